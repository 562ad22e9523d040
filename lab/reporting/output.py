"""Output of a command's result: the terminal, JSON, Markdown, a chart."""

from __future__ import annotations

import importlib
import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
from rich.console import Console

from ..cli.options import writable_folder
from ..cli.usage_errors import Problem
from .text_tables import TextTable


@dataclass(frozen=True)
class Output:
    """``charts``: the module that draws, or None."""

    as_json: bool
    as_markdown: bool
    out: Path | None
    charts: Any

    @property
    def plain(self) -> bool:
        """True if a person reads stdout."""
        return not self.as_json and not self.as_markdown

    @staticmethod
    def checked(as_json: bool, as_markdown: bool, out: Path | None = None, charts: str = "bench.charts") -> Output:
        """Problem for impossible options, raised before the long run. charts: the lab's module that draws."""
        if as_json and as_markdown:
            raise Problem("--json and --markdown exclude each other")
        if out is None:
            return Output(as_json, as_markdown, out, None)
        module = drawing_module(charts, "--out:", "bench")
        writable_folder(out)
        return Output(as_json, as_markdown, out, module)

    def as_it_comes(self, answer: Callable[[Any], list[str]]) -> Callable[[Any], None]:
        """Prints what is known so far, with the seconds that it took, for a person; nothing for others."""
        began = time.monotonic()

        def show(known: Any) -> None:
            if self.plain:
                first, *lines = answer(known)
                click.echo("\n".join([f"after {time.monotonic() - began:.0f} s: {first}", *lines, ""]))

        return show

    def show(self, result: Any, tables: list[TextTable], remarks: list[str]) -> None:
        """Print the result."""
        if self.as_json:
            click.echo(json.dumps(result.as_dict(), indent=2))
        elif self.as_markdown:
            click.echo(as_markdown(tables, remarks))
        else:
            console = Console()
            for table in tables:
                table.show(console)
            for remark in remarks:
                console.print(remark, style="dim", highlight=False)

    def draw(self, function: str, result: Any) -> None:
        """Draw the chart if requested, and print its path."""
        if self.charts is None:
            return
        picture = getattr(self.charts, function)(result, self.out)
        click.echo(f"chart: {picture}" if picture is not None else "no chart: nothing is compared", err=True)


def as_markdown(tables: list[TextTable], remarks: list[str]) -> str:
    """The tables, then the remarks, as Markdown."""
    return "\n\n".join([*(table.markdown() for table in tables), *remarks])


def drawing_module(name: str, what: str, extra: str = "plot") -> Any:
    """A module of the lab that draws; Problem, with the name of the extra, if matplotlib is missing."""
    try:
        return importlib.import_module(f"..{name}", __package__)
    except ImportError as error:
        reason = f"matplotlib is missing; it comes with the extra: pip install 'carom[{extra}]'"
        raise Problem(f"{what} {reason}") from error
