"""What joints answer an impact with, at the same time: impulses of all that holds what is struck.

An impulse at a point of a body moves all that joints connect with it, and nothing that they hold: with the changes J of
what they hold per second, the masses M and what p alone gives, they answer with q so that J (M^-1 J' q + given) = 0.
So the law of an impact is that of two points with the masses that this leaves: they part at e times their approach,
and energy is kept where e is 1. What joints hold changes on the way to an impact too, as bodies fly freely until the
solver has them: that is taken back first, with the least change of all motions, as energy might grow with it.

q is found by conjugate residuals (E. Stiefel, "Relaxationsmethoden bester Strategie", 1955), each row over the mass
that it moves: where rings of joints hold more than bodies can do, what is left over is the least, and the search ends
where only that is left, as it would go far along what moves nothing. The rows that answer are those that hold whatever
force that takes, motors without a bound, and limits that bore something in the last step, as far as they push.
"""

from __future__ import annotations

import math

from ...framework.compilation import inlined, part
from ...framework.jit.records.record_type import zero_of
from ...framework.vectors import add, add_scaled, dot, item, length, replace, scale, sub
from ..ccd.turning_touch import STOPPED
from ..integration.trajectory import along, path_of, rate_along
from ..integration.turning import change_of_spin, cross_spin, lever, turn_of_arm, twist
from ..joints.bodies import turned_before, turned_in_step
from ..joints.direct import directions_at
from ..joints.groups import group_of
from ..joints.order import numbers_of
from ..joints.records import ALIGN, DRIVE, HOLD, LIMIT, POINT, ROD, SERVO, SLIDE, TURN
from ..parts.rows import owner_of, place_of

MOST_ITERATIONS = 96  # a chain of 60 bodies is solved to rounding; longer ones bounce with less energy
SOLVED = 1e-16  # of the energy that joints would take if each row were alone: less is none
# What joints take back as well: how fast bodies part what they hold, now, before and behind their flight to an impact,
# or as the solver has them; how far.
TAKE_NOTHING, TAKE_SPEEDS, TAKE_FLIGHT, TAKE_STARTS, TAKE_WAYS = range(5)
HELD = 1e-10  # of what an impulse would move without joints: less is nothing


# -- the rows that answer ----------------------------------------------------------------------------------------------


@inlined
def answers(joints, j):
    """Whether a row holds its value against an impact."""
    rule = joints.rule[j]
    holds = rule in (HOLD, DRIVE, SERVO) or (rule == LIMIT and joints.load[j] != 0.0)
    return holds and joints.most[j] == math.inf


@part
def turned_at(state, i, v):
    """A vector along the axes of body i as it is now; of the world the same."""
    if i < 0:
        return v
    turned = turned_in_step(state, i, v)
    return add(turned, turn_of_arm(scale(state.bodies.spin[i], state.impacts.now - state.impacts.end), turned))


@part
def point_at(state, i, arm):
    """Where the end of an arm of body i is now; of the world the arm is that place."""
    return add(along(path_of(state, i), state.impacts.now), arm) if i >= 0 else arm


@part
def moved_by_row(state, i, push, turn):
    """What 1 N s of a row moves of its value by body i."""
    if i < 0:
        return 0.0
    k = owner_of(state, i)
    w = state.bodies.inverse_mass[k]
    return w * dot(push, push) + dot(turn, change_of_spin(state.bodies, k, turn)) if w > 0.0 else 0.0


