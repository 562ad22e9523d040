"""Rows of joints in the passes of the solver: how stiff they are, and what their impulses do.

A row, see measuring, HOLDs its value, keeps it within LIMITs, DRIVEs it at a speed, brings it there as a SERVO, or is a
SPRING; what is FREE has an angle that is counted, and no more. What holds is as soft as a spring of a frequency that
follows the rate of the substeps, and is solved without that in the passes that do not push; limits are not soft, so
that no motor is stronger. Springs are solved in the pass that pushes alone. One that swings faster than substeps can
follow holds its value. Rows of one joint are solved together, see coupling.

Joints come before the contacts of their range, in the pass that pushes and once in those that do not. Their bodies have
the columns of bodies that spin, as contacts of such bodies have.
"""

from __future__ import annotations

import math

from ...framework.compilation import inlined, part
from ...framework.elementary import cos, exp
from ...framework.vectors import add, add_scaled, length, scale, sub
from ..contacts.constants import FREQUENCY, JOINT_DAMPING_RATIO
from ..contacts.solving.records import TORN_OPEN, note_fault
from ..integration.turning import change_of_spin, cross_spin, symmetric, twist
from .coupling import couple, first_of, has_coupling, is_holding, is_soft_spring, response_at, symmetric_product
from .direct import (
    PUSH_PASS,
    REFINE_PASS,
    RELAX_PASS,
    apply_to_bodies,
    factorise,
    solve_all_limited,
    solve_direct,
    speed_between,
    speed_of,
)
from .measuring import reach_at
from .order import is_rigid
from .records import BY_PASSES, CUSTOM, HELD_AT_ONCE, POINT, TURN

LEAST_SHARE = 1e-9  # of its mass that a spring without damping takes part with
TORN = 0.2  # of the reach of a body from its centre: a joint that is open by more is told


# -- in a range --------------------------------------------------------------------------------------------------------


@part
def count_springs(solver):
    """``used`` of each body that moves: how many springs of the range are at it."""
    joints, used = solver.joints, solver.used
    for count in range(2):
        for e in range(joints.begin, joints.end):
            j = joints.order[e]
            for q in (joints.first[j], joints.second[j]):
                moves = is_soft_spring(joints, j) and solver.inverse_mass[q] > 0.0
                used[q] = used[q] + moves if count > 0 else 0


@inlined
def joint_spring(angle, ratio, together):
    """(error that a spring pushes out in a substep, share of its mass) for it to turn by an angle, rad, in a substep.

    It takes share * (v + rate * x / h) from the speed v at a stretch x, then x changes by v h: a map of (x, v) whose
    determinant is 1 - share and whose trace is 2 - share * (1 + rate). Those of the exact solution make its period and
    its decay exact. So many ``together`` at a body that they turn it far in a substep are implicit, and lose energy.
    """
    damping = 2.0 * ratio + angle
    stiffness = angle * damping
    share = stiffness / (1.0 + stiffness)
    both = share * (1.0 + angle / damping)
    exact = min(1.0, max(0.0, 2.0 - angle * math.sqrt(together)))
    if exact > 0.0:
        fading, swing = exp(-ratio * angle), angle * math.sqrt(abs(1.0 - ratio * ratio))
        trace = 2.0 * fading * cos(swing)
        if ratio >= 1.0:
            trace = exp(swing - ratio * angle) + exp(-swing - ratio * angle)
        share += exact * (1.0 - fading * fading - share)
        both += exact * (2.0 - trace - both)
    share = max(share, LEAST_SHARE)
    return both / share - 1.0, share


@part
def start_joints(solver, h):
    """The joints of a range start with the forces that they had, in substeps of h. They are as stiff as in their
    ``period``, whatever contacts ask for: changes of it would give energy to what is stretched."""
    joints = solver.joints
    joints.step = h
    omega = 2.0 * math.pi * FREQUENCY / joints.period
    damping = 2.0 * JOINT_DAMPING_RATIO + h * omega
    joints.stiffness, joints.rate = stiffness, rate = h * omega * damping, omega / damping
    kept, back = stiffness / (1.0 + stiffness), 1.0 / (1.0 + stiffness)
    count_springs(solver)
    for e in range(joints.begin, joints.end):
        j = joints.order[e]
        joints.impulse[j], joints.push[j] = joints.load[j] * h, scale(joints.pull[j], h)
        if is_soft_spring(joints, j):
            swing = 2.0 * math.pi * joints.frequency[j]
            together = max(solver.used[joints.first[j]], solver.used[joints.second[j]])
            away, mass_scale = joint_spring(swing * h, joints.damping_ratio[j], together)
            joints.push_rate[j], joints.mass_scale[j], joints.impulse_scale[j] = away / h, mass_scale, 1.0 - mass_scale
            continue
        joints.push_rate[j], holding = rate, is_holding(joints, j)
        joints.mass_scale[j], joints.impulse_scale[j] = kept if holding else 1.0, back if holding else 0.0


# -- in a substep ------------------------------------------------------------------------------------------------------


