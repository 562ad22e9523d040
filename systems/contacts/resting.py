"""Contacts at rest: where two bodies first touch on their way, which pairs rest, their geometry at the start of the
step, and what touches in the end."""

from __future__ import annotations

import math

from ...framework.compilation import inlined, part
from ...framework.jit.records.record_type import zero_of
from ...framework.vectors import add, add_scaled, dot, item, length, replace, sub
from ..ccd.search_bounds import FAST, is_swept, turns_far
from ..ccd.turning_touch import is_followed
from ..codes import NEED_REST, OK
from ..forces.stages import is_zero
from ..impacts.impulses import STOPPED, is_beyond_cap, is_trapped
from ..integration.trajectory import ROUNDING, along, relative_path
from ..integration.turning import arms_to, closing_by_spin, is_turned, size_of_turn
from ..linking.parts import ARMS_AT_REST, TOUCH_OF_TURN, call_of_step, call_touch_of_turn
from ..narrow_phase.manifolds import (
    centre_offset,
    centre_offset_at_start,
    depth_at,
    depth_bound,
    depth_bound_on_path,
    depth_by_plane,
    evaluate_pair,
    forget_manifold,
    has_manifold,
    is_at_manifold,
    make_manifold,
    shape_centre,
)  # fmt: skip
from ..parts.rows import owner_of
from ..shapes.dispatch import (
    both_convex,
    both_sharp,
    friction_at,
    has_corner_rule,
    is_corner_touch,
    restitution_at,
    restitution_of,
)  # fmt: skip
from ..shapes.surfaces import any_surface_runs, slip_at
from ..shapes.tolerances import (
    SAME_PLACE,
    contact_margin,
    driven_travel,
    is_turning,
    slop_for,
    slop_of,
    smaller_extent,
    turning_margin,
    turning_travel,
)  # fmt: skip
from .points import is_ball, points_of, rows_from

APPROACH_LOOKS = 24
ENTRY_ITERATIONS = 24
STAYS_SLOPS = 1e-3  # slops: two bodies that go less far past each other in a step stay where they are
REST_GAP = 1e-11  # of the extent: a smaller gap is none, not even as seen past a round corner
NORMAL_PROBE, NORMAL_VARIATION = 1e-6, 1e-9  # of the extent: so near the normal differs, by this much of its cosine


@inlined
def is_stationary(travel, slop):
    """Whether two bodies that go so far past each other stay where they are; false for nan."""
    return dot(travel, travel) < STAYS_SLOPS * STAYS_SLOPS * slop * slop


@part
def meets_at_corner(state, a, b, d, met, slop):
    """Whether the two touch at a corner only. Shapes without a rule of their own are looked at if they move past each
    other: what stays where it is does not catch. Two that turn may lean on each other's corners. met: (depth, normal)
    there."""
    bodies, shape = state.bodies, state.bodies.shape
    if state.spinning and is_turned(bodies, a) and is_turned(bodies, b):
        return False
    if not has_corner_rule(state, shape[a], shape[b]):
        if not both_sharp(state, shape[a], shape[b]):
            return False
        if is_stationary(sub(centre_offset(bodies, a, b), centre_offset_at_start(bodies, a, b)), slop):
            return False
    return is_corner_touch(state, shape[a], a, shape[b], b, d, met, slop)


@part
def segment_start(state, a, b):
    """From a's centre to b's where the last stretch of their way begins: at the later of their last impacts if they are
    apart there, else at the start of the step. Nothing holds what rests between two impacts.
    """
    bodies = state.bodies
    start = centre_offset_at_start(bodies, a, b)
    if state.impacts.sweeps and (bodies.impact_count[a] > 0 or bodies.impact_count[b] > 0):
        since = max(0.0, bodies.last_impact[a], bodies.last_impact[b])
        d = along(relative_path(state, a, b), since)
        if evaluate_pair(state, a, b, d)[1] <= slop_of(state, a, b):
            return d
    return start


