"""The bodies of joints: which joints take part in a step, what they keep apart, and where they hold their bodies."""

from __future__ import annotations

from ...framework.compilation import inlined, part
from ...framework.elementary import cos, sin
from ...framework.jit.records.record_type import zero_of
from ...framework.vectors import add, add_scaled, dot, item, length, replace, scale, sub
from ..codes import OK
from ..contacts.solving.rows import rotate_body
from ..contacts.solving.warm_start import row_of
from ..integration.turning import change_of_spin, cross_spin, turn_of_arm
from ..narrow_phase.stages import layers_meet
from ..parts.rows import next_row, owner_of
from ..shapes.poses import has_unequal_moments, row_of_axes
from .coupling import first_of
from .groups import join_held, may_move
from .measuring import turn_about
from .records import CUSTOM, DRIVE, FREE, POINT, SLIDE, TURN, TWIST


@inlined
def is_left_out(state, i):
    """Whether row i is a dynamic body that sleeps, or one that takes no part as it had a value that cannot be."""
    asleep = 0 <= i < state.dynamic and (i < state.first or state.bodies.sleep_state[i] > 0)
    return asleep or (i >= 0 and state.bodies.quarantined[i])


@inlined
def row_near(state, entity, row):
    """The row of a body, or -1 of the world: most are where they were, or one row on."""
    if entity == 0:
        return -1
    count, known = state.count, state.bodies.entity
    for i in range(row - 1, row + 2):
        if 0 <= i < count and known[i] == entity:
            return i
    return row_of(state, entity)


@inlined
def is_active(state, j):
    """Whether a row of joints has its bodies, and one of them may move."""
    joints = state.solver.joints
    a, b = joints.row_a[j], joints.row_b[j]
    gone = (a < 0 and joints.entity_a[j] > 0) or (b < 0 and joints.entity_b[j] > 0)
    if gone or is_left_out(state, a) or is_left_out(state, b) or joints.rule[j] == FREE:
        return False
    return may_move(state, a) or may_move(state, b)


@part
def find_active(state):
    """The rows of joints that hold a body which may move, in their order: motors and what else turns alone come first,
    as what they let open would give energy."""
    joints, found, alone = state.solver.joints, 0, False
    if joints.rows_version != state.version:
        for j in range(joints.count):
            joints.row_a[j] = row_near(state, joints.entity_a[j], joints.row_a[j])
            joints.row_b[j] = row_near(state, joints.entity_b[j], joints.row_b[j])
        joints.rows_version = state.version
    for j in range(joints.count):
        joints.old_load[j], joints.old_pull[j], joints.old_value[j] = joints.load[j], joints.pull[j], joints.value[j]
        joints.old_normal[j], joints.old_along_a[j] = joints.normal[j], joints.along_a[j]
        joints.total[j], joints.thrust[j] = 0.0, zero_of(state)
        alone |= TURN <= joints.kind[j] < CUSTOM and first_of(joints, j) == j
    for turning in (True, False):
        for j in range(joints.count if alone or not turning else 0):
            turns = alone and TURN <= joints.kind[first_of(joints, j)] < CUSTOM
            if turns == turning and is_active(state, j):
                joints.order[found] = j
                found += 1
    joints.active, joints.kept_in = found, state.step_number + 1
    join_held(state)


def begin_joints(state, dt):
    """Which joints take part; all bodies have the columns of those that spin, also where none does."""
    bodies, zero = state.bodies, zero_of(state)
    if not state.spinning:
        state.spinning = True
        for i in range(state.count):
            bodies.spin[i], bodies.turn[i], bodies.inverse_inertia[i] = zero, zero, zero
            bodies.inverse_products[i], bodies.rolling_radius[i], bodies.rolling_friction[i] = zero, 0.0, 0.0
    if not state.collides:
        state.solver.contacts = state.pairs.count = state.pairs.resting_count = 0
    find_active(state)
    if state.collides:
        find_driven(state, dt)
    return OK


@inlined
def spin_about(state, i, axis):
    """rad/s of body i, or the world, about an axis."""
    return dot(axis, state.bodies.spin[owner_of(state, i)]) if i >= 0 else 0.0


