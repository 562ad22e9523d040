"""Products of small numpy arrays with the same bits on every platform: numpy leaves ``@``, ``dot`` and the norm of a
vector to BLAS, which sums in another order, and rounds less often, on another processor."""

from __future__ import annotations

import math
from typing import Any

import numpy as np


def matrix_product(a: Any, b: Any) -> np.ndarray:
    """a @ b, of a matrix (m, k) or vector (k,) and a matrix (k, n) or vector (k,), k below 8."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    if b.ndim == 1:
        return (a * b).sum(axis=-1)
    return (a[..., None] * b).sum(axis=-2)


def unit(v: Any) -> np.ndarray:
    """A vector, not 0, divided by its length."""
    v = np.asarray(v, float)
    return v / magnitude(v)


def magnitude(v: Any) -> float:
    """The length of a vector."""
    return math.sqrt(matrix_product(v, v))