@part
def first_touch_on_segment(state, a, b, d, travel, edge):
    """(whether they touch on the way from d to d + travel and get deeper than ``edge``; gap at d and normal of that),
    by conservative advancement; of concave shapes by their distance, as what comes next may have another normal.
    A touch of corners is none, nor one that only is the edge of the next thing in a row that one of them slides along.
    """
    shape, t, nothing = state.bodies.shape, 0.0, zero_of(state)
    way, slop = length(travel), slop_of(state, a, b)
    convex = both_convex(state, shape[a], shape[b])
    _, depth, normal, _ = evaluate_pair(state, a, b, d)
    for _ in range(APPROACH_LOOKS):
        rate = dot(travel, normal)
        if convex and not rate < 0.0:
            break
        at, further = add_scaled(d, travel, t), t - depth / (-rate if convex else way)
        if depth >= -ROUNDING * (length(d) + t * way) or (not convex and depth >= -slop):
            further = t + 2.0 * slop / way
            if rate < 0.0 and not meets_at_corner(state, a, b, at, (depth, normal), slop):
                ahead = t - 2.0 * edge / rate
                if ahead < 1.0 and evaluate_pair(state, a, b, add_scaled(d, travel, ahead))[1] > edge:
                    return True, -depth - t * rate, normal
                if convex:
                    break
        if not further < 1.0:
            break
        t = further
        _, depth, normal, _ = evaluate_pair(state, a, b, add_scaled(d, travel, t))
    return False, 0.0, nothing


@part
def touch_of_long_way(state, dt, a, b, end):
    """As :func:`first_touch_on_segment`, on the last stretch of the way of a pair, to ``end``, that goes so far on it
    that its end may say nothing; the gap is that at the start of the step.

    In a discrete world only as far as forces lead: what is faster than that passes through what is thin. What turns has
    another shape on its way; its impacts are searched with that. Where it may bounce a touch is one only if they get
    deeper than that may be wrong, and none after an impact, on a way that was no straight one.
    """
    bodies, edge, nothing = state.bodies, FAST * smaller_extent(state.bodies, a, b), zero_of(state)
    d = segment_start(state, a, b)
    travel = sub(end, d)
    way = length(travel)
    if not way > edge:  # usual
        return False, 0.0, nothing
    margin, turns = contact_margin(state, dt, a, b), turning_travel(state, dt, a, b)
    if not (is_swept(state, a, b, way) or way <= margin) or turns > edge:
        return False, 0.0, nothing
    least = min(edge, margin)
    if is_turning(state, dt, a, b) and state.impacts.sweeps and restitution_of(state, a, b) > 0.0:
        if bodies.impact_count[a] > 0 or bodies.impact_count[b] > 0:
            return False, 0.0, nothing
        least += turns
    found, gap, normal = first_touch_on_segment(state, a, b, d, travel, least)
    return found, gap + dot(sub(centre_offset_at_start(bodies, a, b), d), normal), normal


@part
def deepest(state, dt, c, d, turns):
    """(depth where the centres are d apart, normal, whether it is) by the plane where the pair first touches on a long
    way there, or as it ``turns`` far; else by its manifold or its function."""
    pairs, bodies = state.pairs, state.bodies
    a, b = pairs.a[c], pairs.b[c]
    if turns and depth_bound_on_path(state, c) >= -slop_of(state, a, b):
        touches, _, _, normal, _, _, _ = call_touch_of_turn(state.links[TOUCH_OF_TURN], state, dt, a, b)
        if touches or not is_followed(state, a, b, dt):
            return 2.0 * slop_of(state, a, b) if touches else -math.inf, normal, touches
    far, gap, normal = touch_of_long_way(state, dt, a, b, d)
    if far:
        return -gap - dot(sub(d, centre_offset_at_start(bodies, a, b)), normal), normal, True
    depth, normal = depth_at(state, c, d, smaller_extent(bodies, a, b), state.impacts.active)
    return depth, normal, False


@inlined
def support_along(bodies, a, b, normal):
    """Speed along the normal, not below 0, that what held the bodies in the last step gives them in this one."""
    speed = dot(bodies.warm_start_velocity[b], normal) if bodies.warm_started[b] else 0.0
    return max(0.0, speed - dot(bodies.warm_start_velocity[a], normal) if bodies.warm_started[a] else speed)


