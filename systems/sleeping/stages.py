"""The stages of sleeping: what has been at rest for long enough, what still is, and what touches these."""

from __future__ import annotations

import math

from ...framework.compilation import inlined, part
from ...framework.jit.records.record_type import zero_of
from ...framework.vectors import dot, item, length, sub
from ..codes import LOOK, OK, WAKE, WAKE_TOUCHED
from ..forces.stages import is_zero
from ..islands import join_roots, root_of
from ..narrow_phase.one_way import is_one_way
from ..parts.rows import has_parts, next_row, owner_of
from ..shapes.tolerances import contact_margin

# Values of ``bodies.sleep_state``. FALLING_ASLEEP: its first step asleep is the next one. Static bodies are ASLEEP.
AWAKE, ASLEEP, FALLING_ASLEEP, WAKING = 0, 1, 2, -1

# Stages without which nothing can sleep, as bits of ``state.sleep_stages``: a game may have replaced their systems.
HAS_RESTING, HAS_LEFT_OUT, HAS_TOUCHED = 1, 2, 4
ALL_BODIES = -1  # in place of the number of those that fall asleep: all wake

REST_TIME = 0.5  # s at rest before sleep,
REST_STEPS = 8  # and at least so many steps
REST_SHARE = 0.25  # of what forces change of the speed in a step: what they move freely is faster after one
REST_ROOM = 0.02  # of the extent: how far it may go in that time
RATTLE_SHARE = 0.9  # the same of what rattles in its place, as one disc of ten thousand does for ever
RATTLE_ROOM = 0.01
REST_SIZES = 0.002  # of the extent, per step: what is faster is not at rest, however strong the forces
UNMOVED_SIZES = 1e-6  # of the extent, per step: what is slower is, without forces and contacts
GOES_ON = 0.5  # of the way at its speed: what goes farther slides and is not held, what rattles or leans is
LOOK_EVERY = 4  # steps; islands need not be joined in each
FIRST_SHARE = 0.05  # of what forces change: they may differ by it when its velocity has become 0
THROW_FACTOR = 3.0  # times the highest speed there is: what an impact may make of a body within the step


@inlined
def is_same_vector(one, other):
    """Whether two vectors have the same numbers; nan is none."""
    equal = True
    for k in range(len(one)):
        equal &= item(one, k) == item(other, k)
    return equal


# -- what sleeps on ----------------------------------------------------------------------------------------------------


@part
def is_pushed_otherwise(state, i, dt):
    """Whether another force acts on a sleeper than in the step before.

    In its first step that force is noted. Its velocity has just become 0, so that what depends on velocities may differ
    a little: force systems, and code of the game. What floats is held by such forces alone.
    """
    bodies, free = state.bodies, state.has_force_systems or state.others_write
    if len(bodies.force) == 0:
        return False
    if bodies.sleep_state[i] == ASLEEP:
        return not is_same_vector(bodies.force[i], bodies.rest_force[i])
    push = length(sub(bodies.force[i], bodies.rest_force[i])) * bodies.inverse_mass[i] * dt
    bodies.rest_force[i] = bodies.force[i]
    unmoved = UNMOVED_SIZES * least_extent(state, i) / dt
    return not push <= (max(FIRST_SHARE * bodies.force_speed_change[i], unmoved) if free else 0.0)


def look_at_sleepers(state, dt):
    """Disturb what other forces act on; Python looks for what code of the game has written in this step."""
    still, disturbed = state.bodies.sleep_state, False
    if state.asleep == 0:
        return OK
    for i in range(state.force_first, state.dynamic):
        if still[i] > AWAKE and is_pushed_otherwise(state, i, dt):
            still[i], disturbed = WAKING, True
    return LOOK if state.others_write or (disturbed and state.first > 0) else OK


@part
def is_lively(state):
    """Whether anything is awake that could meet another."""
    bodies, lively = state.bodies, False
    for i in range(state.first, state.moving):
        lively |= bodies.sleep_state[i] == AWAKE and bodies.shape[i] >= 0
    return lively


