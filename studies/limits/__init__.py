"""Where carom fails, one quantity at a time.

Reads worlds made for each quantity. Writes tables and a chart.
"""

from __future__ import annotations

from pathlib import Path

from ..runner import Axis, Result
from .edges import axis_of
from .tables import QUANTITIES, report

__all__ = ["axes", "draw", "report"]


def axes(quick: bool = False, long: bool = False) -> list[Axis]:
    """Each quantity with each of its methods."""
    return [
        axis_of(quantity, method, quantity.chosen(quick, long))
        for quantity in QUANTITIES
        for method in quantity.methods
    ]


def draw(result: Result, folder: Path) -> Path:
    """A picture of all quantities, limits.png."""
    from .chart import draw_limits  # matplotlib is needed for pictures alone

    return draw_limits(result, folder)
