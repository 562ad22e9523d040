"""Games in the laboratory: what they compare, recorded inputs, and bodies that come and go."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Component, Phase, Settings, System, World
from carom.lab import Inputs, Only, trade
from carom.lab.cases import case
from carom.lab.cases.subjects import subject_of
from carom.lab.cli.usage_errors import Problem
from carom.lab.measure.effects import NEVER, at_worst, effects_of, in_words, noticed, told
from carom.lab.measure.norms import errors_of, norm_of, other_touches
from carom.lab.measure.observation import Seen, mean_of, step_lengths
from carom.lab.trading.answer import answer, recommended
from carom.lab.trading.records import CHAOTIC, IMPACTS, Cell
from carom.plugins import Physics

ROOT = Path(__file__).parents[2]

FEW = {"repeats": 3, "timing": False, "only": Only(collisions=("discrete",), integrators=("semi_implicit_euler",))}


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


def test_a_game_that_spawns_is_compared_by_means_over_its_seeds(monkeypatch):
    monkeypatch.setattr(case, "ENSEMBLE", 4)
    result = trade(shots, seconds=1.5, steps=(1 / 30,), **FEW).cases[0]
    assert result.kind == CHAOTIC
    assert "bodies come" in result.why
    assert result.repeated == "seeds"
    assert list(result.norms) == ["mean gone", "mean fired"]  # a place is another one in each game
    point = result.curves[0].points[0]
    assert point.errors["mean fired"].mean == 0
    assert point.errors["mean gone"].high < 1
    assert point.effects["right fired"] == 15
    assert point.effects["runs"] == 3
    text = "\n".join(answer(result))
    assert "fired: 15 on average instead of 15" in text


def test_without_a_name_for_it_bodies_are_matched_in_the_order_of_their_creation():
    def plain(settings, seed=0):
        return shots(settings, 0)

    found = trade(plain, seconds=0.2, steps=(1 / 60,), **FEW).cases[0]
    assert found.norm == "position"
    assert found.curves[0].points[0].errors["position"].high < 0.1


def seen(values, **more):
    return Seen(np.zeros((1, 2)), values=values, seconds=1.0, reach=4.0, entities=[1], **more)


@pytest.mark.parametrize(("mine", "right", "error", "words"), [
    ([7.0], [7.0], 0.0, []),
    ([6.0], [7.0], 1 / 7, ["x: 6 instead of 7"]),
    ([3.205], [3.2005], 0.0045 / 3.2005, []),
    ([3.3], [3.2005], 0.0995 / 3.2005, ["x: 3.3 instead of 3.2"]),
    ([math.nan], [3.0], 1.0, ["x: none instead of 3"]),
    ([3.0], [math.nan], 1.0, ["x: there is one, and there should be none"]),
    ([math.nan], [math.nan], 0.0, []),
    ([math.nan], [0.0, 3.0], 1.0, ["x: none, and there should be one"]),
    ([0.0, 3.0], [math.nan], 1.0, ["x: there is one, and there should be none"]),
    ([0.0, 1.0], [0.0, 3.0], 0.5, ["x ends 2 m from where it should"]),
    ([0.0, 1.0], [0.0, 1.009], 0.009 / 4, []),
])  # fmt: skip
def test_values_of_a_game_are_compared_by_name(mine, right, error, words):
    one, other = seen({"x": mine}), seen({"x": right})
    assert errors_of(one, other, ["x"])["x"] == pytest.approx(error)
    effects = at_worst([effects_of(one, other, IMPACTS)])
    assert in_words(effects) == words
    assert len(told(effects)) == 1


def test_a_mean_is_noticed_beyond_chance_and_beyond_what_games_differ_by():
    right = mean_of([seen({"kills": [kills]}) for kills in (90.0, 110.0, 100.0, 100.0)], ())
    assert right.values == {"kills": [100.0]}
    assert right.runs == 4
    assert right.spread["kills"] == pytest.approx(8.165, 1e-3)

    def effects(mean, count):
        return at_worst([effects_of(seen({"kills": [mean]}), right, CHAOTIC)] * count)

    assert not noticed(effects(110.0, 1))
    assert not noticed(effects(90.0, 2))
    assert not noticed(effects(110.0, 16))  # four games are few: 3.2 standard errors may be chance
    assert noticed(effects(120.0, 16))
    assert noticed(effects(70.0, 2))
    assert in_words(effects(130.0, 4)) == [
        "kills: 130 on average instead of 100; one game differs from the next by 8.2"
    ]
    assert norm_of("mean kills").signed
    assert not norm_of("kills").signed
    assert errors_of(seen({"kills": [90.0]}), right, ["mean kills"]) == {"mean kills": -0.1}
    assert abs(at_worst([effects_of(seen({}), right, CHAOTIC)])["mean kills"]) == NEVER


def test_the_order_of_first_contacts():
    right = seen({}, touches=[(1, 2, 0.1), (1, 3, 0.2), (2, 3, 0.3), (3, 4, 0.4)])
    assert other_touches(dataclasses.replace(right, touches=right.touches[::-1]), right) == []  # the times stay
    swapped = seen({}, touches=[(1, 2, 0.1), (2, 3, 0.2), (1, 3, 0.3), (3, 5, 0.5)])
    assert sorted(other_touches(swapped, right)) == [(1, 3, "order"), (3, 4, "never"), (3, 5, "touches")]
    assert errors_of(swapped, right, ["order"])["order"] == 0.75
    at_once = seen({}, touches=[(1, 2, 0.1), (2, 3, 0.2), (1, 3, 0.2), (3, 4, 0.4)])  # in one step: no order
    assert other_touches(at_once, right) == []
    assert in_words(effects_of(swapped, right, IMPACTS)) == ["entity 3 never touches entity 4 (3 such pairs)"]


def test_balls_on_a_line_touch_in_order():
    def line(settings, seed=0):
        world = World(Physics(dimensions=2, gravity=(0, 0)), settings=settings)
        for k, speed in enumerate((3.0, 0.0, 0.0)):
            body = RigidBody(linear_velocity=(speed, 0))
            world.create_entity(Transform((1.5 * k, 0)), body, SphereCollider(0.5, restitution=1))
        world.create_entity(Transform((6, 0)), AABBCollider((0.5, 2), restitution=1))
        return world

    found = trade(line, norms=("order",), seconds=2.0, steps=(1 / 60,), **FEW).cases[0]
    assert found.curves[0].points[0].errors["order"].high == 0


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


def test_inputs_act_at_their_times_in_every_run_and_their_age_is_told_apart():
    """A key acts up to a step early and ends up to a step late, each of which is 5 m/s times the step."""
    plan = {"seconds": 1.0, "repeats": 4, "timing": False, "only": Only(integrators=("semi_implicit_euler",))}
    found = trade(runner, steps=(1 / 15, 1 / 30, 1 / 60), **plan).cases[0]
    assert [point.effects["value at hero"] < 1e-9 for point in found.points] == [True] * 3
    chosen = recommended(found)
    assert chosen is not None
    late = {float(dt): effects["value at hero"] for dt, effects in found.inputs.items()}
    assert late.keys() == {1 / 60, chosen.cell.dt}
    for dt, metres in late.items():
        assert 0.5 * 5 * dt < metres <= 2 * 5 * dt
        again = []
        for phase in (1.0, 0.5, 0.75, 0.25):  # in whole steps, with nothing but a world
            with runner(Settings(dt=phase * dt)) as world:
                while world.time < 1.0:
                    world.step()
                    world.settings = world.settings.replace(dt=dt)
                again.append(abs(world.bodies.position[0, 0] - 2.05))
        assert max(again) / 2 <= metres <= 2 * max(again)
    assert "inputs   read once a step" in answer(found)[-1]
    assert found.own == Cell(1 / 60, substeps=8)  # what the build makes of None
    assert trade(runner, steps=(1 / 30, 1 / 60), **plan).cases[0].points[-1].line == "Settings(substeps=8)"


def test_steps_end_where_inputs_change():
    assert step_lengths(1.0, 0.25, 1.0, inputs=(0.5, 0.6)) == pytest.approx([0.25, 0.25, 0.1, 0.15, 0.25])
    assert step_lengths(1.0, 0.25, 0.5, inputs=(0.38, 2.0)) == pytest.approx([0.125, 0.255, 0.245, 0.25, 0.125])
    assert step_lengths(1.0, 0.25, 1.0) == step_lengths(1.0, 0.25, 1.0, inputs=(0.25, 0.75)) == [0.25] * 4
    dense = Inputs([(k / 60, str(k)) for k in range(60)])

    def watched(settings, seed=0):
        world = shots(settings, seed)
        watches = System()
        watches.process = lambda dt: dense.held(world.time, dt)
        world.add_system(watches)
        return world

    steps = case.case_of(watched, seconds=1.0).steps
    assert max(steps) <= 1 / 60 * (1 + 1e-9)  # longer ones would be cut into pieces too often to be judged


@pytest.mark.parametrize(("returned", "words"), [
    (3, "compared must return a dict"), ({"x": "much"}, "compared must give a number"), ({"x": [1, 2, 3]}, "a place"),
])  # fmt: skip
def test_what_cannot_be_compared_is_refused(returned, words):
    def game(settings, seed=0):
        return shots(settings, seed)

    game.compared = lambda world: returned
    with pytest.raises(Problem, match=words):
        print(subject_of(game).names)
    if isinstance(returned, dict):
        game.compared = lambda world: {"where": world.bodies.position[0]}
        with pytest.raises(Problem, match="let compared give numbers too"):
            trade(game, seconds=1.5, steps=(1 / 30,), **FEW)
        with pytest.raises(Problem, match="no norm 'wher'"):
            trade(game, norms=("wher",), **FEW)


@pytest.mark.parametrize(("name", "options"), [("survivors", {"enemies": 40}), ("platformer", {}), ("pool", {})])
def test_the_games_of_the_examples_play(name, options):
    game = subject_of(str(ROOT / "examples" / "games" / f"{name}.py"), options)
    with game.world(None) as world:
        before = game.loaded.values_of(world)
        for _ in range(90):
            world.step()
        assert game.loaded.values_of(world).keys() == before.keys() == set(game.names)
        assert game.loaded.values_of(world) != before
        assert world.faults == [] or name == "survivors"
