"""Games in the laboratory: what they compare, recorded inputs, and bodies that come and go."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Component, Phase, Settings, System, World
from carom.lab import Inputs, trade
from carom.lab.cli.usage_errors import Problem
from carom.lab.jobs import Jobs
from carom.lab.trading.answer import answer
from carom.lab.trading.grid import grid, survey
from carom.lab.trading.subject import Subject
from carom.plugins import Physics

ROOT = Path(__file__).parents[2]

METHOD = {"collision": ("discrete",), "integrator": ("semi_implicit_euler",)}
FEW = {"repeats": 3, "timing": False, "thorough": True}


class Shot(Component):
    """What is fired."""


class Gun(Component):
    """What fires."""


class Fire(System):
    """Ten shots a second in random directions; what gets far away goes, and counts."""

    phase = Phase.START

    def __init__(self, seed):
        super().__init__()
        self.random = np.random.default_rng(seed)
        self.fired = self.gone = 0

    def process(self, dt):
        world = self.world
        ((_, (gun, _)),) = world.get_components(Transform, Gun)
        for shot, (place, _) in world.get_components(Transform, Shot):
            if np.abs(place.position).max() > 2.0:
                world.delete_entity(shot)
                self.gone += 1
        while self.fired < 10 * (world.time + dt) - 1e-9:
            self.fired += 1
            angle = self.random.uniform(0, 2 * np.pi)
            start = 0.6 * np.array([math.cos(angle), math.sin(angle)])
            world.create_entity(
                Transform(gun.position + start), RigidBody(0.1, 8 * start), SphereCollider(0.1, restitution=1), Shot()
            )


def shots(settings, seed=0):
    """Shots that bounce off pillars and each other."""
    world = World(Physics(dimensions=2, gravity=(0, 0)), settings=settings)
    world.add_system(Fire(seed))
    world.create_entity(Transform((0, 0)), RigidBody(), SphereCollider(0.3, restitution=1), Gun())
    for x, y in ((1.2, 0), (-1.2, 0), (0, 1.2), (0, -1.2)):
        world.create_entity(Transform((x, y)), SphereCollider(0.3, restitution=1))
    return world


def compared(world):
    fire = world.get_processor(Fire)
    return {"gone": fire.gone, "fired": fire.fired, "first": world.bodies.position[0]}


shots.compared = compared


@pytest.mark.slow
def test_a_game_that_spawns_is_compared_by_means_over_its_seeds():
    result = trade(shots, seconds=1.5, vary={"dt": (1 / 30,), **METHOD}, **FEW).scenes[0]
    assert result.chaotic
    assert "0.01 of a body apart" in result.why
    assert list(result.norms) == ["gone", "fired"]  # a place is another one in each game
    point = result.points[0]
    assert point.repeats == 3
    assert point.figures["fired"].error == 0
    assert point.figures["gone"].error < 1
    text = "\n".join(answer(result))
    assert "(chaotic: means over seeds)" in text
    assert "fired: 15 on average instead of 15" in text


@pytest.mark.slow
def test_without_a_name_for_it_bodies_are_matched_in_the_order_of_their_creation():
    def plain(settings, seed=0):
        return shots(settings, 0)

    found = trade(plain, seconds=0.2, vary={"dt": (1 / 60,), **METHOD}, **FEW).scenes[0]
    assert found.norm == "position"
    assert found.points[0].figures["position"].error < 0.1


def begins_with_a_title(settings, seed=0):
    """Nothing that moves by itself is there at the start: the first ball comes after half a second."""

    class Begin(System):
        def process(self, dt):
            if self.world.time >= 0.5 and not len(self.world.bodies.dynamic):
                self.world.create_entity(Transform((0, 0)), RigidBody(linear_velocity=(2, 0)), SphereCollider(0.3))

    world = World(Physics(dimensions=2, gravity=0), settings=settings)
    world.create_entity(Transform((0, -5)), RigidBody(kind="kinematic"), SphereCollider(0.3))
    world.add_system(Begin())
    return world


def test_a_game_may_begin_without_a_body_that_moves_by_itself():
    with pytest.raises(Problem, match="there is no body that moves by itself"):
        survey(Subject.of(begins_with_a_title), 1.0, Jobs(1))
    begins_with_a_title.compared = lambda world: {"balls": len(world.bodies.dynamic)}
    assert survey(Subject.of(begins_with_a_title), 1.0, Jobs(1)).trial.values == {"balls": [1.0]}


@pytest.mark.slow
def test_balls_on_a_line_touch_in_order():
    def line(settings, seed=0):
        world = World(Physics(dimensions=2, gravity=(0, 0)), settings=settings)
        for k, speed in enumerate((3.0, 0.0, 0.0)):
            body = RigidBody(linear_velocity=(speed, 0))
            world.create_entity(Transform((1.5 * k, 0)), body, SphereCollider(0.5, restitution=1))
        world.create_entity(Transform((6, 0)), AABBCollider((0.5, 2), restitution=1))
        return world

    found = trade(line, norms=("order",), seconds=1.2, vary={"dt": (1 / 60,), **METHOD}, **FEW).scenes[0]
    assert found.points[0].figures["order"].error == 0


def test_what_passes_beside_has_missed_a_contact():
    """The right arc touches a ledge 1 cm below its apex, Euler's is lower by g dt t / 2 = 8 cm, and touches nothing."""
    def ledge(settings, seed=0):
        world = World(Physics(dimensions=2, gravity=(0, -10)), settings=settings)
        world.create_entity(Transform((0, 0)), RigidBody(linear_velocity=(3, 10)), SphereCollider(0.1))
        world.create_entity(Transform((3, 5.59)), AABBCollider((0.5, 0.5)))
        return world

    found = trade(ledge, seconds=1.5, vary={"dt": (1 / 60,), **METHOD}, **FEW).scenes[0]
    assert found.points[0].failed == "3 of 3 missed a contact"


