"""Joints of an island that are solved all at once, by elimination of one body after the other (Cholesky).

Passes over one joint after the other let heavy loads, beams and towers of joints give way. Where these hold without a
limit their equations are solved as they are: of all velocities those are taken that least change the motion, in the
measure of kinetic energy, and what goes into the joints, which are soft springs where the pass pushes and nearly rigid
where it does not. In the measure u with v = R u, where R R' are the inverse masses, this is (1 + J' W J) u = J' W b.

Bodies with few neighbours go first: in trees no other pair of bodies than those of joints appears. An island in which
a body would have more than MOST_NEIGHBOURS neighbours is solved by passes, as all others are.
"""

from __future__ import annotations

import math

from ...framework.compilation import inlined, part
from ...framework.jit.stack_arrays import stack_array
from ...framework.vectors import add, add_scaled, dot, item, replace, scale, sub
from ..contacts.constants import DIRECT_STIFFNESS, DIRECT_STIFFNESS_MAX, FRAME_BEND
from ..integration.turning import change_of_spin, compliance, cross_spin, twist
from .custom import speed_of_custom
from .order import NO_BLOCK, block_of, freedoms, numbers_of
from .records import CUSTOM, HELD_AT_ONCE, LIMIT, LIMITED_AT_ONCE, POINT, TURN

# What is asked of rows: to push errors out, to hold without that, to hold what is left; RESULT_OF: of the solution.
PUSH_PASS, RELAX_PASS, REFINE_PASS, RESULT_OF = 0, 1, 2, 3


@part
def mass_root(solver, q):
    """The root of the inverse inertia of a body: below the diagonal, row by row."""
    root, d, p = solver.direct.root, solver.inverse_inertia[q], solver.inverse_products[q]
    if len(d) == 2:
        root[q, 0] = math.sqrt(item(d, 0))
        return
    last = len(d) - 1
    a = math.sqrt(max(0.0, item(d, 0)))
    b = item(p, 0) / a if a > 0.0 else 0.0
    c = item(p, 1) / a if a > 0.0 else 0.0
    e = math.sqrt(max(0.0, item(d, 1) - b * b))
    f = (item(p, last) - b * c) / e if e > 0.0 else 0.0
    root[q, 0], root[q, 1], root[q, 2], root[q, 3], root[q, 4] = a, b, e, c, f
    root[q, 5] = math.sqrt(max(0.0, item(d, last) - c * c - f * f))


@inlined
def to_energy_norm(solver, q, push, turn, out):
    """R' times an impulse and an angular impulse of body q."""
    root, d = solver.direct.root, len(push)
    w = math.sqrt(solver.inverse_mass[q])
    for k in range(d):
        out[k] = w * item(push, k)
    if d == 2:
        out[2] = root[q, 0] * item(turn, 0)
    else:
        x, y, z = item(turn, 0), item(turn, 1), item(turn, d - 1)
        out[3] = root[q, 0] * x + root[q, 1] * y + root[q, 3] * z
        out[4] = root[q, 2] * y + root[q, 4] * z
        out[5] = root[q, 5] * z


@inlined
def from_energy_norm(solver, q, like):
    """(velocity, spin) of the solution of body q: R times that."""
    root, x, d = solver.direct.root, solver.direct.solution, len(like)
    w, v, spin = math.sqrt(solver.inverse_mass[q]), like, scale(like, 0.0)
    for k in range(d):
        v = replace(v, k, w * x[q, k])
    if d == 2:
        return v, replace(spin, 0, root[q, 0] * x[q, 2])
    spin = replace(spin, 0, root[q, 0] * x[q, 3])
    spin = replace(spin, 1, root[q, 1] * x[q, 3] + root[q, 2] * x[q, 4])
    return v, replace(spin, d - 1, root[q, 3] * x[q, 3] + root[q, 4] * x[q, 4] + root[q, 5] * x[q, 5])


