"""The oracle's contacts at rest: their detection, and their geometry at the start of the step."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from carom.framework import Settings
from carom.lab.measure.body_shapes import Floats

from .bodies import FAST, Body, Pair, Touch, is_corner_touch, motions_come_near, touch
from .sweeps import enters, is_swept, last_leg, may_be_swept, sweep, way_of

SEARCHES = 24  # iterations of the search for the first overlap
ROUNDING = 1e-12  # relative to the operands: smaller differences may be rounding
SAME_PLACE = 1e-9  # of the size: smaller overlaps count as none
APART = 1e-11  # of the size: a smaller gap at the start of the step is none
RATIO, OPPOSED = 10.0, -0.5  # of masses: light and heavy; cosine: from opposite sides
SAG = (2.0 / math.pi) ** 2  # of a soft contact under a load: times substep^2 load / mass
OWN_SAG = 0.0003  # of the size: a contact that would sag more under one of its bodies is rigid


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
    shock: float = 0.0  # N s, of all shocks in the step: not remembered
    pushed: bool = False
    in_block: bool = False
    apart: bool = False  # where the step starts
    waits: bool = False  # a firm one that is open where the step starts
    firm: bool = False  # of a body that touches only what cannot be moved, and not against the others of its contacts
    rigid: bool = False  # does not sag under its load
    deep: bool = False  # overlaps by more than what is corrected through velocities
    soft: bool = False  # its overlap is corrected softly
    opening: float = 0.0  # m/s, to be added to its normal velocity in passes that do not push,
    pushing: float = 0.0  # and in the one that does
    island: int = -1  # the number of its island, if that has rigid contacts
    slack: float = 0.0  # N s: by how much the impulse may differ, because the solver stops when it is small
    doubtful: bool = False  # the result was decided by a number of the size of rounding


class Moving:
    """A body in the solver: velocity, displacement since the step began, acceleration."""

    def __init__(self, body: Body, dt: float, h: float) -> None:
        self.inverse_mass = body.inverse_mass
        self.velocity = body.first_velocity
        self.shift = self.acceleration = np.zeros_like(body.position)
        self.held = self.unsettled = False
        self.slack = 0.0  # m/s, as of contacts
        if self.inverse_mass > 0.0:
            self.shift = body.seems_from - body.start
            support = 0.0 if body.resting_prediction is None else body.resting_prediction
            self.acceleration = (body.velocity - body.first_velocity - support) / dt
            if body.last > -math.inf:  # so that the substeps lead through the place of its last impact
                t, a = body.last, self.acceleration
                self.shift = body.at(t) - body.start - t * self.velocity - 0.5 * t * (t + h) * a


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
    if a.stopped or b.stopped:
        return None
    apart = pair.between(a.position, b.position)
    far = far_touch(pair, apart, settings)
    free_flight = not struck and not carried
    if free_flight and pair.depth < -margin and not (far and _meets_in_flight(pair, settings)):
        return None
    now = _deepest(pair, apart, settings)
    if now.depth < -margin:
        if struck or not carried:
            return None
        # The resting prediction may push too much: do they meet without it?
        places = ((a, a.position), (b, b.position))
        free = [x if (dv := body.resting_prediction) is None else x - travels * dt * dv for body, x in places]
        now = _deepest(pair, pair.between(*free), settings)
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
    pair.doubtful |= not (pair.surely_near or motions_come_near(a, b))  # a swept world does not look that far
    is_apart = touch(a, b, pair.between(a.start, b.start)).depth < -APART * pair.size
    gap, normal = first_overlap(pair, at_end, slop, far)
    if bounced and pair.normal is not None and float(normal @ pair.normal) <= 0.0:
        normal = pair.normal  # coincident centres have separated: keep the direction
    pair.normal, pair.has_contact = normal, True
    parting = parting or (bounced and gap > 0.0)
    weight = SAG * (dt / settings.substeps) ** 2 * pair.gained / dt
    rigid = weight > OWN_SAG * pair.size
    pair.doubtful = pair.doubtful or abs(weight - OWN_SAG * pair.size) <= ROUNDING * weight
    tangent = np.zeros_like(normal)
    return Resting(pair, normal, gap, parting, pair.friction(settings), tangent, apart=is_apart, rigid=rigid)


def _deepest(pair: Pair, end: Floats, settings: Settings) -> Touch:
    """The touch at ``end``; on a long way there its depth and normal are those of what they first touch."""
    far, now = far_touch(pair, end, settings), touch(pair.a, pair.b, end)
    if far is None:
        return now
    travel = end - pair.between(pair.a.start, pair.b.start)
    return replace(now, depth=-far[0] - float(travel @ far[1]), normal=far[1])


def far_touch(pair: Pair, end: Floats, settings: Settings) -> tuple[float, Floats] | None:
    """(gap at the start of the step, normal) of what two bodies first touch on the last part of their way to ``end``,
    if that is so long that its end may be behind it. Without sweeping only ways count that forces alone make."""
    margin, first = pair.margin(settings), last_leg(pair)
    travel = end - first
    way, edge = float(np.linalg.norm(travel)), FAST * pair.size
    if not (way > edge and (may_be_swept(pair, settings) or way <= margin)):
        return None
    entry = enters(pair, first, travel, min(edge, margin), pair.slop(settings))
    if entry is None:
        return None
    gap, normal = entry
    return gap + float((pair.between(pair.a.start, pair.b.start) - first) @ normal), normal


def _meets_in_flight(pair: Pair, settings: Settings) -> bool:
    way = way_of(pair)
    return is_swept(pair, way, settings) and sweep(pair, way, 0.0, settings) is not None


def first_overlap(
    pair: Pair, at_end: bool, slop: float, far: tuple[float, Floats] | None = None
) -> tuple[float, Floats]:
    """Gap at the start of the step, and normal, both for the geometry where the two first overlap in the step.

    That is the start of the step if they overlap there, and the end if they never overlap, or if ``at_end``; between
    these what is met on a ``far`` way.
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
    if at_end or depth >= -APART * pair.size:
        return at_start(1.0 if at_end else 0.0, depth, normal)
    if far is not None:
        return far
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
