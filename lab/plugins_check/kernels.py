"""Kernels for ``carom plugins check``: a plugin's functions, compiled as in worlds, called for many inputs."""

from __future__ import annotations

import collections
import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...framework.compilation import inlined, kernel
from ...framework.data.array_columns import array_at
from ...framework.plugins.registry import Pair, Shape
from ...framework.vectors import axes_at, row, store
from ...systems.shapes.dispatch import pair_call, parameters_source, source_module
from .samples import Rows

# Compiler messages: lines without information, and files outside the plugin.
NOISE = ("Failed in nopython", "- Resolution failure", "During:", ">>>")
FOREIGN = ("numba/", "numba\\", "carom_shapes_")


class RaisedError(Exception):
    """A compiled function of the plugin raised; ``at`` is the row of its input."""

    def __init__(self, at: int, error: BaseException) -> None:
        super().__init__(f"{type(error).__name__}: {error}")
        self.at = at


@dataclass
class Results:
    """The results of a pair function, one array per part."""

    hit: np.ndarray
    depth: np.ndarray
    normal: np.ndarray
    point: np.ndarray

    def take(self, rows: np.ndarray) -> Results:
        return Results(self.hit[rows], self.depth[rows], self.normal[rows], self.point[rows])


class PairCode:
    """The function of a pair for two shapes, in the pair's own order, compiled for one dimension."""

    def __init__(self, pair: Pair, first: Shape, second: Shape, dimensions: int) -> None:
        self.pair, self.like = pair, (0.0,) * dimensions
        scope = _scope((first, second))
        one, two = (parameters_source((first, second), index, "at") for index in (0, 1))
        lines = ["def contact(at, d, shapes, like):", f"    return {pair_call(pair, 'pair', scope, one, two, 'd')}", ""]
        if pair.sweep is not None:
            sweep = pair_call(replace(pair, function=pair.sweep), "sweep", scope, one, two, "d, v")
            lines += ["def swept(at, d, v, shapes, like):", f"    return {sweep}", ""]
        title = f'"""{pair.names}, {dimensions}D, to be checked."""'
        module = source_module("\n".join([title, "", *lines]) + "\n", scope)
        self._contact = _contact_kernel(inlined(module.contact))
        self._sweep = _sweep_kernel(inlined(module.swept)) if pair.sweep is not None else None

    def __call__(self, a: Rows, b: Rows, d: np.ndarray) -> Results:
        """RaisedError if the function raises; numba's errors if it does not compile."""
        n, dimensions = d.shape
        made = Results(np.zeros(n, bool), np.zeros(n), np.zeros((n, dimensions)), np.zeros((n, dimensions)))
        at = np.zeros(1, np.int64)
        columns = (a.columns, b.columns)
        _call(self._contact, at, columns, np.ascontiguousarray(d), at, made.hit, made.depth, made.normal, made.point,
              self.like)  # fmt: skip
        return made

    def sweep(self, a: Rows, b: Rows, d: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(hit, time) of the pair's sweep function."""
        hit, time, at = np.zeros(len(d), bool), np.zeros(len(d)), np.zeros(1, np.int64)
        _call(self._sweep, at, (a.columns, b.columns), np.ascontiguousarray(d), v, at, hit, time, self.like)
        return hit, time


class SupportCode:
    """The support function of a shape and its rounding, compiled for one dimension."""

    def __init__(self, shape: Shape, dimensions: int) -> None:
        self.like = (0.0,) * dimensions
        scope = {**_scope((shape,)), "support": shape.support, "rounding": shape.rounding}
        one = parameters_source((shape,), 0, "at")
        title = f'"""Support of {shape.component.__name__}, {dimensions}D, to be checked."""'
        lines = [title, "", "def farthest(at, direction, shapes, like):"]
        lines += [f"    return support({one}, direction), rounding({one})", ""]
        self._farthest = _support_kernel(inlined(source_module("\n".join(lines) + "\n", scope).farthest))

    def __call__(self, rows: Rows, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(points (n, d), rounding (n,)) of the rows in one direction each."""
        points, beyond, at = np.zeros(direction.shape), np.zeros(len(direction)), np.zeros(1, np.int64)
        _call(self._farthest, at, (rows.columns,), np.ascontiguousarray(direction), at, points, beyond, self.like)
        return points, beyond


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


def _scope(shapes: tuple[Shape, ...]) -> dict[str, Any]:
    scope: dict[str, Any] = {"row": row, "array_at": array_at, "axes_at": axes_at}
    for index, shape in enumerate(shapes):
        scope[f"Shape{index}"] = collections.namedtuple(f"Shape{index}", shape.parameters)
    return scope


def _call(compiled: Any, at: np.ndarray, *arguments: Any) -> None:
    at[0] = -1
    try:
        compiled(*arguments)
    except Exception as error:  # raised by the plugin; before the first row, by the compiler
        if at[0] < 0:
            raise
        raise RaisedError(int(at[0]), error) from error


def _contact_kernel(contact: Any) -> Any:
    @kernel
    def check_contacts(shapes, d, at, hit, depth, normal, point, like):
        for i in range(len(d)):
            at[0] = i
            touches, deep, direction, where = contact(i, row(d, i, like), shapes, like)
            hit[i] = touches
            depth[i] = deep
            store(normal, i, direction)
            store(point, i, where)

    return check_contacts


def _sweep_kernel(swept: Any) -> Any:
    @kernel
    def check_sweeps(shapes, d, v, at, hit, time, like):
        for i in range(len(d)):
            at[0] = i
            touches, when = swept(i, row(d, i, like), row(v, i, like), shapes, like)
            hit[i] = touches
            time[i] = when

    return check_sweeps


def _support_kernel(farthest: Any) -> Any:
    @kernel
    def check_supports(shapes, directions, at, points, beyond, like):
        for i in range(len(directions)):
            at[0] = i
            place, radius = farthest(i, row(directions, i, like), shapes, like)
            store(points, i, place)
            beyond[i] = radius

    return check_supports
