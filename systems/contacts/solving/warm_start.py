"""What is known of last step's contacts at rest: the impulses that the solver starts with.

Pairs in canonical order with the impulse of the last substep, its friction (tangent), and the sum of the normal impulse
over the step (total).
"""

from __future__ import annotations

from ....framework.compilation import part
from ....framework.data.row_moves import place_of
from ....framework.jit.records.record_type import zero_of
from ....framework.vectors import add_scaled, dot, scale
from ...codes import NEED_WARM_START, OK
from .firm import choose_firm, let_go

TURNED = 0.5  # cosine between last step's normal and this one's, below which the impulses say nothing


@part
def scale_to(state, dt):
    """The impulses that belong to steps of other length than this one."""
    memory, now = state.warm_start, state.warm_start.now
    substep = dt / state.substeps
    if dt != memory.step[now] or substep != memory.substep[now]:
        by_step, by_substep = dt / memory.step[now], substep / memory.substep[now]
        for m in range(memory.counts[now]):
            if dt != memory.step[now]:
                memory.total[now, m] *= by_step
            if substep != memory.substep[now]:
                memory.impulse[now, m] *= by_substep
                memory.tangent[now, m] = scale(memory.tangent[now, m], by_substep)
        memory.step[now], memory.substep[now] = dt, substep


@part
def row_of(state, wanted):
    """The row of an entity; -1 if it is no body. Entities ascend within the dynamic, kinematic and static rows."""
    entity = state.bodies.entity
    for kind in range(3):
        low = 0 if kind == 0 else (state.dynamic if kind == 1 else state.moving)
        high = state.dynamic if kind == 0 else (state.moving if kind == 1 else state.count)
        row = place_of(entity, low, high, wanted)
        if row < high and entity[row] == wanted:
            return row
    return -1


@part
def find_rows(state):
    """The rows of the remembered pairs; -1 for bodies that are gone. They hold until rows move."""
    memory, now = state.warm_start, state.warm_start.now
    if memory.rows_version[now] == state.version:
        return
    for m in range(memory.counts[now]):
        memory.first[now, m] = row_of(state, memory.entity_a[now, m])
        memory.second[now, m] = row_of(state, memory.entity_b[now, m])
    memory.rows_version[now] = state.version


def match_warm_start(state, dt):
    """Start each contact with the impulses that its pair had, if its normal has not turned far; else with none.

    Bodies that a contact of the last step pushes no more become unsettled: their other contacts push too much.
    """
    solver, memory, bodies, pairs = state.solver, state.warm_start, state.bodies, state.pairs
    if solver.contacts == 0:
        return OK
    entity, now, zero = bodies.entity, memory.now, zero_of(state)
    for k in range(solver.contacts):
        solver.impulse[k], solver.tangent[k] = 0.0, zero
    for q in range(solver.bodies):
        solver.unsettled[q] = False
    solver.any_unsettled = False
    if memory.counts[now] > 0:
        find_rows(state)
    r = 0
    for m in range(memory.counts[now]):
        first, second, same = memory.first[now, m], memory.second[now, m], False
        while r < solver.contacts:
            c = pairs.resting[r]
            same = pairs.a[c] == first and pairs.b[c] == second
            if same or entity[pairs.a[c]] > memory.entity_a[now, m]:
                break
            if entity[pairs.a[c]] == memory.entity_a[now, m] and entity[pairs.b[c]] > memory.entity_b[now, m]:
                break
            r += 1
        if same:
            k = solver.slot[r]
            r += 1
            n = solver.normal[k]
            if dot(memory.normal[now, m], n) > TURNED:
                pull = memory.tangent[now, m]
                solver.impulse[k] = memory.impulse[now, m]
                solver.tangent[k] = add_scaled(pull, n, -dot(pull, n))
                continue
        for side in range(2):
            i = first if side == 0 else second
            if i >= 0 and bodies.place[i] >= 0:
                solver.unsettled[bodies.place[i]] = True
                solver.any_unsettled = True
    choose_firm(state, dt / state.substeps, zero)
    let_go(solver, zero)
    return OK


def store_warm_start(state, dt):
    """Keep the contacts that pushed, for the next step; the memory until now stays, for a step that is undone."""
    solver, memory, pairs, entity = state.solver, state.warm_start, state.pairs, state.bodies.entity
    if state.response_idle or (solver.contacts == 0 and memory.counts[memory.now] == 0):
        return OK
    if solver.contacts > len(memory.work):
        state.needed = solver.contacts
        return NEED_WARM_START
    new, count = 1 - memory.now, 0
    for r in range(solver.contacts):
        k, c = solver.slot[r], pairs.resting[r]
        if not solver.total[k] > 0.0:  # also nan
            continue
        a, b = pairs.a[c], pairs.b[c]
        memory.first[new, count], memory.second[new, count] = a, b
        memory.entity_a[new, count], memory.entity_b[new, count] = entity[a], entity[b]
        memory.impulse[new, count], memory.total[new, count] = solver.impulse[k], solver.total[k]
        memory.normal[new, count], memory.tangent[new, count] = solver.normal[k], solver.tangent[k]
        count += 1
    memory.counts[new], memory.rows_version[new] = count, state.version
    memory.step[new], memory.substep[new] = dt, dt / state.substeps
    memory.now = new
    return OK