@inlined
def columns_of(solver):
    """What impulses change, and how: in names, so that no row looks for them again."""
    return solver.velocity, solver.spin, solver.inverse_mass, solver.inverse_inertia, solver.inverse_products


@inlined
def push_apart(columns, ends, arms, impulse):
    """Push the second of two bodies at the end of its arm by an impulse, a vector, and the first one back."""
    velocity, spin, inverse_mass, inertia, products = columns
    (a, b), (arm_a, arm_b) = ends, arms
    w_a, w_b = inverse_mass[a], inverse_mass[b]
    if w_a > 0.0:
        velocity[a] = add_scaled(velocity[a], impulse, -w_a)
        spin[a] = sub(spin[a], symmetric(inertia[a], products[a], twist(arm_a, impulse)))
    if w_b > 0.0:
        velocity[b] = add_scaled(velocity[b], impulse, w_b)
        spin[b] = add(spin[b], symmetric(inertia[b], products[b], twist(arm_b, impulse)))


@inlined
def apply_row(solver, j, impulse):
    """Let a row that is no POINT act with an impulse."""
    joints = solver.joints
    if joints.kind[j] < TURN:
        ends, arms = (joints.first[j], joints.second[j]), (joints.arm_a[j], joints.arm_b[j])
        push_apart(columns_of(solver), ends, arms, scale(joints.normal[j], impulse))
        return
    if joints.kind[j] == CUSTOM:
        apply_to_bodies(solver, j, 0, impulse)
        return
    a, b, twisted = joints.first[j], joints.second[j], scale(joints.normal[j], impulse)
    if solver.inverse_mass[a] > 0.0:
        solver.spin[a] = sub(solver.spin[a], change_of_spin(solver, a, twisted))
    if solver.inverse_mass[b] > 0.0:
        solver.spin[b] = add(solver.spin[b], change_of_spin(solver, b, twisted))


@inlined
def row_response(solver, j, impulse, soft):
    """What holds in the joint of row j pushes with it, see coupling."""
    joints, k = solver.joints, 0
    for i in range(first_of(joints, j), j):
        if not is_holding(joints, i):
            continue
        if joints.kind[i] == POINT:
            answer = scale(joints.soft_answer[j] if soft else joints.answer[j], impulse)
            ends, arms = (joints.first[i], joints.second[i]), (joints.arm_a[i], joints.arm_b[i])
            joints.push[i] = add(joints.push[i], answer)
            push_apart(columns_of(solver), ends, arms, answer)
            k += len(answer)
        else:
            share = response_at(joints, j, k, soft) * impulse
            joints.impulse[i] += share
            apply_row(solver, i, share)
            k += 1


@part
def warm_start_joints(solver):
    """The impulses of the last substep act again, with the anchors as they are now."""
    joints, columns, order, kind = solver.joints, columns_of(solver), solver.joints.order, solver.joints.kind
    first, second, arm_a, arm_b, push = joints.first, joints.second, joints.arm_a, joints.arm_b, joints.push
    for e in range(joints.begin, joints.end):
        j = order[e]
        if kind[j] == POINT:
            push_apart(columns, (first[j], second[j]), (arm_a[j], arm_b[j]), push[j])
        elif joints.impulse[j] != 0.0:
            apply_row(solver, j, joints.impulse[j])


@inlined
def solve_row(solver, j, pushes):
    """The value of a row changes as it asks, as far as its impulses allow."""
    joints, old = solver.joints, solver.joints.impulse[j]
    asked = (joints.pushing[j] if pushes else joints.target_speed[j]) - speed_of(solver, j)
    least, greatest = joints.least[j], joints.greatest[j]
    if old == 0.0:
        if asked <= 0.0 == least or asked >= 0.0 == greatest:
            return  # most limits are not met
        if has_coupling(joints, j):  # it may have been idle
            couple(solver, first_of(joints, j))
    mass = joints.mass[j]
    change = joints.mass_scale[j] * mass * asked - joints.impulse_scale[j] * old if pushes else mass * asked
    new = min(greatest, max(least, old + change))
    joints.impulse[j] = new
    if new != old:
        apply_row(solver, j, new - old)
        if has_coupling(joints, j):
            row_response(solver, j, new - old, pushes and not is_soft_spring(joints, j))


