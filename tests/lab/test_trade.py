"""`trade()`: errors against closed forms, the reference's own error, the choice, and what cannot be measured.

The tolerance of each figure follows from its law, and was set before the run.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from helpers_trade_scenes import BALL, BULLET, CROWD, REST, SPRING, scene_file
from oracles.closed_forms import FORMS

from carom import scenes
from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import ForceSystem, Settings, System, World
from carom.lab import Trade, trade
from carom.lab.cli.usage_errors import Problem
from carom.lab.jobs import Jobs
from carom.lab.measure.observer import RunResult, mean_of, step_lengths
from carom.lab.trading.answer import answer
from carom.lab.trading.errors import NEVER, NORMS, Figure, figures_of, game_norm, norms_for, other_touches, reference_of
from carom.lab.trading.grid import Facts, grid, perform, survey, tasks_of
from carom.lab.trading.subject import Subject
from carom.lab.trading.trade import Point, SceneTrade, next_better, recommended, settings_line
from carom.plugins import Physics
from carom.scenes import jump, spring, stack

HERE = {"timing": False, "workers": 1}
JOBS = Jobs(1)


def case_of(*targets, **options) -> SceneTrade:
    """The only scene of a trade in this process, without the clock."""
    (case,) = trade(*targets, **{**HERE, **options}).scenes
    return case


def errors(case: SceneTrade, norm: str) -> dict[tuple[str, str, float], float]:
    keys = {(point.settings.integrator, point.settings.collision, point.settings.dt): point for point in case.points}
    return {key: point.figures[norm].error for key, point in keys.items() if norm in point.figures}


def facts_of(target, seconds=1.0, **options) -> Facts:
    return survey(Subject.of(target, options), seconds, JOBS)


def world_of(settings, gravity=-10.0):
    return World(Physics(dimensions=2, gravity=(0, gravity)), settings=settings or Settings())


# -- errors, against closed forms ---------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(("name", "seconds", "options"), [
    ("spring", 1.3, {}), ("orbit", 4.0, {}), ("jump", 1.0, {}), ("bouncing", 5.0, {"n": 3}), ("oblique", 3.0, {}),
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
    case = case_of(scene_file(tmp_path, BULLET), repeats=8, thorough=True, vary={"dt": (1 / 15, 1 / 480)})
    for point in (point for point in case.points if point.asked):
        coarse = point.settings.collision == "discrete" and point.settings.dt == 1 / 15
        assert point.repeats == 8
        assert bool(point.failed) == coarse
        assert not coarse or "tunnelled" in point.failed or "escaped" in point.failed
        assert point.work > 0  # failed runs have a cost too
    assert not case.chosen.failed


@pytest.mark.slow
def test_a_spring_too_stiff_for_its_step_fails(tmp_path):
    """z = 50 / 15 is above the limits of all methods, z = 50 / 240 below those of all but explicit Euler."""
    mine = scene_file(tmp_path, SPRING.format(stiffness=2500.0))
    case = case_of(mine, repeats=1, seconds=0.8, vary={"dt": (1 / 15, 1 / 240)})
    for point in case.points:
        if point.settings.dt != 1 / 60:
            assert bool(point.failed) == (point.settings.dt == 1 / 15)


@pytest.mark.slow
def test_a_chaotic_crowd_is_named_and_measured_by_statistics(tmp_path):
    """Elastic discs without forces conserve their kinetic energy with any step; places would measure chance."""
    mine = scene_file(tmp_path, CROWD)
    case = case_of(mine, vary={"dt": (1 / 60,)}, repeats=4, thorough=True)
    assert case.chaotic
    assert list(case.norms) == ["pressure", "rate", "kinetic"]
    for point in case.points:
        assert point.figures["kinetic"].error < 1e-9 or point.settings.collision == "discrete"
        assert "position" not in point.figures
    with pytest.raises(Problem, match=r"mine\.py is chaotic: two starts .* places would measure chance"):
        case_of(mine, norms=("position",))
    refused, measured = trade(mine, "jump", norms=("position",), vary={"dt": (1 / 30,)}, repeats=1, **HERE).scenes
    assert "chaotic" in refused.refused
    assert measured.refused == ""


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


@pytest.mark.slow
@pytest.mark.parametrize(("name", "wanted", "verify"), [
    ("jump", {"norms": ("apex",), "max_error": 0.1, "absolute": True, "seconds": 1.0}, apex_error),  # pixels
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
    one, other = (trade(mine, seconds=1.0, timing=False, workers=count).scenes[0] for count in (1, 2))
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


# -- the grid, and what cannot be measured ----------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "seconds", "chaotic", "rests"), [
    ("jump", 1.0, False, False), ("oblique", 3.0, False, False), ("stack", 1.0, False, True),
    pytest.param("thermal_gas", 8.0, True, False, marks=pytest.mark.slow),
])  # fmt: skip
def test_what_matters_in_a_scene(name, seconds, chaotic, rests):
    """A nudge grows as e^(3 t) in the gas (30 discs per collision time), so by more than 1e7 in 8 time units."""
    facts = facts_of(name, seconds, **({"n": 100} if chaotic else {}))
    assert (facts.chaotic, facts.rests) == (chaotic, rests)
    cells = grid(facts, {})
    assert facts.settings in cells
    assert all(cell.integrator != "explicit_euler" for cell in cells)
    assert max(cell.dt for cell in cells) <= max(1 / 30, facts.settings.dt)
    assert len({cell.substeps for cell in cells}) == (3 if rests else 1)
    assert len({cell.collision for cell in cells}) == (1 if name == "jump" else 2 if chaotic else 3)
    asked = grid(facts, {"dt": (0.1,), "integrator": ("explicit_euler",)})
    assert {(cell.dt, cell.integrator) for cell in asked} == {(0.1, "explicit_euler")}


def test_start_phases_are_spread_evenly_and_few_of_them_reach_far():
    facts = facts_of("jump")
    for count in (1, 2, 4, 64):
        phases = [task.phase for task in tasks_of(facts, facts.settings, range(count))]
        assert sorted(phases) == [(k + 1) / count for k in range(count)]
    assert len({task.key for task in tasks_of(facts, facts.settings, range(8))}) == 8


def test_steps_end_where_inputs_change():
    assert step_lengths(1.0, 0.25, 1.0, inputs=(0.5, 0.6)) == pytest.approx([0.25, 0.25, 0.1, 0.15, 0.25])
    assert step_lengths(1.0, 0.25, 0.5, inputs=(0.38, 2.0)) == pytest.approx([0.125, 0.255, 0.245, 0.25, 0.125])
    assert step_lengths(1.0, 0.25, 1.0) == step_lengths(1.0, 0.25, 1.0, inputs=(0.25, 0.75)) == [0.25] * 4


def test_a_ball_that_rolls_off_a_platform_has_not_escaped():
    def build(settings, seed=0):
        world = world_of(settings)
        world.create_entity(Transform((0, -0.5)), AABBCollider((2, 0.5)))
        world.create_entity(Transform((0, 0.5)), RigidBody(linear_velocity=(4, 0)), SphereCollider(0.5))
        return world

    assert not facts_of(build, 2.0).task.walled


def stars(settings, seed=0):
    """Eight bodies that attract each other, at rest at first: chaos soon."""

    class Attraction(ForceSystem):
        def add_forces(self, bodies, time):
            apart = bodies.position[None] - bodies.position[:, None]
            cube = (np.sum(apart**2, axis=2) + 1e-3) ** 1.5
            bodies.force[:] += np.sum(apart / cube[..., None], axis=1)

    world = world_of(settings, 0.0)
    for place in np.random.default_rng(1).uniform(-1, 1, (8, 2)):
        world.create_entity(Transform(place), RigidBody())
    world.add_system(Attraction())
    return world


def thrown(settings, velocity=(3.0, 9.0)):
    world = world_of(settings)
    world.create_entity(Transform((0, 0)), RigidBody(linear_velocity=velocity), SphereCollider(0.3))
    return world


def still(settings, seed=0):
    world = world_of(settings, 0.0)
    world.create_entity(Transform((0, 0)), RigidBody(), SphereCollider(0.3))
    return world


def unseeded(settings, seed=0):
    return thrown(settings, np.random.default_rng().uniform(1, 3, 2))


def spoilt(settings, seed=0):
    class Spoiler(System):
        def process(self, dt):
            if self.world.time > 0.5:
                self.world.bodies.linear_velocity[0] = np.nan

    world = thrown(settings)
    world.add_system(Spoiler())
    return world


@pytest.mark.parametrize(
    ("build", "reason"),
    [
        (still, "still: no body moves within 2 s: nothing to measure"),
        (unseeded, r"unseeded: build makes another world each time.*default_rng\(seed\)"),
        (spoilt, r"spoilt: the trial run .* failed after 0\.5333 s: not finite; entity 1: linear_velocity is \[nan"),
        pytest.param(stars, "stars is chaotic: two starts", marks=pytest.mark.slow),
    ],
)
def test_the_reason_why_a_world_cannot_be_measured(build, reason):
    with pytest.raises(Problem, match=reason):
        case_of(build, seconds=20.0 if build is stars else 2.0)


@pytest.mark.parametrize(("options", "words"), [
    ({"norms": ("positon",)}, "did you mean 'position'"),
    ({"norms": "position"}, "norms must be a sequence"),
    ({"options": {"mass": 2}}, "mass"),
    ({"workers": 0}, "workers"),
    ({"vary": {"collision": ("discreet",)}}, "discreet"),
    ({"vary": {"integrator": ("rk5",)}}, "did you mean 'rk4'"),
    ({"vary": {"integrator": "rk4"}}, "integrator must be a sequence, got 'rk4'"),
    ({"vary": {"dt": (0.5,)}, "seconds": 1.0}, "no room for steps of 0.5 s: at most 0.3333"),
    ({"max_error": True}, "max_error must be a number above 0"),
    ({"max_cost": math.inf}, "max_cost must be a number above 0"),
    ({"repeats": 1.5}, "repeats must be a whole number above 0"),
    ({"norms": ("pressure",), "seconds": 1.0}, "pressure is 0 throughout; what can be measured here: position"),
])  # fmt: skip
def test_wrong_arguments_are_named(options, words):
    with pytest.raises((ValueError, TypeError, Problem), match=words):
        case_of("spring", **options)


def test_functions_are_measured_here_and_their_options_reach_them():
    def falling(settings, seed=0, height=5.0):
        world = World(Physics(dimensions=2, gravity=(0.0, -10.0)), settings=settings)
        world.create_entity(Transform((0.0, height)), RigidBody(), SphereCollider(0.5))
        return world

    vary = {"dt": (1 / 10,), "integrator": ("explicit_euler", "velocity_verlet")}
    case = case_of(falling, seconds=1.0, vary=vary, workers=2, options={"height": 7.0})
    found = errors(case, "position")
    assert found["explicit_euler", "discrete", 1 / 10] == pytest.approx(0.1, rel=1e-9)  # g dt t / 2 = 0.5 m of 5 m
    assert found["velocity_verlet", "discrete", 1 / 10] < 1e-12


def test_a_build_with_settings_of_its_own_is_measured_with_those_that_are_asked_for():
    case = case_of(lambda settings, seed=0: scenes.get("jump").build(None), seconds=1.0, vary={"dt": (1 / 60, 1 / 120)})
    assert {point.settings.dt for point in case.points} == {1 / 60, 1 / 120}
    assert len({point.work for point in case.points}) > 1


def test_the_names_of_the_laboratory():
    import carom.lab

    assert {"trade", "Trade"} <= set(carom.lab.__all__) <= set(dir(carom.lab))
    assert carom.lab.Trade is Trade
    with pytest.raises(AttributeError, match="no attribute 'trad'"):
        carom.lab.trad  # noqa: B018
