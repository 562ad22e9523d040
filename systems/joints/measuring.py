"""What rows of joints hold their bodies by, where these are now, and what they ask: points, a length, a way, an angle.

A joint is a few rows, which stand next to each other. POINT holds two anchors together, ROD the length between them,
SLIDE how far b's anchor is along an axis of a. Others are angles: TURN about an axis; in space ALIGN, by how much an
axis of b leads away from one of a in one direction, CONE, by how much in all, and TWIST, behind a CONE, how far b turns
about its axis beyond the shortest way there. CUSTOM is what a plugin says, see custom. Whole turns count: in space
against the angle that the joint had before.
"""

from __future__ import annotations

import math

from ...framework.compilation import inlined, part
from ...framework.elementary import atan2
from ...framework.vectors import add, add_scaled, dot, item, length, replace, scale, sub
from ..contacts.constants import FULL_PUSH_OVERLAP
from ..integration.turning import change_of_spin, compliance, cross_spin, end_of_turn, twist
from .coupling import compliance_of, couple, first_of, has_coupling, is_holding, is_idle, is_soft_spring
from .custom import measure_custom
from .records import ALIGN, CUSTOM, DRIVE, HELD_AT_ONCE, LIMIT, POINT, SERVO, SLIDE, TURN, TWIST

FULL_TURN = 2.0 * math.pi
FOLDED = 1e-2  # 1 + cosine of a swing: beyond it a twist is nearly any angle
BRAKES = 0.9  # of the speed from which a servo could just stop in time


@inlined
def turned_with(solver, q, arm):
    """An arm of body q as that is turned now."""
    return add(arm, end_of_turn(solver.turn[q], (solver.sine[q], solver.versine[q]), arm))


@inlined
def moved_by(solver, q, arm, along):
    """What an impulse at the end of an arm of body q changes of the velocity there."""
    spin = change_of_spin(solver, q, twist(arm, along))
    return add(scale(along, solver.inverse_mass[q]), cross_spin(spin, arm))


@inlined
def compute_point_mass(solver, j, zero):
    """The masses that impulses at two anchors move: the inverse of a matrix."""
    joints, d = solver.joints, len(zero)
    a, b, arm_a, arm_b = joints.first[j], joints.second[j], joints.arm_a[j], joints.arm_b[j]
    if d == 2:
        w, inertia = solver.inverse_mass[a] + solver.inverse_mass[b], solver.inverse_inertia
        i_a, i_b = inertia[a], inertia[b]
        x_a, y_a, x_b, y_b = item(arm_a, 0), item(arm_a, 1), item(arm_b, 0), item(arm_b, 1)
        xx = w + item(i_a, 0) * y_a * y_a + item(i_b, 0) * y_b * y_b
        yy = w + item(i_a, 0) * x_a * x_a + item(i_b, 0) * x_b * x_b
        xy = -item(i_a, 0) * x_a * y_a - item(i_b, 0) * x_b * y_b
        size = 1.0 / (xx * yy - xy * xy)
        joints.mass[j] = 1.0 / max(xx, yy)
        joints.inverse[j] = replace(replace(zero, 0, yy * size), 1, xx * size)
        joints.inverse_products[j] = replace(zero, 0, -xy * size)
        return
    x, y, z = replace(zero, 0, 1.0), replace(zero, 1, 1.0), replace(zero, d - 1, 1.0)
    x = add(moved_by(solver, a, arm_a, x), moved_by(solver, b, arm_b, x))
    y = add(moved_by(solver, a, arm_a, y), moved_by(solver, b, arm_b, y))
    z = add(moved_by(solver, a, arm_a, z), moved_by(solver, b, arm_b, z))
    xx, xy, yy = item(x, 0), item(x, 1), item(y, 1)
    xz, yz, zz = item(x, d - 1), item(y, d - 1), item(z, d - 1)
    aa, bb, cc = yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy
    ab, ac, bc = xz * yz - xy * zz, xy * yz - xz * yy, xy * xz - xx * yz
    size = xx * aa + xy * ab + xz * ac
    joints.mass[j] = 1.0 / max(xx, yy, zz)
    joints.inverse[j] = replace(replace(replace(zero, 0, aa / size), 1, bb / size), d - 1, cc / size)
    joints.inverse_products[j] = replace(replace(replace(zero, 0, ab / size), 1, ac / size), d - 1, bc / size)


