"""The tables of ``carom bench``: times and ratios, quality figures, and the settings of both engines."""

from __future__ import annotations

import math
from typing import Any

from ..measure.timing import Spread
from ..reporting.text_tables import TextTable
from ..wording import NOTHING, number
from .results import Result, Row, machine_line

CAROM_SETTINGS = ("dt", "integrator", "collision", "substeps")
PYMUNK_SETTINGS = ("iterations", "collision_slop", "collision_bias", "damping", "threads", "sleeping")


def tables(result: Result) -> list[TextTable]:
    """All tables of the result."""
    steps = [row for row in result.rows if row.energy]
    stacks = [row for row in steps if row.energy == "left"]
    queries = [row for row in result.rows if row.unit != "step"]
    made = [times(result.rows, result.repeats)]
    if steps:
        made.append(quality(steps))
    if stacks:
        made.append(motion(stacks))
    if queries:
        made.append(answers(queries))
    return made


def times(rows: list[Row], repeats: int) -> TextTable:
    """Milliseconds and ratios."""
    cells = [
        (
            row.label,
            digits(row.carom_ms.median),
            digits(row.carom_fast_ms.median),
            digits(row.peer_ms.median) if row.peer_ms else NOTHING,
            digits(row.peer_fast_ms.median) if row.peer_fast_ms else NOTHING,
            row.peer_index or NOTHING,
            digits(row.ratio.median) if row.ratio else NOTHING,
            span(row.ratio) if row.ratio else NOTHING,
            f"{row.target:.3g}" if row.target else NOTHING,
        )
        for row in rows
    ]
    what = "ms per 1,000 queries" if rows and all(row.unit != "step" for row in rows) else "ms per step"
    if len({row.unit for row in rows}) > 1:
        what = "ms per step, of player_query per 1,000 queries"
    medians = f"medians of {repeats} repeats" if repeats > 1 else "one repeat"
    title = f"{what}: {medians}; p10: a tenth of the steps took less; ratio: pymunk's median over carom's"
    headings = ("scene", "carom", "p10", "pymunk", "p10", "index", "ratio", "from .. to", "target")
    return TextTable(title, headings, cells)


def quality(rows: list[Row]) -> TextTable:
    """Quality of the states reached in the timed steps, carom first."""
    engines = list(rows[0].quality)
    cells = []
    for row in rows:
        of = [row.quality[engine] for engine in engines]
        overlap = [[percent(one[name]) for one in of] for name in ("overlap_mean", "overlap_max")]
        escaped = [f"{one['escaped']:.0f}" for one in of]
        cells.append((row.label, energy(row.energy, of), *map(both, (*overlap, escaped))))
    title = f"quality, {' / '.join(engines)}: kinetic energy kept or left, overlaps in % of a diameter, bodies escaped"
    return TextTable(title, ("scene", "kinetic energy", "mean overlap", "deepest", "escaped"), cells)


def motion(rows: list[Row]) -> TextTable:
    """The largest displacement of bodies that should come to rest."""
    engines = list(rows[0].quality)
    cells = [
        (row.label, *(both([digits(row.quality[engine][name]) for engine in engines]) for name in ("drift", "sink")))
        for row in rows
    ]
    title = f"farthest way from the start, {' / '.join(engines)}: sideways and downwards, in m"
    return TextTable(title, ("scene", "sideways", "downwards"), cells)


def answers(rows: list[Row]) -> TextTable:
    """The figures of the queries, which show that both engines ran the same ones."""
    engines = list(rows[0].quality)
    cells = []
    for row in rows:
        figure = next(iter(row.quality[engines[0]]))
        values = [f"{row.quality[engine][figure]:,.6g}" for engine in engines]
        cells.append((row.label, figure, *values))
    return TextTable("answers to 1,000 queries", ("scene", "what", *engines), cells, words=2)


def remarks(result: Result) -> list[str]:
    """Machine and engine settings, one line each."""
    compiling = sum({(row.name, row.bodies): row.compile_seconds for row in result.rows}.values())
    lines = [machine_line(result.machine), f"compiling and loading kernels: {compiling:.1f} s, not counted"]
    for engine, names in (("carom", CAROM_SETTINGS), ("pymunk", PYMUNK_SETTINGS)):
        values = result.settings.get(engine)
        if values:
            lines.append(f"{engine}: {', '.join(f'{name} {_value(values[name])}' for name in names)}")
            if engine == "carom":
                lines[-1] += "".join(f"; {name}: {what}" for name, what in _other_settings(result.rows).items())
    if "pymunk" in result.settings:
        lines[-1] += (
            "; moments infinite; index: its tree of boxes or its spatial hash (cells of two"
            " diameters), whichever was faster in the first repeat"
        )
    return lines


def _other_settings(rows: list[Row]) -> dict[str, str]:
    """Non-default settings by scene name."""
    return {
        row.name: ", ".join(f"{name} {_value(value)}" for name, value in row.settings.items())
        for row in rows
        if row.settings
    }


def energy(kind: str, of: list[dict[str, float]]) -> str:
    """Kinetic energy: a percentage of the start's if it must be kept, joules if it must be dissipated."""
    if kind == "kept":
        return both([f"{100 * one['kinetic_end'] / one['kinetic_start']:.3f}" for one in of]) + " %"
    return both([digits(one["kinetic_end"]) for one in of]) + " J"


def both(cells: list[str]) -> str:
    """Both engines' figures in one cell."""
    return " / ".join(cells)


def span(spread: Spread) -> str:
    """The range from least to largest."""
    return f"{digits(spread.low)} .. {digits(spread.high)}"


def digits(value: float) -> str:
    """Three significant digits, without an exponent where that is short."""
    if value == 0 or not math.isfinite(value):
        return f"{value:g}"
    places = 2 - math.floor(math.log10(abs(value)))
    if places > 6:
        return f"{value:.2g}"
    return f"{value:,.{max(places, 0)}f}"


def percent(value: float) -> str:
    """A percentage of a diameter, two digits."""
    return f"{100 * value:.2g}" if value < 1 else f"{100 * value:.0f}"


def _value(value: Any) -> str:
    return number(value) if isinstance(value, float) else str(value)
