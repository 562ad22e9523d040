"""Where carom fails, one axis at a time or two."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import click
from rich.console import Console

from ...cli.options import listed, one_of, out_option, seed_option, traceback_option
from ...cli.usage_errors import Problem
from ...reporting.progress import Bar
from ..page import PageOutput, shown_options
from . import report as limits_report
from .pairs import report as pairs_report
from .pairs.axes import Draw
from .pairs.scenes import played
from .pairs.sweep import QUICK_SCENES, SCENES, pair_limits
from .sweep import AXES, limits

MARK, PAIRS_MARK = "studies limits", "studies limits --pairs"
NAMES = tuple(axis.name for axis in AXES)


@click.command("limits", short_help="Where carom fails.")
@click.option(
    "--axes", "names", metavar="NAME,NAME", help=f"Only these of {', '.join(NAMES)}.",
    callback=listed("--axes", "names", one_of("--axes", NAMES)),
)  # fmt: skip
@click.option("--quick", is_flag=True, help="Fewer values on each axis: about a minute; few scenes of --pairs.")
@click.option("--long", "long_runs", is_flag=True, help="Runs of a million steps too: about ten minutes more.")
@click.option("--pairs", is_flag=True, help=f"Cross the axes in pairs: {SCENES:,} short random scenes, some minutes.")
@click.option("--scenes", type=click.IntRange(min=1), metavar="N", help="With --pairs: so many scenes.")
@click.option("--play", type=click.IntRange(min=0), metavar="N", help="Play scene N of --pairs alone, and describe it.")
@click.option("--workers", type=click.IntRange(min=1), metavar="N", help="Processes of --pairs (default: one a core).")
@out_option("Draw a picture into this folder.")
@shown_options
@seed_option
@traceback_option
def limits_command(
    names: tuple[str, ...] | None,
    quick: bool,
    long_runs: bool,
    pairs: bool,
    scenes: int | None,
    play: int | None,
    workers: int | None,
    as_json: bool,
    as_markdown: bool,
    into: Path | None,
    out: Path | None,
    seed: int,
) -> None:
    """Sweep one thing at a time until carom fails: the step, stiffness, speeds, ratios of masses and sizes, distance
    from the origin, towers, crowds, duration. Prints where the error passes 1 % and 10 %, and where it breaks.

    With --pairs: random scenes that cross these axes in pairs; prints what went wrong in each mode, and where.
    """
    crossing = pairs or play is not None
    if not crossing:
        _refuse({"--scenes": scenes is not None, "--workers": workers is not None}, "needs --pairs")
    if crossing:
        of_others = {
            "--axes": names is not None, "--long": long_runs, "--out": out is not None,
        }  # fmt: skip
        _refuse(of_others, "does not go with --pairs or --play")
        if play is not None:
            _refuse({"--scenes": scenes is not None, "--into": into is not None}, "does not go with --play")
            _play(seed, play, as_json)
            return
        if quick and scenes is not None:
            raise Problem("--quick and --scenes exclude each other")
        wanted = scenes or (QUICK_SCENES if quick else SCENES)
        output = PageOutput.of(PAIRS_MARK, as_json, as_markdown, into, None)
        _cross(wanted, seed, workers, output)
        return
    _refuse({"--seed": seed != 0}, "needs --pairs")
    output = PageOutput.of(MARK, as_json, as_markdown, into, out, "studies.limits.chart")
    _sweep(names, quick, long_runs, output)


def _sweep(names: tuple[str, ...] | None, quick: bool, long_runs: bool, output: PageOutput) -> None:
    if quick and long_runs:
        raise Problem("--quick and --long exclude each other")
    with Bar(Console(stderr=True)) as bar:
        result = limits(names, progress=bar, quick=quick, long=long_runs)
    output.show(result, limits_report.tables(result), limits_report.remarks(result))
    output.draw("draw_limits", result)


def _cross(scenes: int, seed: int, workers: int | None, output: PageOutput) -> None:
    with Bar(Console(stderr=True)) as bar:
        result = pair_limits(scenes, seed, workers, bar)
    output.show(result, pairs_report.tables(result), pairs_report.remarks(result))


def _play(seed: int, number: int, as_json: bool) -> None:
    draw = Draw.of(seed, number)
    outcome = played(draw)
    if as_json:
        plain = {"scene": dataclasses.asdict(draw), "outcome": dataclasses.asdict(outcome)}
        click.echo(json.dumps(plain, indent=2))
    else:
        click.echo(pairs_report.described(draw, outcome))


def _refuse(given: dict[str, bool], why: str) -> None:
    for option, is_given in given.items():
        if is_given:
            raise Problem(f"{option} {why}")
