"""The rows of one joint move each other's values: a door that is stopped at its edge pushes at its hinge.

Solved one after the other such rows creep where an anchor is far from a centre of mass, and where motors, springs and
limits act with the mass of a body that nothing holds they give energy. So a joint is one small system, which is solved
by elimination: with each impulse of a row those before it that hold answer, so that their values go on as they did, and
the row has the mass of the motion that they leave. The rows of a joint are solved one right after the other, so that
nothing else has moved those that answer: else the answers could give energy.

In the pass that pushes what holds gives way, and so do the answers; springs are exact, and theirs never do.
"""

from __future__ import annotations

from ...framework.compilation import inlined, part
from ...framework.jit.stack_arrays import stack_array
from ...framework.vectors import add, add_scaled, dot, item, replace, row, scale, store
from ..contacts.constants import TURNING_FREQUENCY
from ..integration.turning import change_of_spin, cross_spin, symmetric, twist
from .records import CUSTOM, HOLD, LIMIT, POINT, SPRING, TURN

MOST_ANSWERS = 6  # rows that hold, in space, and each a number
BOTH_ANSWERS = 2 * MOST_ANSWERS  # as they are, and behind these as if they gave way
MOST_LEVER = 16.0  # times as much as the masses alone: what more is moved at the end of an arm gives way no more
NOTHING = 1e-9  # of what an impulse moves: less is held by rows before


@inlined
def first_of(joints, j):
    """The first row of the joint of row j."""
    first = j
    while first > 0 and joints.joint[first - 1] == joints.joint[j]:
        first -= 1
    return first


@inlined
def end_of(joints, j):
    """The row behind those of the joint of row j."""
    end = j + 1
    while end < joints.count and joints.joint[end] == joints.joint[j]:
        end += 1
    return end


@inlined
def is_fast(joints, j):
    """Whether a spring is too fast for its substeps: such springs gain energy where they meet at a body."""
    return joints.frequency[j] * joints.period > TURNING_FREQUENCY


@inlined
def is_soft_spring(joints, j):
    """Whether a row is a spring that its substeps can follow."""
    return joints.rule[j] == SPRING and not is_fast(joints, j)


@inlined
def is_holding(joints, j):
    """Whether a row holds its value, as springs do that are too fast for their substeps."""
    return joints.rule[j] == HOLD or (joints.rule[j] == SPRING and is_fast(joints, j))


@inlined
def has_coupling(joints, j):
    """Whether rows before row j may answer it."""
    return joints.kind[j] != CUSTOM and j > 0 and joints.joint[j - 1] == joints.joint[j]


@inlined
def symmetric_product(diagonal, others, v):
    """A symmetric matrix times a vector; others: xy, in space xy, xz, yz."""
    if len(v) == 2:
        x = item(diagonal, 0) * item(v, 0) + item(others, 0) * item(v, 1)
        return replace(replace(v, 0, x), 1, item(others, 0) * item(v, 0) + item(diagonal, 1) * item(v, 1))
    return symmetric(diagonal, others, v)


@inlined
def row_directions(joints, j):
    """(impulse, turn of a, turn of b) that 1 N s or N m s of a row which is no POINT gives its second body; the first
    one gets as much back."""
    along = joints.normal[j]
    if joints.kind[j] >= TURN:
        return scale(along, 0.0), along, along
    return along, twist(joints.arm_a[j], along), twist(joints.arm_b[j], along)


@inlined
def response_at(joints, j, k, soft):
    """The answer number k to row j, where what holds gives way or not."""
    answer, further = (joints.soft_answer[j], joints.soft_further[j]) if soft else (joints.answer[j], joints.further[j])
    d = len(answer)
    return item(answer, k) if k < d else item(further, k - d)


@inlined
def compliance_of(solver, first, usual):
    """By how much of what an impulse moves at it a joint gives way: the ``usual`` part, 1 / stiffness, but where that
    the end of a long arm of a body which turns easily. It may have to bear the body itself, and gives way less."""
    joints = solver.joints
    w = solver.inverse_mass[joints.first[first]] + solver.inverse_mass[joints.second[first]]
    share = MOST_LEVER * w * joints.mass[first] if joints.kind[first] < TURN else 1.0
    return share / joints.stiffness if share < 1.0 else usual


