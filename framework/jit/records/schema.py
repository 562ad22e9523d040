"""Schemas: the columns and scalars of a record, written once for 2D and 3D.

A schema is a list of named fields. :class:`~carom.framework.jit.records.record.Record` makes the memory for one,
:class:`~carom.framework.jit.records.record_type.RecordType` is what compiled code knows it as.

    BODIES = Schema("Bodies", position=vectors(), inverse_mass=floats(), entity=ints())
    STATE = Schema("State", dt=number(), count=integer(), bodies=BODIES)
"""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

WORD = 8  # bytes: a scalar or the address of another record takes one word, a column two (address, length)


@dataclass(frozen=True)
class Scalar:
    """One number: ``dtype`` is float64, int64 or bool; ``unit`` as of a column."""

    dtype: str
    unit: str = dataclasses.field(default="", repr=False)
    words = 1


@dataclass(frozen=True)
class Column:
    """An array with one item per row.

    dtype
        of numpy
    item
        ``scalar``; ``vector``, d floats that kernels see as a tuple; ``axes``, d vectors (the columns of a matrix);
        ``table``, ``width`` numbers that are read and written one by one: ``column[row, k]``
    width
        of a table; a multiple of d if ``per_dimension``
    stacked
        several arrays of the same length behind each other, ``column[slot, row]``
    apart
        each component of its vectors is an array of its own, one behind the other, so that a loop over rows reads
        several of them at once
    flat
        of vectors: how many numbers of one are kept in 2D, the others are 0: what turns there is one number
    default
        of a column on demand: what kernels read in every row, each number of it, while the column has no rows; None:
        it has to have rows
    numbered
        fresh rows hold their own numbers
    unit
        "m", "N s"; "1" of a ratio; empty of counts, flags and what has several units. ``world.plan()`` prints it
    """

    dtype: str = "float64"
    item: str = "scalar"
    width: int = 0
    per_dimension: bool = False
    stacked: bool = False
    apart: bool = False
    flat: int = 2
    default: float | None = None
    numbered: bool = False
    unit: str = dataclasses.field(default="", repr=False)  # not in the digest: compiled code does not depend on it
    words = 2

    @property
    def rows_axis(self) -> int:
        """Which axis of its array are the rows; what stands before is several arrays."""
        return 1 if self.stacked or self.apart else 0

    def item_shape(self, dimensions: int) -> tuple[int, ...]:
        """Shape of one row's item in numpy."""
        if self.apart:
            return ()
        if self.item == "vector":
            return (self.numbers(dimensions),)
        if self.item == "axes":
            return (dimensions, dimensions)
        if self.item == "table":
            return (self.width * dimensions if self.per_dimension else self.width,)
        return ()

    def numbers(self, dimensions: int) -> int:
        """How many numbers of a vector are kept."""
        return self.flat if dimensions == 2 else dimensions

    def fresh(self, rows: tuple[int, ...], dimensions: int) -> np.ndarray:
        """An array for that many rows, of what is stacked (stacks, rows)."""
        if self.numbered:
            return np.arange(rows[0], dtype=self.dtype)
        return np.zeros((*rows, *self.item_shape(dimensions)), self.dtype)

    def full(self, rows: int, dimensions: int) -> np.ndarray:
        """An array for that many rows, which hold the default, without one 0."""
        return np.full((rows, *self.item_shape(dimensions)), self.default or 0, self.dtype)


class Section:
    """Some fields of a schema whose columns are there for one reason and grow together; iterates over their names.

    of, group, why
        for ``world.plan()``: what one of their rows is, what uses them, and why there are any; empty: not shown
    """

    def __init__(self, of: str = "", group: str = "", why: str = "", /, **fields: Field) -> None:
        self.of, self.group, self.why, self.fields = of, group, why, fields

    def __iter__(self) -> Iterator[str]:
        return (name for name, field in self.fields.items() if isinstance(field, Column))


class Schema:
    """Named fields in a fixed order; a field may be another schema: the address of a record of it.

    unshared
        its columns share no memory with each other nor with another record: kernels may work on several rows at once
    """

    def __init__(self, name: str, *sections: Section, unshared: bool = False, **fields: Field) -> None:
        self.name, self.sections, self.unshared = name, sections, unshared
        self.fields = {**{name: field for section in sections for name, field in section.fields.items()}, **fields}

    @cached_property
    def layout(self) -> dict[str, int]:
        """Byte offset of each field."""
        offsets, at = {}, 0
        for name, field in self.fields.items():
            offsets[name] = at
            at += WORD * (1 if isinstance(field, Schema) else field.words)
        return offsets

    @cached_property
    def size(self) -> int:
        """Bytes of a record."""
        return sum(WORD * (1 if isinstance(field, Schema) else field.words) for field in self.fields.values())

    @property
    def carom_structure(self) -> str:
        """For names and hashes of what is made for it."""
        return f"{self.name}({self.digest})"

    carom_depends_on = carom_structure

    @cached_property
    def digest(self) -> str:
        """Changes whenever compiled code has to: the hash of all fields, those of inner records included."""
        parts = [(name, f.digest if isinstance(f, Schema) else repr(f)) for name, f in self.fields.items()]
        return hashlib.sha256(repr((self.name, self.unshared, parts)).encode()).hexdigest()[:16]


Field: TypeAlias = Scalar | Column | Schema


def number(unit: str = "") -> Scalar:
    """A float."""
    return Scalar("float64", unit)


def integer() -> Scalar:
    """An integer of 64 bits."""
    return Scalar("int64")


def flag() -> Scalar:
    """True or False."""
    return Scalar("bool")


def floats(**options: Any) -> Column:
    """A column of floats."""
    return Column("float64", **options)


def ints(dtype: str = "int64", **options: Any) -> Column:
    """A column of integers."""
    return Column(dtype, **options)


def flags(**options: Any) -> Column:
    """A column of bools."""
    return Column("bool", **options)


def vectors(**options: Any) -> Column:
    """A column of vectors: arrays (n, d) in numpy, tuples of d floats in kernels."""
    return Column("float64", "vector", **options)


def axes() -> Column:
    """A column of rotation matrices (n, d, d); kernels see the body's axes, a tuple of d vectors."""
    return Column("float64", "axes", unit="1")


def table(dtype: str, width: int, per_dimension: bool = False, unit: str = "") -> Column:
    """A column of ``width`` numbers per row, times d if ``per_dimension``."""
    return Column(dtype, "table", width, per_dimension, unit=unit)
