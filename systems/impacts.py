"""Impacts: bounces at their time on the path, in order of time, each followed by a new look at both bodies.

A body's path within the step is x(t) = origin + p1 t + p2 t^2 + p3 t^3. An impact at time t changes the velocity by
dv; the path becomes the one of a body that has travelled with dv all along and stood at origin - dv t at the start, so
one polynomial always describes what is left of the step.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..framework.compilation import inlined, kernel, part
from ..framework.vectors import add, add_scaled, divided, dot, item, length, negative, replace, row, scale, store, sub
from .mixing import mix_friction

TIME_ITERATIONS = 80
ROUNDING = 4e-16  # of the distance between the centres: a separation smaller than that is none

# places in ``counts``: events made, events waiting, impacts logged, impacts cut off by the cap, the event now, its pair
EVENTS, WAITING, LOGGED, CAPPED, CURRENT, LAST = range(6)


@inlined
def along(t, x0, x1, x2, x3):
    """x0 + x1 t + x2 t^2 + x3 t^3."""
    return add_scaled(x0, add_scaled(x1, add_scaled(x2, x3, t), t), t)


@inlined
def along_rate(t, x1, x2, x3):
    """The derivative of :func:`along`."""
    return add_scaled(x1, add_scaled(scale(x2, 2.0), x3, 3.0 * t), t)


@inlined
def earlier(i, j, times, keys):
    """Order of events: time, then the pair's place in the canonical order."""
    return times[i] < times[j] or (times[i] == times[j] and keys[i] < keys[j])


@part
def heap_push(heap, size, event, times, keys):
    """Add an event to the binary heap; returns the new size."""
    heap[size] = event
    child = size
    while child > 0:
        parent = (child - 1) // 2
        if not earlier(heap[child], heap[parent], times, keys):
            break
        heap[child], heap[parent] = heap[parent], heap[child]
        child = parent
    return size + 1


@part
def heap_pop(heap, size, times, keys):
    """Take the earliest event off the top (it is heap[size - 1] afterwards); returns the new size."""
    size -= 1
    heap[0], heap[size] = heap[size], heap[0]
    parent = 0
    while True:
        child = 2 * parent + 1
        if child >= size:
            return size
        if child + 1 < size and earlier(heap[child + 1], heap[child], times, keys):
            child += 1
        if not earlier(heap[child], heap[parent], times, keys):
            return size
        heap[child], heap[parent] = heap[parent], heap[child]
        parent = child


