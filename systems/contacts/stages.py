"""The stages that open and end the response: no contact yet; those of the step, against those of the one before."""

from __future__ import annotations

from ...framework.compilation import part
from ...framework.schedule.stages import Rows
from ...framework.vectors import add
from ..codes import FAULTS, OK, RUN_NARROW
from ..narrow_phase.manifolds import move_to_end, move_to_start, shape_centre
from ..records import CONTACT_ROWS
from .solving.records import KINDS_OF_FAULT

ROOM_FOR_CONTACTS = (Rows("contacts", CONTACT_ROWS, lambda s: s.pairs.touching_count),)
# Where no response has looked at the end of the step.
ROOM_FOR_FOUND = (Rows("contacts", CONTACT_ROWS, lambda s: s.pairs.found if s.found_current else 0),)


def begin_response(state, dt):
    """Where the paths begin; the response is idle if nothing is near anything and nothing rested."""
    if state.collides and not state.contacts_ready:
        return RUN_NARROW
    bodies, pairs, memory, moved = state.bodies, state.pairs, state.warm_start, state.moved
    near = pairs.found if moved else pairs.count  # in a step, what is near at its end is among those found
    unknown = state.sweeping and moved and state.neighbours_known_until < dt
    solver = state.solver
    state.response_idle = near + solver.joints.active + memory.counts[memory.now] == 0 and not unknown
    for kind in range(KINDS_OF_FAULT):
        solver.faults[kind] = 0
    solver.islands = state.impacts.halted = 0
    state.impacts_recorded = False
    if state.response_idle:
        return OK
    move_to_start(state)
    for c in range(pairs.count):
        pairs.impulse[c] = 0.0
    if not moved:  # the phase is run alone: the bodies stand where they overlap
        state.path_degree = 1
        for i in range(state.count):
            bodies.previous_position[i] = bodies.position[i]
            bodies.path_velocity[i] = bodies.linear_velocity[i]
            bodies.start_velocity[i] = bodies.linear_velocity[i]
    for i in range(state.first, state.moving):
        bodies.origin[i] = bodies.previous_position[i]
    return OK


@part
def write_contacts(state):
    """The touching pairs as the contacts of the step, in canonical order; disabled pairs count as not touching."""
    pairs, contacts, bodies, entity = state.pairs, state.contacts, state.bodies, state.bodies.entity
    new, count = 1 - contacts.now, 0
    for r in range(pairs.touching_count):
        c = pairs.touching[r]
        contacts.entity_a[new, count], contacts.entity_b[new, count] = entity[pairs.a[c]], entity[pairs.b[c]]
        contacts.point[new, count] = add(shape_centre(bodies, pairs.a[c]), pairs.point[c])
        contacts.normal[new, count] = pairs.normal[c]
        contacts.depth[new, count], contacts.impulse[new, count] = pairs.depth[c], pairs.impulse[c]
        contacts.enabled[new, count], contacts.rested[new, count] = not pairs.disabled[c], pairs.rests[c]
        count += 1
    contacts.counts[new], contacts.steps[new], contacts.stays[new] = count, state.step_number, 0
    contacts.now = new
    state.found_current = False
    state.contacts_version += 1
    state.motion_version += 1


def publish_contacts(state, dt):
    """The contacts at the end of the step."""
    write_contacts(state)
    return OK


@part
def publish_found(state, dt):
    """What overlaps where free flight leads, as the contacts of a step in which no response has looked at its end."""
    pairs, count = state.pairs, 0
    move_to_end(state, dt)
    for h in range(pairs.found):
        c = pairs.hits[h]
        if pairs.hit[c]:
            pairs.impulse[c], pairs.rests[c], pairs.touching[count] = 0.0, False, c
            count += 1
    pairs.touching_count = count
    write_contacts(state)
    state.contacts_counted += count


def compare_contacts(state, dt):
    """Rows of the contacts that ceased, began and stayed; both lists are in canonical order."""
    if state.found_current:
        publish_found(state, dt)
    contacts, impacts = state.contacts, state.impacts
    now = contacts.now
    old, i, j, ends, begins, stays = 1 - now, 0, 0, 0, 0, 0
    a0, b0, enabled = contacts.entity_a, contacts.entity_b, contacts.enabled
    count, before, same_ids = contacts.counts[now], contacts.counts[old], not state.ids_changed
    while i < before or j < count:
        if i < before and not enabled[old, i]:
            i += 1
        elif j < count and not enabled[now, j]:
            j += 1
        elif (i < before and not same_ids) or j == count or (
            i < before
            and (a0[old, i] < a0[now, j] or (a0[old, i] == a0[now, j] and b0[old, i] < b0[now, j]))
        ):  # all of them are over
            contacts.ended[ends] = i
            ends += 1
            i += 1
        elif i == before or a0[old, i] != a0[now, j] or b0[old, i] != b0[now, j]:
            contacts.began[begins] = j
            begins += 1
            j += 1
        else:
            contacts.stayed[now, stays] = j
            stays += 1
            i += 1
            j += 1
    state.ids_changed = False
    contacts.ends, contacts.begins, contacts.stays[now] = ends, begins, stays
    faults = impacts.capped + impacts.halted + state.too_fast_for_discrete
    faults += state.turns_too_far
    for kind in range(KINDS_OF_FAULT):
        faults += state.solver.faults[kind]
    staying = stays + contacts.stored if state.stay_wanted else 0
    state.event_count = ends + begins + staying + impacts.logged + faults
    return FAULTS if faults > 0 and not state.others_write else OK
