"""The oracle's contacts at rest: which they are, and their geometry at the start of the step."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ....framework import Settings
from ...measure.body_shapes import Floats
from .bodies import Body, Pair, only_corners, touch

SEARCHES = 24  # for the place where a pair first touches
ROUNDING = 1e-12  # of what was subtracted: a number this small may as well be zero
SAME_PLACE = 1e-9  # of the size: an overlap of rounding errors is none


@dataclass(eq=False)
class Kept:
    """What a contact at rest leaves for the next step: impulses (N s) of the last substep and of the whole step."""

    normal: Floats
    impulse: float
    tangent: Floats
    total: float


@dataclass(eq=False)
class Resting:
    """One contact in the solver: its geometry where the step began, and its impulses."""

    pair: Pair
    normal: Floats
    gap: float  # where the step began; overlap is negative
    parting: bool  # its overlap needs no push
    friction: float
    tangent: Floats
    impulse: float = 0.0
    total: float = 0.0
    pushed: bool = False
    in_block: bool = False
    doubtful: bool = False  # a number of rounding's size has decided what happens


class Moving:
    """A body in the solver: velocity, displacement since the step began, acceleration."""

    def __init__(self, body: Body, dt: float) -> None:
        self.inverse_mass = body.inverse_mass
        self.velocity = body.first_velocity
        self.shift = self.acceleration = np.zeros_like(body.position)
        self.held = self.loose = False
        if self.inverse_mass > 0.0:
            self.shift = body.seems_from - body.start
            support = 0.0 if body.support is None else body.support
            self.acceleration = (body.velocity - body.first_velocity - support) / dt


# -- which pairs rest -------------------------------------------------------------------------------


def find_resting(pairs: Sequence[Pair], travels: float, settings: Settings) -> list[Resting]:
    """Pairs nearer than the margin where they are now, but for those that bounce; in canonical order.

    travels: the way that a supporting force makes in a step, over dt times the velocity it gives.
    """
    found = [rest for pair in pairs if pair.pushes and (rest := _rests(pair, travels, settings)) is not None]
    return sorted(found, key=lambda rest: rest.pair.key)


def _rests(pair: Pair, travels: float, settings: Settings) -> Resting | None:
    a, b, dt = pair.a, pair.b, settings.dt
    slop, margin, threshold = pair.slop(settings), pair.margin(settings), pair.threshold(settings)
    struck, carried = a.struck + b.struck > 0, a.support is not None or b.support is not None
    if a.aside or b.aside:
        return None
    if not struck and not carried and pair.depth < -margin:
        return None
    apart = pair.between(a.position, b.position)
    now = touch(a, b, apart)
    if now.depth < -margin:
        if struck or not carried:
            return None
        # Their supports may push too much in the prediction: do they meet without?
        free = [x.position - (0.0 if x.support is None else travels * dt * x.support) for x in (a, b)]
        now = touch(a, b, pair.between(*free))
        if now.depth < -margin:
            return None
    bounced, at_end, parting = pair.impulse > 0.0, False, False
    if pair.restitution(settings) > 0.0:
        speed = float((b.velocity - a.velocity) @ now.normal)
        touches = now.depth > (0.0 if bounced else SAME_PLACE * pair.size)
        if not touches and speed < -threshold:
            return None  # an impact of the next step
        at_end, parting = speed > 0.0, speed > threshold and speed * dt > slop
        if bounced and speed > threshold and touch(a, b, pair.between(a.start, b.start)).depth < 0.0:
            return None  # on its way out
    if only_corners(a, b, apart, slop):
        return None
    gap, normal = entry(pair, at_end, slop)
    if bounced and pair.normal is not None and float(normal @ pair.normal) <= 0.0:
        normal = pair.normal  # coincident centres have parted: not back again
    pair.normal, pair.involved = normal, True
    parting = parting or (bounced and gap > 0.0)
    return Resting(pair, normal, gap, parting, pair.friction(settings), np.zeros_like(normal))


def entry(pair: Pair, at_end: bool, slop: float) -> tuple[float, Floats]:
    """Gap where the step began and normal, both taken from the place where the two first touch in the step.

    That is where the step began if they touch there, and where it ends if they touch nowhere, or if ``at_end``.
    """
    a, b = pair.bodies
    first = pair.between(a.start, b.start)
    travel = pair.between(a.position, b.position) - first

    def look(t: float) -> tuple[float, Floats]:
        d = first + t * travel
        seen = touch(a, b, d)
        corners = only_corners(a, b, d, slop)
        return min(seen.depth, -slop) if corners else seen.depth, seen.normal

    def at_start(t: float, depth: float, normal: Floats) -> tuple[float, Floats]:
        return -depth - t * float(travel @ normal), normal

    depth, normal = look(1.0 if at_end else 0.0)
    if at_end or depth >= 0.0:
        return at_start(1.0 if at_end else 0.0, depth, normal)
    depth, normal = look(1.0)
    low, high = 0.0, 1.0
    if depth < 0.0:
        return at_start(1.0, depth, normal)
    for search in range(1, SEARCHES):
        rate = float(travel @ normal)
        t = high + depth / rate if rate else math.nan  # where the plane of contact says, now and then the middle
        if not low < t < high or search % 4 == 0:
            t = 0.5 * (low + high)
        depth_there, normal_there = look(t)
        if depth_there >= 0.0:
            high, depth, normal = t, depth_there, normal_there
        else:
            low = t
        if abs(depth_there) <= slop:
            break
    return at_start(high, depth, normal)