@inlined
def bounce(
    event, dt, pair_a, pair_b, position, velocity, start_velocity, inverse_mass, origin, path, struck, pair_impulse,
    pair_normal, pair_point, pair_depth, events, event_values, log_pair, log_value, counts, like,
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
        dv = scale(change, (-mass if side == 0 else mass) * inverse_mass[i])
        if inverse_mass[i] > 0.0:  # what cannot be moved is as it was: its other impacts stand, and no cap is on it
            struck[i] += 1
            store(start_velocity, i, add(row(start_velocity, i, like), dv))
            store(origin, i, add_scaled(row(origin, i, like), dv, -now))
            store(path, i, add(row(path, i, like), dv))
            store(position, i, add_scaled(row(position, i, like), dv, dt - now))
            store(velocity, i, add(row(velocity, i, like), dv))
    pair_impulse[c] += impulse
    pair_depth[c] = 0.0
    logged = counts[LOGGED]
    log_pair[logged] = c
    for k in range(2 + 2 * len(like)):
        log_value[logged, k] = event_values[event, k]
    log_value[logged, 1] = impulse
    counts[LOGGED] += 1


@inlined
def link_pairs(pair_a, pair_b, pairs, heads, links):
    """Chain the pairs of each body, ascending: heads[i] is the first of row i, then follows links[it], till -1.

    An entry is twice the pair for its first body, one more for its second.
    """
    for i in range(len(heads)):
        heads[i] = -1
    for c in range(pairs - 1, -1, -1):
        for side in range(2):
            i = pair_a[c] if side == 0 else pair_b[c]
            links[2 * c + side] = heads[i]
            heads[i] = 2 * c + side


def make_impact_kernel(evaluate: Any, corner: Any, mix: Any) -> Callable[..., Any]:
    """The event loop over the shapes of a scene."""

    @inlined
    def consider(
        c, since, dt, pair_a, pair_b, rank, size, shape_of, offset, shapes, velocity, start_velocity, motion,
        restitution, friction, rules, material, limits, share, struck, pair_impulse, events, event_times, event_keys,
        event_values, heap, counts, like,
    ):  # fmt: skip
        """Put the pair's next impact into the queue, if it has one: e > 0, overlap at the end, a fast approach.

        The time is when the pair begins to touch, ``since`` if it does then already. It is found between a time
        apart and one in touch by Newton's method on the separation, whose rate is the speed along the normal; where
        that leads out of the bracket, and every eighth time, the bracket is halved instead.
        """
        origin, path, second, third, degree = motion
        a, b = pair_a[c], pair_b[c]
        shape_a, shape_b = shape_of[a], shape_of[b]
        e = mix(rules[0], restitution[material[a], a], restitution[material[b], b])
        if e <= 0.0:
            return
        low, high, guess = since, dt, dt
        # b's path as a sees it
        x0, x1 = sub(row(origin, b, like), row(origin, a, like)), sub(row(path, b, like), row(path, a, like))
        x0 = add(x0, sub(row(offset, b, like), row(offset, a, like)))
        x2, x3 = like, like
        if degree > 1:
            x2, x3 = sub(row(second, b, like), row(second, a, like)), sub(row(third, b, like), row(third, a, like))
        t, normal, point, apart, end_normal = dt, like, like, like, like
        fixed_threshold, fixed_slop, cap = limits
        slop = slop_of(a, b, size, fixed_slop)
        for look in range(TIME_ITERATIONS):  # one place that calls evaluate: it is what takes time to compile
            middle = dt if look == 0 else since
            if look > 1:
                middle = guess if low < guess < high and look % 8 != 7 else 0.5 * (low + high)
                if not low < middle < high:
                    break
            d = along(middle, x0, x1, x2, x3)
            hit, depth, n, p = evaluate(shape_a, a, shape_b, b, d, shapes, like)
            near = look > 1 and abs(depth) <= ROUNDING * length(d)
            guess = middle + depth / dot(along_rate(middle, x1, x2, x3), n)
            if look == 0 and hit:
                end_normal = n
                if corner(shape_a, a, shape_b, b, d, slop, shapes, like):
                    return
            if hit or near:
                t, normal, point, apart = middle, n, p, d
                if near:
                    break
                high = middle
                if look == 1:
                    break
            elif look == 0:
                return
            else:
                low = middle
        w = along_rate(t, x1, x2, x3)
        if dot(apart, apart) == 0.0 and length(apart) == 0.0 and length(w) > 0.0:
            if pair_impulse[c] > 0.0:  # it has parted already
                return
            normal = divided(negative(w), length(w))  # no direction between the centres: they part the way they came
        elif corner(shape_a, a, shape_b, b, apart, slop, shapes, like):
            normal = end_normal  # it slides from one thing onto the next: the edges are in nobody's way
        speed = dot(w, normal)
        threshold = fixed_threshold
        if threshold < 0.0:
            threshold = 2.0 * max(share[a], share[b])
        if not speed < -threshold:
            return
        if degree == 1 and e != 1.0:
            # A straight path has the flight's velocity in its middle only. With that of another time a bounce gains
            # or loses, and a ball that always meets the floor at the same phase of a step hops for ever. Elastic
            # pairs do reflect the path: their flight then runs backwards exactly, and nothing drifts.
            bend_a = sub(row(velocity, a, like), row(start_velocity, a, like))
            bend_b = sub(row(velocity, b, like), row(start_velocity, b, like))
            speed = min(0.0, speed + dot(sub(bend_b, bend_a), normal) * (t / dt - 0.5))
        if struck[a] >= cap or struck[b] >= cap:
            counts[CAPPED] += 1
            return
        pull = scale(like, 0.0)
        mu = mix_friction(mix, rules[1], friction[material[a], a], friction[material[b], b])
        if mu > 0.0:  # Coulomb: stops what slides, with at most mu times the normal impulse
            sliding = add_scaled(w, normal, -dot(w, normal))
            fast = length(sliding)
            if fast > 0.0:
                pull = scale(sliding, -min(1.0, -mu * (1.0 + e) * speed / fast))
        centre = add(add_scaled(row(origin, a, like), row(path, a, like), t), row(offset, a, like))
        if degree > 1:
            centre = add_scaled(centre, add_scaled(row(second, a, like), row(third, a, like), t), t * t)
        point = add(centre, point)
        event = counts[EVENTS]
        events[event, 0], events[event, 1], events[event, 2] = c, struck[a], struck[b]
        event_times[event], event_keys[event] = t, rank[a] * len(rank) + rank[b]
        event_values[event, 0], event_values[event, 1] = t, -(1.0 + e) * speed
        for k in range(len(like)):
            event_values[event, 2 + k] = item(normal, k)
            event_values[event, 2 + len(like) + k] = item(point, k)
            event_values[event, 2 + 2 * len(like) + k] = item(pull, k)
        counts[WAITING] = heap_push(heap, counts[WAITING], event, event_times, event_keys)
        counts[EVENTS] += 1

    @kernel
    def resolve_impacts(
        dt, pair_a, pair_b, pairs, responds, hits, supported, heads, links, looks, rank, size, shape_of, offset, shapes,
        position, velocity, start_velocity, inverse_mass, motion, restitution, friction, rules, material, limits, share,
        struck, pair_impulse, pair_normal, pair_point, pair_depth, events, event_times, event_keys, event_values,
        heap, log_pair, log_value, counts, like,
    ):  # fmt: skip
        """Bounce every pair that overlaps at the end of its motion and approaches faster than the threshold.

        hits: pairs that may have met; so may every pair of a body that is ``supported`` (n,). heads (n,), links
        (2 pairs,), looks (pairs + 1,): room, see link_pairs.
        restitution, friction: per slot and row, material: whose slot counts; rules: how two become one. limits: the
        threshold and the slop (below 0: from the bodies), the most impacts of a body.
        share (n,): see reach. struck (n,): impacts per dynamic body. pair_*: per pair, the impulse summed and
        the last impact's geometry and time. log_*: pair; time, impulse, normal, point of every impact. counts: see
        EVENTS.
        Returns False if the queue or the log may not suffice: call again with larger ones to go on.
        """
        linked = False
        while True:
            # What is looked at: at first what may have met, later the pairs of the two bodies just struck.
            c = counts[LAST]
            wanted = 0
            if c < 0:
                for p in range(pairs):
                    if supported[pair_a[p]] or supported[pair_b[p]]:
                        looks[wanted] = p
                        wanted += 1
                for h in range(len(hits)):
                    if not (supported[pair_a[hits[h]]] or supported[pair_b[hits[h]]]):
                        looks[wanted] = hits[h]
                        wanted += 1
            else:
                if not linked:
                    link_pairs(pair_a, pair_b, pairs, heads, links)
                    linked = True
                for side in range(2):
                    i = pair_a[c] if side == 0 else pair_b[c]
                    entry = heads[i] if inverse_mass[i] > 0.0 else -1
                    while entry >= 0:
                        looks[wanted] = entry // 2
                        wanted += 1
                        entry = links[entry]
            if counts[EVENTS] + wanted > len(heap) or counts[LOGGED] == len(log_pair):
                return False
            for q in range(wanted):
                p = looks[q]
                if responds[p]:
                    since = event_times[counts[CURRENT]] if c >= 0 else 0.0
                    consider(
                        p, since, dt, pair_a, pair_b, rank, size, shape_of, offset, shapes, velocity, start_velocity,
                        motion, restitution, friction, rules, material, limits, share, struck, pair_impulse, events,
                        event_times, event_keys, event_values, heap, counts, like,
                    )  # fmt: skip
            chosen = -1
            while counts[WAITING] > 0 and chosen < 0:
                counts[WAITING] = heap_pop(heap, counts[WAITING], event_times, event_keys)
                event = heap[counts[WAITING]]
                p = events[event, 0]
                if events[event, 1] == struck[pair_a[p]] and events[event, 2] == struck[pair_b[p]]:
                    chosen = event
            if chosen < 0:
                return True
            counts[CURRENT], counts[LAST] = chosen, events[chosen, 0]
            bounce(
                chosen, dt, pair_a, pair_b, position, velocity, start_velocity, inverse_mass, motion[0], motion[1],
                struck, pair_impulse, pair_normal, pair_point, pair_depth, events, event_values, log_pair,
                log_value, counts, like,
            )  # fmt: skip

    return resolve_impacts


SLOP = 0.005  # of the size of the smaller body
MARGIN_STEPS = 2.0


@inlined
def smaller(a, b, size):
    """The size of the smaller body; a point takes that of the other."""
    one, other = size[a], size[b]
    return min(one, other) if one > 0.0 and other > 0.0 else max(one, other)


@inlined
def slop_of(a, b, size, fixed):
    """Metres that are nothing to this pair: as the settings say, or from the sizes."""
    return fixed if fixed >= 0.0 else SLOP * smaller(a, b, size)


@inlined
def reach(dt, a, b, share, size, fixed_slop):
    """How near a pair is held before it touches: the slop, and twice the way that forces make in a step from rest.

    share (n,): what forces change of a body's speed in a step.
    """
    return slop_of(a, b, size, fixed_slop) + MARGIN_STEPS * max(share[a], share[b]) * dt
