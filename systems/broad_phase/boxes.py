"""Stages of BROAD: boxes around the motion of each body, widened where bodies are swept."""

from __future__ import annotations

import math

from ...framework.compilation import inlined, part
from ...framework.jit.records.record_type import zero_of
from ...framework.vectors import add, at_most, filled, item, larger, shifted, smaller, smallest, sub
from ..ccd.search_bounds import GIVE, find_margins, place_at
from ..codes import OK
from ..integration.turning import size_of_turn
from ..linking.parts import BOUND_SEARCHES, call_bound_searches
from ..shapes.dispatch import half_extents, half_thickness, write_rotated
from ..shapes.surfaces import along_world
from ..shapes.tolerances import driven_travel, reach_of
from .brute_force import BRUTE_FORCE_MAX
from .records import HIGHEST, LARGEST_EXTENT, LOWEST
from .uniform_grid import OUTSIDE_MAX, move_in_grid

# Of the body's smallest half extent, on each side: bodies deflected within the step still meet their neighbours.
BOX_MARGIN = 0.1


@inlined
def fixed_count(state):
    """How many bodies do not move in this step: sleepers and static ones."""
    return state.first + state.count - state.moving


@inlined
def fixed_row(state, k):
    """The row of the k-th of these."""
    return k if k < state.first else k - state.first + state.moving


@part
def find_extents(state, level, start, stop):
    """Half extents of one level of rows start..stop-1 and where it stands from the body's position; nan without one.

    The smallest extent of the last level stays, along the axes of the world or of its body. Returns the least of these,
    but for bodies without any.
    """
    bodies, offset, slots, thinnest = state.bodies, state.colliders.offset, state.shapes.slots, math.inf
    offsets, reach = bodies.level_offsets, bodies.reach
    for i in range(start, stop):
        shape, half, least = bodies.levels[level, i], filled(zero_of(state), math.nan), math.inf
        if shape >= 0:
            at = offset[slots[shape], i]
            if state.rotated:
                at = along_world(state, i, at)
                write_rotated(state, shape, i)
                least = half_thickness(state, shape, i)
            offsets[level, i] = at
            half = half_extents(state, shape, i)
        least = min(smallest(half), least)
        extent = 2.0 * least if least < math.inf else 0.0  # what has no end is to others as a point
        bodies.half_extents[i], bodies.min_extent[i] = half, extent
        if len(reach) > 0:
            reach[i] = reach_of(half, offsets[level, i])
        thinnest = extent if 0.0 < extent < thinnest else thinnest
    return thinnest


@part
def box_level(state, level, i, before, after):
    """The box of one level of a body that moves from ``before`` to ``after``; of nan if it has no shape."""
    at, half = state.bodies.level_offsets[level, i], state.bodies.half_extents[i]
    margin, first, last = BOX_MARGIN * smallest(half), add(before, at), add(after, at)
    return shifted(sub(smaller(first, last), half), -margin), shifted(add(larger(first, last), half), margin)


@part
def grid_stop(state):
    """The row behind those of the grid of what moves. Kinematic bodies are often long: if they are few they are outside
    of it."""
    dynamic, moving = state.dynamic, state.moving
    few = moving - dynamic <= OUTSIDE_MAX // 2 and dynamic - state.first > BRUTE_FORCE_MAX
    return dynamic if few else moving


@part
def measure_frame(state):
    """The frame holds the boxes of what may be in the grid of what moves; those of nan count for nothing."""
    frame, bodies, zero, largest = state.frame, state.bodies, zero_of(state), 0.0
    lowest, highest = filled(zero, math.inf), filled(zero, -math.inf)
    for i in range(state.first, grid_stop(state)):
        low, high, longest = bodies.lower[i], bodies.upper[i], 0.0
        lowest, highest = smaller(lowest, low), larger(highest, high)
        for k in range(len(low)):
            edge = item(high, k) - item(low, k)
            longest = edge if edge > longest else longest  # comparisons with nan are false
        largest = longest if longest > largest else largest  # one comparison a body waits for the one before
    for k in range(len(lowest)):
        frame[LOWEST + k], frame[HIGHEST + k] = item(lowest, k), item(highest, k)
    frame[LARGEST_EXTENT] = largest


@part
def any_meet(state):
    """Whether layers and masks let any two bodies meet that move. Debris that meets walls alone need not be searched
    for others of it, however crowded."""
    bodies, layer, mask = state.bodies, state.colliders.layer, state.colliders.mask
    slot, layers, masks = bodies.collider_slot, 0, 0
    for i in range(state.first, state.moving if len(mask) > 0 else state.first):
        if bodies.shape[i] >= 0:
            layers, masks = layers | layer[slot[i], i], masks | mask[slot[i], i]
    return len(mask) == 0 or layers & masks != 0


@part
def follow_static_places(state):
    """Static bodies have changed if one stands elsewhere than its box: code of the game has written its place."""
    bodies, moving, moved = state.bodies, state.moving, False
    for i in range(moving, state.count if state.positions_exposed else moving):
        here, before = bodies.position[i], bodies.static_position[i - moving]
        for k in range(len(here)):
            moved |= (item(here, k) != item(before, k)) & (item(here, k) == item(here, k))  # nan has not moved
    if moved and state.boxed_version == state.statics_version:
        state.statics_version += 1


