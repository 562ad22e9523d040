"""Firm contacts: those of a body that rests only on what cannot be moved, and that nobody presses on.

Soft contacts sag, by an amount that depends on how many there are. A body that slides over floors which lie flush would
rise and sink at each seam, and meet the next floor's corner below its own underside. Firm contacts do not sag. A body
alone has few of them, so that the usual passes solve them.
"""

from __future__ import annotations

from ....framework.compilation import part
from ....framework.vectors import add, dot, length, sub

LOAD = 1e-6  # of the impulse that forces give in a substep: less is none
ALONG = 0.5  # of a firm contact's normal along the sum of the normals of all such contacts of its body
OPEN = 1e-9  # of the extent: less is neither a gap nor an overlap; a contact that is open at the end of the step
NEVER = 1e6  # may close by so many extents: the next step looks along its own normals


@part
def presses(solver, k, h):
    """Whether contact k, of two bodies that can be moved, bears a load, or will: they overlap."""
    a, b, acceleration = solver.first[k], solver.second[k], solver.acceleration
    if not (solver.inverse_mass[a] > 0.0 and solver.inverse_mass[b] > 0.0):
        return False
    if solver.gap[k] < -OPEN * solver.extent[k]:
        return True
    return solver.impulse[k] > LOAD * solver.mass[k] * h * max(length(acceleration[a]), length(acceleration[b]))


@part
def choose_firm(state, h, nothing):
    """Contacts with what cannot be moved are firm if their body has rested until now, and nobody presses on it.

    Not those that push against the sum of its normals: no impulse is high enough for what is squeezed. Nor one that
    stands for several faces: how much it overlaps each of them says which way it pushes.
    """
    solver, supported = state.solver, state.bodies.supported
    inverse_mass, way, shared = solver.inverse_mass, solver.velocity_way, solver.going
    for q in range(solver.bodies):
        way[q], shared[q] = nothing, False
    for k in range(solver.contacts):
        a, b, n = solver.first[k], solver.second[k], solver.normal[k]
        if inverse_mass[a] == 0.0 or inverse_mass[b] == 0.0:
            way[a], way[b] = sub(way[a], n), add(way[b], n)
        elif presses(solver, k, h):
            shared[a] = shared[b] = True
    for k in range(solver.contacts):
        a, b, n = solver.first[k], solver.second[k], solver.normal[k]
        body, along = (b, dot(way[b], n)) if inverse_mass[b] > 0.0 else (a, -dot(way[a], n))
        fixed = inverse_mass[a] == 0.0 or inverse_mass[b] == 0.0
        rested = state.any_support and supported[solver.body_row[body]]
        solver.firm[k] = fixed and rested and along > ALONG and not (shared[body] or solver.varies[k])
        if solver.firm[k] and solver.apart[k]:
            solver.gap[k] = max(0.0, solver.gap[k])  # faces that meet in the end do not overlap where the step starts


@part
def let_go(solver, nothing):
    """Firm contacts that are open where the step starts wait until the others of their body bear its load; those that
    open further have no impulse any more: the body has passed the corner."""
    velocity = solver.velocity
    for k in range(solver.contacts):
        a, b = solver.first[k], solver.second[k]
        solver.waits[k] = solver.firm[k] and solver.apart[k]
        if solver.waits[k]:
            solver.unsettled[a] = solver.unsettled[b] = solver.any_unsettled = True
            if dot(sub(velocity[b], velocity[a]), solver.normal[k]) > 0.0:
                solver.impulse[k], solver.tangent[k] = 0.0, nothing


@part
def leave_open(solver, h):
    """A firm contact that is open when the step ends is left to the next step if its body is held by another one: it
    slides on, and by then it may have passed the corner that it would be stopped at."""
    first, second, shift, held = solver.first, solver.second, solver.shift, solver.going
    for q in range(solver.bodies):
        held[q] = False
    for k in range(solver.contacts):
        if solver.impulse[k] > 0.0:
            held[first[k]] = held[second[k]] = True
    for k in range(solver.contacts):
        body = first[k] if solver.inverse_mass[first[k]] > 0.0 else second[k]
        if solver.firm[k] and held[body] and solver.impulse[k] == 0.0:
            room = solver.gap[k] + dot(sub(shift[second[k]], shift[first[k]]), solver.normal[k])
            if room > OPEN * solver.extent[k]:
                solver.opening[k] = NEVER * solver.extent[k] / h
