"""``carom trade``: the trade-off between speed and accuracy, measured over a grid of settings."""

from __future__ import annotations

import dataclasses
import importlib
import shlex
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import click
from rich.console import Console

from ..cases.grid import ALL_METHODS
from ..cases.subjects import Subject, subject_of
from ..cli.group import STOPPED as STOPPED_CODE
from ..cli.options import (
    WORDS,
    KeepsWords,
    case_options,
    only_options,
    out_option,
    runs_options,
    seed_number,
    shown_options,
    together,
    workers_of,
    writable_folder,
)
from ..cli.usage_errors import Problem
from ..engines.pymunk_space import pymunk_module
from ..jobs.result_store import Store
from ..jobs.runs import STOPPED
from ..reporting.output import Output
from ..reporting.progress import Bar
from ..reporting.text_tables import TextTable
from ..wording import counted
from .answer import answer
from .files import write_csv, write_json
from .records import PYMUNK, Trade
from .report import COUNTS, cheapest, choice_lines, measured, remarks, tables
from .trade import Only, trade

MARK = "carom trade"


@click.command("trade", cls=KeepsWords, short_help="What speed costs in accuracy, measured.")
@click.argument("targets", metavar="SCENE|FILE.py...", nargs=-1, required=True)
@case_options
@only_options
@together(
    click.option("--against", type=click.Choice([PYMUNK]), help="The same scenes in this engine, on the same axes."),
    click.option("--no-timing", is_flag=True, help="Counts only; nothing is timed."),
)
@runs_options
@out_option("Where results, tables and charts go.", Path("out/trade"))
@shown_options
@click.option("--traceback", is_flag=True, help="Show in full where an error came from.")
@click.pass_context
def trade_command(
    context: click.Context,
    targets: tuple[str, ...],
    norms: tuple[str, ...],
    seconds: float | None,
    repeats: int | None,
    steps: tuple[float, ...] | None,
    options: dict[str, Any],
    seed: str,
    integrators: tuple[str, ...] | None,
    collisions: tuple[str, ...] | None,
    substeps: tuple[int, ...] | None,
    geometries: tuple[str, ...] | None,
    against: str | None,
    no_timing: bool,
    budget: float,
    thorough: bool,
    workers: int | None,
    cluster: str | None,
    kept: Path,
    out: Path,
    as_json: bool,
    as_markdown: bool,
    traceback: bool,
) -> None:
    """Run scenes with all settings that matter in them: how large is the error, and what does it cost?

    Scenes of the library, or files that define build(settings, seed=0). Each is measured by a norm that suits it,
    against a closed form or runs of its own; finished runs are kept as they come.
    """
    del traceback  # seen by Commands.main
    targets = tuple(dict.fromkeys(targets))
    subjects = [subject_of(target, options, seed_number(seed)) for target in targets]
    only = Only(integrators or (), collisions or (), substeps or (), geometries or ())
    check_integrators(subjects, only.integrators)
    if against == PYMUNK:
        pymunk_module()
    output = Output.checked(as_json, as_markdown)
    writable_folder(out)
    arguments = {
        "norms": norms, "seconds": seconds, "repeats": repeats, "steps": steps or (), "only": only,
        "against_pymunk": against == PYMUNK, "timing": not no_timing, "options": options,
        "seed": seed_number(seed), "command": _command_line(context),
        "budget": None if thorough else budget,
    }  # fmt: skip
    with Store(kept) as store, workers_of(workers, cluster) as pool:
        try:
            with Bar(Console(stderr=True)) as bar:
                show = output.as_it_comes(answer)
                result = trade(*targets, **arguments, workers=pool, store=store, progress=bar, show=show)
                files = _write(result, out)
                if result.stopped != STOPPED:
                    bar.say("charts")
                    files += _charts(result, out, norms)
        except KeyboardInterrupt:
            known = counted(len(store), "result")
            click.echo(f"carom: stopped before anything was known; {known} kept in {kept}", err=True)
            raise click.exceptions.Exit(STOPPED_CODE) from None
    if output.plain:
        for case in result.cases:
            click.echo("\n".join(answer(case)) + "\n")
    if result.stopped == STOPPED and not any(case.curves for case in result.cases):
        raise click.exceptions.Exit(STOPPED_CODE)
    choices = [cheapest(case) for case in measured(result)]
    output.show(result, [*_tables(result, norms), *choices], [*remarks(result), *_lines(result)])
    for path in files:
        click.echo(f"written: {path}", err=True)
    if result.stopped == STOPPED:
        click.echo(f"carom: stopped; finished runs are kept in {kept}, the same command goes on", err=True)
        raise click.exceptions.Exit(STOPPED_CODE)


def check_integrators(subjects: Sequence[Subject], names: Sequence[str]) -> None:
    """Problem, with suggestions, for an integrator that a scene does not have; plugins can add integrators."""
    for subject in subjects:
        for name in names:
            if name not in ALL_METHODS:
                with closing(subject.world(None)) as world:
                    settings = world.settings.replace(integrator=name)
                subject.world(settings).close()


def _charts(result: Trade, out: Path, norms: Sequence[str]) -> list[Path]:
    """Draw them; without matplotlib a note is all."""
    try:
        draw = chart_module().draw
    except Problem as problem:
        click.echo(f"carom: {problem.message}", err=True)
        return []
    return [path for norm in norms or [None] for path in draw(result, out, norm)]


def chart_module() -> Any:
    """The module carom.lab.trading.charts; Problem, with the name of the extra, if matplotlib is missing."""
    try:
        return importlib.import_module(".charts", __package__)
    except ImportError as error:
        raise Problem("no charts, matplotlib is missing; it comes with the extra: pip install 'carom[plot]'") from error


def _command_line(context: click.Context) -> str:
    """The command line that repeats the measurement from the start."""
    return shlex.join([*MARK.split(), *context.meta[WORDS]])


def _tables(result: Trade, norms: Sequence[str]) -> list[TextTable]:
    """The tables of each requested norm; of each case's first one if none was requested."""
    return [_narrow(table) for norm in norms or [None] for table in tables(result, norm)]


def _narrow(table: TextTable) -> TextTable:
    """The table without the single counts, which are in the CSV file: a terminal is too narrow."""
    kept = [place for place, heading in enumerate(table.headings) if heading not in COUNTS.values()]
    rows = [tuple(row[place] for place in kept) for row in table.rows]
    return dataclasses.replace(table, headings=tuple(table.headings[place] for place in kept), rows=rows)


def _lines(result: Trade) -> list[str]:
    """The settings to paste."""
    return [f"{case.scene}, {target}: {line}" for case in measured(result) for target, line in choice_lines(case)]


def _write(result: Trade, out: Path) -> list[Path]:
    return [write_json(result, out / "trade.json"), write_csv(result, out / "trade.csv")]
