"""``carom limits``: where carom fails, one axis at a time or two; and the longest safe step of a scene."""

from __future__ import annotations

import dataclasses
import importlib
import json
from contextlib import closing
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich.console import Console

from ...framework import World
from ..commands.choices import parse_assignments, preset
from ..commands.loading import Loaded, load, stdout_kept_clean
from ..commands.options import (
    out_option,
    plugin_option,
    seed_number,
    seed_option,
    set_option,
    settings_option,
    shown_options,
)
from ..commands.usage_errors import Problem, did_you_mean
from ..plugins_check.installed import plugin_named
from ..reporting.output import Output
from ..reporting.progress_bar import Bar, Progress
from . import report as limits_report
from .pairs import report as pairs_report
from .pairs.axes import Draw
from .pairs.scenes import played
from .pairs.sweep import QUICK_SCENES, SCENES, pair_limits
from .step_length import StepLimits, step_limits
from .sweep import AXES, limits

LOOKS = 20  # times that a running scene is examined
DEFAULT_SECONDS = 10.0  # for a file that does not define it
MARK, PAIRS_MARK = "carom limits", "carom limits --pairs"
NAMES = tuple(axis.name for axis in AXES)


@click.command("limits", short_help="Where carom fails; how long a scene's step may be.")
@click.argument("target", metavar="[SCENE|FILE.py]", required=False)
@click.option("--axes", "axis_names", metavar="NAME,NAME", help=f"Only these of {', '.join(NAMES)}.")
@click.option("--quick", is_flag=True, help="Fewer values on each axis: about a minute; few scenes of --pairs.")
@click.option("--long", "long_runs", is_flag=True, help="Runs of a million steps too: about ten minutes more.")
@click.option("--pairs", is_flag=True, help=f"Cross the axes in pairs: {SCENES:,} short random scenes, some minutes.")
@click.option("--scenes", type=click.IntRange(min=1), metavar="N", help="With --pairs: so many scenes.")
@click.option("--play", type=click.IntRange(min=0), metavar="N", help="Play scene N of --pairs alone, and describe it.")
@click.option("--workers", type=click.IntRange(min=1), metavar="N", help="Processes of --pairs (default: one a core).")
@out_option("Draw a picture into this folder.")
@shown_options
@click.option(
    "--seconds", type=float, help="Of a scene: how long to watch it (default: what it recommends; 0: its start)."
)
@settings_option
@set_option
@seed_option
@plugin_option
@click.option("--traceback", is_flag=True, help="Show in full where an error came from.")
def limits_command(
    target: str | None,
    axis_names: str | None,
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
    seconds: float | None,
    preset_name: str | None,
    assignments: tuple[str, ...],
    seed: str,
    plugins: tuple[str, ...],
    traceback: bool,
) -> None:
    """Sweep one thing at a time until carom fails: the step, stiffness, speeds, ratios of masses and sizes, distance
    from the origin, towers, crowds, duration. Prints where the error passes 1 % and 10 %, and where it breaks.

    With --pairs: random scenes that cross these axes in pairs; prints what went wrong in each mode, and where.

    With a scene, or a file that defines build(settings, seed=0): how long its step may be, and what limits it.
    """
    del traceback  # seen by Commands.main
    crossing = pairs or play is not None
    if not crossing:
        _refuse({"--scenes": scenes is not None, "--workers": workers is not None}, "needs --pairs")
    elif target is not None:
        _refuse({"--pairs": pairs, "--play": play is not None}, "is for the sweep, without a scene")
    if crossing:
        of_others = {
            "--axes": axis_names is not None, "--long": long_runs, "--out": out is not None,
            "--seconds": seconds is not None, "--settings": preset_name is not None, "--set": bool(assignments),
            "--plugin": bool(plugins),
        }  # fmt: skip
        _refuse(of_others, "does not go with --pairs or --play")
        if play is not None:
            _refuse({"--scenes": scenes is not None, "--into": into is not None}, "does not go with --play")
            _play(seed_number(seed), play, as_json)
            return
        if quick and scenes is not None:
            raise Problem("--quick and --scenes exclude each other")
        wanted = scenes or (QUICK_SCENES if quick else SCENES)
        output = Output.checked(PAIRS_MARK, as_json, as_markdown, into, None)
        _cross(wanted, seed_number(seed), workers, output)
        return
    if target is None:
        of_scene = {
            "--seconds": seconds is not None, "--settings": preset_name is not None, "--set": bool(assignments),
            "--seed": seed != "0", "--plugin": bool(plugins),
        }  # fmt: skip
        _refuse(of_scene, "needs a scene or a file")
        _sweep(axis_names, quick, long_runs, Output.checked(MARK, as_json, as_markdown, into, out))
        return
    of_sweep = {
        "--axes": axis_names is not None, "--quick": quick, "--long": long_runs, "--markdown": as_markdown,
        "--into": into is not None, "--out": out is not None,
    }  # fmt: skip
    _refuse(of_sweep, "is for the sweep, without a scene")
    if seconds is not None and not 0 <= seconds < float("inf"):
        raise Problem(f"--seconds must be a number of at least 0, not {seconds!r}")
    settings = preset(preset_name) if preset_name is not None else None
    changes, number = parse_assignments(assignments), seed_number(seed)
    loaded = load(target)
    if seconds is None:
        seconds = DEFAULT_SECONDS if loaded.seconds is None else loaded.seconds
    with closing(loaded.build(settings, changes, number, [plugin_named(name) for name in plugins])) as world:
        with Bar(Console(stderr=True)) as bar:
            found = _watched(loaded, world, seconds, bar)
        _show(loaded.name, found, as_json)


