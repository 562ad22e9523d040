"""``python -m studies bench``: the same bodies in three engines, one measure for all, and what the figures mean.

Nothing here asserts a time, because any time is possible on a busy machine.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import sys

import numpy as np
import pytest
from click.testing import CliRunner

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Settings, World
from carom.lab.cli.usage_errors import Problem
from carom.plugins import Physics, capsule, convex_polygon
from carom.plugins.capsule import CapsuleCollider
from carom.plugins.convex_polygon import ConvexPolygonCollider
from carom.plugins.joints import Hinge, Joints, Slider
from carom.plugins.rotation import BoxCollider, Rotation, Spin
from studies.__main__ import cli
from studies.bench import engines, suite, timing
from studies.bench.engines import CAROM, PEERS, Carom, State
from studies.bench.plain import NotPlainError, bodies_of
from studies.bench.quality import Quality
from studies.bench.suite import cases
from studies.runner import run

both = pytest.mark.parametrize("name", PEERS)


def plane(gravity=(0.0, -9.81), *plugins, **settings) -> World:
    return World(Physics(dimensions=2, gravity=gravity), *plugins, settings=Settings(**settings))


# -- the same bodies ------------------------------------------------------------------------------


@pytest.mark.slow
@both
def test_every_scene_begins_alike(name, monkeypatch):
    """Places, velocities, angles and spins are those of the scene, to the peer's precision; after two steps most bodies
    are where carom has them. Of mass and moment the energy tells. With pymunk's spatial hash, as many bodies have."""
    monkeypatch.setattr(engines, "HASHED", 5)
    for case in {case.scene: case for case in cases((40,)) if case.scene != "fastgas"}.values():
        few = {option: value if option == "crates" else min(value, 8) for option, value in case.options.items()}
        case = dataclasses.replace(case, options=few)
        with case.build(seed=3) as world:
            own, peer, quality = Carom(world), PEERS[name](world), Quality(case.build)
            for what, ours, theirs in zip(State._fields, own.state(), peer.state(), strict=True):
                apart = theirs - ours if what != "angle" else np.remainder(theirs - ours + 1.0, 2 * math.pi) - 1.0
                assert np.abs(apart).max() <= 1e-6 * max(1.0, np.abs(ours).max()), (case, what)
            assert quality.figures(own.state())["energy"] == pytest.approx(world.kinetic_energy(), rel=1e-9)
            for engine in (own, peer):
                engine.step(2)
            apart = np.linalg.norm(peer.state().position - own.state().position, axis=1)
            assert np.median(apart) < 0.02, case


@both
def test_a_disc_and_a_box_fall_and_bounce_alike(name):
    """Dropped from 3 m with restitution 1, all bring them back near 3 m after 2 sqrt(2 h / g) = 1.4 s.

    A peer may find the contact up to a step late (v dt = 0.12 m) and moves with the old velocity, carom with the new
    one (g t dt / 2 = 0.1 m at 1.4 s): they can differ by half a metre at most.
    """
    with plane() as world:
        world.create_entity(Transform((0, -0.5)), AABBCollider((20, 0.5), restitution=1.0))
        world.create_entity(Transform((0, 3.5)), RigidBody(mass=2.0), SphereCollider(0.5, restitution=1.0))
        world.create_entity(Transform((4, 3.25)), RigidBody(mass=0.1), AABBCollider((1.0, 0.25), restitution=1.0))
        own, peer, lowest = Carom(world), PEERS[name](world), np.full(2, np.inf)
        for _ in range(84):  # 1.4 s
            own.step(1)
            peer.step(1)
            lowest = np.minimum(lowest, peer.state().position[:, 1])
            np.testing.assert_allclose(own.state().position, peer.state().position, atol=0.5)
        assert np.all(lowest < [0.75, 0.5])
        np.testing.assert_allclose(peer.state().position, [(0, 3.5), (4, 3.25)], atol=0.3)


