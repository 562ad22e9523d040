"""Records on the stack: columns of a few rows for the time of one call, as those of records in memory are read and
written. What stands in them is not cleared.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..lazy import JIT, LazyIntrinsic, LazyModule
from .plain_view import PlainView
from .record import make_record
from .schema import Schema

if TYPE_CHECKING:
    from . import record_code
else:
    record_code = LazyModule(f"{__package__}.record_code")


def stack_record(schema: Schema, rows: int) -> Any:
    """The function (zero vector of the world) -> record of an unshared schema that has columns alone, of so many rows.

    Its memory belongs to the function that asks for it, as that of :func:`~..stack_arrays.stack_array` does.
    """

    def plain(zero: Any) -> PlainView:
        record = make_record(schema, len(zero))
        record.reserve(rows, *schema.fields)
        return PlainView(record)

    if not JIT:
        return plain
    return LazyIntrinsic(
        lambda: record_code.stack_record_of(schema, rows), plain, lambda: f"{rows} rows of {schema.carom_structure}"
    )