def rest_sleepers(state, dt):
    """Where some are disturbed all have flown: what sleeps on is back where it rests, without speed."""
    bodies, still, zero, disturbed, fresh = state.bodies, state.bodies.sleep_state, zero_of(state), False, 0
    state.sleep_stages |= HAS_RESTING
    if state.asleep == 0:
        return OK
    for i in range(state.count if state.first == 0 else 0):
        disturbed |= still[i] == WAKING
    if disturbed:
        return WAKE
    for i in range(state.dynamic if state.first == 0 else 0):
        if still[i] == AWAKE:
            continue
        if still[i] == FALLING_ASLEEP:
            bodies.flown_position[i], bodies.flown_velocity[i] = bodies.position[i], bodies.linear_velocity[i]
        still[i] = ASLEEP
        bodies.position[i], bodies.linear_velocity[i] = bodies.rest_position[i], zero
        bodies.path_velocity[i] = zero
        if state.path_degree > 1:
            bodies.path_second[i], bodies.path_third[i] = zero, zero
    for i in range(state.moving, state.count if state.first == 0 else 0):
        fresh += still[i] == AWAKE
    for i in range(state.dynamic, state.moving):
        still[i] = ASLEEP if still[i] == FALLING_ASLEEP else still[i]
    state.fresh_statics = fresh
    state.all_still = fresh == 0 and not is_lively(state)
    return OK


# -- pairs -------------------------------------------------------------------------------------------------------------


def leave_out_still(state, dt):
    """Pairs of two bodies that are still are no candidates."""
    candidates, still, kept = state.candidates, state.bodies.sleep_state, 0
    state.sleep_stages |= HAS_LEFT_OUT
    if state.asleep == 0:
        return OK
    first, second = candidates.first, candidates.second
    for c in range(candidates.count):
        a, b = first[c], second[c]
        first[kept], second[kept] = a, b
        kept += still[a] <= AWAKE or still[b] <= AWAKE
    candidates.count = kept
    return OK


def measure_force_changes(state, dt):
    """What forces would change of the speed of sleepers, for the margins of their pairs."""
    bodies = state.bodies
    for i in range(state.dynamic if state.asleep > 0 and state.first == 0 and state.pairs.count > 0 else 0):
        if bodies.sleep_state[i] == ASLEEP:
            bodies.force_speed_change[i] = length(bodies.flown_velocity[i])
    return OK


@part
def highest_speed(state):
    """Of all that moves, before the step or after its flight."""
    bodies, fastest = state.bodies, 0.0
    for i in range(state.first, state.moving):
        u, v = bodies.start_velocity[i], bodies.linear_velocity[i]
        square = max(dot(u, u), dot(v, v))
        if bodies.sleep_state[i] == AWAKE and square > fastest:
            fastest = square
    return math.sqrt(fastest)


@part
def reach_of_next_step(state, dt):
    """How far, at most, what is awake will wake others, if nothing but forces makes it faster."""
    bodies, change = state.bodies, 0.0
    for i in range(state.first, state.dynamic):
        if bodies.sleep_state[i] == AWAKE:
            change = max(change, bodies.force_speed_change[i])
    return THROW_FACTOR * (highest_speed(state) + change) * dt


@inlined
def wakes(state, dt, c, reach):
    """Whether a pair is so near that what is awake wakes the other."""
    return state.pairs.depth[c] >= -contact_margin(state, dt, state.pairs.a[c], state.pairs.b[c]) - reach


def find_touched(state, dt):
    """Wake what an awake body touches, or may touch after impacts in this step."""
    pairs, still, disturbed = state.pairs, state.bodies.sleep_state, False
    state.sleep_stages |= HAS_TOUCHED
    if state.asleep == 0 or pairs.count == 0:
        return OK
    reach = THROW_FACTOR * highest_speed(state) * dt
    for c in range(pairs.count):
        a, b = pairs.a[c], pairs.b[c]
        i, other = (a, b) if still[a] == ASLEEP and a < state.dynamic else (b, a)
        if not (pairs.is_solid[c] and i < state.dynamic and still[i] == ASLEEP and still[other] <= AWAKE):
            continue
        if pairs.near_contact[c] or wakes(state, dt, c, reach if other < state.moving else 0.0):
            still[i], disturbed = WAKING, True
    return WAKE_TOUCHED if disturbed else OK


