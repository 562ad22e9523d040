"""sin and its friends to as many digits as the context of decimals has, up to 60: Taylor series, and pi as a whole
number."""

from __future__ import annotations

import math
from collections.abc import Callable
from decimal import Decimal

SMALL, BITS = Decimal(10) ** -60, 1300
OVER = 2000.0  # an exponent of e so large is any larger one


def _arctan_of_inverse(n: int) -> int:
    """atan(1 / n) 2^BITS."""
    term, total, k = (1 << BITS + 64) // n, 0, 0
    while term:
        total += (-term if k & 1 else term) // (2 * k + 1)
        term, k = term // (n * n), k + 1
    return total >> 64


PI = 4 * (4 * _arctan_of_inverse(5) - _arctan_of_inverse(239))  # times 2^BITS (Machin)


def series(x: Decimal, first: int) -> Decimal:
    """x - x^3/3! + ... with ``first`` 1, 1 - x^2/2! + ... with 0."""
    total = term = x if first else Decimal(1)
    k = first
    while abs(term) > SMALL * abs(total):
        term = -term * x * x / ((k + 1) * (k + 2))
        total, k = total + term, k + 2
    return total


def _turned(x: float, quarters: int) -> Decimal:
    """sin(x + quarters pi/2)."""
    top, bottom = x.as_integer_ratio()
    n = ((4 * top << BITS) + bottom * PI) // (2 * bottom * PI)  # the nearest multiple of pi/2
    rest = Decimal((2 * top << BITS) - n * bottom * PI) / Decimal(bottom << BITS + 1)
    value = series(rest, 1 - (n + quarters & 1))
    return -value if n + quarters & 2 else value


def sin(x: float) -> Decimal:
    return _turned(x, 0)


def cos(x: float) -> Decimal:
    return _turned(x, 1)


def _atan(ratio: Decimal) -> Decimal:
    """By Newton's method, up to 1."""
    if ratio < Decimal(10) ** -30:
        return ratio
    angle = Decimal(math.atan(float(ratio)))
    for _ in range(3):
        sine, cosine = series(angle, 1), series(angle, 0)
        step = (ratio * cosine - sine) / (cosine + ratio * sine)
        angle += step - step**3 / 3
    return angle


def atan2(y: float, x: float) -> Decimal:
    pi, aside, along = Decimal(PI) / Decimal(1 << BITS), abs(Decimal(y)), abs(Decimal(x))
    angle = pi / 2 - _atan(along / aside) if aside > along else _atan(aside / along) if along else Decimal(0)
    return (pi - angle if math.copysign(1.0, x) < 0.0 else angle).copy_sign(Decimal(y))


def exp(x: float) -> Decimal:
    return Decimal(max(-OVER, min(OVER, x))).exp()


def expm1(x: float) -> Decimal:
    if abs(x) < 1e-10:
        return Decimal(x) + Decimal(x) ** 2 / 2 + Decimal(x) ** 3 / 6 + Decimal(x) ** 4 / 24 + Decimal(x) ** 5 / 120
    return exp(x) - 1


def power(x: float, y: float) -> Decimal:
    return (Decimal(x).ln() * Decimal(y)).exp()


FUNCTIONS: dict[str, Callable[..., Decimal]] = {
    "sin": sin, "cos": cos, "atan2": atan2, "exp": exp, "expm1": expm1, "power": power,
}  # fmt: skip
