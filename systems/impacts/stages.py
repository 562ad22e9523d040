"""The stage of impacts: in order of time, each followed by a new search among the pairs of both bodies."""

from __future__ import annotations

import math

from ...framework.compilation import part
from ...framework.jit.records.record_type import request
from ..ccd.refresh_pairs import NEW
from ..ccd.search_bounds import FAST, leaves_bounds_at
from ..codes import NEED_EVENTS, OK, REFRESH_PAIRS
from ..linking.parts import TAKE_SWEPT, WATCH_BOUNDS, call_take_swept, call_watch_bounds
from ..shapes.tolerances import smaller_extent
from .find import bounce_threshold, consider
from .heap import heap_pop
from .impulses import CROSS, LAND, SLIDE, STICK, STOPPED, bounce, can_stick, slide, stick, stop

# In place of a pair in ``last_pair``: what is searched next.
AHEAD = 4  # looks between the request of a body's rows and their use
HITS, FRESH, NONE, MEMBERS, LANDINGS = -1, -2, -3, -4, -5


@part
def any_restitution(state):
    """Whether a collider of the scene bounces."""
    restitution, bounces = state.colliders.restitution, False
    for slot in range(state.slot_count if len(restitution) > 0 else 0):
        for i in range(state.count):
            bounces |= restitution[slot, i] != 0.0
    return bounces


@part
def may_sink(state, dt):
    """Whether some approach that is too slow to bounce may lead through the thinnest of all within the step."""
    bodies, fastest, thinnest = state.bodies, max(0.0, state.restitution_threshold), state.thinnest_static
    for i in range(state.moving):
        extent = bodies.min_extent[i]
        thinnest = min(thinnest, extent if extent > 0.0 else math.inf)
        fastest = max(fastest, 2.0 * bodies.force_speed_change[i])
    return fastest * dt > FAST * thinnest


def begin_impacts(state, dt):
    """No impact has happened yet; the first search is among what may have met."""
    impacts, bodies, pairs = state.impacts, state.bodies, state.pairs
    impacts.logged = impacts.capped = impacts.crossings = 0
    impacts.active = False
    if state.response_idle:
        return OK
    impacts.sweeps = state.sweeping and state.moved
    for i in range(state.count):
        bodies.impact_count[i], bodies.counted_impacts[i] = 0, 0
    for c in range(pairs.count):
        pairs.crossed[c] = False
    if pairs.found == 0 and not state.any_support and not (impacts.sweeps and state.neighbours_known_until < dt):
        return OK
    impacts.active = impacts.sweeps or any_restitution(state)
    impacts.may_sink = impacts.sweeps and may_sink(state, dt)
    for i in range(state.count if impacts.sweeps else 0):
        bodies.caught[i] = 0
        bodies.last_impact[i], bodies.cluster_inverse_mass[i] = -1.0, bodies.inverse_mass[i]
        bodies.cluster_root[i], bodies.cluster_next[i], bodies.cluster_tail[i] = i, -1, i
    begin_search(state, HITS, 0.0)
    return OK


@part
def begin_search(state, last_pair, now):
    """The queue is empty, and the pairs may be others than before."""
    impacts = state.impacts
    impacts.waiting, impacts.last_pair, impacts.linked = 0, last_pair, False
    impacts.sunk_pair, impacts.sunk_by = -1, 0.0
    impacts.now, impacts.until = now, state.neighbours_known_until if impacts.sweeps else math.inf


@part
def link_pairs(state):
    """Chain the pairs of each body, ascending: heads[i] is the first of row i, then follows links[it], till -1.

    An entry is twice the pair for its first body, one more for its second.
    """
    impacts, pairs = state.impacts, state.pairs
    heads, links = impacts.heads, impacts.links
    for i in range(state.count):
        heads[i] = -1
    for c in range(pairs.count - 1, -1, -1):
        for side in range(2):
            i = pairs.a[c] if side == 0 else pairs.b[c]
            links[2 * c + side] = heads[i]
            heads[i] = 2 * c + side
    impacts.linked = True


@part
def look_at_hits(state):
    """The pairs of supported bodies, and the contacts of all others; returns how many."""
    pairs, looks, supported, wanted = state.pairs, state.impacts.looks, state.bodies.supported, 0
    for c in range(pairs.count if state.any_support else 0):
        if supported[pairs.a[c]] or supported[pairs.b[c]]:
            looks[wanted] = c
            wanted += 1
    for h in range(pairs.found):
        c = pairs.hits[h]
        if not (supported[pairs.a[c]] or supported[pairs.b[c]]):
            looks[wanted] = c
            wanted += 1
    return wanted


