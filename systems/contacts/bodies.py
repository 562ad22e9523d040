"""The bodies that have contacts at rest, gathered for the solver, and what it made of them put back."""

from __future__ import annotations

from ...framework.compilation import part
from ...framework.jit.records.record_type import zero_of
from ...framework.schedule.stages import Rows
from ...framework.vectors import add, add_scaled, dot, length, scale, sub
from ..ccd.turning_touch import turn_of_path
from ..codes import OK
from ..integration.trajectory import along, path_of
from ..integration.turning import size_of_turn
from ..joints.bodies import build_joint_rows
from ..joints.order import order_direct
from ..joints.records import DIRECT_BODIES
from ..linking.parts import JOINED_BODIES, JOINED_START, TURN_BACK, call_of_step
from ..parts.rows import next_row, owner_of, place_of
from ..parts.stages import copy_to_parts
from ..records import (
    HELD_COLUMNS,
    REST_COLUMNS,
    SOLVER_ARMS,
    SOLVER_BODIES,
    SOLVER_CONTACTS,
    SOLVER_SPINS,
    SOLVER_SURFACES,
    UNDO_HOLD,
)
from ..shapes.surfaces import any_surface_runs
from ..step_stages import KEEPS_HOLD
from .points import points_of
from .solving.islands import order_joints, order_rows
from .solving.prediction import drop_support
from .solving.rows import rotate_body


@part
def start_of_flight(state, i, q, t, dt):
    """From where the substeps would take row i, of body q, to the place of an impact at time t."""
    v, a, i = state.solver.velocity[q], state.solver.acceleration[q], owner_of(state, i)
    there = sub(along(path_of(state, i), t), state.bodies.previous_position[i])
    return add_scaled(add_scaled(there, v, -t), a, -0.5 * t * (t + dt / state.substeps))


@part
def reach_from_centre(state, i):
    """How far the shapes of body i reach from its centre of mass."""
    bodies, reach, k = state.bodies, 0.0, i
    while k >= 0:
        if bodies.shape[k] >= 0:
            reach = max(reach, length(bodies.half_extents[k]) + length(bodies.offset[k]))
        k = next_row(state, k)
    return reach


@part
def list_rows(state):
    """The pair of each contact, and which of its points; in canonical order. Whether the points are those of the list
    that was there."""
    solver, pairs, r, same = state.solver, state.pairs, 0, True
    for h in range(pairs.resting_count):
        c = pairs.resting[h]
        for e in range(points_of(state, c) if solver.any_tips else 1):
            same &= solver.point[r] == e
            solver.pair[r], solver.point[r] = c, e
            r += 1
    return same


@part
def rows_at_rest(state):
    """Contacts at rest, and rows of joints."""
    return state.solver.contacts + state.solver.joints.active


@part
def bodies_at_rest(state):
    """So many bodies they have at most, and the world, which joints hold on to."""
    return min(2 * rows_at_rest(state), state.count) + 1


ROOM_AT_REST = (
    Rows("bodies", (*REST_COLUMNS, *HELD_COLUMNS, *UNDO_HOLD), lambda s: s.count if rows_at_rest(s) > 0 else 0),
    Rows("solver", SOLVER_CONTACTS, rows_at_rest),
    Rows("solver", SOLVER_BODIES, bodies_at_rest),
    Rows("solver", SOLVER_ARMS, lambda s: rows_at_rest(s) if s.spinning else 0),
    Rows("solver", SOLVER_SURFACES, lambda s: rows_at_rest(s) if any_surface_runs(s) else 0),
    Rows("solver.direct", DIRECT_BODIES, lambda s: bodies_at_rest(s) if s.solver.joints.active > 0 else 0),
    Rows("solver", SOLVER_SPINS, lambda s: bodies_at_rest(s) if s.spinning else 0),
)  # fmt: skip


