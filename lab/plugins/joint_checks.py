"""Checks of the functions of joints: compiled as in worlds, they say what they say in Python, and what is true."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from ...framework.compilation import kernel
from ...framework.jit.records.record import Record, make_record
from ...framework.jit.records.record_type import record_at
from ...framework.plugins.checks import shown
from ...systems.contacts.solving.records import SOLVER
from ...systems.joints.custom import call_given
from ...systems.joints.linked import linked_joint
from ...systems.joints.own import OwnJoint, Placed, custom_numbers, custom_parameters, rows_of, sample_of
from ...systems.shapes.rotation import axes_of
from .samples import Finding, Subject

PLACES = 1000
TOLERANCE = 1e-9
STEP = 1e-6  # m and rad
RATE = 1e-3  # of the vectors: by so much the change of the value may differ


@lru_cache(maxsize=2)
def _kernel(dimensions: int) -> Any:
    solver_at = record_at(SOLVER, dimensions)

    @kernel
    def ask(solver_address, address, j):
        return call_given(address, solver_at(solver_address), j)

    return ask


def check_joint(subject: Subject, joint: OwnJoint, dimensions: int) -> None:
    """The function of a joint, with bodies at random places."""
    rng = np.random.default_rng((5, dimensions))
    sample, address = sample_of(joint.component, dimensions), linked_joint(joint, dimensions).address
    fields = shown(custom_parameters(sample, dimensions))
    record = _solver(custom_numbers(sample, dimensions), dimensions)
    subject.inputs, rows, differs, wrong = PLACES, (), [], []
    for _ in range(PLACES):
        places = rng.uniform(-3.0, 3.0, (2, dimensions))
        angles = rng.uniform(-3.0, 3.0, 2) if dimensions == 2 else rng.normal(size=(2, 4))
        axes = axes_of(angles, dimensions)
        ways, turns = rng.normal(size=(2, 2, dimensions))
        if dimensions == 2:
            turns[:, 1] = 0.0
        rows = _rows(joint, sample, places, axes)
        ahead = _rows(joint, sample, places + STEP * ways, _turned(axes, STEP * turns))
        behind = _rows(joint, sample, places - STEP * ways, _turned(axes, -STEP * turns))
        example = f"{fields}, positions = {places.tolist()}, axes = {axes.tolist()}"
        for k, row in enumerate(rows):
            numbers = np.array([0.0 if row[0] is None else row[0], *np.ravel(row[1:])])
            record.joints.part[0] = k
            _place(record, places, axes)
            made = _kernel(dimensions)(record.address, address, 0)
            made = np.array([0.0 if row[0] is None else made[0], *np.ravel(made[1:])])
            if not np.allclose(made, numbers, rtol=TOLERANCE, atol=TOLERANCE):
                what = f"row {k}: compiled it returns {made.tolist()}, as plain Python {numbers.tolist()}"
                differs.append((what, example))
            if row[0] is None:
                continue
            along_a, turn_a, along_b, turn_b = numbers[1:].reshape(4, dimensions)
            said = along_a @ ways[0] + turn_a @ turns[0] + along_b @ ways[1] + turn_b @ turns[1]
            true = (ahead[k][0] - behind[k][0]) / (2 * STEP)
            if abs(said - true) > RATE * (1.0 + np.abs(numbers[1:]).sum()):
                wrong.append((f"row {k}: its value changes by {true:.6g}, by its vectors {said:.6g}", example))
    for found, cure in (
        (differs, "use what both know: numbers and tuples, math, carom.framework.vectors; no global that changes"),
        (wrong, "along_a . v_a + turn_a . w_a + along_b . v_b + turn_b . w_b is the change of the value per second; "
                "a push at an arm turns by moment(arm, push)"),
    ):  # fmt: skip
        if found:
            what, example = found[0]
            subject.findings.append(Finding(what, example, cure, f"{len(found)} of {PLACES * len(rows)}"))


def _rows(joint: OwnJoint, sample: Any, places: np.ndarray, axes: np.ndarray) -> tuple[Any, ...]:
    bodies = (Placed(tuple(p), tuple(map(tuple, a.T))) for p, a in zip(places, axes, strict=True))
    with np.errstate(all="ignore"):
        return rows_of(joint.component, sample, *bodies)


def _turned(axes: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """Axes (n, d, d) after small turns."""
    found = axes.copy()
    for matrix, turn in zip(found, turns, strict=True):
        moved = np.cross(turn, matrix.T).T if len(turn) == 3 else turn[0] * np.stack((-matrix[1], matrix[0]))
        matrix += moved
    return found


def _solver(numbers: np.ndarray, dimensions: int) -> Record:
    """A record with one row of a joint between two bodies."""
    record = make_record(SOLVER, dimensions)
    joints = record.joints
    joints.reserve(1, "part", "numbers_at", "first", "second", "base_a", "base_b")
    joints.reserve(dimensions, "axes_a", "axes_b")
    joints.numbers_at[0], joints.first[0], joints.second[0] = 0, 0, 1
    joints.numbers = numbers
    record.reserve(2, "shift", "turn", "sine", "versine")
    record.shift[:], record.turn[:], record.sine[:], record.versine[:] = 0.0, 0.0, 1.0, 0.5
    return record


def _place(record: Record, places: np.ndarray, axes: np.ndarray) -> None:
    joints = record.joints
    joints.base_a[0], joints.base_b[0] = places
    joints.axes_a[:], joints.axes_b[:] = (matrix.T for matrix in axes)
