"""Impacts of bodies that spin: the impulse at a point that is off their centres, and how it turns them.

While the impulse along the normal grows, friction slides, sticks or turns round, in pieces in which both speeds of the
point change in proportion to it (E. J. Routh, 1905). Restitution is that of energy: the work that it gives back is e^2
times that of the compression (W. J. Stronge, 1990), so that energy never grows. Newton's rule, the same where an
impulse along the normal makes nothing slide, gains with friction elsewhere.

In space friction acts along one direction, that of the slip halfway through the impact without friction.
"""

from __future__ import annotations

import math

from ...framework.compilation import part
from ...framework.vectors import add, add_scaled, divided, dot, item, length, replace, scale, sub
from ..codes import OK
from ..integration.trajectory import along, path_of
from ..integration.turning import arms_to, change_of_spin, compliance, cross_spin, lever, twist, velocity_by_spin
from ..joints.groups import is_joined
from ..linking.parts import JOINED_RESPONSE, call_turning_response
from ..parts.rows import next_row, owner_of
from ..shapes.poses import advance_pose, has_unequal_moments, motion_of, rotate_pose, set_motion, turn_shape

PIECES = 6  # slides, sticks or turns round, and each once more for the restitution
STUCK = 1e-14  # of the speeds: a slower slip is none


@part
def slip_direction(normal, slip, driven):
    """The unit vector along which friction acts; 0 if there is none. driven: the slip that the normal impulse makes in
    the first half of the impact."""
    if len(normal) == 2:
        across = replace(replace(normal, 0, -item(normal, 1)), 1, item(normal, 0))
        return across if length(slip) + length(driven) > 0.0 else scale(normal, 0.0)
    halfway, size = add(slip, driven), length(slip) + length(driven)
    if not length(halfway) > STUCK * size:
        halfway = slip
    return divided(halfway, length(halfway)) if length(halfway) > 0.0 else halfway


@part
def impulses_of(masses, speeds, e, mu):
    """(impulse along the normal, along the slip) of an impact. masses: 1 / kg that impulses move, along the normal, of
    one along the other, and along the slip; speeds: of the point, along both."""
    nn, nt, tt = masses
    speed, slip = speeds
    least = STUCK * (abs(speed) + abs(slip))
    normal, friction, work, owed, restores = 0.0, 0.0, 0.0, 0.0, False
    for _ in range(PIECES):
        share, slides = -nt / tt, abs(slip) > least  # of the friction in the impulse, where it sticks
        if slides:
            share = -math.copysign(mu, slip)
        elif abs(share) > mu:
            share = math.copysign(mu, share)
        faster, further = nn + nt * share, nt + tt * share
        if restores:
            left = speed * speed + 2.0 * faster * (owed - work)
            growth = 2.0 * (owed - work) / (speed + math.sqrt(max(left, 0.0))) if owed > work else 0.0
        else:
            growth = -speed / faster if faster > 0.0 else math.inf
        stops = slides and -slip / further < growth if slip * further < 0.0 else False
        growth = -slip / further if stops else growth
        normal, friction = normal + growth, friction + share * growth
        work += speed * growth + 0.5 * faster * growth * growth
        speed, slip = speed + faster * growth, 0.0 if stops else slip + further * growth
        if not stops:
            if restores or e == 0.0:
                break
            speed, restores, owed = 0.0, True, (1.0 - e * e) * work
    return normal, friction


