"""Work-precision charts of a trade: the error on the x axis, the cost on the y axis, one curve per method.

Failed repeats have a cost but no error: they are crosses in a strip at the right edge, one column per kind of failure.
"""

from __future__ import annotations

import io
import math
import re
import textwrap
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..cli.usage_errors import Problem
from ..pictures import canvas
from ..reporting.text import compact, number
from .records import CAROM, FAILURES, NOT_FINITE, TRUSTED, CaseTrade, Cell, Curve, ErrorBar, Point, Trade
from .report import check_norm, error_heading, measured, norm_of, order

WORK, TIME = "work", "time"
AXIS = {
    WORK: "work per simulated second (weighted counts)",
    TIME: "wall time per simulated second, ms",
}

WIDTH, PLOT, STRIP = 10.0, 6.9, 0.6  # inches: the chart, its plot with headings, a column of the strip of failures
ROW, NOTE, SMALL = 0.176, 0.13, 7.5  # inches: a row of the legend, a line of small print; points of small print
LEAST_ERROR = 1e-17  # lower end of an axis on which all errors are 0
APART = (0.075, 0.035)  # minimum distance of two step labels, as fractions of the axes

FEW = 8  # up to this number each curve has its own colour
COLOURS = ("#4dabf7", "#ffa94d", "#51cf66", "#ff6b6b", "#b197fc", "#ffd43b", "#22d3c5", "#f78fd0")
PEER = canvas.TEXT  # pymunk's colour
MARKERS = "osD^vPpXhd"
LINES = {"discrete": "-", "continuous": "-.", "event_driven": ":"}
PEER_LINE = "--"
MARKS, WIDTHS = (8.5, 4.5), (2.6, 1.3)  # points, of the first and the last curve: covered ones stay visible


@dataclass
class Sheet:
    """A chart in progress: its axes and its limits."""

    case: CaseTrade
    norm: str
    quantity: str
    axes: Any = None
    strip: Any = None
    kinds: list[str] = field(default_factory=list)
    errors: tuple[float, float] = (LEAST_ERROR, 1.0)

    def height(self, point: Point) -> float | None:
        """The cost of the point; None if it is unknown or not positive."""
        cost = point.work if self.quantity == WORK else point.milliseconds and point.milliseconds.median
        return cost if cost and math.isfinite(cost) and cost > 0 else None


@canvas.styled
def draw(trade: Trade, folder: Path, norm: str | None = None) -> list[Path]:
    """Draw charts of all measured cases as PNG and SVG in ``folder``: by work and, if timed, by wall time.

    ``norm``: used for cases that have it; the others use their first one. Problem if no case has it, or for the folder.
    """
    check_norm(trade, norm)
    made: list[Path] = []
    for case in measured(trade):
        chosen = norm_of(case, norm)
        for quantity in quantities(case):
            name = "-".join(filter(None, ("trade", _slug(case.scene), _slug(chosen), quantity)))
            name = name if folder / f"{name}.png" not in made else f"{name}-{len(made)}"
            chart = figure(case, quantity, chosen)
            for suffix in ("png", "svg"):
                path = folder / f"{name}.{suffix}"
                try:
                    path.parent.mkdir(parents=True, exist_ok=True)
                    path.write_bytes(_saved(chart, suffix))
                except OSError as error:
                    raise Problem(f"{path}: {error.strerror or error}") from error
                made.append(path)
    return made


def quantities(case: CaseTrade) -> list[str]:
    """WORK, and TIME if a point was timed."""
    timed = any(point.milliseconds for point in case.points)
    return [WORK, TIME] if timed else [WORK]


