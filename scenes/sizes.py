"""Checked numbers for scene sizes, and integer roots without rounding."""

from __future__ import annotations

import math
from typing import Any

from ..framework.elementary import power


def whole(value: Any, name: str, least: int = 1) -> int:
    """``value`` as an int; TypeError if it is not a whole number, ValueError below ``least``, both with its name."""
    if isinstance(value, bool) or not hasattr(value, "__index__"):
        raise TypeError(f"{name} must be a whole number, got {value!r}")
    number = value.__index__()
    if number < least:
        raise ValueError(f"{name} must be at least {least}, got {value!r}")
    return number


def real(value: Any, name: str, least: float = 0.0, *, above: bool = False) -> float:
    """``value`` as a float; ValueError unless it is finite and at least (``above``: more than) ``least``."""
    if isinstance(value, bool) or not hasattr(value, "__float__"):
        raise TypeError(f"{name} must be a number, got {value!r}")
    number = float(value)
    if not math.isfinite(number) or number < least or (above and number == least):
        raise ValueError(f"{name} must be {'above' if above else 'at least'} {least:g}, got {value!r}")
    return number


def root(x: float, degree: int) -> float:
    """The ``degree``-th root, the same on every platform."""
    return math.sqrt(x) if degree == 2 else power(x, 1 / degree)


def floor_root(n: int, degree: int) -> int:
    """The largest m with m^degree <= n."""
    m = round(n ** (1 / degree))
    while m**degree > n:
        m -= 1
    while (m + 1) ** degree <= n:
        m += 1
    return m


def ceil_root(n: int, degree: int) -> int:
    """The smallest m with m^degree >= n."""
    m = floor_root(n, degree)
    return m if m**degree == n else m + 1
