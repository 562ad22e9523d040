"""``carom trade``: the trade-off between speed and accuracy, measured over a grid of settings."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from ..cases.subjects import subject_of
from ..cli.options import WORDS, KeepsWords, out_option, shown_options, together, traceback_option, writable_folder
from ..cli.usage_errors import Problem
from ..engines.pymunk_space import pymunk_module
from ..jobs.runs import STOPPED
from ..reporting.output import Output, drawing_module
from .answer import answer
from .files import write_csv, write_json
from .records import PYMUNK, Trade
from .report import cheapest, choice_lines, measured, remarks, tables
from .session import arguments_of, check_integrators, end_if_stopped, performing, study_options
from .trade import trade

MARK = "carom trade"


@click.command("trade", cls=KeepsWords, short_help="What speed costs in accuracy, measured.")
@click.argument("targets", metavar="SCENE|FILE.py...", nargs=-1, required=True)
@study_options
@together(
    click.option("--against", type=click.Choice([PYMUNK]), help="The same scenes in this engine, on the same axes."),
    click.option("--no-timing", is_flag=True, help="Counts only; nothing is timed."),
)
@out_option("Where results, tables and charts go.", Path("out/trade"))
@shown_options
@traceback_option
@click.pass_context
def trade_command(
    context: click.Context, targets: tuple[str, ...], norms: tuple[str, ...], against: str | None, no_timing: bool,
    out: Path, as_json: bool, as_markdown: bool, **given: Any,
) -> None:  # fmt: skip
    """Run scenes with all settings that matter in them: how large is the error, and what does it cost?

    Scenes of the library, or files that define build(settings, seed=0). Each is measured by a norm that suits it,
    against a closed form or runs of its own; finished runs are kept as they come.
    """
    targets = tuple(dict.fromkeys(targets))
    arguments = arguments_of(given)
    subjects = [subject_of(target, given["options"], given["seed"]) for target in targets]
    check_integrators(subjects, arguments["only"].integrators)
    if against == PYMUNK:
        pymunk_module()
    output = Output.checked(as_json, as_markdown)
    writable_folder(out)
    with performing(given) as runs:
        result = trade(
            *targets, norms=norms, against_pymunk=against == PYMUNK, timing=not no_timing,
            command=shlex.join([*MARK.split(), *context.meta[WORDS]]), show=output.as_it_comes(answer),
            **arguments, **runs,
        )  # fmt: skip
        files = [write_json(result, out / "trade.json"), write_csv(result, out / "trade.csv")]
        if result.stopped != STOPPED:
            runs["progress"].say("charts")
            files += _charts(result, out, norms)
    if output.plain:
        for case in result.cases:
            click.echo("\n".join(answer(case)) + "\n")
    if any(case.curves for case in result.cases) or result.stopped != STOPPED:
        shown = [table for norm in norms or [None] for table in tables(result, norm)]
        shown += [cheapest(case) for case in measured(result)]
        output.show(result, shown, [*remarks(result), *_lines(result)])
        for path in files:
            click.echo(f"written: {path}", err=True)
    end_if_stopped(result.stopped, given["kept"])


def _charts(result: Trade, out: Path, norms: Sequence[str]) -> list[Path]:
    """Draw them; without matplotlib a note is all."""
    try:
        draw = drawing_module("trading.charts", "no charts,").draw
    except Problem as problem:
        click.echo(f"carom: {problem.message}", err=True)
        return []
    return [path for norm in norms or [None] for path in draw(result, out, norm)]


def _lines(result: Trade) -> list[str]:
    """The settings to paste."""
    return [f"{case.scene}, {target}: {line}" for case in measured(result) for target, line in choice_lines(case)]
