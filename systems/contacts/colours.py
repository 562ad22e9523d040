"""Colours of contacts: those of one colour share no body that moves, so that the processor can work on several at once.

Contacts of a body beyond COLOURS share the last colour.
"""

from __future__ import annotations

from ...framework.compilation import part
from ..bits import lowest_bit

COLOURS = 62  # bits of a mask


@part
def number_body(state, i):
    """The place of a row among the bodies of the solver, a new one if it has none yet."""
    solver, place = state.solver, state.bodies.place
    if place[i] < 0:
        place[i] = solver.bodies
        solver.body_row[solver.bodies] = i
        solver.used[solver.bodies] = 0
        solver.bodies += 1
    return place[i]


@part
def colour_contacts(state):
    """Number the bodies of the contacts and colour these: contacts of one colour share no body that moves."""
    solver, pairs, inverse_mass = state.solver, state.pairs, state.bodies.inverse_mass
    used, starts = solver.used, solver.starts
    solver.bodies = 0
    for k in range(COLOURS + 2):
        starts[k] = 0
    for r in range(solver.contacts):
        c = pairs.resting[r]
        a, b, taken = pairs.a[c], pairs.b[c], 0
        p, q = number_body(state, a), number_body(state, b)
        if inverse_mass[a] > 0.0:
            taken |= used[p]
        if inverse_mass[b] > 0.0:
            taken |= used[q]
        colour = min(lowest_bit(~taken), COLOURS - 1)
        if inverse_mass[a] > 0.0:
            used[p] |= 1 << colour
        if inverse_mass[b] > 0.0:
            used[q] |= 1 << colour
        solver.colour[r] = colour
        starts[colour + 1] += 1
    for k in range(1, COLOURS + 1):
        starts[k] += starts[k - 1]
