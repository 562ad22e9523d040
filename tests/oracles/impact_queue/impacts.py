"""The oracle's impacts: bounces at their time on the path, in order of time, with new predictions after each.

An impact at time t changes a body's velocity by dv. The path is extended backwards as if the body had travelled with
dv since the start of the step, from a start shifted by -dv t, so that it stays one polynomial. Impacts at one time that
share a movable body are one problem: each pair parts at e times its approach, or faster without an impulse.
"""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import nnls

from carom.framework import Settings
from carom.lab.measure.body_shapes import Floats

from .bodies import Body, Pair, Touch, is_corner_touch, touch
from .sweeps import ROUNDING, Meeting, is_swept, sweep, way_of

HALVINGS = 60  # of a step: more than its time resolution
EQUAL = 1e-6  # of the step: times that differ by more are never the same
CLEAR = 64 * ROUNDING  # of places and ways: what rounding makes of them


@dataclass(frozen=True, eq=False)
class Impact:
    """A predicted bounce, or the ``crossing`` of a pair without response."""

    pair: Pair
    time: float
    speed: float  # change of the normal velocity: (1 + e) times the approach
    normal: Floats
    slide: Floats  # change of the sliding velocity by friction
    impact_counts: tuple[int, int]  # impact counts of its two bodies at the time of prediction
    crossing: bool = False

    @property
    def impulse(self) -> float:
        return self.speed * self.pair.mass

    @property
    def stale(self) -> bool:
        return self.impact_counts != (self.pair.a.impact_count, self.pair.b.impact_count)


class Impacts:
    """Resolves the impacts of a step. sweeping: some pairs are swept along their paths, and crossings are recorded."""

    def __init__(self, pairs: Sequence[Pair], settings: Settings, curved: bool, sweeping: bool) -> None:
        self.done: list[Impact] = []  # in order of time
        self._pairs, self._settings, self._curved, self._sweeping = pairs, settings, curved, sweeping
        self._queue: list[tuple[float, int, int, int, Impact]] = []
        self._number = itertools.count()

    def run(self) -> None:
        """Resolve all impacts in order of time."""
        self._look(self._pairs, 0.0)
        while self._queue:
            first = heapq.heappop(self._queue)[-1]
            if first.stale:
                continue
            together = [first]
            while self._queue and (self._queue[0][-1].stale or self._is_at(self._queue[0][-1], first.time)):
                impact = heapq.heappop(self._queue)[-1]
                if not impact.stale and all(impact.pair is not other.pair for other in together):
                    together.append(impact)
            for impact in together:
                impact.pair.crossed |= impact.crossing
            moved = set[Body]()
            for group in _groups_of([impact for impact in together if not impact.crossing]):
                self._strike(group)
                moved |= {body for impact in group for body in impact.pair.bodies if body.inverse_mass > 0.0}
            self._look([p for p in self._pairs if p.a in moved or p.b in moved], first.time)

    def _is_at(self, impact: Impact, now: float) -> bool:
        """True if an impact's time is ``now``, but for what rounding of places makes of it."""
        a, b = impact.pair.bodies
        later, path = impact.time - now, b.velocity_at(now) - a.velocity_at(now)
        places = [a.seems_from, b.seems_from, b.seems_from - a.seems_from, a.path[0] * now, b.path[0] * now]
        clear = CLEAR * sum(map(np.linalg.norm, places))
        return later == 0.0 or (later <= EQUAL * self._settings.dt and later * abs(path @ impact.normal) <= clear)

    def _strike(self, group: Sequence[Impact]) -> None:
        """Apply impacts of one time that share bodies."""
        now = min(impact.time for impact in group)
        if len(group) > 1:
            group = [replace(i, time=now, speed=p / i.pair.mass) for i, p in zip(group, _impulses(group), strict=True)]
        for impact in group:
            if impact.speed > 0.0:
                pair = impact.pair
                change = pair.mass * (impact.speed * impact.normal + impact.slide)
                pair.impulse, pair.normal = pair.impulse + impact.impulse, impact.normal
                self.done.append(impact)
                self._deflect(pair.a, -pair.a.inverse_mass * change, now)
                self._deflect(pair.b, pair.b.inverse_mass * change, now)

    def _deflect(self, body: Body, dv: Floats, time: float) -> None:
        """Change a movable body's velocity at ``time``. The damping after it depends on the flight: half of dt if
        event-driven; the rest of the step on parabolas; none on straight paths, which have the end velocity."""
        if body.inverse_mass > 0.0:
            dt = self._settings.dt
            fading = 0.5 * dt if self._settings.collision == "event_driven" else dt - time if self._curved else 0.0
            body.impact_count += 1
            body.first_velocity = body.first_velocity + dv
            body.velocity = body.velocity + dv * math.exp(-body.rigid.linear_damping * fading)
            body.position = body.position + dv * (dt - time)
            body.seems_from = body.seems_from - dv * time
            body.path = body.path[0] + dv, body.path[1]

    def _look(self, chosen: Sequence[Pair], since: float) -> None:
        for pair in chosen:
            impact = self._foresee(pair, since) if pair.pushes or self._sweeping else None
            if impact is not None:
                heapq.heappush(self._queue, (impact.time, *pair.key, next(self._number), impact))

    def _foresee(self, pair: Pair, since: float) -> Impact | None:
        """The pair's next impact: a touch with approach above the threshold."""
        a, b, settings, dt = pair.a, pair.b, self._settings, self._settings.dt
        e, way = pair.restitution(settings), way_of(pair)
        swept = self._sweeping and is_swept(pair, way, settings)
        if not (pair.pushes or (swept and not pair.crossed)):
            return None
        met = sweep(pair, way, since, settings) if swept else None
        if swept and met is None:
            return None
        if met is None or met.at_corner:
            if e <= 0.0 and not swept:
                return None
            met, last = _overlap(pair, since, settings)
            if met is None:
                return None
            swept = False
            if is_corner_touch(a, b, met.apart, pair.slop(settings)):  # use the normal at the end of the step
                met = replace(met, touch=last)
        normal = met.touch.normal
        time, approach = met.time, way.velocity(met.time)
        speed = float(np.linalg.norm(approach))
        if not met.apart.any() and speed > 0.0:  # coincident centres give no normal: use the direction of approach
            if pair.impulse > 0.0:
                return None
            normal = -approach / speed
        along = float(approach @ normal)
        nothing = ROUNDING * sum(float(np.linalg.norm(body.path[0])) for body in pair.bodies) if self._sweeping else 0.0
        counts = a.impact_count, b.impact_count
        if not pair.pushes:
            return Impact(pair, time, 0.0, normal, normal, counts, crossing=True)
        if not along < -pair.threshold(settings) - nothing:
            return None  # too slow to bounce: a contact at rest
        if not self._curved and e != 1.0:  # a straight path has the true velocity only in its middle
            bend = float(((b.velocity - b.first_velocity) - (a.velocity - a.first_velocity)) @ normal)
            along = min(0.0, along + bend * (time / dt - 0.5))
            if self._sweeping and not along < -nothing:
                return None  # no approach at the true velocity
        slide = np.zeros_like(normal)
        sliding = approach - normal * float(approach @ normal)
        fast, mu = float(np.linalg.norm(sliding)), pair.friction(settings)
        if mu > 0.0 and fast > 0.0:  # Coulomb: at most mu times the normal impulse
            slide = -sliding * min(1.0, -mu * (1.0 + e) * along / fast)
        return Impact(pair, time, -(1.0 + e) * along, normal, slide, counts)


