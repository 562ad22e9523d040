"""The oracle's impacts: bounces at their time on the path, in the order of time, and a new look after each.

A blow at time t changes a body's velocity by dv. It goes on as if it had travelled with dv all along and had come from
dv t behind, so that its path stays one polynomial.
"""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..framework import Settings
from .shapes import Floats
from .testing_oracle_bodies import Body, Pair, Touch, only_corners, touch
from .testing_oracle_sweeps import FAST, ROUNDING, Meeting, is_swept, sweep, way_of

HALVINGS = 60  # of a step: below the rounding of its time


@dataclass(frozen=True, eq=False)
class Impact:
    """A bounce that lies ahead. ``slide``: the change of sliding speed that friction brings, (d,).

    kind: bounce; free, if no cap counts it; stop, of what is fast and beyond the cap; cross, of what does not push
    """

    pair: Pair
    time: float
    speed: float  # that the bounce changes: (1 + e) times the approach
    normal: Floats
    slide: Floats
    struck: tuple[int, int]  # how often its two bodies had been struck when this was foreseen
    kind: str = "bounce"

    @property
    def stale(self) -> bool:
        return self.struck != (self.pair.a.struck, self.pair.b.struck)

    @property
    def impulse(self) -> float:
        """N s, along the normal."""
        return self.pair.mass * self.speed


class Impacts:
    """Lets bounce what bounces. sweeping: some pairs are looked at on their whole way, and what crosses is noted."""

    def __init__(self, pairs: Sequence[Pair], settings: Settings, curved: bool, sweeping: bool) -> None:
        self.done: list[Impact] = []  # the bounces, in order
        self.capped = 0  # what the cap has kept from bouncing
        self._pairs, self._settings, self._curved, self._sweeping = pairs, settings, curved, sweeping
        self._queue: list[tuple[float, int, int, int, Impact]] = []
        self._number = itertools.count()

    def run(self) -> None:
        """First those that may have met in the prediction."""

        def may_have_met(p: Pair) -> bool:
            return self._sweeping or p.near or p.a.support is not None or p.b.support is not None

        self._look([p for p in self._pairs if may_have_met(p)], 0.0)
        while self._queue:
            impact = heapq.heappop(self._queue)[-1]
            if impact.stale:
                continue
            if impact.kind == "cross":
                impact.pair.crossed = True
                continue
            moved = [body for body in impact.pair.bodies if body.inverse_mass > 0.0]
            if impact.kind == "stop":
                self.capped += 1
                impact.pair.crossed = impact.pair.involved = True
                for body in moved:
                    if not body.stopped:
                        _stop(body, impact.time)
            else:
                self._strike(impact)
                self.done.append(impact)
            self._look([p for p in self._pairs if p.a in moved or p.b in moved], impact.time)
        for body in {body: None for pair in self._pairs for body in pair.bodies}:
            body.aside = body.stopped or (self._sweeping and body.struck > 0 and _is_thrown(body))

    def _look(self, chosen: Sequence[Pair], since: float) -> None:
        for pair in chosen:
            impact = self._foresee(pair, since) if pair.pushes or self._sweeping else None
            if impact is not None:
                heapq.heappush(self._queue, (impact.time, *pair.key, next(self._number), impact))

    def _foresee(self, pair: Pair, since: float) -> Impact | None:
        """The pair's next impact: a touch, and an approach above the threshold; without restitution if swept only."""
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
            if only_corners(a, b, met.apart, pair.slop(settings)):  # from one thing onto the next
                met = replace(met, touch=last)
        normal = met.touch.normal
        time, approach = met.time, way.velocity(met.time)
        speed = float(np.linalg.norm(approach))
        if not met.apart.any() and speed > 0.0:  # no direction between the centres: they part the way they came
            if pair.impulse > 0.0:
                return None
            normal = -approach / speed
        along, nothing = float(approach @ normal), 0.0
        if self._sweeping:
            nothing = ROUNDING * sum(float(np.linalg.norm(body.path[0])) for body in pair.bodies)
        gain, left = 0.0, dt - time
        if not along < -pair.threshold(settings) - nothing and pair.pushes:
            # Too slow to bounce, but what is fast must not end far past the surface: it goes there and stays.
            curve = float(way.bend @ normal)
            fast = swept and way.length(left) > FAST * pair.size
            if not (fast and -(along + curve * left) * left > pair.slop(settings)):
                return None
            e, gain = 0.0, max(0.0, -curve * left)
        if not self._curved and e != 1.0:  # a straight path has the true speed in its middle only
            bend = (b.velocity - b.first_velocity) - (a.velocity - a.first_velocity)
            along = min(0.0, along + float(bend @ normal) * (time / dt - 0.5))
            if self._sweeping and pair.pushes and not along < -nothing:
                return None  # the flight does not have it
        kind = self._kind(pair, e, way.length(left) > FAST * pair.size or any(map(_is_thrown, pair.bodies)))
        if kind is None:
            self.capped += 1
            return None
        slide = np.zeros_like(normal)
        sliding = approach - normal * float(approach @ normal)
        fast, mu = float(np.linalg.norm(sliding)), pair.friction(settings)
        if mu > 0.0 and fast > 0.0:  # Coulomb: at most mu times the normal impulse
            slide = -sliding * min(1.0, -mu * (1.0 + e) * along / fast)
        return Impact(pair, time, gain - (1.0 + e) * along, normal, slide, (a.struck, b.struck), kind)

    def _strike(self, impact: Impact) -> None:
        """Both bodies get their impulse at the time of impact and make the rest of the step with new velocities."""
        pair, dt = impact.pair, self._settings.dt
        change = pair.mass * (impact.speed * impact.normal + impact.slide)
        fading = 0.5 * dt if self._settings.collision == "event_driven" else dt - impact.time
        for body, sign in ((pair.a, -1.0), (pair.b, 1.0)):
            if body.inverse_mass > 0.0:
                _push(body, sign * body.inverse_mass * change, impact.time, dt, fading)
                body.spent += impact.kind == "bounce"
        pair.impulse += impact.impulse
        pair.normal = impact.normal
        pair.involved = True

    def _kind(self, pair: Pair, e: float, fast: bool) -> str | None:
        """None for what is left to the contacts at rest, being beyond the cap and not ``fast``."""
        if not pair.pushes:
            return "cross"
        if any(body.stopped or body.spent >= self._settings.impact_cap for body in pair.bodies):
            moves = any(body.inverse_mass > 0.0 and not body.stopped for body in pair.bodies)
            return "stop" if self._sweeping and fast and moves else None
        driven = any(body.inverse_mass == 0.0 and body.path[0].any() for body in pair.bodies)
        free = self._settings.collision == "event_driven" and self._sweeping and e == 1.0 and not driven
        return "free" if free else "bounce"