def respond_at_arms(state, sides, touch, motion, e, mu):
    """(change of the speed of b as a sees it, along the normal; change of its velocity along the surface) by an impact.

    motion: (velocity of b's body as that of a sees it, with what runs of their surfaces; speed of the point along the
    normal).
    """
    bodies, (a, b), (_, normal, point, apart) = state.bodies, sides, touch
    velocity, speed = motion
    if is_joined(state, a, b):
        return call_turning_response(state.links[JOINED_RESPONSE], state, sides, touch, motion, e, mu)
    arms = arms_to(bodies, a, b, normal, point, apart)
    light = bodies.inverse_mass[a] + bodies.inverse_mass[b]
    lever_a, lever_b = lever(bodies, a, arms[0], normal), lever(bodies, b, arms[1], normal)
    turn_a, turn_b = change_of_spin(bodies, a, lever_a), change_of_spin(bodies, b, lever_b)
    nn = light + (dot(lever_a, turn_a) + dot(lever_b, turn_b))
    smooth, nothing = -(1.0 + e) * speed * (light / nn), scale(normal, 0.0)
    if mu == 0.0:
        return smooth, nothing
    velocity = add(velocity, velocity_by_spin(bodies, a, b, arms))
    slip = add_scaled(velocity, normal, -dot(velocity, normal))
    driven = add(cross_spin(turn_a, arms[0]), cross_spin(turn_b, arms[1]))
    driven = scale(add_scaled(driven, normal, -dot(driven, normal)), 0.5 * smooth / light)
    tangent = slip_direction(normal, slip, driven)
    tt = light + compliance(bodies, a, arms[0], tangent) + compliance(bodies, b, arms[1], tangent)
    nt = dot(turn_a, twist(arms[0], tangent)) + dot(turn_b, twist(arms[1], tangent))
    slips = dot(slip, tangent)
    if nt == 0.0:
        stop = min(abs(slips) / tt, mu * smooth / light)
        return smooth, scale(tangent, -math.copysign(stop, slips) * light)
    pushed, pulled = impulses_of((nn, nt, tt), (speed, slips), e, mu)
    return pushed * light, scale(tangent, pulled * light)


@part
def arms_of(state, event):
    """The arms of both bodies to the point of an impact."""
    impacts, now = state.impacts, state.impacts.now
    a, b = state.pairs.a[impacts.event_pair[event]], state.pairs.b[impacts.event_pair[event]]
    point, bodies = impacts.event_point[event], state.bodies
    to_a, to_b = sub(point, along(path_of(state, a), now)), sub(point, along(path_of(state, b), now))
    place, d = sub(to_a, bodies.offset[a]), add(sub(to_a, to_b), sub(bodies.offset[b], bodies.offset[a]))
    return arms_to(bodies, a, b, impacts.event_normal[event], place, d)


@part
def kinematic_normal_speed(state, event):
    """The speed along the normal at which what cannot be moved, of the two of an impact, turns at its point."""
    impacts, bodies, arms = state.impacts, state.bodies, arms_of(state, event)
    c = impacts.event_pair[event]
    a, b = state.pairs.a[c], state.pairs.b[c]
    q, arm = (b, arms[1]) if bodies.inverse_mass[a] > 0.0 else (a, arms[0])
    return dot(cross_spin(bodies.spin[q], arm), impacts.event_normal[event])


@part
def add_spin(state, i, change, left):
    """Body i turns by so much faster for what is left of the step."""
    bodies, i = state.bodies, owner_of(state, i) if length(change) > 0.0 else -1
    while i >= 0:
        if has_unequal_moments(state, i):
            rotate_pose(state, i, bodies.spin[i], -left)
            bodies.spin[i] = add(bodies.spin[i], change)
            rotate_pose(state, i, bodies.spin[i], left)
        else:
            bodies.spin[i] = add(bodies.spin[i], change)
            bodies.turn[i] = add_scaled(bodies.turn[i], change, left)
            if bodies.rolling_radius[i] == 0.0:
                turn_shape(state, i, scale(change, left))
        i = next_row(state, i)


def turn_by_impact(state, event, impulse, friction, dt):
    """An impact changes the spins of both bodies, with which they turn for the rest of the step. impulse: along the
    normal; friction: along the surface."""
    impacts, bodies, arms = state.impacts, state.bodies, arms_of(state, event)
    c, normal, left = impacts.event_pair[event], impacts.event_normal[event], dt - impacts.now
    for i, arm, sign in ((state.pairs.a[c], arms[0], -1.0), (state.pairs.b[c], arms[1], 1.0)):
        twisted = add(scale(lever(bodies, i, arm, normal), impulse), twist(arm, friction))
        motion = motion_of(state, i)
        advance_pose(state, i, bodies.spin[i], -left)
        change = scale(change_of_spin(bodies, i, twisted), sign)
        set_motion(state, i, motion)
        add_spin(state, i, change, left)
    return OK
