"""The stages of sleeping: what has been at rest for long enough, what still is, and what touches these."""

from __future__ import annotations

import math

import numpy as np

from ...framework.compilation import inlined, part
from ...framework.jit.records.record_type import record_at, zero_of
from ...framework.vectors import dot, item, length, sub
from ..broad_phase.active_rows import ALL, add_active
from ..broad_phase.boxes import follow_static_places
from ..codes import OK, WAKE, WAKE_TOUCHED
from ..forces.stages import is_zero
from ..islands import root_of
from ..records import WATCHED
from ..shapes.tolerances import contact_margin

# Values of ``bodies.still``. FALLING: its first step asleep is the next one. What cannot be moved is still, too.
AWAKE, STILL, FALLING, DISTURBED = 0, 1, 2, -1

# Stages without which nothing can sleep, as bits of ``state.sleep_stages``: a game may have replaced their systems.
RESTED, LEFT_OUT, TOUCHED = 1, 2, 4
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
THROW = 3.0  # times the highest speed there is: what an impact may make of a body within the step

_watched_at = record_at(WATCHED, 2)


@inlined
def same(one, other):
    """Whether two vectors have the same numbers; nan is none."""
    equal = True
    for k in range(len(one)):
        equal &= item(one, k) == item(other, k)
    return equal


@inlined
def rotated_bits(word, by):
    """The 64 bits rotated by 1 to 62 places."""
    return (word << by) | ((word >> (64 - by)) & ((np.int64(1) << by) - 1))


@part
def add_to_checksums(watched, checksums, start, stop):
    """The column's share in the prints of rows start..stop-1; none where it holds the default."""
    words, small, width = watched.words, watched.small, watched.width
    for k in range(width):
        by, default = 1 + (watched.turn + 13 * k) % 62, watched.defaults[k]
        for i in range(start, stop if len(words) > 0 else start):
            checksums[i] ^= rotated_bits(words[i * width + k] ^ default, by)
        for i in range(start, stop if len(small) > 0 else start):
            checksums[i] ^= rotated_bits(np.int64(small[i * width + k]) ^ default, by)


@part
def print_rows(state, start, stop):
    """prints[i]: all that is watched of rows start..stop-1, each in one number that changes with any of it."""
    checksums, watching = state.bodies.checksums, state.watching
    for i in range(start, stop):
        checksums[i] = 0
    for q in range(len(watching)):
        add_to_checksums(_watched_at(watching[q]), checksums, start, stop)


def take_checksums(state, dt):
    """The prints of all rows."""
    print_rows(state, 0, state.count)
    return OK


# -- what sleeps on ----------------------------------------------------------------------------------------------------


@part
def sleeps_on(state, i, dt):
    """Whether a sleeper is what it was, and free flight has led where it always does.

    In the first step its flight is noted. Its velocity has just become 0, so that what depends on velocities may differ
    a little: force systems, and code of the game.
    """
    bodies, free = state.bodies, state.has_force_systems or state.others_write
    if not (same(bodies.previous_position[i], bodies.rest_position[i]) and is_zero(bodies.start_velocity[i])):
        return False
    if bodies.checksums[i] != bodies.watched[i]:
        return False
    if bodies.still[i] == FALLING:
        push = length(sub(bodies.force[i], bodies.rest_force[i])) * bodies.inverse_mass[i] * dt
        if not push <= (FIRST_SHARE * bodies.force_speed_change[i] if free else 0.0):
            return False
        bodies.flown_position[i], bodies.flown_velocity[i] = bodies.position[i], bodies.linear_velocity[i]
        return True
    return same(bodies.position[i], bodies.flown_position[i]) and same(
        bodies.linear_velocity[i], bodies.flown_velocity[i]
    )


@part
def stands(state, i):
    """Whether a body that cannot be moved is what it was, where it was."""
    bodies = state.bodies
    at, before = bodies.position[i], bodies.previous_position[i] if i < state.moving else bodies.rest_position[i]
    moves = i < state.moving and not is_zero(bodies.linear_velocity[i])
    at_place = same(at, bodies.rest_position[i]) and same(before, bodies.rest_position[i])
    return at_place and not moves and bodies.checksums[i] == bodies.watched[i]


@part
def find_disturbed(state, dt):
    """Mark the still rows that are not what they were; returns how many there are, with those marked before."""
    still, disturbed = state.bodies.still, 0
    follow_static_places(state)
    stop = state.moving if state.watched_version == state.statics_version else state.count
    state.watched_version = state.statics_version
    print_rows(state, 0, stop)
    for i in range(stop):
        if still[i] > AWAKE:
            stays = sleeps_on(state, i, dt) if i < state.dynamic else stands(state, i)
            if not stays:
                still[i] = DISTURBED
        disturbed += still[i] == DISTURBED
    for i in range(stop, state.count):
        disturbed += still[i] == DISTURBED
    return disturbed


