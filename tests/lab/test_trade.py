"""`trade()` measures known figures: orders, apexes, published energies, and those of user files.

The tolerance of each figure follows from its law, and was set before the run.
"""

from __future__ import annotations

import math
import warnings

import numpy as np
import pytest
from helpers_trade_scenes import BALL, BULLET, CROWD, REST, SPRING, scene_file

from carom.components import RigidBody, SphereCollider, Transform
from carom.framework import PhysicsWarning, World
from carom.lab import Only, Trade, trade
from carom.lab.cases import case as case_module
from carom.lab.cli.usage_errors import Problem
from carom.lab.trading.records import (
    BLEW_UP,
    CHAOTIC,
    ESCAPED,
    IMPACTS,
    NOT_FINITE,
    RESTING,
    SMOOTH,
    TUNNELLED,
    CaseTrade,
    Point,
)
from carom.plugins import Physics

ORDER_TOLERANCE = 0.3  # between an observed order and theory's

pytestmark = [pytest.mark.slow, pytest.mark.early]  # many runs: half a minute or more together

ORDERS = {"explicit euler": 1, "semi implicit euler": 1, "velocity verlet": 2, "rk4": 4, "yoshida4": 4}


def case_of(*targets, **options) -> CaseTrade:
    """The only case of a trade in this process, without the clock."""
    [case] = trade(*targets, **{"timing": False, "workers": 1, **options}).cases
    assert case.refused == ""
    return case


def points(case: CaseTrade) -> dict[tuple[str, float], Point]:
    return {(curve.label, point.cell.dt): point for curve in case.curves for point in curve.points}


def errors(case: CaseTrade, norm: str) -> dict[tuple[str, float], float]:
    return {key: point.errors[norm].mean for key, point in points(case).items() if point.errors}


# -- smooth motion --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def spring() -> CaseTrade:
    return case_of("spring", seconds=1.3, repeats=2, steps=(1 / 60, 1 / 120, 1 / 240))


def test_the_orders_of_all_methods_on_the_spring(spring):
    assert spring.kind == SMOOTH
    assert [curve.label for curve in spring.curves] == list(ORDERS)
    for curve in spring.curves:
        assert curve.orders["position"] == pytest.approx(ORDERS[curve.label], abs=0.3)
        assert curve.theory["position"] == ORDERS[curve.label]
        assert [point.cell.dt for point in curve.points] == [1 / 60, 1 / 120, 1 / 240]


def test_work_counts_evaluations_of_forces(spring):
    for (label, dt), point in points(spring).items():
        evaluations = {"rk4": 4, "yoshida4": 4, "velocity verlet": 2}.get(label, 1)
        assert point.counts["steps"] == pytest.approx(1 / dt, rel=0.02)
        assert point.counts["force_evaluations"] == pytest.approx(evaluations / dt, rel=0.02, abs=4)
        assert point.milliseconds is None
        assert point.work > 0


@pytest.fixture(scope="module")
def jump() -> CaseTrade:
    return case_of("jump", repeats=1, steps=(1 / 60, 1 / 30, 1 / 15), against_pymunk=True)


@pytest.mark.parametrize(("hertz", "missed"), [(60, 2), (30, 4), (15, 8)])
def test_the_apex_of_the_jump_arc(jump, hertz, missed):
    """64 pixels; explicit Euler 66, 68, 72, semi-implicit Euler 62, 60, 56, velocity Verlet 64; pymunk as the first."""
    found = {label: error for (label, dt), error in errors(jump, "apex").items() if dt == 1 / hertz}
    assert jump.kind == SMOOTH
    assert found.pop("velocity verlet") == pytest.approx(0.0, abs=1e-12)
    assert set(found) == {
        "explicit euler", "semi implicit euler", "pymunk, 10 iterations", "pymunk, 50 iterations",
    }  # fmt: skip
    for error in found.values():
        assert error == pytest.approx(missed / 64, rel=1e-9)


PERIODS = 10  # of the orbit with eccentricity 0.6


@pytest.fixture(scope="module")
def orbit() -> CaseTrade:
    steps = tuple(PERIODS * 2 * math.pi / count for count in (500, 1000, 2000))
    return case_of("orbit", steps=steps, only=Only(integrators=("velocity_verlet", "yoshida4")))


@pytest.mark.parametrize(("method", "meets", "fails"), [("velocity verlet", 2000, 1000), ("yoshida4", 1000, 500)])
def test_the_steps_that_keep_the_energy_of_an_orbit_within_a_hundredth(orbit, method, meets, fails):
    """Known for Kepler's orbit, e = 0.6, ten periods, steps halved until |E - E0| / |E0| < 1e-2, the norm here."""
    found = {
        round(PERIODS * 2 * math.pi / dt): error
        for (label, dt), error in errors(orbit, "energy").items() if label == method
    }  # fmt: skip
    assert found[meets] < 1e-2 <= found[fails]