@canvas.styled
def figure(case: CaseTrade, quantity: str = WORK, norm: str | None = None) -> Figure:
    """One chart: WORK or TIME over the error of ``norm``, the case's first if it does not have it."""
    sheet = Sheet(case, norm_of(case, norm), quantity)
    sheet.kinds = [kind for kind in FAILURES if any(kind in _failures(p, sheet.norm) for p in case.points)]
    drawn = list(zip(case.curves, styles(case.curves), strict=True))
    entries = [
        Line2D([], [], label=legend_text(curve, sheet.norm), color=style.colour, ls=style.line, marker=style.marker,
               ms=5.5, lw=1.6)
        for curve, style in drawn
    ]  # fmt: skip
    notes = [line for note in _notes(sheet) for line in textwrap.wrap(note, 135)]
    columns = 3 if max((len(str(entry.get_label())) for entry in entries), default=0) < 34 else 2
    below = ROW * -(-len(entries) // columns) + NOTE * len(notes)
    made = Figure(figsize=(WIDTH, PLOT + below), layout="constrained")
    FigureCanvasAgg(made)
    sheet.axes, *strip = made.subplots(1, 2, width_ratios=(PLOT, STRIP * len(sheet.kinds))) if sheet.kinds else (
        made.subplots(),
    )  # fmt: skip
    sheet.strip = strip[0] if strip else None
    _set_limits(sheet)
    for curve, style in drawn:
        _draw_curve(sheet, curve, style)
    _draw_failures(sheet, drawn)
    _label_steps(sheet, drawn)
    made.suptitle(case.scene, x=0.01, ha="left", fontsize=16, fontweight="bold")
    what = textwrap.shorten(f"{sheet.norm}: {case.norms[sheet.norm]}", 120, placeholder=" ...")
    sheet.axes.set_title(what, loc="left", color=canvas.MUTED, fontsize=9.5)
    made.legend(
        handles=entries, ncols=columns, loc="outside lower left", frameon=False, fontsize=8.5, handlelength=2.6,
        title="\n".join(notes), title_fontsize=SMALL, alignment="left",
    )  # fmt: skip
    return made


def legend_text(curve: Curve, norm: str) -> str:
    """`velocity Verlet, order 2.0 (2)`, or `exact`, or the label alone if no order is known."""
    found, theory = curve.orders.get(norm), curve.theory.get(norm)
    if theory == math.inf:
        return f"{curve.label}, exact"
    if found is None:
        return curve.label
    return f"{curve.label}, order {order(curve, norm)}"


def _bar(point: Point, norm: str) -> ErrorBar | None:
    """The point's error bar, or None if its error is not a number."""
    bar = point.errors.get(norm)
    return bar if bar is not None and math.isfinite(bar.mean) else None


def _failures(point: Point, norm: str) -> dict[str, int]:
    """Number of failed repeats by kind; an error that is not a number counts as a kind."""
    failures = {kind: count for kind, count in point.failures.items() if count}
    if norm in point.errors and _bar(point, norm) is None and NOT_FINITE not in failures:
        failures[NOT_FINITE] = point.repeats
    return failures


def _set_limits(sheet: Sheet) -> None:
    """Set both axes to enclose everything drawn, with room at the left edge for errors of 0."""
    axes, norm = sheet.axes, sheet.norm
    bars = [bar for point in sheet.case.points if (bar := _bar(point, norm))]
    errors = [e for bar in bars for e in (bar.low, bar.mean, bar.high) if 0 < e < math.inf]
    costs = [cost for point in sheet.case.points if (cost := sheet.height(point))]
    least, most = (min(errors), max(errors)) if errors else (10 * LEAST_ERROR, 1.0)
    if any(bar.mean <= 0 for bar in bars):
        least /= 10
    sheet.errors = _widened(least, most)
    axes.set(xscale="log", yscale="log", xlim=sheet.errors, xlabel=error_heading(norm), ylabel=AXIS[sheet.quantity],
             ylim=_widened(min(costs, default=1.0), max(costs, default=1.0)))  # fmt: skip
    axes.grid(lw=0.7)
    if sheet.strip is not None:
        strip = sheet.strip
        strip.set(yscale="log", ylim=axes.get_ylim(), xlim=(0, len(sheet.kinds)))
        strip.tick_params(which="both", left=False, labelleft=False, bottom=False, labelbottom=False)
        strip.set_title("failed", color=canvas.MUTED, fontsize=9, pad=4)
        for column, kind in enumerate(sheet.kinds):
            label = strip.text(column + 0.5, -0.02, kind, color=canvas.MUTED, fontsize=8, ha="center", va="top")
            label.set_transform(strip.get_xaxis_transform())
            if column:
                strip.axvline(column, color=canvas.FRAME, lw=0.8)


def _widened(low: float, high: float) -> tuple[float, float]:
    """The range with a margin, at least one decade, for a logarithmic axis."""
    middle, half = (math.log10(low) + math.log10(high)) / 2, (math.log10(high) - math.log10(low)) / 2
    half = max(half * 1.08, half + 0.06, 0.5)
    return 10 ** (middle - half), 10 ** (middle + half)


def _place(sheet: Sheet, point: Point) -> tuple[float, float] | None:
    """Where a point is drawn; an error of 0 at the left edge; None without an error or a cost."""
    bar, cost = _bar(point, sheet.norm), sheet.height(point)
    return None if bar is None or cost is None else (max(bar.mean, sheet.errors[0]), cost)


def _draw_curve(sheet: Sheet, curve: Curve, style: Style) -> None:
    placed = [(point, place) for point in curve.points if (place := _place(sheet, point))]
    xs, ys = [x for _, (x, _) in placed], [y for _, (_, y) in placed]
    look: dict[str, Any] = {"color": style.colour, "clip_on": False}
    sheet.axes.plot(xs, ys, ls=style.line, lw=style.width, label=curve.label, zorder=3, color=style.colour)
    for point, (x, y) in placed:
        bar = point.errors[sheet.norm]
        if bar.high > bar.low:
            sheet.axes.hlines(y, max(bar.low, sheet.errors[0]), bar.high, color=style.colour, lw=1.0, alpha=0.45)
        zero = bar.mean <= 0
        trusted = sheet.case.reference.trusts(sheet.norm, bar.mean)
        marker, label = ("<", "zero") if zero else (style.marker, "trusted" if trusted else "untrusted")
        inside = style.colour if trusted else canvas.PANEL
        sheet.axes.plot([x], [y], ls="none", marker=marker, ms=style.size, mfc=inside, label=label, zorder=4, **look)


def _draw_failures(sheet: Sheet, drawn: list[tuple[Curve, Style]]) -> None:
    """A cross for each point and kind, at the point's cost; at the upper edge if the cost is unknown."""
    for column, kind in enumerate(sheet.kinds):
        found = [(p, style) for curve, style in drawn for p in curve.points if kind in _failures(p, sheet.norm)]
        bottom, top = sheet.axes.get_ylim()
        for place, (point, style) in enumerate(found):
            x = column + (place + 1) / (len(found) + 1)
            y = sheet.height(point) or bottom * (top / bottom) ** 0.97
            sheet.strip.plot([x], [y], ls="none", marker="x", ms=6.5, mew=1.8, color=style.colour, label=kind)
            count = _failures(point, sheet.norm)[kind]
            if count < point.repeats:
                beside: dict[str, Any] = {"xytext": (0, 5), "textcoords": "offset points", "ha": "center"}
                text = f"{count}/{point.repeats}"
                sheet.strip.annotate(text, (x, y), color=canvas.MUTED, fontsize=6, **beside)


def _label_steps(sheet: Sheet, drawn: list[tuple[Curve, Style]]) -> None:
    """Step labels at the ends and middles of curves, as far as they fit."""
    kept: list[tuple[float, float]] = []
    to_share = sheet.axes.transAxes.inverted()
    wanted: list[tuple[Point, Style]] = []
    for pick in (lambda n: n - 1, lambda n: 0, lambda n: n // 2):
        for curve, style in drawn:
            seen = [point for point in curve.points if _place(sheet, point)]
            if seen:
                wanted.append((seen[pick(len(seen))], style))
    for point, style in wanted:
        x, y = _place(sheet, point) or (0.0, 0.0)
        across, up = to_share.transform(sheet.axes.transData.transform((x, y)))
        beside: dict[str, Any] = {"xytext": (6, 5), "textcoords": "offset points"}
        middle = across + APART[0] / 2
        if across > 0.93:
            beside.update(xytext=(-6, 5), ha="right")
            middle = across - APART[0] / 2
        if any(abs(middle - a) < APART[0] and abs(up - b) < APART[1] for a, b in kept):
            continue
        kept.append((middle, up))
        text = f"{number(point.cell.dt)} s"
        sheet.axes.annotate(text, (x, y), color=style.colour, fontsize=7, zorder=5, **beside)


def _notes(sheet: Sheet) -> list[str]:
    """The meaning of the marks used, and what could not be drawn."""
    case, norm, points = sheet.case, sheet.norm, sheet.case.points
    bars = [bar for point in points if (bar := _bar(point, norm))]
    what = {WORK: "work", TIME: "wall time"}[sheet.quantity]
    lines = []
    if any(known is not None for curve in case.curves for known in (curve.orders.get(norm), curve.theory.get(norm))):
        lines.append("Order: of the error in the step, observed; in brackets what theory says.")
    if any(bar.high > bar.low for bar in bars):
        span = "from the least to the largest error"
        if case.reference.is_statistic(norm):
            span = "two standard errors either way"
        lines.append(f"Point: mean over the {case.repeated}; the line across it: {span}.")
    if any(not case.reference.trusts(norm, bar.mean) for bar in bars):
        apart = compact(case.reference.agreement[norm])
        lines.append(f"Hollow: an error below {TRUSTED:g} times what the references differ by ({apart}) says little.")
    if any(bar.mean <= 0 for bar in bars):
        lines.append("Triangle at the left edge: no error at all.")
    if sheet.kinds:
        lines.append("Cross: failed, at what it cost; a count beside it: so many repeats, the others have an error.")
    costless = [point for point in points if sheet.height(point) is None]
    failed = sum(point.failed for point in costless)
    if failed:
        lines.append(f"The {what} of {failed} that failed is not known: their crosses are at the upper edge.")
    if len(costless) > failed:
        lines.append(f"The {what} of {len(costless) - failed} points is not known: they are not here.")
    return lines


def _saved(chart: Figure, suffix: str) -> bytes:
    """The chart as bytes, reproducible as far as matplotlib allows."""
    buffer = io.BytesIO()
    with matplotlib.rc_context({"svg.hashsalt": "carom", "svg.fonttype": "path"}):
        extra: dict[str, Any] = {"metadata": {"Date": None}} if suffix == "svg" else {"dpi": canvas.DPI}
        chart.savefig(buffer, format=suffix, facecolor=canvas.BACKGROUND, **extra)
    return buffer.getvalue()


def _slug(name: str) -> str:
    """A file name."""
    return re.sub(r"[^A-Za-z0-9_]+", "-", name).strip("-")


# -- the styles that tell curves apart ------------------------------------------------------------


@dataclass(frozen=True)
class Style:
    """How a curve is drawn."""

    colour: str
    line: str
    marker: str
    size: float
    width: float


def styles(curves: Sequence[Curve]) -> list[Style]:
    """One colour per curve if there are few; with many the colour stands for the integrator, the line for the collision
    mode, the marker for substeps and geometry. Other engines are dashed and without colour."""
    cells = [curve.points[0].cell for curve in curves]
    own = [cell for cell in cells if cell.engine == CAROM]
    peers = [cell for cell in cells if cell.engine != CAROM]
    many = len(curves) > FEW
    colour = _numbered(own, (lambda cell: cell.integrator) if many else (lambda cell: cell))
    marker = _numbered(own, (lambda cell: (cell.substeps, cell.geometry)) if many else (lambda cell: cell))
    peer_marker = _numbered(peers, lambda cell: cell)
    made = []
    for place, cell in enumerate(cells):
        share = place / max(len(cells) - 1, 1)
        sizes = [first + (last - first) * share for first, last in (MARKS, WIDTHS)]
        if cell.engine == CAROM:
            line = LINES.get(cell.collision, "-") if many else "-"
            made.append(Style(COLOURS[colour(cell) % len(COLOURS)], line, MARKERS[marker(cell) % len(MARKERS)], *sizes))
        else:
            made.append(Style(PEER, PEER_LINE, MARKERS[::-1][peer_marker(cell) % len(MARKERS)], *sizes))
    return made


def _numbered(cells: Sequence[Cell], key: Callable[[Cell], Hashable]) -> Callable[[Cell], int]:
    """A function from a cell to the index of its key among the keys present."""
    places = {found: place for place, found in enumerate(dict.fromkeys(key(cell.method) for cell in cells))}
    return lambda cell: places[key(cell.method)]
