"""The sheet of a picture: dark theme, to scale, header, legend; works without a display."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize, to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

BACKGROUND = "#0d1117"
PANEL = "#10161f"
FRAME = "#222c3a"
WALL = "#2a3442"
WALL_EDGE = "#475569"
TEXT = "#e6edf3"
MUTED = "#8b98a8"
CONTACT = "#ffffff"
SENSOR = "#7dd3c0"
SPEED = LinearSegmentedColormap.from_list("speed", ["#3f66e0", "#1fb6c9", "#a6d854", "#ffd43b", "#ff6b5e"])
BODY_COLOURS = (
    "#ff6b6b", "#ffa94d", "#ffd43b", "#a9e34b", "#51cf66", "#20c997",
    "#22b8cf", "#4dabf7", "#748ffc", "#b197fc", "#e599f7", "#faa2c1",
)  # fmt: skip

DPI = 120
STYLE: dict[Any, Any] = {
    "figure.facecolor": BACKGROUND, "figure.dpi": DPI, "savefig.facecolor": BACKGROUND, "axes.facecolor": PANEL,
    "axes.edgecolor": FRAME, "axes.labelcolor": MUTED, "axes.axisbelow": True, "axes.titlecolor": TEXT,
    "xtick.color": MUTED, "ytick.color": MUTED, "grid.color": FRAME, "text.color": TEXT, "legend.facecolor": PANEL,
    "legend.edgecolor": FRAME, "legend.labelcolor": TEXT,
}  # fmt: skip
styled = matplotlib.rc_context(STYLE)  # a decorator of what makes figures
LONG_SIDE = 10.0  # inches, of the longer side; the shorter follows from the view
LONGEST_RATIO = 5.0  # of the sides
SHORTEST = 3.2  # inches
HEADER, FOOTER, MARGIN = 0.95, 0.8, 0.45

View = tuple[np.ndarray, np.ndarray]


@dataclass
class Sheet:
    """A figure with one view to scale, a header above and a footer below; points: of the picture per unit of space."""

    figure: Figure
    axes: Any
    points: float

    @classmethod
    @styled
    def new(cls, title: str, subtitle: str, view: View, numbered: bool) -> Sheet:
        """``view``: two corners in the plane; ``numbered``: it has a scale."""
        lower, upper = view
        span = np.maximum(upper - lower, np.finfo(float).tiny)
        ratio = float(np.clip(span[0] / span[1], 1 / LONGEST_RATIO, LONGEST_RATIO))
        height = max(SHORTEST, min(LONG_SIDE, LONG_SIDE / ratio))
        panel = np.array([max(height * ratio, SHORTEST), height])
        size = panel + np.array([2 * MARGIN, HEADER + FOOTER])
        figure = Figure(figsize=tuple(size))
        FigureCanvasAgg(figure)
        axes = figure.add_axes((MARGIN / size[0], FOOTER / size[1], *(panel / size)))
        unit = float((panel / span).min())  # inches per unit of space
        low, high = ((lower + upper + side * panel / unit) / 2 for side in (-1, 1))
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        axes.tick_params(labelsize=7, length=2 * numbered, pad=2, labelbottom=numbered, labelleft=numbered)
        sheet = cls(figure, axes, 72 * unit)
        sheet.write(MARGIN, size[1] - HEADER + 0.54, title, color=TEXT, fontsize=17, fontweight="bold")
        sheet.write(MARGIN, size[1] - HEADER + 0.21, subtitle, color=MUTED, fontsize=9.5)
        return sheet

    def write(self, x: float, y: float, text: str, **style: Any) -> None:
        """Text that begins so many inches from the lower left corner."""
        width, height = self.figure.get_size_inches()
        self.figure.text(x / width, y / height, text, va="center", **style)

    @styled
    def legend(self, entries: list[tuple[str, str, str]]) -> None:
        """Entries at the right of the footer: a matplotlib marker, its colour, a text."""
        handles = [Line2D([], [], ls="", marker=marker, color=colour, label=text, ms=9 if "$" in marker else 5)
                   for marker, colour, text in entries]  # fmt: skip
        self.figure.legend(handles=handles, loc="lower right", ncols=len(handles) or 1, frameon=False, fontsize=8.5,
                           labelcolor=MUTED, handletextpad=0.2)  # fmt: skip

    def speed_scale(self, norm: Normalize) -> None:
        """The colour bar of the speed, at the left of the footer."""
        width, height = self.figure.get_size_inches()
        axes: Any = self.figure.add_axes((MARGIN / width, 0.34 / height, 2.0 / width, 0.09 / height))
        bar = self.figure.colorbar(ScalarMappable(norm, SPEED), cax=axes, orientation="horizontal")
        bar.outline.set_visible(False)  # type: ignore[operator]
        axes.tick_params(colors=MUTED, labelsize=7, length=2, pad=1)
        self.write(MARGIN + 2.12, 0.385, "speed", color=MUTED, fontsize=8.5)

    def pixels(self, dpi: int) -> np.ndarray:
        """The picture as (height, width, 3) bytes."""
        self.figure.set_facecolor(BACKGROUND)
        self.figure.set_dpi(dpi)
        self.figure.canvas.draw()
        return np.asarray(self.figure.canvas.buffer_rgba())[..., :3].copy()  # type: ignore[attr-defined]

    def save(self, path: Path) -> Path:
        self.figure.savefig(path, facecolor=BACKGROUND, dpi=DPI, pil_kwargs={"optimize": True})
        return path


def speed_norm(speeds: np.ndarray) -> Normalize:
    """From 0 to the 98 % quantile of the speeds: one fast body must not make all others look slow."""
    moving = speeds[(speeds > 0) & np.isfinite(speeds)]
    top = float(np.quantile(moving, 0.98)) if len(moving) else 1.0
    return Normalize(0.0, top or 1.0, clip=True)


def mixed(colours: np.ndarray, other: str, share: Any) -> np.ndarray:
    """RGBA ``colours`` (..., 4) moved towards ``other`` by ``share`` (...) between 0 and 1."""
    result = np.array(colours, float)
    result[..., :3] += (np.array(to_rgb(other)) - result[..., :3]) * np.asarray(share)[..., None]
    return result
