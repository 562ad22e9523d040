"""Records as modules of kernels name them; what compiled code makes of them is in :mod:`record_code`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..kinds import record_kind
from ..lazy import JIT, LazyIntrinsic, LazyModule
from .plain_view import plain_view_at
from .schema import Schema

if TYPE_CHECKING:
    from . import record_code
else:
    record_code = LazyModule(f"{__package__}.record_code")


def record_at(schema: Schema, dimensions: int) -> Any:
    """The function (address) -> record of that schema in worlds of that many dimensions."""
    if not JIT:
        return plain_view_at
    return LazyIntrinsic(
        lambda: record_code.record_at(record_code.record_type(schema, dimensions)),
        label=lambda: str(record_kind(schema, dimensions)),
    )


def _plain_rows(column: Any, start: int, stop: int) -> Any:
    return column.array[start:stop]


# rows_of(column, start, stop): those rows as a numpy array that shares the column's memory.
rows_of: Any = LazyIntrinsic(lambda: record_code.compiled_rows.made, _plain_rows) if JIT else _plain_rows


def _plain_request(column: Any, index: int) -> None:
    return None


# request(column, i): row i of the column will be read soon; the processor may fetch it meanwhile. It never fails.
request: Any = LazyIntrinsic(lambda: record_code.compiled_request.made, _plain_request) if JIT else _plain_request


def _plain_zero(record: Any) -> tuple[float, ...]:
    return (0.0,) * record.dimensions


# The zero vector of the world that a record belongs to: a tuple of 2 or 3 floats.
zero_of: Any = LazyIntrinsic(lambda: record_code.compiled_zero.made, _plain_zero) if JIT else _plain_zero
