"""The laws of joints, compiled as in worlds: they say what they say in Python, and what is true."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from ...framework.compilation import kernel
from ...framework.jit.records.record import Record, make_record
from ...framework.jit.records.record_type import record_at
from ...framework.plugins.checks import shown
from ...framework.plugins.laws import Law
from ...systems.contacts.solving.records import SOLVER
from ...systems.joints.custom import call_given
from ...systems.joints.own import (
    OwnJoint,
    change_law,
    custom_numbers,
    custom_parameters,
    linked_joint,
    numbers_at,
    sample_of,
)
from ...systems.shapes.quaternions import axes_of
from .samples import UPRIGHT, Numbers

TOLERANCE = 1e-9
ALIKE = "use what both know: numbers and tuples, math, carom.framework.vectors; no global that changes"


@lru_cache(maxsize=2)
def _kernel(dimensions: int) -> tuple[Any, Record]:
    """Calls a joint's function by its address; a record with one row of a joint between two bodies, for it."""
    solver_at, record = record_at(SOLVER, dimensions), make_record(SOLVER, dimensions)

    @kernel
    def ask(solver_address, address, j):
        return call_given(address, solver_at(solver_address), j)

    joints = record.joints
    joints.reserve(1, "part", "numbers_at", "first", "second", "base_a", "base_b")
    joints.reserve(dimensions, "axes_a", "axes_b")
    joints.numbers_at[0], joints.first[0], joints.second[0] = 0, 0, 1
    record.reserve(2, "shift", "turn", "sine", "versine")
    record.shift[:], record.turn[:], record.sine[:], record.versine[:] = 0.0, 0.0, 1.0, 0.5
    return ask, record


def joint_laws_of(joint: OwnJoint, dimensions: int, examples: np.ndarray) -> Any:
    """Laws of a joint between bodies of each example, and the text that shows one of them."""
    n, numbers, sample = len(examples), Numbers(examples), sample_of(joint.component, dimensions)
    places, ways = 3.0 * numbers(2, dimensions), numbers(2, 2, dimensions)
    if dimensions == 2:
        axes, ways[:, 1, :, 1] = axes_of(3.0 * numbers(2).ravel(), 2), 0.0
    else:
        axes = axes_of(numbers(2, 4).reshape(-1, 4) + UPRIGHT, 3)
    axes = axes.reshape(n, 2, dimensions, dimensions)

    def laws() -> Any:
        there = numbers_at(joint.component, sample, places, axes)
        here = _compiled(joint, sample, places, axes, there.shape)
        apart: Any = ~np.isclose(here, there, rtol=TOLERANCE, atol=TOLERANCE, equal_nan=True).all(axis=2)
        row = apart.argmax(axis=1)
        values = row, here[np.arange(n), row], there[np.arange(n), row]
        yield Law(apart.any(axis=1), "row {}: compiled it returns {}, as plain Python {}", ALIKE, values)
        yield change_law(joint.component, sample, places, axes, ways)

    fields = shown(custom_parameters(sample, dimensions))
    return laws(), lambda i: f"{fields}, positions = {places[i].tolist()}, axes = {axes[i].tolist()}"


def _compiled(joint: OwnJoint, sample: Any, places: np.ndarray, axes: np.ndarray, shape: Any) -> np.ndarray:
    """The same numbers, of the linked function."""
    dimensions, address = places.shape[-1], linked_joint(joint, places.shape[-1]).address
    ask, record = _kernel(dimensions)
    joints, found = record.joints, np.empty(shape)
    joints.numbers = custom_numbers(sample, dimensions)
    for i, row in np.ndindex(shape[:2]):
        joints.base_a[0], joints.base_b[0] = places[i]
        joints.axes_a[:], joints.axes_b[:] = axes[i].swapaxes(-1, -2)
        joints.part[0] = row
        value, *vectors = ask(record.address, address, 0)
        found[i, row] = value, *np.ravel(vectors)
    return found
