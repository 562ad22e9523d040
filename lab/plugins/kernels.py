"""Kernels for ``carom plugins check``: a plugin's functions, compiled as in worlds, called for many inputs."""

from __future__ import annotations

import re
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from ...framework.compilation import kernel
from ...framework.jit.linking import Linked
from ...framework.jit.records.record import Record, make_record
from ...framework.jit.records.record_type import record_at
from ...framework.jit.records.schema import Schema, flags, floats, vectors
from ...framework.plugins.registry import Pair, Shape
from ...systems.records import STATE
from ...systems.shapes.linking.linked_pair import LinkedPair, linked_pair
from ...systems.shapes.linking.linked_shape import linked_shape
from ...systems.shapes.linking.linked_shapes import set_support
from ...systems.shapes.linking.parameters import HEADER
from ...systems.shapes.linking.signatures import (
    call_evaluate,
    call_rounding,
    call_support,
    call_sweep,
    evaluate_signature,
    named,
    sweep_signature,
)
from .samples import Rows

# Compiler messages: lines without information, and files outside the plugin.
NOISE = ("Failed in nopython", "- Resolution failure", "During:", ">>>")
FOREIGN = ("numba/", "numba\\", "carom_shapes_")

# Inputs and results of n calls, a row for each.
CALLS = Schema(
    "CheckedCalls",
    d=vectors(),  # from the first shape to the second, or the direction of a support
    v=vectors(),
    hit=flags(),
    depth=floats(),  # or the rounding
    normal=vectors(),
    point=vectors(),  # of contact, or of the support
    time=floats(),
)


class RaisedError(Exception):
    """A compiled function of the plugin raised; ``at`` is the row of its input."""

    def __init__(self, at: int, error: BaseException) -> None:
        super().__init__(f"{type(error).__name__}: {error}")
        self.at = at