def _groups_of(impacts: Sequence[Impact]) -> list[list[Impact]]:
    """The impacts in groups that share movable bodies, in the order of the first of each."""
    groups, left = [], list(impacts)
    while left:
        group, reached = [], [left[0]]
        while reached:
            group += reached
            left = [impact for impact in left if impact not in reached]
            bodies = {body for impact in group for body in impact.pair.bodies if body.inverse_mass > 0.0}
            reached = [impact for impact in left if bodies.intersection(impact.pair.bodies)]
        groups.append(sorted(group, key=lambda impact: impact.pair.key))
    return groups


def _impulses(group: Sequence[Impact]) -> Floats:
    """(contacts,) impulses p >= 0 with A p >= the wanted change of speed, and equal where p > 0, as least squares."""
    if any(impact.slide.any() for impact in group):
        raise ValueError("the oracle knows no friction of impacts at the same time")
    movable = list({body: None for impact in group for body in impact.pair.bodies if body.inverse_mass > 0.0})
    light = np.sqrt([body.inverse_mass for body in movable])
    signs = [[(body is impact.pair.b) * 1.0 - (body is impact.pair.a) for body in movable] for impact in group]
    ways = np.einsum("ki,i,kd->idk", np.array(signs), light, np.array([impact.normal for impact in group]))
    ways = ways.reshape(-1, len(group))  # A = ways^T ways
    wanted = np.array([impact.speed for impact in group])
    return nnls(ways, np.linalg.lstsq(ways.T, wanted, rcond=None)[0])[0]


def _overlap(pair: Pair, since: float, settings: Settings) -> tuple[Meeting | None, Touch]:
    """For a pair that overlaps at the end of the step: when the overlap begins, ``since`` if it exists then; and the
    contact geometry at the end."""
    a, b, dt = pair.a, pair.b, settings.dt

    def at(time: float) -> tuple[float, Floats, Touch]:
        apart = pair.between(a.at(time), b.at(time))
        return time, apart, touch(a, b, apart)

    found = at(dt)
    _, apart, last = found
    if last.depth < 0.0 or is_corner_touch(a, b, apart, pair.slop(settings)):
        return None, last
    early = at(since)
    if early[-1].depth >= 0.0:
        found = early
    else:
        low, high = since, dt
        for _ in range(HALVINGS):
            middle = at(0.5 * (low + high))
            if middle[-1].depth >= 0.0:
                high, found = middle[0], middle
            else:
                low = middle[0]
    time, apart, met = found
    return Meeting(time, met, apart), last
