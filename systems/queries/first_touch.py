"""When a moving query shape first touches a body, from the pair functions alone or from the pair's sweep.

While a shape and a body are apart, a plane with the pair's normal lies between them and the gap is at least -depth
wide. So the shape can move until it has closed that gap along the normal; there the pair is evaluated again. For
convex shapes that never steps past a touch, and it converges as Newton's method does (the gap is a convex function of
the way): a box in a few steps exactly, a sphere with the square of the error, a graze by halves. If the shape does not
approach the plane, they never touch. A pair with a sweep returns the time directly; shapes that are not convex need
one.
"""

from __future__ import annotations

import collections
import math
from collections.abc import Callable
from typing import Any

from ...framework.compilation import inlined, part, pasted
from ...framework.elementary import exponent_of, two_to
from ...framework.vectors import add, add_scaled, dot, length, negative, scale, smallest, sub
from ..integration.trajectory import ROUNDING
from ..narrow_phase.one_way import SLACK, front_of, is_from_front, is_one_way
from ..shapes.query import evaluate_against, sweep_against
from .candidates import to_collider

CAST_STEPS = 100  # a graze takes about 30; what still approaches after that counts as touching
LAST_STEP = 1e-9  # of the way: the most that rounding is made up for
BEYOND_ROUNDING = 1e-12  # of a distance: more than all rounding
LONGEST_SPAN = 1e200  # m; on the way past bodies without end
MOST_SHIFTS = 8  # off what is left, before the shape counts as wedged in
LOOK_AHEAD, MOST_STRIDES_AHEAD = 0.2, 1000  # of the size of a shape that is wedged in; at most so many

# start: centre of the query's shape; direction: unit vector; inverse: 1 / direction; half: half extents, with room for
# rounding.
Path = collections.namedtuple("Path", "start direction inverse half")


@inlined
def power_above(distance):
    """A power of two that is larger, so that the digits of a time of a sweep are those of the distance."""
    return two_to(exponent_of(distance)) if distance > 0.0 else 1.0


def make_first_touch(evaluate_at: Callable[..., Any], sweep_at: Callable[..., Any]) -> Any:
    """first_touch(state, batch, q, i, path, leave, reach) of what asks with number q.

    evaluate_at, sweep_at
        (state, batch, q, i, d) -> (hit, depth, normal, point) of what asks and row i, d from its centre to the row's;
        (state, batch, q, i, d, way) -> (known, hit, time) where it moves by ``way``
    """

    @part
    def touch_at(state, batch, q, i, path, away, distance):
        """(normal, point) of the touch at a distance that is known."""
        direction = path.direction
        d = add_scaled(away, direction, 0.0 - distance)
        _, _, normal, point = evaluate_at(state, batch, q, i, d)
        if distance > 0.0 and not dot(direction, normal) > 0.0:  # a rounding error too far may reverse the normal
            before = min(distance, LAST_STEP * length(away))
            d = add_scaled(away, direction, before - distance)
            _, _, other, _ = evaluate_at(state, batch, q, i, d)
            if dot(direction, other) > 0.0:
                normal = other
        return normal, point

    @part
    def search_touch(state, batch, q, i, path, away, reach):
        """(touches, distance, normal, point) by steps along the path; reach: where to give up."""
        direction, distance, touches, normal, point = path.direction, 0.0, False, away, away
        before, past = 0.0, math.inf  # where they are apart, and where they are in each other
        for step in range(CAST_STEPS):
            d = add_scaled(away, direction, 0.0 - distance)
            hit, depth, here, point = evaluate_at(state, batch, q, i, d)
            rate = dot(direction, here)
            if step == 0 or rate > 0.0:  # a rounding error too far may reverse the normal
                normal = here
            near = abs(depth) <= ROUNDING * length(d)
            touches = hit or (near and (step > 0 or rate > 0.0))
            further = distance - depth / rate if rate != 0.0 else math.inf
            if hit and depth > BEYOND_ROUNDING * (length(d) + distance) and distance > before:
                past = distance
            elif not touches:
                before = distance
            if past < math.inf and (not touches or distance == past):
                further = further if before < further < past else 0.5 * (before + past)
                if before < further < past:
                    distance = further
                    continue
                distance, touches = past, True
                break
            if touches or not rate > 0.0:
                if near and step > 0 and abs(further - distance) <= LAST_STEP * distance:
                    distance = further  # what rounding leaves of the gap is a long way at a graze
                break
            if further > reach:
                break
            touches = step == CAST_STEPS - 1
            if not further > distance:
                touches = True
                break
            distance = further
        return touches, distance, normal, point

    @pasted
    def first_touch(state, batch, q, i, path, leave, reach):
        """(touches, distance, normal, point) of query q on its path and row i, whose box it leaves at ``leave``."""
        away = to_collider(state, path.start, i)
        span = power_above(min(leave, LONGEST_SPAN))
        known, touches, time = sweep_at(state, batch, q, i, away, scale(path.direction, span))
        if not known:
            return search_touch(state, batch, q, i, path, away, reach)
        if not touches:
            return False, 0.0, away, away
        normal, point = touch_at(state, batch, q, i, path, away, time * span)
        return True, time * span, normal, point

    return first_touch


