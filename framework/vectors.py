"""Points and vectors inside kernels: tuples of 2 or 3 floats, so that the dimension is known when a kernel compiles.

One source serves 2D and 3D: a kernel takes ``like``, a tuple of zeros of the world's dimension, and loops over
``range(len(like))``; the loops unroll completely.
"""

from __future__ import annotations

import math

from numba.cpython.unsafe.tuple import tuple_setitem

from .compilation import inlined


@inlined
def row(column, index, like):
    """Row ``index`` of an (n, d) column as a tuple."""
    result = like
    for k in range(len(like)):
        result = tuple_setitem(result, k, column[index, k])
    return result


@inlined
def store(column, index, vector):
    for k in range(len(vector)):
        column[index, k] = vector[k]


@inlined
def replace(vector, k, value):
    """``vector`` with component ``k`` set to ``value``."""
    return tuple_setitem(vector, k, value)


@inlined
def add(a, b):
    result = a
    for k in range(len(a)):
        result = tuple_setitem(result, k, a[k] + b[k])
    return result


@inlined
def sub(a, b):
    result = a
    for k in range(len(a)):
        result = tuple_setitem(result, k, a[k] - b[k])
    return result


@inlined
def scale(a, factor):
    result = a
    for k in range(len(a)):
        result = tuple_setitem(result, k, a[k] * factor)
    return result


@inlined
def add_scaled(a, b, factor):
    """a + factor * b."""
    result = a
    for k in range(len(a)):
        result = tuple_setitem(result, k, a[k] + factor * b[k])
    return result


@inlined
def negative(a):
    result = a
    for k in range(len(a)):
        result = tuple_setitem(result, k, -a[k])
    return result


@inlined
def dot(a, b):
    total = a[0] * b[0]
    for k in range(1, len(a)):
        total += a[k] * b[k]
    return total


@inlined
def divided(a, divisor):
    result = a
    for k in range(len(a)):
        result = tuple_setitem(result, k, a[k] / divisor)
    return result


@inlined
def length(a):
    """Euclidean length; neither overflows above 1e154 nor loses digits below 1e-154."""
    square = dot(a, a)
    if 1e-280 < square < 1e280:
        return math.sqrt(square)
    largest = 0.0
    for k in range(len(a)):
        largest = max(largest, abs(a[k]))
    if largest == 0.0 or not math.isfinite(largest):
        return largest
    square = 0.0
    for k in range(len(a)):
        part = a[k] / largest
        square += part * part
    return largest * math.sqrt(square)
