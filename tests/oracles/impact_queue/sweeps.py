"""The oracle's sweeps: the first touch of two bodies on their paths through a step, found by sampling the gap.

No equation is solved: the gap is measured with the oracle's plain ``touch``. It changes no faster than the bodies move,
so an interval contains no touch if its middle has a larger gap than they can travel from there; other intervals are
halved. Along a straight path the gap of convex shapes is convex in time; along a parabola it is nearly so within a
small part of the step. There a library finds its minimum, and the time when it closes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from carom.framework import Settings
from carom.lab.measure.body_shapes import Floats

from .bodies import FAST, Pair, Touch, is_corner_touch, touch

ROUNDING = 4e-16  # of a distance
PARTS = 64  # of a step, within which a parabola counts as straight
NARROW = 1e-12  # of an interval: as near to a minimum as that


@dataclass(frozen=True)
class Way:
    """b's path relative to a within the step: start + speed t + bend t^2."""

    start: Floats
    speed: Floats
    bend: Floats

    def at(self, t: float) -> Floats:
        return self.start + self.speed * t + self.bend * t * t

    def velocity(self, t: float) -> Floats:
        return self.speed + 2.0 * t * self.bend

    def length(self, span: float) -> float:
        """Upper bound of its length within ``span`` seconds."""
        return float(np.linalg.norm(self.speed)) * span + float(np.linalg.norm(self.bend)) * span * span


@dataclass(frozen=True)
class Meeting:
    """The first touch: time, geometry, and b's centre from a's. ``at_corner``: decided by the end of the step."""

    time: float
    touch: Touch
    apart: Floats
    at_corner: bool = False


def way_of(pair: Pair) -> Way:
    a, b = pair.bodies
    return Way(pair.between(a.seems_from, b.seems_from), b.path[0] - a.path[0], b.path[1] - a.path[1])


def is_swept(pair: Pair, way: Way, settings: Settings) -> bool:
    """True if event-driven; else for fast pairs, in a discrete world only if one of the two has ccd."""
    if settings.collision == "event_driven":
        return True
    some = settings.collision != "discrete" or pair.a.rigid.ccd or pair.b.rigid.ccd
    return some and way.length(settings.dt) > FAST * pair.size


def sweep(pair: Pair, way: Way, since: float, settings: Settings) -> Meeting | None:
    """The first touch from ``since`` to the end of the step, None if there is none."""
    a, b, until, edge = pair.a, pair.b, settings.dt, pair.edge(settings)
    time = _first_touch(pair, way, since, until)
    if time is None:
        return None
    apart = way.at(time)
    met = touch(a, b, apart)
    if not is_corner_touch(a, b, apart, edge):
        return Meeting(time, met, apart)
    speed = float(np.linalg.norm(way.velocity(time)))
    further = time + 2.0 * edge / speed if speed > 0.0 else math.inf
    if further <= until:  # use the contact just behind the corner
        there = touch(a, b, way.at(further))
        if there.depth >= 0.0 and not is_corner_touch(a, b, way.at(further), edge):
            return Meeting(time, there, apart)
    return Meeting(time, met, apart, at_corner=True)


def _first_touch(pair: Pair, way: Way, since: float, until: float) -> float | None:
    def gap(t: float) -> float:
        return -touch(pair.a, pair.b, way.at(t)).depth

    now = gap(since)
    places = sum(float(np.linalg.norm(body.seems_from)) for body in pair.bodies)
    bend, span = float(np.linalg.norm(way.bend)), until - since
    if bend * until * until <= ROUNDING * places:
        if now <= 0.0:
            return since
        return _first_in(gap, way, [since, until])
    rate = float(way.velocity(since) @ touch(pair.a, pair.b, way.at(since)).normal)
    if now > ROUNDING * float(np.linalg.norm(way.at(since))):
        edges = [since + span * k / PARTS for k in range(PARTS)]
        return _first_in(gap, way, [*edges, until])
    if rate <= 0.0:
        return since
    # They touch and separate, but may return. Search from where they are surely farther apart than before.
    level = min(now, 0.0)
    sure = 1e-13 * max(places, float(np.linalg.norm(way.at(since))))
    edges = [since + span * 2.0**-k for k in range(40, 0, -1) if rate * span * 2.0**-k > sure]
    edges = [*edges, *(since + span * k / PARTS for k in range(PARTS // 2 + 1, PARTS)), until]
    if gap(edges[0]) <= level:  # too slow to separate
        return since
    return _first_in(lambda t: gap(t) - level, way, edges)


def _first_in(gap: Callable[[float], float], way: Way, edges: list[float]) -> float | None:
    """The first time at which the gap closes, in intervals with one minimum each."""
    for low, high in _near(gap, way, edges, 0, len(edges) - 1):
        if gap(low) <= 0.0:
            return low
        inside = minimize_scalar(gap, bounds=(low, high), method="bounded", options={"xatol": NARROW * (high - low)}).x
        least = min((low, inside, high), key=gap)
        if gap(least) <= 0.0:
            return brentq(gap, low, least, xtol=1e-300, rtol=4e-16 * 4)
    return None


def _near(
    gap: Callable[[float], float], way: Way, edges: list[float], first: int, last: int
) -> list[tuple[float, float]]:
    """The intervals between neighbouring edges that may hold a touch."""
    low, high = edges[first], edges[last]
    fastest = float(np.linalg.norm(way.speed)) + 2.0 * float(np.linalg.norm(way.bend)) * high
    if gap(0.5 * (low + high)) > 0.5 * fastest * (high - low):
        return []
    if last == first + 1:
        return [(low, high)]
    middle = (first + last) // 2
    return _near(gap, way, edges, first, middle) + _near(gap, way, edges, middle, last)
