"""Kinds: what compiled functions get and give, in terms that need no compiler.

A function that is called through its address has a :class:`Signature`: ``INT(state, INT, FLOAT)`` gives an integer. Its
name in a library (:mod:`names`) is made of these, and numba's types are, where something has to compile.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .log import CHECKED

if TYPE_CHECKING:
    from .records.schema import Schema


@dataclass(frozen=True)
class Kind:
    """A number; ``name`` as numba has it."""

    name: str

    def __call__(self, *arguments: Kind) -> Signature:
        return Signature(self, arguments)

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True)
class TupleKind(Kind):
    """A tuple of kinds."""

    kinds: tuple[Kind, ...]


@dataclass(frozen=True)
class RecordKind(Kind):
    """A record of a schema in worlds of that many dimensions; its name tells the layout."""

    schema: Schema
    dimensions: int


@dataclass(frozen=True)
class ArrayKind(Kind):
    """An array of numpy with so many axes, of kernels that Python calls."""

    dimensions: int


@dataclass(frozen=True)
class Signature:
    """What a function gives and what it gets."""

    result: Kind
    arguments: tuple[Kind, ...]

    def __str__(self) -> str:
        return f"{self.result}({', '.join(map(str, self.arguments))})"


INT, FLOAT, BOOL, NONE = Kind("int64"), Kind("float64"), Kind("bool"), Kind("none")
NUMBERS: dict[type, Kind] = {int: INT, float: FLOAT, bool: BOOL, np.float64: FLOAT, np.int64: INT, np.bool_: BOOL}


def tuple_of(*kinds: Kind) -> TupleKind:
    """A tuple of these."""
    return TupleKind(f"({','.join(map(str, kinds))})", kinds)


def floats(count: int) -> TupleKind:
    """A tuple of so many floats; d of them are a vector."""
    return tuple_of(*(FLOAT,) * count)


def array_kind(dtype: object, dimensions: int, layout: str, writable: bool) -> ArrayKind:
    """layout: C, F, or A of neither."""
    return ArrayKind(f"array({dtype},{dimensions},{layout},{'' if writable else 'readonly'})", dimensions)


def kind_of(value: object) -> Kind | None:
    """Of an argument; None: none that a kernel out of a library is called with."""
    if isinstance(value, np.ndarray):
        flags = value.flags
        layout = "C" if flags.c_contiguous else "F" if flags.f_contiguous else "A"
        return array_kind(value.dtype, value.ndim, layout, flags.writeable)
    return NUMBERS.get(type(value))


def record_kind(schema: Schema, dimensions: int) -> RecordKind:
    """A record of that schema."""
    checked = ",checked" if CHECKED else ""
    return RecordKind(f"{schema.name}{dimensions}D({schema.digest}{checked})", schema, dimensions)