@inlined
def directions_at(joints, j, k):
    """(impulse of a, its turn, impulse of b, its turn) that 1 N s or N m s of row j gives; of a POINT its axis k."""
    along, kind = joints.normal[j], joints.kind[j]
    if kind == CUSTOM:
        return joints.along_a[j], joints.turn_a[j], along, joints.turn_b[j]
    zero = scale(along, 0.0)
    if kind >= TURN:
        return zero, scale(along, -1.0), zero, along
    if kind == POINT:
        along = replace(zero, k, 1.0)
    return scale(along, -1.0), scale(twist(joints.arm_a[j], along), -1.0), along, twist(joints.arm_b[j], along)


@inlined
def inverse_mass_of(solver, j):
    """How stiff a row is: as if it bore the heaviest body of its group; of angles, at the end of a beam of welds."""
    joints, a, b, axis = solver.joints, solver.joints.first[j], solver.joints.second[j], solver.joints.normal[j]
    direct, g = solver.direct, joints.group[j]
    bend = max(1.0, FRAME_BEND * direct.welds[g] ** 2) if joints.kind[j] >= TURN else 1.0
    stiffness = direct.stiffer * joints.stiffness * (DIRECT_STIFFNESS / direct.heavy[g] * bend)
    w = max(solver.inverse_mass[a], solver.inverse_mass[b])
    if joints.kind[j] == CUSTOM:
        return min(stiffness * w, DIRECT_STIFFNESS_MAX) * joints.mass[j]
    if joints.kind[j] >= TURN:
        moved = dot(axis, change_of_spin(solver, a, axis)) + dot(axis, change_of_spin(solver, b, axis))
        return min(stiffness * w, DIRECT_STIFFNESS_MAX) / moved if moved > 0.0 else 0.0
    if joints.kind[j] == POINT:
        return min(stiffness, DIRECT_STIFFNESS_MAX * joints.mass[j])
    moved = compliance(solver, a, joints.arm_a[j], axis) + compliance(solver, b, joints.arm_b[j], axis)
    return min(stiffness, DIRECT_STIFFNESS_MAX / (solver.inverse_mass[a] + solver.inverse_mass[b] + moved))


@inlined
def add_square(direct, q, of, weight, n):
    """What a row adds to the diagonal block of body q."""
    for i in range(n):
        by = weight * of[i]
        for k in range(i + 1):
            direct.diagonal[q, n * i + k] += by * of[k]


@part
def add_row(solver, j, weight):
    """J' W J of row j."""
    joints, direct = solver.joints, solver.direct
    a, b, zero = joints.first[j], joints.second[j], scale(joints.normal[j], 0.0)
    n, of_a, of_b = freedoms(zero), stack_array(6, 0.0), stack_array(6, 0.0)
    moves_a, moves_b = solver.island[a] >= 0, solver.island[b] >= 0
    block, first = NO_BLOCK, a
    if moves_a and moves_b:
        first = a if direct.place[a] < direct.place[b] else b
        block = block_of(direct, first, b if first == a else a)
    for axis in range(numbers_of(joints, j)):
        push_a, turn_a, push_b, turn_b = directions_at(joints, j, axis)
        if moves_a:
            to_energy_norm(solver, a, push_a, turn_a, of_a)
            add_square(direct, a, of_a, weight, n)
        if moves_b:
            to_energy_norm(solver, b, push_b, turn_b, of_b)
            add_square(direct, b, of_b, weight, n)
        if block != NO_BLOCK:
            for i in range(n):
                for k in range(n):
                    if first == a:
                        direct.values[block, n * i + k] += weight * of_a[i] * of_b[k]
                    else:
                        direct.values[block, n * i + k] += weight * of_b[i] * of_a[k]