@inlined
def is_idle(joints, first):
    """Whether there are limits alone behind the first row of a joint, a point, and none was met in the last substep."""
    idle = joints.kind[first] == POINT
    for j in range(first + 1, end_of(joints, first)):
        idle &= joints.rule[j] == LIMIT and joints.impulse[j] == 0.0
    return idle


@part
def couple(solver, first):
    """The masses of the rows of a joint behind its first one, and the answers to them of those before that hold.

    Each row is made orthogonal to these, in the measure of kinetic energy and of what goes into the joint where that
    gives way (Gram and Schmidt). Once as it is, then, but for springs, as if it gave way.
    """
    joints, zero = solver.joints, scale(solver.joints.normal[first], 0.0)
    n = BOTH_ANSWERS
    force, spins_a, spins_b = stack_array(n, zero), stack_array(n, zero), stack_array(n, zero)
    answers, furthers, masses = stack_array(n, zero), stack_array(n, zero), stack_array(n, 0.0)
    a, b, d, held = joints.first[first], joints.second[first], len(zero), 0
    w, point = solver.inverse_mass[a] + solver.inverse_mass[b], joints.kind[first] == POINT
    before = d if point else 0
    arm_a, arm_b = joints.arm_a[first], joints.arm_b[first]
    gives = compliance_of(solver, first, 1.0 / joints.stiffness)
    for j in range(first + 1 if point else first, end_of(joints, first)):
        along, turn_a, turn_b = row_directions(joints, j)
        turned_a, turned_b = change_of_spin(solver, a, turn_a), change_of_spin(solver, b, turn_b)
        whole, holds = w * dot(along, along) + dot(turn_a, turned_a) + dot(turn_b, turned_b), is_holding(joints, j)
        for soft in range(1 if is_soft_spring(joints, j) else 2):
            push, spin_a, spin_b, begin = along, turned_a, turned_b, MOST_ANSWERS * soft
            answer = further = zero
            if point:
                apart = add(scale(along, w), add(cross_spin(spin_a, arm_a), cross_spin(spin_b, arm_b)))
                answer = symmetric_product(joints.inverse[first], joints.inverse_products[first], apart)
                answer = scale(answer, -1.0 / (1.0 + gives) if soft else -1.0)
                push = add(push, answer)
                spin_a = add(spin_a, change_of_spin(solver, a, twist(arm_a, answer)))
                spin_b = add(spin_b, change_of_spin(solver, b, twist(arm_b, answer)))
            for i in range(begin, begin + held):
                moved = w * dot(along, row(force, i, zero)) + dot(turn_a, row(spins_a, i, zero))
                share = -(moved + dot(turn_b, row(spins_b, i, zero))) * masses[i]
                push = add_scaled(push, row(force, i, zero), share)
                spin_a = add_scaled(spin_a, row(spins_a, i, zero), share)
                spin_b = add_scaled(spin_b, row(spins_b, i, zero), share)
                answer = add_scaled(answer, row(answers, i, zero), share)
                further = add_scaled(further, row(furthers, i, zero), share)
                k = i - begin + before
                if k < d:
                    answer = replace(answer, k, item(answer, k) + share)
                else:
                    further = replace(further, k - d, item(further, k - d) + share)
            left = w * dot(along, push) + dot(turn_a, spin_a) + dot(turn_b, spin_b)
            gives_way = gives * whole if holds and soft else 0.0
            mass = 1.0 / (left + gives_way) if left > NOTHING * whole else 0.0
            if soft:
                joints.soft_answer[j], joints.soft_further[j] = answer, further
                joints.mass_scale[j] = mass / joints.mass[j] if joints.mass[j] > 0.0 else 0.0
                joints.impulse_scale[j] = gives_way * mass
            else:
                joints.mass[j], joints.answer[j], joints.further[j] = mass, answer, further
            if holds:
                at = begin + held
                store(force, at, push)
                store(spins_a, at, spin_a)
                store(spins_b, at, spin_b)
                store(answers, at, answer)
                store(furthers, at, further)
                masses[at] = mass
        held += holds
