"""The sheet of a picture: dark theme, panels to scale, header, legend; works without a display."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure

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
    footer: Any

    @classmethod
    @styled
    def new(cls, title: str, subtitle: str, views: list[View], numbered: bool) -> Sheet:
        """``views``: two corners in the plane for each panel; ``numbered``: the first one has a scale."""
        spans = [np.maximum(upper - lower, np.finfo(float).tiny) for lower, upper in views]
        long_side = LONG_SIDE if len(views) == 1 else LONG_SIDE_OF_TWO
        ratios = [float(np.clip(span[0] / span[1], 1 / LONGEST_RATIO, LONGEST_RATIO)) for span in spans]
        height = max(SHORTEST, min(long_side, *(long_side / ratio for ratio in ratios)))
        widths = [max(height * ratio, SHORTEST) for ratio in ratios]
        total_width = sum(widths) + GAP * (len(views) - 1) + 2 * MARGIN
        total_height = height + HEADER + FOOTER
        figure = Figure(figsize=(total_width, total_height))
        FigureCanvasAgg(figure)

        def place(left: float, bottom: float, width: float, height: float) -> Any:
            """Axes at a position in inches."""
            scale = np.array([total_width, total_height, total_width, total_height])
            return figure.add_axes(tuple(np.array([left, bottom, width, height]) / scale))

        panels, left = [], MARGIN
        for number, ((lower, upper), span, width) in enumerate(zip(views, spans, widths, strict=True)):
            axes = place(left, FOOTER, width, height)
            unit = min(width / span[0], height / span[1])  # inches per unit of space
            middle, half = (lower + upper) / 2, np.array([width, height]) / unit / 2
            axes.set_xlim(middle[0] - half[0], middle[0] + half[0])
            axes.set_ylim(middle[1] - half[1], middle[1] + half[1])
            axes.tick_params(labelsize=7, length=2, pad=2)
            if number or not numbered:
                axes.tick_params(labelbottom=False, labelleft=False, length=0)
            panels.append(Panel(axes, 72 * unit))
            left += width + GAP
        header = place(0, total_height - HEADER, total_width, HEADER)
        footer = place(0, 0, total_width, FOOTER)
        for strip, strip_height in ((header, HEADER), (footer, FOOTER)):
            strip.set_axis_off()
            strip.set_xlim(0, total_width)
            strip.set_ylim(0, strip_height)
        header.text(MARGIN, 0.54, title, color=TEXT, fontsize=17, fontweight="bold", va="center")
        header.text(MARGIN, 0.21, subtitle, color=MUTED, fontsize=9.5, va="center")
        return cls(figure, panels, footer)

    @property
    def width(self) -> float:
        return float(self.footer.get_xlim()[1])

    def legend(self, entries: list[tuple[str, str, str]]) -> None:
        """Entries right-aligned in the footer: (marker, colour, text); a matplotlib marker or '->'."""
        right = self.width - MARGIN
        for marker, colour, text in reversed(entries):
            label = self.footer.text(right, 0.3, text, color=MUTED, fontsize=8.5, ha="right", va="center")
            box = label.get_window_extent(self.figure.canvas.get_renderer())  # type: ignore[attr-defined]
            right -= box.width / DPI + 0.13
            if marker == "->":
                arrow = {"arrowstyle": "->", "color": colour, "lw": 1.3}
                self.footer.annotate("", xy=(right + 0.05, 0.3), xytext=(right - 0.22, 0.3), arrowprops=arrow)
                right -= 0.22
            else:
                self.footer.plot([right], [0.3], marker=marker, color=colour, ms=5, mec="none", ls="none")
            right -= 0.3

    def speed_scale(self, norm: Normalize) -> None:
        """The colour bar of the speed, at the left of the footer."""
        width, height = self.width, float(self.figure.get_size_inches()[1])
        axes: Any = self.figure.add_axes((MARGIN / width, 0.34 / height, 2.0 / width, 0.09 / height))
        bar = self.figure.colorbar(ScalarMappable(norm, SPEED), cax=axes, orientation="horizontal")
        bar.outline.set_visible(False)  # type: ignore[operator]
        axes.tick_params(colors=MUTED, labelsize=7, length=2, pad=1)
        self.footer.text(MARGIN + 2.12, 0.385, "speed", color=MUTED, fontsize=8.5, va="center")

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


def mixed(colours: np.ndarray, other: str, share: np.ndarray) -> np.ndarray:
    """RGBA ``colours`` (n, 4) moved towards ``other`` by ``share`` (n) between 0 and 1."""
    target = np.array([int(other[k : k + 2], 16) / 255 for k in (1, 3, 5)])
    result = np.array(colours, float)
    result[:, :3] += (target - result[:, :3]) * np.asarray(share)[:, None]
    return result
