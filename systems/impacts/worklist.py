"""The worklist: pairs to search for their next impact, each with the time from which on.

It begins with what may have met; each event adds the pairs of the bodies that it has sent elsewhere.
"""

from __future__ import annotations

from ...framework.compilation import inlined, part
from ..ccd.search_bounds import FAST, leaves_bounds_at
from ..narrow_phase.manifolds import forget_manifold
from ..parts.rows import next_row, owner_of
from ..shapes.tolerances import smaller_extent
from .find import bounce_threshold
from .impulses import STOPPED


@inlined
def most_listed(pairs):
    """Of so many pairs each is listed at most twice, and one once more, before it is searched."""
    return 2 * pairs + 1


@inlined
def list_pair(impacts, c, since):
    """Search pair c for an impact from that time on."""
    impacts.worklist[impacts.listed], impacts.listed_since[impacts.listed] = c, since
    impacts.listed += 1


@part
def list_contacts(state):
    """The pairs of supported bodies, and the contacts of all others."""
    impacts, pairs, warm_started = state.impacts, state.pairs, state.bodies.warm_started
    for c in range(pairs.count if state.any_warm_started else 0):
        if warm_started[pairs.a[c]] or warm_started[pairs.b[c]]:
            list_pair(impacts, c, 0.0)
    for h in range(pairs.found):
        c = pairs.hits[h]
        if not (warm_started[pairs.a[c]] or warm_started[pairs.b[c]]):
            list_pair(impacts, c, 0.0)


@part
def link_pairs(state):
    """Chain the pairs of each body that moves, ascending: heads[i] is the first of row i, then follows links[it], till
    -1. An entry is twice the pair for its first body, one more for its second. Contacts bear none yet.
    """
    impacts, pairs = state.impacts, state.pairs
    heads, links = impacts.heads, impacts.links
    for i in range(state.first, state.moving):
        heads[i], impacts.borne[i] = -1, False
    for c in range(pairs.count - 1, -1, -1):
        for side in range(2):
            i = pairs.a[c] if side == 0 else pairs.b[c]
            if i < state.moving:
                first = owner_of(state, i)
                links[2 * c + side] = heads[first]
                heads[first] = 2 * c + side
    impacts.linked = True


@part
def list_pairs_of(state, i, but, dt):
    """Body i goes on from an impact: list its pairs but one from now on, and note when it may leave its bounds. What is
    known of them was with the shape as it was turned before."""
    impacts, bodies, now = state.impacts, state.bodies, state.impacts.now
    i = owner_of(state, i)
    k = i if impacts.sweeps and bodies.impact_count[i] < STOPPED else -1
    while k >= 0:
        bodies.last_impact[k] = now
        impacts.until = min(impacts.until, leaves_bounds_at(state, k, now, dt))
        k = next_row(state, k)
    if not impacts.linked:
        link_pairs(state)
    entry = impacts.heads[i]
    while entry >= 0:
        c = entry // 2
        if state.spinning:
            forget_manifold(state.pairs, c)
        if c != but:
            list_pair(impacts, c, now)
        entry = impacts.links[entry]


@part
def list_neighbours(state, c, dt):
    """The pairs of the two bodies of pair c that can be moved."""
    listed = -1
    for i in (state.pairs.a[c], state.pairs.b[c]):
        if state.bodies.inverse_mass[i] > 0.0:
            list_pairs_of(state, i, listed, dt)
            listed = c


@part
def list_landings(state, c, now):
    """The pairs in which a body of pair c may have sunk through what cannot be moved before its impact, as slowly as a
    contact at rest lets it, from the start of the step on."""
    impacts, pairs, bodies = state.impacts, state.pairs, state.bodies
    if not impacts.linked:
        link_pairs(state)
    for i in (pairs.a[c], pairs.b[c]):
        free = bodies.inverse_mass[i] > 0.0 and bodies.impact_count[i] == 0
        entry = impacts.heads[owner_of(state, i)] if free else -1
        while entry >= 0:
            p = entry // 2
            one, other = pairs.a[p], pairs.b[p]
            if entry % 2 == 1:
                one, other = other, one
            fixed, room = bodies.inverse_mass[other] == 0.0, FAST * smaller_extent(bodies, one, other)
            if p != c and pairs.is_solid[p] and fixed and bounce_threshold(state, one, other) * now > room:
                list_pair(impacts, p, 0.0)
            entry = impacts.links[entry]
