"""`trade()`: errors against closed forms, the reference's own error, the choice, and what is noticed.

The tolerance of each figure follows from its law, and was set before the run.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from helpers_trade import HERE, JOBS, case_of, errors, facts_of, world_of
from helpers_trade_scenes import BALL, BULLET, CROWD, REST, SPRING, scene_file
from oracles.closed_forms import FORMS

from carom.components import AABBCollider, RigidBody, Transform
from carom.framework import Settings
from carom.lab import trade
from carom.lab.cli.usage_errors import Problem
from carom.lab.measure.observer import RunResult, mean_of
from carom.lab.trading.answer import answer
from carom.lab.trading.errors import NEVER, NORMS, Figure, figures_of, game_norm, norms_for, other_touches, reference_of
from carom.lab.trading.grid import perform, survey, tasks_of
from carom.lab.trading.subject import Subject
from carom.lab.trading.trade import Point, SceneTrade, next_better, recommended, settings_line
from carom.scenes import jump, spring, stack

# -- errors, against closed forms ---------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(("name", "seconds", "options"), [
    ("spring", 0.7, {}), ("jump", 1.0, {}), ("bouncing", 3.3, {"n": 3}),
    *(pytest.param(name, seconds, {}, marks=pytest.mark.long) for name, seconds in (("orbit", 1.5), ("oblique", 2.6))),
])  # fmt: skip
def test_errors_against_the_own_reference_are_those_against_the_closed_form(name, seconds, options):
    """Within three times what the reference says of itself, as it is extrapolated from two steps; and the scale, the
    longest way of a body, is seen at steps only."""
    subject = Subject.of(name, options)
    facts = survey(subject, seconds, JOBS)
    cell = facts.settings.replace(dt=1 / 60, integrator="semi_implicit_euler")
    case = case_of(
        name, seconds=seconds, options=options, repeats=1, vary={"dt": (cell.dt,), "integrator": (cell.integrator,)}
    )
    with subject.world(cell) as world:
        right = FORMS[name](world, seconds)
    (task,) = tasks_of(facts, cell, [0])
    true = figures_of([perform(task)], dataclasses.replace(right, tolerance=1.0), NORMS)
    for norm in ("position", "energy"):
        found = errors(case, norm)[cell.integrator, cell.collision, cell.dt]
        assert found == pytest.approx(true[norm].error, rel=2e-3, abs=3 * case.agreement[norm] + 1e-9)
    assert case.agreement["position"] < 1e-6


@pytest.mark.slow
def test_the_apex_of_the_jump_arc():
    """64 pixels; explicit Euler 66, 68, 72, semi-implicit Euler 62, 60, 56, velocity Verlet 64."""
    methods = ("explicit_euler", "semi_implicit_euler", "velocity_verlet")
    vary = {"dt": (1 / 60, 1 / 30, 1 / 15), "integrator": methods}
    case = case_of("jump", norms=("apex",), repeats=1, seconds=1.0, vary=vary)
    for (method, _, dt), error in errors(case, "apex").items():
        missed = 0.0 if method == "velocity_verlet" else 120 * dt / 64
        assert error == pytest.approx(missed, rel=1e-9, abs=1e-12)


@pytest.mark.long
@pytest.mark.parametrize(("method", "meets", "fails"), [("velocity_verlet", 800, 400), ("yoshida4", 400, 200)])
def test_the_steps_that_keep_the_energy_of_an_orbit_within_a_hundredth(method, meets, fails):
    """Known for Kepler's orbit, e = 0.6, four periods, steps halved until |E - E0| / |E0| < 1e-2, the norm here."""
    seconds = 8 * math.pi
    vary = {"dt": tuple(seconds / count for count in (fails, meets)), "integrator": (method,)}
    found = errors(case_of("orbit", norms=("energy",), seconds=seconds, vary=vary), "energy")
    assert found[method, "discrete", seconds / meets] < 1e-2 <= found[method, "discrete", seconds / fails]


