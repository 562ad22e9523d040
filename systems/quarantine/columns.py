"""The stage that looks at what code of the game may have written in place: the columns of which it has a view."""

from __future__ import annotations

from ...framework.compilation import part
from ...framework.jit.records.record_type import record_at
from ..codes import CHECK_COLUMNS, OK
from ..records import CHECKED, DYNAMIC_ROWS, STATIC_ROWS

_checked_at = record_at(CHECKED, 2)


@part
def are_allowed(checked, start, stop):
    """Whether the field allows all of these numbers."""
    values, low, high, optional, allowed = checked.values, checked.low, checked.high, checked.optional, True
    for k in range(start, stop):
        allowed &= ((values[k] >= low) & (values[k] <= high)) | (optional & (values[k] != values[k]))
    return allowed


@part
def is_column_sound(state, checked):
    """Whether all rows of a column hold what the field allows, static ones if they may have changed; those of bodies
    without the component do not count."""
    values, owned, width, rows, sound = checked.values, checked.owned, checked.width, checked.rows, True
    start = state.moving if rows == STATIC_ROWS else 0
    stop = state.dynamic if rows == DYNAMIC_ROWS else state.moving
    if rows != DYNAMIC_ROWS and (checked.statics or state.read_version != state.statics_version):
        stop = state.count
    if checked.least == 0.0 and are_allowed(checked, start * width, stop * width):
        return True
    for i in range(start, stop):
        total = 0.0
        for k in range(i * width, (i + 1) * width):
            total += abs(values[k])
        fits = are_allowed(checked, i * width, (i + 1) * width) & (not total < checked.least)
        sound &= fits | (not owned[i])
    return sound


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
