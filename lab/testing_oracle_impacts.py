"""The oracle's impacts: bounces at their time on the path, in the order of time, and a new look after each.

A blow at time t changes a body's velocity by dv. It goes on as if it had travelled with dv all along and had come from
dv t behind, so that its path stays one polynomial.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..framework import Settings
from .shapes import Floats
from .testing_oracle_bodies import Body, Pair, Touch, only_corners, touch

HALVINGS = 60  # of a step: below the rounding of its time


@dataclass(frozen=True, eq=False)
class Impact:
    """A bounce that lies ahead. ``slide``: the change of sliding speed that friction brings, (d,)."""

    pair: Pair
    time: float
    speed: float  # that the bounce changes: (1 + e) times the approach
    normal: Floats
    slide: Floats
    struck: tuple[int, int]  # how often its two bodies had been struck when this was foreseen

    @property
    def stale(self) -> bool:
        return self.struck != (self.pair.a.struck, self.pair.b.struck)


def bounce_all(pairs: Sequence[Pair], settings: Settings) -> list[Impact]:
    """Let bounce what bounces, first those that may have met in the prediction; returns the impacts in order."""
    queue: list[tuple[float, int, int, int, Impact]] = []
    number = itertools.count()

    def look(chosen: Sequence[Pair], since: float) -> None:
        for pair in chosen:
            impact = foresee(pair, since, settings) if pair.pushes else None
            if impact is not None:
                heapq.heappush(queue, (impact.time, *pair.key, next(number), impact))

    done = []
    look([p for p in pairs if p.near or p.a.support is not None or p.b.support is not None], 0.0)
    while queue:
        impact = heapq.heappop(queue)[-1]
        if impact.stale:
            continue
        strike(impact, settings.dt)
        done.append(impact)
        moved = [body for body in impact.pair.bodies if body.inverse_mass > 0.0]
        look([p for p in pairs if p.a in moved or p.b in moved], impact.time)
    return done


def foresee(pair: Pair, since: float, settings: Settings) -> Impact | None:
    """The pair's next impact: restitution, overlap at the end of the step, an approach above the threshold."""
    a, b, dt = pair.a, pair.b, settings.dt
    e, slop = pair.restitution(settings), pair.slop(settings)
    if e <= 0.0 or max(a.struck, b.struck) >= settings.impact_cap:
        return None
    apart = pair.between(a.at(dt), b.at(dt))
    last = touch(a, b, apart)
    if last.depth < 0.0 or only_corners(a, b, apart, slop):
        return None
    time, met = first_touch(pair, since, dt, last)
    apart, approach = pair.between(a.at(time), b.at(time)), b.velocity_at(time) - a.velocity_at(time)
    normal, speed = met.normal, float(np.linalg.norm(approach))
    if not apart.any() and speed > 0.0:  # no direction between the centres: they part the way they came
        if pair.impulse > 0.0:
            return None
        normal = -approach / speed
    elif only_corners(a, b, apart, slop):
        normal = last.normal  # it slides from one thing onto the next
    along = float(approach @ normal)
    if not along < -pair.threshold(settings):
        return None
    if settings.integrator != "velocity_verlet" and e != 1.0:  # a straight path has the true speed in its middle only
        bend = (b.velocity - b.first_velocity) - (a.velocity - a.first_velocity)
        along = min(0.0, along + float(bend @ normal) * (time / dt - 0.5))
    slide = np.zeros_like(normal)
    sliding = approach - normal * float(approach @ normal)
    fast, mu = float(np.linalg.norm(sliding)), pair.friction(settings)
    if mu > 0.0 and fast > 0.0:  # Coulomb: at most mu times the normal impulse
        slide = -sliding * min(1.0, -mu * (1.0 + e) * along / fast)
    return Impact(pair, time, -(1.0 + e) * along, normal, slide, (a.struck, b.struck))


def first_touch(pair: Pair, since: float, dt: float, last: Touch) -> tuple[float, Touch]:
    """When they begin to touch, ``since`` if they do then already, and how."""

    def at(time: float) -> Touch:
        return touch(pair.a, pair.b, pair.between(pair.a.at(time), pair.b.at(time)))

    early = at(since)
    if early.depth >= 0.0:
        return since, early
    low, high, met = since, dt, last
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        found = at(middle)
        if found.depth >= 0.0:
            high, met = middle, found
        else:
            low = middle
    return high, met


def strike(impact: Impact, dt: float) -> None:
    """Both bodies get their impulse at the time of impact and make the rest of the step with the new velocities."""
    pair = impact.pair
    change = pair.mass * (impact.speed * impact.normal + impact.slide)
    for body, sign in ((pair.a, -1.0), (pair.b, 1.0)):
        if body.inverse_mass > 0.0:
            _push(body, sign * body.inverse_mass * change, impact.time, dt)
    pair.impulse += pair.mass * impact.speed
    pair.normal = impact.normal
    pair.involved = True


def _push(body: Body, dv: Floats, time: float, dt: float) -> None:
    body.struck += 1
    body.first_velocity = body.first_velocity + dv
    body.velocity = body.velocity + dv
    body.position = body.position + dv * (dt - time)
    body.seems_from = body.seems_from - dv * time
    body.path = body.path[0] + dv, body.path[1]
