"""Impacts: bounces at their time on the path, in order of time, each followed by a new look at both bodies.

A body's path within the step is x(t) = origin + p1 t + p2 t^2 + p3 t^3. An impact at time t changes the velocity by
dv; the path becomes the one of a body that has travelled with dv all along and stood at origin - dv t at the start, so
one polynomial always describes what is left of the step.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..framework.compilation import inlined, kernel
from ..framework.vectors import add, add_scaled, divided, dot, length, negative, row, scale, store, sub

AVERAGE, GEOMETRIC_MEAN, MAX, MIN, MULTIPLY = range(5)  # in the order of framework.settings.MIXING_RULES

TIME_ITERATIONS = 80
NEVER = 2.0  # of the step: no impact in it


@inlined
def mix(rule, a, b):
    """The contact's value from those of its two bodies."""
    if rule == MAX:
        return max(a, b)
    if rule == AVERAGE:
        return 0.5 * (a + b)
    if rule == GEOMETRIC_MEAN:
        return np.sqrt(a * b)
    if rule == MIN:
        return min(a, b)
    return a * b


@inlined
def path_position(i, t, origin, path, second, third, degree, like):
    """Where body i is at time t of the step."""
    x = add_scaled(row(origin, i, like), row(path, i, like), t)
    if degree > 1:
        x = add_scaled(x, add_scaled(row(second, i, like), row(third, i, like), t), t * t)
    return x


@inlined
def path_velocity(i, t, path, second, third, degree, like):
    """How fast body i moves at time t of the step."""
    v = row(path, i, like)
    if degree > 1:
        v = add_scaled(v, add_scaled(scale(row(second, i, like), 2.0), row(third, i, like), 3.0 * t), t)
    return v


@inlined
def earlier(i, j, times, keys):
    """Order of events: time, then the pair's place in the canonical order."""
    return times[i] < times[j] or (times[i] == times[j] and keys[i] < keys[j])


@kernel
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


@kernel
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


