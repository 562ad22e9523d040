"""The sheet of a picture: dark theme, panels to scale, header, legend; works without a display."""

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
LONG_SIDE = 10.0  # inches, of the longer side of a single panel; the shorter follows from the view
LONG_SIDE_OF_TWO = 7.2
LONGEST_RATIO = 5.0  # of a panel's sides
SHORTEST = 3.2  # inches
HEADER, FOOTER, GAP = 0.95, 0.8, 0.35
MARGIN = 0.45

View = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Panel:
    """One view: matplotlib's axes, and the number of points of the picture per unit of space."""

    axes: Any
    points: float

    def outline(self, lower: np.ndarray, upper: np.ndarray) -> None:
        """Frame the part of this panel that another panel magnifies."""
        (x0, y0), (x1, y1) = lower, upper
        self.axes.plot([x0, x1, x1, x0, x0], [y0, y0, y1, y1, y0], color=TEXT, lw=1.0, alpha=0.9, zorder=8)


@dataclass
class Sheet:
    """A figure with panels side by side, each to scale, a header above and a footer below."""

    figure: Figure
    panels: list[Panel]

    @classmethod
    @styled
    def new(cls, title: str, subtitle: str, views: list[View], numbered: bool) -> Sheet:
        """``views``: two corners in the plane for each panel; ``numbered``: the first one has a scale."""
        spans = [np.maximum(upper - lower, np.finfo(float).tiny) for lower, upper in views]
        long_side = LONG_SIDE if len(views) == 1 else LONG_SIDE_OF_TWO
        ratios = [float(np.clip(span[0] / span[1], 1 / LONGEST_RATIO, LONGEST_RATIO)) for span in spans]
        height = max(SHORTEST, min(long_side, *(long_side / ratio for ratio in ratios)))
        widths = [max(height * ratio, SHORTEST) for ratio in ratios]
        size = np.array([sum(widths) + GAP * (len(views) - 1) + 2 * MARGIN, height + HEADER + FOOTER])
        figure = Figure(figsize=tuple(size))
        FigureCanvasAgg(figure)
        sheet, left = cls(figure, []), MARGIN
        for number, ((lower, upper), span, width) in enumerate(zip(views, spans, widths, strict=True)):
            axes = figure.add_axes((left / size[0], FOOTER / size[1], width / size[0], height / size[1]))
            unit = min(width / span[0], height / span[1])  # inches per unit of space
            middle, half = (lower + upper) / 2, np.array([width, height]) / unit / 2
            axes.set_xlim(middle[0] - half[0], middle[0] + half[0])
            axes.set_ylim(middle[1] - half[1], middle[1] + half[1])
            axes.tick_params(labelsize=7, length=2, pad=2)
            if number or not numbered:
                axes.tick_params(labelbottom=False, labelleft=False, length=0)
            sheet.panels.append(Panel(axes, 72 * unit))
            left += width + GAP
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