@part
def put_to_rest(state):
    """Sleepers are where they rest, without speed; notes whether anything moves that could meet another."""
    bodies, still, zero, lively, fresh = state.bodies, state.bodies.still, zero_of(state), False, 0
    state.candidates.active_count = 0
    for i in range(state.moving):
        if still[i] == AWAKE:
            lively |= bodies.shape[i] >= 0
            add_active(state, i)
            continue
        still[i] = STILL
        if i < state.dynamic:
            bodies.position[i], bodies.linear_velocity[i] = bodies.rest_position[i], zero
            bodies.path_velocity[i] = zero
            if state.path_degree > 1:
                bodies.path_second[i], bodies.path_third[i] = zero, zero
    for i in range(state.moving, state.count):
        fresh += still[i] == AWAKE
    if fresh > 0:  # sleepers have to look at these
        state.candidates.active_count = ALL
    state.fresh_statics = fresh
    state.all_still = not lively and fresh == 0


def rest_sleepers(state, dt):
    """Compare what is still with what it was, and put sleepers back to where they rest."""
    state.sleep_stages |= RESTED
    if state.asleep == 0:
        return OK
    state.disturbed = find_disturbed(state, dt)
    if state.disturbed > 0:
        return WAKE
    put_to_rest(state)
    return OK


# -- pairs -------------------------------------------------------------------------------------------------------------


def leave_out_still(state, dt):
    """Pairs of two bodies that are still are no candidates."""
    candidates, still, kept = state.candidates, state.bodies.still, 0
    state.sleep_stages |= LEFT_OUT
    if state.asleep == 0:
        return OK
    first, second = candidates.first, candidates.second
    for c in range(candidates.count):
        a, b = first[c], second[c]
        first[kept], second[kept] = a, b
        kept += still[a] <= AWAKE or still[b] <= AWAKE
    candidates.count = kept
    return OK


def weigh_sleepers(state, dt):
    """What forces would change of the speed of sleepers, for the margins of their pairs."""
    bodies = state.bodies
    for i in range(state.dynamic if state.asleep > 0 and state.pairs.count > 0 else 0):
        if bodies.still[i] == STILL:
            bodies.force_speed_change[i] = length(bodies.flown_velocity[i])
    return OK


@part
def highest_speed(state):
    """Of all that moves, before the step or after its flight."""
    bodies, fastest = state.bodies, 0.0
    for i in range(state.moving):
        u, v = bodies.start_velocity[i], bodies.linear_velocity[i]
        square = max(dot(u, u), dot(v, v))
        if bodies.still[i] == AWAKE and square > fastest:
            fastest = square
    return math.sqrt(fastest)


def find_touched(state, dt):
    """Wake what an awake body touches, or may touch after impacts in this step."""
    pairs, still, disturbed = state.pairs, state.bodies.still, 0
    state.sleep_stages |= TOUCHED
    if state.asleep == 0 or pairs.count == 0:
        return OK
    reach = THROW * highest_speed(state) * dt
    for c in range(pairs.count):
        a, b = pairs.a[c], pairs.b[c]
        i, other = (a, b) if still[a] == STILL and a < state.dynamic else (b, a)
        if not (pairs.is_solid[c] and i < state.dynamic and still[i] == STILL and still[other] <= AWAKE):
            continue
        margin = contact_margin(state, dt, a, b) + (reach if other < state.moving else 0.0)
        if pairs.near_contact[c] or pairs.depth[c] >= -margin:
            still[i] = DISTURBED
            disturbed += 1
    state.disturbed = disturbed
    return WAKE_TOUCHED if disturbed > 0 else OK


# -- what falls asleep -------------------------------------------------------------------------------------------------


@inlined
def is_unmoved(state, i, dt):
    """Whether a body stands as good as still."""
    v, least = state.bodies.linear_velocity[i], UNMOVED_SIZES * state.bodies.min_extent[i] / dt
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
    if bodies.quarantined[i] or bodies.shape[i] < 0 or (state.impacts.logged > 0 and bodies.impact_count[i] > 0):
        return False
    v, extent, forced = bodies.linear_velocity[i], bodies.min_extent[i], bodies.force_speed_change[i]
    away = length(sub(bodies.position[i], bodies.rest_position[i])) if bodies.rest_steps[i] > 0 else math.inf
    limit = min(REST_SIZES * extent / dt, (RATTLE_SHARE if away <= RATTLE_ROOM * extent else REST_SHARE) * forced)
    slow = dot(v, v) <= limit * limit and (bodies.rest_steps[i] == 0 or away <= REST_ROOM * extent)
    return slow or is_unmoved(state, i, dt)


