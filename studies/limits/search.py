"""Where the error of a quantity passes each level, as tables and as a chart."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from carom.framework import CaromError
from carom.lab.cli.usage_errors import one_line
from carom.lab.reporting.text import NOTHING, TextTable

from ..runner import Axis, Line, Result
from .worlds import QUANTITIES, BrokenError, Method, Quantity

BREAKS = "breaks"
LEVELS = {"1 %": 0.01, "10 %": 0.1, BREAKS: math.inf}
LARGEST = 1e6  # larger errors count as broken
LONGEST = 90  # characters of a reason
ROUNDING, MOST = 1e-9, 10.0  # smaller errors are shown as rounding, larger ones as "over"

Found = dict[float, tuple[float | None, str]]  # by value: the error, if it has one, and how it broke, else ""


def axes(quick: bool = False) -> list[Axis]:
    """Each quantity with all its methods."""
    searches = [(each, partial(search, each, each.quick if quick else each.values)) for each in QUANTITIES]
    return [Axis(each.name, "", tuple(each.methods), facts=found) for each, found in searches]


def search(quantity: Quantity, values: tuple[float, ...], name: str) -> Found:
    """Outwards until a value has no error, then by halves what each level is narrowed down with."""
    method, found = quantity.methods[name], {}
    for value in values:
        found[value] = outcome(quantity, method, value)
        if found[value][0] is None:
            break
    for level in LEVELS:
        while (middle := _between(quantity, *edge(found, level))) is not None:
            found[middle] = outcome(quantity, method, middle)
    return found


def outcome(quantity: Quantity, method: Method, value: float) -> tuple[float | None, str]:
    """The error of one value; an error raised by carom breaks it."""
    try:
        with np.errstate(all="ignore"):
            error = float(quantity.measure(method, value))
    except BrokenError as broken:
        return broken.error, str(broken)
    except (CaromError, ValueError, ArithmeticError, MemoryError) as error:
        return None, f"refused: {one_line(error.__cause__ or error)}"
    if not error < LARGEST:
        return None, "blows up" if math.isfinite(error) else "not finite"
    return error, ""


def edge(found: Found, level: str) -> tuple[float | None, float | None]:
    """The last value before the level is passed, and the first one after that; None for none."""
    last = None
    for value, (error, broken) in sorted(found.items()):
        if broken if level == BREAKS else error is None or error > LEVELS[level]:
            return last, value
        last = value
    return last, None


def _between(quantity: Quantity, good: float | None, bad: float | None) -> float | None:
    """The value that halves the edge on a logarithmic scale; None if it is narrow enough."""
    if good is None or bad is None or quantity.fine is None or bad / good <= quantity.fine:
        return None
    middle = math.sqrt(bad * good)
    if not quantity.whole:
        return middle
    return None if bad - good <= 1 else float(min(max(round(middle), good + 1), bad - 1))


# -- tables -----------------------------------------------------------------------------------------------------------


def report(result: Result) -> tuple[list[TextTable], list[str]]:
    """One table for each quantity, in which methods with equal limits share a row, and how to read them."""
    return [_table(quantity, line) for quantity, line in measured(result)], [
        "A level is passed at the figure given, found to the axis's precision; a .. b: between these two, not narrowed "
        "down. Worst: the largest error where nothing breaks. "
        f"carom {result.machine['carom']}, numpy {result.machine['numpy']}."
    ]


def measured(result: Result) -> Iterator[tuple[Quantity, Line]]:
    by_name = {quantity.name: quantity for quantity in QUANTITIES}
    return ((by_name[line.axis], line) for line in result.lines)


def _table(quantity: Quantity, line: Line) -> TextTable:
    rows: dict[tuple[str, ...], list[str]] = {}
    for sample in line.samples:
        found: Any = sample.facts
        why = next((broken for _, (_, broken) in sorted(found.items()) if broken), NOTHING)
        cells = *(_place(*edge(found, level)) for level in LEVELS), _worst(found)
        rows.setdefault((*cells, textwrap.shorten(why, LONGEST, placeholder=" ...")), []).append(sample.value)
    unit = f" ({quantity.unit})" if quantity.unit else ""
    headings = ("method", "1 % at", "10 % at", "breaks at", "worst", "how")
    body = [(", ".join(names), *cells) for cells, names in rows.items()]
    return TextTable(f"{quantity.title}{unit}. Error: {quantity.norm}", headings, body)


def draw_chart(result: Result, folder: Path) -> list[Path]:
    """A panel for each quantity."""
    from .chart import draw  # matplotlib is needed for pictures alone

    return [draw(result, folder)]


def number(value: float) -> str:
    """Three significant digits: 2,050 and 1e15."""
    if 1e3 <= value < 1e5:
        return f"{float(f'{value:.3g}'):,.0f}"
    mantissa, _, exponent = f"{value:.3g}".partition("e")
    return f"{mantissa}e{int(exponent)}" if exponent else mantissa


def _place(good: float | None, bad: float | None) -> str:
    if bad is None:
        return f"not up to {number(good or 0.0)}"
    if good is None:
        return f"from {number(bad)} on"
    return f"{number(good)} .. {number(bad)}" if bad / good > 1.2 and bad - good > 1 else number(bad)


def _worst(found: Mapping[float, tuple[float | None, str]]) -> str:
    worst = max((error for error, broken in found.values() if error is not None and not broken), default=None)
    if worst is None or worst < ROUNDING:
        return NOTHING if worst is None else "rounding"
    return f"{number(float(f'{100 * worst:.2g}'))} %" if worst < MOST else f"over {number(100 * MOST)} %"