def test_inputs_are_played_back_with_steps_of_any_length(tmp_path):
    keys = Inputs([(0.0, "right"), (0.5, "right jump"), (0.5 + 1 / 60, "right"), (1.0, "")])
    keys.write(tmp_path / "a.keys")
    assert (tmp_path / "a.keys").read_text().splitlines()[1] == "0.5 jump right"
    for kept in (keys, Inputs.read(tmp_path / "a.keys")):
        for dt in (1 / 15, 1 / 60, 1 / 240):
            held = [kept.held(k * dt, dt) for k in range(round(1.5 / dt))]
            jumps = sum("jump" in words for words in held)
            assert jumps == max(1, round(1 / 60 / dt))
            assert held[0] == {"right"}
            assert held[-1] == frozenset()
    assert Inputs().held(1.0) == frozenset()
    recorded = Inputs()
    for step in range(90):
        recorded.record(step / 60, {"fire"} if 30 <= step < 33 else ())
    assert [step for step in range(90) if recorded.held(step / 60, 1 / 60)] == [30, 31, 32]
    with pytest.raises(ValueError, match=r"0.5 s is before 1.48"):
        recorded.record(1.48, {"x"}) or recorded.record(0.5, ())
    (tmp_path / "b.keys").write_text("0.0 right\nleft 0.5\n")
    with pytest.raises(ValueError, match=r"b.keys, line 2"):
        Inputs.read(tmp_path / "b.keys")


@pytest.mark.parametrize(("time", "held", "named"), [
    (0.0, "jump", "'jump'"), (0.0, {"page up"}, "'page up'"), (0.0, {""}, "''"), (0.0, {1}, "1"), (0.0, {b"q"}, "b'q'"),
    ("0", (), "'0'"), (None, (), "None"), (math.nan, (), "nan"), (math.inf, {"q"}, "inf"),
])  # fmt: skip
def test_inputs_that_a_file_would_not_hold_are_refused(time, held, named):
    keys = Inputs()
    with pytest.raises((TypeError, ValueError), match=f"got {named}$"):
        keys.record(time, held)
    assert keys.held(1.0) == frozenset()


def test_inputs_are_read_as_they_were_recorded(tmp_path):
    keys = Inputs()
    for time in (np.float32(0.0), *np.arange(1, 5) / 60, np.int64(1)):
        keys.record(time, {f"k{time:.2f}", "umlaut-ü"})
    keys.write(tmp_path / "a.keys")
    back = Inputs.read(tmp_path / "a.keys")
    assert [back.held(k / 60) for k in range(90)] == [keys.held(k / 60) for k in range(90)]


