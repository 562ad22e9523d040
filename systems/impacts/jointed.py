"""Impacts on bodies that joints hold, with the answers of these: what an impact asks, what it does to all that joints
connect with it, and where that starts in the solver then."""

from __future__ import annotations

import math

from ...framework.compilation import part
from ...framework.jit.records.record_type import zero_of
from ...framework.vectors import add, add_scaled, dot, item, length, scale, sub
from ..codes import OK
from ..contacts.solving.rows import rotate_body
from ..integration.turning import arms_to, cross_spin, velocity_by_spin
from ..joints.groups import group_of
from ..joints.records import HOLD, POINT
from ..parts.rows import owner_of, place_of
from ..shapes.poses import advance_pose, motion_of, set_motion
from ..shapes.surfaces import slip_at
from .impulses import count_impact, deflect, touch_of_event
from .joint_answers import (
    HELD,
    TAKE_FLIGHT,
    TAKE_NOTHING,
    TAKE_SPEEDS,
    TAKE_STARTS,
    TAKE_WAYS,
    answer,
    answers,
    change_of_row,
    given_in_flight,
    list_answering,
    motion_to_take,
    parted_by,
    push_rows,
    rate_of_row,
    rows_that_answer,
)
from .turning import add_spin, arms_of, impulses_of, slip_direction
from .worklist import list_pairs_of

GAIN_OF_ROUNDING = 1e-9  # of the energy of the velocities that an impact gives: less is rounding
ONE_MOTION = 1e-5  # of the product: answers are as exact as that; two impulses that differ by less do one thing


@part
def last_impact_of(state, group):
    """When a body of that group has had its last impact in this step; -1: it has had none."""
    impacts, pairs, last = state.impacts, state.pairs, -1.0
    for k in range(impacts.logged):
        c = impacts.log_pair[k]
        if group_of(state, pairs.a[c]) == group or group_of(state, pairs.b[c]) == group:
            last = impacts.log_time[k]
    return last


@part
def settle_group(state, i, t):
    """``settled`` of the bodies of the group of body i, to an impact at time t; see :func:`settle`."""
    impacts, joints, zero, group = state.impacts, state.solver.joints, zero_of(state), group_of(state, i)
    impacts.since = max(0.0, last_impact_of(state, group)) if group >= 0 else 0.0
    impacts.now = 0.5 * (impacts.since + t)
    e, holds = group, True
    while e >= 0:
        j = joints.order[e]
        holds &= joints.rule[j] == HOLD or not answers(joints, j)  # limits and motors are not known to be on the way
        for row in (joints.row_a[j], joints.row_b[j]):
            if row >= 0:
                impacts.settled[owner_of(state, row)] = impacts.settled_spin[owner_of(state, row)] = zero
        e = joints.stream[e]
    rows = list_answering(state, i, i) if holds else 0
    answer(state, rows, ((i, i), (zero, zero), zero), 0.0, zero, TAKE_FLIGHT)
    for e in range(rows):
        for row in (joints.row_a[joints.open_row[e]], joints.row_b[joints.open_row[e]]):
            if row >= 0:
                k = owner_of(state, row)
                impacts.settled[k] = sub(impacts.gained[k], given_in_flight(state, row))
                impacts.settled_spin[k] = impacts.gained_spin[k]
    impacts.now = t


@part
def settle(state, sides, t):
    """``settled``: what makes the flight of what joints connect with two bodies, to an impact at time t, end as joints
    have it. These were foreseen to give what they gave in the step before, in the direction of then, and on a straight
    path all at once: in place of that they give, at half of the way, what makes the velocities before and behind part
    what they hold as much, one way and the other, so that energy is the same."""
    (a, b), impacts, zero = sides, state.impacts, zero_of(state)
    for i in (a, b):
        k = owner_of(state, i)
        impacts.settled[k] = impacts.settled_spin[k] = zero
    settle_group(state, a, t)
    if group_of(state, b) != group_of(state, a):
        settle_group(state, b, t)


@part
def drop_settled(state, sides):
    """Two bodies go on as they have come."""
    for i in sides:
        k = owner_of(state, i)
        state.impacts.settled[k] = state.impacts.settled_spin[k] = zero_of(state)


