"""The limits as tables: one per axis; methods with equal limits share a row."""

from __future__ import annotations

from ...reporting.text_tables import TextTable
from ...wording import NOTHING
from .records import BREAKS, DOWN, LEVELS, AxisLimits, Edge, Limits, Line

LONGEST = 90  # characters of a reason
ROUNDING = 1e-9  # smaller errors count as rounding
MOST = 10.0  # larger errors are shown as "over"


def tables(result: Limits) -> list[TextTable]:
    """One for each axis."""
    return [table(axis) for axis in result.axes]


def remarks(result: Limits) -> list[str]:
    """How to read the tables."""
    return [
        "A level is passed at the figure given, found to the axis's precision; a .. b: between these two, not narrowed "
        "down. Worst: the largest error where nothing breaks. "
        f"carom {result.machine['carom']}, numpy {result.machine['numpy']}."
    ]


def table(axis: AxisLimits) -> TextTable:
    """Where the error passes each level, and where it breaks."""
    both_ways = any(edge.way == DOWN for line in axis.lines for edge in line.edges)
    rows: dict[tuple[str, ...], list[str]] = {}
    for line in axis.lines:
        cells = [_edge(line.edge(level)) for level in (*LEVELS, BREAKS)]
        cells += [_below(line)] if both_ways else []
        cells += [_worst(line), _short(line.edge(BREAKS).why) or NOTHING]
        rows.setdefault(tuple(cells), []).append(line.method)
    unit = f" ({axis.unit})" if axis.unit else ""
    headings = ("method", "1 % at", "10 % at", "breaks at", *["downwards"] * both_ways, "worst", "how")
    body = [(", ".join(names), *cells) for cells, names in rows.items()]
    return TextTable(f"{axis.title}{unit}. Error: {axis.norm}", headings, body)


def number(value: float) -> str:
    """Three significant digits: 2,050 and 1e15."""
    if 1e3 <= value < 1e5:
        return f"{float(f'{value:.3g}'):,.0f}"
    mantissa, _, exponent = f"{value:.3g}".partition("e")
    return f"{mantissa}e{int(exponent)}" if exponent else mantissa


def _edge(edge: Edge) -> str:
    if edge.value is None:
        return f"not up to {number(edge.last or 0.0)}"
    if edge.last is None:
        return f"from {number(edge.value)} on"
    wide = max(edge.value / edge.last, edge.last / edge.value) > 1.2 and edge.value - edge.last > 1
    return f"{number(edge.last)} .. {number(edge.value)}" if wide else number(edge.value)


def _below(line: Line) -> str:
    found = [
        f"{level} at {number(edge.value)}"
        for level in (*LEVELS, BREAKS)
        if (edge := line.edge(level, DOWN)).value is not None
    ]
    return ", ".join(found) or f"fine to {number(line.edge(BREAKS, DOWN).last or 0.0)}"


def _worst(line: Line) -> str:
    errors = [sample.error for sample in line.samples if sample.error is not None and not sample.broken]
    if not errors:
        return NOTHING
    worst = max(errors)
    if worst < ROUNDING:
        return "rounding"
    return f"{number(float(f'{100 * worst:.2g}'))} %" if worst < MOST else f"over {number(100 * MOST)} %"


def _short(why: str) -> str:
    return why if len(why) <= LONGEST else f"{why[:LONGEST].rsplit(' ', 1)[0]} ..."