@both
def test_what_turns_turns_alike(name):
    """A box turned by .3 and one of each other kind fall into a corner of a drum that turns for a second, which holds
    them: the peer's bodies have the mass, the shapes and the angles of carom's."""
    with plane((0.0, -9.81), Rotation(), capsule.plugin, convex_polygon.plugin) as world:
        for x, y in ((1, 0), (0, -1)):
            wall = BoxCollider((0.5, 4) if x else (4, 0.5), offset=(4 * x, 4 * y), friction=0.5)
            world.create_entity(Transform((0, 0)), RigidBody(kind="kinematic"), Spin(-0.5), wall)
        shapes = BoxCollider((0.5, 0.25)), CapsuleCollider(0.25, 0.5), ConvexPolygonCollider.regular(5, 0.5), None
        for k, shape in enumerate(shapes):
            shape = shape or SphereCollider(0.5)
            shape.friction = 0.5
            world.create_entity(Transform((1.2 * k - 2, -2.5), rotation=0.3), RigidBody(), Spin(), shape)
        own, peer = Carom(world), PEERS[name](world)
        own.step(60)
        peer.step(60)
        np.testing.assert_allclose(peer.state().position, own.state().position, atol=0.25)
        np.testing.assert_allclose(peer.state().angle, own.state().angle, atol=0.3)
        np.testing.assert_allclose(peer.state().angle[:2], -0.5, rtol=0, atol=1e-6)


@both
@pytest.mark.parametrize("floor", [0.4, None])
def test_friction_means_the_same(name, floor):
    """Sliding at 3 m/s on a floor of 0.4 under a body of 0.9: mu = sqrt(0.36) = 0.6, so 3^2 / (2 mu g) = 0.76 m; a
    floor without friction of its own takes the body's."""
    with plane() as world:
        world.create_entity(Transform((0, -0.5)), AABBCollider((20, 0.5), friction=floor))
        body = RigidBody(linear_velocity=(3, 0))
        world.create_entity(Transform((0, 0.5)), body, AABBCollider((0.5, 0.5), friction=0.9 if floor else 0.6))
        peer = PEERS[name](world)
        peer.step(90)
        assert peer.state().position[0, 0] == pytest.approx(9 / (2 * 0.6 * 9.81), rel=0.05)  # a step is 0.05 m
        assert np.abs(peer.state().velocity).max() < 1e-5
        assert not getattr(peer.space, "sleeping_enabled", False)