@pytest.mark.parametrize(("turns", "order"), [(10, 2.0), (0.75, 1.0)])
def test_semi_implicit_euler_gains_an_order_after_whole_turns(turns, order):
    """It is velocity Verlet shifted by half a step; from the perihelion the shift vanishes after whole orbits."""
    seconds = turns * 2 * math.pi
    steps = tuple(seconds / (turns * count) for count in (100, 200, 400))
    found = case_of(
        "orbit", steps=steps, seconds=seconds, only=Only(integrators=("semi_implicit_euler",)),
        options={"eccentricity": 0.1},
    )  # fmt: skip
    (curve,) = found.curves
    assert curve.theory["position"] == order
    assert curve.orders["position"] == pytest.approx(order, abs=ORDER_TOLERANCE)


# -- impacts --------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def bouncing() -> CaseTrade:
    only = Only(integrators=("semi_implicit_euler", "velocity_verlet"), collisions=("continuous",))
    return case_of("bouncing", repeats=1, steps=(0.1, 0.01), only=only, against_pymunk=True)


@pytest.mark.parametrize("dt", [0.1, 0.01])
def test_the_energy_of_elastic_balls(bouncing, dt):
    """Semi-implicit Euler lags by half a step, M g dt/2: a mean square of 18511 (dt / 0.01)^2 J^2 for 49 balls, and up
    to 7.5 times that with the two-cycle of the apex. Velocity Verlet with impacts at their times conserves the
    energy."""
    found = errors(bouncing, "energy_square")
    assert 0 < found["semi implicit euler", dt] <= 7.5 * 18511 * (dt / 0.01) ** 2
    assert found["velocity verlet", dt] < 1e-16
    assert not any(point.failed for point in points(bouncing).values())


def test_pymunk_on_the_published_scene_is_the_published_column_of_ode(bouncing):
    """18808.3 J^2 at 0.01 s: it is the lag of semi-implicit Euler."""
    assert errors(bouncing, "energy_square")["pymunk, 10 iterations", 0.01] == pytest.approx(18808.3, rel=1e-4)


# -- user scenes ----------------------------------------------------------------------------------


def test_a_file_gets_its_reference_from_two_methods_that_agree(tmp_path):
    """A ball without loss: between two bounces, t from the last apex, y = h - g t^2 / 2."""
    mine = scene_file(tmp_path, BALL)
    case = case_of(mine, repeats=2, steps=(1 / 30, 1 / 60))
    assert (case.scene, case.target, case.description) == ("mine.py", mine, "A scene of one's own.")
    assert (case.kind, case.seconds, case.norm) == (IMPACTS, 1.7, "position")
    assert "own runs" in case.reference.text
    assert case.reference.agreement["position"] < 1e-9
    found = errors(case, "position")
    assert found["velocity verlet, continuous", 1 / 30] < 1e-9
    assert found["event-driven", 1 / 30] < 1e-9
    assert found["semi implicit euler, continuous", 1 / 60] > 1e-3
    for point in points(case).values():
        assert point.errors["count"].high == 0.0  # impacts at sqrt(0.2) s and 3 sqrt(0.2) s


def test_errors_against_an_own_reference_are_the_true_ones(tmp_path):
    """A spring in a file, whose solution only the test knows: cos(w t), displacement 2."""
    case = case_of(scene_file(tmp_path, SPRING.format(stiffness=135.0)), seconds=0.3, repeats=1, steps=(1 / 60,))
    assert case.kind == SMOOTH
    x, v = np.array([1.0]), np.array([0.0])
    for _ in range(18):
        force = -135.0 * x
        x = x + v / 60 + force / 7200
        v = v + (force - 135.0 * x) / 120
    true = abs(x[0] - math.cos(math.sqrt(135.0) * 0.3)) / 2
    assert errors(case, "position")["velocity verlet", 1 / 60] == pytest.approx(true, rel=1e-3)


def test_a_chaotic_file_is_recognised_and_its_places_are_not_measured(tmp_path):
    mine = scene_file(tmp_path, CROWD)
    with pytest.raises(Problem, match=r"mine\.py is chaotic: two starts .* position would measure chance"):
        case_of(mine, norms=("position",))
    few = {"repeats": 1, "steps": (1 / 30,), "timing": False, "workers": 1}
    refused, measured = trade(mine, "jump", norms=("position",), **few).cases
    assert "chaotic" in refused.refused
    assert refused.curves == []
    assert measured.refused == ""


