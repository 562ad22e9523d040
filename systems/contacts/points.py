"""The points of a pair at rest, where bodies spin: how many rows it has, and the arms of these."""

from __future__ import annotations

import math

from ...framework.compilation import inlined, part
from ...framework.jit.records.record_type import zero_of
from ...framework.jit.stack_arrays import stack_array
from ...framework.vectors import add, add_scaled, dot, length, replace, row, scale, store, sub
from ..ccd.search_bounds import FAST, turns_far
from ..ccd.turning_touch import FOLLOWED_TURN, turn_of_path
from ..codes import OK
from ..integration.turning import cross_spin, is_turned, size_of_turn, turn_of_arm
from ..linking.parts import TOUCH_OF_TURN, TURN_BACK, call_of_step, call_touch_of_turn
from ..narrow_phase.manifolds import centre_offset_at_start, evaluate_pair, forget_manifold, has_manifold
from ..shapes.convex.points import MOST_POINTS, contact_points, is_same
from ..shapes.linking.convex_by_address import convex_at, rounding_by_address, support_by_address
from ..shapes.tolerances import reach_of, smaller_extent, turning_margin
from .constants import UNREACHED

INWARDS, LEVEL = 0.2, 1.0 - 1e-6  # extents: that nearer to the middle the normal of a face is the same, to this cosine
SAME_FACE = 0.9  # cosine between the normals of a first touch and of the end: other points of the end count, too
TILT = 0.1  # rad: faces whose normals are so near that of the contact touch along their length, or soon will


@inlined
def points_of(state, c):
    """How many rows pair c has."""
    bodies, a, b = state.bodies, state.pairs.a[c], state.pairs.b[c]
    if not (is_turned(bodies, a) or is_turned(bodies, b)) or bodies.rolling_radius[a] + bodies.rolling_radius[b] > 0.0:
        return 1
    return 2 if len(zero_of(state)) == 2 else MOST_POINTS


@inlined
def rows_from(solver, r):
    """How many rows the pair has whose first is r."""
    e = 1
    while r + e < solver.contacts and solver.point[r + e] == e:
        e += 1
    return e


@inlined
def point_rounding(state, i):
    """How far the shape of body i reaches beyond its core."""
    shape = convex_at(state.shapes.parameters[state.bodies.shape[i]], i)
    return rounding_by_address(shape) if shape[1] != 0 else 0.0


@inlined
def rolling_between(bodies, a, b):
    """The rolling friction of two bodies."""
    return max(bodies.rolling_friction[a], bodies.rolling_friction[b])