@part
def solve_joint_pass(solver, pushes):
    """One pass over the joints of a range that are not solved at once."""
    joints, columns, velocity, spin = solver.joints, columns_of(solver), solver.velocity, solver.spin
    order, kind, first, second = joints.order, joints.kind, joints.first, joints.second
    arm_a, arm_b, gap, push, most = joints.arm_a, joints.arm_b, joints.gap, joints.push, joints.most
    diagonal, others, step = joints.inverse, joints.inverse_products, joints.step
    rate, mass_scale, impulse_scale = joints.push_rate, joints.mass_scale, joints.impulse_scale
    for e in range(joints.begin, joints.end):
        j = order[e]
        if (not pushes and is_soft_spring(joints, j)) or joints.at_once[j] != BY_PASSES:
            continue
        if kind[j] != POINT:
            solve_row(solver, j, pushes)
            continue
        a, b, r_a, r_b, old = first[j], second[j], arm_a[j], arm_b[j], push[j]
        speed = sub(add(velocity[b], cross_spin(spin[b], r_b)), add(velocity[a], cross_spin(spin[a], r_a)))
        if pushes:
            speed = add_scaled(speed, gap[j], rate[j])
            change = scale(symmetric_product(diagonal[j], others[j], speed), -mass_scale[j])
            change = add_scaled(change, old, -impulse_scale[j])
        else:
            change = scale(symmetric_product(diagonal[j], others[j], speed), -1.0)
        new, limit = add(old, change), most[j] * step
        if limit < math.inf:
            size = length(new)
            if size > limit:
                new = scale(new, limit / size)
            change = sub(new, old)
        push[j] = new
        push_apart(columns, (a, b), (r_a, r_b), change)


@part
def solve_joints(solver, pushes):
    """One pass over the joints of a range; where they are solved at once two, as those that are not know of them."""
    solve_joint_pass(solver, pushes)
    if solver.direct.begin < solver.direct.end:
        factorise(solver, pushes)
        solve_direct(solver, PUSH_PASS if pushes else RELAX_PASS)
        if solver.direct.mixed:
            solve_all_limited(solver, pushes)
            solve_joint_pass(solver, pushes)
            solve_direct(solver, PUSH_PASS if pushes else REFINE_PASS)
            solve_all_limited(solver, pushes)


@part
def island_of_joint(solver, j):
    """The island of row j."""
    return max(solver.island[solver.joints.first[j]], solver.island[solver.joints.second[j]])


@part
def relax_listed(solver):
    """A pass without pushing over the joints of islands with listed rows; in order they stand island by island."""
    joints, columns, e = solver.joints, columns_of(solver), solver.joints.begin
    while e < joints.end:
        t = island_of_joint(solver, joints.order[e])
        begin, e = e, e + solver.links[t]
        for one in range(begin, e if solver.listed_of[t] > 0 else begin):
            j = joints.order[one]
            a, b = joints.first[j], joints.second[j]
            if is_soft_spring(joints, j) or joints.at_once[j] != BY_PASSES:
                continue
            if joints.kind[j] != POINT:
                solve_row(solver, j, False)
                continue
            old, speed = joints.push[j], speed_between(solver, j)
            change = symmetric_product(joints.inverse[j], joints.inverse_products[j], speed)
            new, limit = sub(old, change), joints.most[j]
            size = length(new)
            if size > limit * joints.step:
                new = scale(new, limit * joints.step / size)
            joints.push[j] = new
            push_apart(columns, (a, b), (joints.arm_a[j], joints.arm_b[j]), sub(new, old))
    if solver.direct.begin < solver.direct.end:
        solve_direct(solver, REFINE_PASS)
        solve_all_limited(solver, False)


@part
def add_joints(solver):
    """What the joints of a range have done in a substep."""
    joints, order, impulse, push = solver.joints, solver.joints.order, solver.joints.impulse, solver.joints.push
    total, thrust = joints.total, joints.thrust
    for e in range(joints.begin, joints.end):
        j = order[e]
        total[j] += impulse[j]
        thrust[j] = add(thrust[j], push[j])


@inlined
def is_torn(solver, j):
    """Whether a joint is wide open where the step ends, against the size of its smaller body."""
    joints, reach = solver.joints, math.inf
    for q, arm in ((joints.first[j], joints.arm_a[j]), (joints.second[j], joints.arm_b[j])):
        if solver.inverse_mass[q] > 0.0:
            reach = min(reach, reach_at(solver, q, arm))
    return is_rigid(joints, j) and length(joints.gap[j]) > TORN * reach > 0.0


@part
def keep_joints(solver, dt):
    """The forces of the last substep, for the next step, no larger than their means: what is more was a blow. A step
    shorter than the last one tells its share alone. Where all is found at once that needs none, and passes, which may
    be next, could not undo what is gone by then."""
    joints = solver.joints
    by, share = 1.0 / joints.step, dt / solver.usual / joints.period
    for e in range(joints.begin, joints.end):
        j = joints.order[e]
        last, mean = joints.impulse[j] * by, abs(joints.total[j]) / dt
        load, old = min(mean, max(-mean, last)), joints.load[j]
        pull, most = scale(joints.push[j], by), length(joints.thrust[j]) / dt
        size = length(pull)
        if joints.at_once[j] == HELD_AT_ONCE:
            load, most = 0.0, 0.0
        if size > most:
            pull = scale(pull, most / size)
        if share < 1.0:
            load, pull = old + share * (load - old), add_scaled(joints.pull[j], sub(pull, joints.pull[j]), share)
        joints.load[j], joints.pull[j] = load, pull
        if joints.kind[j] < TURN and is_torn(solver, j):
            note_fault(solver, TORN_OPEN, joints.joint[j])