@part
def lay_row(state, j):
    """Along which a row acts now, and the mass that it moves. That of a plugin, and those of angles in space that are
    no hinges, act as in the last substep of the step before."""
    joints, zero = state.solver.joints, zero_of(state)
    a, b, kind = joints.row_a[j], joints.row_b[j], joints.kind[j]
    if kind == SLIDE or (len(zero) == 3 and kind in (TURN, ALIGN)):
        joints.normal[j] = turned_at(state, a, joints.axis[j])
    if kind < TURN:
        arm_a, arm_b = turned_at(state, a, joints.anchor_a[j]), turned_at(state, b, joints.anchor_b[j])
        way = sub(point_at(state, b, arm_b), point_at(state, a, arm_a))
        if kind == ROD and length(way) > 0.0:
            joints.normal[j] = scale(way, 1.0 / length(way))
        if kind == POINT:  # at one point, so that impulses turn nothing as a whole
            arm_a, arm_b = add_scaled(arm_a, way, 0.5), add_scaled(arm_b, way, -0.5)
        joints.arm_a[j], joints.arm_b[j] = add(arm_a, way) if kind == SLIDE else arm_a, arm_b
    for k in range(numbers_of(joints, j)):
        push_a, turn_a, push_b, turn_b = directions_at(joints, j, k)
        moved = moved_by_row(state, a, push_a, turn_a) + moved_by_row(state, b, push_b, turn_b)
        joints.inverse[j] = replace(joints.inverse[j], k, 1.0 / moved if moved > 0.0 else 0.0)


@part
def list_answering(state, a, b):
    """Write the rows that answer an impact of rows a and b into ``open_row``; returns how many."""
    joints, one, other, count = state.solver.joints, group_of(state, a), group_of(state, b), 0
    for g in (one, other if other != one else -1):
        e = g
        while e >= 0:
            if answers(joints, joints.order[e]):
                lay_row(state, joints.order[e])
                joints.open_row[count] = joints.order[e]
                count += 1
            e = joints.stream[e]
    return count


# -- their impulses ----------------------------------------------------------------------------------------------------


@part
def clear_bodies(state, rows):
    """No row has moved its bodies."""
    joints, impacts, zero = state.solver.joints, state.impacts, zero_of(state)
    for e in range(rows):
        for i in (joints.row_a[joints.open_row[e]], joints.row_b[joints.open_row[e]]):
            if i >= 0:
                k = owner_of(state, i)
                impacts.gained[k], impacts.gained_spin[k] = zero, zero


@part
def push_body(state, i, push, turn, impulse):
    """Body i gains what an impulse gives it."""
    k = owner_of(state, i) if i >= 0 else 0
    if i < 0 or state.bodies.inverse_mass[k] == 0.0:
        return
    impacts, bodies = state.impacts, state.bodies
    impacts.gained[k] = add_scaled(impacts.gained[k], push, impulse * bodies.inverse_mass[k])
    impacts.gained_spin[k] = add_scaled(impacts.gained_spin[k], change_of_spin(bodies, k, turn), impulse)


@part
def push_rows(state, rows, impulses):
    """Bodies gain what these impulses of rows give them."""
    joints = state.solver.joints
    for e in range(rows):
        j = joints.open_row[e]
        for k in range(numbers_of(joints, j)):
            impulse = item(impulses[j], k)
            if impulse != 0.0:
                push_a, turn_a, push_b, turn_b = directions_at(joints, j, k)
                push_body(state, joints.row_a[j], push_a, turn_a, impulse)
                push_body(state, joints.row_b[j], push_b, turn_b, impulse)


@part
def change_of_row(state, j):
    """What the bodies have gained changes of the value of a row per second."""
    joints, impacts, change = state.solver.joints, state.impacts, zero_of(state)
    for k in range(numbers_of(joints, j)):
        push_a, turn_a, push_b, turn_b = directions_at(joints, j, k)
        moved = 0.0
        for i, push, turn in ((joints.row_a[j], push_a, turn_a), (joints.row_b[j], push_b, turn_b)):
            if i >= 0:
                q = owner_of(state, i)
                moved += dot(push, impacts.gained[q]) + dot(turn, impacts.gained_spin[q])
        change = replace(change, k, moved)
    return change


@part
def changes_of(state, rows, impulses):
    """What these impulses of rows would change of what the rows hold, as ``change_of_row`` tells then; returns the
    energy of that, without its half."""
    joints, energy = state.solver.joints, 0.0
    clear_bodies(state, rows)
    push_rows(state, rows, impulses)
    for e in range(rows):
        energy += dot(impulses[joints.open_row[e]], change_of_row(state, joints.open_row[e]))
    return energy


