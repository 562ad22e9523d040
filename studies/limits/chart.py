"""The limits as a picture: one panel per axis, the error against the value, crosses where it breaks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from carom.lab.pictures import canvas

from ..runner import Line, Result
from .edges import LEVELS, Quantity
from .tables import by_quantity

PANEL = (3.4, 2.5)  # inches
DPI = 90
COLUMNS = 3
TOP, BOTTOM = 1e3, 1e-16  # errors outside this range are drawn at its ends
COLOURS: dict[str, str] = dict(
    zip(
        ("discrete", "continuous", "event_driven", "explicit_euler", "semi_implicit_euler", "velocity_verlet", "rk4",
         "yoshida4", "discrete with ccd", "discrete with 32 substeps", "continuous with velocity_verlet"),
        ("#4dabf7", "#ffd43b", "#ff6b6b", "#8b98a8", "#e599f7", "#51cf66", "#ffa94d", "#22b8cf", "#a9e34b", "#748ffc",
         "#faa2c1"),
        strict=True,
    )
)  # fmt: skip


@canvas.styled
def draw_limits(result: Result, folder: Path) -> Path:
    """Draw limits.png with one panel per axis."""
    panels = by_quantity(result)
    columns = min(COLUMNS, len(panels))
    rows = -(-len(panels) // columns)
    size = (PANEL[0] * columns, PANEL[1] * rows + 0.9)
    figure = Figure(figsize=size, dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle("where carom's errors grow, and where it breaks", fontsize=13, fontweight="bold")
    shown: dict[str, Any] = {}
    for place, (quantity, lines) in enumerate(panels):
        panel = figure.add_subplot(rows, columns, place + 1)
        _draw(panel, quantity, lines, shown, place % columns == 0)
    cross = figure.axes[0].plot([], [], "x", color=canvas.TEXT, ms=6, mew=1.5)[0]
    columns = min(4, len(shown) + 1)
    figure.legend([*shown.values(), cross], [*shown, "broken"], loc="outside lower center", ncols=columns, fontsize=8)
    path = folder / "limits.png"
    figure.savefig(path, facecolor=canvas.BACKGROUND, pil_kwargs={"optimize": True})
    return path


def _draw(panel: Any, quantity: Quantity, lines: list[Line], shown: dict[str, Any], labelled: bool) -> None:
    for order, line in enumerate(lines):
        colour = COLOURS.get(line.of, canvas.TEXT)
        samples = sorted((s.value, s.facts["error"], s.facts["broken"]) for s in line.samples)
        known = [(value, _shown(error)) for value, error, _ in samples if error is not None]
        # Lines may coincide: the later ones are thinner.
        width = 1.0 + 0.7 * (len(lines) - 1 - order)
        drawn = panel.plot([v for v, _ in known], [e for _, e in known], "-", color=colour, lw=width)[0]
        shown.setdefault(line.of, drawn)
        for value, error, _ in [found for found in samples if found[2]][:1]:
            height = TOP if error is None else _shown(error)
            panel.plot([value], [height], "x", color=colour, ms=7, mew=1.8, zorder=5, clip_on=False)
    for level in LEVELS.values():
        panel.axhline(level, color=canvas.MUTED, lw=0.7, ls=":")
    panel.set(xscale="log", yscale="log", ylim=(BOTTOM / 3, TOP))
    panel.set_title(quantity.title, fontsize=9, loc="left")
    panel.set_xlabel(quantity.unit, fontsize=8)
    panel.set_ylabel("error" if labelled else "", fontsize=8)
    panel.tick_params(labelsize=7, which="both", length=2)


def _shown(error: float) -> float:
    return min(max(error, BOTTOM), TOP)
