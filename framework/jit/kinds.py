"""Kinds: what compiled functions get and give, in terms that need no compiler.

A function that is called through its address has a :class:`Signature`: ``INT(state, INT, FLOAT)`` gives an integer. Its
name in a library (:mod:`names`) is made of these, and numba's types are, where something has to compile.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

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
class Signature:
    """What a function gives and what it gets."""

    result: Kind
    arguments: tuple[Kind, ...]

    def __str__(self) -> str:
        return f"{self.result}({', '.join(map(str, self.arguments))})"


INT, FLOAT, BOOL = Kind("int64"), Kind("float64"), Kind("bool")


def tuple_of(*kinds: Kind) -> TupleKind:
    """A tuple of these."""
    return TupleKind(f"({','.join(map(str, kinds))})", kinds)


def floats(count: int) -> TupleKind:
    """A tuple of so many floats; d of them are a vector."""
    return tuple_of(*(FLOAT,) * count)


def record_kind(schema: Schema, dimensions: int) -> RecordKind:
    """A record of that schema."""
    checked = ",checked" if CHECKED else ""
    return RecordKind(f"{schema.name}{dimensions}D({schema.digest}{checked})", schema, dimensions)