@part
def find_driven(state, dt):
    """By how much motors, which act in the solver, may turn each body in the step beyond what its spin does, and how
    far that moves its position. How far its points are from there is known later in the step."""
    joints, bodies = state.solver.joints, state.bodies
    for i in range(state.count):
        bodies.driven[i] = bodies.driven_turn[i] = 0.0
    for e in range(joints.active):
        j = joints.order[e]
        if not (joints.kind[j] == TURN and joints.rule[j] == DRIVE):
            continue
        a, b = joints.row_a[j], joints.row_b[j]
        axis, missing = joints.axis[j], joints.target[j]
        if len(axis) == 3:
            axis = turned_since(state, a, axis)
        missing -= spin_about(state, b, axis) - spin_about(state, a, axis)
        hold = first_of(joints, j)  # the point about which they turn
        for i, anchor in ((a, joints.anchor_a[hold]), (b, joints.anchor_b[hold])):
            if may_move(state, i):
                k = owner_of(state, i)
                angle = min(abs(missing), joints.most[j] * dt * dot(axis, change_of_spin(bodies, k, axis))) * dt
                way = angle * length(anchor) if joints.kind[hold] == POINT else 0.0
                while k >= 0:
                    bodies.driven[k] += way
                    bodies.driven_turn[k] += angle
                    k = next_row(state, k)


@part
def is_kept_apart(joints, a, b):
    """Whether a joint keeps two bodies, by their ids, from touching."""
    low, high = 0, joints.apart
    while low < high:
        middle = (low + high) // 2
        one, other = joints.apart_a[middle], joints.apart_b[middle]
        if one < a or (one == a and other < b):
            low = middle + 1
        else:
            high = middle
    return low < joints.apart and joints.apart_a[low] == a and joints.apart_b[low] == b


def leave_out_joined(state, dt):
    """Pairs of bodies that a joint keeps from touching are no candidates."""
    candidates, entity, joints, kept = state.candidates, state.bodies.entity, state.solver.joints, 0
    if joints.apart == 0:
        return OK
    first, second = candidates.first, candidates.second
    for c in range(candidates.count):
        a, b = first[c], second[c]
        first[kept], second[kept] = a, b
        one, other = entity[owner_of(state, a)], entity[owner_of(state, b)]
        kept += not (layers_meet(state, a, b) and is_kept_apart(joints, min(one, other), max(one, other)))
    candidates.count = kept
    return OK


@inlined
def turned_by_quaternion(rotation, i, v):
    """A vector in space, turned as body i is."""
    axis, k = v, 4 * i
    axis = replace(replace(replace(axis, 0, rotation[k + 1]), 1, rotation[k + 2]), len(v) - 1, rotation[k + 3])
    half = cross_spin(axis, v)
    return add(add_scaled(v, half, 2.0 * rotation[k]), scale(cross_spin(axis, half), 2.0))


@inlined
def turned_since(state, i, v):
    """A vector along the axes of body i, or of the world, as it is in the world."""
    rotation, axes = state.bodies.rotation, state.bodies.axes
    if len(rotation) == 0 or i < 0:
        return v
    if len(v) == 2:
        if len(axes) > 0 and state.bodies.axes_rotation[i] == rotation[i]:
            c, s = axes[4 * i], axes[4 * i + 2]
        else:
            c, s = cos(rotation[i]), sin(rotation[i])
        return replace(replace(v, 0, c * item(v, 0) - s * item(v, 1)), 1, s * item(v, 0) + c * item(v, 1))
    return turned_by_quaternion(rotation, i, v)


@inlined
def has_turned_by_impacts(state, i):
    """Whether impacts have turned body i in this step, of which its rotation knows nothing yet."""
    return state.impacts.logged > 0 and state.bodies.impact_count[i] > 0 and len(state.bodies.previous_rotation) > 0


@part
def turned_before(state, i, v):
    """The same where the step starts."""
    before = state.bodies.previous_rotation
    if len(before) == 0 or i < 0:
        return turned_since(state, i, v)
    if len(v) == 2:
        c, s = cos(before[i]), sin(before[i])
        return replace(replace(v, 0, c * item(v, 0) - s * item(v, 1)), 1, s * item(v, 0) + c * item(v, 1))
    return turned_by_quaternion(before, i, v)