@part
def gain_settled(state, rows, sides):
    """Two bodies, and those of rows, gain what has settled them and what the rows push: all of that, or nothing."""
    impacts, joints, zero = state.impacts, state.solver.joints, zero_of(state)
    for e in range(-1, rows):
        one, other = sides if e < 0 else (joints.row_a[joints.open_row[e]], joints.row_b[joints.open_row[e]])
        for i in (one, other):
            if i >= 0:
                k = owner_of(state, i)
                impacts.gained[k] = impacts.settled[k] if rows > 0 else zero
                impacts.gained_spin[k] = impacts.settled_spin[k] if rows > 0 else zero
    push_rows(state, rows, joints.push)


def respond_joined(state, sides, met, motion, e, mu):
    """What ``respond_at_arms`` tells, where joints hold one of the two."""
    bodies, (a, b), (t, normal, point, apart) = state.bodies, sides, met
    now, (velocity, speed) = state.impacts.now, motion
    settle(state, sides, t)
    arms = arms_to(bodies, a, b, normal, point, apart)
    light, touch, nothing = bodies.inverse_mass[a] + bodies.inverse_mass[b], (sides, arms, normal), scale(normal, 0.0)
    rows, parted = rows_that_answer(state, touch)
    answer(state, rows, touch, 0.0, nothing, TAKE_SPEEDS)
    gain_settled(state, rows, sides)
    settled, nn = parted_by(state, touch), dot(parted, normal)
    speed += dot(settled, normal)
    smooth, pull = -(1.0 + e) * min(0.0, speed) * (light / nn), nothing
    if mu > 0.0 and speed < 0.0:
        velocity = add(add(velocity, settled), velocity_by_spin(bodies, a, b, arms))
        slip = add_scaled(velocity, normal, -dot(velocity, normal))
        driven = scale(add_scaled(parted, normal, -nn), 0.5 * smooth / light)
        tangent = slip_direction(normal, slip, driven)
        if length(tangent) > 0.0:
            answer(state, rows, touch, 0.0, tangent, TAKE_NOTHING)
            nt, tt = dot(parted, tangent), dot(parted_by(state, touch), tangent)
            if tt > HELD * light and nn * tt - nt * nt > ONE_MOTION * nn * tt:  # else the answers are rounding
                pushed, pulled = impulses_of((nn, nt, tt), (speed, dot(slip, tangent)), e, mu)
                smooth, pull = pushed * light, scale(tangent, pulled * light)
    state.impacts.now = now
    return smooth, pull


@part
def share_of_impact(state, rows, touch, met, friction):
    """The largest share of an impact and of the answers of rows to it, which are in ``push``, that gives no energy: a
    share s gives slope s + curvature s^2 / 2, without the work of what drives the bodies. met: (impulse along the
    normal, at which their surfaces run)."""
    ((a, b), arms, normal), joints, (impulse, running) = touch, state.solver.joints, met
    answer(state, rows, touch, impulse, friction, TAKE_SPEEDS)
    (v_a, spin_a), (v_b, spin_b) = motion_to_take(state, a, TAKE_NOTHING), motion_to_take(state, b, TAKE_NOTHING)
    seen = sub(add(v_b, cross_spin(spin_b, arms[1])), add(v_a, cross_spin(spin_a, arms[0])))
    push = add_scaled(friction, normal, impulse)
    slope, curvature = dot(push, add(seen, running)), dot(push, parted_by(state, touch))
    for e in range(rows):
        j = joints.open_row[e]
        slope += dot(joints.push[j], rate_of_row(state, j, TAKE_NOTHING))
        curvature += dot(joints.push[j], change_of_row(state, j))
    if slope + 0.5 * curvature <= GAIN_OF_ROUNDING * curvature:
        return 1.0
    return max(0.0, -2.0 * slope / curvature) if curvature < math.inf else 0.0


@part
def take_gains(state, i, dt):
    """Body i goes on with what it has gained; returns whether it has gained anything."""
    impacts, k, zero = state.impacts, owner_of(state, i), zero_of(state)
    dv, spin = impacts.gained[k], impacts.gained_spin[k]
    impacts.gained[k], impacts.gained_spin[k] = zero, zero
    if length(dv) + length(spin) == 0.0:
        return False
    deflect(state, k, dv, impacts.now, dt)
    add_spin(state, k, spin, dt - impacts.now)
    return True


