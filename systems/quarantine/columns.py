"""The stage that looks at what code of the game may have written: whether all columns that a step reads hold what their
fields allow."""

from __future__ import annotations

from ...framework.compilation import part
from ...framework.jit.records.record_type import record_at
from ..codes import CHECK_COLUMNS, OK
from ..records import CHECKED, DYNAMIC_ROWS, STATIC_ROWS

LEAST_TURN = 1e-150  # of a quaternion: below, the squares of its numbers may be 0

_checked_at = record_at(CHECKED, 2)


@part
def all_within(values, start, stop, low, high):
    """Whether every number is from low to high; nan is not."""
    within = True
    for i in range(start, stop):
        within &= (values[i] >= low) & (values[i] <= high)
    return within


@part
def none_beyond(values, start, stop, low, high):
    """The same where nan stands for None."""
    beyond = False
    for i in range(start, stop):
        beyond |= (values[i] < low) | (values[i] > high)
    return not beyond


@part
def owned_within(checked, start, stop):
    """The same for a column of a component that not every body has."""
    owned, values, numbers, within, width = checked.owned, checked.values, checked.numbers, True, checked.width
    floats, integers = width if len(values) > 0 else 0, width if len(numbers) > 0 else 0
    for i in range(start, stop):
        for k in range(i * floats, (i + 1) * floats if owned[i] else 0):
            within &= (values[k] >= checked.low) & (values[k] <= checked.high)
        for k in range(i * integers, (i + 1) * integers if owned[i] else 0):
            within &= (numbers[k] >= checked.low) & (numbers[k] <= checked.high)
    return within


@part
def are_quaternions(values, start, stop, low, high):
    """Whether all of them are, of any length but 0."""
    within = all_within(values, start, stop, low, high)
    for i in range(start, stop, 4):
        total = abs(values[i]) + abs(values[i + 1]) + abs(values[i + 2]) + abs(values[i + 3])
        within &= total >= LEAST_TURN
    return within


@part
def is_column_sound(state, checked):
    """Whether all rows of a column hold what the field allows; static ones only if they may have changed."""
    first = state.moving if checked.rows == STATIC_ROWS else 0
    last = state.dynamic if checked.rows == DYNAMIC_ROWS else state.moving
    if checked.rows != DYNAMIC_ROWS and (state.read_version != state.statics_version or checked.exposed):
        last = state.count
    start, stop, low, high = first * checked.width, last * checked.width, checked.low, checked.high
    if checked.turns:
        return are_quaternions(checked.values, start, stop, low, high)
    if checked.some:
        return owned_within(checked, first, last)
    if checked.optional:
        return none_beyond(checked.values, start, stop, low, high)
    if len(checked.numbers) > 0:
        return all_within(checked.numbers, start, stop, low, high)
    return all_within(checked.values, start, stop, low, high)


@part
def are_columns_sound(state):
    """Whether everything that the step reads and the game may write is what it has to be, but for what moves."""
    sound = True
    for c in range(len(state.checked)):
        sound &= is_column_sound(state, _checked_at(state.checked[c]))
    return sound


def check_columns(state, dt):
    """What code of the game may have written; Python names what is wrong, and takes these bodies out."""
    if state.quarantining or not are_columns_sound(state):
        return CHECK_COLUMNS
    return OK
