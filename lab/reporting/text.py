"""Numbers, counts, tables and records as the reports of the laboratory write them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

NOTHING = "-"


def number(value: float) -> str:
    """Four digits, and 1/60 if the value is exactly that."""
    if 0 < value < 0.1 and math.isclose(1 / value, round(1 / value), rel_tol=1e-9):
        return f"1/{round(1 / value)}"
    return f"{value:.4g}"


def compact(value: float, digits: int = 3) -> str:
    """A number with that many significant digits: 0.0123, 1,230, 1.23e-5, 4.56e7."""
    if not math.isfinite(value):
        return f"{value:g}"
    mantissa, _, exponent = f"{value:.{digits - 1}e}".partition("e")
    power = int(exponent)
    if value == 0:
        return "0"
    if power < -3 or power > 5:
        return f"{mantissa}e{power}"
    return f"{float(f'{mantissa}e{power}'):,.{max(digits - 1 - power, 0)}f}"


def span(spread: Any) -> str:
    """`0.123 .. 0.456`, the least and the largest of some values."""
    return f"{compact(spread.low)} .. {compact(spread.high)}"


def counted(count: int, what: str, plural: str = "") -> str:
    """`1 run`, `2,000 runs`; plural: of a word that takes no s."""
    return f"{count:,} {what if count == 1 else plural or what + 's'}"


def values_text(values: Sequence[float]) -> str:
    """What a game compares: a number, a place, or `none` for NaN."""
    text = ", ".join(f"{value:.4g}" for value in values)
    return "none" if any(map(math.isnan, values)) else f"({text})" if len(values) > 1 else text


def metres(value: float) -> str:
    """A length: 4.2 mm, 12 cm, 3.4 m; the unit is that of the scene."""
    size = abs(value)
    if size < 1e-6:
        return "less than 0.001 mm"
    if size < 0.01:
        return f"{1e3 * size:.2g} mm"
    return f"{100 * size:.2g} cm" if size < 1 else f"{size:.3g} m"


def plain_console(stderr: bool = False) -> Any:
    """A rich Console that prints texts as they are: brackets in faults, names and paths are no markup."""
    from rich.console import Console

    return Console(stderr=stderr, markup=False, highlight=False, emoji=False)


@dataclass(frozen=True)
class TextTable:
    """``rows`` of cells under ``headings``; the first ``words`` columns, and others with ``left``, are left-aligned."""

    title: str
    headings: tuple[str, ...]
    rows: list[tuple[str, ...]]
    words: int = 1
    left: tuple[int, ...] = ()

    def show(self) -> None:
        """Print the table."""
        from rich.table import Table  # only here: numbers need nothing of it

        table = Table(title=self.title or None, title_justify="left", title_style="bold", box=None,
                      pad_edge=False, show_header=any(self.headings))  # fmt: skip
        for place, heading in enumerate(self.headings):
            words = place < self.words or place in self.left
            table.add_column(heading, justify="left" if words else "right", no_wrap=place == 0 and len(self.left) > 0)
        for row in self.rows:
            table.add_row(*row)
        plain_console().print(table)

    def markdown(self) -> str:
        """The table as Markdown, under its title."""
        rules = ["---" if place < self.words else "---:" for place in range(len(self.headings))]
        lines = [f"| {' | '.join(cells)} |" for cells in (self.headings, rules, *self.rows)]
        return "\n".join([f"**{self.title}**", "", *lines])


def as_markdown(tables: list[TextTable], remarks: list[str]) -> str:
    """The tables, then the remarks, as Markdown."""
    return "\n\n".join([*(table.markdown() for table in tables), *remarks])


def jsonable(value: Any) -> Any:
    """Records as plain data, with None instead of numbers that JSON cannot represent: infinity and NaN."""
    if isinstance(value, Mapping):
        return {key: jsonable(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [jsonable(item) for item in value]
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return jsonable(dataclasses.asdict(value))
    if isinstance(value, np.ndarray):
        return jsonable(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value
