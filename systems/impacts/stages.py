"""The stage of impacts: in order of time, each followed by a new search among the pairs of both bodies."""

from __future__ import annotations

import math

from ...framework.compilation import part
from ...framework.jit.records.record_type import request
from ...framework.schedule.stages import Rows
from ..ccd.search_bounds import FAST
from ..codes import NEED_IMPACTS, NEED_ROOM, NEED_TOGETHER, OK, REFRESH_PAIRS
from ..linking.parts import FIRST_TOUCH, TAKE_TOGETHER, call_take_together
from ..narrow_phase.stages import flag_fast_bodies
from .find import queue_next_impact
from .heap import heap_pop, is_current
from .impulses import CROSSING, IMPACT, STOPPED, bounce_pair, hand_over, note_crossing, stop_body
from .records import BEARINGS, BODIES_OF_MEMBERS, EVENTS, LOG, MEMBERS
from .together import EQUAL, requeue
from .worklist import list_contacts, list_landings, list_neighbours, list_pairs_of, most_listed

EVENT_BLOCK = 256  # bodies that are looked at before one that bounces is enough
FAR = 1 << 15  # bodies from which their columns do not fit into the second-level cache
AHEAD = 4  # looks between the request of a body's rows and their use

MOST_ROUNDS = 1000  # of pairs for the rest of a step

UNLISTED = -1  # in place of a number of pairs: those of the contacts are still to be listed


@part
def any_restitution(state):
    """Whether a collider of the scene bounces."""
    restitution, bounces = state.colliders.restitution, False
    for start in range(0, state.count if len(restitution) > 0 else 0, EVENT_BLOCK):
        for slot in range(state.slot_count if not bounces else 0):
            for i in range(start, min(start + EVENT_BLOCK, state.count)):
                bounces |= restitution[slot, i] != 0.0
    return bounces


@part
def may_sink(state, dt):
    """Whether some approach that is too slow to bounce may lead through the thinnest of all within the step."""
    bodies, fastest = state.bodies, max(0.0, state.restitution_threshold)
    thinnest = min(state.thinnest_static, state.thinnest_moving)
    for i in range(state.first, state.moving):
        fastest = max(fastest, 2.0 * bodies.force_speed_change[i])
    return fastest * dt > FAST * thinnest


def begin_impacts(state, dt):
    """No impact has happened yet; the first search is among what may have met."""
    impacts, bodies, pairs = state.impacts, state.bodies, state.pairs
    impacts.logged = impacts.capped = impacts.group_visits = 0
    impacts.rounds = impacts.halted = impacts.looked = impacts.together = 0
    impacts.active, impacts.end = False, dt
    if state.response_idle:
        return OK
    impacts.sweeps = sweeps = state.sweeping and state.moved
    for i in range(state.first, state.moving):
        bodies.impact_count[i], bodies.counted_impacts[i] = 0, 0
    for c in range(pairs.count):
        pairs.crossed[c] = False
    if pairs.found == 0 and not state.any_warm_started and not (sweeps and state.neighbours_known_until < dt):
        return OK
    impacts.active = sweeps or any_restitution(state)
    impacts.may_sink = sweeps and may_sink(state, dt)
    if sweeps:
        known = impacts.swept_version == state.version  # impacts change nothing of static bodies
        for i in range(state.first if known else 0, state.moving if known else state.count):
            bodies.trapped_impacts[i], bodies.last_impact[i] = 0, -1.0
        impacts.swept_version = state.version
    impacts.waiting, impacts.listed, impacts.pending = 0, UNLISTED, -1
    impacts.linked, impacts.touchdown_pair, impacts.touchdown_time = False, -1, 0.0
    impacts.until = state.neighbours_known_until if sweeps else math.inf
    return NEED_IMPACTS if impacts.active and state.links[FIRST_TOUCH] == 0 else OK


@part
def next_event(state):
    """Take the earliest event off the queue that still holds, of those that come before the search bounds are left.

    Returns its place, or -1.
    """
    impacts = state.impacts
    while impacts.waiting > 0:
        event = impacts.heap[0]
        if impacts.sweeps and impacts.event_time[event] > impacts.until:
            return -1
        heap_pop(impacts)
        if is_current(state, event):
            return event
    return -1


@part
def lands_before(state, event):
    """Whether a body of this event may have to land on something thin before: then that is searched, and the event
    waits once more."""
    impacts = state.impacts
    c, now = impacts.event_pair[event], impacts.event_time[event]
    looked, impacts.touchdown_time = impacts.touchdown_pair == c, 0.0
    if looked or not impacts.may_sink or impacts.event_kind[event] == CROSSING:
        return False
    list_landings(state, c, now)
    if impacts.listed == 0:
        return False
    requeue(impacts, event)
    impacts.touchdown_pair, impacts.touchdown_time = c, now
    return True