@part
def factorise_body(direct, q, n):
    """The root of the diagonal block of body q, and its blocks with those that go after it divided by that. What is
    left of 1 + J' W J is never less than 1, but for rounding."""
    diagonal, values = direct.diagonal, direct.values
    for i in range(n):
        for k in range(i + 1):
            left = diagonal[q, n * i + k]
            for m in range(k):
                left -= diagonal[q, n * i + m] * diagonal[q, n * k + m]
            diagonal[q, n * i + k] = math.sqrt(max(1.0, left)) if i == k else left / diagonal[q, n * k + k]
    for e in range(direct.degree[q]):
        block = direct.block[q, e]
        for i in range(n):
            for m in range(i):
                by = diagonal[q, n * i + m]
                for k in range(n):
                    values[block, n * i + k] -= by * values[block, n * m + k]
            by = 1.0 / diagonal[q, n * i + i]
            for k in range(n):
                values[block, n * i + k] *= by


@part
def subtract_from_pair(direct, one, other, p, o, n):
    """What is left between bodies p and o where their blocks with a body that goes are these."""
    values = direct.values
    if p == o:
        for m in range(n):
            for i in range(n):
                by = values[one, n * m + i]
                for k in range(i + 1):
                    direct.diagonal[p, n * i + k] -= by * values[one, n * m + k]
        return
    if direct.place[p] > direct.place[o]:
        one, other, p, o = other, one, o, p
    block = block_of(direct, p, o)
    for m in range(n):
        for i in range(n):
            by = values[one, n * m + i]
            for k in range(n):
                values[block, n * i + k] -= by * values[other, n * m + k]


@part
def factorise(solver, pushes):
    """The root of the matrix of a range, for a pass that pushes or not."""
    joints, direct = solver.joints, solver.direct
    n = freedoms(solver.velocity[solver.bodies])
    for e in range(direct.begin, direct.end):
        q = direct.body[e]
        mass_root(solver, q)
        for i in range(n):
            for k in range(i):
                direct.diagonal[q, n * i + k] = 0.0
            direct.diagonal[q, n * i + i] = 1.0
        for k in range(direct.degree[q]):
            for i in range(n * n):
                direct.values[direct.block[q, k], i] = 0.0
    direct.stiffer, direct.mixed = 1.0 if pushes else DIRECT_STIFFNESS, False
    for e in range(joints.begin, joints.end):
        j = joints.order[e]
        if joints.at_once[j] == HELD_AT_ONCE:
            add_row(solver, j, inverse_mass_of(solver, j))
        else:
            direct.mixed = True
    for e in range(direct.begin, direct.end):
        q = direct.body[e]
        factorise_body(direct, q, n)
        for k in range(direct.degree[q]):
            for i in range(k + 1):
                subtract_from_pair(
                    direct, direct.block[q, i], direct.block[q, k], direct.near[q, i], direct.near[q, k], n
                )


@inlined
def note_push(direct, q, push, turn, impulse):
    direct.push[q] = add_scaled(direct.push[q], push, impulse)
    direct.twist[q] = add_scaled(direct.twist[q], turn, impulse)


@inlined
def speed_between(solver, j):
    """The velocity of b's anchor as that of a sees it."""
    joints, a, b = solver.joints, solver.joints.first[j], solver.joints.second[j]
    v_a = add(solver.velocity[a], cross_spin(solver.spin[a], joints.arm_a[j]))
    return sub(add(solver.velocity[b], cross_spin(solver.spin[b], joints.arm_b[j])), v_a)


@inlined
def speed_of(solver, j):
    """How fast the value of a row that is no POINT changes."""
    joints = solver.joints
    if joints.kind[j] == CUSTOM:
        return speed_of_custom(solver, j)
    if joints.kind[j] >= TURN:
        return dot(joints.normal[j], sub(solver.spin[joints.second[j]], solver.spin[joints.first[j]]))
    return dot(joints.normal[j], speed_between(solver, j))


