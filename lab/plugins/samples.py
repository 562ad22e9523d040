"""Random shapes and poses for ``carom plugins check``: ordinary and extreme parameters that the columns accept."""

from __future__ import annotations

import collections
import contextlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...components import Collider
from ...framework.data.arrays.column import ArrayColumn, hold_arrays
from ...framework.data.columns import REQUIRED, Column
from ...framework.jit.records.record import Record
from ...framework.plugins.checks import plain, shown
from ...framework.plugins.registry import Shape
from ...systems.shapes.linking.linked_shape import half_extents_of
from ...systems.shapes.linking.parameters import bind, make_parameter_record
from ...systems.shapes.rotation import axes_of

ORDINARY = 10_000  # poses of a pair
EXTREME = 300  # poses of each other kind below
VARIANTS = 8  # stretched variants of an array
# Kinds of poses: (name, size of a, size of b, distance in units of their sizes), in metres; the first come first.
KINDS = (
    ("ordinary", 1.0, 1.0, "near"), ("along the axes", 1.0, 1.0, "axes"),
    ("coincident centres", 1.0, 1.0, "coincident"), ("centres 1e-9 apart", 1.0, 1.0, "close"),
    ("far apart", 1.0, 1.0, "far"), ("of size 1e-9", 1e-9, 1e-9, "near"), ("of size 1e9", 1e9, 1e9, "near"),
    ("first 1e12 larger", 1e6, 1e-6, "near"), ("second 1e12 larger", 1e-6, 1e6, "near"),
)  # fmt: skip


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

    def take(self, rows: np.ndarray) -> Rows:
        return Rows(self.shape, {n: array[rows] for n, array in self.arrays.items()}, self.axes[rows], self.half[rows])

    def size(self) -> np.ndarray:
        """(n,) the largest finite half extent; 0 if all are infinite."""
        return np.where(np.isfinite(self.half), self.half, 0.0).max(axis=1)


@dataclass
class Poses:
    """n pairs: a, b, d (n, dimensions) from a's centre to b's, and the kind of each."""

    a: Rows
    b: Rows
    d: np.ndarray
    kind: np.ndarray  # (n,) index into KINDS

    def take(self, rows: np.ndarray) -> Poses:
        return Poses(self.a.take(rows), self.b.take(rows), self.d[rows], self.kind[rows])

    def scale(self) -> np.ndarray:
        """(n,) the length that tolerances are relative to: distance plus both sizes."""
        return np.sqrt((self.d * self.d).sum(axis=1)) + self.a.size() + self.b.size()


def poses(first: Shape, second: Shape, dimensions: int, seed: int) -> Poses:
    """Pairs of the two shapes, the same in every run."""
    rng = np.random.default_rng((seed, dimensions))
    counts = [ORDINARY] + [EXTREME] * (len(KINDS) - 1)
    kind = np.repeat(np.arange(len(KINDS)), counts)
    upright = rng.random(len(kind)) < np.where(kind == 0, 0.1, 0.5)
    a = rows(first, np.array([k[1] for k in KINDS])[kind], upright, dimensions, rng)
    b = rows(second, np.array([k[2] for k in KINDS])[kind], upright, dimensions, rng)
    return Poses(a, b, _apart(a, b, kind, rng), kind)


def rows(shape: Shape, scale: np.ndarray, upright: np.ndarray, dimensions: int, rng: np.random.Generator) -> Rows:
    """Colliders of that shape with lengths around ``scale`` (n,); ``upright`` ones are not rotated."""
    pools = [column.pool for column in shape.component.columns.values() if isinstance(column, ArrayColumn)]
    with contextlib.ExitStack() as made:
        for pool in pools:  # the rows hold the arrays as soon as they are there
            made.enter_context(pool.kept())
        return _rows(shape, scale, upright, dimensions, rng)


