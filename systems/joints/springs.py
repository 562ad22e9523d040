"""Springs of joints that hold their bodies in other ways, too: a door turns about its edge, a wheel slides on an axis.

What a spring does with its own row alone would move its bodies as if nothing held them until the next pass: a heavier
motion in the end than the one it is measured for, whose swing gains energy. So the rows that hold answer each impulse
of the spring at once, and its mass is that of the motion which is left: rows and spring are one small system, which is
solved by elimination, the spring last.
"""

from __future__ import annotations

from ...framework.compilation import inlined, part
from ...framework.jit.stack_arrays import stack_array
from ...framework.vectors import dot, replace, row, scale, store
from ..integration.turning import change_of_spin, twist
from .records import GIVEN, HOLD, POINT, TURN

MOST = 6  # rows of a system: five that hold, in space, and the spring
ENTRIES = MOST * MOST
NOTHING = 1e-9  # of what an impulse moves: less is held by rows before


@inlined
def first_of(joints, j):
    """The first row of the joint of row j."""
    first = j
    while first > 0 and joints.joint[first - 1] == joints.joint[j]:
        first -= 1
    return first


@part
def left_to(solver, j):
    """1 / kg or 1 / (kg m^2): what an impulse of the spring of row j moves, with the rows before it in its joint that
    hold; how they answer is kept. 0: they hold all of it."""
    joints, zero = solver.joints, scale(solver.joints.normal[j], 0.0)
    along, turns_a, turns_b = stack_array(MOST, zero), stack_array(MOST, zero), stack_array(MOST, zero)
    matrix, whole = stack_array(ENTRIES, 0.0), stack_array(MOST, 0.0)
    a, b, n = joints.first[j], joints.second[j], 0
    for i in range(first_of(joints, j), j + 1):
        if i < j and (joints.rule[i] != HOLD or joints.kind[i] == GIVEN):
            continue
        for k in range(len(zero) if joints.kind[i] == POINT else 1):
            way, turn_a, turn_b = zero, joints.normal[i], joints.normal[i]
            if joints.kind[i] < TURN:
                way = replace(zero, k, 1.0) if joints.kind[i] == POINT else joints.normal[i]
                turn_a, turn_b = twist(joints.arm_a[i], way), twist(joints.arm_b[i], way)
            store(along, n, way)
            store(turns_a, n, turn_a)
            store(turns_b, n, turn_b)
            n += 1
    last = n - 1
    for r in range(n):
        moves = scale(row(along, r, zero), solver.inverse_mass[a] + solver.inverse_mass[b])
        spin_a = change_of_spin(solver, a, row(turns_a, r, zero))
        spin_b = change_of_spin(solver, b, row(turns_b, r, zero))
        for c in range(r + 1):
            turns = dot(row(turns_a, c, zero), spin_a) + dot(row(turns_b, c, zero), spin_b)
            matrix[r * MOST + c] = dot(row(along, c, zero), moves) + turns
        whole[r] = NOTHING * matrix[r * MOST + r]
    for p in range(last):
        pivot = matrix[p * MOST + p]
        for r in range(p + 1, n):
            share = matrix[r * MOST + p] / pivot if pivot > whole[p] else 0.0
            for c in range(p + 1, r + 1):
                matrix[r * MOST + c] -= share * matrix[c * MOST + p]
    for p in range(last - 1, -1, -1):  # whole is the answer of each from here on
        pivot, held = matrix[p * MOST + p], matrix[last * MOST + p]
        for r in range(p + 1, last):
            held += matrix[r * MOST + p] * whole[r]
        whole[p] = -held / pivot if pivot > whole[p] else 0.0
    n = 0
    for i in range(first_of(joints, j), j):
        if joints.rule[i] == HOLD and joints.kind[i] != GIVEN:
            for k in range(len(zero) if joints.kind[i] == POINT else 1):
                joints.answer[i] = replace(zero if k == 0 else joints.answer[i], k, whole[n])
                n += 1
    left = matrix[last * MOST + last]
    return left if left > whole[last] else 0.0
