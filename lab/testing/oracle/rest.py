"""The oracle's contacts at rest: their detection, and their geometry at the start of the step."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ....framework import Settings
from ...measure.body_shapes import Floats
from .bodies import Body, Pair, is_corner_touch, touch

SEARCHES = 24  # iterations of the search for the first overlap
ROUNDING = 1e-12  # relative to the operands: smaller differences may be rounding
SAME_PLACE = 1e-9  # of the size: smaller overlaps count as none


@dataclass(eq=False)
class Kept:
    """Warm start data of a contact at rest: impulses (N s) of the last substep and of the whole step."""

    normal: Floats
    impulse: float
    tangent: Floats
    total: float


@dataclass(eq=False)
class Resting:
    """One contact in the solver: its geometry at the start of the step, and its impulses."""

    pair: Pair
    normal: Floats
    gap: float  # at the start of the step; negative: overlap
    parting: bool  # its overlap needs no push
    friction: float
    tangent: Floats
    impulse: float = 0.0
    total: float = 0.0
    pushed: bool = False
    in_block: bool = False
    doubtful: bool = False  # the result was decided by a number of the size of rounding


class Moving:
    """A body in the solver: velocity, displacement since the step began, acceleration."""

    def __init__(self, body: Body, dt: float) -> None:
        self.inverse_mass = body.inverse_mass
        self.velocity = body.first_velocity
        self.shift = self.acceleration = np.zeros_like(body.position)
        self.held = self.unsettled = False
        if self.inverse_mass > 0.0:
            self.shift = body.seems_from - body.start
            support = 0.0 if body.resting_prediction is None else body.resting_prediction
            self.acceleration = (body.velocity - body.first_velocity - support) / dt


# -- which pairs rest -------------------------------------------------------------------------------


def find_resting(pairs: Sequence[Pair], travels: float, settings: Settings) -> list[Resting]:
    """Pairs within the margin at their present positions, without those that bounce; in canonical order.

    travels: displacement by a constant force in a step, over dt times the velocity change.
    """
    found = [rest for pair in pairs if pair.pushes and (rest := _rests(pair, travels, settings)) is not None]
    return sorted(found, key=lambda rest: rest.pair.key)


def _rests(pair: Pair, travels: float, settings: Settings) -> Resting | None:
    a, b, dt = pair.a, pair.b, settings.dt
    slop, margin, threshold = pair.slop(settings), pair.margin(settings), pair.threshold(settings)
    struck = a.impact_count + b.impact_count > 0
    carried = a.resting_prediction is not None or b.resting_prediction is not None
    if a.excluded_from_rest or b.excluded_from_rest:
        return None
    if not struck and not carried and pair.depth < -margin:
        return None
    apart = pair.between(a.position, b.position)
    now = touch(a, b, apart)
    if now.depth < -margin:
        if struck or not carried:
            return None
        # The resting prediction may push too much: do they meet without it?
        places = ((a, a.position), (b, b.position))
        free = [x if (dv := body.resting_prediction) is None else x - travels * dt * dv for body, x in places]
        now = touch(a, b, pair.between(*free))
        if now.depth < -margin:
            return None
    bounced, at_end, parting = pair.impulse > 0.0, False, False
    if pair.restitution(settings) > 0.0:
        speed = float((b.velocity - a.velocity) @ now.normal)
        touches = now.depth > (0.0 if bounced else SAME_PLACE * pair.size)
        if not touches and speed < -threshold:
            return None  # will be an impact of the next step
        at_end, parting = speed > 0.0, speed > threshold and speed * dt > slop
        if bounced and speed > threshold and touch(a, b, pair.between(a.start, b.start)).depth < 0.0:
            return None  # separating
    if is_corner_touch(a, b, apart, slop):
        return None
    gap, normal = first_overlap(pair, at_end, slop)
    if bounced and pair.normal is not None and float(normal @ pair.normal) <= 0.0:
        normal = pair.normal  # coincident centres have separated: keep the direction
    pair.normal, pair.has_contact = normal, True
    parting = parting or (bounced and gap > 0.0)
    return Resting(pair, normal, gap, parting, pair.friction(settings), np.zeros_like(normal))


def first_overlap(pair: Pair, at_end: bool, slop: float) -> tuple[float, Floats]:
    """Gap at the start of the step, and normal, both for the geometry where the two first overlap in the step.

    That is the start of the step if they overlap there, and the end if they never overlap, or if ``at_end``.
    """
    a, b = pair.bodies
    first = pair.between(a.start, b.start)
    travel = pair.between(a.position, b.position) - first

    def look(t: float) -> tuple[float, Floats]:
        d = first + t * travel
        seen = touch(a, b, d)
        corners = is_corner_touch(a, b, d, slop)
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
        t = high + depth / rate if rate else math.nan  # Newton step; bisection now and then
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
