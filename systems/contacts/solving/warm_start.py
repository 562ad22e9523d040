"""What is known of last step's contacts at rest: the impulses that the solver starts with.

Pairs in canonical order with the impulse of the last substep and its friction (tangent), as if the step were one
substep, and what it gave in the whole step (total).
"""

from __future__ import annotations

import math

from ....framework.compilation import part
from ....framework.data.row_moves import place_of
from ....framework.jit.records.record_type import zero_of
from ....framework.schedule.stages import Rows
from ....framework.vectors import add_scaled, dot, scale, sub
from ...codes import OK
from ...narrow_phase.manifolds import skip_before
from ..constants import NEGLIGIBLE, SAME_PLACE_EXTENTS, WARM_START_MAX
from .guard import island_of
from .records import WARM_START_ROWS

FOLLOWS = 0.1  # s per s by which the period of springs follows the length of steps: what long ones let sink in has
# time to come up, and is not thrown


@part
def scale_to(state, dt):
    """The impulses that belong to steps of other length than this one."""
    memory, now = state.warm_start, state.warm_start.now
    step = memory.step
    if dt != step[now]:
        by = dt / step[now]
        for m in range(memory.counts[now]):
            memory.impulse[now, m] *= by
            memory.tangent[now, m] = scale(memory.tangent[now, m], by)
            memory.total[now, m] *= by
        step[now] = dt


@part
def row_of(state, wanted):
    """The row of an entity; -1 if it is no body. Entities ascend within each block of rows."""
    entity, low = state.bodies.entity, 0
    for high in (state.sleepers, state.dynamic, state.moving, state.count):
        row = place_of(entity, low, high, wanted)
        if row < high and entity[row] == wanted:
            return row
        low = high
    return -1


@part
def shaped_row_of(state, entity):
    """The row of an entity; -1 if it is no body, or has no shape."""
    row = row_of(state, entity)
    return row if row >= 0 and state.bodies.shape[row] >= 0 else -1


@part
def find_rows(state):
    """The rows of the remembered pairs, -1 for bodies that are gone, or have lost their shape. They hold until rows
    move or shapes go."""
    memory, now = state.warm_start, state.warm_start.now
    if memory.rows_version[now] == state.version:
        return
    for m in range(memory.counts[now]):
        memory.first[now, m] = shaped_row_of(state, memory.entity_a[now, m])
        memory.second[now, m] = shaped_row_of(state, memory.entity_b[now, m])
    memory.rows_version[now] = state.version


@part
def start_with(solver, memory, k, several, span):
    """Row k starts with the impulses of the point of its pair, remembered in a range, that is nearest to it; of the
    first one if there are not several, then or now, or where points have no places as nothing turns."""
    now, m = memory.now, span[0]
    if several:
        farthest = SAME_PLACE_EXTENTS * solver.extent[k]
        nearest, m = farthest * farthest, -1
        for one in range(span[0], span[1]):
            away = sub(memory.place[now, one], solver.place[k])
            square = dot(away, away)
            if square < nearest and not memory.off[one]:
                nearest, m = square, one
        if m < 0:
            return
        memory.off[m] = True  # each once
    n, pull = solver.normal[k], memory.tangent[now, m]
    solver.impulse[k] = memory.impulse[now, m]
    solver.tangent[k] = add_scaled(pull, n, -dot(pull, n))


def match_warm_start(state, dt):
    """Start each contact with the impulses that its pair had, along the normal of now. The memory is that of a step of
    this length already, see ``predict_rest``. Both lists are in canonical order."""
    solver, memory, pairs, entity = state.solver, state.warm_start, state.pairs, state.bodies.entity
    now, zero, r, m, pair, contacts = memory.now, zero_of(state), 0, 0, solver.pair, solver.contacts
    while r < contacts:
        c, begin = pair[r], r
        a, b = pairs.a[c], pairs.b[c]
        stop = m = skip_before(memory, m, entity[a], entity[b])
        while stop < memory.counts[now] and memory.first[now, stop] == a and memory.second[now, stop] == b:
            stop += 1
        while r < contacts and pair[r] == c:
            r += 1
        several = state.spinning and (stop - m > 1 or r - begin > 1)
        for one in range(begin, r):
            k = solver.slot[one]
            solver.impulse[k], solver.tangent[k] = 0.0, zero
            if stop > m:
                start_with(solver, memory, k, several, (m, stop))
        m = stop
    return OK


ROOM_TO_STORE = (Rows("warm_start", WARM_START_ROWS, lambda s: 0 if s.response_idle else s.solver.contacts),)


def store_warm_start(state, dt):
    """Keep the contacts that pushed, for the next step; the memory until now stays, for a step that is undone."""
    solver, memory, pairs, entity = state.solver, state.warm_start, state.pairs, state.bodies.entity
    if state.response_idle or solver.contacts + solver.joints.active + memory.counts[memory.now] == 0:
        return OK
    new, count, nowhere = 1 - memory.now, 0, scale(zero_of(state), math.nan)
    for r in range(solver.contacts):
        k, c = solver.slot[r], solver.pair[r]
        if not solver.total[k] * dt > NEGLIGIBLE * solver.extent[k] * solver.mass[k]:  # of rounding; also nan
            continue
        a, b = pairs.a[c], pairs.b[c]
        memory.first[new, count], memory.second[new, count] = a, b
        memory.entity_a[new, count], memory.entity_b[new, count] = entity[a], entity[b]
        last, memory.total[new, count] = solver.impulse[k], solver.total[k]
        most = WARM_START_MAX * solver.force_of[island_of(solver, k)]
        kept = most / last if last > most else 1.0
        memory.impulse[new, count], memory.tangent[new, count] = kept * last, scale(solver.tangent[k], kept)
        memory.place[new, count] = solver.place[k] if state.spinning else nowhere
        count += 1
    memory.counts[new], memory.rows_version[new] = count, state.version
    most = memory.period[memory.now] + FOLLOWS * dt  # one long step alone lets nothing sink in
    memory.step[new], memory.period[new] = dt, min(solver.joints.period * state.substeps, most)
    memory.now = new
    return OK
