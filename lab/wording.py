"""Numbers and counts as the reports of the laboratory write them."""

from __future__ import annotations

import math

NOTHING = "-"


def number(value: float) -> str:
    """Four digits, and 1/60 if the value is exactly that."""
    if 0 < value < 0.1 and math.isclose(1 / value, round(1 / value), rel_tol=1e-9):
        return f"1/{round(1 / value)}"
    return f"{value:.4g}"


def compact(value: float, digits: int = 3) -> str:
    """A number with that many significant digits: 0.0123, 1,230, 1.23e-5, 4.56e7."""
    if not math.isfinite(value):
        return f"{value:g}"
    mantissa, _, exponent = f"{value:.{digits - 1}e}".partition("e")
    power = int(exponent)
    if value == 0:
        return "0"
    if power < -3 or power > 5:
        return f"{mantissa}e{power}"
    return f"{float(f'{mantissa}e{power}'):,.{max(digits - 1 - power, 0)}f}"


def counted(count: int, what: str, plural: str = "") -> str:
    """`1 run`, `2,000 runs`; plural: of a word that takes no s."""
    return f"{count:,} {what if count == 1 else plural or what + 's'}"


def metres(value: float) -> str:
    """A length: 4.2 mm, 12 cm, 3.4 m; the unit is that of the scene."""
    size = abs(value)
    if size < 1e-6:
        return "less than 0.001 mm"
    if size < 0.01:
        return f"{1e3 * size:.2g} mm"
    return f"{100 * size:.2g} cm" if size < 1 else f"{size:.3g} m"
