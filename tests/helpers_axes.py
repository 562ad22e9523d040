"""Rotation matrices as the functions of shapes get them: tuples of vectors."""

from __future__ import annotations

from carom.framework.jit.lazy import cgutils, types
from carom.framework.vectors import _emitted, _vector


def _emit_axes(context, builder, arguments, values):
    count = arguments[2].count
    made = context.make_array(arguments[0])(context, builder, values[0])
    places = [context.get_constant(types.intp, k) for k in range(count)]
    kind = types.UniTuple(arguments[2], count)
    result = cgutils.get_null_value(context.get_value_type(kind))
    for j in range(count):
        axis = values[2]
        for k in range(count):
            place = cgutils.get_item_pointer(context, builder, arguments[0], made, [values[1], places[k], places[j]])
            axis = builder.insert_value(axis, builder.load(place), k)
        result = builder.insert_value(result, axis, j)
    return result


def _sign_axes(axes, index, like):
    kind = _vector(like)
    if kind is None or not isinstance(axes, types.Array) or axes.ndim != 3 or axes.dtype != types.float64:
        return None
    return types.UniTuple(kind, kind.count)(axes, types.intp, kind)


@_emitted(_emit_axes, _sign_axes)
def axes_at(axes, index, like):
    """The axes of body ``index``, a tuple of vectors: columns of its rotation matrix."""
    d = len(like)
    return tuple(tuple(axes[index, k, j] for k in range(d)) for j in range(d))
