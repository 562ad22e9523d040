"""The oracle's impacts: bounces at their time on the path, in order of time, with new predictions after each.

An impact at time t changes a body's velocity by dv. The path is extended backwards as if the body had travelled with
dv since the start of the step, from a start shifted by -dv t, so that it stays one polynomial.
"""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from carom.framework import Settings
from carom.lab.measure.body_shapes import Floats

from .bodies import FAST, Body, Cluster, Pair, Touch, is_corner_touch, touch
from .groups import groups_of, is_at, solve
from .sweeps import ROUNDING, Meeting, Way, is_swept, slides_over, sweep, way_of

HALVINGS = 60  # of a step: more than its time resolution
QUICK = 1e-3  # of the step: inelastic impacts closer than this in time are treated as inelastic collapse
STUCK = 1 << 30  # exceeds any cap on impacts: a body that has stuck once continues to stick


@dataclass(frozen=True, eq=False)
class Impact:
    """A predicted bounce. ``slide``: the change of the sliding velocity by friction, (d,).

    kind: bounce; free, if the cap does not count it; stick and stop, beyond the cap; cross, of a pair without response
    """

    pair: Pair
    time: float
    speed: float  # change of the normal velocity: (1 + e) times the approach
    normal: Floats
    slide: Floats
    impact_counts: tuple[int, int]  # impact counts of its two bodies at the time of prediction
    kind: str
    impulse: float = field(init=False)  # N s, along the normal

    def __post_init__(self) -> None:
        one, two = (body.cluster if self.kind == "stick" else body for body in self.pair.bodies)
        light = one.inverse_mass + two.inverse_mass
        object.__setattr__(self, "impulse", self.speed / light if light else 0.0)

    @property
    def stale(self) -> bool:
        return self.impact_counts != (self.pair.a.impact_count, self.pair.b.impact_count)