@pytest.mark.slow
def test_a_bullet_through_a_wall_is_a_failure(tmp_path):
    """3.3 m a step through a wall 0.1 m thick: discrete collisions miss it in most start phases, others in none."""
    case = case_of(scene_file(tmp_path, BULLET), repeats=4, thorough=True, vary={"dt": (1 / 15, 1 / 240)})
    for point in (point for point in case.points if point.asked):
        coarse = point.settings.collision == "discrete" and point.settings.dt == 1 / 15
        assert point.repeats == 4
        assert bool(point.failed) == coarse
        assert not coarse or "missed a contact" in point.failed or "escaped" in point.failed
        assert point.work > 0  # failed runs have a cost too
    assert not case.chosen.failed


@pytest.mark.slow
def test_a_spring_too_stiff_for_its_step_fails(tmp_path):
    """z = 50 / 15 is above the limits of all methods, z = 50 / 120 below those of all but explicit Euler."""
    mine = scene_file(tmp_path, SPRING.format(stiffness=2500.0))
    case = case_of(mine, repeats=1, seconds=0.8, vary={"dt": (1 / 15, 1 / 120)})
    for point in case.points:
        if point.settings.dt != 1 / 60:
            assert bool(point.failed) == (point.settings.dt == 1 / 15)


@pytest.mark.slow
def test_a_chaotic_crowd_is_named_and_measured_by_statistics(tmp_path):
    """Elastic discs without forces conserve their kinetic energy with any step; places would measure chance."""
    mine = scene_file(tmp_path, CROWD)
    runs = {"folder": tmp_path / "runs"}  # kept: the scene is looked at once
    case = case_of(mine, vary={"dt": (1 / 60,)}, repeats=2, thorough=True, **runs)
    assert case.chaotic
    assert list(case.norms) == ["pressure", "rate", "kinetic"]
    for point in case.points:
        assert point.figures["kinetic"].error < 1e-9 or point.settings.collision == "discrete"
        assert "position" not in point.figures
    with pytest.raises(Problem, match=r"mine\.py is chaotic: two starts .* places would measure chance"):
        case_of(mine, norms=("position",), **runs)
    again = {**HERE, **runs, "vary": {"dt": (1 / 30,)}, "repeats": 1}
    refused, measured = trade(mine, "jump", norms=("position",), **again).scenes
    assert "chaotic" in refused.refused
    assert measured.refused == ""


@pytest.mark.slow
def test_what_rests_is_judged_by_what_it_sinks(tmp_path):
    case = case_of(scene_file(tmp_path, REST), vary={"dt": (1 / 60,), "substeps": (4,)})
    assert (case.chaotic, case.norm) == (False, "overlap")
    for point in case.points:
        assert point.figures["overlap"].error < 0.01
        assert point.severity <= 1


def test_two_methods_that_disagree_are_no_reference_for_places():
    """What one of them has elsewhere is not noticed, and the answer says so."""
    facts = facts_of("oblique", 3.0)
    norms, shown = norms_for(facts, ())
    one = seen(fixed=True, impacts=1, times=[0.5])
    other = dataclasses.replace(one, position=np.array([[0.0, 0.3]]))
    right, agreement = reference_of(facts, norms, shown, [one, one, other, other])
    assert right.doubt == pytest.approx(0.3)
    assert agreement["position"] == pytest.approx(0.3 / 4.0)
    assert figures_of([other], right, norms)["position"].times <= 0.5
    right, agreement = reference_of(facts, norms, shown, [other, one, one, one])
    assert right.doubt == pytest.approx(0.1)  # second order: a third of what the step changes
    near = dataclasses.replace(one, position=np.array([[0.0, 0.15]]))
    right, agreement = reference_of(facts, norms, shown, [one, one, other, near])
    assert right.doubt == 0.0  # the other method is on its way there
    own = point(1 / 60, 100.0)
    case = SceneTrade("a", norms={"position": ""}, points=[own], own=own, chosen=own, doubt=0.3)
    assert answer(case)[0] == "a (places are known to 30 cm only): use 60 (as it has now)"


# -- the choice, in runs of the test --------------------------------------------------------------------------------


def apex_error(settings: Settings) -> float:
    """Pixels, the worst of 64 jumps that leave the ground at different times within a step."""
    missed = []
    for phase in range(64):
        start = phase / 64 * settings.dt
        world = world_of(settings, -jump.GRAVITY)
        height, speed = jump.JUMP_SPEED * start - jump.GRAVITY * start**2 / 2, jump.JUMP_SPEED - jump.GRAVITY * start
        box = AABBCollider((0.5, 0.5))
        world.create_entity(Transform((0.0, height)), RigidBody(linear_velocity=(1.0, speed)), box)
        highest = 0.0
        while world.time < 1.0:
            world.step()
            highest = max(highest, float(world.bodies.dynamic.position[0, 1]))
        missed.append(abs(highest - 64.0))
    return max(missed)


