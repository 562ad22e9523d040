"""The trade of scenes with a known answer, in short tables: orders of accuracy, and the step that keeps an error."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from carom.framework.settings import COLLISION_MODES
from carom.lab.reporting.text import NOTHING, TextTable, compact, number
from carom.lab.trading.answer import curves, remarks
from carom.lab.trading.grid import METHODS
from carom.lab.trading.trade import Point, SceneTrade, Trade, trade

from .runner import Axis, Result

ALL = ("explicit_euler", *METHODS)
TARGETS = (0.1, 0.01, 0.001, 1e-6)
ASYMPTOTIC = 4  # number of finest points used for the order
SMALL, ROUNDING = 0.1, 1e-12  # larger errors have no order yet; smaller ones have none


@dataclass(frozen=True)
class Known:
    """How a scene is measured."""

    seconds: float
    norms: tuple[str, ...]
    steps: tuple[float, ...]
    repeats: int
    methods: tuple[str, ...] = ALL
    options: dict[str, Any] = field(default_factory=dict)


def _halved(largest: float, count: int) -> tuple[float, ...]:
    return tuple(largest / 2**k for k in range(count))


KNOWN = {
    "spring": Known(5.2, ("position", "energy"), _halved(1 / 15, 8), 4),
    # Semi-implicit Euler is velocity Verlet shifted by half a step (Hairer, Lubich, Wanner: Geometric Numerical
    # Integration, VI.3). At the perihelion, the start, that shift changes no energy, and after whole orbits no length.
    "orbit": Known(20 * math.pi, ("position", "energy"), _halved(2 * math.pi / 100, 8), 1),
    "jump": Known(1.0, ("apex", "position", "energy"), _halved(1 / 15, 6), 64, ALL[:3]),
    # As published: 49 balls, 20 s, these steps.
    "bouncing": Known(
        20.0, ("energy_square", "position", "energy"), (0.1, 0.04, 0.01, 0.004, 0.001), 4, ALL[:3], {"n": 49}
    ),
    "stack": Known(5.0, ("overlap", "speed", "drift"), _halved(1 / 30, 6), 1, ()),
    "thermal_gas": Known(100.0, ("pressure", "rate"), _halved(0.8, 7), 8, ()),
    "billiards": Known(1.0, ("position", "energy", "impact_time", "count"), _halved(1 / 30, 6), 16, ALL[:3]),
}


def axes(quick: bool = False) -> list[Axis]:
    """The scenes."""
    del quick
    return [Axis(scene, "", (scene,), facts=_facts, cost=10.0) for scene in KNOWN]


def _facts(scene: str) -> dict[str, SceneTrade]:
    """The trade of the scene, with all methods and steps."""
    known, vary = KNOWN[scene], {"dt": KNOWN[scene].steps}
    vary |= {"integrator": known.methods} if known.methods else {}
    vary |= {"collision": COLLISION_MODES} if scene == "thermal_gas" else {}  # else not all, of what is chaotic
    result = trade(
        scene, norms=known.norms, vary=vary, seconds=known.seconds, repeats=known.repeats, options=known.options,
        timing=False, thorough=True, workers=1,
    )  # fmt: skip
    return {"trade": result.scenes[0]}


def _trades(result: Result) -> list[SceneTrade]:
    return [line.samples[0].facts["trade"] for line in result.lines]


def report(result: Result) -> tuple[list[TextTable], list[str]]:
    """A table for each scene, and what was measured against what."""
    cases = _trades(result)
    return [summary(case) for case in cases], remarks(Trade(result.machine, "", cases))


def draw_charts(result: Result, folder: Path) -> list[Path]:
    """A chart for each scene."""
    from carom.lab.trading.chart import draw  # matplotlib is needed for pictures alone

    trades = [Trade(result.machine, "", [case]) for case in _trades(result)]
    return [path for one in trades for path in draw(one, folder, one.scenes[0].norm)]


def summary(case: SceneTrade, targets: Sequence[float] = TARGETS) -> TextTable:
    """By method: the observed order of each norm; for each target the largest step that meets it in all repeats, with
    its work per simulated second; the least error; and the failures. Methods with the same figures share a row."""
    norm = case.norm
    known = [target for target in targets if case.trusts(norm, target)]
    headings = ["method", *(f"{name}, order" for name in case.norms), *(f"{target:g}" for target in known), "best"]
    failing = any(point.failed for point in case.points)
    labels: dict[tuple[str, ...], list[str]] = {}
    for label, points in curves(case).items():
        good = [point for point in points if not point.failed]
        row = [order(case, good, name) for name in case.norms]
        row += [_step(points, norm, target) for target in known]
        row.append(compact(min(point.figures[norm].error for point in good), 2) if good else NOTHING)
        failed = [f"{number(point.settings.dt)}: {point.failed}" for point in points if point.failed]
        labels.setdefault((*row, *["; ".join(failed) or NOTHING] * failing), []).append(label)
    rows = [("; ".join(methods), *row) for row, methods in labels.items()]
    title = f"{case.scene}: orders; the largest step, s, that keeps {norm} below the target, and its work per second"
    return TextTable(title, (*headings, *["failed"] * failing), rows)


def order(case: SceneTrade, points: Sequence[Point], norm: str) -> str:
    """The slope of log error over log dt of the finest points, above rounding and the reference's own error, and small
    enough for the asymptotic order to hold."""
    errors = [(point.settings.dt, point.figures[norm].error) for point in points if norm in point.figures]
    most = math.inf if norm == "energy_square" else SMALL
    told = [(dt, error) for dt, error in errors if ROUNDING < error < most and case.trusts(norm, error)][-ASYMPTOTIC:]
    if len(told) < 2:
        return NOTHING
    steps, sizes = ([math.log(value) for value in values] for values in zip(*told, strict=True))
    return f"{statistics.linear_regression(steps, sizes).slope:.2f}"


def _step(points: Sequence[Point], norm: str, target: float) -> str:
    """The largest step that meets the target together with all smaller ones."""
    kept: Point | None = None
    for point in reversed(points):
        if point.failed or norm not in point.figures or point.figures[norm].error > target:
            break
        kept = point
    return NOTHING if kept is None else f"{number(kept.settings.dt)}: {compact(kept.work, 2)}"