@part
def look_at_fresh(state):
    """The pairs that have become candidates within the step; returns how many."""
    pairs, looks, wanted = state.pairs, state.impacts.looks, 0
    for c in range(pairs.count):
        looks[wanted] = c
        wanted += pairs.place[c] == NEW
    return wanted


@part
def look_at_members(state):
    """The pairs of all bodies of the cluster that has just grown; returns how many."""
    impacts, i, wanted = state.impacts, state.impacts.cluster, 0
    while i >= 0:
        entry = impacts.heads[i]
        while entry >= 0:
            impacts.looks[wanted] = entry // 2
            wanted += 1
            entry = impacts.links[entry]
        i = state.bodies.cluster_next[i]
    return wanted


@part
def look_at_partners(state, c):
    """The pairs of the two bodies of pair c that can be moved; returns how many."""
    impacts, pairs, inverse_mass, wanted = state.impacts, state.pairs, state.bodies.inverse_mass, 0
    for side in range(2):
        i = pairs.a[c] if side == 0 else pairs.b[c]
        entry = impacts.heads[i] if inverse_mass[i] > 0.0 else -1
        while entry >= 0:
            if side == 0 or entry // 2 != c or inverse_mass[pairs.a[c]] == 0.0:  # once is enough
                impacts.looks[wanted] = entry // 2
                wanted += 1
            entry = impacts.links[entry]
    return wanted


@part
def may_have_sunk(state, i, k, now):
    """Whether body i may by now have sunk through k, which cannot be moved, as slowly as a contact at rest lets it."""
    if state.bodies.inverse_mass[k] > 0.0:
        return False
    return bounce_threshold(state, i, k) * now > FAST * smaller_extent(state.bodies, i, k)


@part
def look_at_landings(state, c, now):
    """The pairs in which a body of pair c may have sunk before its impact, and that pair; returns how many."""
    impacts, pairs, bodies, wanted = state.impacts, state.pairs, state.bodies, 1
    impacts.looks[0] = c
    for side in range(2):
        i = pairs.a[c] if side == 0 else pairs.b[c]
        entry = impacts.heads[i] if bodies.inverse_mass[i] > 0.0 and bodies.impact_count[i] == 0 else -1
        while entry >= 0:
            p = entry // 2
            if p != c and pairs.is_solid[p] and may_have_sunk(state, i, pairs.a[p] + pairs.b[p] - i, now):
                impacts.looks[wanted] = p
                wanted += 1
            entry = impacts.links[entry]
    return wanted


@part
def choose_looks(state):
    """Which pairs are searched now: at first what may have met, later the pairs of the two bodies of an impact."""
    impacts = state.impacts
    c = impacts.last_pair
    if c == HITS:
        return look_at_hits(state)
    if c == FRESH:
        return look_at_fresh(state)
    if c == NONE:
        return 0
    if not impacts.linked:
        link_pairs(state)
    if c == LANDINGS:
        return look_at_landings(state, impacts.sunk_pair, impacts.sunk_by)
    return look_at_members(state) if c == MEMBERS else look_at_partners(state, c)


@part
def next_event(state):
    """Take the earliest event off the queue that still holds, of those that come before the search bounds are left.

    Returns its place, or -1. It holds if neither body has had an impact since it was made.
    """
    impacts, pairs, count = state.impacts, state.pairs, state.bodies.impact_count
    while impacts.waiting > 0:
        event = impacts.heap[0]
        if impacts.sweeps and impacts.event_time[event] > impacts.until:
            return -1
        c = impacts.event_pair[event]
        holds = impacts.event_count_a[event] == count[pairs.a[c]] and impacts.event_count_b[event] == count[pairs.b[c]]
        heap_pop(impacts)
        if holds:
            return event
    return -1


def watch_bounds(state, i, dt):
    """The body goes on from here: note when it may leave its search bounds."""
    impacts = state.impacts
    state.bodies.last_impact[i] = impacts.now
    impacts.until = min(impacts.until, leaves_bounds_at(state, i, impacts.now, dt))
    return 0


@part
def watch_again(state, i, dt):
    """The same from another function."""
    return call_watch_bounds(state.links[WATCH_BOUNDS], state, i, dt)