def test_a_chaotic_file_is_measured_by_statistics(tmp_path, monkeypatch):
    """Elastic discs without forces conserve their kinetic energy with any step. 16 runs make its reference, not 80."""
    monkeypatch.setattr(case_module, "ENSEMBLE", 8)
    case = case_of(scene_file(tmp_path, CROWD), steps=(1 / 60,), repeats=5)
    assert (case.kind, case.repeated, case.norm) == (CHAOTIC, "seeds", "pressure")
    assert set(case.reference.spread) >= {"pressure", "rate"}
    for point in points(case).values():
        assert point.errors["kinetic"].mean < 1e-9 or point.cell.collision == "discrete"
        assert not point.failed


def test_what_rests_has_to_stay_where_it_is(tmp_path):
    case = case_of(scene_file(tmp_path, REST), repeats=1, steps=(1 / 60,), only=Only(substeps=(4,)))
    assert (case.kind, case.norm) == (RESTING, "overlap")
    assert "0" in case.reference.text
    for point in points(case).values():
        assert point.errors["overlap"].high < 0.01
        assert point.errors["speed"].high < 1e-3


def test_a_bullet_through_a_wall_is_kept_as_a_failure(tmp_path):
    """3.3 m a step through a wall 0.1 m thick: discrete collisions miss it in most start phases, others in none. The
    result says so, and nothing is warned of."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", PhysicsWarning)
        case = case_of(scene_file(tmp_path, BULLET), repeats=8, steps=(1 / 15, 1 / 480))
    for (_, dt), point in points(case).items():
        coarse = point.cell.collision == "discrete" and dt == 1 / 15
        assert point.repeats == 8
        assert set(point.failures) <= ({TUNNELLED, ESCAPED} if coarse else set())
        assert not coarse or sum(point.failures.values()) >= 4
        assert point.counts["steps"] > 0  # failed runs have a cost too
        assert not coarse or not point.meets(case.norm, math.inf)


def test_a_spring_too_stiff_for_its_step_fails(tmp_path, monkeypatch):
    """z = 50 / 15 is above the limits of all five methods, z = 50 / 240 below those of all but explicit Euler."""
    monkeypatch.setattr(case_module, "FINER", 2)
    mine = scene_file(tmp_path, SPRING.format(stiffness=2500.0))
    case = case_of(mine, repeats=1, seconds=0.8, steps=(1 / 15, 1 / 240))
    found = points(case)
    for method in ORDERS:
        assert set(found[method, 1 / 15].failures) <= {BLEW_UP, NOT_FINITE}
        assert found[method, 1 / 15].failed
        assert not found[method, 1 / 240].failed or method == "explicit euler"


def test_a_function_that_no_other_process_can_import_is_measured_here():
    def falling(settings, seed=0, height=5.0):
        """A ball falls past nothing."""
        world = World(Physics(dimensions=2, gravity=(0.0, -10.0)), settings=settings)
        world.create_entity(Transform((0.0, height)), RigidBody(), SphereCollider(0.5))
        return world

    case = case_of(falling, seconds=1.0, repeats=1, steps=(1 / 10,), workers=2, options={"height": 7.0})
    assert (case.scene, case.description, case.kind) == ("falling", "A ball falls past nothing.", SMOOTH)
    found = errors(case, "position")
    assert found["explicit euler", 1 / 10] == pytest.approx(0.1, rel=1e-9)  # g dt t / 2 = 0.5 m of 5 m
    assert found["semi implicit euler", 1 / 10] == pytest.approx(0.1, rel=1e-9)
    assert found["velocity verlet", 1 / 10] < 1e-12


# -- errors for wrong arguments -------------------------------------------------------------------


@pytest.mark.parametrize(("options", "words"), [
    ({"norms": ("positon",)}, "did you mean 'position'"),
    ({"options": {"mass": 2}}, "mass"),
    ({"workers": 0}, "workers"),
    ({"only": Only(collisions=("discreet",)), "steps": (0.1,)}, "discreet"),
])  # fmt: skip
def test_wrong_arguments_are_named(options, words):
    with pytest.raises((ValueError, Problem), match=words):
        case_of("spring", **options)


def test_the_names_of_the_laboratory():
    import carom.lab

    assert {"trade", "Only", "Trade"} <= set(carom.lab.__all__) <= set(dir(carom.lab))
    assert carom.lab.Trade is Trade
    with pytest.raises(AttributeError, match="no attribute 'trad'"):
        carom.lab.trad  # noqa: B018