@part
def take_event(state, event, dt):
    """Carry an event out, with all impacts at the same time; a code if these need something first."""
    impacts = state.impacts
    if lands_before(state, event):
        return OK
    c, kind = impacts.event_pair[event], impacts.event_kind[event]
    impacts.now = impacts.event_time[event]
    if kind == CROSSING:
        note_crossing(state, event)
        return OK
    if kind == IMPACT and impacts.waiting > 0 and impacts.event_time[impacts.heap[0]] - impacts.now <= EQUAL * dt:
        if state.links[TAKE_TOGETHER] == 0:
            return NEED_TOGETHER
        taken = call_take_together(state.links[TAKE_TOGETHER], state, event, dt)
        if taken >= 0:
            return taken
    if kind == IMPACT:
        bounce_pair(state, event, dt)
    else:
        hand_over(state, event, dt)
    list_neighbours(state, c, dt)
    return OK


@part
def request_bodies(state, c):
    """The bodies of pair c will be looked at soon, and each column of each is far away in memory."""
    bodies, pairs = state.bodies, state.pairs
    for i in (pairs.a[c], pairs.b[c]):
        request(bodies.origin, i)
        request(bodies.path_velocity, i)
        request(bodies.offset, i)
        request(bodies.min_extent, i)
        request(bodies.force_speed_change, i)
        request(bodies.start_velocity, i)
        request(bodies.position, i)
        request(bodies.linear_velocity, i)
        request(bodies.inverse_mass, i)
        request(bodies.rank, i)
        request(bodies.impact_count, i)
        request(bodies.counted_impacts, i)


@part
def end_worklist(state, dt):
    """Too many rounds: what impacts have sent elsewhere stays where it is until the step ends; others may meet it."""
    impacts, bodies = state.impacts, state.bodies
    impacts.now = impacts.until
    for i in range(state.first, state.dynamic):
        if bodies.inverse_mass[i] > 0.0 and 0 < bodies.impact_count[i] < STOPPED:
            if impacts.halted == 0:
                impacts.halted_row = i
            impacts.halted += 1
            stop_body(state, i, impacts.now)
            list_pairs_of(state, i, -1, dt)
    impacts.until = math.inf


@part
def search_worklist(state, dt, far):
    """Queue the next impact of each of its pairs; then it is empty."""
    impacts, pairs, listed = state.impacts, state.pairs, state.impacts.listed
    worklist = impacts.worklist
    impacts.looked += listed
    for q in range(min(AHEAD, listed) if far else 0):
        request_bodies(state, worklist[q])
    for q in range(listed):
        c = worklist[q]
        if far and q + AHEAD < listed:
            request_bodies(state, worklist[q + AHEAD])
        if pairs.is_solid[c] or impacts.sweeps:
            queue_next_impact(state, c, impacts.listed_since[q], dt)
    impacts.listed = 0


@part
def events(state):
    """The queue, with all that may be added before it is looked at again."""
    return max(state.impacts.waiting + state.impacts.listed, most_listed(state.pairs.count))


ROOM_FOR_IMPACTS = (
    Rows("impacts", EVENTS, lambda s: events(s) if s.impacts.active else 0),
    Rows("impacts", BEARINGS, lambda s: s.count if s.impacts.active else 0),
    Rows("impacts", LOG, lambda s: s.impacts.logged + max(s.impacts.together, 1) if s.impacts.active else 0),
    Rows("impacts", MEMBERS, lambda s: s.impacts.together),
    Rows("impacts", ("next_member",), lambda s: 2 * s.impacts.together),  # one for each of two bodies
    Rows("impacts", BODIES_OF_MEMBERS, lambda s: s.count if s.impacts.together + s.solver.joints.active > 0 else 0),
)  # fmt: skip


def resolve_impacts(state, dt):
    """Bounce every pair that touches in its motion and approaches faster than the threshold."""
    impacts, far = state.impacts, state.count >= FAR
    if not impacts.active:
        return OK
    if impacts.listed == UNLISTED:
        impacts.listed = 0
        list_contacts(state)
    while True:
        if events(state) > len(impacts.heap) or impacts.logged == len(impacts.log_pair):
            return NEED_ROOM
        search_worklist(state, dt, far)
        event = impacts.pending if impacts.pending >= 0 else next_event(state)
        impacts.pending = -1
        if event >= 0:
            code = take_event(state, event, dt)
            if code != OK:  # back in the queue it would come after another of the same pair and time
                impacts.pending = event
                return code
        elif impacts.sweeps and impacts.until < dt:
            impacts.rounds += 1
            if impacts.rounds <= MOST_ROUNDS:
                return REFRESH_PAIRS
            end_worklist(state, dt)
        else:
            break
    if impacts.logged > 0:
        flag_fast_bodies(state, dt, True)
    state.impacts_counted += impacts.logged
    state.looks_counted += impacts.looked
    state.capped_counted += impacts.capped
    return OK