def spring_error(settings: Settings) -> float:
    """Relative to the largest displacement, 2: the worst in the last oscillation that ends by 5.2 s."""
    world, omega, worst = spring.build(settings), math.sqrt(spring.STIFFNESS / spring.MASS), 0.0
    while world.time + settings.dt <= 5.2:
        world.step()
        if world.time > 4.2:
            place = float(world.bodies.dynamic.position[0, 0])
            worst = max(worst, abs(place - math.cos(omega * world.time)) / 2)
    return worst


def stack_error(settings: Settings) -> float:
    """The deepest overlap of ten boxes of side 1 from 2.5 s to 10 s, sizes."""
    world, worst = stack.build(settings), 0.0
    while world.time < 10.0:
        world.step()
        if world.time > 2.5:
            height = np.sort(world.bodies.dynamic.position[:, 1])
            worst = max(worst, float((1.0 - np.diff(height, prepend=-0.5)).max()))
    return worst


APEX = {  # in pixels
    "norms": ("apex",), "max_error": 0.1, "absolute": True, "seconds": 1.0, "repeats": 16,
    "vary": {"dt": (1 / 30, 1 / 60)},
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("name", "wanted", "verify"), [
    ("jump", APEX, apex_error),
    pytest.param("spring", {"max_error": 1e-3}, spring_error, marks=pytest.mark.long),
    pytest.param("stack", {"max_error": 1e-3}, stack_error, marks=pytest.mark.long),
])  # fmt: skip
def test_the_choice_keeps_the_error_in_runs_that_share_nothing_with_the_lab(name, wanted, verify):
    case = case_of(name, **wanted)
    assert case.chosen is not None
    settings = eval(case.chosen.line, {"Settings": Settings})
    assert settings == case.chosen.settings
    assert settings.dt <= 1 / 30
    assert settings.integrator != "explicit_euler"
    assert verify(settings) <= wanted["max_error"]


@pytest.mark.slow
def test_the_same_scene_gets_the_same_answer_with_any_number_of_workers(tmp_path, monkeypatch):
    pytest.importorskip("joblib")
    monkeypatch.setattr("carom.lab.jobs.FEW_SECONDS", 0.0)
    mine = scene_file(tmp_path, BALL)
    chosen = {"seconds": 0.5, "vary": {"dt": (1 / 60,), "collision": ("discrete",)}, "timing": False}
    one, other = (trade(mine, workers=count, **chosen).scenes[0] for count in (1, 2))
    assert one == other


def point(dt, work, times=0.0, error=1e-3, **fields) -> Point:
    figures = {"position": Figure(error, times, "seen")}
    return Point(Settings(dt=dt, **fields), f"{1 / dt:.0f}", True, 4, figures, "", work)


def test_the_cheapest_of_which_nothing_is_noticed_and_one_step_more():
    own = point(1 / 60, 100.0)
    case = SceneTrade("a", norms={"position": ""}, points=[own, point(1 / 30, 50.0, 0.9, 1e-2)], own=own)
    case.chosen = recommended(case)
    assert case.chosen.line == "30"
    assert next_better(case) is own  # a tenth of the error
    case.points[1].figures["position"] = case.points[1].figures["position"]._replace(times=1.1)
    assert recommended(case) is own  # it would be noticed
    case.points[1] = point(1 / 30, 90.0)
    assert recommended(case) is own  # it costs hardly more
    case.points += [point(1 / 30, 50.0, substeps=8), point(1 / 30, 45.0, substeps=8, collision="continuous")]
    assert recommended(case).settings == Settings(dt=1 / 30, substeps=8)  # it changes less, and costs hardly more


def test_a_largest_error_or_cost_that_nothing_keeps():
    own = point(1 / 60, 100.0)
    case = SceneTrade("a", norms={"position": ""}, points=[own, point(1 / 120, 200.0, error=1e-4)], own=own)
    case.max_error = 5e-4
    assert recommended(case).line == "120"
    case.max_error = 5e-5
    assert recommended(case) is None
    case.max_error, case.max_cost, own.milliseconds = math.inf, 3.0, 4.0
    assert recommended(case).line == "120"  # as far as it is known
    case.points[1].milliseconds = 8.0
    assert recommended(case) is None
    case.max_error, case.agreement = 5e-3, {"position": 1e-3}
    assert case.unknowable


