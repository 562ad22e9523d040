"""An artificial trade of accuracy for speed: errors are powers of the step, so every figure is known in advance."""

from __future__ import annotations

import dataclasses
import itertools
import math

from carom.lab.measure.timing import Spread
from carom.lab.trading.records import (
    ESCAPED,
    PYMUNK,
    SMOOTH,
    TUNNELLED,
    CaseTrade,
    Cell,
    Curve,
    ErrorBar,
    Point,
    Reference,
    Trade,
    observed_order,
)

MACHINE = {"processor": "a processor", "system": "Linux", "clock": "wall time", "python": "3.13", "carom": "0.1.0"}
STEPS = tuple(1 / 15 / 2**k for k in range(7))
REPEATS = 64
AGREEMENT = 1e-9  # of the reference of smooth cases

# per method: order in the position, order in the energy, evaluations of the forces per step
METHODS = {
    "explicit_euler": (1, 1, 1), "semi_implicit_euler": (1, 1, 1), "velocity_verlet": (2, 2, 1), "rk4": (4, 5, 4),
    "yoshida4": (4, 4, 3),
}  # fmt: skip


def point(cell: Cell, orders: tuple[float, float], evaluations: int, failing: int = 0, timed: bool = True) -> Point:
    """A point whose errors are 0.1 (15 dt)^order in the position and 0.01 (15 dt)^order in the energy.

    ``failing`` repeats tunnelled; if that is all of them there are no errors.
    """
    size = 0.1 * (15 * cell.dt) ** orders[0]
    energy = 0.01 * (15 * cell.dt) ** orders[1]
    errors = {
        "position": ErrorBar(size, 0.5 * size, 2 * size, 0.05 * size),
        "energy": ErrorBar(energy, energy, energy, 0.0),
    }
    steps = 1 / cell.dt
    counts = {"steps": steps, "force_evaluations": evaluations * steps, "candidates": 0.0, "impacts": 2.0}
    work = 50_000 * steps + 10_000 * evaluations * steps
    milliseconds = Spread.of([1.1e-6 * work, 1e-6 * work, 1.2e-6 * work])
    failures = {TUNNELLED: failing} if failing else {}
    errors = {} if failing == REPEATS else errors
    return Point(cell, REPEATS, errors, failures, counts, work, milliseconds if timed else None)


def observed_in(points: list[Point], norm: str) -> float | None:
    sized = [one for one in points if norm in one.errors]
    return observed_order([one.cell.dt for one in sized], [one.errors[norm].mean for one in sized])


def curve(cell: Cell, label: str, failing: int = 0, timed: bool = True, steps: tuple[float, ...] = STEPS) -> Curve:
    """All steps of one method; ``failing`` repeats of the largest step tunnelled."""
    order, energy_order, evaluations = METHODS[cell.integrator]
    cells = [dataclasses.replace(cell, dt=dt) for dt in steps]
    failures = [failing, *[0] * len(steps)]
    points = [
        point(one, (order, energy_order), evaluations, failed, timed)
        for one, failed in zip(cells, failures, strict=False)
    ]
    orders = {norm: observed_in(points, norm) for norm in ("position", "energy")}
    return Curve(label, points, orders, {"position": float(order), "energy": float(energy_order)})


def smooth(timed: bool = True, against: bool = True) -> CaseTrade:
    """Five methods and pymunk; Euler fails at the largest step, three repeats of semi-implicit Euler do."""
    failing = {"explicit_euler": REPEATS, "semi_implicit_euler": 3}
    curves = [curve(Cell(1.0, name), name.replace("_", " "), failing.get(name, 0), timed) for name in METHODS]
    curves[0].points[1].failures = {ESCAPED: 2}
    if against:
        cell = Cell(1.0, "semi_implicit_euler", substeps=10, engine=PYMUNK)
        curves.append(curve(cell, "pymunk, 10 iterations", timed=timed))
    norms = {
        "position": "largest error of a position at the end, relative to the orbit's radius",
        "energy": "largest error of the energy, relative to that of the start",
    }
    why = "no impact and no contact in a run of the default settings"
    reference = Reference("own runs of rk4 and yoshida4 at 1/7,680 s", {"position": AGREEMENT, "energy": 0.0})
    return CaseTrade(
        "orbit", "orbit", "A planet & its sun: one period <1 s>.", SMOOTH, why, norms, 10.0, REPEATS, "start phases",
        reference, curves,
    )  # fmt: skip


def bouncing() -> CaseTrade:
    """The scene with published results: an exact method, one of order 2, one that differs from theory."""
    plan = (
        ("velocity verlet, event driven", "event_driven", 0.0, math.inf),
        ("semi-implicit Euler, continuous", "continuous", 2.0, 2.0),
        ("semi-implicit Euler, discrete", "discrete", 1.5, 2.0),
    )
    curves = []
    for label, collision, order, theory in plan:
        points = []
        for dt in (0.1, 0.01, 0.001):
            error = 1.9e8 * dt**order if order else 0.0
            cell = Cell(dt, "semi_implicit_euler" if order else "velocity_verlet", collision)
            errors = {"energy_square": ErrorBar.of([error])}
            points.append(Point(cell, 1, errors, {}, {"steps": 1 / dt}, 6e4 / dt, Spread.of([0.05 / dt])))
        observed = observed_in(points, "energy_square")
        curves.append(Curve(label, points, {"energy_square": observed}, {"energy_square": theory}))
    return CaseTrade(
        "bouncing", "bouncing", "49 balls bounce for 20 s without loss.", "impacts",
        "impacts without loss, and two near starts stay near",
        {"energy_square": "mean over the steps of the squared error of the energy, J²"}, 20.0, 1, "start phases",
        Reference("the energy of the start, which nothing changes"), curves,
    )  # fmt: skip


def crowded() -> CaseTrade:
    """More curves than colours: all integrators in all modes at two geometry levels."""
    curves = []
    for name, collision, geometry in itertools.product(
        METHODS, ("discrete", "continuous", "event_driven"), ("precise", "bounds")
    ):
        cell = Cell(1.0, name, collision, geometry=geometry)
        curves.append(curve(cell, f"{name}, {collision}, {geometry}", steps=STEPS[:3]))
    case = smooth(against=False)
    case.scene, case.curves = "crowded", curves
    return case


def refused() -> CaseTrade:
    """A case that was not measured."""
    return CaseTrade(
        "my_scene.py", "games/my_scene.py", "", "chaotic", "two starts 1e-9 apart are 0.3 apart at the end",
        {"pressure": "relative to the mean"}, 5.0, 5, "seeds", Reference(""), [],
        "there is no wall whose pressure could be measured",
    )  # fmt: skip


def trade(*cases: CaseTrade) -> Trade:
    """All cases of one call; without an argument a smooth one, a published one and a refused one."""
    shown = list(cases or (smooth(), bouncing(), refused()))
    return Trade(MACHINE, "carom trade orbit bouncing games/my_scene.py", shown)
