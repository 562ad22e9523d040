"""``carom bench``: measure, then print as requested."""

from __future__ import annotations

from pathlib import Path

import click
from rich.console import Console

from ..cli.options import COUNT, Listed, out_option, shown_options
from ..cli.usage_errors import Problem
from ..engines.pymunk_space import pymunk_module
from ..reporting.output import Output, drawing_into
from ..reporting.progress import Progress
from . import report as bench_report
from .against_pymunk import bench
from .suite import LARGE, SIZES, SUITE, subjects

QUICK_SIZES, QUICK_REPEATS = (1000,), 2
REPEATS = 5
NAMES = ", ".join(dict.fromkeys(subject.scene for subject in SUITE))


@click.command("bench", short_help="Time carom on this machine.")
@click.option("--scenes", "scene_names", type=Listed(click.STRING), metavar="NAME,NAME", help=f"Only these of {NAMES}.")
@click.option(
    "--sizes", type=Listed(COUNT), metavar="N,N",
    help=f"Numbers of bodies (default: {SIZES[0]:,} and {SIZES[1]:,}) of scenes that come in sizes; few, pyramid, "
    "static_world, fastgas, freefall and those that turn have their own.",
)  # fmt: skip
@click.option(
    "--repeats", type=click.IntRange(min=1), help=f"Runs of everything; the median counts (default: {REPEATS})."
)
@click.option("--large", is_flag=True, help=f"{LARGE:,} bodies too: takes long, above all pile2d.")
@click.option(
    "--quick", is_flag=True,
    help=f"{QUICK_SIZES[0]:,} bodies only, {QUICK_REPEATS} repeats, and no scenes of many bodies that turn.",
)  # fmt: skip
@click.option("--no-peer", is_flag=True, help="carom alone, without pymunk.")
@out_option("Draw a chart into this folder.")
@shown_options
def bench_command(
    scene_names: tuple[str, ...] | None, sizes: tuple[int, ...] | None, repeats: int | None, large: bool, quick: bool,
    no_peer: bool, out: Path | None, as_json: bool, as_markdown: bool,
) -> None:  # fmt: skip
    """Time scenes of the library in carom and in pymunk, on the same bodies, in one process."""
    if quick and (sizes or large):
        raise Problem("--quick chooses the sizes: leave out --sizes and --large")
    wanted = subjects(scene_names or (), quick)
    asked = QUICK_SIZES if quick else tuple(sorted(sizes)) if sizes else SIZES
    if large:
        asked = tuple(sorted({*asked, LARGE}))
    repeats = repeats or (QUICK_REPEATS if quick else REPEATS)
    output, charts = Output(as_json, as_markdown), drawing_into(out, "bench.charts")
    peer = not no_peer and _peer_there()
    with Progress(Console(stderr=True)) as bar:
        result = bench(wanted, asked, repeats, peer, bar)
    output.show(result, bench_report.tables(result), bench_report.remarks(result))
    if charts is not None:
        picture = charts.draw_ratios(result, out)
        click.echo(f"chart: {picture}" if picture is not None else "no chart: nothing is compared", err=True)


def _peer_there() -> bool:
    """True if pymunk is installed; prints a note if not."""
    try:
        pymunk_module()
    except Problem as problem:
        click.echo(f"carom: timing carom alone: {problem.message}", err=True)
        return False
    return True
