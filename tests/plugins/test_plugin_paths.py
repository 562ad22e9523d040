"""Paths: where a body is at the end of each step, against a walk along the legs by hand."""

from __future__ import annotations

import itertools
import math
import pathlib

import numpy as np
import pytest
from worlds import MODES

from carom import (
    AABBCollider,
    NoPhysicsError,
    Path,
    Paths,
    Physics,
    RigidBody,
    Settings,
    SphereCollider,
    StepError,
    System,
    Transform,
    World,
)
from carom.plugins.paths import MODES as ENDS

SQUARE = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0)]


def world_of(d=2, **settings):
    return World(Physics(d), Paths(), settings=Settings(**settings))


def mover(world, points, *args, at=None, **values):
    place = Transform(points[0] if at is None else at)
    return world.create_entity(
        place, RigidBody(kind="kinematic"), SphereCollider(0.1, mask=0), Path(points, *args, **values)
    )


def at(world, entity):
    return world.component_for_entity(entity, Transform).position.copy()


def run(world, steps):
    for _ in range(steps):
        world.step()


def walked(points, distance, mode, ease):
    """Where a walk of that distance ends: leg by leg."""
    points = [np.array(point) for point in points]
    if mode == "loop":
        points.append(points[0])
    there = list(itertools.pairwise(points))
    legs = there + [(b, a) for a, b in reversed(there)] if mode == "back_and_forth" else there
    while True:
        for a, b in legs:
            length = math.dist(a, b)
            if distance <= length:
                u = distance / length
                return a + (u * u * (3 - 2 * u) if ease else u) * (b - a)
            distance -= length
        if mode == "once":
            return points[-1]


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("d", [2, 3])
def test_each_step_ends_on_the_path(mode, d):
    """At random points and speeds, where legs are longer and shorter than steps: 1e-11 m after 120 steps."""
    random = np.random.default_rng(d)
    world, paths = world_of(d, collision=mode), {}
    for k in range(18):
        points = random.uniform(-5, 5, (random.integers(2, 7), d)) * (0.02 if k % 5 == 0 else 1.0)
        speed, path = random.uniform(0.5, 9), {"mode": ENDS[k % 3], "ease": bool(k % 2)}
        paths[mover(world, points, speed, **path)] = points, speed, path
    for n in range(1, 121):
        world.step()
        for entity, (points, speed, path) in paths.items():
            expected = walked(points, n / 60 * speed, **path)
            np.testing.assert_allclose(at(world, entity), expected, rtol=0, atol=1e-11)


@pytest.mark.slow
@pytest.mark.parametrize("ease", [False, True])
@pytest.mark.parametrize("dt", [1 / 60, 1 / 50, 0.1, 1 / 30])
def test_it_arrives_at_corners_to_the_bit_in_the_step_it_should(dt, ease):
    """Also in the second round, and never a step before."""
    per_metre = round(1 / dt)
    for mode, round_trip, places in (
        ("back_and_forth", 6, [*SQUARE, (2.0, 0.0)]), ("loop", 4, [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]),
    ):  # fmt: skip
        world = world_of(dt=dt)
        entity = mover(world, places[: 4 if mode == "loop" else 3], 1.0, mode=mode, ease=ease)
        corners = (0, 2, 3, 4) if mode == "back_and_forth" else range(4)
        due = {metre * per_metre: place for metre, place in zip(corners, places, strict=True)}
        for n in range(1, 2 * round_trip * per_metre + 1):
            world.step()
            place = due.get(n % (round_trip * per_metre))
            assert (tuple(at(world, entity)) in places) is (place is not None)
            assert place is None or tuple(at(world, entity)) == place