@part
def stands_still(state, i):
    """Whether a body that moves by its own velocity alone has none."""
    bodies = state.bodies
    return is_zero(bodies.linear_velocity[i]) and same(bodies.position[i], bodies.previous_position[i])


@part
def count_rest(state, dt, needed):
    """For how many steps each moving body has been at rest; returns whether some body has for long enough: also one
    that cannot be moved, where others sleep."""
    bodies, ripe, last = state.bodies, False, state.moving if state.asleep > 0 else state.dynamic
    for i in range(state.moving):
        if bodies.still[i] == AWAKE:
            rests = is_at_rest(state, i, dt) if i < state.dynamic else stands_still(state, i)
            bodies.rest_steps[i] = bodies.rest_steps[i] + 1 if rests else 0
            if bodies.rest_steps[i] <= 1:
                bodies.rest_position[i] = bodies.position[i]
            ripe |= bodies.rest_steps[i] >= needed and i < last
    return ripe


@part
def join_islands(state, dt, needed):
    """Islands of dynamic bodies that are awake, each known by its first row; restless[row] tells which stay awake.

    Those do of which a body has not been at rest for long enough, or has nothing that holds it, or slides on and on, or
    stands on something that moves, or that a system disables the contact with.
    """
    bodies, pairs, root, keeps_awake = state.bodies, state.pairs, state.bodies.rest_root, state.bodies.keeps_awake
    still = bodies.still
    for i in range(state.dynamic):
        root[i], keeps_awake[i] = i, bodies.rest_steps[i] < needed or not is_unmoved(state, i, dt)
    for c in range(pairs.count):
        a, b = pairs.a[c], pairs.b[c]
        if pairs.is_solid[c] and pairs.near_contact[c]:
            for i in (a, b):
                if i < state.dynamic and bodies.rest_steps[i] >= needed:
                    keeps_awake[i] = goes_on(state, i, dt)
    for c in range(pairs.count):
        a, b = min(pairs.a[c], pairs.b[c]), max(pairs.a[c], pairs.b[c])
        awake = b < state.dynamic and still[a] == AWAKE and still[b] == AWAKE
        if awake and pairs.is_solid[c] and pairs.near_contact[c]:
            one, other = root_of(root, a), root_of(root, b)
            root[max(one, other)] = min(one, other)
    for k in range(pairs.disabled_count):
        for i in (pairs.a[pairs.disabled[k]], pairs.b[pairs.disabled[k]]):
            if i < state.dynamic:
                keeps_awake[i] = True
    for i in range(state.dynamic):
        if keeps_awake[i]:
            keeps_awake[root_of(root, i)] = True
    for c in range(pairs.count):
        a, b = min(pairs.a[c], pairs.b[c]), max(pairs.a[c], pairs.b[c])
        carried = a < state.dynamic and state.dynamic <= b < state.moving
        if carried and pairs.is_solid[c] and pairs.near_contact[c] and bodies.rest_steps[b] < needed:
            keeps_awake[root_of(root, a)] = True


@part
def put_to_sleep(state, i):
    """Row i is still from the next step on, if nothing changes until then."""
    bodies = state.bodies
    bodies.still[i], bodies.watched[i], bodies.rest_position[i] = FALLING, bodies.checksums[i], bodies.position[i]
    bodies.linear_velocity[i] = zero_of(state)


def update_sleep(state, dt):
    """Count the steps that bodies have been at rest; islands that have been for long enough fall asleep."""
    bodies, due = state.bodies, 0
    if state.unsound != 0:
        return OK
    if not state.moved or state.sleep_stages != RESTED | LEFT_OUT | TOUCHED:
        state.due = ALL_BODIES if state.asleep > 0 else 0
        return OK
    needed = max(REST_STEPS, math.ceil(REST_TIME / dt))
    if not count_rest(state, dt, needed) or state.step_number % LOOK_EVERY != 0:
        return OK
    join_islands(state, dt, needed)
    print_rows(state, 0, state.moving)
    for i in range(state.dynamic):
        first = root_of(bodies.rest_root, i)
        if bodies.still[i] == AWAKE and not bodies.keeps_awake[first]:
            put_to_sleep(state, i)
            bodies.rest_force[i], bodies.island[i] = bodies.force[i], bodies.entity[first]
            due += 1
    for i in range(state.dynamic, state.moving if due > 0 or state.asleep > 0 else state.dynamic):
        if bodies.still[i] == AWAKE and bodies.rest_steps[i] >= needed:
            put_to_sleep(state, i)
            due += 1
    state.due = due
    return OK
