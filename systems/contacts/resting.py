"""Contacts at rest: which pairs they are, their geometry at the start of the step, and what touches in the end."""

from __future__ import annotations

import math

from ...framework.compilation import part
from ...framework.jit.records.record_type import zero_of
from ...framework.vectors import add, add_scaled, dot, item, length, replace, sub
from ..ccd.search_bounds import FAST, is_swept
from ..codes import OK
from ..impacts.impulses import STOPPED, is_caught
from ..shapes.dispatch import both_convex, mix, mix_friction
from ..shapes.tolerances import contact_margin, slop_for, slop_of, smaller_extent
from .approach import between, between_at_start, leg_start, meet, meets_at_corner, touch_on_way
from .solving.softness import SAG

ENTRY_ITERATIONS = 24
OWN_SAG = 0.0003  # of the extent: a contact that would sag more under one body alone is rigid;
CONCAVE_SAG = 0.001  # one of concave shapes, which stands for all sides where they touch, by turns
APART = 1e-11  # of the extent: a smaller gap is none, not even as seen past a round corner
BESIDE, EVEN = 1e-6, 1e-9  # of the extent: so near the normal is another one, by this much of its cosine
LOOK, RESTS, IS_APART = range(3)
STAYS, PARTS_SLOWLY, PARTS = range(3)  # what an elastic pair does at the end of the step
SAME_PLACE = 1e-9  # of the extent: a gap of rounding errors is none


@part
def far_touch(state, dt, a, b, end):
    """As :func:`touch_on_way`, on the last stretch of the way of a pair, to ``end``, that goes so far on it that its
    end may say nothing; the gap is that at the start of the step.

    In a discrete world only as far as forces lead: who is faster than that passes through what is thin.
    """
    bodies, edge, nothing = state.bodies, FAST * smaller_extent(state.bodies, a, b), zero_of(state)
    d, margin = leg_start(state, a, b), contact_margin(state, dt, a, b)
    travel = sub(end, d)
    way = length(travel)
    if not (way > edge and (is_swept(state, a, b, way) or way <= margin)):
        return False, 0.0, nothing, nothing
    found, gap, normal, point = touch_on_way(state, a, b, d, travel, min(edge, margin))
    return found, gap + dot(sub(between_at_start(bodies, a, b), d), normal), normal, point


@part
def without_support(state, dt, a, b):
    """From the centre of a's shape to that of b's where free flight alone would lead: the resting prediction may push
    too much."""
    bodies, travelled = state.bodies, state.force_travels * dt
    free = between(bodies, a, b)
    if bodies.supported[a]:
        free = add_scaled(free, bodies.support_change[a], travelled)
    if bodies.supported[b]:
        free = add_scaled(free, bodies.support_change[b], -travelled)
    return free


@part
def deepest(state, dt, a, b, end):
    """(depth at ``end``, normal, whether it is) by the plane where the pair first touches on a long way there; else by
    its end."""
    far, gap, normal, _ = far_touch(state, dt, a, b, end)
    if far:
        return -gap - dot(sub(end, between_at_start(state.bodies, a, b)), normal), normal, True
    _, depth, normal, _ = meet(state, a, b, end)
    return depth, normal, False


@part
def still_bounces(state, dt, c, depth, normal):
    """Whether a pair that bounces is no contact at rest: it meets in the next step only, or is on its way out.

    Notes in pairs.parting how it parts.
    """
    pairs, bodies, colliders = state.pairs, state.bodies, state.colliders
    a, b, slot = pairs.a[c], pairs.b[c], bodies.collider_slot
    restitution, velocity = colliders.restitution, bodies.linear_velocity
    e = mix(state, state.restitution_rule, restitution[slot[a], a], restitution[slot[b], b])
    if not e > 0.0:
        return False
    if e == 1.0 and state.impacts.sweeps and is_caught(state, a, b):
        return True
    slop, fixed = slop_of(state, a, b), state.restitution_threshold
    threshold = fixed if fixed >= 0.0 else (contact_margin(state, dt, a, b) - slop) / dt
    speed = dot(sub(velocity[b], velocity[a]), normal)
    touches = depth > (SAME_PLACE * smaller_extent(bodies, a, b) if pairs.impulse[c] == 0.0 else 0.0)
    if not touches and speed < -threshold:
        return True  # the next step's impact
    if speed > 0.0:
        pairs.parting[c] = PARTS if speed > threshold and speed * dt > slop else PARTS_SLOWLY
    if pairs.impulse[c] > 0.0 and speed > threshold:
        _, before, _, _ = meet(state, a, b, between_at_start(bodies, a, b))
        return before < 0.0  # on its way out
    return False