@part
def hold_turns(state, start, stop):
    """Boxes hold what bodies sweep by turning, and as far as motors may turn them: they are those of shapes as they are
    turned where the step ends."""
    bodies = state.bodies
    lower, upper = bodies.lower, bodies.upper
    for i in range(start, stop):
        angle, driven = size_of_turn(bodies.turn[i]), driven_travel(state, i)
        turned = angle > 0.0 and bodies.rolling_radius[i] == 0.0
        if turned or driven > 0.0:
            way = (min(angle, 2.0) * bodies.reach[i] if turned else 0.0) + driven
            lower[i], upper[i] = shifted(lower[i], -way), shifted(upper[i], way)


# Where the motion of a box begins and ends. STAYING: where the body is, and the box may be one of the uniform grid.
STANDING, MOVING, SEARCHING, STAYING = range(4)


@part
def box_rows(state, start, stop, motion):
    """Boxes of rows start..stop-1: of bodies that stand, around their motion, or from search_lower to search_upper; the
    frame holds those of the grid of what moves.

    A box holds every level, so that what the first one meets is looked at.
    """
    bodies = state.bodies
    lower, upper = bodies.lower, bodies.upper
    starts = ends = bodies.position
    if motion == MOVING and state.moved:
        starts = bodies.previous_position
    if motion == SEARCHING:
        starts, ends = bodies.search_lower, bodies.search_upper
    thinnest = find_extents(state, 0, start, stop)
    for i in range(start, stop):
        low, high = box_level(state, 0, i, starts[i], ends[i])
        if motion == STAYING and not contains_box(lower[i], upper[i], low, high):
            move_in_grid(state.grid, i, low, high)
        lower[i], upper[i] = low, high
    for level in range(1, state.level_count):
        thinnest = find_extents(state, level, start, stop)
        for i in range(start, stop):
            low, high = box_level(state, level, i, starts[i], ends[i])
            lower[i], upper[i] = smaller(lower[i], low), larger(upper[i], high)
    if state.spinning and motion in (MOVING, SEARCHING):
        hold_turns(state, start, stop)
    if motion == STANDING:
        state.thinnest_static = min(state.thinnest_static, thinnest)
    elif motion != STAYING:
        state.thinnest_moving = thinnest
        measure_frame(state)


@part
def contains_box(lower, upper, low, high):
    """Whether lower..upper holds the box low..high, or this is of nan."""
    return (at_most(lower, low) and at_most(high, upper)) or low[0] != low[0]


def box_statics(state, dt):
    """Boxes of what does not move and of sleepers, made again only when these have changed."""
    bodies, moving = state.bodies, state.moving
    follow_static_places(state)
    if state.boxed_version != state.statics_version:
        for k in range(fixed_count(state)):
            i = fixed_row(state, k)
            bodies.previous_position[i] = bodies.origin[i] = bodies.position[i]
            if i >= moving:
                bodies.static_position[i - moving] = bodies.position[i]
        state.thinnest_static = math.inf
        box_rows(state, 0, state.first, STANDING)
        box_rows(state, moving, state.count, STANDING)
        state.boxed_version = state.statics_version
    return OK


def box_motions(state, dt):
    """Boxes around the motion of what moves; where bodies are swept, with room for what impacts make of it."""
    bodies = state.bodies
    state.neighbours_known_until, state.candidates_ready = math.inf, True
    if state.all_still:
        return OK
    state.grid.suits = False  # until it is made of these boxes
    state.moving_meet = any_meet(state)
    box_rows(state, state.first, state.moving, MOVING)
    if state.sweeping and state.moved:
        for i in range(state.first, state.moving):
            bodies.search_lower[i], bodies.search_upper[i] = bodies.previous_position[i], bodies.position[i]
        call_bound_searches(state.links[BOUND_SEARCHES], state, 0.0, dt)
    return OK


def box_standing(state, dt):
    """For queries, when the uniform grid has the boxes of the last step: boxes where the bodies are now. Those that
    have left theirs are outside the grid, which suits as long as these are few."""
    box_rows(state, state.first, state.moving, STAYING)
    return OK


def bound_searches(state, now, dt):
    """Boxes around the paths of what moves from ``now`` on, with room for what impacts make of these; or, where that
    would be too many candidates, around the next part of the paths: until ``state.neighbours_known_until``.

    search_lower, search_upper: the place at ``now`` and at the end when this is called, afterwards the bounds.
    """
    bodies, first, moving = state.bodies, state.first, state.moving
    lower, upper, crossing = bodies.search_lower, bodies.search_upper, find_margins(state, now, dt - now)
    state.neighbours_known_until = now + crossing if now + crossing < dt else math.inf
    if now > 0.0 or state.neighbours_known_until < dt:
        for i in range(first, moving):
            upper[i] = place_at(state, i, min(state.neighbours_known_until, dt), dt)
        box_rows(state, first, moving, SEARCHING)
    for i in range(first, moving):
        margin, before, after = bodies.search_margin[i], lower[i], upper[i]
        give = margin + GIVE * bodies.min_extent[i]
        bodies.lower[i], bodies.upper[i] = shifted(bodies.lower[i], -margin), shifted(bodies.upper[i], margin)
        lower[i], upper[i] = shifted(smaller(before, after), -give), shifted(larger(before, after), give)
    measure_frame(state)
    return 0


def box_rest_of_step(state, dt):
    """Boxes for what is left of the step, after an impact has sent a body out of its search bounds."""
    now, state.grid.suits = state.impacts.until, False
    for i in range(state.first, state.moving):
        state.bodies.search_lower[i] = place_at(state, i, now, now)
    call_bound_searches(state.links[BOUND_SEARCHES], state, now, dt)
    return OK