def _overlap(pair: Pair, since: float, settings: Settings) -> tuple[Meeting | None, Touch]:
    """Of those that overlap at the end of the step: when they begin to, ``since`` if they do then already; and how
    they touch at the end."""
    a, b, dt = pair.a, pair.b, settings.dt

    def at(time: float) -> tuple[float, Floats, Touch]:
        apart = pair.between(a.at(time), b.at(time))
        return time, apart, touch(a, b, apart)

    found = at(dt)
    _, apart, last = found
    if last.depth < 0.0 or only_corners(a, b, apart, pair.slop(settings)):
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


def _is_thrown(body: Body) -> bool:
    """Whether blows have changed its way so much that it seems to come from far off its start."""
    return float(np.linalg.norm(body.seems_from - body.start)) > FAST * body.size


def _push(body: Body, dv: Floats, time: float, dt: float, fading: float) -> None:
    """fading: seconds in which damping acts on the new velocity."""
    body.struck += 1
    body.first_velocity = body.first_velocity + dv
    body.velocity = body.velocity + dv * math.exp(-body.damping * fading)
    body.position = body.position + dv * (dt - time)
    body.seems_from = body.seems_from - dv * time
    body.path = body.path[0] + dv, body.path[1]


def _stop(body: Body, time: float) -> None:
    """It stays there until the step ends, and keeps its velocity."""
    body.stopped, body.struck = True, body.struck + 1
    body.velocity = body.velocity_at(time)
    body.position = body.seems_from = body.at(time)
    body.path = np.zeros_like(body.velocity), np.zeros_like(body.velocity)