@part
def given_in_flight(state, i):
    """What joints were foreseen to give body i on its flight, halfway through which it is now, and its path has."""
    impacts, bodies, k = state.impacts, state.bodies, owner_of(state, i)
    swings = state.any_warm_started and bodies.warm_started[k] and bodies.swings[k]
    if bodies.impact_count[k] >= STOPPED or not swings:
        return zero_of(state)
    share = 2.0 * (impacts.now - impacts.since) / impacts.end
    if state.path_degree == 1:
        share = 0.5 + 0.5 / state.substeps if impacts.since == 0.0 else 0.0
    return scale(bodies.warm_start_velocity[k], share)


@part
def motion_to_take(state, i, takes):
    """(velocity, spin) of body i now, as it is settled; or the sum of those before and behind its flight, without what
    joints were foreseen to give it, or as the solver has them, before an impact as behind it."""
    bodies, impacts, since, k = state.bodies, state.impacts, state.impacts.since, owner_of(state, i)
    stopped = bodies.impact_count[k] >= STOPPED  # it stays where it is, with its velocity
    if takes == TAKE_STARTS:
        q = place_of(state, i)
        return scale(state.solver.velocity[q], 2.0), scale(state.solver.spin[q], 2.0)
    path = path_of(state, i)
    if takes <= TAKE_SPEEDS:
        velocity = bodies.linear_velocity[k] if stopped else rate_along(path, impacts.now)
        return add(velocity, impacts.settled[k]), add(bodies.spin[i], impacts.settled_spin[k])
    if stopped:
        return scale(bodies.linear_velocity[k], 2.0), scale(bodies.spin[i], 2.0)
    start = rate_along(path, since) if since > 0.0 else bodies.start_velocity[i]
    end = rate_along(path, 2.0 * impacts.now - since)
    return sub(add(start, end), given_in_flight(state, i)), scale(bodies.spin[i], 2.0)


@part
def rate_of_row(state, j, takes):
    """How fast the bodies change the value of a row that holds it, or bears it: motors 0, and limits where joints take
    something back."""
    joints, speed = state.solver.joints, zero_of(state)
    counts = joints.rule[j] == HOLD or (joints.rule[j] == LIMIT and takes == TAKE_NOTHING)
    for k in range(numbers_of(joints, j) if counts else 0):
        push_a, turn_a, push_b, turn_b = directions_at(joints, j, k)
        moved = 0.0
        for i, push, turn in ((joints.row_a[j], push_a, turn_a), (joints.row_b[j], push_b, turn_b)):
            if i >= 0:
                v, spin = motion_to_take(state, i, takes)
                moved += dot(push, v) + dot(turn, spin)
        speed = replace(speed, k, moved)
    return speed


@part
def strayed_at(state, j):
    """How much farther a row is open at the start of the paths than where the step starts."""
    joints, previous, zero = state.solver.joints, state.bodies.previous_position, zero_of(state)
    a, b, kind = joints.row_a[j], joints.row_b[j], joints.kind[j]
    if kind >= TURN or joints.rule[j] != HOLD:
        return zero
    arm_a, arm_b = turned_at(state, a, joints.anchor_a[j]), turned_at(state, b, joints.anchor_b[j])
    way = sub(point_at(state, b, arm_b), point_at(state, a, arm_a))
    start_a = add(previous[a], turned_before(state, a, joints.anchor_a[j])) if a >= 0 else joints.anchor_a[j]
    start_b = add(previous[b], turned_before(state, b, joints.anchor_b[j])) if b >= 0 else joints.anchor_b[j]
    before = sub(start_b, start_a)
    if kind == POINT:
        return sub(way, before)
    if kind == ROD:
        return replace(zero, 0, length(way) - length(before))
    axis = turned_before(state, a, joints.axis[j]) if a >= 0 else joints.axis[j]
    return replace(zero, 0, dot(way, joints.normal[j]) - dot(before, axis))


@inlined
def each_times(like, u, v):
    """Number by number."""
    for k in range(len(like)):
        like = replace(like, k, item(u, k) * item(v, k))
    return like


