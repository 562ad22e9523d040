"""``carom limits``: the longest safe step of a scene, and what limits it."""

from __future__ import annotations

import json
from contextlib import closing
from typing import Any

import click
import numpy as np
from rich.console import Console

from ...framework import World
from ..commands.choices import parse_assignments, preset
from ..commands.loading import Loaded, load, stdout_kept_clean
from ..commands.options import plugin_option, seed_number, seed_option, set_option, settings_option
from ..commands.usage_errors import Problem
from ..plugins_check.installed import plugin_named
from ..reporting.progress import Bar, Progress
from .step_length import StepLimits, step_limits

LOOKS = 20  # times that a running scene is examined
DEFAULT_SECONDS = 10.0  # for a file that does not define it


@click.command("limits", short_help="How long a scene's step may be, and what limits it.")
@click.argument("target", metavar="SCENE|FILE.py")
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON, and nothing else, to stdout.")
@click.option("--seconds", type=float, help="How long to watch it (default: what it recommends; 0: its start).")
@settings_option
@set_option
@seed_option
@plugin_option
@click.option("--traceback", is_flag=True, help="Show in full where an error came from.")
def limits_command(
    target: str,
    as_json: bool,
    seconds: float | None,
    preset_name: str | None,
    assignments: tuple[str, ...],
    seed: str,
    plugins: tuple[str, ...],
    traceback: bool,
) -> None:
    """How long the step of a scene, or of a file that defines build(settings, seed=0), may be, and what limits it."""
    del traceback  # seen by Commands.main
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