class PairCode:
    """The function of a pair for two shapes, in the pair's own order, compiled for one dimension."""

    def __init__(self, pair: Pair, first: Shape, second: Shape, dimensions: int) -> None:
        linked = linked_pair(first, second, pair, dimensions)
        self._functions = UncheckedPair(linked.first, linked.second, linked.pair, dimensions)

    def __call__(self, a: Rows, b: Rows, d: np.ndarray) -> Any:
        """hit, depth, normal and point of each row; RaisedError if the function raises, numba's errors if it does not
        compile."""
        return _run(0, d, self._functions.evaluate.address, *self._parameters(a, b))

    def sweep(self, a: Rows, b: Rows, d: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(hit, time) of the pair's sweep function."""
        assert self._functions.sweep is not None
        calls = _run(1, d, self._functions.sweep.address, *self._parameters(a, b), v=v)
        return calls.hit, calls.time

    def _parameters(self, a: Rows, b: Rows) -> tuple[Record, Record]:
        one, two = a.parameters(), b.parameters()
        for rows, record, shape in ((a, one, self._functions.first), (b, two, self._functions.second)):
            if shape is None:  # the pair calls its support by address
                set_support(record, linked_shape(rows.shape, record.dimensions))
        return one, two


class UncheckedPair(LinkedPair):
    """The linked functions of a pair, which return what the plugin's functions return, valid or not."""

    @cached_property
    def evaluate(self) -> Linked:
        contact, (at_a, at_b) = self._contact, self._records

        def evaluate(state, pa, a, pb, b, d):
            state.row_a = a
            return contact(at_a(pa), a, at_b(pb), b, d)

        return Linked(named(evaluate), evaluate_signature(self.dimensions))

    @cached_property
    def sweep(self) -> Linked | None:
        if self.pair.sweep is None:
            return None
        swept, (at_a, at_b) = self._registered("swept", self.pair.sweep, "d, v"), self._records

        def sweep(state, pa, a, pb, b, d, v):
            state.row_a = a
            return swept(at_a(pa), a, at_b(pb), b, d, v)

        return Linked(named(sweep), sweep_signature(self.dimensions))


class SupportCode:
    """The support function of a shape and its rounding, compiled for one dimension."""

    def __init__(self, shape: Shape, dimensions: int) -> None:
        self._functions = linked_shape(shape, dimensions)

    def __call__(self, rows: Rows, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(points (n, d), rounding (n,)) of the rows in one direction each."""
        record = rows.parameters()
        set_support(record, self._functions)
        calls = _run(2, direction, 0, record, record)
        return calls.point, calls.depth


def compiler_message(error: BaseException) -> str:
    """The essence of numba's message: what it could not compile, and the line of the plugin's file."""
    lines = [line.strip() for line in str(error).splitlines()]
    gist = next((line for line in lines if line and not line.startswith(NOISE)), type(error).__name__)
    call = next((line for line in lines if line.startswith(">>>")), "")
    place = ""
    for at, line in enumerate(lines):
        found = re.fullmatch(r'File "([^"<]+)", line (\d+):', line)
        if found and not any(part in found[1] for part in FOREIGN):
            code = lines[at + 1 : lines.index("^", at)] if "^" in lines[at:] else []
            place = f" ({Path(found[1]).name}, line {found[2]}{f': {code[-1]}' if code else ''})"
            break
    words = gist.split(" found for signature")[0] if call else gist
    return f"{words}{f': {call[4:]}' if call else ''}{place}"


def _run(which: int, d: np.ndarray, function: int, one: Record, two: Record, v: np.ndarray | None = None) -> Record:
    """Call the function at that address once per row of d; which: of :func:`_kernels`. Returns a record of CALLS."""
    (n, dimensions), calls = d.shape, make_record(CALLS, d.shape[1])
    calls.d, calls.v = np.ascontiguousarray(d), np.ascontiguousarray(d if v is None else v)
    calls.hit, calls.depth, calls.time = np.zeros(n, bool), np.zeros(n), np.zeros(n)
    calls.normal, calls.point = np.zeros((n, dimensions)), np.zeros((n, dimensions))
    state = make_record(STATE, dimensions)
    state.row_a = -1
    try:
        _kernels(dimensions)[which](state.address, calls.address, function, one.address, two.address)
    except Exception as error:  # any error of the plugin; before the first row it is the compiler's
        if state.row_a < 0:
            raise
        raise RaisedError(state.row_a, error) from error
    return calls


@lru_cache(maxsize=2)
def _kernels(dimensions: int) -> tuple[Any, Any, Any]:
    """Loops over contacts, sweeps and supports; they compile once, whatever the plugin."""
    state_at, calls_at = record_at(STATE, dimensions), record_at(CALLS, dimensions)
    header_at = record_at(HEADER, dimensions)

    @kernel
    def check_contacts(state_address, address, function, pa, pb):
        state, calls = state_at(state_address), calls_at(address)
        for i in range(len(calls.d)):
            hit, depth, normal, point = call_evaluate(function, state, pa, i, pb, i, calls.d[i])
            calls.hit[i], calls.depth[i], calls.normal[i], calls.point[i] = hit, depth, normal, point

    @kernel
    def check_sweeps(state_address, address, function, pa, pb):
        state, calls = state_at(state_address), calls_at(address)
        for i in range(len(calls.d)):
            hit, time = call_sweep(function, state, pa, i, pb, i, calls.d[i], calls.v[i])
            calls.hit[i], calls.time[i] = hit, time

    @kernel
    def check_supports(state_address, address, function, pa, pb):
        state, calls, shape = state_at(state_address), calls_at(address), header_at(pa)
        for i in range(len(calls.d)):
            state.row_a = i
            calls.point[i] = call_support(shape.support, pa, i, calls.d[i])
            calls.depth[i] = call_rounding(shape.rounding, pa, i)

    return check_contacts, check_sweeps, check_supports
