"""Impacts at the same time, but for rounding: none of them is first.

Those that share a body which can be moved are a group, and solved together (see group). All groups of one time come
before what follows from them, so that the order of bodies decides nothing.

A row of balls that touch is no group: its second ball is not struck before the first impact has been.
"""

from __future__ import annotations

from ...framework.compilation import part
from ...framework.jit.records.record_type import zero_of
from ...framework.vectors import dot
from ..ccd.time_of_impact import clear_of_rounding
from ..codes import NEED_ROOM, OK
from ..contacts.solving.passes import sort_by
from ..integration.trajectory import rate_along, relative_path
from ..joints.groups import is_joined
from ..parts.rows import owner_of
from .group import LEAST_PASSES, WORK, is_shooting, is_turning_group, push_group, solve_group
from .heap import heap_pop, heap_push, is_current
from .impulses import CROSSING, IMPACT, bounce_pair, note_crossing
from .worklist import list_landings, list_pairs_of

EQUAL = 1e-6  # of the step: times that differ by more are never the same, however slow the approach


@part
def is_at(state, event, dt):
    """Whether an impact's time is ``now`` but for the rounding of places: of these its time is as uncertain as they are
    over the speed of approach."""
    impacts, pairs, now = state.impacts, state.pairs, state.impacts.now
    later = impacts.event_time[event] - now
    if later == 0.0:
        return True
    c = impacts.event_pair[event]
    path = relative_path(state, pairs.a[c], pairs.b[c])
    speed = abs(dot(rate_along(path, now), impacts.event_normal[event]))
    return later <= EQUAL * dt and later * speed <= clear_of_rounding(state, pairs.a[c], pairs.b[c], path, now)


@part
def next_at(state, dt):
    """The earliest event in the queue that holds, if its time is ``now`` or soon, else -1; it stays there. Crossings
    before it are noted, as they change no path."""
    impacts = state.impacts
    while impacts.waiting > 0:
        event = impacts.heap[0]
        time = impacts.event_time[event]
        if time - impacts.now > EQUAL * dt or (impacts.sweeps and time > impacts.until):
            return -1
        if is_current(state, event):
            if impacts.event_kind[event] != CROSSING or not is_at(state, event, dt):
                return event
            note_crossing(state, event)
        heap_pop(impacts)
    return -1


@part
def is_member(state, event, dt):
    """Whether an event that comes now or soon is one of the impacts at that time: joints hold none of its bodies, and
    none has to land on something thin before."""
    impacts, c = state.impacts, state.impacts.event_pair[event]
    waits = impacts.event_kind[event] != IMPACT or is_joined(state, state.pairs.a[c], state.pairs.b[c])
    if waits or not is_at(state, event, dt):
        return False
    if impacts.may_sink:
        list_landings(state, c, impacts.event_time[event])
    free, impacts.listed = impacts.listed == 0, 0
    return free


@part
def requeue(impacts, event):
    """Add an event to the queue again that has been taken off it."""
    place = impacts.waiting
    while impacts.heap[place] != event:
        place += 1
    heap_push(impacts, place)


