"""What went wrong in a step, of which faults will tell: how many bodies or joints of each kind, and the first."""

from __future__ import annotations

from ....framework.compilation import inlined

SQUEEZED, OVERLOADED, RESTRAINED, TORN_OPEN = range(4)
# there is no room where they are pushed; they count as lighter than they are; first bodies of islands to which contacts
# would have given much energy; joints that are wide open
KINDS_OF_FAULT = 4


@inlined
def note_fault(solver, kind, first):
    """One more. first: the row of a body, the entity of a joint, if it is the first."""
    if solver.faults[kind] == 0:
        solver.faulty[kind] = first
    solver.faults[kind] += 1
