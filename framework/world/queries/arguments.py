"""Arguments of queries: checked and as the kernels want them. Every message names the argument.

Arrays are copied: a kernel would compile once more for one that is read-only or not contiguous.
"""

from __future__ import annotations

import math
import numbers
import operator
from typing import Any, NamedTuple

import numpy as np

from ...data.columns import or_no_rows

NONE_EXCLUDED = np.empty((1, 0), np.int64)
BY_NAME = {"query_nearest: mask": "max_distance", "query_nearests: masks": "max_distances"}  # what floats there mean


class Wanted(NamedTuple):
    """Which bodies m queries look for.

    masks
        bits of layers, one for all or (m,)
    excluded
        (m, k) ids to leave out, -1: none; NONE_EXCLUDED
    layers, groups
        if colliders ask, theirs, one for all or (m,): masks and groups of bodies count then
    one_way
        overlaps: whether also what is solid from one side only
    """

    masks: Any
    excluded: np.ndarray
    layers: Any = 0
    groups: Any = 0
    one_way: bool = False


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
        made = np.asarray(or_no_rows(value, dimensions), float)
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


def flag(value: Any, name: str) -> bool:
    """True or False."""
    if not isinstance(value, (bool, np.bool_)):
        raise ValueError(f"{name} must be True or False, got {value!r}")
    return bool(value)


def mask(value: Any, name: str) -> int:
    """Bits of layers."""
    try:
        bits = operator.index(value)
    except TypeError:
        bits = 1 << 63
    if not -(1 << 63) <= bits < 1 << 63:
        raise _no_bits(name, value, "", isinstance(value, float))
    return bits


def _no_bits(name: str, value: Any, several: str, is_float: bool) -> ValueError:
    meant = f" (did you mean {BY_NAME[name]}={value!r}?)" if is_float and name in BY_NAME else ""
    return ValueError(f"{name} must be an integer of 64 bits, one for each layer{several}, got {value!r}{meant}")


def masks(value: Any, name: str, count: int) -> int | np.ndarray:
    """Bits of layers for all queries, or (m,)."""
    if not isinstance(value, (list, tuple)) and not getattr(value, "ndim", 0):
        return mask(value, name)
    made = np.asarray(value)
    if made.shape != (count,) or (count and (made.dtype.kind not in "iu" or made.max() >= 1 << 63)):
        raise _no_bits(name, value, f", or {count} of them", made.dtype.kind == "f")
    return made.astype(np.int64)


def excluded(value: Any, name: str, count: int | None = None) -> np.ndarray:
    """(m, k) ids to leave out (-1: none), from None, one id or, for each query, one or several; or, without a count,
    of one query."""
    if value is None:
        return NONE_EXCLUDED
    many = 1 if count is None else count
    try:
        made = np.asarray(value)
    except ValueError:  # lists of different lengths
        made = np.empty((0, 0, 0))
    if made.ndim < 2:
        made = made.reshape((1, -1) if made.ndim == 0 or count is None else (-1, 1))
    if made.ndim != 2 or made.shape[0] not in (1, many) or (made.size and made.dtype.kind not in "iu"):
        several = "several" if count is None else f"{count} of them, or several for each: (1, k) or ({count}, k)"
        raise ValueError(f"{name} must be None, an entity or {several}, got {value!r}")
    return np.array(made if len(made) == many else np.broadcast_to(made, (many, made.shape[1])), np.int64)


def met_by(colliders: tuple[Any, Any, Any], wanted: Wanted) -> Wanted:
    """Of what is wanted, what colliders meet with these layers, masks and groups, one for all or (m,)."""
    layers, own, groups = colliders
    return wanted._replace(masks=wanted.masks & own, layers=layers, groups=groups)


def wanted_of_one(verb: str, mask_of: Any, exclude: Any, one_way: Any = False) -> Wanted:
    """Of one query of that verb, from its arguments ``mask`` and ``exclude``."""
    kept = mask(mask_of, f"{verb}: mask"), excluded(exclude, f"{verb}: exclude")
    return Wanted(*kept, one_way=flag(one_way, f"{verb}: one_way"))


def wanted(verb: str, count: int, masks_of: Any, excludes: Any = None, one_way: Any = False) -> Wanted:
    """Of many, from ``masks`` and ``excludes``."""
    kept = masks(masks_of, f"{verb}: masks", count), excluded(excludes, f"{verb}: excludes", count)
    return Wanted(*kept, one_way=flag(one_way, f"{verb}: one_way"))
