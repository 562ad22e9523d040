"""What joints do in the substeps of a range: one function for all that the solver of contacts asks, see calls."""

from __future__ import annotations

from ...framework.compilation import packed, part
from ...framework.vectors import add, dot, scale
from ..integration.turning import cross_spin
from . import calls
from .custom import rates_of_custom
from .direct import PUSH_PASS, REFINE_PASS, solve_direct
from .measuring import measure_joints
from .records import CUSTOM, POINT, TURN
from .rows import add_joints, island_of_joint, keep_joints, relax_listed, solve_joints, start_joints, warm_start_joints


@part
def work_of_joint(solver, j):
    """The work of a row on what moves by itself, J: minus what that gives to the island."""
    joints, island = solver.joints, solver.island
    a, b = joints.first[j], joints.second[j]
    if island[a] >= 0 and island[b] >= 0:
        return 0.0
    q, arm, away = (a, joints.arm_a[j], -1.0) if island[a] < 0 else (b, joints.arm_b[j], 1.0)
    if joints.kind[j] == CUSTOM:
        at_a, at_b = rates_of_custom(solver, j)
        return joints.impulse[j] * (at_a if q == a else at_b)
    if joints.kind[j] >= TURN:
        return away * joints.impulse[j] * dot(joints.normal[j], solver.spin[q])
    push = joints.push[j] if joints.kind[j] == POINT else scale(joints.normal[j], joints.impulse[j])
    return away * dot(push, add(solver.velocity[q], cross_spin(solver.spin[q], arm)))


@packed
def solve_joined_range(solver, what, numbers, span):
    """Whatever calls asks of the joints of a range."""
    (h, dt), joints = numbers, solver.joints
    if what == calls.START:
        start_joints(solver, h, dt / solver.usual)
        measure_joints(solver, 0.0)
    elif what == calls.START_WARM:
        warm_start_joints(solver)
    elif what == calls.PUSH:
        solve_joints(solver, True)
    elif what == calls.RELAX:  # once: more often, chains give way more
        measure_joints(solver, h)
        solve_joints(solver, False)
    elif what in (calls.PUSH_AGAIN, calls.RELAX_AGAIN):  # after the contacts
        pushes = what == calls.PUSH_AGAIN
        if solver.direct.begin < solver.direct.end and (span[0] < span[1] or not pushes):
            solve_direct(solver, PUSH_PASS if pushes else REFINE_PASS)
    elif what == calls.ADD:
        add_joints(solver)
    elif what == calls.KEEP:
        keep_joints(solver, dt)
    elif what == calls.RELAX_LISTED:
        relax_listed(solver)
    elif what == calls.ADD_WORK:
        for e in range(joints.begin, joints.end if solver.movers > 0 else joints.begin):
            j = joints.order[e]
            solver.slope[island_of_joint(solver, j)] += work_of_joint(solver, j)
    elif what == calls.SUM_WORK:
        for e in range(joints.begin, joints.end if solver.movers > 0 else joints.begin):
            h += work_of_joint(solver, joints.order[e])
    return h
