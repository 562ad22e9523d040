"""The stages in which parts follow their bodies."""

from __future__ import annotations

from ...framework.compilation import part
from ...framework.jit.records.record_type import zero_of
from ...framework.vectors import add
from ..codes import OK
from ..contacts.solving.warm_start import row_of
from ..shapes.quaternions import product, rotation_in_space, set_rotation, write_axes
from .rows import owner_of


@part
def find_part_rows(state):
    """The rows of parts and of their bodies, chained in the order of the parts."""
    parts, bodies = state.parts, state.bodies
    for i in range(state.count):
        bodies.owner[i], bodies.next_part[i], bodies.part[i] = i, -1, -1
    for k in range(parts.count - 1, -1, -1):
        i, body = row_of(state, parts.entity[k]), row_of(state, parts.body[k])
        parts.row[k], parts.body_row[k] = i, body
        if i >= 0 and body >= 0:
            bodies.owner[i], bodies.part[i] = body, k
            bodies.next_part[i], bodies.next_part[body] = bodies.next_part[body], i
    parts.rows_version = state.version


@part
def takes_part(state, k):
    """Whether a part moves in this step, or may have been moved before it."""
    return state.parts.body_row[k] >= 0 and state.first <= state.parts.row[k] < state.moving


@part
def place_part(state, k):
    """A part is where its body is, turned as it is against it."""
    bodies, parts = state.bodies, state.parts
    i, body, rotation = parts.row[k], parts.body_row[k], state.bodies.rotation
    bodies.position[i], bodies.linear_velocity[i] = bodies.position[body], bodies.linear_velocity[body]
    if len(rotation) == 0:
        return
    if len(zero_of(state)) == 2:
        rotation[i] = rotation[body] + parts.turn[k, 0]
    else:
        turn = parts.turn[k, 0], parts.turn[k, 1], parts.turn[k, 2], parts.turn[k, 3]
        set_rotation(state, i, product(rotation_in_space(state, body), turn))


def begin_parts(state, dt):
    """Which rows belong together; the game may have moved the bodies."""
    parts = state.parts
    if parts.rows_version != state.version:
        find_part_rows(state)
    state.has_parts = True
    for k in range(parts.count):
        if takes_part(state, k):
            place_part(state, k)
    return OK


@part
def add_masses_of_parts(state):
    """Rows of parts are moved as their bodies are."""
    bodies, parts = state.bodies, state.parts
    for k in range(parts.count if state.has_parts else 0):
        if takes_part(state, k):
            bodies.inverse_mass[parts.row[k]] = bodies.inverse_mass[parts.body_row[k]]


def carry_forces(state, dt):
    """Forces on parts act on their bodies."""
    bodies, parts = state.bodies, state.parts
    if state.unforced or len(bodies.force) == 0:
        return OK
    for k in range(parts.count):
        i, body = parts.row[k], parts.body_row[k]
        if body >= 0 and state.force_first <= i < state.dynamic:
            bodies.force[body], bodies.force[i] = add(bodies.force[body], bodies.force[i]), zero_of(state)
    return OK


def move_parts(state, dt):
    """Parts fly and turn with their bodies."""
    bodies, parts = state.bodies, state.parts
    for k in range(parts.count):
        if not takes_part(state, k):
            continue
        i, body = parts.row[k], parts.body_row[k]
        place_part(state, k)
        write_axes(state, i)
        bodies.previous_position[i] = bodies.previous_position[body]
        bodies.start_velocity[i], bodies.path_velocity[i] = bodies.start_velocity[body], bodies.path_velocity[body]
        if state.sweeping:
            bodies.origin[i] = bodies.origin[body]
        if state.path_degree > 1:
            bodies.path_second[i], bodies.path_third[i] = bodies.path_second[body], bodies.path_third[body]
        if state.spinning:
            bodies.spin[i], bodies.turn[i] = bodies.spin[body], bodies.turn[body]
            bodies.inverse_inertia[i] = bodies.inverse_inertia[body]
            bodies.inverse_products[i] = bodies.inverse_products[body]
            bodies.rolling_friction[i] = bodies.rolling_friction[body]
    return OK


def leave_out_parts(state, dt):
    """Pairs of one body are no candidates."""
    candidates, kept = state.candidates, 0
    first, second = candidates.first, candidates.second
    for c in range(candidates.count):
        a, b = first[c], second[c]
        first[kept], second[kept] = a, b
        kept += owner_of(state, a) != owner_of(state, b)
    candidates.count = kept
    return OK


@part
def copy_prediction_to_parts(state):
    """What was done to bodies before anything is known of the step was done to their parts."""
    bodies, parts = state.bodies, state.parts
    for k in range(parts.count if state.has_parts else 0):
        i, body = parts.row[k], parts.body_row[k]
        if body >= 0 and state.first <= i < state.moving:
            bodies.warm_started[i] = bodies.warm_started[body]
            bodies.warm_start_velocity[i] = bodies.warm_start_velocity[body]
            bodies.position[i], bodies.linear_velocity[i] = bodies.position[body], bodies.linear_velocity[body]
            bodies.path_velocity[i] = bodies.path_velocity[body]
            if state.path_degree > 1:
                bodies.path_second[i] = bodies.path_second[body]


@part
def copy_to_parts(state):
    """Parts are where their bodies are, and as fast, and have turned as far."""
    bodies, parts = state.bodies, state.parts
    for k in range(parts.count if state.has_parts else 0):
        if takes_part(state, k):
            i, body = parts.row[k], parts.body_row[k]
            bodies.position[i], bodies.linear_velocity[i] = bodies.position[body], bodies.linear_velocity[body]
            if state.spinning:
                bodies.spin[i], bodies.turn[i] = bodies.spin[body], bodies.turn[body]


def place_parts(state, dt):
    """Parts go where contacts have sent and turned their bodies."""
    for k in range(state.parts.count):
        if takes_part(state, k):
            place_part(state, k)
            write_axes(state, state.parts.row[k])
    return OK