@pytest.mark.parametrize(("settings", "line"), [
    (Settings(), "Settings()"), (Settings(dt=1 / 30), "Settings(dt=1/30)"),
    (Settings(dt=2 / 45, collision="continuous"), 'Settings(dt=2/45, collision="continuous")'),
    (Settings(dt=0.1234567891), "Settings(dt=0.1234567891)"), (Settings(dt=0.005), "Settings(dt=1/200)"),
])  # fmt: skip
def test_settings_as_a_line_to_paste(settings, line):
    assert settings_line(settings) == line
    assert eval(line) == settings


# -- what is noticed -------------------------------------------------------------------------------------------------


def seen(values=None, **more):
    known = {"seconds": 1.0, "reach": 4.0, "entities": [1], "tolerance": 0.01}
    return RunResult(np.zeros((1, 2)), values=values or {}, **{**known, **more})


@pytest.mark.parametrize(("mine", "right", "error", "words"), [
    ([7.0], [7.0], 0.0, ""),
    ([6.0], [7.0], 1 / 7, "x: 6 instead of 7"),
    ([3.205], [3.2005], 0.0045 / 3.2005, ""),
    ([3.3], [3.2005], 0.0995 / 3.2005, "x: 3.3 instead of 3.2"),
    ([math.nan], [3.0], 1.0, "x: none instead of 3"),
    ([3.0], [math.nan], 1.0, "x: one, and there should be none"),
    ([math.nan], [math.nan], 0.0, ""),
    ([0.0, 1.0], [0.0, 3.0], 0.5, "x ends 2 m from where it should"),
    ([0.0, 1.0], [0.0, 1.009], 0.009 / 4, ""),
])  # fmt: skip
def test_values_of_a_game_are_compared_by_name(mine, right, error, words):
    norms = {"x": game_norm("x", len(right) > 1)}
    figure = figures_of([seen({"x": mine})], seen({"x": right}), norms)["x"]
    assert figure.error == pytest.approx(error)
    assert figure.text == words if words else figure.times <= 1


def test_a_mean_is_noticed_beyond_chance_and_beyond_what_games_differ_by():
    right = mean_of([seen({"kills": [kills]}) for kills in (90.0, 110.0, 100.0, 100.0)], ())
    right.tolerance = 0.01
    norms = {"kills": game_norm("kills", False, True)}

    def times(mean, count):
        return figures_of([seen({"kills": [mean]})] * count, right, norms, True)["kills"].times

    assert times(110.0, 1) <= 1
    assert times(90.0, 2) <= 1
    assert times(105.0, 16) <= 1
    assert times(120.0, 16) > 1
    assert times(60.0, 2) > 1
    assert figures_of([seen({})], right, norms, True)["kills"].times == NEVER


def test_the_order_of_first_contacts():
    right = seen(touches=[(1, 2, 0.1), (1, 3, 0.2), (2, 3, 0.3), (3, 4, 0.4)])
    assert other_touches(dataclasses.replace(right, touches=right.touches[::-1]), right) == []  # the times stay
    swapped = seen(touches=[(1, 2, 0.1), (2, 3, 0.2), (1, 3, 0.3), (3, 5, 0.5)])
    assert [(a, b) for a, b, _ in other_touches(swapped, right)] == [(3, 4), (3, 5), (1, 3)]
    assert figures_of([swapped], right, NORMS)["order"].error == 0.75
    at_once = seen(touches=[(1, 2, 0.1), (2, 3, 0.2), (1, 3, 0.2), (3, 4, 0.4)])  # in one step: no order
    assert other_touches(at_once, right) == []


def test_a_missing_impact_is_an_error_of_time():
    right, missed = (seen(times=times, impacts=len(times)) for times in ([0.1, 0.5], [0.1]))
    found = figures_of([missed], right, NORMS)
    assert found["impact_time"].error == pytest.approx(1.0 - 0.5)
    assert found["count"].error == 0.5
    assert found["count"].text == "1 impacts fewer"
