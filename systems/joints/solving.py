"""What joints do in the substeps of a range: one function for all that the solver of contacts asks, see calls."""

from __future__ import annotations

from ...framework.compilation import packed, part
from ...framework.vectors import dot, item
from . import calls
from .direct import PUSH_PASS, REFINE_PASS, directions_at, solve_direct
from .measuring import measure_joints
from .order import numbers_of
from .records import POINT
from .rows import add_joints, island_of_joint, keep_joints, relax_listed, solve_joints, start_joints, warm_start_joints


@part
def work_of_joint(solver, j):
    """The work of a row on what moves by itself, J: minus what that gives to the island."""
    joints, work = solver.joints, 0.0
    for k in range(numbers_of(joints, j)):
        push_a, turn_a, push_b, turn_b = directions_at(joints, j, k)
        impulse = item(joints.push[j], k) if joints.kind[j] == POINT else joints.impulse[j]
        for q, push, turn in ((joints.first[j], push_a, turn_a), (joints.second[j], push_b, turn_b)):
            if solver.island[q] < 0:
                work += impulse * (dot(push, solver.velocity[q]) + dot(turn, solver.spin[q]))
    return work


@packed
def solve_joined_range(solver, what, numbers, span):
    """Whatever calls asks of the joints of a range."""
    (h, dt), joints = numbers, solver.joints
    if what == calls.START:
        start_joints(solver, h)
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
