"""`trade()`: which settings and runs matter in a scene, and what cannot be measured."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers_trade import case_of, errors, facts_of, world_of

from carom import scenes
from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import ForceSystem, System, World
from carom.lab import Trade
from carom.lab.cli.usage_errors import Problem
from carom.lab.measure.observer import step_lengths
from carom.lab.trading.grid import grid, tasks_of
from carom.plugins import Physics


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.slow
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
    ({"norms": ("pressure",), "seconds": 0.3}, "pressure is 0 throughout; what can be measured here: position"),
])  # fmt: skip
def test_wrong_arguments_are_named(options, words):
    with pytest.raises((ValueError, TypeError, Problem), match=words):
        case_of("spring", **options)


@pytest.mark.slow
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


@pytest.mark.slow
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
