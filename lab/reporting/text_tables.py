"""Text tables, shown in a terminal or written as Markdown."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from ..cli.usage_errors import Problem


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


def between_marks(path: Path, name: str) -> tuple[str, str, str]:
    """A page up to the comment ``<!-- name -->``, to ``<!-- end of name -->`` and after; Problem if one is missing."""
    first, last = f"<!-- {name} -->", f"<!-- end of {name} -->"
    try:
        page = path.read_text(encoding="utf-8")
    except OSError as error:
        raise Problem(f"--into {path}: {error.strerror or error}") from error
    before, mark, rest = page.partition(first)
    inside, end, after = rest.partition(last)
    if not (mark and end):
        raise Problem(f"--into {path}: it has no line {first} with a line {last} after it")
    return before + mark, inside, end + after


def replace_between_marks(path: Path, name: str, text: str) -> None:
    """Replace the text between the two comments of a page; Problem if they are missing."""
    before, _, after = between_marks(path, name)
    try:
        path.write_text(f"{before}\n\n{text}\n\n{after}", encoding="utf-8")
    except OSError as error:
        raise Problem(f"--into {path}: {error.strerror or error}") from error
