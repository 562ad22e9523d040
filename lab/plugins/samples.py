"""What ``carom plugins check`` tries: numbers that hypothesis draws, and the shapes and poses that come of them.

Each example gives one pose of each of KINDS. 0 is the simplest number; of nothing but zeros come a shape's own samples,
upright and with one centre.
"""

from __future__ import annotations

import collections
import contextlib
import importlib.metadata
import itertools
import math
import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

from ...components import Collider
from ...framework.data.arrays.column import ArrayColumn, hold_arrays
from ...framework.data.columns import REQUIRED, Column
from ...framework.jit.cache import cache_folder
from ...framework.jit.records.record import Record
from ...framework.plugins.checks import shown
from ...framework.plugins.laws import size_of
from ...framework.plugins.registry import Shape
from ...systems.shapes.linking.linked_shape import half_extents_of
from ...systems.shapes.linking.parameters import bind, make_parameter_record
from ...systems.shapes.quaternions import axes_of
from ..cli.usage_errors import Problem

MISSING = "hypothesis is missing; it comes with the extra: pip install 'carom[check]'"
EXAMPLES = 400
WIDTH = 56  # numbers of an example; what needs more gets the first ones again
UPRIGHT = np.array((1.0, 0.0, 0.0, 0.0))  # the quaternion
NEAR = 4  # places of the second shape, of an example
# Kinds of poses: (size of a, size of b, in m, their distance); the first come first.
KINDS = (
    *[(1.0, 1.0, "near")] * NEAR, (1.0, 1.0, "axes"), (1.0, 1.0, "coincident"), (1.0, 1.0, "close"), (1.0, 1.0, "far"),
    (1e-9, 1e-9, "near"), (1e9, 1e9, "near"), (1e6, 1e-6, "near"), (1e-6, 1e6, "near"),
)  # fmt: skip


def simplest(is_wanted: Callable[[np.ndarray], Any]) -> np.ndarray | None:
    """The simplest example (1, WIDTH) that is wanted, of EXAMPLES that are the same in every process; None if none is.

    Two bytes a number: hypothesis draws an example of bytes in a tenth of the time of one of floats.
    """
    hypothesis = importlib.import_module("hypothesis")
    hypothesis.configuration.set_hypothesis_home_dir(_folder())  # and no folder where one stands
    settings = hypothesis.settings(max_examples=EXAMPLES, derandomize=True, database=None, deadline=None)
    examples = hypothesis.strategies.binary(min_size=2 * WIDTH, max_size=2 * WIDTH).map(_numbers_in)
    try:
        return hypothesis.find(examples, is_wanted, settings=settings, random=Random(0))
    except hypothesis.errors.NoSuchExample:
        return None


def _numbers_in(drawn: bytes) -> np.ndarray:
    """(1, WIDTH), from -1 to 1."""
    numbers = np.frombuffer(drawn, ">u2").astype(int)
    return np.where(numbers & 1, -1.0, 1.0)[None] * (numbers >> 1) / 2**15


@lru_cache(maxsize=1)
def all_examples() -> np.ndarray:
    """(EXAMPLES, WIDTH); kept in the cache folder, since to draw them takes as long as to check a small plugin."""
    try:
        version = importlib.metadata.version("hypothesis")
    except ImportError as error:
        raise Problem(MISSING) from error
    file = _folder() / f"examples-{version}-{EXAMPLES}x{WIDTH}.npy"
    with contextlib.suppress(OSError, ValueError, EOFError):
        return np.load(file)
    found: list[np.ndarray] = []
    simplest(found.append)
    with contextlib.suppress(OSError):
        file.parent.mkdir(exist_ok=True)
        np.save(unfinished := file.with_name(f"{os.getpid()}-{file.name}"), np.concatenate(found))
        unfinished.replace(file)
    return np.concatenate(found)


def _folder() -> Path:
    return Path(cache_folder() or ".") / "hypothesis"


