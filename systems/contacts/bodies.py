"""The bodies that have contacts at rest, gathered for the solver, and what it made of them put back."""

from __future__ import annotations

from ...framework.compilation import part
from ...framework.jit.records.record_type import zero_of
from ...framework.vectors import add, add_scaled, length, scale, sub
from ..codes import NEED_COLUMNS, NEED_SOLVER, OK
from ..impacts.impulses import STOPPED
from ..integration.trajectory import along, path_of
from .colours import colour_contacts
from .resting_prediction import drop_support

MOST_THROW = 2.0  # times the speed around it: what the solver may give a body in a discrete world


@part
def note_squeezed(solver, i):
    """There is no room for body i where it is pushed: a fault will name the first of them."""
    if solver.squeezed == 0:
        solver.squeezed_row = i
    solver.squeezed += 1


@part
def start_of_flight(state, i, v, a, dt):
    """From where the substeps would take body i to the place of its last impact in time."""
    bodies = state.bodies
    t = bodies.last_impact[i]
    there = sub(along(path_of(state, i), t), bodies.previous_position[i])
    return add_scaled(add_scaled(there, v, -t), a, -0.5 * t * (t + dt / state.substeps))


def gather(state, dt):
    """The bodies of the contacts at rest, where the step starts; the contacts sorted by colour.

    Neighbours of one colour share no body that moves, so that the processor can work on several at once.
    """
    solver, pairs, bodies = state.solver, state.pairs, state.bodies
    for i in range(state.moving if len(bodies.held) > 0 else 0):
        bodies.held[i] = False
    if solver.contacts == 0:
        return OK
    if len(bodies.held) == 0:
        return NEED_COLUMNS
    if solver.contacts > len(solver.first) or min(2 * solver.contacts, state.count) > len(solver.body_row):
        state.needed = solver.contacts
        return NEED_SOLVER
    colour_contacts(state)
    for r in range(solver.contacts):
        c, k = pairs.resting[r], solver.starts[solver.colour[r]]
        solver.starts[solver.colour[r]] += 1
        solver.slot[r], solver.pair[k] = k, c
        solver.first[k], solver.second[k] = bodies.place[pairs.a[c]], bodies.place[pairs.b[c]]
    inverse_mass, nothing = bodies.inverse_mass, zero_of(state)
    for q in range(solver.bodies):
        i = solver.body_row[q]
        solver.inverse_mass[q] = inverse_mass[i]
        v, x, a = nothing, nothing, nothing
        if i < state.moving:
            v = bodies.start_velocity[i]
            if inverse_mass[i] > 0.0:
                x = sub(bodies.origin[i], bodies.previous_position[i])
                a = sub(bodies.linear_velocity[i], v)
                if bodies.supported[i]:
                    a = sub(a, bodies.support_change[i])
                a = scale(a, 1.0 / dt)
                if state.impacts.sweeps and bodies.impact_count[i] > 0:
                    x = start_of_flight(state, i, v, a, dt)
        solver.velocity[q], solver.shift[q], solver.acceleration[q] = v, x, a
    return OK


@part
def bound_throws(state, dt):
    """Heavy bodies may squeeze a light one out between them at many times their speed, and in a discrete world what is
    that fast passes through walls. So the solver makes no body go farther in a step than its own extent, or than
    MOST_THROW times as far as it and those that it touches went."""
    solver, bodies, any_far = state.solver, state.bodies, False
    speed, fastest = solver.worst, solver.far
    for q in range(solver.bodies):
        far = max(length(solver.shift[q]), length(solver.velocity[q]) * dt)
        any_far |= solver.inverse_mass[q] > 0.0 and far > bodies.min_extent[solver.body_row[q]]
    if not any_far:
        return
    for q in range(solver.bodies):
        i = solver.body_row[q]
        before = length(bodies.start_velocity[i]) if i < state.moving else 0.0
        speed[q] = fastest[q] = before + length(solver.acceleration[q]) * dt
    for k in range(solver.contacts):
        a, b = solver.first[k], solver.second[k]
        fastest[a], fastest[b] = max(fastest[a], speed[b]), max(fastest[b], speed[a])
    for q in range(solver.bodies):
        i, way, rate = solver.body_row[q], length(solver.shift[q]), length(solver.velocity[q]) * dt
        most = max(bodies.min_extent[i], MOST_THROW * fastest[q] * dt)
        if solver.inverse_mass[q] > 0.0 and max(way, rate) > most:
            solver.shift[q] = scale(solver.shift[q], min(1.0, most / way) if way > 0.0 else 1.0)
            solver.velocity[q] = scale(solver.velocity[q], min(1.0, most / rate) if rate > 0.0 else 1.0)
            note_squeezed(solver, i)


def put_back(state, dt):
    """Bodies that some contact pushed take what the solver says; without the predicted support they fly free."""
    solver, pairs, bodies = state.solver, state.pairs, state.bodies
    if solver.contacts > 0 and not state.sweeping:
        bound_throws(state, dt)
    for r in range(solver.contacts):
        k = solver.slot[r]
        pairs.impulse[pairs.resting[r]] += solver.total[k] + solver.shock[k]
        if solver.worked[k]:
            bodies.held[solver.body_row[solver.first[k]]] = True
            bodies.held[solver.body_row[solver.second[k]]] = True
    for q in range(solver.bodies if solver.contacts > 0 else 0):
        i = solver.body_row[q]
        bodies.place[i] = -1
        if bodies.held[i] and solver.inverse_mass[q] > 0.0:
            bodies.position[i] = add(bodies.previous_position[i], solver.shift[q])
            bodies.linear_velocity[i] = solver.velocity[q]
    if state.any_support:
        drop_support(state, dt, STOPPED)
    return OK
