"""The paths of bodies within a step, x(t) = x0 + x1 t + x2 t^2 + x3 t^3, and when two on such paths may meet.

A path is a tuple (x0, x1, x2, x3) of vectors.
"""

from __future__ import annotations

import math

from ...framework.compilation import inlined, part
from ...framework.jit.records.record_type import zero_of
from ...framework.vectors import add, add_scaled, length, scale, sub

ROUNDING = 4e-16  # of a distance: what is smaller than that is none


@inlined
def along(path, t):
    """The point at time t: x0 + x1 t + x2 t^2 + x3 t^3."""
    x0, x1, x2, x3 = path
    return add_scaled(x0, add_scaled(x1, add_scaled(x2, x3, t), t), t)


@inlined
def rate_along(path, t):
    """The velocity at time t."""
    _, x1, x2, x3 = path
    return add_scaled(x1, add_scaled(scale(x2, 2.0), x3, 3.0 * t), t)


@part
def path_of(state, i):
    """The path of body i; of its position, not of its shape."""
    bodies = state.bodies
    x2, x3 = zero_of(state), zero_of(state)
    if state.path_degree > 1:
        x2, x3 = bodies.path_second[i], bodies.path_third[i]
    return bodies.origin[i], bodies.path_velocity[i], x2, x3


@part
def relative_path(state, a, b):
    """The path of b's shape as a's sees it."""
    bodies = state.bodies
    origin, path, offset = bodies.origin, bodies.path_velocity, bodies.offset
    x0, x1 = sub(origin[b], origin[a]), sub(path[b], path[a])
    x0 = add(x0, sub(offset[b], offset[a]))
    x2, x3 = zero_of(state), zero_of(state)
    if state.path_degree > 1:
        x2 = sub(bodies.path_second[b], bodies.path_second[a])
        x3 = sub(bodies.path_third[b], bodies.path_third[a])
    return x0, x1, x2, x3


@part
def centre_at(state, a, t):
    """Where the centre of a's shape is at time t."""
    bodies = state.bodies
    centre = add(add_scaled(bodies.origin[a], bodies.path_velocity[a], t), bodies.offset[a])
    if state.path_degree > 1:
        centre = add_scaled(centre, add_scaled(bodies.path_second[a], bodies.path_third[a], t), t * t)
    return centre


@inlined
def bend_of(x2, x3, span):
    """How far a path leaves the straight line within ``span`` seconds, at most."""
    return (length(x2) + length(x3) * span) * span * span


@inlined
def travel_of(path, span):
    """How far it leads within ``span`` seconds, at most."""
    _, x1, x2, x3 = path
    return length(x1) * span + bend_of(x2, x3, span)


@part
def is_straight(state, a, b, path, span):
    """Whether the relative path of two bodies is a straight line, but for what rounding makes of positions."""
    if state.path_degree == 1:
        return True
    bend = bend_of(path[2], path[3], span)
    origin = state.bodies.origin
    return bend == 0.0 or bend <= ROUNDING * (length(origin[a]) + length(origin[b]))


@part
def first_root(gap, c1, c2, c3, span):
    """A time until which gap + c1 t + c2 t^2 + c3 t^3 stays above 0, gap >= 0: its first root, or earlier if c3 is
    below 0; infinity if there is none within ``span``.

    A falling cubic is replaced by a parabola below it. The quadratic formula in the form without cancellation.
    """
    c2 += min(c3, 0.0) * span
    if c1 > 0.0:
        return (c1 + math.sqrt(c1 * c1 - 4.0 * c2 * gap)) / (-2.0 * c2) if c2 < 0.0 else math.inf
    discriminant = c1 * c1 - 4.0 * c2 * gap
    if discriminant < 0.0:
        return math.inf
    below = math.sqrt(discriminant) - c1
    if below > 0.0:
        return 2.0 * gap / below
    return 0.0 if gap == 0.0 and c2 < 0.0 else math.inf