def test_at_its_end_it_stands_and_what_stands_can_sleep():
    world = world_of(sleeping=True)
    entity = mover(world, SQUARE, 2.0, mode="once")
    run(world, 89)
    assert world.bodies.linear_velocity[0].any()
    run(world, 2)
    before = world.state_hash()
    run(world, 10)
    assert tuple(at(world, entity)) == SQUARE[-1]
    assert not world.bodies.linear_velocity.any()
    assert world.state_hash() == before


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("mode", MODES)
def test_what_sleeps_on_a_lift_rides_on_when_it_goes_on(mode):
    """Up and to the side with ease, to sleep, and up again: never a gap of more than what a step of 24 m/s^2 makes."""
    world = World(Physics(2, gravity=(0, -9.81)), Paths(), settings=Settings(sleeping=True, collision=mode))
    parts = RigidBody(kind="kinematic"), AABBCollider((1.0, 0.25), friction=0.5)
    path = Path([(0, 0), (0, 2), (1, 2)], 2.0, mode="once", ease=True)
    lift = world.create_entity(Transform((0, 0)), *parts, path)
    crate = world.create_entity(Transform((0, 0.75)), RigidBody(), AABBCollider((0.5, 0.5), friction=0.5))
    body = world.component_for_entity(crate, RigidBody)
    for end in ((1.0, 2.0), (1.0, 6.0)):
        for _ in range(300):
            world.step()
            assert abs(at(world, crate)[1] - at(world, lift)[1] - 0.75) < 24.0 / 60**2
        assert tuple(at(world, lift)) == end
        assert body.asleep
        path.points, path.travelled = [(1, 2), (1, 6)], 0.0


def test_what_is_elsewhere_goes_to_its_path_at_its_speed():
    """And then on from where it was: never faster, and in the end on it."""
    world = world_of(dt=0.1)
    entity = mover(world, SQUARE, 1.0, at=(0.0, 1.0), mode="loop")
    before = at(world, entity)
    for n in range(200):
        world.step()
        now = at(world, entity)
        assert math.dist(before, now) <= 0.1 + 1e-12
        before = now
        if n == 50:
            before = np.array((5.0, 5.0))
            world.component_for_entity(entity, Transform).position = before
    travelled = world.component_for_entity(entity, Path).travelled
    np.testing.assert_allclose(before, walked(SQUARE, travelled, "loop", False), rtol=0, atol=1e-12)


def test_fields_may_change_on_the_way():
    world = world_of(dt=0.1)
    entity = mover(world, SQUARE, 1.0, travelled=1.0, at=(1.0, 0.0))
    path = world.component_for_entity(entity, Path)
    run(world, 5)
    assert at(world, entity) == pytest.approx((1.5, 0.0), abs=1e-12)
    path.speed = 0.0
    run(world, 5)
    assert at(world, entity) == pytest.approx((1.5, 0.0), abs=1e-12)
    path.speed = 2.0
    path.points = [(1.5, -1.5), (1.5, 5.0)]
    run(world, 5)
    assert at(world, entity) == pytest.approx((1.5, 1.0), abs=1e-12)
    assert path.points.tolist() == [[1.5, -1.5], [1.5, 5.0]]
    path.mode = "once"
    run(world, 50)
    assert tuple(at(world, entity)) == (1.5, 5.0)


@pytest.mark.slow
@pytest.mark.parametrize("d", [2, 3])
def test_snapshots_files_and_failed_steps_go_on_to_the_bit(d, tmp_path):
    class FailsOnce(System):
        failed = True

        def process(self, dt):
            if not self.failed:
                self.failed = True
                raise RuntimeError("once")

    random, fails = np.random.default_rng(7), FailsOnce()
    world = world_of(d)
    world.add_system(fails)
    for k in range(9):
        mover(world, random.uniform(-5, 5, (4, d)), 3.0, mode=ENDS[k % 3], ease=k % 2 == 0)
    run(world, 50)
    kept, points = world.snapshot(), world.component_for_entity(1, Path).points
    world.save(tmp_path / "paths")

    def play(world):
        if not fails.failed:
            with pytest.raises(StepError, match="once"):
                world.step()
        run(world, 30)
        world.delete_entity(2)
        run(world, 30)
        return world.state_hash()

    first = play(world)
    for failed in (True, False):
        world.restore(kept)
        fails.failed = failed
        assert play(world) == first
    other = World.load(tmp_path / "paths", Physics(d), Paths())
    np.testing.assert_array_equal(other.component_for_entity(1, Path).points, points)
    assert play(other) == first


