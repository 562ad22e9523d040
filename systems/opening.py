"""The stages that open and close a step, whatever systems there are."""

from __future__ import annotations

from ..framework.compilation import part
from ..framework.jit.records.record_type import record_at
from ..framework.vectors import item
from .codes import CHECK_COLUMNS, NEED_SWEEPS, OK, ROTATE
from .records import CHECKED

DISCRETE = 0
NOTHING_TESTED = -1  # in place of a row: no pair has been tested yet
LARGEST = 1.7976931348623157e308  # of all finite numbers

LEAST_TURN = 1e-150  # of a quaternion: below, the squares of its numbers may be 0

_checked_at = record_at(CHECKED, 2)


@part
def all_within(values, low, high):
    """Whether every number is from low to high; nan is not."""
    within = True
    for i in range(len(values)):
        within &= (values[i] >= low) & (values[i] <= high)
    return within


@part
def none_beyond(values, low, high):
    """The same where nan stands for None."""
    beyond = False
    for i in range(len(values)):
        beyond |= (values[i] < low) | (values[i] > high)
    return not beyond


@part
def owned_within(checked):
    """The same for a column of a component that not every body has."""
    owned, values, numbers, within = checked.owned, checked.values, checked.numbers, True
    floats, integers = len(values) // max(1, len(owned)), len(numbers) // max(1, len(owned))
    for i in range(len(owned)):
        for k in range(i * floats, (i + 1) * floats if owned[i] else 0):
            within &= (values[k] >= checked.low) & (values[k] <= checked.high)
        for k in range(i * integers, (i + 1) * integers if owned[i] else 0):
            within &= (numbers[k] >= checked.low) & (numbers[k] <= checked.high)
    return within


@part
def are_quaternions(values, low, high):
    """Whether all of them are, of any length but 0."""
    within = all_within(values, low, high)
    for i in range(0, len(values), 4):
        total = abs(values[i]) + abs(values[i + 1]) + abs(values[i + 2]) + abs(values[i + 3])
        within &= total >= LEAST_TURN
    return within


@part
def is_column_sound(checked):
    """Whether all rows of a column hold what the field allows."""
    if checked.turns:
        return are_quaternions(checked.values, checked.low, checked.high)
    if len(checked.owned) > 0:
        return owned_within(checked)
    if checked.optional:
        return none_beyond(checked.values, checked.low, checked.high)
    if len(checked.numbers) > 0:
        return all_within(checked.numbers, checked.low, checked.high)
    return all_within(checked.values, checked.low, checked.high)


@part
def are_columns_sound(state):
    """Whether everything that the step reads and the game may write is what it has to be, but for what moves."""
    sound = True
    for c in range(len(state.checked)):
        sound &= is_column_sound(_checked_at(state.checked[c]))
    return sound


@part
def any_rotation(state):
    """Whether any body is rotated: an angle that is not 0, in 3D a quaternion with a part beside the first."""
    rotation, out, rotated = state.bodies.rotation, state.bodies.quarantined, False
    if len(rotation) == 0:
        return False
    if len(state.gravity[0]) == 2:
        for i in range(state.count):
            rotated |= (rotation[i] != 0.0) & (not out[i])
    else:
        for i in range(state.count):
            turned = (rotation[4 * i + 1] != 0.0) | (rotation[4 * i + 2] != 0.0) | (rotation[4 * i + 3] != 0.0)
            rotated |= turned & (not out[i])
    return rotated


@part
def any_ccd(state):
    """Whether any moving body is swept in a discrete world."""
    ccd, out, found = state.bodies.ccd, state.bodies.quarantined, False
    for i in range(state.moving if len(ccd) > 0 else 0):
        found |= ccd[i] and not out[i]
    return found


def keep_state(state, dt):
    """What a step that fails puts back: columns that the built-in stages overwrite. Nothing is known of this step yet.

    The position is kept in previous_position, by keep_start.
    """
    bodies, pairs, impacts = state.bodies, state.pairs, state.impacts
    state.unforced, state.pushed, state.moved = False, True, False
    state.forces_summed = state.candidates_ready = state.contacts_ready = False
    state.news, state.step_force_kept = 0, False
    pairs.count = pairs.found = pairs.resting_count = pairs.disabled_count = pairs.touching_count = 0
    impacts.logged = impacts.capped = 0
    state.candidates.count = 0
    state.row_a, state.unsound = NOTHING_TESTED, 0
    if not state.others_write:  # else every column is kept
        for i in range(state.count):
            bodies.kept_previous[i] = bodies.previous_position[i]
        for i in range(state.moving):
            bodies.kept_velocity[i] = bodies.linear_velocity[i]
    state.kept = True
    state.warm_start.before, state.contacts.before = state.warm_start.now, state.contacts.now
    return OK


def check_columns(state, dt):
    """What code of the game may have written; Python names what is wrong, and takes these bodies out."""
    if state.quarantining or not are_columns_sound(state):
        return CHECK_COLUMNS
    return OK


def read_bodies(state, dt):
    """1 / mass of what moves freely; whether any speed is limited, any body swept or rotated."""
    bodies, mass, inverse_mass, limited = state.bodies, state.bodies.mass, state.bodies.inverse_mass, False
    limit, out = bodies.max_linear_speed, bodies.quarantined
    for i in range(state.dynamic):
        inverse_mass[i] = 1.0 / mass[i]
    for i in range(state.dynamic if state.quarantining else 0):
        if out[i]:
            inverse_mass[i] = 0.0
    for i in range(state.dynamic if len(limit) > 0 else 0):
        limited |= (limit[i] == limit[i]) & (not out[i])
    for i in range(state.dynamic, state.count):
        inverse_mass[i] = 0.0
    state.limits_speed = limited
    state.sweeping = state.collides and (state.mode != DISCRETE or any_ccd(state))
    if state.sweeping and not state.sweeps_ready:
        return NEED_SWEEPS
    rotated = state.collides and any_rotation(state)
    if rotated or state.rotated or state.rotation_stale:
        return ROTATE
    return OK


def check_finite(state, dt):
    """Whether all positions and velocities of what moves are finite; the step is over."""
    bodies, finite = state.bodies, True
    position, velocity, out = bodies.position, bodies.linear_velocity, bodies.quarantined
    for i in range(state.moving):
        x, v = position[i], velocity[i]
        for k in range(len(x)):
            finite &= (abs(item(x, k)) <= LARGEST) | out[i]
            finite &= (abs(item(v, k)) <= LARGEST) | out[i]
    state.finite = finite
    state.moved = False
    failed = state.unsound != 0  # which Python sees after this stage, and goes back
    state.kept, state.started = state.kept and failed, state.started and failed
    state.motion_version += 1
    state.bodies_counted += state.moving
    return OK
