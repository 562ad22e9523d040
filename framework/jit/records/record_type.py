"""Records as modules of kernels name them; what compiled code makes of them is in :mod:`record_code`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..late import JIT, Late
from .plain_view import plain_view_at
from .schema import Schema

if TYPE_CHECKING:
    from .record_code import RecordType


def record_type(schema: Schema, dimensions: int) -> RecordType:
    """The type of that record in compiled code."""
    from .record_code import record_type

    return record_type(schema, dimensions)


def record_at(schema: Schema, dimensions: int) -> Any:
    """The function (address) -> record of that schema in worlds of that many dimensions."""

    def make() -> Any:
        from .record_code import record_at

        return record_at(record_type(schema, dimensions))

    return Late(make) if JIT else plain_view_at


def _make_rows() -> Any:
    from .record_code import compiled_rows

    return compiled_rows.made


def _plain_rows(column: Any, start: int, stop: int) -> Any:
    return column.array[start:stop]


# rows_of(column, start, stop): those rows as a numpy array that shares the column's memory.
rows_of: Any = Late(_make_rows, _plain_rows) if JIT else _plain_rows


def _make_request() -> Any:
    from .record_code import compiled_request

    return compiled_request.made


def _plain_request(column: Any, index: int) -> None:
    return None


# request(column, i): row i of the column will be read soon; the processor may fetch it meanwhile. It never fails.
request: Any = Late(_make_request, _plain_request) if JIT else _plain_request


def _make_zero() -> Any:
    from .record_code import compiled_zero

    return compiled_zero.made


def _plain_zero(record: Any) -> tuple[float, ...]:
    return (0.0,) * record.dimensions


# The zero vector of the world that a record belongs to: a tuple of 2 or 3 floats.
zero_of: Any = Late(_make_zero, _plain_zero) if JIT else _plain_zero
