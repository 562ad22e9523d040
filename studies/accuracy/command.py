"""``studies accuracy``: the trade of scenes with a known answer, in short, beside what others have published."""

from __future__ import annotations

import shlex
from pathlib import Path

import click
from rich.console import Console

from carom.lab.cli.options import WORDS, KeepsWords, out_option
from carom.lab.jobs.result_store import Store
from carom.lab.reporting.progress import Bar
from carom.lab.trading.charts import draw
from carom.lab.trading.records import PYMUNK
from carom.lab.trading.report import cheapest, choice_lines, remarks
from carom.lab.trading.trade import trade

from ..page import PageOutput, shown_options
from .published import SOURCE, published
from .summary import summary

MARK = "studies accuracy"


@click.command("accuracy", cls=KeepsWords)
@click.argument("scene")
@click.option("--against", type=click.Choice([PYMUNK]), help="The same scene in this engine, on the same axes.")
@click.option("--runs", "kept", type=click.Path(path_type=Path), default=Path("out/runs.sqlite"), show_default=True)
@out_option("Draw charts into this folder.")
@shown_options
@click.pass_context
def accuracy_command(
    context: click.Context, scene: str, against: str | None, kept: Path, out: Path | None, as_json: bool,
    as_markdown: bool, into: Path | None,
) -> None:  # fmt: skip
    """Measure a scene as `carom trade SCENE --thorough` does: a row per method, and the cheapest for each target."""
    output = PageOutput.of(f"{MARK} {scene}", as_json, as_markdown, into)
    command = shlex.join(["python", "-m", "studies", "accuracy", *context.meta[WORDS]])
    with Store(kept) as store, Bar(Console(stderr=True)) as bar:
        result = trade(scene, against_pymunk=against == PYMUNK, store=store, progress=bar, command=command)
    (case,) = result.cases
    others = published(case.scene, case.norm)
    pasted = [f"{case.scene}, {target}: {line}" for target, line in choice_lines(case)]
    output.show(result, [summary(case), cheapest(case)], [*remarks(result), *[SOURCE] * bool(others), *pasted])
    case.curves += others
    if out is not None:
        for path in draw(result, out):
            click.echo(f"chart: {path}", err=True)