@part
def build_arms(state, dt, r, gap):
    """The points of the pair whose first row is r: gaps, and the arms to both bodies. Shapes stand as they are turned
    where the step ends; rows that the pair does not need are never reached."""
    solver, pairs, bodies = state.solver, state.pairs, state.bodies
    c, first = solver.pair[r], solver.slot[r]
    a, b, normal, extent = pairs.a[c], pairs.b[c], solver.normal[first], solver.extent[first]
    d, nothing = centre_offset_at_start(bodies, a, b), zero_of(state)
    places, gaps = stack_array(MOST_POINTS, nothing), stack_array(MOST_POINTS, 0.0)
    point = pairs.point[c]
    if not has_manifold(pairs, c) and bodies.impact_count[a] + bodies.impact_count[b] > 0:  # which have turned shapes
        _, _, _, point = evaluate_pair(state, a, b, d)
    count, rows = 1, rows_from(solver, r)
    store(places, 0, point)
    gaps[0] = gap
    if rows > 1:
        tilt = TILT + dt * (size_of_turn(bodies.spin[a]) + size_of_turn(bodies.spin[b]))
        tilt += max(0.0, -gap) / extent  # no end of a face that overlaps is left out
        margin = turning_margin(state, dt, a, b)
        count = contact_points(state, (a, b), d, (-gap, normal, point), (margin, tilt), places, gaps)
    round_a, round_b = point_rounding(state, a), point_rounding(state, b)
    radius_a, radius_b = bodies.rolling_radius[a], bodies.rolling_radius[b]
    solver.has_rolling |= rolling_between(bodies, a, b) > 0.0
    every = 2 if 2 * count == rows else 1  # two of four are in the rows that are solved at once
    for e in range(rows):
        k, one = solver.slot[r + e], min(e // every, count - 1)
        at, between = row(places, one, nothing), gaps[one]
        solver.place[k], solver.gap[k] = at, between if e == one * every else UNREACHED * extent
        arm_a = add(bodies.offset[a], add_scaled(at, normal, -0.5 * between))
        arm_b = add(bodies.offset[b], add_scaled(sub(at, d), normal, 0.5 * between))
        arm_a = scale(normal, radius_a) if radius_a > 0.0 else arm_a
        arm_b = scale(normal, -radius_b) if radius_b > 0.0 else arm_b
        solver.arm_a[k], solver.core_a[k] = arm_a, add_scaled(arm_a, normal, -round_a)
        solver.arm_b[k], solver.core_b[k] = arm_b, add_scaled(arm_b, normal, round_b)


@part
def slides_past(state, a, b, normal, arm_a, arm_b):
    """Whether surfaces that touch stay where they are along the normal while their bodies turn, as those of a turntable
    and of what it carries: by less than a part of the smaller body, all over it. In a plane nothing does."""
    bodies = state.bodies
    if len(normal) == 2:
        return False
    reach = min(reach_of(bodies.half_extents[a], bodies.offset[a]), reach_of(bodies.half_extents[b], bodies.offset[b]))
    way = abs(dot(cross_spin(bodies.turn[a], arm_a), normal)) + reach * length(cross_spin(bodies.turn[a], normal))
    way += abs(dot(cross_spin(bodies.turn[b], arm_b), normal)) + reach * length(cross_spin(bodies.turn[b], normal))
    return way <= FAST * smaller_extent(bodies, a, b)


@part
def is_ball(state, i, way):
    """Whether the shape of body i is a point with a rounding."""
    shape = convex_at(state.shapes.parameters[state.bodies.shape[i]], i)
    if shape[0] == 0 or not point_rounding(state, i) > 0.0:
        return False
    return is_same(support_by_address(shape, way), support_by_address(shape, scale(way, -1.0)))


@part
def note_middles(state, r, all_alike):
    """The middle about which each body of a contact rolls, from its mass centre: that of a ball which contacts turn.
    all_alike: none where another of its contacts, which are all noted by now, has another one."""
    solver, pairs, bodies = state.solver, state.pairs, state.bodies
    c, k = solver.pair[r], solver.slot[r]
    for i, q in ((pairs.a[c], solver.first[k]), (pairs.b[c], solver.second[k])):
        middle = bodies.offset[i]
        if not (dot(middle, middle) > 0.0 and is_turned(bodies, i) and is_ball(state, i, solver.normal[k])):
            middle = zero_of(state)
        if all_alike:
            other = sub(solver.middle[q], middle)
            solver.middle[q] = scale(middle, 0.0) if dot(other, other) > 0.0 else middle
        elif dot(middle, middle) > 0.0:
            solver.middle[q], solver.lopsided = middle, True


@part
def core_travel(state, i):
    """How far turning moves points of body i at most, but for its rounding: that of a ball or rod turns on the spot."""
    bodies, turn, along, squares = state.bodies, state.bodies.turn[i], zero_of(state), 0.0
    shape, angle = convex_at(state.shapes.parameters[bodies.shape[i]], i), size_of_turn(turn)
    if shape[0] == 0 or not point_rounding(state, i) > 0.0 or not angle > 0.0:
        return angle * bodies.reach[i]
    for k in range(len(along)):
        across = cross_spin(turn, replace(zero_of(state), k, 1.0))
        along = across if dot(across, across) > dot(along, along) else along
    for _ in range(2):  # both directions across the axis
        along = scale(along, 1.0 / length(along))
        middle, back = dot(bodies.offset[i], along), scale(along, -1.0)
        high, low = dot(support_by_address(shape, along), along), dot(support_by_address(shape, back), back)
        most = max(high + middle, low - middle)
        squares += most * most
        along = cross_spin(turn, along)
    return angle * math.sqrt(squares)


@part
def rolls(state, a, b):
    """Whether what turns far of a pair is rounded, and all else of it goes by less than a part of the smaller."""
    return core_travel(state, a) + core_travel(state, b) <= FAST * smaller_extent(state.bodies, a, b)


@part
def lies_on_face(state, sides, d, turn, normal):
    """Whether of two bodies, of which one is a ball, the other is touched on a face that turns on by little.
    d: from a to b at the touch; turn: of the other body, from then to the end of the step, where its shape stands."""
    bodies, (a, b) = state.bodies, sides
    if length(turn) > FOLLOWED_TURN:
        return False
    face = add(normal, turn_of_arm(turn, normal))
    ends = add(add(d, turn_of_arm(turn, d)), sub(bodies.offset[b], bodies.offset[a]))
    aside = add_scaled(ends, face, -dot(ends, face))
    size = length(aside)
    inwards = min(size, INWARDS * smaller_extent(bodies, a, b)) / size if size > 0.0 else 0.0
    return dot(evaluate_pair(state, a, b, add_scaled(ends, aside, -inwards))[2], face) > LEVEL


@part
def nearest_row(solver, r, rows, core_a, core_b):
    """Of the rows of a pair, which begin with r, the one whose point is nearest to that of these arms."""
    nearest, at = math.inf, r
    for one in range(r, r + rows):
        k = solver.slot[one]
        away = length(sub(solver.core_a[k], core_a)) + length(sub(solver.core_b[k], core_b))
        if away < nearest and solver.gap[k] < 0.5 * UNREACHED * solver.extent[k]:
            nearest, at = away, one
    return at


@part
def lay_first_touch(state, dt, r):
    """The rows of a pair of which one body turns far, if it touches on the way: one is that of the touch, as they are
    turned then. Others stay as at the end if the face is the same, and are out of reach if it is not.

    The gap and the arms of the touch are led back to where the shapes stand in the other rows.
    """
    solver, pairs, bodies = state.solver, state.pairs, state.bodies
    c = solver.pair[r]
    a, b = pairs.a[c], pairs.b[c]
    address = state.links[TOUCH_OF_TURN]
    touches, share, gap, normal, point, begin, way = call_touch_of_turn(address, state, dt, a, b)
    if not touches:
        return
    start, between = sub(bodies.previous_position[b], bodies.previous_position[a]), add(begin, way)
    left_a, left_b = scale(turn_of_path(state, a, dt), share - 1.0), scale(turn_of_path(state, b, dt), share - 1.0)
    arm_a = add(add(bodies.offset[a], turn_of_arm(left_a, bodies.offset[a])), add_scaled(point, normal, -0.5 * gap))
    arm_b = sub(add(arm_a, scale(normal, gap)), between)
    if share == 0.0 and slides_past(state, a, b, normal, arm_a, arm_b):
        return  # the points of the end of the step are as good, and more
    ball_a, ball_b = is_ball(state, a, normal), is_ball(state, b, normal)
    onwards = scale(left_b if ball_a else left_a, -1.0)
    free = (bodies.inverse_mass[b] if ball_a else bodies.inverse_mass[a]) > 0.0  # else a ball that sinks in is put back
    led = free and ball_a != ball_b and lies_on_face(state, (a, b), between, onwards, normal)
    if led:  # the face is where the step has turned it
        arm_a, arm_b = add(arm_a, turn_of_arm(onwards, arm_a)), add(arm_b, turn_of_arm(onwards, arm_b))
        normal = add(normal, turn_of_arm(onwards, normal))
        left_a, left_b = scale(left_a, 0.0), scale(left_b, 0.0)
    if led and ball_a:
        arm_a = add_scaled(bodies.offset[a], normal, point_rounding(state, a))
    if led and ball_b:
        arm_b = add_scaled(bodies.offset[b], normal, -point_rounding(state, b))
    if bodies.rolling_radius[a] > 0.0:
        arm_a = scale(normal, bodies.rolling_radius[a])
    if bodies.rolling_radius[b] > 0.0:
        arm_b = scale(normal, -bodies.rolling_radius[b])
    core_a = add_scaled(arm_a, normal, -point_rounding(state, a))
    core_b = add_scaled(arm_b, normal, point_rounding(state, b))
    core_a = add(core_a, turn_of_arm(scale(left_a, -1.0), core_a))
    core_b = add(core_b, turn_of_arm(scale(left_b, -1.0), core_b))
    before = add(add(way, sub(begin, start)), sub(turn_of_arm(left_b, core_b), turn_of_arm(left_a, core_a)))
    apart = dot(add(start, sub(arm_b, arm_a)), normal) if led else gap - dot(before, normal)
    same_face, rows = dot(solver.normal[solver.slot[r]], normal) > SAME_FACE, rows_from(solver, r)
    at = nearest_row(solver, r, rows, core_a, core_b) if same_face else r
    for one in range(r, r + rows):
        k = solver.slot[one]
        solver.apart[k], solver.parting[k] = True, False
        if one == at:
            solver.normal[k], solver.place[k], solver.gap[k] = normal, point, apart
            solver.arm_a[k], solver.arm_b[k], solver.core_a[k], solver.core_b[k] = arm_a, arm_b, core_a, core_b
        elif not same_face:
            solver.gap[k] = UNREACHED * solver.extent[k]
    pairs.normal[c] = normal
    forget_manifold(pairs, c)


def lay_arms(state, dt):
    """The points of all contacts at rest."""
    solver, pairs, offset = state.solver, state.pairs, state.bodies.offset
    solver.lopsided = False
    for r in range(solver.contacts):
        if solver.point[r] == 0:
            a, b = pairs.a[solver.pair[r]], pairs.b[solver.pair[r]]
            build_arms(state, dt, r, solver.gap[solver.slot[r]])
            if dot(offset[a], offset[a]) + dot(offset[b], offset[b]) > 0.0:
                note_middles(state, r, False)
            if turns_far(state, a, b) and not rolls(state, a, b):
                lay_first_touch(state, dt, r)
    for r in range(solver.contacts if solver.lopsided else 0):
        note_middles(state, r, True)
    if solver.lopsided and solver.joints.active == 0 and len(zero_of(state)) == 3:
        call_of_step(state.links[TURN_BACK], state, dt)
    for r in range(solver.contacts if solver.has_rolling else 0):
        c = solver.pair[r]
        solver.rolling[solver.slot[r]] = rolling_between(state.bodies, pairs.a[c], pairs.b[c])
    return OK