def take_swept_event(state, event, dt):
    """Carry out what happens to swept bodies alone: a crossing, sticking together, standing still."""
    impacts, pairs, bodies = state.impacts, state.pairs, state.bodies
    c, kind = impacts.event_pair[event], impacts.event_kind[event]
    if kind == CROSS:
        pairs.crossed[c] = True
        impacts.crossings += 1
        impacts.last_pair = NONE
    elif kind == STICK and can_stick(state, event):
        impacts.cluster = stick(state, event, dt)
        impacts.last_pair = MEMBERS
        i = impacts.cluster
        while i >= 0:
            watch_again(state, i, dt)
            i = bodies.cluster_next[i]
    elif kind in (SLIDE, LAND):
        impacts.capped += 1 if kind == SLIDE else 0
        a, b = pairs.a[c], pairs.b[c]
        if bodies.inverse_mass[a] * bodies.inverse_mass[b] == 0.0:
            slide(state, a if bodies.inverse_mass[a] > 0.0 else b, impacts.event_normal[event], impacts.now, dt)
    else:
        impacts.capped += 1
        pairs.depth[c], pairs.crossed[c] = 0.0, True
        for side in range(2):
            i = pairs.a[c] if side == 0 else pairs.b[c]
            if bodies.inverse_mass[i] > 0.0 and bodies.impact_count[i] < STOPPED:
                stop(state, i, impacts.now)
                bodies.cluster_inverse_mass[bodies.cluster_root[i]] = 0.0  # what sticks to it later does not push it on
    return 0


@part
def lands_first(state, event):
    """Whether a body of this impact may have to land on something thin before: then that is searched, and the impact
    once more."""
    impacts = state.impacts
    c, kind, now = impacts.event_pair[event], impacts.event_kind[event], impacts.event_time[event]
    looked, impacts.sunk_by = impacts.sunk_pair == c, 0.0
    if looked or not impacts.may_sink or kind in (LAND, CROSS):
        return False
    if not impacts.linked:
        link_pairs(state)
    if look_at_landings(state, c, now) == 1:
        return False
    impacts.sunk_pair, impacts.sunk_by, impacts.last_pair, impacts.now = c, now, LANDINGS, 0.0
    return True


@part
def take_event(state, event, dt):
    """Carry an event out."""
    impacts, pairs, bodies = state.impacts, state.pairs, state.bodies
    if lands_first(state, event):
        return
    c, kind = impacts.event_pair[event], impacts.event_kind[event]
    impacts.last_pair, impacts.now = c, impacts.event_time[event]
    if kind > LAND:
        call_take_swept(state.links[TAKE_SWEPT], state, event, dt)
        return
    bounce(state, event, dt)
    if kind == LAND:
        call_take_swept(state.links[TAKE_SWEPT], state, event, dt)
    for side in range(2 if impacts.sweeps else 0):
        i = pairs.a[c] if side == 0 else pairs.b[c]
        if bodies.inverse_mass[i] > 0.0 and bodies.impact_count[i] < STOPPED:
            watch_again(state, i, dt)


@part
def request_bodies(state, c):
    """The bodies of pair c will be looked at soon: in large worlds each column of each is far away in memory."""
    bodies, pairs = state.bodies, state.pairs
    for side in range(2):
        i = pairs.a[c] if side == 0 else pairs.b[c]
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


def resolve_impacts(state, dt):
    """Bounce every pair that touches in its motion and approaches faster than the threshold."""
    impacts, pairs = state.impacts, state.pairs
    if not impacts.active:
        return OK
    while True:
        if len(impacts.looks) <= 2 * pairs.count or len(impacts.heads) < state.count:
            state.needed = 2 * pairs.count
            return NEED_EVENTS
        wanted = choose_looks(state)
        if impacts.waiting + wanted > len(impacts.heap) or impacts.logged == len(impacts.log_pair):
            state.needed = impacts.waiting + wanted
            return NEED_EVENTS
        state.looks_counted += wanted
        for q in range(wanted):
            c = impacts.looks[q]
            if q + AHEAD < wanted:
                request_bodies(state, impacts.looks[q + AHEAD])
            if pairs.is_solid[c] or impacts.sweeps:
                consider(state, c, dt)
        event = next_event(state)
        if event >= 0:
            take_event(state, event, dt)
        elif impacts.sweeps and impacts.until < dt:
            return REFRESH_PAIRS
        else:
            break
    state.impacts_counted += impacts.logged
    state.capped_counted += impacts.capped
    return OK