def _sweep(axis_names: str | None, quick: bool, long_runs: bool, output: Output) -> None:
    if quick and long_runs:
        raise Problem("--quick and --long exclude each other")
    names = None if axis_names is None else [name for name in axis_names.replace(" ", "").split(",") if name]
    for name in names or ():
        if name not in NAMES:
            raise Problem(f"--axes: no axis {name!r}{did_you_mean(name, NAMES)}")
    if names is not None and not names:
        raise Problem(f"--axes takes names with commas between them: {', '.join(NAMES)}")
    if output.charts is not None:
        output = dataclasses.replace(output, charts=importlib.import_module(".chart", __package__))
    with Bar(Console(stderr=True)) as bar:
        result = limits(names, progress=bar, quick=quick, long=long_runs)
    output.show(result, limits_report.tables(result), limits_report.remarks(result))
    output.draw("draw_limits", result)


def _cross(scenes: int, seed: int, workers: int | None, output: Output) -> None:
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


def _watched(loaded: Loaded, world: World, seconds: float, progress: Progress) -> list[tuple[float, StepLimits]]:
    """(time, limits) at the start and at intervals of the run."""
    steps = round(seconds / world.settings.dt)
    looks = sorted({round(steps * k / LOOKS) for k in range(LOOKS + 1)})
    found = []
    progress.begin(steps + 1)
    progress.say(f"watching {loaded.name}")
    with loaded.attribute_errors(), stdout_kept_clean():
        for look in looks:
            before = world.step_count
            while world.step_count < look:
                world.step()
            moving = world.bodies.dynamic
            out = world.physics is not None and world.physics.taken_out().any()
            if out or not (np.isfinite(moving.position).all() and np.isfinite(moving.linear_velocity).all()):
                raise Problem(f"{loaded.name}: not finite after {world.time:.4g} s: {'; '.join(world.faults[:1])}")
            found.append((world.time, step_limits(world)))
            progress.advance(world.step_count - before)
    return found


def _show(name: str, found: list[tuple[float, StepLimits]], as_json: bool) -> None:
    time, tightest = min(found, key=lambda look: look[1].suggested)
    start = found[0][1]
    if as_json:
        shortest: dict[str, Any] = {"time": time, **tightest.as_dict()}
        click.echo(json.dumps({"scene": name, "start": start.as_dict(), "tightest": shortest}, indent=2))
        return
    if tightest.suggested == start.suggested:
        watched = f" and for {found[-1][0]:.3g} s after it" if len(found) > 1 else ""
        click.echo(f"{name}, at its start{watched}:\n{tightest}")
        return
    click.echo(f"{name}, at its start:\n{start}\n\nafter {time:.3g} s, when the step has to be shortest:\n{tightest}")


def _refuse(given: dict[str, bool], why: str) -> None:
    for option, is_given in given.items():
        if is_given:
            raise Problem(f"{option} {why}")
