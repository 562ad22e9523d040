"""A point of the grid as a line of Python for a game's source."""

from __future__ import annotations

import dataclasses
from fractions import Fraction

from ...framework import Settings
from .records import CAROM, Cell

LARGEST_NUMERATOR = 16  # 2/45 is easy to read, 347/20820 is not
LARGEST_DENOMINATOR = 1_000_000


def settings_line(cell: Cell, base: Settings | None = None) -> str:
    """The shortest ``Settings(...)`` that is ``cell.settings(base)``, with identical values, bit for bit.

    Fields with their default values are left out. ``base``: Settings() if None. ValueError for another engine's cell,
    and for values that Settings rejects.
    """
    if cell.engine != CAROM:
        raise ValueError(f"a cell of {cell.engine} has no Settings")
    chosen, usual = cell.settings(base or Settings()), Settings()
    parts = []
    for field in dataclasses.fields(Settings):
        value = getattr(chosen, field.name)
        if value != getattr(usual, field.name):
            parts.append(f"{field.name}={seconds(value) if field.name == 'dt' else quoted(value)}")
    return f"Settings({', '.join(parts)})"


def python_line(cell: Cell, base: Settings | None = None) -> str:
    """The code that sets ``cell`` in its engine: :func:`settings_line`, or pymunk's two statements in one line."""
    if cell.engine == CAROM:
        return settings_line(cell, base)
    return f"space.iterations = {cell.substeps}; space.step({seconds(cell.dt)})"


def seconds(dt: float) -> str:
    """A step as Python source: an exactly equal small fraction, unless it is longer than the decimal number."""
    dt = float(dt)
    plain = repr(dt)
    fraction = Fraction(dt).limit_denominator(LARGEST_DENOMINATOR)
    text = f"{fraction.numerator}/{fraction.denominator}"
    small = 0 < fraction.numerator <= LARGEST_NUMERATOR and fraction.denominator > 1
    same = small and fraction.numerator / fraction.denominator == dt
    return text if same and len(text) <= len(plain) else plain


def quoted(value: object) -> str:
    """The Python repr, with the quotation marks used in the documentation."""
    if isinstance(value, str) and value.isprintable() and '"' not in value and "\\" not in value:
        return f'"{value}"'
    return repr(value)