def runner(settings=None, seed=0):
    """5 m/s to the right from 0.31 s to 0.72 s: 2.05 m, in steps of any length."""
    keys = Inputs([(0.31, "right"), (0.72, "")])

    class Control(System):
        phase = Phase.START

        def process(self, dt):
            self.world.bodies.linear_velocity[0, 0] = 5.0 * ("right" in keys.held(self.world.time, dt))

    world = World(Physics(dimensions=2), settings=settings or Settings(substeps=8))
    world.add_system(Control())
    world.create_entity(Transform((0, 0)), RigidBody(), SphereCollider(0.5))
    return world


runner.compared = lambda world: {"hero": world.bodies.position[0]}


@pytest.mark.slow
def test_inputs_act_at_their_times_in_every_run_and_their_age_is_told_apart():
    """A key acts up to a step early and ends up to a step late, each of which is 5 m/s times the step."""
    plan = {"seconds": 0.8, "repeats": 4, "timing": False, "thorough": True}
    found = trade(runner, vary={"dt": (1 / 30, 1 / 60), **METHOD}, **plan).scenes[0]
    assert [point.figures["hero"].error * found.scale < 1e-9 for point in found.points] == [True] * 2
    assert found.chosen is not None
    assert found.inputs.keys() == {1 / 60, found.chosen.settings.dt} == {1 / 60, 1 / 30}
    for dt, (words,) in found.inputs.items():
        metres = float(words.partition("ends ")[2].partition(" cm")[0]) / 100
        assert 0.5 * 5 * dt < metres <= 2 * 5 * dt
        again = []
        for phase in (1.0, 0.5, 0.75, 0.25):  # in whole steps, with nothing but a world
            with runner(Settings(dt=phase * dt)) as world:
                while world.time < 0.8:
                    world.step()
                    world.settings = world.settings.replace(dt=dt)
                again.append(abs(world.bodies.position[0, 0] - 2.05))
        assert max(again) / 2 <= metres <= 2 * max(again)
    assert "keys  read once a step, which is in no error above: 16.7 ms: hero ends" in answer(found)[-1]
    assert found.own.line == "Settings(substeps=8)"  # what the build makes of None


def test_steps_are_not_tried_that_inputs_would_cut_into_pieces():
    dense = Inputs([(k / 60, str(k)) for k in range(60)])

    def watched(settings, seed=0):
        world = shots(settings, seed)
        watches = System()
        watches.process = lambda dt: dense.held(world.time, dt)
        world.add_system(watches)
        return world

    facts = survey(Subject.of(watched), 1.0, Jobs(1))
    assert len(facts.task.inputs) == 59
    assert max(cell.dt for cell in grid(facts, {})) == facts.settings.dt


@pytest.mark.slow
@pytest.mark.parametrize(("returned", "words"), [
    (3, "compared must return a dict"), ({"x": "much"}, "compared must give a number"), ({"x": [1, 2, 3]}, "a place"),
])  # fmt: skip
def test_what_cannot_be_compared_is_refused(returned, words):
    def game(settings, seed=0):
        return shots(settings, seed)

    game.compared = lambda world: returned
    with pytest.raises(Problem, match=words):
        trade(game, seconds=0.2, vary={"dt": (1 / 30,), **METHOD}, **FEW)
    if isinstance(returned, dict):
        game.compared = lambda world: {"where": world.bodies.position[0]}
        with pytest.raises(Problem, match="let compared give numbers too"):
            trade(game, seconds=1.5, vary={"dt": (1 / 30,), **METHOD}, **FEW)
        with pytest.raises(Problem, match="no norm 'wher'"):
            trade(game, norms=("wher",), **FEW)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "options"), [("survivors", {"enemies": 40}), ("platformer", {}), ("pool", {})])
def test_the_games_of_the_examples_play(name, options):
    game = Subject.of(str(ROOT / "examples" / "games" / f"{name}.py"), options)
    with game.world(None) as world:
        before = game.loaded.values_of(world)
        for _ in range(90):
            world.step()
        assert game.loaded.values_of(world).keys() == before.keys()
        assert game.loaded.values_of(world) != before
        assert world.faults == [] or name == "survivors"