def gather(state, dt):
    """The bodies of the contacts at rest, where the step starts; the contacts sorted by colour.

    Neighbours of one colour share no body that moves, so that the processor can work on several at once.
    """
    solver, bodies, moving = state.solver, state.bodies, state.moving
    pairs, impacts = state.pairs, state.impacts
    for i in range(state.first, moving if len(bodies.held) > 0 else 0):
        bodies.held[i] = False
    if rows_at_rest(state) == 0:
        return OK
    state.kept |= KEEPS_HOLD
    for i in range(state.first, moving):
        bodies.kept_hold[i], bodies.kept_held_velocity[i] = bodies.hold[i], bodies.held_velocity[i]
    order_rows(state, dt, list_rows(state))
    nothing = zero_of(state)
    solver.movers = 0
    for q in range(solver.bodies):
        i = solver.body_row[q]
        w = bodies.inverse_mass[i]
        solver.inverse_mass[q], solver.solver_mass[q] = w, 1.0 / w if w > 0.0 else 0.0
        v, x, a = nothing, nothing, nothing
        if i < moving:
            v = bodies.start_velocity[i]
            if w == 0.0 and (dot(v, v) > 0.0 or (state.spinning and size_of_turn(bodies.spin[i]) > 0.0)):
                solver.mover[solver.movers] = q
                solver.movers += 1
            if w > 0.0:
                x = sub(bodies.origin[i], bodies.previous_position[i])
                a = sub(bodies.linear_velocity[i], v)
                if bodies.warm_started[i]:
                    a = sub(a, bodies.warm_start_velocity[i])
                a = scale(a, 1.0 / dt)
        solver.velocity[q], solver.shift[q], solver.acceleration[q] = v, x, a
    for k in range(impacts.logged if state.collides else 0):  # the last one of each body counts
        c = impacts.log_pair[k]
        for i in (pairs.a[c], pairs.b[c]):
            q = place_of(state, i)
            if q >= 0 and solver.inverse_mass[q] > 0.0:
                solver.shift[q] = start_of_flight(state, i, q, impacts.log_time[k], dt)
    for q in range(solver.bodies if state.spinning else 0):
        i = solver.body_row[q]
        solver.spin[q], solver.middle[q] = bodies.spin[i], nothing
        rotate_body(solver, q, scale(turn_of_path(state, i, dt), -1.0))  # to where the step starts
        solver.reach[q] = reach_from_centre(state, i) if state.collides else 0.0
        solver.inverse_inertia[q] = bodies.inverse_inertia[i]
        solver.inverse_products[q] = bodies.inverse_products[i]
    if solver.joints.active > 0:
        call_of_step(state.links[JOINED_BODIES], state, dt)
    return OK


def gather_joined(state, dt):
    """The order of joints, where they hold their bodies, and how these turn by themselves in space."""
    solver = state.solver
    if len(zero_of(state)) == 3:
        call_of_step(state.links[TURN_BACK], state, dt)
    if state.impacts.active and state.impacts.logged > 0:
        call_of_step(state.links[JOINED_START], state, dt)
    order_joints(state)
    order_direct(solver)
    build_joint_rows(state)
    return OK


def put_back(state, dt):
    """Bodies that some contact pushed take what the solver says; without the predicted support they fly free."""
    solver, pairs, bodies, joints = state.solver, state.pairs, state.bodies, state.solver.joints
    held = bodies.held
    for r in range(solver.contacts):
        k = solver.slot[r]
        pairs.impulse[solver.pair[r]] += solver.total[k]
        if solver.peak[k] > 0.0:
            for q in (solver.first[k], solver.second[k]):
                held[solver.body_row[q]] = True
    for e in range(joints.active):
        j = joints.order[e]
        for i in (joints.row_a[j], joints.row_b[j]):
            if i >= 0:
                held[owner_of(state, i)] = True
    for q in range(solver.bodies if solver.contacts + joints.active > 0 else 0):
        i = solver.body_row[q]
        bodies.place[i] = -1
        if state.spinning:
            bodies.contact_travel[i] = size_of_turn(solver.turn[q]) * solver.reach[q]
        if held[i] and solver.inverse_mass[q] > 0.0:
            bodies.position[i] = add(bodies.previous_position[i], solver.shift[q])
            velocity = solver.velocity[q]
            gained = scale(sub(velocity, bodies.start_velocity[i]), 1.0 / dt)
            bodies.linear_velocity[i] = bodies.held_velocity[i] = velocity
            bodies.hold[i] = sub(gained, solver.acceleration[q])
            if state.spinning:
                bodies.spin[i], bodies.turn[i] = solver.spin[q], add(bodies.turn[i], solver.turn[q])
    if state.any_warm_started:
        drop_support(state, dt)
    copy_to_parts(state)
    return OK
