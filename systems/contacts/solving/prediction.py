"""What bodies at rest will do in this step, before anything is known about it: the contacts that held them still push.

Free flight lets a resting body fall by g dt. For a ball that bounces on such a body the ground would give way. So the
impulses of the last step act on the prediction once more; where they push bodies apart they are taken back, so that a
shock is not repeated, and they never pull.
"""

from __future__ import annotations

from ....framework.compilation import packed, part
from ....framework.vectors import add_scaled, dot, scale, sub
from ...codes import NEED_COLUMNS, OK
from ..constants import MOST_PREDICTION_PASSES, PREDICTION_PASSES, PREDICTION_STEADY
from .warm_start import find_rows, scale_to


@part
def mark_disabled(state):
    """work[m] = 0 for what is remembered of pairs whose contact a system has disabled, else 1. Both lists are in
    canonical order."""
    memory, pairs, entity = state.warm_start, state.pairs, state.bodies.entity
    now, m = memory.now, 0
    for k in range(memory.counts[now]):
        memory.share[k], memory.off[k], memory.going[k] = 1.0, False, True
    for q in range(pairs.disabled_count):
        c = pairs.disabled[q]
        a, b = entity[pairs.a[c]], entity[pairs.b[c]]
        while m < memory.counts[now] and (
            memory.entity_a[now, m] < a or (memory.entity_a[now, m] == a and memory.entity_b[now, m] < b)
        ):
            m += 1
        if m < memory.counts[now] and memory.entity_a[now, m] == a and memory.entity_b[now, m] == b:
            memory.share[m], memory.off[m] = 0.0, True


@part
def apply_remembered(state):
    """The impulses of the last step act on the velocities, with their friction; work[m] is how much of each acts."""
    memory, bodies, now = state.warm_start, state.bodies, state.warm_start.now
    velocity, inverse_mass, share = bodies.linear_velocity, bodies.inverse_mass, memory.share
    for i in range(state.moving):
        bodies.support_change[i] = velocity[i]  # of all, so that no branch asks which are supported
    for m in range(memory.counts[now]):
        a, b = memory.first[now, m], memory.second[now, m]
        if a < 0 or b < 0:
            share[m], memory.off[m] = 0.0, True
        if memory.off[m]:
            continue
        push, w_a, w_b = memory.push[now, m], inverse_mass[a], inverse_mass[b]
        if w_a > 0.0:  # storing what stays as it is would make contacts with one floor wait for each other
            bodies.supported[a], velocity[a] = True, add_scaled(velocity[a], push, -w_a)
        if w_b > 0.0:
            bodies.supported[b], velocity[b] = True, add_scaled(velocity[b], push, w_b)


@part
def relax_remembered(state):
    """Each impulse acts as much as takes the most energy, never more than all of it, nor against itself; returns
    whether some share has changed. Where none does, all together take energy: it falls along the whole way to them."""
    memory, bodies, now, any_change = state.warm_start, state.bodies, state.warm_start.now, False
    velocity, inverse_mass, share = bodies.linear_velocity, bodies.inverse_mass, memory.share
    for m in range(memory.counts[now]):
        if memory.off[m] or not memory.going[memory.group[now, m]]:
            continue
        a, b = memory.first[now, m], memory.second[now, m]
        push, old = memory.push[now, m], share[m]
        gain = dot(push, sub(velocity[b], velocity[a]))
        whole = dot(push, push) * (inverse_mass[a] + inverse_mass[b])  # what all of it changes of the gain
        least = PREDICTION_STEADY * whole
        if not (gain <= least and (old == 1.0 or gain >= -least)):
            new = min(1.0, max(0.0, old - gain / whole))
            any_change |= new != old
            change, share[m] = new - old, new
            velocity[a] = add_scaled(velocity[a], push, -change * inverse_mass[a])
            velocity[b] = add_scaled(velocity[b], push, change * inverse_mass[b])
    return any_change


@part
def velocity_without(bodies, i):
    """The velocity of body i without the remembered impulses."""
    return bodies.support_change[i] if bodies.supported[i] else bodies.linear_velocity[i]


