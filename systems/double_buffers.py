"""What the records carry from step to step besides the bodies' columns, as snapshots hold it: contacts and impulses.

Both are kept for the last step and the one before (``[now, i]`` and ``[1 - now, i]``); a step reads the former only.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..framework.jit.records.record import Record
from ..framework.jit.records.schema import Column, Section

WARM_START_NUMBERS = ("step", "period")  # numbers of which there are two, beside the counts
CONTACT_NUMBERS = ("steps", "stays")
BEFORE_STEP = ("load", "pull", "normal", "along_a", "value")  # of joints, what a step starts with


def saved_rows(record: Record, numbers: tuple[str, ...]) -> dict[str, Any]:
    """Copies of what the record has of the last step."""
    now, count = record.now, int(record.counts[record.now])
    rows = {name: getattr(record, name)[now, :count].copy() for name in _stacked(record)}
    return {**rows, **{name: getattr(record, name)[now].item() for name in ("counts", *numbers)}}


def put_rows_back(record: Record, rows: Section, saved: dict[str, Any]) -> None:
    """Write them into a record."""
    now, count = record.now, saved["counts"]
    record.reserve(count, *rows)
    for name, value in saved.items():
        if isinstance(value, np.ndarray):
            getattr(record, name)[now, :count] = value
        else:
            getattr(record, name)[now] = value


def put_joints_back(state: Record) -> None:
    """The forces and values that joints had before the step, if it has begun with them."""
    joints = state.solver.joints
    if joints.kept_in == state.step_number + 1:
        for name in BEFORE_STEP:
            getattr(joints, name)[:] = getattr(joints, f"old_{name}")


def _stacked(record: Record) -> list[str]:
    return [name for name, field in record.schema.fields.items() if isinstance(field, Column) and field.stacked]