def _rows(shape: Shape, scale: np.ndarray, upright: np.ndarray, dimensions: int, rng: np.random.Generator) -> Rows:
    count = len(scale)
    own_sample = shape.component.sample.__func__ is not Collider.sample.__func__  # type: ignore[attr-defined]
    sample = shape.component.sample()  # type: ignore[attr-defined]
    common = scale * 10.0 ** rng.uniform(-1, 1, count)
    arrays = {}
    for name in shape.columns:
        column, value = shape.component.columns[name], getattr(sample, name)
        if isinstance(column, ArrayColumn):
            arrays[name] = _array_numbers(column, value, common, rng)
        else:
            arrays[name] = _numbers(column, value, common, own_sample, dimensions, rng)
            if type(column) is not Column:  # it has its own rules
                _keep_rules(column, value, arrays[name])
    axes = np.eye(dimensions) * np.ones((count, 1, 1))  # rotation matrices; their columns are the bodies' axes
    if shape.rotates:
        angles = rng.uniform(-np.pi, np.pi, count) if dimensions == 2 else rng.normal(size=(count, 4))
        axes = axes_of(angles, dimensions)
    axes[upright] = np.eye(dimensions)
    return Rows(shape, arrays, axes, half_extents_of(shape, arrays, axes))


def _numbers(
    column: Column, value: Any, common: np.ndarray, own_sample: bool, dimensions: int, rng: np.random.Generator
) -> np.ndarray:
    """Values of a field; those that the constructor requires to be positive are lengths, and so are vectors."""
    count = len(common)
    shape = (count, *column.item_shape(dimensions))
    stored = np.asarray(column.checked(value))
    result = np.empty(shape, column.dtype)
    result[...] = stored
    if column.dtype is not float:
        if column.choices and not own_sample:
            result[...] = rng.integers(len(column.choices), size=shape)
        elif column.dtype is bool and not own_sample:
            result[...] = rng.random(shape) < 0.5
        return result
    if column.default is REQUIRED or column.item == "vector":
        factor = common.reshape((count,) + (1,) * (len(shape) - 1))
        if own_sample:  # its numbers depend on each other
            return result * factor
        signs = -1.0 if column.minimum is None and not column.positive and column.item == "vector" else 0.0
        low = max(column.minimum or 0.0, 0.0)
        result = low + factor * np.abs(result) * 10.0 ** rng.uniform(-0.5, 0.5, shape)
        if signs:
            result *= rng.choice((-1.0, 1.0), shape)
        if not column.positive:  # zero is allowed: a point, a plate
            result[rng.random(shape) < 0.03] = low
    elif not own_sample and (column.positive or column.minimum is not None):
        other = rng.random(count) < 0.5
        result[other] = (column.minimum or 0.0) + 1.0 - rng.random(int(other.sum()))
    return result


def _keep_rules(column: Column, value: Any, array: np.ndarray) -> None:
    """Store each row as the column would; use the sample's value for rows that it rejects."""
    for row, wanted in enumerate(array.tolist()):
        try:
            array[row] = column.checked(tuple(wanted) if isinstance(wanted, list) else wanted)
        except ValueError:
            array[row] = column.checked(value)