@part
def still_bounces(state, dt, c, depth, normal, turns):
    """Whether a pair that bounces is no contact at rest: it meets in the next step only, or is on its way out.

    Notes in pairs.parting whether it flies apart. turns: so far that only sweeps search its impacts.
    """
    pairs, bodies = state.pairs, state.bodies
    a, b, struck, velocity = pairs.a[c], pairs.b[c], pairs.impulse[c] > 0.0, bodies.linear_velocity
    e = restitution_at(state, a, b, (pairs.point[c], pairs.normal[c], pairs.at[c]))
    if not e > 0.0:
        return False
    if e == 1.0 and state.impacts.sweeps and is_trapped(state, a, b):
        return True
    slop, fixed, extent = slop_of(state, a, b), state.restitution_threshold, smaller_extent(bodies, a, b)
    threshold = fixed if fixed >= 0.0 else (contact_margin(state, dt, a, b) - slop) / dt
    speed = dot(sub(velocity[b], velocity[a]), normal)
    if state.spinning and size_of_turn(bodies.spin[a]) + size_of_turn(bodies.spin[b]) > 0.0:
        d = centre_offset(bodies, a, b)
        _, _, _, point = evaluate_pair(state, a, b, d)
        speed += closing_by_spin(bodies, a, b, arms_to(bodies, a, b, normal, point, d), normal)
        known = depth <= slop and not is_beyond_cap(state, a, b)
        known = (known or (e == 1.0 and depth <= FAST * extent)) and (not turns or is_swept(state, a, b, extent))
        if known and abs(speed) > threshold and is_turning(state, dt, a, b):
            return True  # its next impact is searched with the shapes as they are turned then
    held = support_along(bodies, a, b, normal)  # without which they are nearer, and close faster
    near = driven_travel(state, a) + driven_travel(state, b)  # as a motor may bring them together in this step
    if speed >= -held:
        near += held * state.force_travels * dt
    farthest = -near if near > 0.0 else 0.0 if struck else SAME_PLACE * extent
    if speed < -threshold and depth <= farthest:
        return True  # the next step's impact
    pairs.parting[c] = parting = speed > threshold
    return parting and struck  # on its way out


@inlined
def is_borne(state, i):
    """Whether a contact at rest that has been found bears row i."""
    k = owner_of(state, i)
    return state.impacts.borne[k] and state.bodies.inverse_mass[k] > 0.0


@part
def is_resting(state, dt, c):
    """Whether a solid pair's gap is below the margin after the impacts and it is not bouncing."""
    pairs, bodies, count = state.pairs, state.bodies, state.bodies.impact_count
    near_contact = pairs.near_contact
    a, b = pairs.a[c], pairs.b[c]
    if max(count[a], count[b]) >= STOPPED:
        near_contact[c] = True  # they may touch where they are now
        return False
    hit, carried = count[a] + count[b] > 0, bodies.warm_started[a] or bodies.warm_started[b]
    if not near_contact[c] and not hit and not carried:
        return False
    d, extent = centre_offset(bodies, a, b), smaller_extent(bodies, a, b)
    turns = state.spinning and turns_far(state, a, b)
    struck = pairs.impulse[c] > 0.0
    parting = struck and (pairs.early[c] or is_borne(state, a) or is_borne(state, b))  # what bears one may send it back
    if struck and not parting and turns and state.impacts.sweeps and restitution_of(state, a, b) > 0.0:  # it has left
        return False
    if pairs.early[c] and not hit and not turns and is_at_manifold(pairs, c, d, extent):  # usual
        depth, normal, far = depth_by_plane(pairs, c, d), pairs.normal[c], False
    else:
        depth, normal, far = deepest(state, dt, c, d, turns)
        margin = turning_margin(state, dt, a, b)
        if state.spinning and not turns and depth < -margin:
            # A thin bar that lies on terrain is soon behind it, and what slides fast soon beyond what bears it.
            start = centre_offset_at_start(bodies, a, b)
            way = sub(d, start)
            slides = carried and not hit and length(way) > FAST * extent
            if slides or depth == -math.inf:
                _, before, across, _ = evaluate_pair(state, a, b, start)
                if before - max(0.0, dot(way, across)) >= -margin:  # else that plane parts them
                    depth, normal, far = before, across, True
    was_near = near_contact[c] and has_manifold(pairs, c)  # not so pairs that were found within the step
    stays = depth >= 0.0 or parting or (was_near and not hit and not turns)
    if not stays and depth < -turning_margin(state, dt, a, b):
        return False  # else it may have been pushed too much by the prediction
    if depth >= 0.0:
        near_contact[c] = True
    pairs.parting[c] = parting
    if not parting and state.impacts.active and still_bounces(state, dt, c, depth, normal, turns):
        return False
    return far or not meets_at_corner(state, a, b, d, (depth, normal), slop_of(state, a, b))