def make_impact_kernel(evaluate: Any) -> Callable[..., Any]:
    """The event loop over the shapes of a scene."""

    @kernel
    def pair_at(a, b, t, shape_of, offset, shapes, motion, like):
        """The pair's geometry at time t of the step."""
        origin, path, second, third, degree = motion
        centre = add(path_position(a, t, origin, path, second, third, degree, like), row(offset, a, like))
        other = add(path_position(b, t, origin, path, second, third, degree, like), row(offset, b, like))
        hit, depth, normal, point = evaluate(shape_of[a], a, shape_of[b], b, sub(other, centre), shapes, like)
        return hit, depth, normal, add(centre, point)

    @kernel
    def entry_time(a, b, since, dt, shape_of, offset, shapes, motion, like):
        """When the pair begins to touch, between ``since`` and dt, at whose end it does; ``since`` if it does already.

        A bracketing secant (Illinois) on the separation, which halves the bracket whenever that does not.
        """
        hit, depth, _, _ = pair_at(a, b, since, shape_of, offset, shapes, motion, like)
        if hit:
            return since
        low, high, at_low = since, dt, depth
        _, at_high, _, _ = pair_at(a, b, dt, shape_of, offset, shapes, motion, like)
        side = 0
        for iteration in range(TIME_ITERATIONS):
            middle = 0.5 * (low + high)
            if at_low < 0.0 < at_high and iteration % 8 != 7:
                secant = high - (high - low) * (at_high / (at_high - at_low))
                if low < secant < high:
                    middle = secant
            if not low < middle < high:
                break
            hit, depth, _, _ = pair_at(a, b, middle, shape_of, offset, shapes, motion, like)
            if hit:
                high, at_high = middle, depth
                if depth == 0.0:
                    break
                at_low = 0.5 * at_low if side == 1 else at_low
                side = 1
            else:
                low, at_low = middle, depth
                at_high = 0.5 * at_high if side == -1 else at_high
                side = -1
        return high

    @kernel
    def approach(a, b, t, shape_of, offset, shapes, motion, like):
        """Speed of separation along the normal at time t (negative: approach), depth, normal, point, and whether the
        centres coincide.
        """
        origin, path, second, third, degree = motion
        _, depth, normal, point = pair_at(a, b, t, shape_of, offset, shapes, motion, like)
        w = sub(
            path_velocity(b, t, path, second, third, degree, like),
            path_velocity(a, t, path, second, third, degree, like),
        )
        centre = add(path_position(a, t, origin, path, second, third, degree, like), row(offset, a, like))
        other = add(path_position(b, t, origin, path, second, third, degree, like), row(offset, b, like))
        apart = sub(other, centre)
        coincident = True
        for k in range(len(like)):
            coincident = coincident and apart[k] == 0.0
        if coincident and length(w) > 0.0:  # no direction between the centres: they part the way they came
            normal = divided(negative(w), length(w))
        return dot(w, normal), depth, normal, point, coincident

    @kernel
    def resolve_impacts(
        dt, pair_a, pair_b, pairs, responds, hits, found, rank, shape_of, offset, shapes, position, velocity,
        start_velocity, inverse_mass, motion, restitution, slots, rule, fixed_threshold, cap, share, struck, pair_impulse,
        pair_normal, pair_point, pair_depth, pair_times, counters, like,
    ):  # fmt: skip
        """Bounce every pair that overlaps at the end of its motion and approaches faster than the threshold.

        share (n,): see gravity_share. struck (n,): impacts per body. pair_*: per pair, the impulse summed and the last impact's geometry and time.
        Returns the log of impacts: pair, time, impulse, normal, point; counters[0] impacts, [1] cut off by the cap.
        """
        origin, path, second, third, degree = motion
        capacity = 2 * found + 16
        times, keys = np.empty(capacity), np.empty(capacity, np.int64)
        event_pair = np.empty(capacity, np.int64)
        stamps = np.empty((capacity, 2), np.int64)
        heap = np.empty(capacity, np.int64)
        events, size = 0, 0
        log_pair, log_value = np.empty(found + 16, np.int64), np.empty((found + 16, 2 + 2 * len(like)))
        logged = 0
        offsets, neighbours = np.empty(0, np.int64), np.empty(0, np.int64)
        # What is looked at next: first every contact, later the pairs of the two bodies just struck.
        queue = hits[:found].astype(np.int64)
        now = 0.0
        while True:
            for q in range(len(queue)):
                c = queue[q]
                if not responds[c]:
                    continue
                a, b = pair_a[c], pair_b[c]
                e = mix(rule, restitution[slots[shape_of[a]], a], restitution[slots[shape_of[b]], b])
                if e <= 0.0:
                    continue
                if now > 0.0 or logged > 0:
                    hit, _, _, _ = pair_at(a, b, dt, shape_of, offset, shapes, motion, like)
                    if not hit:
                        continue
                t = entry_time(a, b, now, dt, shape_of, offset, shapes, motion, like)
                speed, _, _, _, coincident = approach(a, b, t, shape_of, offset, shapes, motion, like)
                if coincident and pair_impulse[c] > 0.0:  # it has parted already
                    continue
                threshold = fixed_threshold
                if threshold < 0.0:
                    threshold = 2.0 * max(
                        gravity_share(a, share, velocity, start_velocity, like),
                        gravity_share(b, share, velocity, start_velocity, like),
                    )
                if not speed < -threshold:
                    continue
                if struck[a] >= cap or struck[b] >= cap:
                    counters[1] += 1
                    continue
                if events == capacity:
                    capacity *= 2
                    times, keys = grown(times, capacity), grown(keys, capacity)
                    event_pair, heap = grown(event_pair, capacity), grown(heap, capacity)
                    larger = np.empty((capacity, 2), np.int64)
                    larger[:events] = stamps[:events]
                    stamps = larger
                times[events], event_pair[events] = t, c
                keys[events] = rank[a] * len(rank) + rank[b]
                stamps[events, 0], stamps[events, 1] = struck[a], struck[b]
                size = heap_push(heap, size, events, times, keys)
                events += 1
            chosen = -1
            while size > 0:
                size = heap_pop(heap, size, times, keys)
                event = heap[size]
                c = event_pair[event]
                if stamps[event, 0] == struck[pair_a[c]] and stamps[event, 1] == struck[pair_b[c]]:
                    chosen = event
                    break
            if chosen < 0:
                break
            now, c = times[chosen], event_pair[chosen]
            a, b = pair_a[c], pair_b[c]
            speed, depth, normal, point, _ = approach(a, b, now, shape_of, offset, shapes, motion, like)
            e = mix(rule, restitution[slots[shape_of[a]], a], restitution[slots[shape_of[b]], b])
            impulse = -(1.0 + e) * speed / (inverse_mass[a] + inverse_mass[b])
            for side in range(2):
                i = a if side == 0 else b
                dv = scale(normal, (-impulse if side == 0 else impulse) * inverse_mass[i])
                struck[i] += 1
                if inverse_mass[i] > 0.0:
                    store(origin, i, add_scaled(row(origin, i, like), dv, -now))
                    store(path, i, add(row(path, i, like), dv))
                    store(position, i, add_scaled(row(position, i, like), dv, dt - now))
                    store(velocity, i, add(row(velocity, i, like), dv))
            pair_impulse[c] += impulse
            pair_depth[c] = depth
            pair_times[c] = now
            store(pair_normal, c, normal)
            store(pair_point, c, point)
            if logged == len(log_pair):
                log_pair = grown(log_pair, 2 * logged)
                larger_value = np.empty((2 * logged, log_value.shape[1]))
                larger_value[:logged] = log_value
                log_value = larger_value
            log_pair[logged] = c
            log_value[logged, 0], log_value[logged, 1] = now, impulse
            for k in range(len(like)):
                log_value[logged, 2 + k], log_value[logged, 2 + len(like) + k] = normal[k], point[k]
            logged += 1
            if len(offsets) == 0:
                offsets, neighbours = pairs_of_bodies(pair_a, pair_b, pairs, len(struck))
            queue = join(neighbours, offsets[a], offsets[a + 1], offsets[b], offsets[b + 1])
        counters[0] += logged
        return log_pair[:logged], log_value[:logged]

    return resolve_impacts


