"""Codes: boxes in small integers, all in one number, see :mod:`.uniform_grid`; one against several neighbours at once.

That is LLVM's vectors, which become whatever the processor has. The plain functions say what the compiled ones do.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...framework.compilation import CHECKED, inlined
from ...framework.jit.lazy import cgutils, ir, types
from ...framework.jit.records.record_type import record_code
from ...framework.vectors import _emitted

CODE_BITS = 60


@inlined
def code_bits(d):
    """(bits from one coordinate in a code to the next, the largest integer of a coordinate)."""
    field = CODE_BITS // (2 * d)
    return field, (1 << (field - 1)) - 1


@inlined
def guard_bits(d):
    """The free bit above each coordinate of a code."""
    field, largest = code_bits(d)
    guards = np.int64(0)
    for _ in range(2 * d):
        guards = (guards << field) | (largest + 1)
    return guards


@inlined
def outline_of_code(code, d):
    """What codes are subtracted from to see whether their boxes may overlap that of this code: a guard bit stays above
    each coordinate if they do. Lower corners are compared with upper ones, which are stored from the largest down."""
    field, _ = code_bits(d)
    half, guards = np.int64(field * d), guard_bits(d)
    swapped = (code >> half) | ((code & ((np.int64(1) << half) - 1)) << half)
    return ((guards - (guards >> (field - 1))) - swapped) | guards


def _compared(width: int) -> tuple[Any, Any]:
    """(emit, signature) of a comparison with ``width`` codes."""

    def splat(builder: Any, value: Any) -> Any:
        undefined, index = ir.Constant(ir.VectorType(value.type, width), ir.Undefined), ir.IntType(32)
        first = builder.insert_element(undefined, value, index(0))
        return builder.shuffle_vector(first, undefined, ir.Constant(ir.VectorType(index, width), [0] * width))

    def emit(context: Any, builder: Any, arguments: Any, values: Any) -> Any:
        bits = ir.IntType(64)
        lanes = ir.VectorType(bits, width)
        codes = cgutils.create_struct_proxy(arguments[0])(context, builder, values[0])
        if CHECKED:
            last = builder.add(values[1], bits(width - 1))
            record_code.check(context, builder, arguments[0], last, codes.length)
        place = builder.gep(codes.data, [values[1]], inbounds=True)
        members = builder.load(builder.bitcast(place, lanes.as_pointer()), align=8)
        guards = splat(builder, values[3])
        left = builder.and_(builder.sub(splat(builder, values[2]), members), guards)
        hits = builder.bitcast(builder.icmp_signed("==", left, guards), ir.IntType(width))
        return builder.zext(hits, bits)

    def signature(codes: Any, at: Any, code: Any, guards: Any) -> Any:
        if not isinstance(codes, record_code.ColumnType):
            return None
        return types.int64(codes, types.intp, types.int64, types.int64)

    return emit, signature


@_emitted(*_compared(4))
def four_at(codes, at, code, guards):
    """Bit k is set if all guard bits outlast ``code - codes[at + k]``, k below 4; there must be so many codes."""
    return sum(1 << k for k in range(4) if (int(code) - int(codes[at + k])) & guards == guards)


@_emitted(*_compared(8))
def eight_at(codes, at, code, guards):
    """The same for k below 8."""
    return sum(1 << k for k in range(8) if (int(code) - int(codes[at + k])) & guards == guards)