@part
def turned_in_step(state, i, v):
    """The same where the step ends, as impacts have turned it."""
    if i < 0 or not has_turned_by_impacts(state, i):
        return turned_since(state, i, v)
    if has_unequal_moments(state, i):
        if len(state.bodies.axes) == 0:
            return turned_since(state, i, v)
        turned = v
        for k in range(len(v)):
            turned = replace(turned, k, dot(row_of_axes(state, i, k), v))
        return turned
    turned = turned_before(state, i, v)
    return add(turned, turn_of_arm(state.bodies.turn[i], turned))


@part
def angle_in_step(state, i):
    """The angle of body i in a plane, likewise; of the world 0."""
    if i < 0:
        return 0.0
    bodies = state.bodies
    if has_turned_by_impacts(state, i):
        return bodies.previous_rotation[i] + item(bodies.turn[i], 0)
    return bodies.rotation[i]


@part
def build_custom_rows(state, j):
    """Where the bodies of a row of a plugin are when the step starts, and their axes as it has turned them."""
    joints, bodies, zero = state.solver.joints, state.bodies, zero_of(state)
    a, b, d = joints.row_a[j], joints.row_b[j], len(zero)
    joints.base_a[j] = bodies.previous_position[a] if a >= 0 else zero
    joints.base_b[j] = bodies.previous_position[b] if b >= 0 else zero
    for k in range(d):
        axis = replace(zero, k, 1.0)
        joints.axes_a[d * j + k] = turned_in_step(state, a, axis)
        joints.axes_b[d * j + k] = turned_in_step(state, b, axis)


@part
def build_joint_rows(state):
    """Where the joints hold their bodies, as the step has turned these. The world has the place behind all bodies."""
    solver, joints, bodies, zero = state.solver, state.solver.joints, state.bodies, zero_of(state)
    ground = solver.bodies
    solver.velocity[ground], solver.shift[ground], solver.spin[ground] = zero, zero, zero
    rotate_body(solver, ground, zero)
    solver.inverse_mass[ground] = solver.reach[ground] = 0.0
    solver.inverse_inertia[ground], solver.inverse_products[ground] = zero, zero
    for e in range(joints.active):
        j = joints.order[e]
        a, b = joints.row_a[j], joints.row_b[j]
        if joints.kind[j] == CUSTOM:
            build_custom_rows(state, j)
            continue
        if joints.kind[j] == TURN and len(zero) == 2:
            joints.rail[j], joints.angle[j] = joints.axis[j], 0.0
            if len(bodies.rotation) > 0:
                joints.angle[j] = angle_in_step(state, b) - angle_in_step(state, a)
            continue
        start_a = bodies.previous_position[a] if a >= 0 else zero
        start_b = bodies.previous_position[b] if b >= 0 else zero
        joints.between[j] = sub(start_b, start_a)
        joints.base_a[j] = turned_in_step(state, a, joints.anchor_a[j])
        joints.base_b[j] = turned_in_step(state, b, joints.anchor_b[j])
        if joints.kind[j] == SLIDE or len(zero) == 3:
            joints.rail[j] = turned_in_step(state, a, joints.axis[j])


def count_turns(state, dt):
    """The angles of joints in space where the step ends, with whole turns."""
    joints = state.solver.joints
    for j in range(joints.count if len(zero_of(state)) == 3 else 0):
        a, b, above = joints.row_a[j], joints.row_b[j], max(j - 1, 0)
        if joints.kind[j] in (TURN, TWIST) and not (is_left_out(state, a) or is_left_out(state, b)):
            axis, axis_b = turned_since(state, a, joints.axis[j]), turned_since(state, b, joints.anchor_b[above])
            ends = turned_since(state, a, joints.anchor_a[j]), turned_since(state, b, joints.anchor_b[j])
            if joints.rule[j] == FREE:  # others have been counted in each substep
                joints.value[first_of(joints, j)] += dt * (spin_about(state, b, axis) - spin_about(state, a, axis))
            turn_about(joints, j, axis, ends, axis_b)
    return OK