# -- what falls asleep -------------------------------------------------------------------------------------------------


@inlined
def least_extent(state, i):
    """The smallest extent of the shapes of body i; 0 without any."""
    bodies, extent = state.bodies, state.bodies.min_extent[i]
    k = next_row(state, i) if has_parts(state, i) else -1
    while k >= 0:
        other = bodies.min_extent[k]
        extent = other if extent == 0.0 or 0.0 < other < extent else extent
        k = next_row(state, k)
    return extent


@inlined
def is_unmoved(state, i, dt):
    """Whether a body is slower than UNMOVED_SIZES."""
    v, least = state.bodies.linear_velocity[i], UNMOVED_SIZES * least_extent(state, i) / dt
    return dot(v, v) <= least * least


@part
def goes_on(state, i, dt):
    """Whether a body has gone the way that its velocity leads, at that speed or faster, since its rest began."""
    bodies = state.bodies
    v, way = bodies.linear_velocity[i], sub(bodies.position[i], bodies.rest_position[i])
    return dot(way, v) > GOES_ON * dot(v, v) * (bodies.rest_steps[i] - 1) * dt and not is_unmoved(state, i, dt)


@part
def is_at_rest(state, i, dt):
    """Whether an awake body is slow, or rattles about where its rest began, and nothing has struck it.

    What forces accelerate is too fast after a step, unless contacts hold it. Without forces a body has to stand as good
    as still: what drifts in space is not at rest.
    """
    bodies = state.bodies
    shapeless = bodies.shape[i] < 0 and not has_parts(state, i)
    if bodies.quarantined[i] or shapeless or (state.impacts.logged > 0 and bodies.impact_count[i] > 0):
        return False
    v, extent, forced = bodies.linear_velocity[i], least_extent(state, i), bodies.force_speed_change[i]
    away = length(sub(bodies.position[i], bodies.rest_position[i])) if bodies.rest_steps[i] > 0 else math.inf
    limit = min(REST_SIZES * extent / dt, (RATTLE_SHARE if away <= RATTLE_ROOM * extent else REST_SHARE) * forced)
    slow = dot(v, v) <= limit * limit and (bodies.rest_steps[i] == 0 or away <= REST_ROOM * extent)
    return slow or is_unmoved(state, i, dt)


@part
def count_rest(state, dt, needed):
    """For how many steps each moving body has been at rest; returns whether some body has for long enough: also one
    that cannot be moved, where others sleep."""
    bodies, ripe, last = state.bodies, False, state.moving if state.asleep > 0 else state.dynamic
    for i in range(state.first, state.moving):
        if bodies.sleep_state[i] == AWAKE:
            v, x, before = bodies.linear_velocity[i], bodies.position[i], bodies.previous_position[i]
            rests = is_at_rest(state, i, dt) if i < state.dynamic else is_zero(v) and is_same_vector(x, before)
            bodies.rest_steps[i] = bodies.rest_steps[i] + 1 if rests else 0
            if bodies.rest_steps[i] <= 1:
                bodies.rest_position[i] = bodies.position[i]
            ripe |= bodies.rest_steps[i] >= needed and i < last
    for k in range(state.parts.count if state.has_parts else 0):  # parts rest as their bodies do
        i, body = state.parts.row[k], state.parts.body_row[k]
        if body >= 0 and state.first <= i < state.moving:
            bodies.rest_steps[i], bodies.rest_position[i] = bodies.rest_steps[body], bodies.rest_position[body]
    return ripe