@pytest.mark.plain
def test_many_share_points_in_bulk():
    world, starts = world_of(dt=0.1), np.linspace(0.0, 2.0, 11)
    ids = world.create_entities(
        11, Transform.many(np.c_[starts, 0 * starts]), RigidBody.many(kind="kinematic"),
        Path.many(SQUARE, 1.0, travelled=starts),
    )  # fmt: skip
    run(world, 5)
    for entity, start in zip(ids, starts, strict=True):
        expected = walked(SQUARE, start + 0.5, "back_and_forth", False)
        np.testing.assert_allclose(at(world, entity), expected, rtol=0, atol=1e-12)


POINTS = (
    ([(0, 0)], "must be two points or more"),
    ([0, 0], "must be two points or more"),
    ([(0,), (1,)], "must be two points or more"),
    ([(0, 0), (1, math.nan)], "must be finite"),
    ([(0, 0), (0, 0), (1, 1)], r"must not have a point twice in a row, got \[0.0, 0.0\]"),
    ([(0, 0), (1e308, 1e308), (0, 0)], "must not be so long"),
    ("ab", "must be points, it is not a path of files, which is pathlib.Path, got 'ab'"),
    (pathlib.Path("a.tmx"), "must be points, it is not a path of files, which is pathlib.Path"),
)


@pytest.mark.plain
@pytest.mark.parametrize(("points", "message"), POINTS)
def test_points_that_are_no_path_are_refused(points, message):
    for make in (Path, lambda points, speed: Path.many(points, speed).store(3, 2)):
        with pytest.raises(ValueError, match=r"Path\.points " + message):
            make(points, 1.0)


@pytest.mark.plain
@pytest.mark.parametrize(
    ("values", "field"), [({"speed": -1.0}, "speed"), ({"mode": "round"}, "mode"), ({"travelled": -1}, "travelled")]
)
def test_fields_that_cannot_be_are_refused(values, field):
    with pytest.raises(ValueError, match=rf"Path\.{field} must be"):
        Path(SQUARE, **{"speed": 1.0, **values})


@pytest.mark.plain
def test_what_cannot_move_along_a_path_is_refused_with_its_entity():
    with pytest.raises(NoPhysicsError, match="plugin paths needs physics before it"):
        World(Paths())
    body = Transform((0, 0)), RigidBody(kind="kinematic")
    with pytest.raises(ValueError, match="Path does nothing without its plugin"):
        World(Physics(2)).create_entity(*body, Path(SQUARE, 1.0))
    world = world_of(3)
    with pytest.raises(ValueError, match=r"Path\.points must be points of 3 numbers in this 3D world"):
        mover(world, SQUARE, 1.0, at=(0, 0, 0))
    with pytest.raises(ValueError, match=r"Path\.points must be points of 3 numbers in this 3D world"):
        world.create_entities(2, Transform.many((0, 0, 0)), RigidBody.many(), Path.many(SQUARE, 1.0))
    world = world_of()
    for parts in ((), (Transform((0, 0)),), (Transform((0, 0)), SphereCollider(1.0))):
        with pytest.raises(ValueError, match=r"Path moves kinematic bodies, .*: its entity has no Transform"):
            world.create_entity(*parts, Path(SQUARE, 1.0))
    with world:
        import esper

        loose = esper.create_entity(Path(SQUARE, 1.0))
    for _ in range(2):
        with pytest.raises(StepError, match=f"FollowPaths failed .*entity {loose}: Path moves kinematic bodies"):
            world.step()
    world.delete_entity(loose)
    for kind in ("dynamic", "static"):
        wrong = world.create_entity(Transform((0, 0)), RigidBody(kind=kind), Path(SQUARE, 1.0))
        with pytest.raises(StepError, match=f"FollowPaths failed .*entity {wrong}: Path moves kinematic bodies"):
            world.step()
        world.delete_entity(wrong)
    world.step()
