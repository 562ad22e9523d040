"""Points and vectors inside kernels: tuples of 2 or 3 floats, so that the dimension is known when a kernel compiles.

One source serves 2D and 3D: a kernel takes ``like``, a tuple of zeros of the world's dimension, and loops over
``range(len(like))``. Each operation is defined by the plain Python function that stands here, which is also what runs
with the JIT off; in compiled code it becomes a few instructions, written out per component, because loops over tuples
take numba and LLVM many times as long to compile.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any

from .compilation import inlined
from .jit.lazy import JIT, LazyIntrinsic, cgutils, operation, types


def _emitted(emit: Callable[..., Any], signature: Callable[..., Any]) -> Callable[[Any], Any]:
    """Replace a plain function by code that ``emit(context, builder, argument types, values)`` writes."""

    def typing(typing_context: Any, *arguments: Any) -> Any:
        made = signature(*arguments)
        if made is None:
            return None

        def codegen(context: Any, builder: Any, sig: Any, values: Any) -> Any:
            return emit(context, builder, sig.args, values)

        return made, codegen

    def decorate(function: Any) -> Any:
        if not JIT:
            return function
        name, count = function.__name__, function.__code__.co_argcount
        return LazyIntrinsic(lambda: operation(name, count, typing), function)

    return decorate


def _vector(value: Any) -> types.UniTuple | None:
    """The vector type for an argument, None if it is no tuple of numbers."""
    if isinstance(value, types.BaseTuple) and value.count in (2, 3):
        return types.UniTuple(types.float64, value.count)
    return None


def _elementwise(operation: Callable[..., Any], vectors: int, scalars: int) -> tuple[Any, Any]:
    """(emit, signature) of an operation on each component of some vectors, with some scalars."""

    def emit(context: Any, builder: Any, arguments: Any, values: Any) -> Any:
        result = values[0]
        for k in range(arguments[0].count):
            parts = [builder.extract_value(value, k) for value in values[:vectors]]
            result = builder.insert_value(result, operation(builder, *parts, *values[vectors:]), k)
        return result

    def signature(*arguments: Any) -> Any:
        kind = _vector(arguments[0])
        if kind is None:
            return None
        return kind(*(kind,) * vectors, *(types.float64,) * scalars)

    return emit, signature


@_emitted(*_elementwise(lambda b, x, y: b.fadd(x, y), 2, 0))
def add(a, b):
    """a + b."""
    return tuple(x + y for x, y in zip(a, b, strict=True))


@_emitted(*_elementwise(lambda b, x, y: b.fsub(x, y), 2, 0))
def sub(a, b):
    """a - b."""
    return tuple(x - y for x, y in zip(a, b, strict=True))


@_emitted(*_elementwise(lambda b, x, s: b.fmul(x, s), 1, 1))
def scale(a, factor):
    """a times a number."""
    return tuple(x * factor for x in a)


@_emitted(*_elementwise(lambda b, x, s: b.fdiv(x, s), 1, 1))
def divided(a, divisor):
    """a divided by a number."""
    return tuple(x / divisor for x in a)


@_emitted(*_elementwise(lambda b, x, y, s: b.fadd(x, b.fmul(s, y)), 2, 1))
def add_scaled(a, b, factor):
    """a + factor * b."""
    return tuple(x + factor * y for x, y in zip(a, b, strict=True))


@_emitted(*_elementwise(lambda b, x: b.fneg(x), 1, 0))
def negative(a):
    """-a."""
    return tuple(-x for x in a)


@_emitted(*_elementwise(lambda b, x, s: b.fadd(x, s), 1, 1))
def shifted(a, by):
    """The sum of each component and a number."""
    return tuple(x + by for x in a)


@_emitted(*_elementwise(lambda b, x, s: s, 1, 1))
def filled(like, value):
    """A vector whose components are all that number."""
    return (value,) * len(like)


def _least(builder: Any, x: Any, y: Any) -> Any:
    return builder.select(builder.fcmp_ordered("<", y, x), y, x)


def _most(builder: Any, x: Any, y: Any) -> Any:
    return builder.select(builder.fcmp_ordered(">", y, x), y, x)


@_emitted(*_elementwise(_least, 2, 0))
def smaller(a, b):
    """The smaller of each two components; that of a where one is nan."""
    return tuple(min(x, y) for x, y in zip(a, b, strict=True))


@_emitted(*_elementwise(_most, 2, 0))
def larger(a, b):
    """The larger of each two components; that of a where one is nan."""
    return tuple(max(x, y) for x, y in zip(a, b, strict=True))


def _magnitude(builder: Any, x: Any) -> Any:
    return builder.call(builder.module.declare_intrinsic("llvm.fabs", [x.type]), [x])


@_emitted(*_elementwise(_magnitude, 1, 0))
def absolute(a):
    """The magnitude of each component."""
    return tuple(abs(x) for x in a)


def _clamp(builder: Any, x: Any, limit: Any) -> Any:
    below = builder.select(builder.fcmp_ordered("<", x, limit), x, limit)
    least = builder.fneg(limit)
    return builder.select(builder.fcmp_ordered(">", below, least), below, least)


@_emitted(*_elementwise(_clamp, 2, 0))
def clamped(a, limits):
    """Each component of a, from minus to plus that of the limits."""
    return tuple(max(-limit, min(limit, x)) for x, limit in zip(a, limits, strict=True))


def _folded(each: Callable[..., Any], join: Callable[..., Any], result: str = "float64") -> tuple[Any, Any]:
    """(emit, signature) of one number made of what ``each`` gives for the components of some vectors."""

    def emit(context: Any, builder: Any, arguments: Any, values: Any) -> Any:
        found = [
            each(builder, *(builder.extract_value(value, k) for value in values)) for k in range(arguments[0].count)
        ]
        return functools.reduce(functools.partial(join, builder), found)

    def signature(*arguments: Any) -> Any:
        kind = _vector(arguments[0])
        return None if kind is None else getattr(types, result)(*(kind,) * len(arguments))

    return emit, signature


@_emitted(*_folded(lambda b, x, y: b.fmul(x, y), lambda b, x, y: b.fadd(x, y)))
def dot(a, b):
    """Scalar product."""
    total = a[0] * b[0]
    for x, y in zip(a[1:], b[1:], strict=True):
        total += x * y
    return total


@_emitted(*_folded(lambda b, x: x, _least))
def smallest(a):
    """The smallest component."""
    return min(a)


@_emitted(*_folded(lambda b, x: x, _most))
def largest(a):
    """The largest component."""
    return max(a)


@_emitted(*_folded(lambda b, x, y: b.fcmp_ordered("<=", x, y), lambda b, x, y: b.and_(x, y), "boolean"))
def at_most(a, b):
    """Whether each component of a is at most that of b; not if one is nan."""
    return all(x <= y for x, y in zip(a, b, strict=True))


def _in_memory(builder: Any, vector: Any, index: Any) -> tuple[Any, Any]:
    """The vector on the stack, and the place of one component; LLVM dissolves both once the index is known."""
    memory = cgutils.alloca_once(builder, vector.type)
    builder.store(vector, memory)
    return memory, builder.gep(memory, [index.type(0), index], inbounds=True)


def _emit_item(context: Any, builder: Any, arguments: Any, values: Any) -> Any:
    return builder.load(_in_memory(builder, *values)[1])


def _sign_item(a: Any, k: Any) -> Any:
    kind = _vector(a)
    return None if kind is None else types.float64(kind, types.intp)


@_emitted(_emit_item, _sign_item)
def item(a, k):
    """Component k, which must be in range: unlike ``a[k]`` it is not checked, and compiles much faster."""
    return a[k]


def _emit_replace(context: Any, builder: Any, arguments: Any, values: Any) -> Any:
    memory, place = _in_memory(builder, *values[:2])
    builder.store(values[2], place)
    return builder.load(memory)


def _sign_replace(a: Any, k: Any, value: Any) -> Any:
    kind = _vector(a)
    return None if kind is None else kind(kind, types.intp, types.float64)


@_emitted(_emit_replace, _sign_replace)
def replace(a, k, value):
    """a with component k, which must be in range, set to ``value``."""
    return (*a[:k], value, *a[k + 1 :])


def _places(context: Any, builder: Any, kind: Any, array: Any, index: Any, count: int) -> list[Any]:
    """Addresses of the components of a row of an (n, d) array."""
    made = context.make_array(kind)(context, builder, array)
    columns = [context.get_constant(types.intp, k) for k in range(count)]
    return [cgutils.get_item_pointer(context, builder, kind, made, [index, k]) for k in columns]


def _emit_row(context: Any, builder: Any, arguments: Any, values: Any) -> Any:
    result = values[2]
    for k, place in enumerate(_places(context, builder, arguments[0], values[0], values[1], arguments[2].count)):
        result = builder.insert_value(result, builder.load(place), k)
    return result


def _sign_row(column: Any, index: Any, like: Any) -> Any:
    kind = _vector(like)
    if kind is None or not isinstance(column, types.Array) or column.ndim != 2 or column.dtype != types.float64:
        return None
    return kind(column, types.intp, kind)


@_emitted(_emit_row, _sign_row)
def row(column, index, like):
    """Row ``index`` (not negative) of an (n, d) column as a tuple."""
    return tuple(column[index, k] for k in range(len(like)))


def _emit_store(context: Any, builder: Any, arguments: Any, values: Any) -> Any:
    for k, place in enumerate(_places(context, builder, arguments[0], values[0], values[1], arguments[2].count)):
        builder.store(builder.extract_value(values[2], k), place)
    return context.get_dummy_value()


def _sign_store(column: Any, index: Any, vector: Any) -> Any:
    kind = _vector(vector)
    if kind is None or not isinstance(column, types.Array) or column.ndim != 2 or column.dtype != types.float64:
        return None
    return types.none(column, types.intp, kind)


@_emitted(_emit_store, _sign_store)
def store(column, index, vector):
    """Set row ``index`` (not negative) of an (n, d) column."""
    for k, value in enumerate(vector):
        column[index, k] = value


@inlined
def length(a):
    """Euclidean length; neither overflows above 1e154 nor loses digits below 1e-154; nan of nan."""
    square = dot(a, a)
    if 1e-280 < square < 1e280:
        return math.sqrt(square)
    if math.isnan(square):  # which max passes over
        return square
    most = largest(absolute(a))
    if most == 0.0 or not math.isfinite(most):
        return most
    part = divided(a, most)
    return most * math.sqrt(dot(part, part))


@inlined
def cross(a, b):
    """Vector product, of vectors in space."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@inlined
def components(v):
    """(x, y, z) of a vector in space. In a plane code for that is compiled, but never runs."""
    return item(v, 0), item(v, 1), item(v, len(v) - 1)


@inlined
def triple(like, v):
    """The vector in space, as ``like``, that has these three components."""
    return replace(replace(replace(like, 0, v[0]), 1, v[1]), len(like) - 1, v[2])
