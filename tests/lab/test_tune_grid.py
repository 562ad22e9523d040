"""The promises of a search are kept: verified by runs that share nothing with the lab, against the whole grid, and
on scenes that were not tuned on.

The targets, the scenes held out and the tolerances (1.3 times the work of the grid's cheapest, twice the promise) were
set before the first run.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from carom.components import AABBCollider, RigidBody, Transform
from carom.framework import ForceSystem, Settings, World
from carom.lab.cases.case import EFFORTS
from carom.lab.engines.cost import WEIGHTS
from carom.lab.jobs.result_store import Store
from carom.lab.jobs.runs import Runs
from carom.lab.trading.records import Cell, Point
from carom.lab.trading.trade import Only, Study
from carom.lab.tuning.check import check
from carom.lab.tuning.search import Tuning, search
from carom.plugins import Physics
from carom.scenes import billiards, get, jump, orbit, spring, stack, thermal_gas

pytestmark = [pytest.mark.slow, pytest.mark.early]

DEARER = 1.3  # limit of the choice's cost over that of the grid's cheapest
BROKEN = 2.0  # limit of the error on other scenes over the promise
PERIODS = 3
LEAST_STEP = WEIGHTS["steps"] + WEIGHTS["force_evaluations"]  # the work of an otherwise empty step
ALIKE = 1.1  # ratio of the work of one repeat to that of another, at most


@dataclass(frozen=True)
class Wanted:
    """One target of the issue; verify(settings): the error in the test's own runs, relative to the target."""

    max_error: float
    norm: str
    options: dict[str, Any] = field(default_factory=dict)


WANTED = {
    # Pixels. 16 phases: the worst is known to (1/16)^2 of g dt^2 / 8.
    "jump": Wanted(0.1, "apex", {"absolute": True, "repeats": 16}),
    "spring": Wanted(1e-3, "position"),
    "orbit": Wanted(1e-4, "energy", {"seconds": PERIODS * orbit.PERIOD}),
    "thermal_gas": Wanted(0.02, "pressure", {"seconds": 20.0}),
    "stack": Wanted(1e-3, "overlap"),
    # The break itself, to 2 mm where balls have moved by 2 m: 1 s includes the rack's impacts and the first cushions,
    # and nearby starts stay near, so there is a right result. 16 phases keep the test short.
    "billiards": Wanted(1e-3, "position", {"seconds": 1.0, "repeats": 16}),
}


def quick(scene: str) -> Any:
    """Mark what is of the gas: until its pressure is known to 1 % takes longer than all the others together."""
    return pytest.mark.long if scene == "thermal_gas" else ()


each_scene = pytest.mark.parametrize("name", [pytest.param(name, marks=quick(name)) for name in WANTED])


class Laboratory:
    """Searches each scene once, and keeps the results."""

    def __init__(self, store: Store) -> None:
        self.store = store
        self.found: dict[str, Tuning] = {}

    def tuned(self, name: str) -> Tuning:
        if name not in self.found:
            wanted = WANTED[name]
            options = {"workers": 1, "store": self.store, **wanted.options}
            self.found[name] = search(name, wanted.max_error, wanted.norm, **options)
        return self.found[name]


@pytest.fixture(scope="module")
def laboratory(tmp_path_factory):
    with Store(tmp_path_factory.mktemp("tune") / "runs.sqlite") as store:
        yield Laboratory(store)


# -- the target, in runs independent of the lab -------------------------------------------------------------------


def hero(settings: Settings | None, seed: int = 0, *, speed: float, gravity: float, start: float = 0.0) -> World:
    """The test's own jump with ``speed`` at height 0 (m/s or pixels/s), first sampled ``start`` s after that."""
    world = World(Physics(dimensions=2, gravity=(0.0, -gravity)), settings=settings or Settings())
    height = speed * start - gravity * start**2 / 2
    world.create_entity(
        Transform((0.0, height)),
        RigidBody(linear_velocity=(1.0, speed - gravity * start)),
        AABBCollider((0.5, 0.5)),
    )
    return world


def apex_error(settings: Settings) -> float:
    """Pixels, the worst of 64 jumps that leave the ground at different times within a step."""
    missed = []
    for phase in range(64):
        world = hero(settings, speed=jump.JUMP_SPEED, gravity=jump.GRAVITY, start=phase / 64 * settings.dt)
        highest = 0.0
        while world.time < 1.0:
            world.step()
            highest = max(highest, float(world.bodies.dynamic.position[0, 1]))
        missed.append(abs(highest - 64.0))
    return max(missed)


def spring_error(settings: Settings) -> float:
    """Relative to the largest displacement, 2: the worst in the last oscillation that ends by 5.2 s."""
    world, omega = spring.build(settings), math.sqrt(spring.STIFFNESS / spring.MASS)
    worst = 0.0
    while world.time + settings.dt <= 5.2:
        world.step()
        if world.time > 4.2:
            right = math.cos(omega * world.time)
            worst = max(worst, abs(float(world.bodies.dynamic.position[0, 0]) - right) / 2)
    return worst


