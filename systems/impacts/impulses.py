"""What an impact does to its bodies: a bounce; beyond the cap of impacts, sticking together, or standing still.

A body's path within the step is x(t) = origin + p1 t + p2 t^2 + p3 t^3. An impact at time t changes the velocity by
dv; the path becomes the one of a body that has travelled with dv all along and stood at origin - dv t at the start, so
one polynomial always describes what is left of the step.
"""

from __future__ import annotations

import math

from ...framework.compilation import inlined, part
from ...framework.vectors import add, add_scaled, length, replace, row, scale, store, sub
from ..ccd.search_bounds import FAST
from ..integration.trajectory import along, along_rate

# Added to a body's impacts: the solver for contacts at rest is to leave it alone in this step; it moves no more in it.
ASIDE, STOPPED = 1 << 40, 1 << 41
STUCK = 1 << 30  # in the impacts that the cap counts: no cap is that high, so whoever has stuck once goes on to stick

# places in ``counts``: events waiting, impacts logged, impacts cut off by the cap, pairs that crossed, the pair of the
# event now, or who is to be looked at instead, and the first body of the cluster that has just grown
WAITING, LOGGED, CAPPED, CROSSED, LAST, CLUSTER = range(6)
NOW, UNTIL = range(2)  # places in ``clock``
# kinds of events: an impact, one that no cap counts, two beyond the cap, a crossing of what does not push
BOUNCE, FREE, STICK, STOP, CROSS = range(5)


@inlined
def deflect(i, dv, now, dt, half_kick, position, velocity, start_velocity, damping, motion, like):
    """Give a body its change of velocity, and the rest of the step with it.

    half_kick: whether damping acts at the end of the step, for half of it. Else it acts all the time, and the velocity
    of a straight path is that of the end already.
    """
    origin, path = motion[0], motion[1]
    store(start_velocity, i, add(row(start_velocity, i, like), dv))
    store(origin, i, add_scaled(row(origin, i, like), dv, -now))
    store(path, i, add(row(path, i, like), dv))
    store(position, i, add_scaled(row(position, i, like), dv, dt - now))
    fading = damping[i] * (0.5 * dt if half_kick else (dt - now if motion[4] > 1 else 0.0))
    store(velocity, i, add_scaled(row(velocity, i, like), dv, math.exp(-fading) if fading > 0.0 else 1.0))


@inlined
def log_impact(event, c, impulse, event_values, log_pair, log_value, counts, like):
    """Note its time, impulse, normal and point."""
    logged = counts[LOGGED]
    log_pair[logged] = c
    for k in range(2 + 2 * len(like)):
        log_value[logged, k] = event_values[event, k]
    log_value[logged, 1] = impulse
    counts[LOGGED] += 1


@inlined
def bounce(
    event, dt, half_kick, pair_a, pair_b, position, velocity, start_velocity, inverse_mass, damping, motion, struck,
    spent, pair_impulse, pair_normal, pair_point, pair_depth, events, event_values, log_pair, log_value, counts, like,
):  # fmt: skip
    """One impact: both bodies get their impulse now, and the rest of the step with the new velocities."""
    c = events[event, 0]
    a, b = pair_a[c], pair_b[c]
    now = event_values[event, 0]
    mass = 1.0 / (inverse_mass[a] + inverse_mass[b])
    impulse = event_values[event, 1] * mass
    change = like  # of the bodies' relative velocity, with what friction adds to it
    for k in range(len(like)):
        normal = event_values[event, 2 + k]
        change = replace(change, k, event_values[event, 1] * normal + event_values[event, 2 + 2 * len(like) + k])
        pair_normal[c, k] = normal
        pair_point[c, k] = event_values[event, 2 + len(like) + k]
    for side in range(2):
        i = a if side == 0 else b
        if inverse_mass[i] > 0.0:  # what cannot be moved is as it was: its other impacts stand, and no cap is on it
            struck[i] += 1
            spent[i] += 1 if events[event, 3] == BOUNCE else 0
            dv = scale(change, (-mass if side == 0 else mass) * inverse_mass[i])
            deflect(i, dv, now, dt, half_kick, position, velocity, start_velocity, damping, motion, like)
    pair_impulse[c] += impulse
    pair_depth[c] = 0.0
    log_impact(event, c, impulse, event_values, log_pair, log_value, counts, like)


@part
def stick(
    event, dt, half_kick, pair_a, pair_b, position, velocity, start_velocity, inverse_mass, damping, motion, struck,
    spent, clusters, pair_impulse, pair_normal, pair_point, pair_depth, events, event_values, log_pair, log_value,
    counts, like,
):  # fmt: skip
    """Beyond the cap what loses energy sticks together until the step ends: a plastic impact of two clusters.

    clusters: root, next member, last member (n,) of each body's cluster, and the inverse mass of that (n,), by its
    root; 0 once it sticks to something that cannot be moved. Returns the root of the one that has grown.
    """
    root, following, tail, lightness = clusters
    c = events[event, 0]
    a, b = root[pair_a[c]], root[pair_b[c]]
    impulse = event_values[event, 1] / (lightness[a] + lightness[b])
    normal = like
    for k in range(len(like)):
        normal = replace(normal, k, event_values[event, 2 + k])
        pair_normal[c, k] = event_values[event, 2 + k]
        pair_point[c, k] = event_values[event, 2 + len(like) + k]
    for side in range(2):
        i = a if side == 0 else b
        dv = scale(normal, (-impulse if side == 0 else impulse) * lightness[i])
        while i >= 0:
            if inverse_mass[i] > 0.0:
                struck[i] += 1
                spent[i] |= STUCK
                deflect(
                    i, dv, event_values[event, 0], dt, half_kick, position, velocity, start_velocity, damping, motion,
                    like,
                )  # fmt: skip
            i = following[i]
    pair_impulse[c] += impulse
    pair_depth[c] = 0.0
    log_impact(event, c, impulse, event_values, log_pair, log_value, counts, like)
    counts[CAPPED] += 1
    if inverse_mass[pair_a[c]] == 0.0 or inverse_mass[pair_b[c]] == 0.0:  # that is in no cluster: others touch it too
        held = b if inverse_mass[pair_a[c]] == 0.0 else a
        lightness[held] = 0.0
        return held
    heavy = lightness[a] == 0.0 or lightness[b] == 0.0
    lightness[a] = 0.0 if heavy else 1.0 / (1.0 / lightness[a] + 1.0 / lightness[b])
    following[tail[a]] = b
    tail[a] = tail[b]
    i = b
    while i >= 0:
        root[i] = a
        i = following[i]
    return a


@inlined
def is_thrown(i, start, size, origin, like):
    """Whether blows have changed a body's way so much that it seems to come from far off its start.

    The solver for contacts at rest moves bodies from there, and knows their contacts where they are.
    """
    away = sub(row(origin, i, like), row(start, i, like))
    return length(away) > FAST * size[i]


@inlined
def stop(i, now, position, velocity, motion, struck, spent, like):
    """Beyond the cap a fast body stays where it is until the step ends, and keeps its velocity."""
    origin, path, second, third, degree = motion
    x2, x3 = like, like
    if degree > 1:
        x2, x3 = row(second, i, like), row(third, i, like)
    at = along(now, row(origin, i, like), row(path, i, like), x2, x3)
    store(velocity, i, along_rate(now, row(path, i, like), x2, x3))
    store(position, i, at)
    store(origin, i, at)
    store(path, i, like)
    if degree > 1:
        store(second, i, like)
        store(third, i, like)
    struck[i] += STOPPED
    spent[i] += STOPPED