def find_resting(state, dt):
    """The pairs that are contacts at rest, in canonical order. What impacts have parted, and did not rest before, is
    looked at last: what bears one of the two may send it back to the other."""
    pairs, borne, count, rows = state.pairs, state.impacts.borne, 0, 0
    a, b, impulse, rests, bounced = pairs.a, pairs.b, pairs.impulse, pairs.rests, state.impacts.logged > 0
    looked = 0 if state.response_idle else pairs.count
    for last in range(1 + bounced):
        for c in range(looked):
            if (impulse[c] > 0.0 and not pairs.early[c]) == last:
                rests[c] = pairs.is_solid[c] and is_resting(state, dt, c)
                if bounced and rests[c]:
                    borne[owner_of(state, a[c])] = borne[owner_of(state, b[c])] = True
    for c in range(looked):
        if rests[c]:
            pairs.resting[count], pairs.near_contact[c] = c, True
            count, rows = count + 1, rows + (points_of(state, c) if state.spinning else 1)
    pairs.resting_count, state.solver.contacts, state.solver.any_tips = count, rows, rows > count
    state.resting_counted += count
    return OK if count == 0 or state.rest_ready else NEED_REST


@part
def entry(state, a, b, d, travel, at_end, slop):
    """Gap at the start and normal where the pair first touches on its way from d to d + travel.

    That is the end if it touches nowhere or if ``at_end``. A touch of corners is none.
    """
    low, high, t = 0.0, 1.0, 1.0
    normal, depth, chosen = zero_of(state), 0.0, 0.0
    for look in range(ENTRY_ITERATIONS):
        at = add_scaled(d, travel, t)
        _, depth_now, n, _ = evaluate_pair(state, a, b, at)
        if look == 0 and depth_now == -math.inf:  # behind it there, and not where the step starts
            t = 0.0
            _, depth_now, n, _ = evaluate_pair(state, a, b, d)
        elif meets_at_corner(state, a, b, at, (depth_now, n), slop):
            depth_now = min(depth_now, -slop)  # so that the search goes on
        if look == 0 or depth_now >= 0.0:  # the end, or a time in touch
            normal, depth, chosen = n, depth_now, t
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
    return -depth - chosen * dot(travel, normal), normal


@part
def plane_of_end(state, a, b, d, travel, slop):
    """(whether two convex shapes touch where the step ends and have all of the way there, from d, on the side of that
    plane, but for the slop; gap at the start, normal). What slides off one of them onto another meets no corner."""
    _, depth, n, _ = evaluate_pair(state, a, b, add(d, travel))
    start = depth + dot(travel, n)
    return depth >= 0.0 and max(depth, start) <= slop, -start, n


@part
def normal_varies(state, a, b, d, normal):
    """Whether the normal is another one a little beside, so that it stands for several faces of a concave shape."""
    near, varies = NORMAL_PROBE * smaller_extent(state.bodies, a, b), False
    for k in range(len(d)):
        _, _, beside, _ = evaluate_pair(state, a, b, replace(d, k, item(d, k) + near))
        varies |= dot(beside, normal) < 1.0 - NORMAL_VARIATION
    return varies


@part
def find_surface_slips(state):
    """What surfaces that run add to the slip of each row; returns whether any does where there is friction."""
    pairs, solver, runs = state.pairs, state.solver, False
    for r in range(solver.contacts):
        c, k = solver.pair[r], solver.slot[r]
        touch = pairs.point[c], pairs.normal[c], centre_offset_at_start(state.bodies, pairs.a[c], pairs.b[c])
        solver.surface_slip[k] = slip_at(state, pairs.a[c], pairs.b[c], zero_of(state), touch)
        runs |= solver.friction[k] != 0.0 and not is_zero(solver.surface_slip[k])
    return runs


