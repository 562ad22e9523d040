"""One-way colliders: solid for what comes from the front, as if they were not there for all else.

A contact acts if its normal, away from the one-way collider, leans by at most UPRIGHT from the direction of its
``one_way``, which turns with the body; and if the two did not overlap when the step began, or touched in the step
before. So what has come from behind or from the side passes until it has left, and what stands on it stays supported,
however deep a load presses it. Whether that is so is decided once in a step, by the way that free flight leads. What a
blow, a push or a joint has sent into it meanwhile is looked at in the next step, from where it would be without.
"""

from __future__ import annotations

import math

from ...framework.compilation import inlined, part
from ...framework.jit.records.record_type import zero_of
from ...framework.vectors import add_scaled, dot, length, negative, scale, sub
from ..codes import OK
from ..joints.records import NOT_JOINED
from ..parts.rows import next_row, owner_of
from ..shapes.dispatch import both_convex
from ..shapes.surfaces import along_world
from ..shapes.tolerances import SAME_PLACE, way_of_turning
from .manifolds import centre_offset, centre_offset_at_start, evaluate_pair, is_of_pair, skip_before

UPRIGHT = 0.5  # cosine of the most that a normal leans from the direction: what leans farther is met from the side
SLACK = 0.02  # of its extent: what is no deeper in at the start of the step comes from the front, as off a floor beside
ADVANCES = 20  # evaluations on the way to a touch; boxes take 2, round shapes 5


@inlined
def is_one_way(state, i):
    """Whether row i is solid from one side only."""
    ways, slot = state.colliders.one_way, state.bodies.collider_slot[i]
    return len(ways) > 0 and dot(ways[slot, i], ways[slot, i]) > 0.0


@part
def front_of(state, i):
    """The direction of row i's ``one_way`` in the world, of any length; 0 if it is solid from all sides."""
    if not is_one_way(state, i):
        return zero_of(state)
    return along_world(state, i, state.colliders.one_way[state.bodies.collider_slot[i], i])


@inlined
def is_from_front(front, normal):
    """Whether a contact with that normal, away from a one-way collider, is with its front."""
    return dot(front, normal) >= UPRIGHT * length(front)


@part
def normal_ahead(state, a, b, start, end):
    """(depth where the step starts, normal where the two first touch on the straight way, else where they are nearest
    to it), from a to b; of concave shapes the normal at the end, if they touch there, and how deep they were behind
    that plane where the step starts."""
    hit, first, normal, _ = evaluate_pair(state, a, b, start)
    travel, depth, share = sub(end, start), first, 0.0
    shape, near = state.bodies.shape, SAME_PLACE * (length(start) + length(end))
    if not both_convex(state, shape[a], shape[b]):
        hit, there, across, _ = evaluate_pair(state, a, b, end)
        return (there + dot(travel, across), across) if hit else (first, normal)
    if first >= 0.0:
        return first, normal
    for _ in range(ADVANCES):
        rate = dot(travel, normal)
        if not depth < -near or not rate < 0.0:
            break
        share += depth / rate
        if not share < 1.0:
            break
        _, depth, normal, _ = evaluate_pair(state, a, b, add_scaled(start, travel, share))
    return first, normal


@part
def one_way_holds(state, a, b, start, end, pressed):
    """Whether a and b push each other, as far as one-way colliders go; start, end: from the centre of a's shape to that
    of b's; pressed: depth of their contact of the step before, negative if there was none. Of a concave shape it may
    have been elsewhere: there what it bore was no deeper."""
    bodies, extent = state.bodies, math.inf
    if is_one_way(state, a):
        extent = bodies.min_extent[b]
    if is_one_way(state, b):
        extent = min(extent, bodies.min_extent[a])
    if extent == math.inf:
        return True
    known = both_convex(state, bodies.shape[a], bodies.shape[b])
    depth, normal = normal_ahead(state, a, b, start, end)
    if state.spinning:  # shapes stand as they are turned at the end
        depth -= way_of_turning(bodies, a, bodies.turn[a]) + way_of_turning(bodies, b, bodies.turn[b])
    if not (known and pressed >= 0.0) and depth > SLACK * extent + (0.0 if known else max(pressed, 0.0)):
        return False
    return is_from_front(front_of(state, a), normal) and is_from_front(front_of(state, b), negative(normal))


@part
def speed_given(state, dt, i):
    """What contacts and joints have added to the velocity of body i in the step before: no flight has foreseen it."""
    bodies, contacts, k, given = state.bodies, state.contacts, owner_of(state, i), zero_of(state)
    now, w = contacts.now, bodies.inverse_mass[k]
    if state.solver.joints.active > 0 and len(bodies.hold) > 0 and bodies.joined[k] != NOT_JOINED:
        given = scale(bodies.hold[k], dt)
    while k >= 0:
        for r in range(contacts.counts[now]):
            push = w * contacts.impulse[now, r]
            if contacts.entity_b[now, r] == bodies.entity[k]:
                given = add_scaled(given, contacts.normal[now, r], push)
            elif contacts.entity_a[now, r] == bodies.entity[k]:
                given = add_scaled(given, contacts.normal[now, r], -push)
        k = next_row(state, k)
    return given


@part
def was_sent_into_front(state, dt, a, b, start, end):
    """Whether two that overlap where the step starts, of which the step before knows no contact, come from the front of
    what is one-way: by the way from where they would be without what that step has given them."""
    if not evaluate_pair(state, a, b, start)[0]:
        return False
    given = sub(speed_given(state, dt, b), speed_given(state, dt, a))
    return one_way_holds(state, a, b, add_scaled(start, given, -dt), end, -1.0)


def release_one_way(state, dt):
    """Pairs with a one-way collider that do not meet its front count as disabled. Pairs and the contacts of the step
    before are in canonical order."""
    pairs, contacts, entity, now, k = state.pairs, state.contacts, state.bodies.entity, state.contacts.now, 0
    for c in range(pairs.count):
        a, b = pairs.a[c], pairs.b[c]
        if not pairs.is_solid[c] or not (is_one_way(state, a) or is_one_way(state, b)):
            continue
        first, second = entity[a], entity[b]
        k = skip_before(contacts, k, first, second)
        touched = state.moved and is_of_pair(contacts, k, first, second)
        pressed = contacts.depth[now, k] if touched and contacts.enabled[now, k] else -1.0
        start, end = centre_offset_at_start(state.bodies, a, b), centre_offset(state.bodies, a, b)
        holds = one_way_holds(state, a, b, start if state.moved else end, end, pressed)
        if not (holds or touched) and state.moved:
            holds = was_sent_into_front(state, dt, a, b, start, end)
        if not holds:
            pairs.is_solid[c], pairs.disabled[c] = False, True
            pairs.disabled_count += 1
    return OK
