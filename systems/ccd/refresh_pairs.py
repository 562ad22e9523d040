"""When an impact sends a body out of its search bounds, the pairs for the rest of the step are searched again.

The boxes of the broad phase hold each body's foreseen motion and a margin for what impacts make of it. The event loop
stops when a body leaves its bounds. Then candidates are made for the rest of the step from the paths as they are now,
and the loop goes on. In most scenes that never happens; where everything is fast, a step takes several searches.

What the queue holds of pairs that are candidates again stays: their paths are the same. Only the others are searched.
"""

from __future__ import annotations

from ...framework.compilation import part
from ...framework.jit.records.record_type import zero_of
from ...framework.schedule.stages import Rows
from ..codes import OK
from ..impacts.heap import heap_push, is_current
from ..impacts.records import EVENTS
from ..impacts.worklist import list_pair, most_listed
from ..integration.trajectory import along, relative_path
from ..narrow_phase.manifolds import forget_manifold
from ..narrow_phase.one_way import one_way_holds
from ..narrow_phase.stages import is_solid_pair, layers_meet, rank_rows
from ..records import PAIR_COLUMNS

SURVIVED, GONE = -1, -2  # in ``pairs.place``; from 0 on it is the place in the other list


@part
def mark_kept(state):
    """place[c] = SURVIVED for the pairs that something has come of in this step, GONE for the others."""
    pairs, impacts, place = state.pairs, state.impacts, state.pairs.place
    for c in range(pairs.count):
        place[c] = SURVIVED if pairs.crossed[c] or pairs.impulse[c] > 0.0 or pairs.disabled[c] else GONE
    for h in range(pairs.found):
        place[pairs.hits[h]] = SURVIVED
    for k in range(impacts.logged):  # of which some have no impulse, where joints took all
        place[impacts.log_pair[k]] = SURVIVED


@part
def keep_pair(state, j, found):
    """Pair j of the list until now becomes pair ``found`` of the new one."""
    old, new = state.pairs, state.merged
    old.place[j] = found
    new.a[found], new.b[found] = old.a[j], old.b[j]
    new.is_solid[found], new.near_contact[found] = old.is_solid[j], old.near_contact[j]
    new.crossed[found], new.disabled[found] = old.crossed[j], old.disabled[j]
    new.impulse[found], new.struck[found], new.parting[found] = old.impulse[j], old.struck[j], old.parting[j]
    new.hit[found], new.early[found], new.at[found] = old.hit[j], old.early[j], old.at[j]
    new.depth[found], new.normal[found], new.point[found] = old.depth[j], old.normal[j], old.point[j]


@part
def add_pair(state, a, b, found, dt):
    """A candidate becomes pair ``found``; how it stands at the end is not known yet."""
    new, is_solid = state.merged, state.merged.is_solid
    new.a[found], new.b[found] = a, b
    is_solid[found] = is_solid_pair(state, a, b)
    new.near_contact[found], new.crossed[found], new.disabled[found] = True, False, False
    new.early[found], new.impulse[found] = False, 0.0
    new.normal[found] = new.point[found] = zero_of(state)
    forget_manifold(new, found)
    if is_solid[found]:
        path, now = relative_path(state, a, b), state.impacts.until
        if not one_way_holds(state, a, b, along(path, now), along(path, dt), -1.0):
            is_solid[found], new.disabled[found] = False, True
            new.disabled_count += 1


@part
def renumber(state):
    """What names pairs by their place gets the new ones."""
    old, new, impacts = state.pairs, state.merged, state.impacts
    for h in range(old.found):
        new.hits[h] = old.place[old.hits[h]]
    for k in range(impacts.logged):
        impacts.log_pair[k] = old.place[impacts.log_pair[k]]
    new.found = old.found
    new.resting_count = new.touching_count = 0


@part
def keep_events(state):
    """The queue again, without the events of pairs that are gone, and those that do not hold any more."""
    old, impacts = state.pairs, state.impacts
    waiting, impacts.waiting = impacts.waiting, 0
    for k in range(waiting):
        event = impacts.heap[k]
        c = impacts.event_pair[event]
        if is_current(state, event) and old.place[c] >= 0:
            impacts.event_pair[event] = old.place[c]
            heap_push(impacts, k)


ROOM_TO_MERGE = (
    Rows("merged", PAIR_COLUMNS, lambda s: s.pairs.count + s.candidates.count),
    Rows("impacts", EVENTS, lambda s: most_listed(s.pairs.count + s.candidates.count)),
)  # fmt: skip


def merge_pairs(state, dt):
    """Join two lists in canonical order: candidates whose layers meet, and the pairs that something has come of. New
    candidates are searched for impacts."""
    candidates, old, new, rank = state.candidates, state.pairs, state.merged, state.bodies.rank
    impacts, place = state.impacts, state.pairs.place
    mark_kept(state)
    new.disabled_count = old.disabled_count
    if state.ranks_version != state.version:
        rank_rows(state)
    n, found, i, j = state.count, 0, 0, 0
    while i < candidates.count or j < old.count:
        new_key, old_key = n * n, n * n
        if i < candidates.count:
            new_key = rank[candidates.sorted_a[i]] * n + rank[candidates.sorted_b[i]]
        if j < old.count:
            old_key = rank[old.a[j]] * n + rank[old.b[j]]
        if old_key <= new_key:
            if place[j] == SURVIVED:
                keep_pair(state, j, found)
            elif old_key == new_key:
                add_pair(state, old.a[j], old.b[j], found, dt)
                place[j] = found
            found += 1 if place[j] >= 0 else 0
            i += 1 if old_key == new_key else 0
            j += 1
            continue
        a, b = candidates.sorted_a[i], candidates.sorted_b[i]
        i += 1
        if layers_meet(state, a, b):
            add_pair(state, a, b, found, dt)
            list_pair(impacts, found, impacts.until)
            found += 1
    new.count = found
    renumber(state)
    keep_events(state)
    impacts.linked, impacts.touchdown_pair, impacts.touchdown_time = False, -1, 0.0
    state.refreshes_counted += 1
    return OK
