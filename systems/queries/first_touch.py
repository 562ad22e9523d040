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
from ...framework.vectors import add_scaled, dot, length, scale
from ..integration.trajectory import ROUNDING
from ..shapes.query import evaluate_against, sweep_against
from .candidates import to_collider

CAST_STEPS = 100  # a graze takes about 30; what still approaches after that counts as touching
LAST_STEP = 1e-9  # of the way: the most that rounding is made up for
LONGEST_SPAN = 1e200  # m; on the way past bodies without end
SPAN_RATIO = 1e6  # the way that a sweep is given may be so many times longer than needed

# start: centre of the query's shape; direction: unit vector; inverse: 1 / direction; half: half extents, with room for
# rounding.
Path = collections.namedtuple("Path", "start direction inverse half")


@inlined
def power_above(distance):
    """A power of two that is larger. With such spans a sweep finds the same digits, however long the way is."""
    return math.ldexp(1.0, math.frexp(distance)[1])


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
        for step in range(CAST_STEPS):
            d = add_scaled(away, direction, 0.0 - distance)
            hit, depth, here, point = evaluate_at(state, batch, q, i, d)
            rate = dot(direction, here)
            if step == 0 or rate > 0.0:  # a rounding error too far may reverse the normal
                normal = here
            near = abs(depth) <= ROUNDING * length(d)
            touches = hit or (near and (step > 0 or rate > 0.0))
            further = distance - depth / rate if rate != 0.0 else math.inf
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
        if not leave <= batch.span < SPAN_RATIO * leave:
            batch.span = power_above(min(leave, LONGEST_SPAN))
        span = batch.span
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