@part
def known_by_flight(state, dt, c, d, margin):
    """RESTS or IS_APART if that is sure of a pair that has had no impact, by what the narrow phase has found at the end
    of the free flight; else LOOK.

    d: from the centre of a's shape to that of b's. The resting prediction cannot change the depth by more than it
    moves the two to each other. Pairs that go far are to be looked at, and those that may bounce unless they are apart.
    """
    pairs, bodies, colliders = state.pairs, state.bodies, state.colliders
    a, b, slot = pairs.a[c], pairs.b[c], bodies.collider_slot
    least, edge = pairs.depth[c] + margin, FAST * smaller_extent(bodies, a, b)
    moved, travel = zero_of(state), sub(d, between_at_start(bodies, a, b))
    if bodies.supported[a]:
        moved = add_scaled(moved, bodies.support_change[a], state.force_travels * dt)
    if bodies.supported[b]:
        moved = add_scaled(moved, bodies.support_change[b], -state.force_travels * dt)
    room, flown = least * least, add(travel, moved)
    if not (dot(moved, moved) <= room and dot(travel, travel) <= edge * edge):
        return LOOK
    if least < 0.0:  # a depth of -inf only says that they do not touch there
        return IS_APART if dot(moved, moved) < room < math.inf and dot(flown, flown) <= edge * edge else LOOK
    restitution = colliders.restitution
    if not pairs.near_contact[c]:
        return LOOK
    if mix(state, state.restitution_rule, restitution[slot[a], a], restitution[slot[b], b]) > 0.0:
        return LOOK
    pairs.parting[c] = STAYS
    return RESTS


@part
def is_resting(state, dt, c):
    """Whether a solid pair's gap is below the margin after the impacts and it is not bouncing.

    pairs.depth is that of the free flight, and still holds for bodies neither hit nor supported.
    """
    pairs, bodies, count = state.pairs, state.bodies, state.bodies.impact_count
    a, b = pairs.a[c], pairs.b[c]
    if count[a] >= STOPPED or count[b] >= STOPPED:
        pairs.near_contact[c] = True  # they may touch where they are now
        return False
    hit, carried = count[a] > 0 or count[b] > 0, bodies.supported[a] or bodies.supported[b]
    if not pairs.near_contact[c] and not hit and not carried:
        return False
    margin = contact_margin(state, dt, a, b)
    near = pairs.depth[c] >= -margin and not hit
    if not near and not hit and not carried:
        return False
    d = between(bodies, a, b)
    known = LOOK if hit else known_by_flight(state, dt, c, d, margin)
    if known != LOOK:
        return known == RESTS and not meets_at_corner(state, a, b, d, slop_of(state, a, b))
    pairs.looked += 1
    depth, normal, far = deepest(state, dt, a, b, d)
    if depth < -margin:
        if hit or not carried:
            return False
        depth, normal, far = deepest(state, dt, a, b, without_support(state, dt, a, b))
        if depth < -margin:
            return False
    if depth >= 0.0:
        pairs.near_contact[c] = True
    pairs.parting[c] = STAYS
    if still_bounces(state, dt, c, depth, normal):
        return False
    return far or not meets_at_corner(state, a, b, d, slop_of(state, a, b))


def find_resting(state, dt):
    """The pairs that are contacts at rest, in canonical order."""
    pairs, count = state.pairs, 0
    pairs.looked = 0
    if not state.response_idle:
        for c in range(pairs.count):
            if pairs.is_solid[c] and is_resting(state, dt, c):
                pairs.resting[count] = c
                count += 1
    pairs.resting_count = count
    state.solver.contacts = count
    state.resting_counted += count
    return OK


@part
def entry(state, a, b, d, travel, at_end, slop):
    """Gap at the start, normal and point where the pair first touches on its way from d to d + travel.

    That is the end if it touches nowhere or if ``at_end``. A touch of corners is none.
    """
    low, high, t = 0.0, 1.0, 1.0
    normal, point, depth, chosen = zero_of(state), zero_of(state), 0.0, 0.0
    for look in range(ENTRY_ITERATIONS):
        at = add_scaled(d, travel, t)
        _, depth_now, n, p = meet(state, a, b, at)
        if meets_at_corner(state, a, b, at, slop):
            depth_now = min(depth_now, -slop)  # so that the search goes on
        if look == 0 or depth_now >= 0.0:  # the end, or a time in touch
            normal, point, depth, chosen = n, p, depth_now, t
            if at_end or depth_now < 0.0:
                break
            high = t
        else:
            low = t
        if abs(depth_now) <= slop and look > 0:
            break
        t = chosen + depth / dot(travel, normal)  # where its plane says, if that is between the two
        if not low < t < high or look % 4 == 3:
            t = 0.5 * (low + high)
    return -depth - chosen * dot(travel, normal), normal, point


