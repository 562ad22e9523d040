"""``carom limits``: the longest safe step of a scene, what limits it, and what half of its step changes."""

from __future__ import annotations

import json
from contextlib import closing
from typing import Any

import click
import numpy as np

from ...framework import Settings, World
from ..cli.loading import Loaded, load, stdout_kept_clean
from ..cli.options import NOT_NEGATIVE, json_option, traceback_option, world_options
from ..cli.usage_errors import Problem
from ..measure.bodies import apart, state_by_id
from ..plugins.command import plugin_named
from ..reporting.progress import Progress
from ..reporting.text import jsonable, metres, number, plain_console, values_text
from .step_length import StepLimits, step_limits

LOOKS = 20  # times that a running scene is examined
DEFAULT_SECONDS = 10.0  # for a file that does not define it


@click.command("limits", short_help="How long a scene's step may be, and what limits it.")
@click.argument("target", metavar="SCENE|FILE.py")
@json_option
@click.option("--seconds", type=NOT_NEGATIVE, help="How long to watch it (default: what it recommends; 0: its start).")
@world_options
@traceback_option
def limits_command(
    target: str, as_json: bool, seconds: float | None, settings: Settings | None, changes: dict[str, Any], seed: int,
    plugins: tuple[str, ...],
) -> None:  # fmt: skip
    """How long the step of a scene, or of a file that defines build(settings, seed=0), may be, and what limits it.

    Forces and speeds are examined while the scene runs; then it runs with half of its step.
    """
    loaded = load(target)
    if seconds is None:
        seconds = DEFAULT_SECONDS if loaded.seconds is None else loaded.seconds

    def build() -> World:
        return loaded.build(settings, changes, seed, [plugin_named(name) for name in plugins])

    with Progress(plain_console(stderr=True)) as bar, closing(build()) as world:
        bar.begin(3 * round(seconds / world.settings.dt))
        found = _run(loaded, world, seconds, bar)
        with closing(build()) as half:
            half.settings = half.settings.replace(dt=world.settings.dt / 2)
            _run(loaded, half, seconds, bar)
            difference = _difference(loaded, world, half)
    at, tightest = min(found, key=lambda look: look[1].suggested)
    if as_json:
        facts = {"suggested": tightest.suggested, "start": found[0][1].as_dict(), "half": difference}
        facts["tightest"] = {"time": at, **tightest.as_dict()}
        click.echo(json.dumps(jsonable({"scene": loaded.name, **facts}), indent=2))
        return
    click.echo(f"{loaded.name}, where its limits are tightest, after {at:.3g} s:\n{tightest}")
    if difference["farthest"] is not None:
        way = f"entity {difference['entity']} ends {metres(difference['farthest'])} from where it does, the farthest"
        click.echo(f"After {seconds:.4g} s with half of the step {way}.")
    for name, values in difference["compared"].items():
        click.echo(f"{name}: {values_text(values[0])}, with half of the step {values_text(values[1])}.")


def _run(loaded: Loaded, world: World, seconds: float, bar: Progress) -> list[tuple[float, StepLimits]]:
    """Run for so many seconds; the times at the start and at intervals, with the limits then."""
    steps = round(seconds / world.settings.dt)
    bar.say(f"{loaded.name}, steps of {number(world.settings.dt)} s")
    found, moves = [], loaded.compared is not None
    with loaded.attribute_errors(), stdout_kept_clean():
        for look in sorted({round(steps * k / LOOKS) for k in range(LOOKS + 1)}):
            bar.advance(look - world.step_count)
            while world.step_count < look:
                world.step()
            moving, physics = world.bodies.dynamic, world.physics
            out = physics is not None and physics.excluded().any()
            if out or not (np.isfinite(moving.position).all() and np.isfinite(moving.linear_velocity).all()):
                if physics is not None:
                    physics.report_faults("")  # of what no step has looked at yet
                raise Problem(": ".join((f"{loaded.name}: not finite after {world.time:.4g} s", *world.faults[:1])))
            found.append((world.time, step_limits(world)))
            moves |= len(moving) > 0  # what moves may come later
    if not moves:
        raise Problem(f"{loaded.name}: there is no body that moves by itself: nothing to measure")
    return found


def _difference(loaded: Loaded, one: World, other: World) -> dict[str, Any]:
    """Of two runs: the dynamic body whose ends are farthest apart, m, and what a game compares."""
    ways, ids = apart(*(state_by_id(world)[:2] for world in (one, other)))
    farthest, entity = max(zip(ways.tolist(), ids.tolist(), strict=True), default=(None, None))
    values = [loaded.values_of(world) for world in (one, other)]
    compared = {name: [value, values[1].get(name, [np.nan])] for name, value in values[0].items()}
    return {"entity": entity, "farthest": farthest, "compared": compared}
