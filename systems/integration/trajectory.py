"""The paths of bodies within a step, x(t) = x0 + x1 t + x2 t^2 + x3 t^3, and when two on such paths may meet."""

from __future__ import annotations

import math

from ...framework.compilation import inlined
from ...framework.vectors import add, add_scaled, length, row, scale, sub

ROUNDING = 4e-16  # of a distance: what is smaller than that is none


@inlined
def along(t, x0, x1, x2, x3):
    """x0 + x1 t + x2 t^2 + x3 t^3."""
    return add_scaled(x0, add_scaled(x1, add_scaled(x2, x3, t), t), t)


@inlined
def along_rate(t, x1, x2, x3):
    """The derivative of :func:`along`."""
    return add_scaled(x1, add_scaled(scale(x2, 2.0), x3, 3.0 * t), t)


@inlined
def relative_path(a, b, motion, offset, like):
    """(x0, x1, x2, x3) of b's shape as a's sees it.

    motion: origins, velocities, second and third coefficients (n, d), and the degree of the paths: where that is 1,
    the latter two have no rows.
    """
    origin, path, second, third, degree = motion
    x0, x1 = sub(row(origin, b, like), row(origin, a, like)), sub(row(path, b, like), row(path, a, like))
    x0 = add(x0, sub(row(offset, b, like), row(offset, a, like)))
    x2, x3 = like, like
    if degree > 1:
        x2, x3 = sub(row(second, b, like), row(second, a, like)), sub(row(third, b, like), row(third, a, like))
    return x0, x1, x2, x3


@inlined
def bend_of(x2, x3, span):
    """How far a path leaves the straight line within ``span`` seconds, at most."""
    return (length(x2) + length(x3) * span) * span * span


@inlined
def travel_of(x1, x2, x3, span):
    """How far it leads within ``span`` seconds, at most."""
    return length(x1) * span + bend_of(x2, x3, span)


@inlined
def is_straight(a, b, x2, x3, span, motion, like):
    """Whether a relative path is a straight line, but for what rounding makes of positions."""
    if motion[4] == 1:
        return True
    bend = bend_of(x2, x3, span)
    return bend == 0.0 or bend <= ROUNDING * (length(row(motion[0], a, like)) + length(row(motion[0], b, like)))


@inlined
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