def orbit_error(settings: Settings) -> float:
    """|E - E0| / |E0|, the worst in these periods."""
    world = orbit.build(settings)

    def energy() -> float:
        x, v = world.bodies.dynamic.position[0], world.bodies.dynamic.linear_velocity[0]
        return 0.5 * float(v @ v) - 1.0 / math.hypot(*x)

    before, worst = energy(), 0.0
    assert before == pytest.approx(-0.5, rel=1e-12)
    for _ in range(math.ceil(PERIODS * orbit.PERIOD / settings.dt)):
        world.step()
        worst = max(worst, abs(energy() - before) / 0.5)
    return worst


def mean_pressure(settings: Settings, seeds: range, seconds: float = 60.0, discard: float = 12.0) -> float:
    """Momentum that the walls take per second, from runs with other seeds than the lab's."""
    found = []
    for seed in seeds:
        world = thermal_gas.build(settings, seed)
        taken = 0.0
        for _ in range(round(seconds / settings.dt)):
            world.step()
            if world.time > discard:
                impacts = world.contacts.impacts
                taken += float(impacts.normal_impulse[impacts.entity_a <= 4].sum())
        found.append(taken / (seconds - discard))
    return float(np.mean(found))


def gas_error(settings: Settings) -> float:
    """Error of the pressure, against event-driven runs with a step of a thirtieth of a second."""
    exact = Settings(dt=1 / 30, integrator="velocity_verlet", collision="event_driven")
    return abs(mean_pressure(settings, range(8000, 8005)) / mean_pressure(exact, range(7000, 7005)) - 1)


def stack_error(settings: Settings) -> float:
    """The deepest overlap of ten boxes of side 1 from 2.5 s to 10 s, sizes."""
    world, worst = stack.build(settings), 0.0
    while world.time < 10.0:
        world.step()
        if world.time > 2.5:
            height = np.sort(world.bodies.dynamic.position[:, 1])
            worst = max(worst, float((1.0 - np.diff(height, prepend=-0.5)).max()))
    return worst


def billiards_error(settings: Settings) -> float:
    """Relative to the largest displacement of a ball: after 1 s, against a sweep in steps of 1/16 000 s."""
    exact = Settings(dt=1 / 16_000, integrator="rk4", collision="continuous")
    start = billiards.build(settings).bodies.dynamic.position.copy()
    places, reach = [], 0.0
    for chosen in (settings, exact):
        world = billiards.build(chosen)
        for _ in range(round(1 / chosen.dt)):
            world.step()
            way = np.linalg.norm(world.bodies.dynamic.position - start, axis=1)
            reach = max(reach, float(way.max()))
        assert world.time == pytest.approx(1.0, abs=1e-9), "1 s is no whole number of these steps"
        places.append(world.bodies.dynamic.position.copy())
    return float(np.linalg.norm(places[0] - places[1], axis=1).max()) / reach


VERIFY: dict[str, Callable[[Settings], float]] = {
    "jump": apex_error, "spring": spring_error, "orbit": orbit_error, "thermal_gas": gas_error, "stack": stack_error,
    "billiards": billiards_error,
}  # fmt: skip


@each_scene
def test_the_choice_meets_its_target_in_runs_of_the_test(laboratory, name):
    tuning = laboratory.tuned(name)
    assert tuning.error <= tuning.target
    assert VERIFY[name](tuning.settings) <= WANTED[name].max_error
    assert eval(tuning.line, {"Settings": Settings}) == tuning.settings


# -- against the whole grid ---------------------------------------------------------------------------------------


def measured(tuning: Tuning, store: Store, only: Only, steps: list[float], repeats: int) -> list[Point]:
    """The part of the grid with these methods and steps."""
    case = tuning.case.replace(steps=tuple(steps), repeats=repeats)
    found = Study(case, only, False, False, Runs(1, store), None, 0.0).measured((EFFORTS - 1,))
    return [point for curve in found.curves for point in curve.points]


def alone(cell: Cell) -> Only:
    return Only((cell.integrator,), (cell.collision,), (cell.substeps,), (cell.geometry,))


