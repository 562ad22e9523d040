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
from ..cli.loading import Loaded, stdout_kept_clean
from ..cli.options import NOT_NEGATIVE, POSITIVE, traceback_option, world_options
from ..cli.usage_errors import Problem
from ..jobs import Jobs
from ..plain import Plain, jsonable
from ..reporting.progress import Progress
from ..reporting.text import counted, metres, number
from ..trading.errors import SHARE
from ..trading.grid import FIELDS
from ..trading.subject import Subject, load_once
from ..trading.trade import SceneTrade, measured
from .step_length import StepLimits, step_limits

LOOKS = 20  # times that a running scene is examined
IN_VIEW = 1.0  # s: limits far beyond the steps of a game are not told
DEFAULT_SECONDS = 10.0  # for a file that does not define it


@click.command("limits", short_help="How long a scene's step may be, and what limits it.")
@click.argument("target", metavar="SCENE|FILE.py")
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON, and nothing else, to stdout.")
@click.option("--seconds", type=NOT_NEGATIVE, help="How long to watch it (default: what it recommends; 0: its start).")
@click.option(
    "--max-error", "way", type=POSITIVE, metavar="METRES",
    help="How far a body may be from where it should (default: 1 % of the smallest one's size).",
)  # fmt: skip
@world_options
@traceback_option
def limits_command(
    target: str, as_json: bool, seconds: float | None, way: float | None, settings: Settings | None,
    changes: dict[str, Any], seed: int, plugins: tuple[str, ...],
) -> None:  # fmt: skip
    """How long the step of a scene, or of a file that defines build(settings, seed=0), may be, and what limits it.

    The scene runs with longer and shorter steps until a player would notice the difference, and its forces and speeds
    are examined on the way.
    """
    loaded = load_once(target)
    scene = Subject(loaded.name, target, seed=seed, chosen=settings, changes=tuple(changes.items()), plugins=plugins)
    if way is not None and loaded.compared is not None:
        raise Problem(f"--max-error does not apply: {loaded.name} says itself what counts, in compared(world)")
    if seconds is None:
        seconds = DEFAULT_SECONDS if loaded.seconds is None else loaded.seconds
    with Progress(Console(stderr=True)) as bar:
        with closing(scene.world(None)) as world:
            found = _watched(loaded, world, seconds, bar)
        outcome = outcome_of_steps(scene, seconds, Jobs(progress=bar), way)
    _show(loaded.name, found, outcome, as_json)


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
            out = world.physics is not None and world.physics.excluded().any()
            if out or not (np.isfinite(moving.position).all() and np.isfinite(moving.linear_velocity).all()):
                if world.physics is not None:
                    world.physics.report_faults("")  # of what no step has looked at yet
                raise Problem(": ".join((f"{loaded.name}: not finite after {world.time:.4g} s", *world.faults[:1])))
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
            "scene": name, "suggested": dt, "outcome": outcome,
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


# -- what runs show --------------------------------------------------------------------------------------


STEPS = (8, 4, 2, 1, 1 / 2, 1 / 4, 1 / 8)  # of the scene's own, as long as they are steps of a game
LONGEST = 1 / 10  # s


@dataclass
class StepOutcome(Plain):
    """What runs with several steps have shown.

    longest: s, of those steps from which on all shorter ones change nothing that would be noticed; 0 if there is none,
    inf if nothing was measured
    shortest: s, of those tried; size: of a body, m
    way: m, how far a body may be from where it should; None: a share of the size
    link: what gives way at the next longer step, ``beyond`` s; "" if none was tried
    refused: why nothing was measured, else ""
    compared: the names of what a game compares
    known: from how many runs, and what to think of them
    """

    longest: float = math.inf
    shortest: float = math.inf
    size: float = 1.0
    way: float | None = None
    link: str = ""
    beyond: float = math.inf
    refused: str = ""
    compared: tuple[str, ...] = ()
    known: str = ""

    def sentences(self) -> list[str]:
        """For a person."""
        if self.refused:
            return [f"Outcome: not measured: {self.refused}"]
        lines = []
        if self.longest:
            way = f"{metres(SHARE * self.size)}, 1 % of the smallest one's size"
            way = metres(self.way) if self.way is not None else way
            moved = f"the step moves no body by more than {way}, and nothing else is noticed"
            kept = f"nothing would be noticed in {', '.join(self.compared)}" if self.compared else moved
            lines.append(f"Outcome: up to {number(self.longest)} s {kept}.")
        if self.link:
            lines.append(f"Weakest link: at {number(self.beyond)} s {self.link}.")
        return [*lines, f"Known {self.known}."]


def outcome_of_steps(scene: Subject, seconds: float, jobs: Jobs, way: float | None = None) -> StepOutcome:
    """Run the scene with its own settings and several steps; way: see :class:`StepOutcome`."""
    if not seconds:
        return StepOutcome(refused="it was not run")
    try:
        with closing(scene.world(None)) as world:
            own, longest = world.settings, min(LONGEST, seconds / 3)
        vary: dict[str, Any] = {name: (getattr(own, name),) for name in FIELDS}
        vary["dt"] = [own.dt * factor for factor in STEPS if factor <= 1 or own.dt * factor <= longest]
        case = measured(scene, jobs, vary=vary, seconds=seconds, thorough=True, tolerance=way)
        return _outcome(case, way)
    except Problem as problem:
        return StepOutcome(refused=problem.message)


def _outcome(case: SceneTrade, way: float | None) -> StepOutcome:
    points = sorted(case.points, key=lambda point: point.settings.dt)
    found = StepOutcome(0.0, points[0].settings.dt, case.size, way, compared=case.game)
    runs = sum(point.repeats for point in points)
    found.known = f"from {counted(runs, 'run')} of {number(case.seconds)} s with {counted(len(points), 'step')}"
    for point in points:
        noticed = [figure.text for _, figure in point.noticed]
        if point.failed or noticed:
            found.link, found.beyond = "; ".join([point.failed] * bool(point.failed) + noticed), point.settings.dt
            break
        found.longest = point.settings.dt
    return found