@inlined
def evaluate_query(state, batch, q, i, d):
    """Of query q's shape."""
    return evaluate_against(state, batch.query, q, state.bodies.shape[i], i, d)


@inlined
def sweep_query(state, batch, q, i, d, way):
    """The same."""
    return sweep_against(state, batch.query, q, state.bodies.shape[i], i, d, way)


first_touch_of_cast = make_first_touch(evaluate_query, sweep_query)


@part
def is_met(state, batch, q, i, path, distance, normal):
    """Whether a touch counts with row i, which may be solid from one side only: where its front is met, by what does
    not start in it, nor moves away where it starts at it."""
    if not is_one_way(state, i):
        return True
    front = front_of(state, i)
    if not is_from_front(front, negative(normal)):
        return False
    if distance > 0.0:
        return True
    if not dot(front, path.direction) < 0.0:
        return False
    away, extent = to_collider(state, path.start, i), 2.0 * smallest(path.half)
    return evaluate_against(state, batch.query, q, state.bodies.shape[i], i, away)[1] <= SLACK * extent


@inlined
def opposes(path, normal):
    """Whether a body with this normal, from the shape to the body, is in the way; a slope of rounding errors is not."""
    return dot(path.direction, normal) > LAST_STEP


@part
def touch_in_the_way(state, batch, q, i, path, leave, reach, touch):
    """The same for the first touch that opposes the motion; ``touch``: the first of all.

    The path is shifted off what the shape leaves, slides along or grazes, by more than rounding errors and ties. Off a
    convex body it meets that no more; of another one it meets another side.
    """
    start, shape = path.start, state.bodies.shape[i]
    slack = LAST_STEP * length(path.half) + ROUNDING * (length(start) + length(to_collider(state, start, i)))
    for _turn in range(MOST_SHIFTS):
        touches, distance, normal, point = touch
        if not touches:
            return touch
        away = to_collider(state, start, i)
        _, depth, here, _ = evaluate_against(state, batch.query, q, shape, i, away)
        if depth < -slack or opposes(path, here):
            if opposes(path, normal):
                return touches, distance, normal, add(point, sub(start, path.start))
            here = normal
            depth = evaluate_against(
                state, batch.query, q, shape, i, add_scaled(away, path.direction, 0.0 - distance)
            )[1]
        start = add_scaled(start, here, -max(depth, -slack) - 2.0 * slack)
        shifted = Path(start, path.direction, path.inverse, path.half)
        touch = first_touch_of_cast(state, batch, q, i, shifted, leave, reach)
    return touch_of_wedged(state, batch, q, i, path, leave)


@part
def touch_of_wedged(state, batch, q, i, path, reach):
    """The same of a shape between two sides of a body, both of which it touches all the way: by looks in strides, and
    bisection between the first that finds what is in the way and the one before."""
    away, shape, size = to_collider(state, path.start, i), state.bodies.shape[i], 2.0 * smallest(path.half)
    stride = max(LOOK_AHEAD * size, reach / MOST_STRIDES_AHEAD)
    low, high, t, looks, inside, normal, point = 0.0, math.inf, 0.0, 0, 0.0, away, away
    while low < t < high or looks == 0:
        d = add_scaled(away, path.direction, 0.0 - t)
        hit, depth, here, place = evaluate_against(state, batch.query, q, shape, i, d)
        if hit and opposes(path, here):
            high, inside, normal, point = t, depth / dot(path.direction, here), here, place
        else:
            low = t
        looks += 1
        t = 0.5 * (low + high) if high < math.inf else min(looks * stride, reach)
    return high < math.inf, max(high - inside, 0.0), normal, point
