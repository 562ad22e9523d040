"""The benchmarks of single features: measure, then print as requested."""

from __future__ import annotations

from pathlib import Path

import click
from rich.console import Console

from ...cli.loading import load
from ...cli.options import listed, out_option, whole_number
from ...reporting.progress import Bar
from ..page import PageOutput, repeats_option, shown_options
from . import collision_modes as bench_modes
from . import feature_ladder as bench_ladder
from . import plugin_pairs as bench_pairs
from . import scaling as bench_scaling
from . import startup as bench_startup

RUNS = "Runs; the median counts."


@click.command("plugin-pairs", short_help="What a pair of a plugin costs, next to a built-in one and by hand.")
@repeats_option(15, RUNS)
@shown_options
def pairs_command(repeats: int, as_json: bool, as_markdown: bool, into: Path | None) -> None:
    """Time the narrow phase with a registered pair, with a built-in one, and with the same maths written by hand."""
    output = PageOutput.of("studies plugin-pairs", as_json, as_markdown, into, None)
    with Bar(Console(stderr=True)) as bar:
        result = bench_pairs.pair_costs(repeats, bar)
    output.show(result, [bench_pairs.table(result)], [])


@click.command("ladder", short_help="What each feature costs, switched on alone.")
@click.option("--bodies", type=click.IntRange(min=1), default=bench_ladder.BODIES, show_default=True)
@repeats_option(5, RUNS)
@shown_options
def ladder_command(bodies: int, repeats: int, as_json: bool, as_markdown: bool, into: Path | None) -> None:
    """Time scenes that differ in one feature: nanoseconds per body per step beside the scene without it."""
    output = PageOutput.of("studies ladder", as_json, as_markdown, into, None)
    with Bar(Console(stderr=True)) as bar:
        result = bench_ladder.ladder(bodies, repeats, bar)
    output.show(result, [bench_ladder.table(result)], [])


@click.command("modes", short_help="What each kind of collision costs, and what it buys.")
@click.option(
    "--steps", type=click.IntRange(min=1), default=bench_modes.STEPS, show_default=True,
    help="Steps timed of each scene; of bullets a sixth.",
)  # fmt: skip
@repeats_option(bench_modes.REPEATS, RUNS)
@shown_options
def modes_command(steps: int, repeats: int, as_json: bool, as_markdown: bool, into: Path | None) -> None:
    """Time the same bodies with discrete, continuous and event-driven collisions."""
    output = PageOutput.of("studies modes", as_json, as_markdown, into, None)
    with Bar(Console(stderr=True)) as bar:
        result = bench_modes.modes(steps, repeats, bar)
    output.show(result, bench_modes.tables(result), bench_modes.remarks(result))


@click.command("scaling", short_help="How the time per body grows with their number.")
@click.option(
    "--sizes", metavar="N,N", help="Numbers of bodies (default: 1,000 to 100,000).",
    callback=listed("--sizes", "whole numbers from 1", whole_number),
)  # fmt: skip
@click.option("--million", is_flag=True, help=f"{bench_scaling.LARGEST:,} bodies too: needs some gigabytes.")
@repeats_option(3, RUNS)
@out_option("Draw a chart into this folder.")
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
    output = PageOutput.of("studies scaling", as_json, as_markdown, into, out, "studies.bench.charts")
    with Bar(Console(stderr=True)) as bar:
        result = bench_scaling.scaling((*asked, *[bench_scaling.LARGEST] * million), repeats, bar)
    output.show(result, [bench_scaling.table(result)], [])
    output.draw("draw_scaling", result)


@click.command("startup", short_help="The time to the first step of a new process.")
@click.option(
    "--scenes", "names", default="asteroids", metavar="NAME,NAME", help="Scenes of the library.",
    callback=listed("--scenes", "names", str),
)  # fmt: skip
@repeats_option(3, RUNS)
@shown_options
def startup_command(names: tuple[str, ...], repeats: int, as_json: bool, as_markdown: bool, into: Path | None) -> None:
    """Time new processes up to their first step: nothing compiled, kernels kept on disk, and kernels shipped."""
    output = PageOutput.of("studies startup", as_json, as_markdown, into, None)
    wanted = [load(name).name for name in names]
    with Bar(Console(stderr=True)) as bar:
        result = bench_startup.startup(wanted, repeats, bar)
    output.show(result, bench_startup.tables(result), [])