class Numbers:
    """Gives out the columns of examples (n, WIDTH), one after the other."""

    def __init__(self, examples: np.ndarray) -> None:
        self._columns = itertools.cycle(examples.T)

    def __call__(self, *shape: int) -> np.ndarray:
        """(n, *shape)"""
        found = [next(self._columns) for _ in range(math.prod(shape))]
        return np.stack(found, axis=-1).reshape(-1, *shape)

    def directions(self, dimensions: int) -> np.ndarray:
        """(n, dimensions) of length 1."""
        vectors = self(dimensions)
        vectors[~vectors.any(axis=1), 0] = 1.0
        return vectors / np.sqrt((vectors * vectors).sum(axis=1, keepdims=True))


@dataclass(eq=False)
class Rows:
    """Parameters of n colliders of one shape, as kernels take them, with the half extents of their boxes."""

    shape: Shape
    arrays: dict[str, np.ndarray]
    axes: np.ndarray
    half: np.ndarray

    def __post_init__(self) -> None:
        hold_arrays(self, self.shape.component.columns.values())

    def numbers_in(self, pool: Any) -> list[np.ndarray]:
        """The numbers of arrays in it; those of other pools do no harm."""
        return [array for array in self.arrays.values() if array.dtype == np.int64]

    def parameters(self) -> Record:
        """The record through which linked functions see them."""
        record = make_parameter_record(self.shape, self.axes.shape[-1])
        bind(record, self.shape, self.arrays, self.axes)
        return record

    def at(self, row: int) -> Any:
        """The parameters of one row, as passed to a plain Python function."""
        values: dict[str, Any] = {}
        for name in self.shape.columns:
            column, value = self.shape.component.columns[name], self.arrays[name][row]
            if isinstance(column, ArrayColumn):
                values[name] = column.shown(value)
            else:
                values[name] = tuple(value) if column.item == "vector" else value
        if self.shape.rotates:
            values["axes"] = tuple(tuple(axis) for axis in self.axes[row].T)
        return collections.namedtuple(self.shape.component.__name__, values)(**values)

    def shown(self, row: int) -> str:
        return shown(self.at(row))


def rows(shape: Shape, scale: np.ndarray, dimensions: int, numbers: Numbers) -> Rows:
    """Colliders of that shape with lengths around ``scale`` (n,), a quarter of them upright."""
    component: Any = shape.component
    sample, common = component.sample(), scale * 10.0 ** numbers()
    own_sample = component.sample.__func__ is not Collider.sample.__func__  # its numbers depend on each other
    with contextlib.ExitStack() as made:
        for column in component.columns.values():  # the rows hold the arrays as soon as they are there
            if isinstance(column, ArrayColumn):
                made.enter_context(column.pool.kept())
        arrays = {}
        for name in shape.columns:
            column, value = component.columns[name], getattr(sample, name)
            if isinstance(column, ArrayColumn):
                arrays[name] = _array_numbers(column, value, common, numbers())
            else:
                arrays[name] = _values(column, value, common, own_sample, dimensions, numbers)
        axes = np.eye(dimensions) * np.ones((len(scale), 1, 1))
        if shape.rotates:
            rotation = np.pi * numbers() if dimensions == 2 else numbers(4) + UPRIGHT
            turned = np.abs(numbers()) > 0.25
            axes[turned] = axes_of(rotation[turned], dimensions)
        return Rows(shape, arrays, axes, half_extents_of(shape, arrays, axes))


