"""Arguments of queries: checked and as the kernels want them. Every message names the argument.

Arrays are copied: a kernel would compile once more for one that is read-only or not contiguous.
"""

from __future__ import annotations

import math
import numbers
import operator
from typing import Any

import numpy as np

NO_ENTITY = -1  # in arrays of entities to leave out


def point(value: Any, name: str, dimensions: int) -> tuple[float, ...]:
    """One point as plain floats: for one point quicker than an array."""
    try:
        made = tuple(map(float, value))
    except (TypeError, ValueError):
        made = ()
    if len(made) != dimensions or not all(map(math.isfinite, made)):
        raise ValueError(f"{name} must be {dimensions} finite numbers, got {value!r}")
    return made


def points(value: Any, name: str, dimensions: int, count: int | None = None) -> np.ndarray:
    """(m, d) finite floats; one point stands for ``count`` of them."""
    try:
        made = np.asarray(value, float)
    except (TypeError, ValueError):
        raise ValueError(f"{name} must be numbers, got {value!r}") from None
    if count is not None and made.shape == (dimensions,):
        made = np.broadcast_to(made, (count, dimensions))
    if made.ndim != 2 or made.shape[1] != dimensions or (count is not None and len(made) != count):
        wanted = "m" if count is None else count
        raise ValueError(f"{name} must have shape ({wanted}, {dimensions}), got {made.shape}")
    if not np.isfinite(made).all():
        bad = ~np.isfinite(made).all(axis=1)
        raise ValueError(f"{name} must be finite, got {made[bad][0].tolist()} in row {int(np.argmax(bad))}")
    return np.array(made, order="C")


def distance(value: Any, name: str, *, endless: bool = False) -> float:
    """A finite number that is not negative; infinity too if ``endless``."""
    if isinstance(value, numbers.Real) and not isinstance(value, bool):
        number = float(value)
        if number >= 0 and (endless or math.isfinite(number)):
            return number
    raise ValueError(f"{name} must be {'' if endless else 'finite and '}not negative, got {value!r}")


def distances(value: Any, name: str, count: int, *, endless: bool = False) -> np.ndarray:
    """(m,) from one number or one per query, checked as :func:`distance` does."""
    try:
        made = np.array(np.broadcast_to(np.asarray(value, float), count))
    except (TypeError, ValueError):
        raise ValueError(f"{name} must be one number or {count}, got {value!r}") from None
    bad = ~(made >= 0) | (False if endless else ~np.isfinite(made))
    if bad.any():
        rule = "not negative" if endless else "finite and not negative"
        raise ValueError(f"{name} must be {rule}, got {made[bad][0]} in row {int(np.argmax(bad))}")
    return made


def mask(value: Any, name: str) -> int:
    """Bits of layers."""
    try:
        bits = operator.index(value)
    except TypeError:
        bits = 1 << 63
    if not -(1 << 63) <= bits < 1 << 63:
        raise ValueError(f"{name} must be an integer of 64 bits, one for each layer, got {value!r}")
    return bits


def excluded(value: Any, name: str, count: int) -> np.ndarray:
    """(m,) ids to leave out, from None, one id, or one for each query (-1: none)."""
    if value is None:
        return np.full(count, NO_ENTITY)
    made = np.asarray(value)
    if made.dtype.kind not in "iu" or made.shape not in ((), (count,)):
        raise ValueError(f"{name} must be None, an entity or {count} of them, got {value!r}")
    return np.array(np.broadcast_to(made, count), np.int64)
