"""``carom limits``: the longest safe step of a scene, and what limits it."""

from __future__ import annotations

import json
import math
from contextlib import closing
from dataclasses import dataclass
from typing import Any

import click
import numpy as np
from rich.console import Console

from ...framework import Settings, World
from ..cases.subjects import load_once
from ..cli.loading import Loaded, stdout_kept_clean
from ..cli.options import above_zero, thorough_option, traceback_option, world_options
from ..cli.usage_errors import Problem
from ..jobs.runs import Runs
from ..plain import jsonable
from ..plugins.installed import plugin_named
from ..reporting.progress import Bar, Progress
from ..reporting.text import number
from .outcome import StepOutcome, outcome_of_steps
from .step_length import StepLimits, step_limits

LOOKS = 20  # times that a running scene is examined
IN_VIEW = 1.0  # s: limits far beyond the steps of a game are not told
DEFAULT_SECONDS = 10.0  # for a file that does not define it


@click.command("limits", short_help="How long a scene's step may be, and what limits it.")
@click.argument("target", metavar="SCENE|FILE.py")
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON, and nothing else, to stdout.")
@click.option(
    "--seconds", type=float, callback=above_zero("--seconds", "a number of at least 0", zero=True),
    help="How long to watch it (default: what it recommends; 0: its start).",
)  # fmt: skip
@click.option(
    "--max-error", "way", type=float, metavar="METRES", callback=above_zero("--max-error", "metres above 0"),
    help="How far a body may be from where it should (default: 1 % of the smallest one's size).",
)  # fmt: skip
@world_options
@thorough_option
@traceback_option
def limits_command(
    target: str,
    as_json: bool,
    seconds: float | None,
    way: float | None,
    settings: Settings | None,
    changes: dict[str, Any],
    seed: int,
    plugins: tuple[str, ...],
    thorough: bool,
) -> None:
    """How long the step of a scene, or of a file that defines build(settings, seed=0), may be, and what limits it.

    The scene runs with longer and shorter steps until a player would notice the difference, and its forces and speeds
    are examined on the way.
    """
    scene = Asked(target, settings, tuple(changes.items()), plugins)
    loaded = load_once(target)
    if way is not None and loaded.compared is not None:
        raise Problem(f"--max-error does not apply: {loaded.name} says itself what counts, in compared(world)")
    if seconds is None:
        seconds = DEFAULT_SECONDS if loaded.seconds is None else loaded.seconds
    with Bar(Console(stderr=True)) as bar:
        with closing(scene(None, seed)) as world:
            found = _watched(loaded, world, seconds, bar)
        outcome = outcome_of_steps(scene, seed, seconds, Runs(progress=bar), thorough, way)
    _show(loaded.name, found, outcome, as_json)


@dataclass(frozen=True)
class Asked:
    """The scene as the command line has it: build(settings, seed=0) -> World, which worker processes can call too."""

    target: str
    settings: Settings | None
    changes: tuple[tuple[str, Any], ...]
    plugins: tuple[str, ...]

    def __call__(self, settings: Settings | None, seed: int = 0) -> World:
        added = [plugin_named(name) for name in self.plugins]
        if settings is None:
            return load_once(self.target).build(self.settings, dict(self.changes), seed, added)
        return load_once(self.target).build(settings, {}, seed, added)

    @property
    def __name__(self) -> str:
        return load_once(self.target).name

    @property
    def compared(self) -> Any:
        """What the game is judged by, or None."""
        return load_once(self.target).compared


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


def _show(name: str, found: list[tuple[float, StepLimits]], outcome: StepOutcome, as_json: bool) -> None:
    at, tightest = min(found, key=lambda look: look[1].suggested)
    start = found[0][1]
    dt = min(outcome.longest, tightest.suggested)
    if as_json:
        shortest: dict[str, Any] = {"time": at, **tightest.as_dict()}
        plain = {
            "scene": name, "suggested": dt, "outcome": outcome.as_dict(),
            "start": start.as_dict(), "tightest": shortest,
        }  # fmt: skip
        click.echo(json.dumps(jsonable(plain), indent=2))
        return
    for line in [f"{name}: {_suggestion(dt, start.dt, tightest, outcome)}", *outcome.sentences()]:
        click.echo(line)
    for limit, line in zip((tightest.stability, tightest.tunnelling), tightest.sentences(), strict=False):
        if limit < IN_VIEW:
            click.echo(f"{line} (after {at:.3g} s)" if tightest.suggested != start.suggested else line)


def _suggestion(dt: float, own: float, tightest: StepLimits, outcome: StepOutcome) -> str:
    if dt == math.inf:
        return "nothing that was looked at limits the step: choose it by the accuracy you need"
    if dt == 0.0:
        if tightest.suggested == 0.0:
            return f"no step is stable: choose another integrator than {tightest.integrator}"
        return f"no step that was tried keeps the outcome, not even {number(outcome.shortest)} s: see carom trade"
    reason = " by its forces and speeds alone" if outcome.refused else ""
    fits = "fits" if own <= dt * 1.000001 else "is too long"
    return f"dt up to {number(dt)} s{reason}; its step of {number(own)} s {fits}"