@inlined
def turn_about(joints, j, axis, ends, axis_b):
    """The same of a TURN or a TWIST in space, of which its joint keeps the angle. ends: the directions between which
    it is; axis_b: of a TWIST the axis of b."""
    (end_a, end_b), rate, first = ends, axis, first_of(joints, j)
    if joints.kind[j] == TWIST:  # what is left where the shortest way has brought b's axis to a's
        between = add(axis, axis_b)
        rate = scale(between, 1.0 / max(FOLDED, dot(between, axis)))
        end_b = add_scaled(end_b, rate, -dot(axis, end_b))
    angle = atan2(dot(axis, cross_spin(end_a, end_b)), dot(end_a, end_b))
    angle += FULL_TURN * math.floor((joints.value[first] - angle) / FULL_TURN + 0.5)
    joints.value[first] = angle
    return rate, angle


@inlined
def angle_of(solver, j):
    """(along which a spin changes it, angle) of a row of angles: for most rows the axis."""
    joints = solver.joints
    a, b, rail = joints.first[j], joints.second[j], joints.rail[j]
    if len(rail) == 2:
        return rail, joints.angle[j] + item(solver.turn[b], 0) - item(solver.turn[a], 0)
    axis = turned_with(solver, a, rail)
    end_a, end_b = turned_with(solver, a, joints.base_a[j]), turned_with(solver, b, joints.base_b[j])
    if joints.kind[j] in (TURN, TWIST):
        axis_b = turned_with(solver, b, joints.base_b[j - 1]) if joints.kind[j] == TWIST else axis  # of the CONE before
        return turn_about(joints, j, axis, (end_a, end_b), axis_b)
    across = cross_spin(end_a, end_b)
    if joints.kind[j] == ALIGN:
        return axis, dot(axis, across)
    size = length(across)
    return scale(across, 1.0 / size) if size > 0.0 else axis, atan2(size, dot(end_a, end_b))


@inlined
def reach_at(solver, q, arm):
    """How far a body reaches; one without a collider reaches to where it is held."""
    return max(solver.reach[q], length(arm))


@inlined
def most_pushed(solver, j, size):
    """Of how much error of a row, by the size of its value, no more is pushed out at once, as of overlap: else bodies
    are thrown where joints ask for what cannot be, or from beyond a limit. Springs and values of others push it all."""
    joints = solver.joints
    if is_soft_spring(joints, j) or joints.kind[j] == CUSTOM:
        return math.inf
    reach = 1.0
    if joints.kind[j] < TURN:
        reach = reach_at(solver, joints.first[j], joints.arm_a[j]) + reach_at(solver, joints.second[j], joints.arm_b[j])
    return FULL_PUSH_OVERLAP * (reach + size)


@part
def update_joint_targets(solver, j, value):
    """What a row asks of the speed of its value, m/s or rad/s, and the impulses that it may have."""
    joints, target = solver.joints, 0.0
    rule, h, low, most = joints.rule[j], joints.step, joints.low[j], joints.most[j] * joints.step
    least = -most
    if rule == DRIVE:
        pushing = target = joints.target[j]
    elif rule == SERVO:
        pushing = low - value  # see servo_speed
    elif rule != LIMIT:
        bound = most_pushed(solver, j, max(abs(value), abs(low)))
        pushing = -joints.push_rate[j] * max(-bound, min(bound, value - low))
    else:
        below, above = value - low, joints.high[j] - value
        lower = below <= above
        room = below if lower else above
        bound = most_pushed(solver, j, max(abs(value), abs(low if lower else joints.high[j])))
        speed = -room / h if room > 0.0 else -joints.push_rate[j] * max(room, -bound)
        pushing = speed if lower else -speed
        if room > 0.0:
            target = pushing
        least, most = 0.0 if lower else least, most if lower else 0.0
    joints.target_speed[j], joints.pushing[j], joints.least[j], joints.greatest[j] = target, pushing, least, most