def strike_joined(state, event, impulse, friction, dt):
    """What joints answer an impact of two bodies with: all that they connect goes on with other velocities and spins,
    and is searched for its next impacts. The joints bear it. Limits that go slack, and answers that are not exact,
    would give energy: only the share of all acts that gives none. Where each share does, joints answer nothing."""
    impacts, joints, bodies = state.impacts, state.solver.joints, state.bodies
    a, b = state.pairs.a[impacts.event_pair[event]], state.pairs.b[impacts.event_pair[event]]
    touch = (a, b), arms_of(state, event), impacts.event_normal[event]
    settle(state, touch[0], impacts.now)
    motions = motion_of(state, a), motion_of(state, b)  # of the end of the step
    advance_pose(state, a, bodies.spin[a], impacts.now - dt)
    advance_pose(state, b, bodies.spin[b], impacts.now - dt)
    rows, _ = rows_that_answer(state, touch)
    running = slip_at(state, a, b, zero_of(state), touch_of_event(state, event))
    share = share_of_impact(state, rows, touch, (impulse, running), friction)
    if rows == 0 or share == 0.0:
        rows = 0
        drop_settled(state, touch[0])
        share = share_of_impact(state, rows, touch, (impulse, running), friction)
    if share < 1.0:
        for e in range(rows):
            joints.push[joints.open_row[e]] = scale(joints.push[joints.open_row[e]], share)
        impacts.event_change[event] *= share
        impacts.event_pull[event] = scale(impacts.event_pull[event], share)
    gain_settled(state, rows, touch[0])
    set_motion(state, a, motions[0])
    set_motion(state, b, motions[1])
    take_gains(state, a, dt)
    take_gains(state, b, dt)
    for e in range(rows):
        j = joints.open_row[e]
        if joints.kind[j] == POINT:
            joints.thrust[j] = add(joints.thrust[j], joints.push[j])
        else:
            joints.total[j] += item(joints.push[j], 0)
        for i in (joints.row_a[j], joints.row_b[j]):
            if i >= 0 and take_gains(state, i, dt):
                count_impact(state, i, False)
                list_pairs_of(state, i, -1, dt)
    return OK


@part
def displace(state, i, takes):
    """Body i starts in the solver by so much elsewhere as it has gained, or with other velocities."""
    impacts, solver, k, zero = state.impacts, state.solver, owner_of(state, i), zero_of(state)
    q = place_of(state, k)
    if takes == TAKE_WAYS:
        solver.shift[q] = add(solver.shift[q], impacts.gained[k])
        rotate_body(solver, q, add(solver.turn[q], impacts.gained_spin[k]))
    else:
        solver.velocity[q] = add(solver.velocity[q], impacts.gained[k])
        solver.spin[q] = add(solver.spin[q], impacts.gained_spin[k])
    impacts.gained[k], impacts.gained_spin[k] = zero, zero


def bend_struck(state, dt):
    """What has had an impact starts in the solver where its way behind it comes from, on a straight line, with the
    velocity of the impact. Where joints hold it that is a bend: they bring it back to where it is as open as the step
    starts, and its velocity to that of there. At half of the way the two velocities part what joints hold as much, one
    way and the other, so that energy is the same."""
    impacts, joints, zero = state.impacts, state.solver.joints, zero_of(state)
    for e in range(joints.active):
        a, b = joints.row_a[joints.order[e]], joints.row_b[joints.order[e]]
        i = a if group_of(state, a) >= 0 else b
        last = last_impact_of(state, e) if group_of(state, i) == e else -1.0
        for takes in range(TAKE_STARTS, TAKE_WAYS + 1 if last >= 0.0 else TAKE_STARTS):
            impacts.now = 0.0 if takes == TAKE_WAYS else 0.5 * last
            rows = list_answering(state, i, i)
            answer(state, rows, ((i, i), (zero, zero), zero), 0.0, zero, takes)
            for m in range(rows):
                for k in (joints.row_a[joints.open_row[m]], joints.row_b[joints.open_row[m]]):
                    if group_of(state, k) >= 0:
                        displace(state, k, takes)
    return OK
