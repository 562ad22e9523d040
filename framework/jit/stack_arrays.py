"""Small arrays for the time of one call: kernels do not allocate, so these stand on the stack.

The memory belongs to the function that asks for it (after inlining: to the kernel); it may be handed to functions that
are called, never returned. It is not cleared. Asked for in a loop, it is the same memory each time.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..vectors import _emitted
from .lazy import arrayobj, ir, types


def _sign_stack_array(count: Any, like: Any) -> Any:
    like = types.unliteral(like)
    kind = like.dtype if isinstance(like, types.UniTuple) else like
    if not isinstance(count, types.IntegerLiteral) or kind not in (types.float64, types.intp):
        return None
    return types.Array(kind, 2 if isinstance(like, types.UniTuple) else 1, "C")(count, like)


def _emit_stack_array(context: Any, builder: Any, arguments: Any, values: Any) -> Any:
    kind = _sign_stack_array(*arguments).return_type
    shape = [arguments[0].literal_value] + ([arguments[1].count] if kind.ndim == 2 else [])
    item_type = context.get_data_type(kind.dtype)
    item_size = context.get_abi_sizeof(item_type)
    with builder.goto_entry_block():  # cgutils.alloca_once would clear it in each call
        memory = builder.alloca(ir.ArrayType(item_type, int(np.prod(shape))))
    strides = [item_size * shape[1], item_size] if kind.ndim == 2 else [item_size]
    made = context.make_array(kind)(context, builder)
    arrayobj.populate_array(
        made,
        data=builder.bitcast(memory, item_type.as_pointer()),
        shape=[context.get_constant(types.intp, n) for n in shape],
        strides=[context.get_constant(types.intp, n) for n in strides],
        itemsize=context.get_constant(types.intp, item_size),
        meminfo=None,
    )
    return made._getvalue()


@_emitted(_emit_stack_array, _sign_stack_array)
def stack_array(count, like):
    """An array of ``count`` (a constant) values like ``like``: a float, an integer, or a tuple of either, one a row."""
    return np.empty((count, *np.shape(like)), np.asarray(like).dtype)
