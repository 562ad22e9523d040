"""``carom tune``: the cheapest settings that keep an error limit, and the line of code that sets them."""

from __future__ import annotations

import math
import shlex
from pathlib import Path
from typing import Any

import click
from rich.console import Console

from ...framework import Settings
from ..cases.subjects import subject_of
from ..cli.group import STOPPED as STOPPED_CODE
from ..cli.options import (
    WORDS,
    KeepsWords,
    case_options,
    only_options,
    runs_options,
    seed_number,
    shown_options,
    together,
    workers_of,
)
from ..cli.usage_errors import Problem
from ..jobs.result_store import Store
from ..jobs.runs import STOPPED, Runs
from ..measure.norms import NORMS, check_norm
from ..reporting.output import Output
from ..reporting.progress import Bar
from ..trading.command import check_integrators
from ..trading.trade import Only
from .check import Check, check, measured_with
from .report import TuneResult, answer, sentences, tables
from .search import Tuning, search

MARK = "carom tune"
NONE_MEETS = 1  # exit code


MISSING = (
    "--max-error is missing: how large may the error be? --max-error 0.01 allows 1 % of what the norm is relative to "
    "(carom trade shows it), --max-error 0.05 --absolute 5 cm"
)


def _above_zero(context: click.Context, parameter: click.Parameter, value: float | None) -> float | None:
    if value is not None and not (math.isfinite(value) and value > 0):
        raise Problem(f"--max-error takes a number above 0, not {value:g}")
    return value


@click.command("tune", cls=KeepsWords, short_help="The cheapest settings that keep an error.")
@click.argument("target", metavar="SCENE|FILE.py")
@together(
    click.option(
        "--max-error", type=float, metavar="E", callback=_above_zero,
        help="The largest error allowed, as a part of what the norm is relative to; it must be given.",
    ),
    click.option("--absolute", is_flag=True, help="--max-error is in the scene's own units."),
)  # fmt: skip
@case_options
@only_options
@click.option(
    "--check", "checked", multiple=True, metavar="SCENE|FILE.py",
    help="Also measure the choice on this scene, which it was not tuned on; repeatable.",
)  # fmt: skip
@runs_options
@shown_options
@click.option("--traceback", is_flag=True, help="Show in full where an error came from.")
@click.pass_context
def tune_command(
    context: click.Context,
    target: str,
    max_error: float | None,
    absolute: bool,
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
    checked: tuple[str, ...],
    budget: float,
    thorough: bool,
    workers: int | None,
    cluster: str | None,
    kept: Path,
    as_json: bool,
    as_markdown: bool,
    traceback: bool,
) -> None:
    """Find the settings of least work that keep the error of a scene below --max-error in all repeats.

    A scene of the library, or a file that defines build(settings, seed=0). It is searched, not the whole grid: the
    cheapest settings are tried first. The last line of what is printed is the Python to paste. The exit code is 1 if no
    settings keep the error.
    """
    del traceback  # seen by Commands.main
    if len(norms) > 1:
        raise Problem(f"--norm: settings are tuned for one error, not for {' and '.join(norms)}")
    command = shlex.join([*MARK.split(), *context.meta[WORDS]])
    output = Output.checked(as_json, as_markdown)
    for one in (target, *checked):
        subject_of(one)
    only = Only(integrators or (), collisions or (), substeps or (), geometries or ())
    subject = subject_of(target, options, seed_number(seed))
    for name in norms:
        check_norm(name, () if name in NORMS else subject.names)
    check_integrators([subject], only.integrators)
    if max_error is None:
        raise Problem(MISSING)
    arguments = {
        "absolute": absolute, "seconds": seconds, "repeats": repeats, "steps": steps or (), "options": options,
        "only": only, "seed": seed_number(seed),
        "budget": None if thorough else budget,
    }  # fmt: skip
    with Store(kept) as store, workers_of(workers, cluster) as pool, Bar(Console(stderr=True)) as bar:
        try:
            show = output.as_it_comes(answer)
            norm = norms[0] if norms else None
            tuning = search(target, max_error, norm, workers=pool, store=store, progress=bar, show=show, **arguments)
            balanced, found = None, []
            if not tuning.stopped:
                balanced = measured_with(tuning.case, Settings.balanced(), Runs(pool, store, bar))
            for other in checked if tuning.choice is not None and tuning.stopped != STOPPED else ():
                found.append(_checked(tuning, other, absolute=absolute, workers=pool, store=store, progress=bar))
        except KeyboardInterrupt:
            click.echo(f"carom: stopped; finished runs are kept in {kept}, the same command goes on", err=True)
            raise click.exceptions.Exit(STOPPED_CODE) from None
    if output.plain:
        click.echo("\n".join(answer(tuning)) + "\n")
    _show(TuneResult(command, tuning, balanced, found), output)
    if tuning.stopped == STOPPED:
        click.echo(f"carom: stopped; finished runs are kept in {kept}, the same command goes on", err=True)
        raise click.exceptions.Exit(STOPPED_CODE)
    if tuning.choice is None:
        raise click.exceptions.Exit(NONE_MEETS)


def _checked(tuning: Tuning, target: str, **options: Any) -> Check:
    """Check on another scene; if it cannot be measured, the result of the search is still reported."""
    try:
        return check(tuning, target, **options)
    except Problem as problem:
        return Check(subject_of(target).name, tuning.norm, tuning.target, refused=problem.message)


def _show(result: TuneResult, output: Output) -> None:
    """Print tables and sentences; the line to paste comes last."""
    words, tuning = sentences(result), result.tuning
    pasted = [] if tuning.choice is None else [f"`{tuning.line}`"]
    output.show(result, tables(result), words if output.plain else [*words, *pasted])
    if output.plain and tuning.choice is not None:
        click.echo(f"\n{tuning.line}")
