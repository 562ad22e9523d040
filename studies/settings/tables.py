"""The tables: cost and error of each value of each field, and what the errors mean."""

from __future__ import annotations

from typing import Any

from carom.lab.measure.timing import Spread
from carom.lab.reporting.text import NOTHING, TextTable, compact
from carom.lab.trading.trade import quoted, seconds_text

from ..runner import Line, Result, Sample
from .fields import VARIED, Varied

ROUNDING = 1e-6  # smaller errors are shown as this limit


def report(result: Result) -> tuple[list[TextTable], list[str]]:
    """Tables of cost and errors, and of what the errors mean; how and where it was timed."""
    studied = [(varied, line) for line in result.lines for varied in VARIED if _is_of(varied, line)]
    tables = [values(studied), meanings(studied)]
    spread = max((of.high - of.low) / of.median for _, line in studied for of in times(line).values())
    repeats = f"{result.repeats} repeats" if result.repeats > 1 else "one repeat"
    return tables, [
        f"time: {result.machine['clock']}, medians of {repeats}, in which the values take turns; the "
        f"repeats of one value lie at most {100 * spread:.0f} % apart; no compiling is in it; "
        f"{result.machine['processor']}",
        "work: weighted sum of steps, evaluations of forces, pairs, impacts and loops of the solver, the same on every "
        "machine",
    ]


def _is_of(varied: Varied, line: Line) -> bool:
    return (varied.field, varied.scene) == (line.axis, line.of)


def default_of(line: Line) -> Sample:
    """The sample that the others are compared with."""
    (varied,) = (varied for varied in VARIED if _is_of(varied, line))
    return line.sample(varied.default)


def times(line: Line) -> dict[Any, Spread]:
    """Processor time by value, relative to the default value within each repeat."""
    own = default_of(line).figures["seconds"].values
    return {
        sample.value: Spread.of([a / b for a, b in zip(sample.figures["seconds"].values, own, strict=True)])
        for sample in line.samples
    }


def values(studied: list[tuple[Varied, Line]]) -> TextTable:
    """One row per value."""
    rows = []
    for varied, line in studied:
        time, own = times(line), default_of(line)
        for place, sample in enumerate(line.samples):
            errors = ", ".join(_amount(sample.facts[name], unit) for name, unit in varied.errors.items())
            rows.append((
                *((varied.field, varied.scene) if place == 0 else ("", "")),
                source(varied.field, sample.value) + " (default)" * (sample is own),
                ratio(time[sample.value].median),
                ratio(sample.facts["work"] / own.facts["work"]),
                errors,
            ))  # fmt: skip
    title = "each field alone: time and work per simulated second, the default value's being 1; what goes wrong"
    return TextTable(title, ("field", "scene", "value", "time", "work", "error"), rows, words=3)


def meanings(studied: list[tuple[Varied, Line]]) -> TextTable:
    """The meaning of the errors, each once."""
    rows, said = [], {}
    for varied, line in studied:
        rows.append((
            varied.field,
            varied.scene,
            compact(1e3 * default_of(line).figures["seconds"].median),
            ", ".join(f"{name}={source(name, of)}" for name, of in varied.others.items()) or NOTHING,
            said.get(varied.words, varied.words),
        ))  # fmt: skip
        said.setdefault(varied.words, f"as for {varied.field}, {varied.scene}")
    title = "what the errors are; ms per simulated second with the default value; fields that are set otherwise there"
    return TextTable(title, ("field", "scene", "ms", "set otherwise", "the error"), rows, words=5)


def ratio(of: float) -> str:
    """Two decimals, because ratios are compared with 1."""
    return f"{of:.2f}" if of < 10 else compact(of)


def source(field: str, of: Any) -> str:
    """The value as Python source; a step as a fraction."""
    return seconds_text(of) if field == "dt" else quoted(of)


def _amount(amount: float, unit: str) -> str:
    text = f"{amount:.0f}" if amount == round(amount) and abs(amount) < 1e6 else compact(amount)
    if 0 < abs(amount) < ROUNDING:
        text = f"< {ROUNDING:g}"
    return f"{text} {unit}".strip()
