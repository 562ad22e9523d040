"""What the solver of contacts asks of the joints of a range, by address: worlds without joints link none of them."""

from __future__ import annotations

from ...framework.compilation import inlined
from ..linking.parts import JOINED_RANGE, call_joined_range

# See solving.solve_joined_range, which does it.
(
    START, START_WARM, PUSH, RELAX, PUSH_AGAIN, RELAX_AGAIN, ADD, KEEP, RELAX_LISTED, ADD_WORK, SUM_WORK,
) = range(11)  # fmt: skip


@inlined
def for_joints(solver, what, numbers, span, arms):
    """Ask it of the joints of a range, if there are some. numbers: two that it needs, most often s of a substep and of
    the step; returns the first one, or what joints add to it."""
    joints = solver.joints
    if len(arms) > 0 and joints.begin < joints.end:
        return call_joined_range(solver.addresses[JOINED_RANGE], solver, what, numbers, span)
    return numbers[0]
