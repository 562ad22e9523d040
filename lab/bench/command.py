"""``carom bench`` and its subcommands, one per benchmark: measure, then print as requested."""

from __future__ import annotations

from pathlib import Path

import click
from rich.console import Console

from ..commands.group import Commands
from ..commands.loading import load
from ..commands.options import listed, out_option, repeats_option, shown_options, whole_number
from ..commands.usage_errors import Problem
from ..engines.pymunk_space import pymunk_module
from ..reporting.output import Output
from ..reporting.progress import Bar
from . import report as bench_report
from .benchmarks import scaling as bench_scaling
from .benchmarks import startup as bench_startup
from .benchmarks.against_pymunk import bench
from .suite import LARGE, SIZES, SUITE, subjects

QUICK_SIZES, QUICK_REPEATS = (1000,), 2
REPEATS = 5
NAMES = ", ".join(dict.fromkeys(subject.scene for subject in SUITE))

RUNS = "Runs; the median counts."
chart_option = out_option("Draw a chart into this folder.")


@click.group("bench", cls=Commands, invoke_without_command=True, short_help="Time carom on this machine.")
@click.option(
    "--scenes", "scene_names", metavar="NAME,NAME", help=f"Only these of {NAMES}.",
    callback=listed("--scenes", "names", str),
)  # fmt: skip
@click.option(
    "--sizes", metavar="N,N", callback=listed("--sizes", "whole numbers from 1", whole_number),
    help=f"Numbers of bodies (default: {SIZES[0]:,} and {SIZES[1]:,}) of scenes that come in sizes; pyramid, "
    "static_world, fastgas and freefall have their own.",
)  # fmt: skip
@click.option(
    "--repeats", type=click.IntRange(min=1), help=f"Runs of everything; the median counts (default: {REPEATS})."
)
@click.option("--large", is_flag=True, help=f"{LARGE:,} bodies too: takes long, above all pile2d.")
@click.option("--quick", is_flag=True, help=f"{QUICK_SIZES[0]:,} bodies only, {QUICK_REPEATS} repeats.")
@click.option("--no-peer", is_flag=True, help="carom alone, without pymunk.")
@chart_option
@shown_options
@click.pass_context
def bench_command(
    context: click.Context,
    scene_names: tuple[str, ...] | None,
    sizes: tuple[int, ...] | None,
    repeats: int | None,
    large: bool,
    quick: bool,
    no_peer: bool,
    out: Path | None,
    as_json: bool,
    as_markdown: bool,
    into: Path | None,
) -> None:
    """Time scenes of the library in carom and in pymunk, on the same bodies, in one process.

    The commands below measure other things.
    """
    if context.invoked_subcommand is not None:
        return
    if quick and (sizes or large):
        raise Problem("--quick chooses the sizes: leave out --sizes and --large")
    wanted = subjects(scene_names or ())
    asked = QUICK_SIZES if quick else tuple(sorted(sizes)) if sizes else SIZES
    if large:
        asked = tuple(sorted({*asked, LARGE}))
    repeats = repeats or (QUICK_REPEATS if quick else REPEATS)
    output = Output.checked("carom bench", as_json, as_markdown, into, out)
    peer = not no_peer and _peer_there()
    with Bar(Console(stderr=True)) as bar:
        result = bench(wanted, asked, repeats, peer, bar)
    output.show(result, bench_report.tables(result), bench_report.remarks(result))
    output.draw("draw_ratios", result)


@bench_command.command("scaling", short_help="How the time per body grows with their number.")
@click.option(
    "--sizes", metavar="N,N", help="Numbers of bodies (default: 1,000 to 100,000).",
    callback=listed("--sizes", "whole numbers from 1", whole_number),
)  # fmt: skip
@click.option("--million", is_flag=True, help=f"{bench_scaling.LARGEST:,} bodies too: needs some gigabytes.")
@repeats_option(3, RUNS)
@chart_option
@shown_options
def scaling_command(
    sizes: tuple[int, ...] | None,
    million: bool,
    repeats: int,
    out: Path | None,
    as_json: bool,
    as_markdown: bool,
    into: Path | None,
) -> None:
    """Time the elastic gas from 1,000 to 100,000 bodies: nanoseconds per body per step."""
    asked = tuple(sorted(sizes)) if sizes else bench_scaling.SIZES
    output = Output.checked("carom bench scaling", as_json, as_markdown, into, out)
    with Bar(Console(stderr=True)) as bar:
        result = bench_scaling.scaling((*asked, *[bench_scaling.LARGEST] * million), repeats, bar)
    output.show(result, [bench_scaling.table(result)], [])
    output.draw("draw_scaling", result)


@bench_command.command("startup", short_help="The time to the first step of a new process.")
@click.option(
    "--scenes", "names", default="asteroids", metavar="NAME,NAME", help="Scenes of the library.",
    callback=listed("--scenes", "names", str),
)  # fmt: skip
@repeats_option(3, RUNS)
@shown_options
def startup_command(names: tuple[str, ...], repeats: int, as_json: bool, as_markdown: bool, into: Path | None) -> None:
    """Time new processes up to their first step: nothing compiled, kernels kept on disk, and kernels shipped."""
    output = Output.checked("carom bench startup", as_json, as_markdown, into, None)
    wanted = [load(name).name for name in names]
    with Bar(Console(stderr=True)) as bar:
        result = bench_startup.startup(wanted, repeats, bar)
    output.show(result, [bench_startup.table(result)], [])


def _peer_there() -> bool:
    """True if pymunk is installed; prints a note if not."""
    try:
        pymunk_module()
    except Problem as problem:
        click.echo(f"carom: timing carom alone: {problem.message}", err=True)
        return False
    return True
