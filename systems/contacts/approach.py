"""Where two bodies first touch on their way, and what counts as no touch."""

from __future__ import annotations

from ...framework.compilation import inlined, part
from ...framework.jit.records.record_type import zero_of
from ...framework.vectors import add_scaled, dot, length, sub
from ..integration.trajectory import ROUNDING, along, relative_path
from ..integration.turning import is_turned
from ..narrow_phase.manifolds import centre_offset, centre_offset_at_start, evaluate_pair
from ..shapes.dispatch import both_convex, both_sharp, has_corner_rule, is_corner_touch
from ..shapes.tolerances import slop_of

APPROACH_LOOKS = 24
STAYS_SLOPS = 1e-3  # slops: two bodies that go less far past each other in a step stay where they are


@inlined
def is_stationary(travel, slop):
    """Whether two bodies that go so far past each other stay where they are; false for nan."""
    return dot(travel, travel) < STAYS_SLOPS * STAYS_SLOPS * slop * slop


@part
def meets_at_corner(state, a, b, d, met, slop):
    """Whether the two touch at a corner only. Shapes without a rule of their own are looked at if they move past each
    other: what stays where it is does not catch. Two that turn may lean on each other's corners. met: (depth, normal)
    there."""
    bodies, shape = state.bodies, state.bodies.shape
    if state.spinning and is_turned(bodies, a) and is_turned(bodies, b):
        return False
    if not has_corner_rule(state, shape[a], shape[b]):
        if not both_sharp(state, shape[a], shape[b]):
            return False
        if is_stationary(sub(centre_offset(bodies, a, b), centre_offset_at_start(bodies, a, b)), slop):
            return False
    return is_corner_touch(state, shape[a], a, shape[b], b, d, met, slop)


@part
def segment_start(state, a, b):
    """From a's centre to b's where the last stretch of their way begins: at the later of their last impacts if they are
    apart there, else at the start of the step. Nothing holds what rests between two impacts.
    """
    bodies = state.bodies
    start = centre_offset_at_start(bodies, a, b)
    if state.impacts.sweeps and (bodies.impact_count[a] > 0 or bodies.impact_count[b] > 0):
        since = max(0.0, bodies.last_impact[a], bodies.last_impact[b])
        d = along(relative_path(state, a, b), since)
        if evaluate_pair(state, a, b, d)[1] <= slop_of(state, a, b):
            return d
    return start


@part
def first_touch_on_segment(state, a, b, d, travel, edge):
    """(whether they touch on the way from d to d + travel and get deeper than ``edge``; gap at d and normal of that),
    by conservative advancement; of concave shapes by their distance, as what comes next may have another normal.
    A touch of corners is none, nor one that only is the edge of the next thing in a row that one of them slides along.
    """
    shape, t, nothing = state.bodies.shape, 0.0, zero_of(state)
    way, slop = length(travel), slop_of(state, a, b)
    convex = both_convex(state, shape[a], shape[b])
    _, depth, normal, _ = evaluate_pair(state, a, b, d)
    for _ in range(APPROACH_LOOKS):
        rate = dot(travel, normal)
        if convex and not rate < 0.0:
            break
        at, further = add_scaled(d, travel, t), t - depth / (-rate if convex else way)
        if depth >= -ROUNDING * (length(d) + t * way) or (not convex and depth >= -slop):
            further = t + 2.0 * slop / way
            if rate < 0.0 and not meets_at_corner(state, a, b, at, (depth, normal), slop):
                ahead = t - 2.0 * edge / rate
                if ahead < 1.0 and evaluate_pair(state, a, b, add_scaled(d, travel, ahead))[1] > edge:
                    return True, -depth - t * rate, normal
                if convex:
                    break
        if not further < 1.0:
            break
        t = further
        _, depth, normal, _ = evaluate_pair(state, a, b, add_scaled(d, travel, t))
    return False, 0.0, nothing
