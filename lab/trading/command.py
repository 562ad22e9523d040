"""``carom trade``: what settings cost and buy, and which to use."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

import click

from ...framework.settings import COLLISION_MODES
from ..cli.group import STOPPED
from ..cli.options import (
    COUNT,
    POSITIVE,
    Assignment,
    Listed,
    json_option,
    out_option,
    seed_option,
    traceback_option,
    writable_folder,
)
from ..cli.usage_errors import Problem
from ..reporting.output import Output, drawing_if_there
from ..reporting.progress import Progress
from ..reporting.text import plain_console
from .answer import answer, remarks, table
from .grid import FIELDS
from .trade import trade

WORDS = "carom.words"  # key for the words of the command line


class KeepsWords(click.Command):
    """A command that stores the words it was called with in ``context.meta[WORDS]``."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        ctx.meta[WORDS] = list(args)
        return super().parse_args(ctx, args)


def _keywords(context: click.Context, option: click.Parameter, pairs: tuple[tuple[str, Any], ...]) -> dict[str, Any]:
    for name in {"settings", "seed"} & dict(pairs).keys():
        raise Problem(f"--option cannot set {name}: the command does")
    return dict(pairs)


@click.command("trade", cls=KeepsWords, short_help="What speed costs in accuracy, and which settings to use.")
@click.argument("scenes", metavar="SCENE|FILE.py...", nargs=-1, required=True)
@click.option(
    "--max-error", type=POSITIVE, metavar="E",
    help="The cheapest settings that keep this error, a part of what the norm is relative to.",
)  # fmt: skip
@click.option("--absolute", is_flag=True, help="--max-error is in the scene's own units.")
@click.option(
    "--max-cost", type=POSITIVE, metavar="MS",
    help="The best settings that take at most these milliseconds a frame of 1/60 s.",
)  # fmt: skip
@click.option(
    "--norm", "norms", multiple=True, metavar="NAME",
    help="What the error is the error of; repeatable, the first counts (default: what suits the scene).",
)  # fmt: skip
@click.option("--seconds", type=POSITIVE, metavar="S", help="Simulated time of each run.")
@click.option("--repeats", type=COUNT, metavar="N", help="Runs of each setting: start phases or seeds.")
@click.option(
    "--option", "options", type=Assignment(), multiple=True, metavar="NAME=VALUE", callback=_keywords,
    help="A keyword of the scene's build, as in n=100; repeatable.",
)  # fmt: skip
@seed_option
@click.option("--dt", type=Listed(POSITIVE), metavar="S,S", help="Only these steps, as in 1/60,1/120; all fields of "
              "settings have all values that differ in the scene by default.")  # fmt: skip
@click.option("--integrators", "integrator", type=Listed(click.STRING), metavar="NAME,NAME", help="Only these.")
@click.option(
    "--collisions", "collision", type=Listed(click.Choice(COLLISION_MODES)), metavar="NAME,NAME",
    help=f"Only these of {', '.join(COLLISION_MODES)}.",
)  # fmt: skip
@click.option("--substeps", type=Listed(COUNT), metavar="N,N", help="Only these of the solver.")
@click.option("--workers", type=COUNT, metavar="N", help="Processes (default: one a core).")
@click.option("--cluster", metavar="ADDRESS", help="Run on the workers of this dask.distributed scheduler.")
@click.option(
    "--runs", "kept", type=click.Path(path_type=Path, file_okay=False), metavar="FOLDER", default=Path("out/runs"),
    show_default=True, help="Finished runs are kept here, and used again.",
)  # fmt: skip
@click.option("--no-timing", is_flag=True, help="Counts only; nothing is timed.")
@out_option("Where the charts go.", Path("out/trade"))
@json_option
@click.option("--markdown", "as_markdown", is_flag=True, help="Print the tables as Markdown.")
@traceback_option
@click.pass_context
def trade_command(
    context: click.Context, scenes: tuple[str, ...], norms: tuple[str, ...], no_timing: bool, max_error: float | None,
    absolute: bool, max_cost: float | None, out: Path, as_json: bool, as_markdown: bool, kept: Path,
    cluster: str | None, **given: Any,
) -> None:  # fmt: skip
    """Run scenes with the settings that matter in them: how large is the error, what does it cost, and what to use?

    Scenes of the library, or files that define build(settings, seed=0). The exit code is 2 if nothing keeps --max-error
    or --max-cost.
    """
    if absolute and max_error is None:
        raise Problem("--absolute is about --max-error, which is missing")
    if max_cost is not None and no_timing:
        raise Problem("--max-cost needs times: without --no-timing")
    if cluster is not None and given["workers"] is not None:
        raise Problem("--workers and --cluster exclude each other")
    output = Output(as_json, as_markdown)
    writable_folder(out)
    writable_folder(kept, option="--runs")
    vary = {field: values for field in FIELDS if (values := given.pop(field))}
    command = shlex.join(["carom", "trade", *context.meta[WORDS]])
    with Progress(plain_console(stderr=True)) as bar:
        try:
            result = trade(
                *dict.fromkeys(scenes), norms=norms, max_error=max_error, max_cost=max_cost, absolute=absolute,
                vary=vary, timing=not no_timing, cluster=cluster or "", folder=kept, progress=bar, command=command,
                **given,
            )  # fmt: skip
        except KeyboardInterrupt:
            click.echo(f"carom: stopped; finished runs are kept in {kept}, the same command goes on", err=True)
            raise click.exceptions.Exit(STOPPED) from None
        bar.say("charts")
        charts = drawing_if_there("trading.chart", "no charts,")
        files = [path for norm in norms or ("",) for path in charts.draw(result, out, norm)] if charts else []
    measured = [case for case in result.scenes if not case.refused]
    answers = [answer(case) for case in result.scenes]
    if not as_json and not as_markdown:
        click.echo("".join("\n".join(lines) + "\n\n" for lines in answers), nl=False)
    output.show(result, [table(case, norm) for case in measured for norm in norms or ("",)], remarks(result))
    for path in files:
        click.echo(f"written: {path}", err=True)
    missing = [lines[0] for case, lines in zip(result.scenes, answers, strict=True) if case.chosen is None]
    if missing and (max_error is not None or max_cost is not None):
        raise Problem("; ".join(missing))
