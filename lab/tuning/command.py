"""``carom tune``: the cheapest settings that keep an error limit, and the line of code that sets them."""

from __future__ import annotations

import shlex
from typing import Any

import click

from ...framework import Settings
from ..cases.subjects import subject_of
from ..cli.options import WORDS, KeepsWords, above_zero, shown_options, together, traceback_option
from ..cli.usage_errors import Problem
from ..jobs.runs import STOPPED, Runs
from ..measure.norms import NORMS, check_norm
from ..reporting.output import Output
from ..trading.session import arguments_of, check_integrators, end_if_stopped, performing, study_options
from .check import Check, check, measured_with
from .report import TuneResult, answer, sentences, tables
from .search import Tuning, search

MARK = "carom tune"
NONE_MEETS = 1  # exit code

MISSING = (
    "--max-error is missing: how large may the error be? --max-error 0.01 allows 1 % of what the norm is relative to "
    "(carom trade shows it), --max-error 0.05 --absolute 5 cm"
)


@click.command("tune", cls=KeepsWords, short_help="The cheapest settings that keep an error.")
@click.argument("target", metavar="SCENE|FILE.py")
@together(
    click.option(
        "--max-error", type=float, metavar="E", callback=above_zero("--max-error"),
        help="The largest error allowed, as a part of what the norm is relative to; it must be given.",
    ),
    click.option("--absolute", is_flag=True, help="--max-error is in the scene's own units."),
)  # fmt: skip
@study_options
@click.option(
    "--check", "checked", multiple=True, metavar="SCENE|FILE.py",
    help="Also measure the choice on this scene, which it was not tuned on; repeatable.",
)  # fmt: skip
@shown_options
@traceback_option
@click.pass_context
def tune_command(
    context: click.Context, target: str, max_error: float | None, absolute: bool, norms: tuple[str, ...],
    checked: tuple[str, ...], as_json: bool, as_markdown: bool, **given: Any,
) -> None:  # fmt: skip
    """Find the settings of least work that keep the error of a scene below --max-error in all repeats.

    A scene of the library, or a file that defines build(settings, seed=0). It is searched, not the whole grid: the
    cheapest settings are tried first. The last line of what is printed is the Python to paste. The exit code is 1 if no
    settings keep the error.
    """
    if len(norms) > 1:
        raise Problem(f"--norm: settings are tuned for one error, not for {' and '.join(norms)}")
    command = shlex.join([*MARK.split(), *context.meta[WORDS]])
    output = Output.checked(as_json, as_markdown)
    for one in (target, *checked):
        subject_of(one)
    subject, arguments = subject_of(target, given["options"], given["seed"]), arguments_of(given)
    for name in norms:
        check_norm(name, () if name in NORMS else subject.names)
    check_integrators([subject], arguments["only"].integrators)
    if max_error is None:
        raise Problem(MISSING)
    with performing(given) as runs:
        norm = norms[0] if norms else None
        show = output.as_it_comes(answer)
        tuning = search(target, max_error, norm, absolute=absolute, show=show, **arguments, **runs)
        balanced, found = None, []
        if not tuning.stopped:
            balanced = measured_with(tuning.case, Settings.balanced(), Runs(**runs))
        for other in checked if tuning.choice is not None and tuning.stopped != STOPPED else ():
            found.append(_checked(tuning, other, absolute=absolute, **runs))
    if output.plain:
        click.echo("\n".join(answer(tuning)) + "\n")
    _show(TuneResult(command, tuning, balanced, found), output)
    end_if_stopped(tuning.stopped, given["kept"])
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