def _values(
    column: Column, value: Any, common: np.ndarray, own_sample: bool, dimensions: int, numbers: Numbers
) -> np.ndarray:
    """Of a field; those that the constructor requires to be positive are lengths, and so are vectors."""
    shape = (len(common), *column.item_shape(dimensions))
    found = np.empty(shape, column.dtype)
    found[...] = column.checked(value)
    drawn, low = numbers(*shape[1:]), column.minimum or 0.0
    is_length = column.dtype is float and (column.default is REQUIRED or column.item == "vector")
    if is_length:
        found *= common.reshape(-1, *[1] * (len(shape) - 1))
    if is_length and not own_sample:
        found = low + np.abs(found) * 10.0 ** (0.5 * drawn)
        other = numbers(*shape[1:])
        if column.item == "vector" and column.minimum is None and not column.positive:
            found[other < 0] *= -1.0
        if not column.positive:  # zero is allowed: a point, a plate
            found[np.abs(other) > 0.97] = low
    elif column.choices and not own_sample:
        found[...] = len(column.choices) * np.abs(drawn)
    elif column.dtype is bool and not own_sample:
        found = drawn < 0
    elif column.dtype is float and not own_sample and (column.positive or column.minimum is not None):
        found = np.where(drawn > 0, low + drawn, found)
    if type(column) is not Column:  # it has its own rules, and the sample's value keeps them
        for row, wanted in enumerate(found.tolist()):
            try:
                found[row] = column.checked(tuple(wanted) if isinstance(wanted, list) else wanted)
            except ValueError:
                found[row] = column.checked(value)
    return found


def _array_numbers(column: ArrayColumn, value: Any, common: np.ndarray, drawn: np.ndarray) -> np.ndarray:
    """The sample's array, scaled and stretched, where the field's own check accepts that."""

    @cache
    def number(size: float, stretch: float) -> int:
        factors = 10.0 ** (size + stretch * np.linspace(-0.5, 0.5, column.width))
        try:
            return column.checked(np.asarray(value) * factors)
        except ValueError:
            return column.checked(value)

    sizes, stretches = np.round(3.0 * np.log10(common)) / 3.0, np.round(2.0 * drawn) / 2.0
    return np.array([number(*each) for each in zip(sizes.tolist(), stretches.tolist(), strict=True)], np.int64)


@dataclass
class Poses:
    """n pairs: a, b, d (n, dimensions) from a's centre to b's; steps and ways of a trial."""

    a: Rows
    b: Rows
    d: np.ndarray
    steps: np.ndarray
    ways: np.ndarray

    def shown(self, row: int) -> str:
        """The input of a pair function, as text."""
        return f"a = {self.a.shown(row)}, b = {self.b.shown(row)}, d = {shown(self.d[row])}"


def poses(first: Shape, second: Shape, dimensions: int, examples: np.ndarray) -> Poses:
    """Pairs of the two shapes, of each example (n, WIDTH) one of each kind: mostly so near that their boxes touch or
    nearly do."""
    kind = np.tile(np.arange(len(KINDS)), len(examples))
    numbers = Numbers(np.repeat(examples, len(KINDS), axis=0))
    size_a, size_b, how = (np.array([each[k] for each in KINDS])[kind] for k in range(3))
    a, b = rows(first, size_a, dimensions, numbers), rows(second, size_b, dimensions, numbers)
    sizes = (size_of(a.half) + size_of(b.half))[:, None]
    reach = sum(np.where(np.isfinite(each.half), each.half, sizes) for each in (a, b))
    near = numbers(NEAR, dimensions)[np.arange(len(kind)), kind % NEAR]
    axis, distance, anywhere = numbers()[:, None], numbers()[:, None], numbers.directions(dimensions)
    along = np.sign(axis) * np.eye(dimensions)[(dimensions * np.abs(axis[:, 0])).astype(int)]
    at = {
        "near": 1.3 * reach * near,
        "axes": reach * along * np.floor(1.0 + 3.0 * np.abs(distance)) / 2.0,
        "coincident": 0.0 * reach,
        "close": 1e-9 * sizes * anywhere,
        "far": 10.0 ** (2.0 + 7.0 * np.abs(distance)) * sizes * anywhere,
    }
    d = np.select([(how == name)[:, None] for name in at], list(at.values()))
    steps = numbers.directions(dimensions) * 10.0 ** (-6.0 * np.abs(numbers()[:, None]))
    ways = (numbers(dimensions) * sizes - d) * (1.75 + 1.25 * numbers()[:, None])
    return Poses(a, b, d, steps, ways)