@both
@pytest.mark.parametrize(("mask", "group", "apart"), [(1, 0, False), (2, 0, True), (-1, 0, True), (-1, 4, False)])
def test_layers_masks_and_groups_are_those_of_carom(name, mask, group, apart):
    with plane((0.0, 0.0)) as world:
        for x, layer in ((0.0, 1), (0.5, 2)):
            filters = {"layer": layer, "mask": mask | layer // 2, "group": group}
            world.create_entity(Transform((x, 0)), RigidBody(), SphereCollider(0.5, **filters))
        for engine in (Carom(world), PEERS[name](world)):
            engine.step(30)
            (one, _), (other, _) = engine.state().position
            assert (other - one > 0.6) == apart


@both
def test_hinges_have_the_limits_and_motors_of_carom(name):
    """A motor of 2 rad/s turns a bar against the world for .25 s; another one falls to the limit at -.4 rad."""
    with plane((0.0, -9.81), Rotation(), Joints()) as world:
        for x, joint in ((0.0, {"motor_speed": 2.0}), (5.0, {"lower": -0.4})):
            bar = world.create_entity(Transform((x + 0.5, 0.0), 0.2), RigidBody(), BoxCollider((0.5, 0.1)), Spin())
            world.create_entity(Hinge(None, bar, (x, 0.0), **joint))
        own, peer = Carom(world), PEERS[name](world)
        for engine, steps in itertools.product((own, peer), (15, 45)):
            engine.step(steps)
            if steps == 15:
                assert engine.state().angle[0] == pytest.approx(0.7, abs=0.04)  # a step is .033
            else:
                assert engine.state().angle[1] == pytest.approx(-0.2, abs=0.05)


@both
def test_the_car_is_the_same_car(name):
    """Its springs give as much, and its motor takes it as far up the first hill; a step at its speed is .2 m."""
    (case,) = (case for case in cases() if case.scene == "car")
    with case.build() as world:
        own, peer = Carom(world), PEERS[name](world)
        for engine in (own, peer):
            engine.step(120)
        np.testing.assert_allclose(peer.state().position, own.state().position, atol=0.4)
        sunk = [engine.state().position[0, 1] - engine.state().position[1:, 1].mean() for engine in (own, peer)]
        assert sunk[0] == pytest.approx(sunk[1], abs=0.03)


@pytest.mark.parametrize(("words", "parts"), [
    ("sensor", (RigidBody(), SphereCollider(0.5, sensor=True))),
    ("two colliders", (RigidBody(), SphereCollider(0.75), AABBCollider((0.5, 0.5)))),
    ("linear_damping", (RigidBody(linear_damping=0.1), SphereCollider(0.5))),
    ("gravity_scale is 2", (RigidBody(gravity_scale=2),)),
    ("max_linear_speed", (RigidBody(max_linear_speed=3),)),
    ("AABBCollider with a rotation", (Transform((5, 5), rotation=0.5), RigidBody(), AABBCollider((1, 1)))),
])  # fmt: skip
def test_what_does_not_translate_is_refused(words, parts):
    with plane() as world:
        world.create_entity(*([] if isinstance(parts[0], Transform) else [Transform((5, 5))]), *parts)
        with pytest.raises(NotPlainError, match=words):
            bodies_of(world)


def test_space_other_rules_and_other_joints_are_refused():
    with World(Physics(dimensions=3)) as world, pytest.raises(NotPlainError, match="3 dimensions"):
        bodies_of(world)
    with plane(restitution_mixing="min") as world, pytest.raises(NotPlainError, match="rules of mixing"):
        bodies_of(world)
    with plane((0, 0), Rotation(), Joints()) as world:
        body = world.create_entity(Transform((0, 0)), RigidBody(), Spin(inertia=1.0))
        world.create_entity(Slider(None, body, (1.0, 0.0)))
        with pytest.raises(NotPlainError, match="a Slider"):
            PEERS["pymunk"](world)


# -- one measure ----------------------------------------------------------------------------------


def test_overlaps_escapes_and_energies_are_those_of_the_state():
    """Discs of diameter 1: one .25 in the floor, two .2 in each other, one beyond the floor's middle."""

    def build(settings):
        world = World(Physics(dimensions=2), settings=settings)
        world.create_entity(Transform((0, 0)), AABBCollider((9, 1)))
        places = Transform.many([(0, 2), (3, 3), (6, 4), (-5, 5)])
        world.create_entities(4, places, RigidBody.many(mass=2.0), SphereCollider.many(0.5))
        return world

    quality = Quality(build)
    with build(Settings()) as world:
        state = Carom(world).state()
        assert len(quality.overlaps(state)) == quality.figures(state)["escaped"] == 0
        state.position[:] = (0, 1.25), (3, 3), (3, 3.8), (-5, -2)
        state.velocity[1] = 3.0, 4.0
        np.testing.assert_allclose(np.sort(quality.overlaps(state)), [0.2, 0.25], atol=1e-7)
        figures = quality.figures(state)
        assert (figures["escaped"], figures["sinks"], figures["gap"]) == (1, 7.0, 0.0)
        assert figures["energy"] == pytest.approx(25.0)


def test_quality_sees_how_bodies_are_turned_and_gaps_of_hinges():
    """Two boxes of side 2 side by side, .1 apart; one turns by 45 degrees, with its corner then in the other, and its
    hinge, .05 beside it at the height of its middle, goes with it. Two that are joined may be in each other."""

    def build(settings):
        world = World(Physics(dimensions=2), Rotation(), Joints(), settings=settings)
        _, turning, *pair = [
            world.create_entity(Transform((x, 0)), RigidBody(mass=3.0), Spin(), BoxCollider((1, 1)))
            for x in (0.0, 2.1, 9.0, 10.5)
        ]
        world.create_entity(Hinge(None, turning, (1.05, 0.0)))
        world.create_entity(Hinge(*pair, (9.75, 0.0)))
        return world

    quality = Quality(build)
    with build(Settings()) as world:
        state = Carom(world).state()
        assert len(quality.overlaps(state)) == 0
        assert quality.figures(state)["gap"] == pytest.approx(0.0, abs=1e-12)
        state.angle[1], state.spin[1] = math.pi / 4, 2.0
        assert quality.overlaps(state).max() == pytest.approx(math.sqrt(2) - 1.1)
        figures = quality.figures(state)
        assert figures["energy"] == pytest.approx(0.5 * (3.0 * 4 / 6) * 2.0**2)  # m side^2 / 6
        assert figures["gap"] == pytest.approx(2 * 1.05 * math.sin(math.pi / 8))


# -- times and tables -----------------------------------------------------------------------------


@pytest.fixture
def tiny(monkeypatch):
    """Two scenes of a few bodies."""
    some = [case for case in cases((30,), 30) if case.scene in ("gas2d", "player_query")]
    monkeypatch.setattr(timing, "SMALL", 10)
    monkeypatch.setattr(suite, "cases", lambda *sizes: some)
    return some


@pytest.mark.slow
def test_ratios_are_within_repeats_and_queries_find_the_same(tiny):
    """But for boxes: pymunk tests the bounding boxes of the discs, and finds a few more."""
    result = run(timing.axes(), repeats=3)
    (times, quality), _ = timing.report(result)
    assert times.headings == ("scene", "carom", "pymunk", "Box2D", "pymunk / carom", "Box2D / carom")
    rows = [f"player_query 30 {name}" for name in ("box 4 x 4", "disc r = 2", "nearest within 2", "ray across")]
    assert [row[0] for row in times.rows] == [row[0] for row in quality.rows] == ["gas2d 30", *rows]
    figures = result.lines[0].samples[0].figures
    values = [[of / own for of, own in zip(figures[f"/{name}/ms"].values, figures["/carom/ms"].values, strict=True)]
              for name in PEERS]  # fmt: skip
    for cell, ratios in zip(times.rows[0][4:], values, strict=True):
        assert cell.startswith(f"{float(np.median(ratios)):.3g}"[:3])
    assert all(figures[f"/{name}/p10"].median <= figures[f"/{name}/ms"].median for name in (CAROM, *PEERS))
    assert figures["/carom/kept"].median == pytest.approx(1.0, abs=1e-6)
    answers = result.lines[1].samples[0].figures
    for row in rows:
        own, other = (answers[f"{row[16:]}/{name}/answer"].median for name in ("carom", "pymunk"))
        assert own <= other <= 1.1 * own if "box" in row else own == pytest.approx(other, rel=1e-9)


def test_steps_in_which_kernels_came_do_not_count(tiny, monkeypatch):
    calls = itertools.count()

    def timed(work):
        work()
        return (1000.0, False, None) if next(calls) == 0 else (3.0, True, None)

    monkeypatch.setattr(timing, "timed", timed)
    figures = timing.measure(tiny[0], 0, [])
    assert figures["/carom/ms"] == pytest.approx(3000.0)
    monkeypatch.setattr(timing, "timed", lambda work: (1.0, False, None))
    with pytest.raises(Problem, match="run it once more"):
        timing.measure(tiny[0], 0, [])


def test_without_the_others_it_times_carom_and_says_what_is_missing(tiny, monkeypatch):
    for module in ("pymunk", "pyb2d3"):
        monkeypatch.setitem(sys.modules, module, None)
    done = CliRunner(env={"COLUMNS": "200"}).invoke(cli, ["bench", "gas2d", "--quick"])
    assert done.exit_code == 0, done.output
    lines = [line for line in done.stderr.splitlines() if "carom[bench]" in line]
    assert [("pymunk" in line, "pyb2d3" in line) for line in lines] == [(True, False), (False, True)]
    assert next(line.split() for line in done.stdout.splitlines() if line.startswith("scene")) == ["scene", "carom"]