def _array_numbers(column: ArrayColumn, value: Any, common: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The sample's array and stretched variants of it, as far as the field's own check accepts them."""
    factors = np.exp(np.linspace(np.log(common.min()), np.log(common.max()), VARIANTS))
    known = [column.checked(value)]
    scaled = []
    for factor in factors:
        for stretch in (np.ones(column.width), 10.0 ** rng.uniform(-0.5, 0.5, column.width)):
            try:
                scaled.append((factor, column.checked(np.asarray(value) * factor * stretch)))
            except ValueError:
                continue
    if not scaled:
        return np.full(len(common), known[0], np.int64)
    sizes, numbers = np.log([size for size, _ in scaled]), np.array([number for _, number in scaled])
    wanted = np.log(common) + rng.uniform(-0.5, 0.5, len(common))
    order = np.argsort(np.abs(sizes[None, :] - wanted[:, None]), axis=1, kind="stable")
    return numbers[order[np.arange(len(common)), rng.integers(0, min(2, len(scaled)), len(common))]].astype(np.int64)


def directions(count: int, dimensions: int, rng: np.random.Generator) -> np.ndarray:
    """(count, d) uniformly distributed unit vectors."""
    vectors = rng.normal(size=(count, dimensions))
    return vectors / np.sqrt((vectors * vectors).sum(axis=1, keepdims=True))


def _apart(a: Rows, b: Rows, kind: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The position of b relative to a: mostly so near that their boxes touch or nearly do."""
    count, dimensions = len(kind), a.half.shape[1]
    sizes = a.size() + b.size()
    reach = sum(np.where(np.isfinite(each.half), each.half, sizes[:, None]) for each in (a, b))
    d = reach * rng.uniform(-1.3, 1.3, (count, dimensions))
    how = np.array([k[3] for k in KINDS])[kind]
    axis = np.eye(dimensions)[rng.integers(dimensions, size=count)] * rng.choice((-1.0, 1.0), (count, 1))
    d = np.where((how == "axes")[:, None], reach * axis * rng.choice((0.5, 1.0, 1.5), (count, 1)), d)
    d[how == "coincident"] = 0.0
    anywhere = directions(count, dimensions, rng)
    d = np.where((how == "close")[:, None], 1e-9 * sizes[:, None] * anywhere, d)
    return np.where((how == "far")[:, None], 10.0 ** rng.uniform(2, 9, (count, 1)) * sizes[:, None] * anywhere, d)


# -- what is found ---------------------------------------------------------------------------------------


@dataclass
class Finding:
    """One defect: what, an example input, and the cure; ``share``: fraction of the inputs it occurs for."""

    what: str
    example: str
    cure: str
    share: str = ""


@dataclass
class Subject:
    """A checked shape, pair or other function, in one dimension, with its findings."""

    kind: str
    name: str
    dimensions: int | None = None
    inputs: int = 0
    findings: list[Finding] = field(default_factory=list)
    note: str = ""

    @property
    def place(self) -> str:
        return f"{self.kind} {self.name}" + (f", {self.dimensions}D" if self.dimensions else "")

    def found(
        self, bad: np.ndarray, what: str, example: Callable[[int], str], cure: str, *values: np.ndarray
    ) -> None:
        """Record a finding where ``bad`` (n,) is true; ``what`` is formatted with the values of the first such row."""
        at = np.flatnonzero(bad)
        if len(at):
            first = int(at[0])
            of_row = (tuple(value[first].tolist()) if value.ndim > 1 else value[first].item() for value in values)
            self.findings.append(Finding(what.format(*of_row), example(first), cure, f"{len(at)} of {len(bad)}"))


@dataclass
class Report:
    """The findings for one plugin."""

    plugin: str
    subjects: list[Subject] = field(default_factory=list)

    @property
    def findings(self) -> int:
        return sum(len(subject.findings) for subject in self.subjects)

    def subject(self, kind: str, name: str, dimensions: int | None = None) -> Subject:
        made = Subject(kind, name, dimensions)
        self.subjects.append(made)
        return made


def pose_shown(poses: Poses, at: int) -> str:
    """The input of a pair function, as text."""
    d = tuple(poses.d[at].tolist())
    return f"{KINDS[poses.kind[at]][0]}: a = {row_shown(poses.a, at)}, b = {row_shown(poses.b, at)}, d = {d}"


def row_shown(rows: Rows, at: int) -> str:
    parameters = rows.at(at)
    turned = rows.shape.rotates and (rows.axes[at] != np.eye(len(rows.axes[at]))).any()
    axes = f", axes={plain(parameters.axes)!r}" if turned else ""
    return shown(parameters)[:-1].removesuffix(", ") + axes + ")"