@inlined
def gravity_share(i, share, velocity, start_velocity, like):
    """What forces change of a body's speed in one step; computed when first asked for (-1 before), before any impact."""
    if share[i] < 0.0:
        share[i] = length(sub(row(velocity, i, like), row(start_velocity, i, like)))
    return share[i]


@inlined
def grown(array, capacity):
    larger = np.empty(capacity, array.dtype)
    larger[: len(array)] = array
    return larger


@kernel
def join(neighbours, first, first_stop, second, second_stop):
    """Two stretches of a list, one after the other."""
    result = np.empty(first_stop - first + second_stop - second, np.int64)
    result[: first_stop - first] = neighbours[first:first_stop]
    result[first_stop - first :] = neighbours[second:second_stop]
    return result


@kernel
def pairs_of_bodies(pair_a, pair_b, pairs, bodies):
    """The pairs of each body: those of row i are neighbours[offsets[i]:offsets[i + 1]], ascending."""
    offsets = np.zeros(bodies + 2, np.int64)
    for c in range(pairs):
        offsets[pair_a[c] + 2] += 1
        offsets[pair_b[c] + 2] += 1
    for i in range(2, bodies + 2):
        offsets[i] += offsets[i - 1]
    neighbours = np.empty(2 * pairs, np.int64)
    for c in range(pairs):
        neighbours[offsets[pair_a[c] + 1]] = c
        offsets[pair_a[c] + 1] += 1
        neighbours[offsets[pair_b[c] + 1]] = c
        offsets[pair_b[c] + 1] += 1
    return offsets, neighbours
