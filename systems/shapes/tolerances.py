"""What is small for two bodies: their extents, and the distances that follow from these."""

from __future__ import annotations

from ...framework.compilation import inlined
from ...framework.vectors import length
from ..integration.turning import size_of_turn

SLOP = 0.005  # of the extent of the smaller body
MARGIN_STEPS = 2.0
# Where a manifold stands for the answer of the pair's function:
SAME_PLACE = 1e-9  # of the extent: within that all of it does; and a gap that is smaller is one of rounding errors
PLANE_SIZES = 0.2  # of the extent: within that its plane may tell the depth,
FLAT_SLOPS = 0.02  # slops: if it is off the surfaces by less, which decides nothing
ENDLESS = 1e300  # m: how far a half-space reaches, so that one that does not turn moves by 0, not nan


@inlined
def smaller_extent(bodies, a, b):
    """The smallest full extent of the smaller body; a point takes that of the other."""
    one, other = bodies.min_extent[a], bodies.min_extent[b]
    return min(one, other) if one > 0.0 and other > 0.0 else max(one, other)


@inlined
def slop_for(state, extent):
    """Metres that are nothing to bodies of that extent: as the settings say, or a share of it."""
    fixed = state.slop
    return fixed if fixed >= 0.0 else SLOP * extent


@inlined
def slop_of(state, a, b):
    """Metres that are nothing to this pair."""
    return slop_for(state, smaller_extent(state.bodies, a, b))


@inlined
def contact_margin(state, dt, a, b):
    """How near a pair is held before it touches: the slop, and twice the way that forces make in a step from rest."""
    bodies = state.bodies
    change = max(bodies.force_speed_change[a], bodies.force_speed_change[b])
    return slop_of(state, a, b) + MARGIN_STEPS * change * dt


@inlined
def reach_of(half, at):
    """How far from a body's centre of mass a box reaches around what is ``at`` from there, at most."""
    return min(length(half) + length(at), ENDLESS)


@inlined
def way_of_turning(bodies, i, turn):
    """How far turning so much moves points of body i, at most: none of a round one. As long for rates."""
    angle = size_of_turn(turn)
    return angle * bodies.reach[i] if angle > 0.0 and bodies.rolling_radius[i] == 0.0 else 0.0


@inlined
def turning_travel(state, span, a, b):
    """How far points of the two come nearer by turning, at most."""
    bodies, spin = state.bodies, state.bodies.spin
    if not state.spinning:
        return 0.0
    return span * (way_of_turning(bodies, a, spin[a]) + way_of_turning(bodies, b, spin[b]))


@inlined
def driven_travel(state, i):
    """How far motors may move points of body i beyond what its spin does."""
    bodies, angle = state.bodies, state.bodies.driven_turn
    if state.solver.joints.active == 0 or not angle[i] > 0.0:
        return 0.0
    return bodies.driven[i] + (angle[i] * bodies.reach[i] if bodies.rolling_radius[i] == 0.0 else 0.0)


@inlined
def is_turning(state, dt, a, b):
    """Whether the pair has another shape at other times of the step."""
    return turning_travel(state, dt, a, b) > SAME_PLACE * smaller_extent(state.bodies, a, b)


@inlined
def turning_margin(state, dt, a, b):
    """How near a pair is looked at before it touches: the same, and how far corners come by turning, or by motors."""
    driven = driven_travel(state, a) + driven_travel(state, b)
    return contact_margin(state, dt, a, b) + (turning_travel(state, dt, a, b) + driven)