def linearise(state, dt):
    """Of each contact at rest the normal and the gap where the step starts, and what the solver needs of its bodies."""
    pairs, bodies, solver, normals, has_friction = state.pairs, state.bodies, state.solver, state.pairs.normal, False
    for r in range(solver.contacts):  # in the order of the pairs, for the caches
        if solver.point[r] > 0:  # as the first of the pair
            continue
        c = solver.pair[r]
        a, b, parting = pairs.a[c], pairs.b[c], pairs.parting[c]
        extent, d = smaller_extent(bodies, a, b), centre_offset_at_start(bodies, a, b)
        slop, end, struck_along = slop_for(state, extent), centre_offset(bodies, a, b), normals[c]
        if not is_at_manifold(pairs, c, d, extent):
            make_manifold(state, c, d)
        gap, normal = -depth_by_plane(pairs, c, d), normals[c]
        apart, convex = gap > REST_GAP * extent, both_convex(state, bodies.shape[a], bodies.shape[b])
        varies = not convex and normal_varies(state, a, b, d, normal)
        way, struck = sub(end, d), bodies.impact_count[a] + bodies.impact_count[b] > 0
        slides = convex and not struck and gap + dot(way, normal) >= -STAYS_SLOPS * slop  # its plane parts them
        moves = not is_stationary(way, slop)
        if moves and (parting or (apart and not slides) or meets_at_corner(state, a, b, d, (-gap, normal), slop)):
            flush = far = False
            if convex and not parting:
                flush, gap, normal = plane_of_end(state, a, b, d, way, slop)
            if not (flush or parting):
                far, gap, normal = touch_of_long_way(state, dt, a, b, end)
            if not (flush or far):
                gap, normal = entry(state, a, b, d, way, parting, slop)
            forget_manifold(pairs, c)
        if gap == math.inf:  # deep in a map that has no face there, at neither end: one that it does not reach
            gap = extent + length(way)
        bounced = pairs.impulse[c] > 0.0
        if bounced and dot(normal, struck_along) <= 0.0:
            normal = struck_along  # coincident centres have parted: not back again
            forget_manifold(pairs, c)
        normals[c] = normal
        if apart and state.spinning and is_ball(state, a, normal) and is_ball(state, b, normal):
            apart = False  # neither has a corner to slide past
        # After an impact at time t the body seems to come from dv t behind: no overlap to be pushed out.
        parting |= bounced and gap > 0.0
        mu = friction_at(state, a, b, (pairs.point[c], normal, d))
        has_friction |= mu != 0.0
        for e in range(r, r + rows_from(solver, r)):
            k = solver.slot[e]
            solver.normal[k], solver.gap[k], solver.extent[k], solver.friction[k] = normal, gap, extent, mu
            solver.apart[k], solver.hard[k], solver.parting[k] = apart, not varies, parting
    solver.has_friction, solver.surfaces_run = has_friction, any_surface_runs(state) and find_surface_slips(state)
    solver.has_rolling = False
    return call_of_step(state.links[ARMS_AT_REST], state, dt) if state.spinning else OK


@inlined
def contact_travel(state, i):
    """How far contacts at rest have turned points of body i."""
    owner = owner_of(state, i)
    return state.bodies.contact_travel[owner] if state.spinning and state.bodies.inverse_mass[owner] > 0.0 else 0.0


def find_touching(state, dt):
    """Pairs that touch now that all is done, or pushed each other in the step or crossed. Those that have parted are
    where they met last.

    Those that may are near contact, rest or had an impact, or are not solid.
    """
    pairs, bodies, impacts, count = state.pairs, state.bodies, state.impacts, 0
    points, hit = pairs.point, pairs.hit
    if state.response_idle:
        pairs.touching_count = 0
        return OK
    for r in range(impacts.logged):
        pairs.near_contact[impacts.log_pair[r]] = True
    for c in range(pairs.count):
        solid, crossed = pairs.is_solid[c], pairs.crossed[c]
        if solid and not pairs.near_contact[c] and not crossed:
            continue
        a, b, pushed, normal, met = pairs.a[c], pairs.b[c], pairs.impulse[c] > 0.0, pairs.normal[c], points[c]
        d, extent = centre_offset(bodies, a, b), smaller_extent(bodies, a, b)
        slop = slop_for(state, extent)
        known = pushed and pairs.rests[c] and is_stationary(sub(d, pairs.at[c]), slop)
        known = known and contact_travel(state, a) + contact_travel(state, b) < STAYS_SLOPS * slop
        if not (known or is_at_manifold(pairs, c, d, extent)):
            if solid and not pushed and not crossed and depth_bound(pairs, c, d) < -SAME_PLACE * extent:
                continue
            make_manifold(state, c, d)
        depth = depth_by_plane(pairs, c, d)
        touches = hit[c] or (solid and depth >= -SAME_PLACE * extent)
        if not touches and not pushed and not crossed:
            continue
        pairs.depth[c], hit[c] = max(0.0, depth), touches
        if pushed or (crossed and not touches):  # along this
            pairs.normal[c] = normal
        if crossed and not touches:
            points[c] = sub(met, shape_centre(bodies, a))
        pairs.touching[count] = c
        count += 1
    for r in range(impacts.logged):
        c = impacts.log_pair[r]
        if not hit[c] and not pairs.crossed[c]:
            points[c] = sub(impacts.log_point[r], shape_centre(bodies, pairs.a[c]))
    pairs.touching_count = count
    state.contacts_counted += count
    return OK