@part
def strike(state, rows, touch, impulse, friction):
    """What an impulse along the normal and one along the surface give bodies a and b alone."""
    (a, b), arms, normal = touch
    impacts, bodies, zero = state.impacts, state.bodies, zero_of(state)
    clear_bodies(state, rows)
    for i in (a, b):
        impacts.gained[owner_of(state, i)] = impacts.gained_spin[owner_of(state, i)] = zero
    for i, arm, sign in ((a, arms[0], -1.0), (b, arms[1], 1.0)):
        turn = add(scale(lever(bodies, i, arm, normal), impulse), twist(arm, friction))
        push_body(state, i, add_scaled(friction, normal, impulse), turn, sign)


@part
def answer(state, rows, touch, impulse, friction, takes):
    """What the two impulses and the answers of joints give all bodies; these are in ``push``. takes: what joints take
    back as well."""
    joints, zero = state.solver.joints, zero_of(state)
    rest, direction, changed = joints.gap, joints.soft_answer, joints.answer
    strike(state, rows, touch, impulse, friction)
    alone = 0.0
    for e in range(rows):
        j = joints.open_row[e]
        joints.push[j], residual = zero, scale(change_of_row(state, j), -1.0)
        if takes == TAKE_WAYS:
            residual = sub(residual, strayed_at(state, j))
        elif takes != TAKE_NOTHING:
            residual = sub(residual, rate_of_row(state, j, takes))
        rest[j] = direction[j] = each_times(zero, joints.inverse[j], residual)
        alone += dot(residual, rest[j])
    left = changes_of(state, rows, rest)
    for e in range(rows):
        changed[joints.open_row[e]] = change_of_row(state, joints.open_row[e])
    unsolved = alone
    for _ in range(MOST_ITERATIONS):
        bends = 0.0
        for e in range(rows):
            j = joints.open_row[e]
            bends += dot(changed[j], each_times(zero, joints.inverse[j], changed[j]))
        if not (left > max(HELD * unsolved, SOLVED * alone) and bends > 0.0):
            break
        step, before = left / bends, left
        unsolved -= step * left
        for e in range(rows):
            j = joints.open_row[e]
            joints.push[j] = add_scaled(joints.push[j], direction[j], step)
            rest[j] = add_scaled(rest[j], each_times(zero, joints.inverse[j], changed[j]), -step)
        left = changes_of(state, rows, rest)
        for e in range(rows):
            j = joints.open_row[e]
            direction[j] = add_scaled(rest[j], direction[j], left / before)
            changed[j] = add_scaled(change_of_row(state, j), changed[j], left / before)
    strike(state, rows, touch, impulse, friction)
    push_rows(state, rows, joints.push)


@part
def without_pulling(state, rows):
    """The same rows without limits that would pull; returns how many."""
    joints, kept = state.solver.joints, 0
    for e in range(rows):
        j = joints.open_row[e]
        if joints.rule[j] != LIMIT or item(joints.push[j], 0) * joints.load[j] >= 0.0:
            joints.open_row[kept] = j
            kept += 1
    return kept


@part
def parted_by(state, touch):
    """The change of the velocity of b's point as that of a sees it, by what the bodies have gained."""
    (a, b), arms, _ = touch
    impacts, a, b = state.impacts, owner_of(state, a), owner_of(state, b)
    v_a = add(impacts.gained[a], cross_spin(impacts.gained_spin[a], arms[0]))
    return sub(add(impacts.gained[b], cross_spin(impacts.gained_spin[b], arms[1])), v_a)


@part
def rows_that_answer(state, touch):
    """(how many rows answer an impulse along the normal, what 1 N s of it changes of the velocity between the points);
    none if joints would let nothing move: then the two part as if they were free, and joints take that back."""
    (a, b), _, normal = touch
    rows, nothing = list_answering(state, a, b), zero_of(state)
    while True:
        answer(state, rows, touch, 1.0, nothing, TAKE_NOTHING)
        kept = without_pulling(state, rows)
        if kept == rows:
            break
        rows = kept
    parted = parted_by(state, touch)
    strike(state, rows, touch, 1.0, nothing)
    if dot(parted, normal) > HELD * dot(parted_by(state, touch), normal):
        return rows, parted
    return 0, parted_by(state, touch)