class Impacts:
    """Resolves the impacts of a step. sweeping: some pairs are swept along their paths, and crossings are recorded."""

    def __init__(self, pairs: Sequence[Pair], settings: Settings, curved: bool, sweeping: bool) -> None:
        self.done: list[Impact] = []  # in order of time
        self.capped = 0  # impacts suppressed by the cap
        self._pairs, self._settings, self._curved, self._sweeping = pairs, settings, curved, sweeping
        self._queue: list[tuple[float, int, int, int, Impact]] = []
        self._number = itertools.count()

    def run(self) -> None:
        """Resolve all impacts in order of time."""

        def may_have_met(p: Pair) -> bool:
            return self._sweeping or p.near or p.a.resting_prediction is not None or p.b.resting_prediction is not None

        self._look([p for p in self._pairs if may_have_met(p)], 0.0)
        while self._queue:
            impact = heapq.heappop(self._queue)[-1]
            if impact.stale:
                continue
            if impact.kind == "cross":
                impact.pair.crossed = True
                continue
            moved = [body for body in impact.pair.bodies if body.inverse_mass > 0.0]
            if impact.kind == "stop" or (impact.kind == "stick" and not impact.pair.can_stick):
                self.capped += 1
                impact.pair.crossed = impact.pair.has_contact = True
                for body in moved:
                    if not body.stopped:
                        _stop(body, impact.time)
            elif impact.kind == "stick":
                self.capped += 1
                moved = self._stick(impact)
            else:
                self._strike_together(impact)
                continue
            self._look([p for p in self._pairs if p.a in moved or p.b in moved], impact.time)

    def _strike_together(self, first: Impact) -> None:
        """Apply an impact and all others at its time; then look at the pairs of all their bodies."""
        together = [first]
        while self._queue:
            impact = self._queue[0][-1]
            if not impact.stale and not is_at(impact, first.time, self._settings):
                break
            if not impact.stale and impact.kind not in ("bounce", "free", "cross"):
                break
            heapq.heappop(self._queue)
            if not impact.stale and impact.kind == "cross":
                impact.pair.crossed = True
            elif not impact.stale and all(impact.pair is not other.pair for other in together):
                together.append(impact)
        begun, searched = len(self.done), set[Body]()
        for group in groups_of(together):
            if len(group) == 1:
                self._strike(group[0])
                self.done.append(group[0])
            else:
                self._strike_group(group)
        for impact in self.done[begun:]:
            moved = {body for body in impact.pair.bodies if body.inverse_mass > 0.0} - searched
            searched |= moved
            self._look([p for p in self._pairs if p.a in moved or p.b in moved], impact.time)

    def _strike_group(self, group: Sequence[Impact]) -> None:
        """Apply impacts of one time that share bodies."""
        now = min(impact.time for impact in group)
        impulses, gained = solve(group, now, self._settings)
        struck = set[Body]()
        for impact, impulse in zip(group, impulses.tolist(), strict=True):
            if impulse > 0.0:
                for body in impact.pair.bodies:
                    struck.add(body)
                    body.impact_count += body.inverse_mass > 0.0
                    body.counted_impacts += body.inverse_mass > 0.0 and impact.kind == "bounce"
                impact = replace(impact, time=now, speed=impulse / impact.pair.mass)
                self.done.append(impact)
                _note(impact)
        for body in struck.intersection(gained):
            self._deflect(body, gained[body], now)

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
        along, nothing = float(approach @ normal), 0.0
        if self._sweeping:
            nothing = ROUNDING * sum(float(np.linalg.norm(body.path[0])) for body in pair.bodies)
        if not along < -pair.threshold(settings) - nothing and pair.pushes:
            return None  # too slow to bounce: a contact at rest
        supported = a.resting_prediction is not None or b.resting_prediction is not None
        if swept and pair.pushes and supported and slides_over(pair, way, met, normal, settings):
            return None
        if not self._curved and e != 1.0:  # a straight path has the true velocity only in its middle
            bend = float(((b.velocity - b.first_velocity) - (a.velocity - a.first_velocity)) @ normal)
            if supported:  # by the pushes of the last step, which may be far more than forces make
                bend = min(max(bend, -a.gained - b.gained), a.gained + b.gained)
            along = min(0.0, along + bend * (time / dt - 0.5))
            if self._sweeping and pair.pushes and not along < -nothing:
                return None  # no approach at the true velocity
        kind = self._kind(pair, e, time, along, way)
        if kind is None:
            self.capped += 1
            return None
        if kind == "stick":
            return Impact(pair, time, -along, normal, np.zeros_like(normal), (a.impact_count, b.impact_count), kind)
        slide = np.zeros_like(normal)
        sliding = approach - normal * float(approach @ normal)
        fast, mu = float(np.linalg.norm(sliding)), pair.friction(settings)
        if mu > 0.0 and fast > 0.0:  # Coulomb: at most mu times the normal impulse
            slide = -sliding * min(1.0, -mu * (1.0 + e) * along / fast)
        return Impact(pair, time, -(1.0 + e) * along, normal, slide, (a.impact_count, b.impact_count), kind)

    def _strike(self, impact: Impact) -> None:
        """Apply the impulse to both bodies at the time of impact; they continue with new velocities."""
        pair = impact.pair
        change = pair.mass * (impact.speed * impact.normal + impact.slide)
        for body, sign in ((pair.a, -1.0), (pair.b, 1.0)):
            if body.inverse_mass > 0.0:
                self._push(body, sign * body.inverse_mass * change, impact.time)
                body.counted_impacts += impact.kind == "bounce"
        _note(impact)

    def _stick(self, impact: Impact) -> list[Body]:
        """An inelastic impact of two clusters, which are merged; returns the movable members."""
        one, two = impact.pair.a.cluster, impact.pair.b.cluster
        closing = float((one.velocity_at(impact.time) - two.velocity_at(impact.time)) @ impact.normal)
        impact = replace(impact, speed=min(impact.speed, max(0.0, 2.0 * closing)))  # more would add energy
        self.done.append(impact)
        for cluster, sign in ((one, -1.0), (two, 1.0)):
            dv = sign * cluster.inverse_mass * impact.impulse * impact.normal
            for body in cluster.members:
                if body.inverse_mass > 0.0:
                    self._push(body, dv, impact.time)
                    body.counted_impacts |= STUCK
        _note(impact)
        members = [body for body in (*one.members, *two.members) if body.inverse_mass > 0.0]
        grown = Cluster(members, one.fixed or two.fixed)
        for body in members:
            body.cluster = grown
        return members

    def _push(self, body: Body, dv: Floats, time: float) -> None:
        """Change a body's velocity at ``time``. The damping after it depends on the flight: half of dt if event-driven;
        the rest of the step on parabolas; none on straight paths, which have the end velocity."""
        body.impact_count += 1
        self._deflect(body, dv, time)

    def _deflect(self, body: Body, dv: Floats, time: float) -> None:
        dt = self._settings.dt
        fading = 0.5 * dt if self._settings.collision == "event_driven" else dt - time if self._curved else 0.0
        if self._sweeping:
            body.last = time
        body.first_velocity = body.first_velocity + dv
        body.velocity = body.velocity + dv * math.exp(-body.damping * fading)
        body.position = body.position + dv * (dt - time)
        body.seems_from = body.seems_from - dv * time
        body.path = body.path[0] + dv, body.path[1]

    def _kind(self, pair: Pair, e: float, time: float, along: float, way: Way) -> str | None:
        """The kind of an impact; None if it is beyond the cap and too slow to tunnel: contacts at rest handle it."""
        if not pair.pushes:
            return "cross"
        a, b, left = pair.a, pair.b, self._settings.dt - time
        since = time - max(a.last, b.last)
        events = self._settings.collision == "event_driven" and self._sweeping
        if not any(body.stopped or body.counted_impacts >= self._settings.impact_cap for body in pair.bodies):
            driven = any(body.inverse_mass == 0.0 and body.path[0].any() for body in pair.bodies)
            return "free" if events and e == 1.0 and not driven and since > 0.0 else "bounce"
        moves = any(body.inverse_mass > 0.0 and not body.stopped for body in pair.bodies)
        fast = way.length(left) > FAST * pair.size or any(map(_is_deflected, pair.bodies))
        if not (self._sweeping and moves and fast and -along * left > pair.slop(self._settings)):
            return None
        ends_up = e <= 0.0 or (e < 1.0 and since <= QUICK * self._settings.dt) or (events and since <= 0.0)
        return "stick" if ends_up and pair.can_stick else "stop"


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


def _is_deflected(body: Body) -> bool:
    """True if impacts have moved the extrapolated start of its path far from its true start."""
    return float(np.linalg.norm(body.seems_from - body.start)) > FAST * body.size


def _note(impact: Impact) -> None:
    pair = impact.pair
    pair.impulse += impact.impulse
    pair.normal, pair.has_contact = impact.normal, True


def _stop(body: Body, time: float) -> None:
    """Stop the body, and what sticks to it, until the step ends; it keeps its velocity."""
    body.stopped, body.impact_count, body.cluster.fixed = True, body.impact_count + 1, True
    body.velocity = body.velocity_at(time)
    body.position = body.seems_from = body.at(time)
    body.path = np.zeros_like(body.velocity), np.zeros_like(body.velocity)
