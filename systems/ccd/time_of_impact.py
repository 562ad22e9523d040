"""When two bodies first touch on their way through a step: the swept test of any two shapes.

Where the way is straight and the pair has a sweep of its own, that says it in closed form. Everywhere else it is found
by conservative advancement: while the two are apart, a plane with the pair's normal lies in the gap between them, and
they cannot meet before the gap along that normal, which is a polynomial of the time, has closed. From there they look
again. Convex shapes are never taken past their touch. On a plane one look is exact, a parabola included; elsewhere the
error is squared by each. (B. Mirtich, "Impulse-based dynamic simulation of rigid body systems", 1996, with the rate of
closing replaced by the path itself.)

Between shapes with dents there is no such plane, and they may touch in one place while they come to another. These are
looked at in steps that are short for their size, for an approach that is fast enough to matter.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from ...framework.compilation import inlined, part
from ...framework.vectors import dot, length, sub
from ..integration.trajectory import ROUNDING, along, along_rate, first_root

MOST_STRIDES = 4096  # looks at shapes with dents in a step
LOOKS = 100  # a graze takes about 30; whatever is still closing in after that counts as touching
APART, TOUCHES, AT_CORNER = range(3)


def make_first_touch(evaluate: Any, corner: Any, swept: Any, convex: Any, dented: bool) -> Callable[..., Any]:
    """The swept test over the shapes of a scene; dented: some are not convex."""
    advance = make_advance(evaluate, corner)
    march: Any = make_march(evaluate) if dented else None

    @inlined
    def first_touch(
        shape_a, a, shape_b, b, x0, x1, x2, x3, straight, since, until, slop, stride, threshold, shapes, like
    ):  # fmt: skip
        """(APART, TOUCHES or AT_CORNER, time, normal, point, from a's centre to b's) of the first touch on b's path
        as a sees it, between two times; touching at ``since`` and parting is none unless the path leads back.

        AT_CORNER: they touch at a corner only, still do a slop further on, and what becomes of it is not looked at.
        stride: seconds between looks at shapes with dents, of which approaches slower than ``threshold`` are none.
        """
        if dented and not convex(shape_a, shape_b):
            return march(shape_a, a, shape_b, b, x0, x1, x2, x3, since, until, stride, threshold, shapes, like)
        t, known, met, share = since, False, False, 0.0
        if straight:
            start = along(since, x0, x1, x2, x3)
            way = sub(along(until, x0, x1, x2, x3), start)
            known, met, share = swept(shape_a, a, shape_b, b, start, way, shapes, like)
            t += share * (until - since)
        if known and not met:  # most pairs: they cost no call
            return APART, t, like, like, like
        return advance(shape_a, a, shape_b, b, x0, x1, x2, x3, straight, known, t, until, slop, shapes, like)

    return first_touch


def make_march(evaluate: Any) -> Callable[..., Any]:
    """Looks at one time after the other, over the shapes of a scene."""

    @part
    def march(shape_a, a, shape_b, b, x0, x1, x2, x3, since, until, stride, threshold, shapes, like):
        """The same for shapes with dents; between the look that finds an approach and the one before it by halves."""
        low, high, t, looks = since, math.inf, since, 0
        normal, point, at = like, like, like
        while True:  # one place that calls evaluate
            d = along(t, x0, x1, x2, x3)
            hit, _, n, p = evaluate(shape_a, a, shape_b, b, d, shapes, like)
            if hit and dot(along_rate(t, x1, x2, x3), n) < -threshold:
                high, normal, point, at = t, n, p, d
            else:
                low = t
            if high < math.inf:
                t = 0.5 * (low + high)
                if not low < t < high:
                    return TOUCHES, high, normal, point, at
            elif not t < until:  # also if it is no number
                return APART, t, normal, point, at
            else:
                looks += 1
                t = min(since + looks * max(stride, (until - since) / MOST_STRIDES), until)

    return march


def make_advance(evaluate: Any, corner: Any) -> Callable[..., Any]:
    """Conservative advancement over the shapes of a scene."""

    @part
    def advance(shape_a, a, shape_b, b, x0, x1, x2, x3, straight, known, t, until, slop, shapes, like):
        """The same from ``t`` on; known: that they first touch then."""
        normal, point, at = like, like, like
        found, cornered, time = False, False, t
        for look in range(LOOKS):
            d = along(t, x0, x1, x2, x3)
            hit, depth, n, p = evaluate(shape_a, a, shape_b, b, d, shapes, like)
            w = along_rate(t, x1, x2, x3)
            rate = dot(w, n)
            if cornered:  # what they run into just behind the corner is what they touch
                if not hit or corner(shape_a, a, shape_b, b, d, slop, shapes, like):
                    return AT_CORNER, time, normal, point, at
                return TOUCHES, time, n, point, at
            touches = known or hit or abs(depth) <= ROUNDING * length(d) or look == LOOKS - 1
            if look == 0 or rate < 0.0 or hit:  # a step too far by a rounding error may turn the normal round
                normal, point = n, p
            found = touches and (straight or rate < 0.0)
            further = t
            if not found:
                further = t + first_root(
                    0.0 if touches else -depth, rate, dot(x2, n) + 3.0 * t * dot(x3, n), dot(x3, n), until - t
                )
                if not further <= until:
                    return APART, t, normal, point, at
                found = not further > t
            if found:
                at, time = d, t
                if not corner(shape_a, a, shape_b, b, d, slop, shapes, like):
                    return TOUCHES, time, normal, point, at
                cornered = True
                further = t + 2.0 * slop / length(w)
                if not further <= until:
                    return AT_CORNER, time, normal, point, at
            t = further
        return TOUCHES, time, normal, point, at

    return advance