@each_scene
def test_the_choice_costs_little_more_than_the_cheapest_of_the_grid(laboratory, name):
    """Over the same ladder of steps; cells whose number of steps alone costs more than the choice are skipped. The
    others run once, and those that may hold at much less work in all repeats. (If the error is no noisy statistic, one
    run that misses the target is enough: the worst of all repeats counts.)"""
    tuning = laboratory.tuned(name)
    assert tuning.choice is not None
    ladder = tuning.case.steps
    steps = [dt for dt in ladder if LEAST_STEP / dt * DEARER < tuning.choice.work] or [ladder[0]]
    assert tuning.choice.cell.dt <= ladder[0]
    grid = measured(tuning, laboratory.store, Only(), steps, 1)
    assert len(grid) == tuning.methods * len(steps)
    noisy = tuning.norm in tuning.reference.spread
    much_cheaper = [point for point in grid if DEARER * point.work < ALIKE * tuning.choice.work]
    for first in much_cheaper:
        if not (noisy or first.meets(tuning.norm, tuning.target)):
            continue
        cell = first.cell
        (point,) = measured(tuning, laboratory.store, alone(cell), [cell.dt], tuning.repeats)
        assert point.cell == cell
        holds = point.meets(tuning.norm, tuning.target)
        assert not holds or tuning.choice.work <= DEARER * point.work, cell


# -- on scenes that were not tuned on -----------------------------------------------------------------------------


class Pull(ForceSystem):
    """Springs of the given stiffness to the origin."""

    def __init__(self, stiffness: float) -> None:
        self.stiffness = stiffness

    def add_forces(self, bodies: Any, time: float) -> None:
        bodies.force[:] -= self.stiffness * bodies.position

    def potential_energy(self, bodies: Any) -> float:
        return 0.5 * self.stiffness * float((bodies.position**2).sum())


Pair = tuple[float, float]


def swinging(
    settings: Settings | None, seed: int = 0, *, start: Pair, velocity: Pair, faster: float = 1.0
) -> World:
    """1 kg on a spring of omega = 2 pi faster, started anywhere in its period."""
    world = World(Physics(dimensions=2, gravity=(0.0, 0.0)), settings=settings or Settings())
    world.create_entity(Transform(start), RigidBody(mass=1.0, linear_velocity=velocity))
    world.add_system(Pull((2 * math.pi * faster) ** 2))
    return world


def other_break(settings: Settings | None, seed: int = 0, *, speed: float, aside: float) -> World:
    """The cue ball at another speed, ``aside`` m off the centre line."""
    world = billiards.build(settings, seed)
    bodies = world.bodies.dynamic
    cue = int(np.argmax(np.abs(bodies.linear_velocity[:, 0])))
    bodies.linear_velocity[cue] = (speed, 0.0)
    bodies.position[cue, 1] = billiards.WIDTH / 2 + aside
    return world


HELD_OUT: dict[str, tuple[str, Any, dict[str, Any]]] = {
    "a quick jump in metres": ("jump", hero, {"options": {"speed": 12.0, "gravity": 30.0}}),
    "a jump of 36 pixels": ("jump", hero, {"options": {"speed": 180.0, "gravity": 450.0}, "absolute": True}),
    "a spring on an ellipse": (
        "spring", swinging, {"options": {"start": (0.3, -0.8), "velocity": (2.0, 1.0)}}),
    "a faster spring": (
        "spring", swinging, {"options": {"start": (1.0, 0.0), "velocity": (0.0, 0.0), "faster": 1.1}}),
    "a rounder orbit": ("orbit", "orbit", {"options": {"eccentricity": 0.5}}),
    "fewer discs": ("thermal_gas", "thermal_gas", {"options": {"n": 225}}),
    "8 boxes": ("stack", "stack", {"options": {"n": 8}}),
    "12 boxes": ("stack", "stack", {"options": {"n": 12}}),
    "ten balls": ("stack", "stack", {"options": {"balls": True}}),
    "the top box twice as heavy": ("stack", "stack", {"options": {"top_mass": 2.0}}),
    "another rack": ("billiards", "billiards", {"seed": 2}),
    "a softer break": ("billiards", other_break, {"options": {"speed": 6.0, "aside": 0.004}, "seconds": 0.4}),
}  # fmt: skip


ALIKE_OTHERS = {"a faster spring", "ten balls", "12 boxes"}
each_elsewhere = pytest.mark.parametrize(
    "held_out",
    [
        pytest.param(name, marks=pytest.mark.long if name in ALIKE_OTHERS else quick(HELD_OUT[name][0]))
        for name in HELD_OUT
    ],
)


@each_elsewhere
def test_the_promise_holds_within_a_factor_of_two_elsewhere(laboratory, held_out):
    name, target, options = HELD_OUT[held_out]
    tuning = laboratory.tuned(name)
    found = check(tuning, target, workers=1, store=laboratory.store, **options)
    print(f"{held_out}: {found.norm} {found.error:.3g}, {found.times:.2f} times the promise")
    assert found.point is not None
    assert not found.point.failed
    assert found.times <= BROKEN
    assert found.tolerated


def test_every_scene_of_the_issue_is_here():
    assert {get(name).name for name in WANTED} == set(WANTED)
    assert {name for name, _, _ in HELD_OUT.values()} == set(WANTED)