@part
def weigh_islands(state):
    """What the contacts of each island do to its energy: slope and curvature, see guard.weigh; returns
    whether some give any."""
    memory, bodies, now, gives = state.warm_start, state.bodies, state.warm_start.now, False
    velocity, share, slope, curvature = bodies.linear_velocity, memory.share, memory.slope, memory.curvature
    for m in range(memory.counts[now]):
        slope[m] = curvature[m] = 0.0
    for m in range(memory.counts[now]):
        if share[m] > 0.0:
            a, b, i = memory.first[now, m], memory.second[now, m], memory.group[now, m]
            push = scale(memory.push[now, m], share[m])
            before = sub(velocity_without(bodies, b), velocity_without(bodies, a))
            slope[i] += dot(push, before)
            curvature[i] += dot(push, sub(sub(velocity[b], velocity[a]), before))
    for m in range(memory.counts[now]):
        memory.going[m] = slope[m] + 0.5 * curvature[m] > 0.0  # each island has the passes that it needs, no more
        gives |= memory.going[m]
    return gives


@part
def keep_energy(state):
    """Where the contacts of an island still give energy, all of them act by the share that takes the most."""
    memory, bodies, now = state.warm_start, state.bodies, state.warm_start.now
    velocity, inverse_mass, share, slope = bodies.linear_velocity, bodies.inverse_mass, memory.share, memory.slope
    for m in range(memory.counts[now]):
        i = memory.group[now, m]
        if share[m] > 0.0 and slope[i] + 0.5 * memory.curvature[i] > 0.0:
            a, b = memory.first[now, m], memory.second[now, m]
            most = -slope[i] / memory.curvature[i] if memory.curvature[i] > 0.0 else 0.0  # else of rounding alone
            back = share[m] * (1.0 - min(1.0, max(0.0, most)))
            push = memory.push[now, m]
            velocity[a] = add_scaled(velocity[a], push, back * inverse_mass[a])
            velocity[b] = add_scaled(velocity[b], push, -back * inverse_mass[b])


@part
def forget_support(state):
    """Nothing is supported yet; what cannot move never is, but other rows may have been there."""
    supported = state.bodies.supported
    if len(supported) > 0:
        for i in range(state.moving if state.support_version == state.version else state.count):
            supported[i] = False
        state.support_version = state.version


@packed
def predict_rest(state, dt):
    """Correct velocity, position and path of the bodies that were held in the last step.

    The impulses act like a force throughout the step, which displaces by ``force_travels`` times dt times the change of
    velocity: what the integrator makes of a force.
    """
    bodies, memory = state.bodies, state.warm_start
    state.any_support = False
    forget_support(state)
    if state.response_idle or memory.counts[memory.now] == 0:
        return OK
    if len(bodies.support_change) == 0 or len(bodies.place) == 0:
        return NEED_COLUMNS
    scale_to(state, dt)
    find_rows(state)
    state.any_support = True
    state.force_travels = 0.5 if state.path_degree > 1 else (0.0 if state.moves_with_old_velocity else 1.0)
    mark_disabled(state)
    apply_remembered(state)
    turn, gives = 0, True
    while gives and turn < MOST_PREDICTION_PASSES:
        gives = relax_remembered(state)
        turn += 1
        if gives and turn >= PREDICTION_PASSES:
            gives = weigh_islands(state)
    if gives:
        keep_energy(state)
    travels = state.force_travels
    for i in range(state.moving):
        if bodies.supported[i]:
            dv = sub(bodies.linear_velocity[i], bodies.support_change[i])
            bodies.support_change[i] = dv
            bodies.position[i] = add_scaled(bodies.position[i], dv, travels * dt)
            if state.path_degree > 1:
                bodies.path_second[i] = add_scaled(bodies.path_second[i], dv, travels / dt)
            else:
                bodies.path_velocity[i] = add_scaled(bodies.path_velocity[i], dv, travels)
    return OK


@part
def drop_support(state, dt):
    """Bodies that no contact has pushed after all fly as the integrator said. What has had an impact stays on the path
    that this has given it: beside it there may be a wall."""
    bodies, travels = state.bodies, state.force_travels
    for i in range(state.moving):
        if bodies.supported[i] and not bodies.held[i]:
            dv = bodies.support_change[i]
            if bodies.impact_count[i] == 0:
                bodies.position[i] = add_scaled(bodies.position[i], dv, -travels * dt)
            bodies.linear_velocity[i] = sub(bodies.linear_velocity[i], dv)
