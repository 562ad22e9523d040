"""Output of a command's result: the terminal, JSON, Markdown, a chart."""

from __future__ import annotations

import importlib
import json
from dataclasses import dataclass
from typing import Any

import click

from ..cli.usage_errors import Problem
from .text import TextTable, as_markdown, plain_console


@dataclass(frozen=True)
class Output:
    """What a command prints, and for whom; Problem, before the long run, for options that exclude each other."""

    as_json: bool
    as_markdown: bool

    def __post_init__(self) -> None:
        if self.as_json and self.as_markdown:
            raise Problem("--json and --markdown exclude each other")

    def show(self, result: Any, tables: list[TextTable], remarks: list[str]) -> None:
        """Print the result."""
        if self.as_json:
            click.echo(json.dumps(result.as_dict(), indent=2))
        elif self.as_markdown:
            click.echo(as_markdown(tables, remarks))
        else:
            show_tables(tables, remarks)


def show_tables(tables: list[TextTable], remarks: list[str]) -> None:
    """For a person."""
    console = plain_console()
    for table in tables:
        table.show()
        console.print()
    for remark in remarks:
        console.print(remark, style="dim")


def drawing_if_there(name: str, what: str) -> Any:
    """A module of the lab that draws; without matplotlib None, and a note on stderr with the name of the extra."""
    try:
        return importlib.import_module(f"..{name}", __package__)
    except ImportError:
        reason = "matplotlib is missing; it comes with the extra: pip install 'carom[plot]'"
        click.echo(f"carom: {what} {reason}", err=True)
        return None
