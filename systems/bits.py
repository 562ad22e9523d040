"""Bits of integers, in kernels."""

from __future__ import annotations

from typing import Any

from ..framework.jit.lazy import ir, types
from ..framework.vectors import _emitted


def _emit_lowest(context: Any, builder: Any, arguments: Any, values: Any) -> Any:
    return builder.cttz(values[0], ir.Constant(ir.IntType(1), 1))


def _emit_highest(context: Any, builder: Any, arguments: Any, values: Any) -> Any:
    return builder.sub(ir.Constant(ir.IntType(64), 63), builder.ctlz(values[0], ir.Constant(ir.IntType(1), 1)))


def _sign_bit(bits: Any) -> Any:
    return types.int64(types.int64)


@_emitted(_emit_lowest, _sign_bit)
def lowest_bit(bits):
    """The place of the lowest bit that is set; there must be one."""
    return (int(bits) & -int(bits)).bit_length() - 1


@_emitted(_emit_highest, _sign_bit)
def highest_bit(bits):
    """The place of the highest bit that is set; there must be one, and the number is not negative."""
    return int(bits).bit_length() - 1