@part
def note_rows(solver, what):
    """What rows ask for, as impulses of their bodies; in the end these are the impulses that they get.

    Impulses are found anew: what several rows that push the same bodies apart have borne against each other is gone
    when they only hold. A REFINE_PASS adds to them what they lack.
    """
    joints, direct = solver.joints, solver.direct
    pushes, anew, ends = what % RESULT_OF == PUSH_PASS, what % RESULT_OF != REFINE_PASS, what >= RESULT_OF
    for q in range(direct.begin, direct.end):
        direct.push[direct.body[q]] = direct.twist[direct.body[q]] = scale(solver.velocity[solver.bodies], 0.0)
    for e in range(joints.begin, joints.end):
        j = joints.order[e]
        if joints.at_once[j] != HELD_AT_ONCE:
            continue
        a, b, weight = joints.first[j], joints.second[j], inverse_mass_of(solver, j)
        if joints.kind[j] == POINT:
            speed = speed_between(solver, j)
            if pushes:
                speed = add_scaled(speed, joints.gap[j], joints.push_rate[j])
            change = scale(speed, -weight)
            if anew:
                change = sub(change, joints.push[j])
            if ends:
                joints.push[j] = add(joints.push[j], change)
            note_push(direct, a, change, twist(joints.arm_a[j], change), -1.0)
            note_push(direct, b, change, twist(joints.arm_b[j], change), 1.0)
            continue
        asked = joints.pushing[j] if pushes else joints.target_speed[j]
        change = weight * (asked - speed_of(solver, j))
        if anew:
            change -= joints.impulse[j]
        if ends:
            joints.impulse[j] += change
        push_a, turn_a, push_b, turn_b = directions_at(joints, j, 0)
        note_push(direct, a, push_a, turn_a, change)
        note_push(direct, b, push_b, turn_b, change)


@part
def back_substitute(solver, n):
    """The solution for the impulses of the bodies: first what is asked of each, then how it moves."""
    direct, out = solver.direct, stack_array(6, 0.0)
    diagonal, values, x = direct.diagonal, direct.values, direct.solution
    for e in range(direct.begin, direct.end):
        q = direct.body[e]
        to_energy_norm(solver, q, direct.push[q], direct.twist[q], out)
        for k in range(n):
            x[q, k] = out[k]
    for e in range(direct.begin, direct.end):
        q = direct.body[e]
        for i in range(n):
            for k in range(i):
                x[q, i] -= diagonal[q, n * i + k] * x[q, k]
            x[q, i] /= diagonal[q, n * i + i]
        for m in range(direct.degree[q]):
            block, p = direct.block[q, m], direct.near[q, m]
            for i in range(n):
                for k in range(n):
                    x[p, k] -= values[block, n * i + k] * x[q, i]
    for e in range(direct.end - 1, direct.begin - 1, -1):
        q = direct.body[e]
        for m in range(direct.degree[q]):
            block, p = direct.block[q, m], direct.near[q, m]
            for i in range(n):
                for k in range(n):
                    x[q, i] -= values[block, n * i + k] * x[p, k]
        for i in range(n - 1, -1, -1):
            for k in range(i + 1, n):
                x[q, i] -= diagonal[q, n * k + i] * x[q, k]
            x[q, i] /= diagonal[q, n * i + i]


@part
def solve_direct(solver, what):
    """The joints of a range that are solved at once, see note_rows."""
    direct, zero = solver.direct, scale(solver.velocity[solver.bodies], 0.0)
    velocity, spins = solver.velocity, solver.spin
    note_rows(solver, what)
    back_substitute(solver, freedoms(zero))
    for e in range(direct.begin, direct.end):
        q = direct.body[e]
        v, spin = from_energy_norm(solver, q, zero)
        velocity[q], spins[q] = add(velocity[q], v), add(spins[q], spin)
    note_rows(solver, what + RESULT_OF)
    for e in range(direct.begin, direct.end):  # what the impulses make of it, to the last bit
        q = direct.body[e]
        v, spin = from_energy_norm(solver, q, zero)
        v = sub(scale(direct.push[q], solver.inverse_mass[q]), v)
        spin = sub(change_of_spin(solver, q, direct.twist[q]), spin)
        velocity[q], spins[q] = add(velocity[q], v), add(spins[q], spin)


