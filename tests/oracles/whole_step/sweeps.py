"""The oracle's sweeps: the first touch of two bodies on their paths through a step, found by sampling the gap.

No equation is solved: the gap is measured with the oracle's plain ``touch``. It changes no faster than the bodies move,
so an interval contains no touch if its middle has a larger gap than they can travel from there; other intervals are
halved. Along a straight path the gap of convex shapes is convex in time; along a parabola it is nearly so within a
small part of the step. There golden section search finds its minimum, and bisection the time when it closes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from carom.framework import Settings
from carom.lab.measure.body_shapes import Floats

from .bodies import FAST, Pair, Touch, is_corner_touch, touch

ROUNDING = 4e-16  # of a distance
NEARLY = 1e-9  # of the size: whether a gap this narrow closes is decided by rounding
PARTS = 64  # of a step, within which a parabola counts as straight
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
SECTIONS, HALVINGS = 90, 70
CORNERS = 20  # that are passed on one way


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
    return may_be_swept(pair, settings) and way.length(settings.dt) > FAST * pair.size


def may_be_swept(pair: Pair, settings: Settings) -> bool:
    """True if the pair is swept when it is fast."""
    return settings.collision != "discrete" or pair.a.ccd or pair.b.ccd


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


def enters(pair: Pair, first: Floats, travel: Floats, edge: float, slop: float) -> tuple[float, Floats] | None:
    """The first touch on the straight way from ``first`` to ``first + travel`` (b's centre from a's), if b gets deeper
    than ``edge`` behind it: (gap at ``first``, normal) of its plane. None: there is no such touch.

    Touches at corners are passed, in strides of two slops.
    """
    a, b, since = pair.a, pair.b, 0.0
    way, stride = Way(first, travel, np.zeros_like(travel)), 2.0 * slop / float(np.linalg.norm(travel))
    for _ in range(CORNERS):
        time = _first_touch(pair, way, since, 1.0) if since < 1.0 else None
        if time is None:
            return None
        met = touch(a, b, way.at(time))
        rate = float(travel @ met.normal)
        if not rate < 0.0:
            return None
        if is_corner_touch(a, b, way.at(time), slop):
            since = time + stride
            continue
        ahead = time - 2.0 * edge / rate  # there its plane is entered by twice the edge
        depth = touch(a, b, way.at(ahead)).depth if ahead < 1.0 else -math.inf
        pair.doubtful = pair.doubtful or abs(ahead - 1.0) <= NEARLY or abs(depth - edge) <= NEARLY * pair.size
        return (-met.depth - time * rate, met.normal) if depth > edge else None
    return None


def last_leg(pair: Pair) -> Floats:
    """From a's centre to b's where the last straight part of their way begins: at the later of their last impacts in a
    world that sweeps, else at the start of the step."""
    last = max(pair.a.last, pair.b.last)
    return way_of(pair).at(last) if last > -math.inf else pair.between(pair.a.start, pair.b.start)


def slides_over(pair: Pair, way: Way, met: Meeting, normal: Floats, settings: Settings) -> bool:
    """True if a supported body passes over what it meets: the contact plane would have to let it in by twice the edge
    zone within the step, and there its depth must not exceed that zone."""
    edge, left = pair.edge(settings), settings.dt - met.time
    ahead = met.time + _closes(2.0 * edge, float(way.velocity(met.time) @ normal), float(way.bend @ normal))
    depth = touch(pair.a, pair.b, way.at(ahead)).depth if ahead <= settings.dt else -math.inf
    near_end = abs(ahead - settings.dt) <= NEARLY * left
    pair.doubtful = pair.doubtful or near_end or abs(depth - edge) <= NEARLY * pair.size
    return depth <= edge


def _closes(gap: float, rate: float, bend: float) -> float:
    """First zero of a gap with this rate and curvature; inf: never. The larger root comes first: no cancellation."""
    if bend == 0.0:
        return -gap / rate if rate < 0.0 else math.inf
    inside = rate * rate - 4.0 * bend * gap
    if inside < 0.0:
        return math.inf
    larger = -0.5 * (rate + math.copysign(math.sqrt(inside), rate))
    roots = [larger / bend, gap / larger if larger else 0.0]
    return min((root for root in roots if root >= 0.0), default=math.inf)


def _first_touch(pair: Pair, way: Way, since: float, until: float) -> float | None:
    def gap(t: float) -> float:
        return -touch(pair.a, pair.b, way.at(t)).depth

    now = gap(since)
    places = sum(float(np.linalg.norm(body.seems_from)) for body in pair.bodies)
    bend, span = float(np.linalg.norm(way.bend)), until - since
    if bend * until * until <= ROUNDING * places:
        if now <= 0.0:
            return since
        return _first_in(pair, gap, way, [since, until])
    rate = float(way.velocity(since) @ touch(pair.a, pair.b, way.at(since)).normal)
    if 0.0 < now <= 4.0 * ROUNDING * places and abs(rate) <= NEARLY * way.length(span) / span:
        pair.doubtful = True  # whether they still touch: on a curved path a small gap gives an arbitrary time
    if now > ROUNDING * float(np.linalg.norm(way.at(since))):
        edges = [since + span * k / PARTS for k in range(PARTS)]
        return _first_in(pair, gap, way, [*edges, until])
    if abs(rate) <= NEARLY * way.length(span) / span and (pair.a.is_sphere or pair.b.is_sphere):
        pair.doubtful = True  # whether they separate, as curved surfaces may, or keep touching
    if rate <= 0.0:
        return since
    # They touch and separate, but may return. Search from where they are surely farther apart than before.
    level = min(now, 0.0)
    sure = 1e-13 * max(places, float(np.linalg.norm(way.at(since))))
    edges = [since + span * 2.0**-k for k in range(40, 0, -1) if rate * span * 2.0**-k > sure]
    edges = [*edges, *(since + span * k / PARTS for k in range(PARTS // 2 + 1, PARTS)), until]
    if gap(edges[0]) <= level:  # too slow to separate
        return since
    again = _first_in(pair, lambda t: gap(t) - level, way, edges)
    if again is not None and level < -NEARLY * pair.size:  # the time of return to that overlap depends on sampling
        pair.doubtful = True
    return again


def _first_in(pair: Pair, gap: Callable[[float], float], way: Way, edges: list[float]) -> float | None:
    """The first time at which the gap closes, in intervals with one minimum each."""
    stretches = _near(gap, way, edges, 0, len(edges) - 1)
    apart = bool(stretches) and gap(edges[0]) > NEARLY * pair.size
    for low, high in stretches:
        if gap(low) <= 0.0:
            return low
        least = _least(gap, low, high)
        width = gap(least)
        pair.doubtful = pair.doubtful or (apart and abs(width) <= NEARLY * pair.size)
        if width > 0.0:
            continue
        high = least
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            if gap(middle) > 0.0:
                low = middle
            else:
                high = middle
        return high
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


def _least(gap: Callable[[float], float], low: float, high: float) -> float:
    """The time of the smallest gap, or any time at which it is closed."""
    left, right = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
    at_left, at_right = gap(left), gap(right)
    for _ in range(SECTIONS):
        if at_left <= 0.0 or at_right <= 0.0:
            return left if at_left <= 0.0 else right
        if at_left < at_right:
            high, right, at_right = right, left, at_left
            left = high - GOLDEN * (high - low)
            at_left = gap(left)
        else:
            low, left, at_left = left, right, at_right
            right = low + GOLDEN * (high - low)
            at_right = gap(right)
    ends = [(at_left, left), (at_right, right), (gap(low), low), (gap(high), high)]
    return min(ends)[1]
