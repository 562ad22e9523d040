"""Which pairs are searched for their next impact: at first what may have met, later the pairs of the bodies that an
impact has sent elsewhere.
"""

from __future__ import annotations

from ...framework.compilation import part
from ..ccd.refresh_pairs import NEW
from ..ccd.search_bounds import FAST
from ..shapes.tolerances import smaller_extent
from .find import bounce_threshold

# In place of a pair in ``last_pair``: what is searched next.
HITS, FRESH, NONE, MEMBERS, LANDINGS = -1, -2, -3, -4, -5


@part
def link_pairs(state):
    """Chain the pairs of each body that moves, ascending: heads[i] is the first of row i, then follows links[it], till
    -1. An entry is twice the pair for its first body, one more for its second.
    """
    impacts, pairs = state.impacts, state.pairs
    heads, links = impacts.heads, impacts.links
    for i in range(state.first, state.moving):
        heads[i] = -1
    for c in range(pairs.count - 1, -1, -1):
        for side in range(2):
            i = pairs.a[c] if side == 0 else pairs.b[c]
            if i < state.moving:
                links[2 * c + side] = heads[i]
                heads[i] = 2 * c + side
    impacts.linked = True


@part
def look_at_hits(state):
    """The pairs of supported bodies, and the contacts of all others; returns how many."""
    pairs, looks, warm_started, wanted = state.pairs, state.impacts.looks, state.bodies.warm_started, 0
    for c in range(pairs.count if state.any_warm_started else 0):
        if warm_started[pairs.a[c]] or warm_started[pairs.b[c]]:
            looks[wanted] = c
            wanted += 1
    for h in range(pairs.found):
        c = pairs.hits[h]
        if not (warm_started[pairs.a[c]] or warm_started[pairs.b[c]]):
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
    """The pairs of the two bodies of pair c that can be moved; returns how many. After several impacts at once the
    pairs of each body are searched once."""
    impacts, pairs, inverse_mass, wanted = state.impacts, state.pairs, state.bodies.inverse_mass, 0
    several = impacts.searching < impacts.search_end
    for side in range(2):
        i = pairs.a[c] if side == 0 else pairs.b[c]
        wants = inverse_mass[i] > 0.0 and not (several and impacts.searched_with[i] != impacts.searching)
        entry = impacts.heads[i] if wants else -1
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
def select_pairs(state):
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
        return look_at_landings(state, impacts.touchdown_pair, impacts.touchdown_time)
    return look_at_members(state) if c == MEMBERS else look_at_partners(state, c)