@inlined
def change_at(solver, j, k):
    """How fast the value of row j, of a POINT along axis k, changes by the motion that is in push and twist."""
    joints, direct = solver.joints, solver.direct
    a, b = joints.first[j], joints.second[j]
    push_a, turn_a, push_b, turn_b = directions_at(joints, j, k)
    change = 0.0
    if solver.island[a] >= 0:
        change += dot(push_a, direct.push[a]) + dot(turn_a, direct.twist[a])
    if solver.island[b] >= 0:
        change += dot(push_b, direct.push[b]) + dot(turn_b, direct.twist[b])
    return change


@part
def apply_to_bodies(solver, j, k, impulse):
    """Let a row act, of a POINT along axis k."""
    joints = solver.joints
    push_a, turn_a, push_b, turn_b = directions_at(joints, j, k)
    for q, push, turn in ((joints.first[j], push_a, turn_a), (joints.second[j], push_b, turn_b)):
        if solver.island[q] >= 0:
            solver.velocity[q] = add_scaled(solver.velocity[q], push, impulse * solver.inverse_mass[q])
            solver.spin[q] = add(solver.spin[q], change_of_spin(solver, q, scale(turn, impulse)))


@part
def solve_limited(solver, j, pushes):
    """A limit, a motor or a servo whose joint, and all that hang on it, are solved at once: these answer it."""
    joints, direct, zero = solver.joints, solver.direct, scale(solver.velocity[solver.bodies], 0.0)
    impulse = joints.impulse
    old, missing = impulse[j], (joints.pushing[j] if pushes else joints.target_speed[j]) - speed_of(solver, j)
    if old == 0.0 and min(joints.greatest[j], max(joints.least[j], missing)) == 0.0:
        return
    for e in range(direct.begin, direct.end):
        direct.push[direct.body[e]] = direct.twist[direct.body[e]] = zero
    push_a, turn_a, push_b, turn_b = directions_at(joints, j, 0)
    note_push(direct, joints.first[j], push_a, turn_a, 1.0)
    note_push(direct, joints.second[j], push_b, turn_b, 1.0)
    back_substitute(solver, freedoms(zero))
    for e in range(direct.begin, direct.end):
        q = direct.body[e]
        direct.push[q], direct.twist[q] = from_energy_norm(solver, q, zero)
    moved, weight = change_at(solver, j, 0), inverse_mass_of(solver, j)
    gives = direct.stiffer / weight if joints.rule[j] != LIMIT and weight > 0.0 else 0.0
    change = (missing - gives * old) / (moved + gives) if moved > 0.0 else 0.0
    new = min(joints.greatest[j], max(joints.least[j], old + change))
    impulse[j] = new
    if new == old:
        return
    apply_to_bodies(solver, j, 0, new - old)
    for e in range(joints.begin, joints.end):
        i = joints.order[e]
        if joints.at_once[i] == HELD_AT_ONCE:
            share = (old - new) * inverse_mass_of(solver, i)
            for k in range(numbers_of(joints, i)):
                answer = share * change_at(solver, i, k)
                if joints.kind[i] == POINT:
                    joints.push[i] = replace(joints.push[i], k, item(joints.push[i], k) + answer)
                else:
                    impulse[i] += answer
                apply_to_bodies(solver, i, k, answer)


@part
def solve_all_limited(solver, pushes):
    """One pass over the limits, motors and servos of joints that are solved at once."""
    joints = solver.joints
    for e in range(joints.begin, joints.end):
        if joints.at_once[joints.order[e]] == LIMITED_AT_ONCE:
            solve_limited(solver, joints.order[e], pushes)
