"""The oracle's impacts at the same time: those that share a movable body are solved together.

Each parts at e times its approach, or faster without an impulse; all impulses are improved at once, until they agree.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from carom.framework import Settings
from carom.lab.measure.body_shapes import Floats

from .bodies import Body

if TYPE_CHECKING:
    from .impacts import Impact

EQUAL = 1e-6  # of the step: times that differ by more are never the same
CLEAR = 64 * 4e-16  # of places and ways: what rounding makes of them
PASSES, LEAST_PASSES, WORK = 1000, 8, 1 << 18
AGREED, SAME, ORTHOGONAL = 8e-16, 2e-15, 1e-12


def is_at(impact: Impact, now: float, settings: Settings) -> bool:
    """True if an impact's time is ``now``, but for what rounding of places makes of it."""
    a, b = impact.pair.bodies
    later, path = impact.time - now, b.velocity_at(now) - a.velocity_at(now)
    places = _norm(a.seems_from) + _norm(b.seems_from) + _norm(impact.pair.between(a.seems_from, b.seems_from))
    clear = CLEAR * (places + (_norm(a.path[0]) + _norm(b.path[0])) * now)
    return later == 0.0 or (later <= EQUAL * settings.dt and later * abs(float(path @ impact.normal)) <= clear)


def groups_of(impacts: Sequence[Impact]) -> list[list[Impact]]:
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


def solve(group: Sequence[Impact], now: float, settings: Settings) -> tuple[Floats, dict[Body, Floats]]:
    """(impulses along the normals, change of velocity of each movable body)."""
    movable = list({body: None for impact in group for body in impact.pair.bodies if body.inverse_mass > 0.0})
    normals, light = np.array([impact.normal for impact in group]), np.array([body.inverse_mass for body in movable])
    signs = np.array(
        [[(body is impact.pair.b) * 1.0 - (body is impact.pair.a) for body in movable] for impact in group]
    )
    cosines = normals @ normals.T
    matrix = np.einsum("ki,i,li->kl", signs, light, signs) * cosines
    coupled = np.abs(cosines) > ORTHOGONAL
    heavy = np.einsum("ki,i,li,kl->k", np.abs(signs), light, np.abs(signs), coupled)
    wanted = np.array([impact.speed for impact in group])
    share = ahead = np.zeros(len(group))
    inertia = 1.0
    for _ in range(max(LEAST_PASSES, min(PASSES, WORK // len(group)))):
        before, share = share, np.maximum(0.0, ahead + (wanted - matrix @ ahead) / heavy)
        change = share - ahead
        if (np.abs(change) * heavy).max() <= AGREED * max(wanted.max(), (share * heavy).max()):
            break
        back = float(-change @ ((share - before) * heavy)) > 0.0
        inertia = 1.0 if back else inertia
        following = 0.5 * (1.0 + math.sqrt(1.0 + 4.0 * inertia * inertia))
        ahead = share if back else share + (inertia - 1.0) / following * (share - before)
        inertia = following
    given = float(share @ matrix @ share)
    if abs(float(share @ wanted) - given) > SAME * given:
        share = share * (float(share @ wanted) / given)
    impulses = share[:, None] * normals
    gained = light[:, None] * (signs.T @ impulses)
    impulses = impulses + _rub(group, now, settings, share, dict(zip(movable, gained, strict=True)))
    gained = light[:, None] * (signs.T @ impulses)
    return share, dict(zip(movable, gained, strict=True))


def _rub(group: Sequence[Impact], now: float, settings: Settings, share: Floats, gained: dict[Body, Floats]) -> Floats:
    """The impulses of friction: each body counts as split among its impacts."""
    result = np.zeros((len(group), len(group[0].normal)))
    for k, impact in enumerate(group):
        a, b = impact.pair.bodies
        mu = impact.pair.friction(settings)
        w = (b.velocity_at(now) + gained.get(b, 0.0)) - (a.velocity_at(now) + gained.get(a, 0.0))
        sliding = w - impact.normal * float(w @ impact.normal)
        fast = _norm(sliding)
        light = sum(body.inverse_mass for each in group for body in each.pair.bodies if body in (a, b))
        if mu > 0.0 and fast > 0.0 and share[k] > 0.0:
            result[k] = -sliding * min(1.0 / light, mu * share[k] / fast)
    return result


def _norm(vector: Floats) -> float:
    return float(np.linalg.norm(vector))
