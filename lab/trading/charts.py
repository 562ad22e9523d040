"""Work-precision charts of a trade: the error on the x axis, the cost on the y axis, one curve per method.

Failed points have a cost but no error: they are crosses at the right edge.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ..cli.usage_errors import Problem
from ..pictures import canvas
from ..reporting.text import compact, number
from .records import CAROM, TRUSTED, CaseTrade, Curve, Point, Trade
from .report import error_heading, measured, norm_of, order

WORK, TIME = "work", "time"
AXIS = {
    WORK: "work per simulated second (weighted counts)",
    TIME: "wall time per simulated second, ms",
}

SIZE, ROW = (10.0, 7.2), 0.18  # inches: the chart without its legend, a row of that
LEAST_ERROR = 1e-17  # where all errors are 0
COLOURS = ("#4dabf7", "#ffa94d", "#51cf66", "#ff6b6b", "#b197fc", "#ffd43b", "#22d3c5", "#f78fd0")
MARKERS = "osD^vPpXh"  # one less than a multiple of the colours: they pair in many ways
LINES = {"discrete": "-", "continuous": "-.", "event_driven": ":"}
WIDTHS, MARKS = (2.6, 1.3), (8.5, 4.5)  # points, of the first and the last curve: covered ones stay visible


@canvas.styled
def draw(trade: Trade, folder: Path, norm: str | None = None) -> list[Path]:
    """Draw charts of all measured cases as PNG and SVG in ``folder``: by work and, if timed, by wall time.

    ``norm``: used for cases that have it; the others use their first one. Problem for the folder.
    """
    made: list[Path] = []
    for case in measured(trade):
        for quantity in quantities(case):
            words = ("trade", case.scene, norm_of(case, norm), quantity)
            name = "-".join(re.sub(r"[^A-Za-z0-9_]+", "-", word).strip("-") for word in words)
            name = name if folder / f"{name}.png" not in made else f"{name}-{len(made)}"
            chart = figure(case, quantity, norm)
            for suffix in ("png", "svg"):
                path = folder / f"{name}.{suffix}"
                try:
                    folder.mkdir(parents=True, exist_ok=True)
                    with matplotlib.rc_context({"svg.hashsalt": "carom"}):  # the same file each time
                        dated = {"Date": None} if suffix == "svg" else {}
                        chart.savefig(path, facecolor=canvas.BACKGROUND, dpi=canvas.DPI, metadata=dated)
                except OSError as error:
                    raise Problem(f"{path}: {error.strerror or error}") from error
                made.append(path)
    return made


def quantities(case: CaseTrade) -> list[str]:
    """WORK, and TIME if a point was timed."""
    return [WORK, TIME] if any(point.milliseconds for point in case.points) else [WORK]


@canvas.styled
def figure(case: CaseTrade, quantity: str = WORK, norm: str | None = None) -> Figure:
    """One chart: WORK or TIME over the error of ``norm``, the case's first if it does not have it."""
    norm = norm_of(case, norm)
    rows = -(-len(case.curves) // 2)
    made = Figure(figsize=(SIZE[0], SIZE[1] + ROW * rows), layout="constrained")
    FigureCanvasAgg(made)
    axes = made.subplots()
    axes.set(xscale="log", yscale="log", xlabel=error_heading(norm), ylabel=AXIS[quantity])
    axes.margins(0.06)
    axes.grid(lw=0.7)
    least = min((error for p in case.points if (error := _error(p, norm)) > 0), default=10 * LEAST_ERROR) / 10
    for curve, style in zip(case.curves, styles(case.curves), strict=True):
        _draw_curve(axes, case, quantity, norm, curve, style, least)
    _label_steps(axes, case, quantity, norm)
    made.suptitle(case.scene, x=0.01, ha="left", fontsize=16, fontweight="bold")
    axes.set_title(f"{norm}: {case.norms[norm]}", loc="left", color=canvas.MUTED, fontsize=9.5, wrap=True)
    if case.curves:
        made.legend(*axes.get_legend_handles_labels(), ncols=2, loc="outside lower left", frameon=False, fontsize=8.5,
                    title="\n".join(_notes(case, norm)), title_fontsize=7.5, alignment="left")  # fmt: skip
    return made


def _error(point: Point, norm: str) -> float:
    """The mean error; NaN if there is none."""
    mean = point.errors[norm].mean if norm in point.errors else math.nan
    return mean if math.isfinite(mean) else math.nan


def _cost(point: Point, quantity: str) -> float:
    """NaN if it is unknown or not positive."""
    cost = point.work if quantity == WORK else point.milliseconds and point.milliseconds.median
    return cost if cost and math.isfinite(cost) and cost > 0 else math.nan


def _draw_curve(
    axes: Any, case: CaseTrade, quantity: str, norm: str, curve: Curve, style: dict[str, Any], least: float
) -> None:
    """The curve; its points, hollow where the reference cannot tell their error; bars, and crosses of failures."""
    colour = style["color"]
    axes.plot([], [], label=legend_text(curve, norm), **style)
    costs = [_cost(point, quantity) for point in curve.points]
    errors = [_error(point, norm) for point in curve.points]
    xs = [max(error, least) if error == error else error for error in errors]
    axes.plot(xs, costs, zorder=3, label=f"_{curve.label}", **{**style, "marker": ""})
    for point, x, y, error in zip(curve.points, xs, costs, errors, strict=True):
        if point.failed:
            edge = axes.get_yaxis_transform()
            axes.plot([0.99], [y], "x", transform=edge, color=colour, ms=6.5, mew=1.8, label="_failed")
        if math.isnan(error):
            continue
        bar, trusted = point.errors[norm], case.reference.trusts(norm, error)
        if math.isfinite(bar.high) and bar.high > bar.low:
            axes.hlines(y, max(bar.low, least), bar.high, color=colour, lw=1.0, alpha=0.45)
        look = {**style, "ls": "", "mfc": colour if trusted else canvas.PANEL}
        axes.plot([x], [y], zorder=4, label="_trusted" if trusted else "_untrusted", **look)


def _label_steps(axes: Any, case: CaseTrade, quantity: str, norm: str) -> None:
    """The steps at the points of the longest curve; the others have the same."""
    for point in max((curve.points for curve in case.curves), key=len, default=[]):
        error, cost = _error(point, norm), _cost(point, quantity)
        if error > 0 and cost > 0:
            axes.annotate(f"{number(point.cell.dt)} s", (error, cost), xytext=(6, 5), textcoords="offset points",
                          color=canvas.MUTED, fontsize=7)  # fmt: skip


def legend_text(curve: Curve, norm: str) -> str:
    """`velocity Verlet, order 2.0 (2)`, or `exact`, or the label alone if no order is known."""
    if curve.theory.get(norm) == math.inf:
        return f"{curve.label}, exact"
    return curve.label if curve.orders.get(norm) is None else f"{curve.label}, order {order(curve, norm)}"


def _notes(case: CaseTrade, norm: str) -> list[str]:
    """The meaning of the marks."""
    span = "two standard errors either way" if case.reference.is_statistic(norm) else "from the least to the largest"
    lines = [f"Point: mean over the {case.repeated}; the line across it: {span}. Order: observed (in theory)."]
    if any(not case.reference.trusts(norm, error) for point in case.points if (error := _error(point, norm)) >= 0):
        apart = compact(case.reference.agreement[norm])
        lines.append(f"Hollow: an error below {TRUSTED:g} times what the references differ by ({apart}) says little.")
    failures = dict.fromkeys(kind for point in case.points for kind, count in point.failures.items() if count)
    if failures:
        lines.append(f"Cross at the right edge: failed ({', '.join(failures)}), at what it cost.")
    return lines


def styles(curves: Sequence[Curve]) -> list[dict[str, Any]]:
    """A colour and a marker for each; the line tells the collision mode. Other engines are dashed, without colour."""
    made = []
    for place, curve in enumerate(curves):
        share = place / max(len(curves) - 1, 1)
        width, size = (first + (last - first) * share for first, last in (WIDTHS, MARKS))
        cell = curve.points[0].cell
        own = cell.engine == CAROM
        made.append({
            "color": COLOURS[place % len(COLOURS)] if own else canvas.TEXT, "marker": MARKERS[place % len(MARKERS)],
            "ls": LINES.get(cell.collision, "-") if own else "--", "lw": width, "ms": size,
        })  # fmt: skip
    return made