@inlined
def servo_speed(joints, j):
    """The speed of a servo, which starts to stop in time."""
    way, mass = joints.pushing[j], joints.mass[j]
    stops = BRAKES * math.sqrt(2.0 * joints.most[j] * abs(way) / mass) if mass > 0.0 else 0.0
    joints.target_speed[j] = joints.pushing[j] = math.copysign(min(joints.push_rate[j] * abs(way), stops), way)


@part
def measure_joints(solver, moved_for):
    """Where the joints of a range hold their bodies now, and what they ask. moved_for: s since they were measured."""
    joints, shift, order = solver.joints, solver.shift, solver.joints.order
    kinds, first, second, base_a, base_b = joints.kind, joints.first, joints.second, joints.base_a, joints.base_b
    between, arms_a, arms_b, gap, reach = joints.between, joints.arm_a, joints.arm_b, joints.gap, solver.reach
    usual = 1.0 / joints.stiffness
    usual_mass, usual_impulse = 1.0 / (1.0 + usual), usual / (1.0 + usual)  # divisions cost more than all else of a row
    for e in range(joints.begin, joints.end):
        j = order[e]
        kind, a, b = kinds[j], first[j], second[j]
        if kind == CUSTOM:
            update_joint_targets(solver, j, measure_custom(solver, j, moved_for))
            continue
        if kind >= TURN:
            axis, angle = angle_of(solver, j)
            joints.normal[j] = axis
            if not has_coupling(joints, j):
                moved = dot(axis, change_of_spin(solver, a, axis)) + dot(axis, change_of_spin(solver, b, axis))
                joints.mass[j] = 1.0 / moved if moved > 0.0 else 0.0
            update_joint_targets(solver, j, angle)
            continue
        arm_a, arm_b = turned_with(solver, a, base_a[j]), turned_with(solver, b, base_b[j])
        way = add(between[j], sub(add(shift[b], arm_b), add(shift[a], arm_a)))
        if kind == POINT:
            if joints.at_once[j] == HELD_AT_ONCE:  # both ends where b's is: great forces a gap apart turn them
                arm_a = add(arm_a, way)
            arms_a[j], arms_b[j], gap[j] = arm_a, arm_b, way
            compute_point_mass(solver, j, scale(way, 0.0))
            if is_holding(joints, j):
                rate, near = joints.rate, FULL_PUSH_OVERLAP * (reach[a] + reach[b])
                if dot(way, way) > near * near:  # else what bounds the push is farther away, whatever the arms
                    wide = length(way)
                    bound = most_pushed(solver, j, wide)
                    rate *= bound / wide if bound < wide else 1.0
                joints.push_rate[j] = rate
                gives, mass_scale, impulse_scale = compliance_of(solver, j, usual), usual_mass, usual_impulse
                if gives < usual:
                    mass_scale, impulse_scale = 1.0 / (1.0 + gives), gives / (1.0 + gives)
                joints.mass_scale[j], joints.impulse_scale[j] = mass_scale, impulse_scale
            continue
        normal, value = joints.normal[j], length(way)
        if kind == SLIDE:
            normal = turned_with(solver, a, joints.rail[j])
            arm_a, value = add(arm_a, way), dot(way, normal)
        elif value > 0.0:
            normal = scale(way, 1.0 / value)
        arms_a[j], arms_b[j], joints.normal[j], gap[j] = arm_a, arm_b, normal, scale(normal, value - joints.low[j])
        if not has_coupling(joints, j):
            moved = solver.inverse_mass[a] + solver.inverse_mass[b]
            joints.mass[j] = 1.0 / (moved + compliance(solver, a, arm_a, normal) + compliance(solver, b, arm_b, normal))
        update_joint_targets(solver, j, value)
    for e in range(joints.begin, joints.end):  # now that all rows are measured: those of a joint may come in any order
        j = order[e]
        if has_coupling(joints, j) and not has_coupling(joints, j - 1) and not is_idle(joints, j - 1):
            couple(solver, j - 1)
    for e in range(joints.begin, joints.end):
        if joints.rule[order[e]] == SERVO:
            servo_speed(joints, order[e])