def resolve_simultaneous(state, event, dt):
    """Carry out all impacts at the time of ``event``, which has been taken off the queue, if there are others.

    Returns OK; NEED_ROOM if there is no room, and nothing has changed then; -1 if there is none besides it, or no
    work left for groups, or joints hold its bodies: such impacts come one after the other.
    """
    impacts, c = state.impacts, state.impacts.event_pair[event]
    if is_joined(state, state.pairs.a[c], state.pairs.b[c]):
        return -1
    if impacts.group_visits >= WORK or next_at(state, dt) < 0:
        return -1
    most = 1
    for k in range(impacts.waiting):
        most += impacts.event_time[impacts.heap[k]] - impacts.now <= EQUAL * dt
    room = min(len(impacts.member), len(impacts.next_member) // 2, len(impacts.log_pair) - impacts.logged)
    if most > room or state.count > len(impacts.first_member):
        impacts.together = most
        return NEED_ROOM
    member, members, following = impacts.member, 0, event
    while following >= 0:
        member[members] = following
        members += 1
        following = next_at(state, dt)
        if following >= 0:
            heap_pop(impacts)
    link_members(state, members, dt)
    for m in range(members):
        if impacts.is_left[m]:
            take_group(state, m, dt)
    return OK


@part
def link_members(state, members, dt):
    """Chain the impacts of each body that can be moved: firsts[i] is the first of row i, then follows next_member[it],
    till -1. An entry is twice the member for its first body, one more for its second. A pair that is there twice is
    left out once; what is no member goes back to the queue."""
    impacts, pairs, inverse_mass = state.impacts, state.pairs, state.bodies.inverse_mass
    event_pair, member, firsts = impacts.event_pair, impacts.member, impacts.first_member
    next_member, is_left = impacts.next_member, impacts.is_left
    for m in range(members):
        c = event_pair[member[m]]
        for i in (owner_of(state, pairs.a[c]), owner_of(state, pairs.b[c])):
            firsts[i], impacts.gained[i] = -1, zero_of(state)
    for m in range(members):
        if m > 0 and not is_member(state, member[m], dt):
            requeue(impacts, member[m])
            is_left[m] = False
            continue
        c = event_pair[member[m]]
        a, b = owner_of(state, pairs.a[c]), owner_of(state, pairs.b[c])
        entry = firsts[a if inverse_mass[a] > 0.0 else b]
        while entry >= 0 and event_pair[member[entry // 2]] != c:
            entry = next_member[entry]
        is_left[m] = entry < 0
        for side in range(2 if entry < 0 else 0):
            i = a if side == 0 else b
            if inverse_mass[i] > 0.0:
                next_member[2 * m + side] = firsts[i]
                firsts[i] = 2 * m + side


@part
def find_group(state, m):
    """Write into ``group`` member m and all that bodies which can be moved connect with it; returns how many."""
    impacts, pairs, done, reached = state.impacts, state.pairs, 0, 1
    group, is_left = impacts.group, impacts.is_left
    group[0], is_left[m] = m, False
    while done < reached:
        c = impacts.event_pair[impacts.member[group[done]]]
        done += 1
        for i in (owner_of(state, pairs.a[c]), owner_of(state, pairs.b[c])):
            entry = impacts.first_member[i]
            while entry >= 0:
                if is_left[entry // 2]:
                    is_left[entry // 2] = False
                    group[reached] = entry // 2
                    reached += 1
                entry = impacts.next_member[entry]
    for g in range(reached):  # canonical order, for the log
        impacts.terms[group[g]] = impacts.event_key[impacts.member[group[g]]]
    sort_by(group, reached, impacts.terms)
    return reached


@part
def take_group(state, m, dt):
    """Carry out the impact of member m, and those that are connected with it.

    In a discrete world what overlaps when a step ends only seems to be at one time. There these impacts come one after
    the other where all at once would shoot a body through a wall; so they do if there are too many for this step,
    and where normals turn a body.
    """
    impacts, pairs, logged = state.impacts, state.pairs, state.impacts.logged
    group, first = impacts.group, impacts.member[m]
    impacts.now = impacts.event_time[first]
    count = find_group(state, m)
    single = count == 1 or is_turning_group(state, count)
    solves = not single and impacts.group_visits + LEAST_PASSES * count <= WORK
    if solves:
        solves = solve_group(state, count)
    elif not single:
        impacts.group_visits = WORK
    if solves and not (is_shooting(state, count) and not impacts.sweeps):
        push_group(state, count, dt)
    else:
        for g in range(count - 1, -1, -1):  # the last one off the queue is found first
            if group[g] != m:
                requeue(impacts, impacts.member[group[g]])
        bounce_pair(state, first, dt)
    for k in range(logged, impacts.logged):
        c, listed = impacts.log_pair[k], -1
        for i in (owner_of(state, pairs.a[c]), owner_of(state, pairs.b[c])):
            if impacts.first_member[i] >= 0:
                impacts.first_member[i] = -1  # once each
                list_pairs_of(state, i, listed, dt)
            listed = c
