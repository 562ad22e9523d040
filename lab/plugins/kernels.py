"""Kernels for ``carom plugins check``: a plugin's functions, as worlds link them, called for many inputs."""

from __future__ import annotations

import re
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from ...framework.compilation import kernel
from ...framework.jit.records.record import Record, make_record
from ...framework.jit.records.record_type import record_at
from ...framework.jit.records.schema import Schema, flags, floats, vectors
from ...framework.plugins.laws import Contacts
from ...framework.plugins.registry import Pair, Shape
from ...systems.records import STATE
from ...systems.shapes.linking.linked_pair import linked_pair
from ...systems.shapes.linking.linked_shape import linked_shape
from ...systems.shapes.linking.linked_shapes import set_support
from ...systems.shapes.linking.parameters import HEADER
from ...systems.shapes.linking.signatures import call_evaluate, call_rounding, call_support, call_sweep
from .samples import Rows

# Compiler messages: lines without information, and files outside the plugin.
NOISE = ("Failed in nopython", "- Resolution failure", "During:", ">>>")
FOREIGN = ("numba/", "numba\\", "carom_shapes_")
CONTACT, SWEEP, SUPPORT = range(3)

# Inputs and results of n calls, a row for each.
CALLS = Schema(
    "CheckedCalls",
    d=vectors(),  # from the first shape to the second, or the direction of a support
    v=vectors(),
    hit=flags(),
    depth=floats(),  # or the time of a sweep, or the rounding
    normal=vectors(),
    point=vectors(),  # of contact, or of the support
    unsound=flags(),  # the linked function has put a miss in place of what was no contact
)


class RaisedError(Exception):
    """A compiled function of the plugin raised, for row ``at`` of ``of`` inputs."""

    def __init__(self, at: int, of: int, error: BaseException) -> None:
        super().__init__(f"{type(error).__name__}: {error}")
        self.at, self.texts = at, [str(self)] * of


class PairCode:
    """The function of a pair for two shapes, in the pair's own order, compiled for one dimension."""

    def __init__(self, pair: Pair, first: Shape, second: Shape, dimensions: int) -> None:
        self._linked = linked_pair(first, second, pair, dimensions)

    def __call__(self, a: Rows, b: Rows, d: np.ndarray) -> Contacts:
        """Of each row, NaN for depths of what is no contact; RaisedError if the function raises, numba's errors if it
        does not compile."""
        calls = _run(CONTACT, d, self._linked.evaluate.address, *self._parameters(a, b))
        return Contacts(calls.hit, np.where(calls.unsound, np.nan, calls.depth), calls.normal, calls.point)

    def sweep(self, a: Rows, b: Rows, d: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(hit, time) of the pair's sweep function, NaN for times that are not from 0 to 1."""
        assert self._linked.sweep is not None
        calls = _run(SWEEP, d, self._linked.sweep.address, *self._parameters(a, b), v=v)
        return calls.hit | calls.unsound, np.where(calls.unsound, np.nan, calls.depth)

    def _parameters(self, a: Rows, b: Rows) -> tuple[Record, Record]:
        one, two = a.parameters(), b.parameters()
        for rows, record, shape in ((a, one, self._linked.first), (b, two, self._linked.second)):
            if shape is None:  # the pair calls its support by address
                set_support(record, linked_shape(rows.shape, record.dimensions))
        return one, two


def support_of(rows: Rows, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(points (n, d), rounding (n,)) of the rows in one direction each."""
    record = rows.parameters()
    set_support(record, linked_shape(rows.shape, record.dimensions))
    calls = _run(SUPPORT, direction, 0, record, record)
    return calls.point, calls.depth


def compiler_message(error: BaseException) -> str:
    """The essence of numba's message: what it could not compile, and the line of the plugin's file."""
    lines = [line.strip() for line in str(error).splitlines()]
    gist = next((line for line in lines if line and not line.startswith(NOISE)), type(error).__name__)
    call = next((f": {line[4:]}" for line in lines if line.startswith(">>>")), "")
    files = (re.fullmatch(r'File "([^"<]+)", line (\d+):', line) for line in lines)
    own = [found for found in files if found and not any(part in found[1] for part in FOREIGN)]
    place = f" ({Path(own[0][1]).name}, line {own[0][2]})" if own else ""
    return f"{gist.split(' found for signature')[0] if call else gist}{call}{place}"


def _run(which: int, d: np.ndarray, function: int, one: Record, two: Record, v: np.ndarray | None = None) -> Record:
    """Call the function at that address once per row of d. Returns a record of CALLS."""
    (n, dimensions), calls = d.shape, make_record(CALLS, d.shape[1])
    calls.d, calls.v = np.ascontiguousarray(d), np.ascontiguousarray(d if v is None else v)
    calls.hit, calls.unsound, calls.depth = np.zeros(n, bool), np.zeros(n, bool), np.zeros(n)
    calls.normal, calls.point = np.zeros((n, dimensions)), np.zeros((n, dimensions))
    run, state = _kernel(dimensions)
    state.row_a = -1
    try:
        run(state.address, calls.address, which, function, one.address, two.address)
    except Exception as error:  # any error of the plugin; before the first row it is the compiler's
        if state.row_a < 0:
            raise
        raise RaisedError(state.row_a, n, error) from error
    return calls


@lru_cache(maxsize=2)
def _kernel(dimensions: int) -> tuple[Any, Record]:
    """The loop over contacts, sweeps or supports, which compiles once, whatever the plugin; and a state for it."""
    state_at, calls_at = record_at(STATE, dimensions), record_at(CALLS, dimensions)
    header_at = record_at(HEADER, dimensions)

    @kernel
    def check_rows(state_address, address, which, function, pa, pb):
        state, calls, shape = state_at(state_address), calls_at(address), header_at(pa)
        for i in range(len(calls.d)):
            state.row_a, state.unsound = i, 0
            if which == CONTACT:
                hit, depth, normal, point = call_evaluate(function, state, pa, i, pb, i, calls.d[i])
                calls.hit[i], calls.depth[i], calls.normal[i], calls.point[i] = hit, depth, normal, point
            elif which == SWEEP:
                calls.hit[i], calls.depth[i] = call_sweep(function, state, pa, i, pb, i, calls.d[i], calls.v[i])
            else:
                calls.point[i] = call_support(shape.support, pa, i, calls.d[i])
                calls.depth[i] = call_rounding(shape.rounding, pa, i) if shape.rounding != 0 else 0.0
            calls.unsound[i] = state.unsound != 0

    return check_rows, make_record(STATE, dimensions)
