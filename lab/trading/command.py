"""``carom trade``: the trade-off between speed and accuracy, measured over a grid of settings."""

from __future__ import annotations

import contextlib
import shlex
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import click
from rich.console import Console

from ..cases.grid import ALL_METHODS
from ..cases.subjects import Subject, subject_of
from ..cli.group import STOPPED
from ..cli.options import (
    WORDS,
    KeepsWords,
    above_zero,
    case_options,
    only_options,
    out_option,
    runs_options,
    shown_options,
    together,
    traceback_option,
    writable_folder,
)
from ..cli.usage_errors import Problem
from ..engines.pymunk_space import pymunk_module
from ..jobs import cluster as clusters
from ..jobs.runs import Store
from ..reporting.output import Output, drawing_if_there
from ..reporting.progress import Progress
from ..reporting.text import counted
from .answer import Target, answer, recommended
from .records import PYMUNK
from .report import remarks, tables, write_csv, write_json
from .trade import Only, trade

MARK = "carom trade"
NONE_MEETS = 1  # exit code


@click.command("trade", cls=KeepsWords, short_help="What speed costs in accuracy, and which settings to use.")
@click.argument("targets", metavar="SCENE|FILE.py...", nargs=-1, required=True)
@together(
    click.option(
        "--max-error", type=float, metavar="E", callback=above_zero("--max-error"),
        help="The cheapest settings that keep this error, a part of what the norm is relative to.",
    ),
    click.option("--absolute", is_flag=True, help="--max-error is in the scene's own units."),
    click.option(
        "--max-cost", type=float, metavar="MS", callback=above_zero("--max-cost"),
        help="The best settings that take at most these milliseconds a frame of 1/60 s.",
    ),
    case_options, only_options, runs_options,
    click.option("--against", type=click.Choice([PYMUNK]), help="The same scenes in this engine, on the same axes."),
    click.option("--no-timing", is_flag=True, help="Counts only; nothing is timed."),
)  # fmt: skip
@out_option("Where results, tables and charts go.", Path("out/trade"))
@shown_options
@traceback_option
@click.pass_context
def trade_command(
    context: click.Context, targets: tuple[str, ...], norms: tuple[str, ...], against: str | None, no_timing: bool,
    max_error: float | None, absolute: bool, max_cost: float | None, out: Path, as_json: bool, as_markdown: bool,
    thorough: bool, workers: int | None, cluster: str | None, kept: Path, **given: Any,
) -> None:  # fmt: skip
    """Run scenes with the settings that matter in them: how large is the error, what does it cost, and what to use?

    Scenes of the library, or files that define build(settings, seed=0). Each is measured by a norm that suits it,
    against a closed form or runs of its own, within a minute or --thorough; finished runs are kept as they come. The
    exit code is 1 if nothing keeps --max-error or --max-cost.
    """
    targets = tuple(dict.fromkeys(targets))
    only = Only(*(given.pop(name) or () for name in ("integrators", "collisions", "substeps", "geometries")))
    subjects = [subject_of(scene, given["options"], given["seed"]) for scene in targets]
    check_integrators(subjects, only.integrators)
    if against == PYMUNK:
        pymunk_module()
    output, plain = Output(as_json, as_markdown), not as_json and not as_markdown
    target = _target(max_error, max_cost, absolute, no_timing)
    writable_folder(out)

    def show(case: Any) -> None:
        if plain:
            first, *lines = answer(case, target)
            click.echo("\n".join([f"first look: {first}", *lines, ""]))

    with performing(workers, cluster, kept) as runs:
        result = trade(
            *targets, norms=norms, target=target, against_pymunk=against == PYMUNK, timing=not no_timing,
            command=shlex.join([*MARK.split(), *context.meta[WORDS]]), show=show, quick=not thorough, only=only,
            **{**given, "steps": given["steps"] or ()}, **runs,
        )  # fmt: skip
        files = [write_json(result, out / "trade.json"), write_csv(result, out / "trade.csv")]
        runs["progress"].say("charts")
        charts = drawing_if_there("trading.charts", "no charts,")
        if charts is not None:
            files += [path for norm in norms or [None] for path in charts.draw(result, out, norm)]
    if plain:
        for case in result.cases:
            click.echo("\n".join(answer(case, target)) + "\n")
    output.show(result, [table for norm in norms or [None] for table in tables(result, norm)], remarks(result))
    for path in files:
        click.echo(f"written: {path}", err=True)
    if target is not None and any(recommended(case, target) is None for case in result.cases):
        raise click.exceptions.Exit(NONE_MEETS)


def _target(max_error: float | None, max_cost: float | None, absolute: bool, no_timing: bool) -> Target | None:
    if absolute and max_error is None:
        raise Problem("--absolute is about --max-error, which is missing")
    if max_cost is not None and no_timing:
        raise Problem("--max-cost needs times: without --no-timing")
    return None if max_error is None and max_cost is None else Target(max_error, max_cost, absolute)


def check_integrators(subjects: Sequence[Subject], names: Sequence[str]) -> None:
    """Problem, with suggestions, for an integrator that a scene does not have; plugins can add integrators."""
    for subject in subjects:
        for name in names:
            if name not in ALL_METHODS:
                with contextlib.closing(subject.world(None)) as world:
                    settings = world.settings.replace(integrator=name)
                subject.world(settings).close()


@contextlib.contextmanager
def performing(workers: int | None, cluster: str | None, kept: Path) -> Iterator[Mapping[str, Any]]:
    """The keywords of what performs and keeps the runs; Ctrl-C ends the command and says what is kept."""
    if workers is not None and cluster is not None:
        raise Problem("--workers and --cluster exclude each other")
    pool = contextlib.nullcontext(workers) if cluster is None else clusters.cluster(cluster)
    with Store(kept) as store, pool as performs, Progress(Console(stderr=True)) as bar:
        try:
            yield {"workers": performs, "store": store, "progress": bar}
        except KeyboardInterrupt:
            runs = counted(len(store), "run")
            click.echo(f"carom: stopped; {runs} kept in {kept}, the same command goes on", err=True)
            raise click.exceptions.Exit(STOPPED) from None