@part
def join_islands(state, dt, needed):
    """Islands of dynamic bodies that are awake, each known by its first row; restless[row] tells which stay awake. What
    would wake each other if one slept is in one island: else they take turns.

    Those do of which a body has not been at rest for long enough, or has nothing that holds it, or slides on and on, or
    stands on something that moves, or that a system disables the contact with.
    """
    bodies, pairs, root, keeps_awake = state.bodies, state.pairs, state.bodies.rest_root, state.bodies.keeps_awake
    still = bodies.sleep_state
    for i in range(state.first, state.dynamic):
        root[i], keeps_awake[i] = i, bodies.rest_steps[i] < needed or not is_unmoved(state, i, dt)
    for c in range(pairs.count):
        a, b = pairs.a[c], pairs.b[c]
        if pairs.is_solid[c] and pairs.near_contact[c]:
            for row in (a, b):
                i = owner_of(state, row)
                if i < state.dynamic and bodies.rest_steps[i] >= needed:
                    keeps_awake[i] = goes_on(state, i, dt)
    for i in range(state.first, state.dynamic if state.has_parts else state.first):
        if owner_of(state, i) != i:
            keeps_awake[i] = False
            join_roots(root, i, owner_of(state, i))
    reach = reach_of_next_step(state, dt)
    for c in range(pairs.count):
        a, b, near = min(pairs.a[c], pairs.b[c]), max(pairs.a[c], pairs.b[c]), pairs.near_contact[c]
        awake = b < state.dynamic and still[a] == AWAKE and still[b] == AWAKE
        if awake and pairs.is_solid[c] and (near or wakes(state, dt, c, reach)):
            join_roots(root, a, b)
        carried = a < state.dynamic and state.dynamic <= b < state.moving and bodies.rest_steps[b] < needed
        if carried and pairs.is_solid[c] and near:
            keeps_awake[a] = True
    joints = state.solver.joints
    for e in range(joints.active):
        a, b = joints.row_a[joints.order[e]], joints.row_b[joints.order[e]]
        low, high = min(a, b), max(a, b)
        if low >= state.first and high < state.dynamic:
            join_roots(root, low, high)
        if state.first <= low < state.dynamic <= high < state.moving and bodies.rest_steps[high] < needed:
            keeps_awake[low] = True
    for c in range(pairs.count if pairs.disabled_count > 0 else 0):
        a, b = pairs.a[c], pairs.b[c]
        if not pairs.disabled[c] or is_one_way(state, a) or is_one_way(state, b):  # of these no system decides
            continue
        for i in (a, b):
            if i < state.dynamic:
                keeps_awake[i] = True
    for i in range(state.first, state.dynamic):
        if keeps_awake[i]:
            keeps_awake[root_of(root, i)] = True


@part
def put_to_sleep(state, i):
    """Row i is still from the next step on, if nothing changes until then."""
    bodies = state.bodies
    bodies.sleep_state[i], bodies.rest_position[i] = FALLING_ASLEEP, bodies.position[i]
    bodies.linear_velocity[i] = zero_of(state)


def update_sleep(state, dt):
    """Count the steps that bodies have been at rest; islands that have been for long enough fall asleep."""
    bodies, due = state.bodies, 0
    if state.unsound != 0:
        return OK
    if not state.moved or state.sleep_stages != HAS_RESTING | HAS_LEFT_OUT | HAS_TOUCHED:
        state.due = ALL_BODIES if state.asleep > 0 else 0
        return OK
    needed = max(REST_STEPS, math.ceil(REST_TIME / dt))
    if not count_rest(state, dt, needed) or state.step_number % LOOK_EVERY != 0:
        return OK
    join_islands(state, dt, needed)
    for i in range(state.first, state.dynamic):
        first = root_of(bodies.rest_root, i)
        if bodies.sleep_state[i] == AWAKE and not bodies.keeps_awake[first]:
            put_to_sleep(state, i)
            bodies.rest_force[i], bodies.island[i] = bodies.force[i], bodies.entity[first]
            due += 1
    for i in range(state.dynamic, state.moving if due > 0 or state.asleep > 0 else state.dynamic):
        if bodies.sleep_state[i] == AWAKE and bodies.rest_steps[i] >= needed:
            put_to_sleep(state, i)
            due += 1
    state.due = due
    return OK
