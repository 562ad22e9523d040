"""A point of the grid as the line of Python to paste into a game."""

from __future__ import annotations

import dataclasses
from fractions import Fraction

from ...framework import Settings
from ..trading.records import CAROM, Cell

LARGEST_NUMERATOR = 16  # 2/45 is read at a glance, 347/20820 is not
LARGEST_DENOMINATOR = 1_000_000


def settings_line(cell: Cell, base: Settings | None = None) -> str:
    """The shortest ``Settings(...)`` that is ``cell.settings(base)``; evaluated, it gives the same bits.

    Fields with their default values are left out. ``base``: Settings() if None. ValueError for another engine's cell,
    and for what Settings refuses.
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
    """What sets ``cell`` in the engine it belongs to: :func:`settings_line`, or pymunk's two lines in one."""
    if cell.engine == CAROM:
        return settings_line(cell, base)
    return f"space.iterations = {cell.substeps}; space.step({seconds(cell.dt)})"


def seconds(dt: float) -> str:
    """A step as Python: a small fraction that is exactly this number, where that is not longer than the number."""
    dt = float(dt)
    plain = repr(dt)
    fraction = Fraction(dt).limit_denominator(LARGEST_DENOMINATOR)
    text = f"{fraction.numerator}/{fraction.denominator}"
    small = 0 < fraction.numerator <= LARGEST_NUMERATOR and fraction.denominator > 1
    same = small and fraction.numerator / fraction.denominator == dt
    return text if same and len(text) <= len(plain) else plain


def quoted(value: object) -> str:
    """Python's own words, with the quotation marks that the documentation uses."""
    if isinstance(value, str) and value.isprintable() and '"' not in value and "\\" not in value:
        return f'"{value}"'
    return repr(value)
