"""The limits as tables: one per axis; methods with equal limits share a row."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

from carom.lab.reporting.text import NOTHING, TextTable

from ..runner import Axis, Line, Result
from . import contacts, motion
from .edges import BREAKS, DOWN, LEVELS, Edge, Quantity, axis_of, edge, home_of

LONGEST = 90  # characters of a reason
ROUNDING = 1e-9  # smaller errors count as rounding
MOST = 10.0  # larger errors are shown as "over"
QUANTITIES = (*motion.QUANTITIES, *contacts.QUANTITIES)


def axes(quick: bool = False, long: bool = False) -> list[Axis]:
    """Each quantity with each of its methods."""
    return [axis_of(each, method, each.chosen(quick, long)) for each in QUANTITIES for method in each.methods]


def by_quantity(result: Result) -> list[tuple[Quantity, list[Line]]]:
    """The quantities of the result, each with its lines."""
    measured = {line.axis for line in result.lines}
    return [
        (quantity, [line for line in result.lines if line.axis == quantity.name])
        for quantity in QUANTITIES if quantity.name in measured
    ]  # fmt: skip


def report(result: Result) -> tuple[list[TextTable], list[str]]:
    """One table for each quantity, and how to read them."""
    tables = [table(quantity, lines) for quantity, lines in by_quantity(result)]
    return tables, [
        "A level is passed at the figure given, found to the axis's precision; a .. b: between these two, not narrowed "
        "down. Worst: the largest error where nothing breaks. "
        f"carom {result.machine['carom']}, numpy {result.machine['numpy']}."
    ]


def table(quantity: Quantity, lines: Sequence[Line]) -> TextTable:
    """Where the error passes each level, and where it breaks."""
    values = [sample.value for line in lines for sample in line.samples]
    both_ways = min(values) < home_of(quantity, values)
    rows: dict[tuple[str, ...], list[str]] = {}
    for line in lines:
        edges = {level: edge(quantity, line.samples, level) for level in (*LEVELS, BREAKS)}
        cells = [_edge(found) for found in edges.values()]
        cells += [_below(quantity, line)] if both_ways else []
        cells += [_worst(line), textwrap.shorten(edges[BREAKS].why, LONGEST, placeholder=" ...") or NOTHING]
        rows.setdefault(tuple(cells), []).append(line.of)
    unit = f" ({quantity.unit})" if quantity.unit else ""
    headings = ("method", "1 % at", "10 % at", "breaks at", *["downwards"] * both_ways, "worst", "how")
    body = [(", ".join(names), *cells) for cells, names in rows.items()]
    return TextTable(f"{quantity.title}{unit}. Error: {quantity.norm}", headings, body)


def number(value: float) -> str:
    """Three significant digits: 2,050 and 1e15."""
    if 1e3 <= value < 1e5:
        return f"{float(f'{value:.3g}'):,.0f}"
    mantissa, _, exponent = f"{value:.3g}".partition("e")
    return f"{mantissa}e{int(exponent)}" if exponent else mantissa


def _edge(found: Edge) -> str:
    if found.value is None:
        return f"not up to {number(found.last or 0.0)}"
    if found.last is None:
        return f"from {number(found.value)} on"
    wide = max(found.value / found.last, found.last / found.value) > 1.2 and found.value - found.last > 1
    return f"{number(found.last)} .. {number(found.value)}" if wide else number(found.value)


def _below(quantity: Quantity, line: Line) -> str:
    edges = {level: edge(quantity, line.samples, level, DOWN) for level in (*LEVELS, BREAKS)}
    found = [f"{level} at {number(found.value)}" for level, found in edges.items() if found.value is not None]
    return ", ".join(found) or f"fine to {number(edges[BREAKS].last or 0.0)}"


def _worst(line: Line) -> str:
    facts = [sample.facts for sample in line.samples]
    errors = [of["error"] for of in facts if of["error"] is not None and not of["broken"]]
    if not errors:
        return NOTHING
    worst = max(errors)
    if worst < ROUNDING:
        return "rounding"
    return f"{number(float(f'{100 * worst:.2g}'))} %" if worst < MOST else f"over {number(100 * MOST)} %"
