"""Cases of the lab: kind, reference, steps and observation of a scene."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from helpers_trade_scenes import BALL, scene_file

from carom import scenes
from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import ForceSystem, Settings, System, World
from carom.lab import Only, suggest_dt, trade
from carom.lab.cases.case import case_of
from carom.lab.cases.subjects import subject_of
from carom.lab.cli.usage_errors import Problem
from carom.lab.engines.adapters import CaromEngine, PymunkEngine
from carom.lab.jobs.runs import Runs, refined_reference
from carom.lab.jobs.tasks import Task
from carom.lab.measure import survey as survey_module
from carom.lab.measure.norms import NORMS
from carom.lab.measure.observation import Seen, observe
from carom.lab.measure.survey import survey
from carom.lab.trading.records import CHAOTIC, IMPACTS, RESTING, SMOOTH, Cell
from carom.plugins import Physics
from carom.scenes import orbit


def world_of(settings, gravity=-10.0):
    return World(Physics(dimensions=2, gravity=(0, gravity)), settings=settings or Settings())


def stars(scale):
    """Eight bodies that attract each other, at rest at first: chaos soon. scale: metres in the unit of length."""

    class Attraction(ForceSystem):
        def add_forces(self, bodies, time):
            x = bodies.position / scale
            apart = x[None] - x[:, None]
            cube = (np.sum(apart**2, axis=2) + 1e-3) ** 1.5
            bodies.force[:] += scale * np.sum(apart / cube[..., None], axis=1)

    def build(settings, seed=0):
        world = world_of(settings, 0.0)
        for place in np.random.default_rng(1).uniform(-1, 1, (8, 2)):
            world.create_entity(Transform(scale * place), RigidBody())
        world.add_system(Attraction())
        return world

    return build


def test_start_phases_are_spread_evenly_and_few_of_them_reach_far():
    phase = case_of("oblique", repeats=3).phase
    for count in (1, 2, 4, 64):
        assert sorted(phase(repeat) for repeat in range(count)) == [(k + 1) / count for k in range(count)]
    assert [phase(repeat) for repeat in range(3)] == [1.0, 0.5, 0.25]


def test_a_survey_that_is_shared_out_finds_the_same(tmp_path, monkeypatch):
    ball, shared = subject_of(scene_file(tmp_path, BALL)), []

    def each(function, tasks):
        shared.extend(tasks)
        return Runs(2).each(function, tasks)

    alone = survey(ball, 1.0, each)
    assert not shared
    monkeypatch.setattr(survey_module, "LONG", 0.0)
    together = survey(ball, 1.0, each)
    assert shared == [(0.0, True), (survey_module.NUDGE, False)]
    plain = [
        {**dataclasses.asdict(found), "trial": {**found.trial.as_dict(), "milliseconds": None}}
        for found in (alone, together)
    ]
    assert plain[0] == plain[1]


@pytest.mark.parametrize(
    ("name", "seconds", "kind"),
    [("jump", 1.0, SMOOTH), ("oblique", 3.0, IMPACTS), ("stack", 1.0, RESTING), ("drops", 2.0, IMPACTS)],
)
def test_the_kind_of_a_scene(name, seconds, kind):
    assert survey(subject_of(name), seconds).kind == kind


@pytest.mark.slow
def test_a_gas_is_chaotic():
    """A nudge grows as e^(3 t) in this gas (30 discs per collision time), so by more than 1e7 in 8 time units."""
    assert survey(subject_of("thermal_gas", {"n": 100}), 8.0).kind == CHAOTIC


@pytest.mark.parametrize("scale", [pytest.param(1.0, marks=pytest.mark.slow), 1e9])
def test_chaos_without_contacts_is_refused_whatever_the_unit(scale):
    with pytest.raises(Problem, match="chaotic: nothing touches anything"):
        case_of(stars(scale), seconds=20.0)


def test_a_ball_that_rolls_off_a_platform_has_not_escaped():
    def build(settings, seed=0):
        world = world_of(settings)
        world.create_entity(Transform((0, -0.5)), AABBCollider((2, 0.5)))
        world.create_entity(Transform((0, 0.5)), RigidBody(linear_velocity=(4, 0)), SphereCollider(0.5))
        return world

    assert not survey(subject_of(build), 2.0).walled


def test_sensors_are_no_contacts():
    def build(settings, seed=0):
        world = world_of(settings, 0.0)
        world.create_entity(Transform((3, 0)), AABBCollider((1, 1), sensor=True))
        world.create_entity(Transform((0, 0)), RigidBody(linear_velocity=(3, 0)), SphereCollider(0.5))
        return world

    assert survey(subject_of(build), 1.5).kind == SMOOTH


def test_build_must_use_its_settings():
    with pytest.raises(Problem, match="must hand its settings to the World"):
        case_of(lambda settings, seed=0: scenes.get("jump").build(None), seconds=1.0)


def test_functions_that_close_over_different_values_are_different_scenes():
    def make(values):
        def build(settings, seed=0):
            return scenes.get("spring").build(settings, stiffness=float(values[-1]))

        return build

    large = np.ones(5000)
    other = large.copy()
    other[2500] = 2.0
    marks = [subject_of(make(values)).mark for values in (large, other, large)]
    assert marks[0] == marks[2] != marks[1]


def test_a_closed_form_is_used_for_what_it_knows_only():
    assert case_of("spring", options={"stiffness": 20.0}, seconds=1.0).form
    assert not case_of("spring", options={"damping": 2.0}, seconds=1.0).form
    assert not case_of("oblique", options={"restitution": 0.5}).form


def test_steps_that_a_run_has_no_room_for_are_left_out():
    assert max(case_of("spring", seconds=0.1).steps) <= 0.1 / 3
    with pytest.raises(Problem, match="no room"):
        case_of("spring", seconds=0.1, steps=(0.1,))


def test_runs_of_one_setting_have_keys_of_their_own():
    case = case_of("oblique", repeats=3)
    keys = {Task(case, Cell(dt), repeat).key for dt in (0.1, 0.2) for repeat in range(3)}
    assert len(keys) == 6


def test_drift_is_what_moves_after_the_fall():
    """A ball falls 5 m in 1 s, rests for the other 4 s and does not drift: less than the slop of a hundredth."""
    world = world_of(Settings())
    world.create_entity(Transform((0, -0.5)), AABBCollider((5, 0.5)))
    world.create_entity(Transform((0, 5.5)), RigidBody(), SphereCollider(0.5))
    seen = observe(CaromEngine(world), 4.0, 1 / 60)
    assert seen.drift < 0.01
    assert seen.reach == pytest.approx(5.0, abs=0.01)


def test_a_missing_impact_is_an_error_of_time():
    right, missed = (Seen(np.zeros((1, 2)), times=times, seconds=2.0) for times in ([0.1, 0.5], [0.1]))
    assert NORMS["impact_time"].measure(missed, right) == pytest.approx((2.0 - 0.5) / 2.0)
    assert NORMS["impact_time"].measure(right, right) == 0.0


def test_pymunk_gets_forces_of_its_own_time():
    """x'' = cos(6 t): x(1) = (1 - cos 6) / 36; explicit Euler is off by the sum of dt a / 2, at most dt / 2."""

    class Shaking(ForceSystem):
        def add_forces(self, bodies, time):
            bodies.force[:, 0] += math.cos(6 * time)

    world = world_of(Settings(dt=1 / 240), 0.0)
    world.create_entity(Transform((0, 0)), RigidBody())
    world.add_system(Shaking())
    engine = PymunkEngine(world, 10)
    for _ in range(240):
        engine.step(1 / 240)
    assert engine.position[0, 0] == pytest.approx((1 - math.cos(6)) / 36, abs=1 / 240)


@pytest.mark.slow
def test_a_reference_of_a_spring_against_a_wall_knows_how_good_it_is():
    """x = -cos until it meets the wall in the middle, where it is reflected at full speed: |cos| from then on. The two
    methods and twice the step must not agree much better than the first of them is right."""

    class Pull(ForceSystem):
        def add_forces(self, bodies, time):
            bodies.force[:, 0] -= 4.0 * (bodies.position[:, 0] + 0.5)

        def potential_energy(self, bodies):
            return 2.0 * float(((bodies.position[:, 0] + 0.5) ** 2).sum())

    def build(settings, seed=0):
        world = world_of(settings, 0.0)
        world.create_entity(Transform((0.5, 0)), AABBCollider((0.5, 2), restitution=1.0))
        world.create_entity(Transform((-1.5, 0)), RigidBody(), SphereCollider(0.5, restitution=1.0))
        world.add_system(Pull())
        return world

    case, reference, _ = refined_reference(case_of(build, seconds=4.0, steps=(1 / 30,)), Runs(1), lambda *_: True)
    assert case.reference is not None
    true = abs(case.reference.position[0, 0] - (-0.5 - abs(math.cos(2 * 4.0))))
    assert true < 20 * reference.agreement["position"]


def trap(settings, seed=0):
    """Nine elastic discs swing around the origin and meet; there are no static bodies and there is no height."""

    class Trap(ForceSystem):
        def add_forces(self, bodies, time):
            bodies.force[:] -= 4.0 * bodies.position

    world = world_of(settings, 0.0)
    world.add_system(Trap())
    for place in np.ndindex(3, 3):
        velocity = np.random.default_rng([seed, *place]).uniform(-4, 4, 2)
        disc = SphereCollider(0.5, restitution=1.0)
        world.create_entity(Transform(2 * np.array(place) - 2.0), RigidBody(linear_velocity=velocity), disc)
    return world


@pytest.mark.parametrize("norm", ["pressure", pytest.param("apex", marks=pytest.mark.slow)])
def test_what_is_0_throughout_is_no_error_of_0(norm):
    """Without walls there is no pressure, without gravity no height: every setting would meet every target."""
    with pytest.raises(Problem, match=rf"trap: {norm} is 0 throughout.* position, energy, impact_time, count"):
        trade(trap, norms=(norm,), seconds=1.0, steps=(1 / 30, 1 / 60), workers=1)


def test_a_norm_that_the_closed_form_does_not_tell_has_own_references():
    assert case_of("bouncing", seconds=3.0).reference is not None
    case = case_of("bouncing", seconds=3.0, norms=("pressure",))
    assert case.reference is None
    assert len(case.reference_cells) == 3


# -- worlds that cannot be measured, and why ------------------------------------------------------


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


def own_step(settings, seed=0):
    return thrown((settings or Settings()).replace(dt=1 / 120))


def own_substeps(settings, seed=0):
    return thrown(Settings(dt=settings.dt) if settings else None)


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
        (own_step, r"own_step: build must hand its settings to the World as they are.* has dt=0\.00833\d* instead"),
        (own_substeps, "own_substeps: build must hand.* has substeps=4 instead of 5"),
        (spoilt, r"spoilt: the trial run .* failed after 0\.5333 s: not finite; entity 1: linear_velocity is \[nan"),
    ],
)
def test_the_reason_why_a_world_cannot_be_measured(build, reason):
    with pytest.raises(Problem, match=reason):
        survey(subject_of(build), 2.0)


def planet(settings, seed=0):
    world = World(Physics(dimensions=2, gravity=(0.0, 0.0)), settings=settings or Settings())
    world.add_system(orbit.Sun())
    world.create_entity(Transform((1.0, 0.0)), RigidBody(linear_velocity=(0.0, 1.0)))
    return world


def test_an_integrator_that_there_is_not_is_refused_before_anything_runs():
    with pytest.raises(Problem, match=r"integrator must be one of .*'rk5' \(did you mean 'rk4'"):
        trade(planet, only=Only(integrators=("rk5",)), seconds=1.0, steps=(1 / 30, 1 / 60), workers=1)


@pytest.mark.parametrize("field", ["integrators", "collisions", "substeps", "geometries"])
def test_one_name_is_no_sequence_of_names(field):
    with pytest.raises(TypeError, match=f"Only.{field} must be a sequence, got 4"):
        Only(**{field: 4})
    with pytest.raises(TypeError, match=f"Only.{field} must be a sequence, got 'rk4'"):
        Only(**{field: "rk4"})


def test_limits_are_those_of_a_world():
    with pytest.raises(TypeError, match="world must be a World, got <function planet"):
        suggest_dt(planet)