@part
def normal_varies(state, a, b, d):
    """Whether the normal is another one a little beside, so that it stands for several faces of a concave shape."""
    _, _, normal, _ = meet(state, a, b, d)
    near, varies = BESIDE * smaller_extent(state.bodies, a, b), False
    for k in range(len(d)):
        _, _, beside, _ = meet(state, a, b, replace(d, k, item(d, k) + near))
        varies |= dot(beside, normal) < 1.0 - EVEN
    return varies


def linearise(state, dt):
    """Of each contact at rest the normal and the gap where the step starts, and what the solver needs of its bodies."""
    pairs, bodies, solver, inverse_mass = state.pairs, state.bodies, state.solver, state.bodies.inverse_mass
    friction, slot_of_body, has_friction = state.colliders.friction, bodies.collider_slot, False
    solver.any_rigid = False
    for r in range(solver.contacts):  # in the order of the pairs, for the caches
        c, k = pairs.resting[r], solver.slot[r]
        a, b, parting = pairs.a[c], pairs.b[c], pairs.parting[c]
        extent, d = smaller_extent(bodies, a, b), between_at_start(bodies, a, b)
        slop = slop_for(state, extent)
        _, depth, normal, point = meet(state, a, b, d)
        gap, apart = -depth, depth < -APART * extent
        if apart or parting != STAYS or meets_at_corner(state, a, b, d, slop):
            far, gap, normal, point = far_touch(state, dt, a, b, between(bodies, a, b))
            if not far or parting != STAYS:
                travel = sub(between(bodies, a, b), d)
                gap, normal, point = entry(state, a, b, d, travel, parting != STAYS, slop)
        if pairs.impulse[c] > 0.0 and dot(normal, pairs.normal[c]) <= 0.0:
            normal = pairs.normal[c]  # coincident centres have parted: not back again
        solver.normal[k], pairs.normal[c] = normal, normal
        pairs.point[c] = add(point, add(bodies.previous_position[a], bodies.offset[a]))
        solver.gap[k], solver.apart[k] = gap, apart
        solver.mass[k] = 1.0 / (inverse_mass[a] + inverse_mass[b])
        # After an impact at time t the body seems to come from dv t behind: no overlap to be pushed out.
        solver.parting[k] = parting == PARTS or (pairs.impulse[c] > 0.0 and gap > 0.0)
        solver.extent[k] = extent
        weight = SAG * max(bodies.force_speed_change[a], bodies.force_speed_change[b]) * dt
        most, solver.varies[k] = OWN_SAG, False
        if not both_convex(state, bodies.shape[a], bodies.shape[b]):
            most, solver.varies[k] = CONCAVE_SAG, normal_varies(state, a, b, d)
        solver.rigid[k] = weight > most * state.substeps * state.substeps * extent
        solver.any_rigid |= solver.rigid[k]
        mu = mix_friction(state, state.friction_rule, friction[slot_of_body[a], a], friction[slot_of_body[b], b])
        solver.friction[k] = mu
        has_friction |= mu != 0.0
    solver.has_friction = has_friction
    return OK


def find_touching(state, dt):
    """Pairs that touch now that all is done, or pushed each other in the step or crossed.

    Those that may are near contact, rest or had an impact, or are not solid.
    """
    pairs, bodies, impacts, count = state.pairs, state.bodies, state.impacts, 0
    if state.response_idle:
        pairs.touching_count = 0
        return OK
    for r in range(pairs.resting_count):
        pairs.near_contact[pairs.resting[r]] = True
    for r in range(impacts.logged):
        pairs.near_contact[impacts.log_pair[r]] = True
    for c in range(pairs.count):
        solid, crossed = pairs.is_solid[c], pairs.crossed[c]
        if solid and not pairs.near_contact[c] and not crossed:
            continue
        a, b = pairs.a[c], pairs.b[c]
        hit, depth, normal, point = meet(state, a, b, between(bodies, a, b))
        pushed = pairs.impulse[c] > 0.0
        if solid and depth >= -SAME_PLACE * smaller_extent(bodies, a, b):
            hit = True
        if not hit and not pushed and not crossed:
            continue
        pairs.depth[c] = max(0.0, depth)
        if not pushed:
            pairs.normal[c] = normal
        pairs.point[c] = add(point, add(bodies.position[a], bodies.offset[a]))
        pairs.touching[count] = c
        count += 1
    pairs.touching_count = count
    state.contacts_counted += count
    return OK
