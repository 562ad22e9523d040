"""The time per body against the number of bodies, as a chart."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ...bench.charts import BAR, new_axes, saved
from ...pictures import canvas
from .scaling import Scaling


@canvas.styled
def draw_scaling(result: Scaling, folder: Path) -> Path:
    """Nanoseconds per body per step against the number of bodies, the spread as a band."""
    axes = new_axes("how the time per body grows (gas2d)", 4.5)
    bodies = [point.bodies for point in result.points]
    spreads = [point.nanoseconds for point in result.points]
    axes.fill_between(bodies, [s.low for s in spreads], [s.high for s in spreads], color=BAR, alpha=0.25, lw=0)
    axes.plot(bodies, [s.median for s in spreads], "o-", color=BAR)
    for n, spread in zip(bodies, spreads, strict=True):
        above: dict[str, Any] = {"xytext": (0, 8), "textcoords": "offset points", "ha": "center"}
        axes.annotate(f"{spread.median:.0f}", (n, spread.median), color=canvas.TEXT, **above)
    axes.set_xscale("log")
    axes.set_ylim(0, 1.2 * max(s.high for s in spreads))
    axes.set_xlabel("bodies")
    axes.set_ylabel("ns per body per step")
    return saved(axes, folder / "scaling.png")
