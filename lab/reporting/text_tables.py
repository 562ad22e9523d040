"""Text tables, shown in a terminal or written as Markdown."""

from __future__ import annotations

from dataclasses import dataclass

from rich.console import Console
from rich.markup import escape
from rich.table import Table


@dataclass(frozen=True)
class TextTable:
    """``rows`` of cells under ``headings``; the first ``words`` columns hold words and are left-aligned."""

    title: str
    headings: tuple[str, ...]
    rows: list[tuple[str, ...]]
    words: int = 1

    def show(self, console: Console) -> None:
        """Print the table."""
        table = Table(title=self.title, title_justify="left", title_style="bold", box=None, pad_edge=False)
        for number, heading in enumerate(self.headings):
            table.add_column(heading, justify="left" if number < self.words else "right")
        for row in self.rows:
            table.add_row(*map(escape, row))
        console.print(table)
        console.print()

    def markdown(self) -> str:
        """The table as Markdown, under its title."""
        rules = ["---" if number < self.words else "---:" for number in range(len(self.headings))]
        lines = [f"| {' | '.join(cells)} |" for cells in (self.headings, rules, *self.rows)]
        return "\n".join([f"**{self.title}**", "", *lines])
