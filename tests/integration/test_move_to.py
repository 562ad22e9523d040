"""Kinematic bodies that are moved to a place: a step ends there, and on the way they push as they move."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from worlds import MODES, Calls, ball, both_dimensions, box, make_world, mostly_2d, position, run, velocity

from carom import BoxCollider, CaromError, Phase, Physics, RigidBody, Rotation, Settings, Spin, Transform, World

G, DT = 9.81, 1 / 60


def of(world, entity, component=RigidBody):
    world.bodies  # noqa: B018  the world takes it
    return world.component_for_entity(entity, component)


def flat(d, x, y):
    return (x, y, 0.0)[:d]


def bound(target, start):
    return 2.0**-53 * np.abs(target) + 2.0**-51 * np.abs(target - start)


def mover(world, start, **values):
    return box(world, start, kind="kinematic", **values)


@pytest.mark.parametrize("mode", MODES)
@mostly_2d
def test_the_step_ends_there_and_the_next_one_too(d, mode):
    """Places up to a kilometre apart, any rotation: within the bound that is promised, 1e-14 of a turn."""
    random = np.random.default_rng(d)
    world = World(Physics(d), Rotation(), settings=Settings(collision=mode, on_fault="ignore"))
    entity = world.create_entity(
        Transform((3.0,) * d), RigidBody(kind="kinematic"), Spin(0.5 if d == 2 else (0.0, 0.0, 0.5)),
        BoxCollider((0.5,) * d, mask=0),
    )  # fmt: skip
    body, spin, place = (of(world, entity, kind) for kind in (RigidBody, Spin, Transform))
    for step in range(60):
        target, start = random.uniform(-1, 1, d) * 10.0 ** random.integers(-3, 4), place.position.copy()
        turn = random.uniform(-10, 10) if d == 2 else random.normal(size=4)
        if d == 3:
            turn /= np.linalg.norm(turn)
        if step % 2:
            world.bodies.kinematic.move_to([target], [turn])
        else:
            body.move_to(target, turn)
        world.step()
        assert (np.abs(place.position - target) <= bound(target, start)).all()
        if d == 2:
            assert abs(math.remainder(place.rotation - turn, 2.0 * math.pi)) < 1e-14
        else:
            assert 1.0 - abs(np.dot(place.rotation, turn)) < 1e-14
        if step % 5 == 0:
            before = place.position.copy(), np.array(place.rotation)
            world.step()
            assert all(map(np.array_equal, before, (place.position, place.rotation)))
    assert not body.linear_velocity.any()
    assert not np.any(spin.angular_velocity)


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
@mostly_2d
def test_a_tween_carries_a_crate(d, mode):
    """To and fro, and up and down, each with less than friction and weight hold: the crate stays where it is on the
    platform. On a circle, where friction needs substeps, it lags by less than what half a step goes."""
    ways = (
        (lambda t: flat(d, 1.0 - math.cos(t), 0.0), 1e-13),  # up to 1 m/s^2
        (lambda t: flat(d, 0.0, 0.25 - 0.25 * math.cos(3.0 * t)), 1e-13),  # 2.25
        (lambda t: flat(d, math.cos(1.5 * t) - 1.0, math.sin(1.5 * t)), 1.5 * DT / 2),  # 2.25
    )
    for way, lag in ways:
        world = make_world(d, gravity=G, collision=mode)
        platform = mover(world, flat(d, 0.0, -0.5), half=(3.0, 0.5, 3.0)[:d], friction=0.5)
        crate = box(world, flat(d, 0.5, 0.5), friction=0.5)
        run(world, 60)
        for n in range(1, 241):
            target = np.add(way(n * DT), flat(d, 0.0, -0.5))
            of(world, platform).move_to(target)
            world.step()
            np.testing.assert_allclose(position(world, platform), target, rtol=0, atol=1e-15)
            offset = position(world, crate) - position(world, platform)
            np.testing.assert_allclose(offset, flat(d, 0.5, 1.0), rtol=0, atol=lag)


@pytest.mark.parametrize("mode", MODES)
@mostly_2d
def test_a_tween_strikes_with_its_true_speed(d, mode):
    """A ball at rest leaves with (1 + e) times the speed that the paddle has in that step, as its tween has it."""
    world = make_world(d, collision=mode)
    paddle = mover(world, flat(d, 0.0, 0.0), restitution=0.75)
    target = ball(world, flat(d, 1.4, 0.0), radius=0.5, restitution=0.75)
    places = [1.5 * (n * DT) ** 2 for n in range(120)]
    for last, now in itertools.pairwise(places):
        of(world, paddle).move_to(flat(d, now, 0.0))
        world.step()
        if velocity(world, target).any():
            assert velocity(world, target)[0] == pytest.approx(1.75 * (now - last) / DT, rel=1e-12)
            break
    else:
        pytest.fail("it was not struck")


@pytest.mark.plain
def test_where_it_is_called_from():
    """Before the flight it is for this step, afterwards for the next; of several steps of a frame for the first."""
    expected = {Phase.START: 1, Phase.FORCES: 1, Phase.INTEGRATION: 2, Phase.RESPONSE: 2, Phase.END: 2}
    for phase, steps in expected.items():
        world = make_world()
        entity = mover(world, (0.0, 0.0))
        body = of(world, entity)
        world.add_system(Calls(phase, lambda w=world, b=body: w.step_count or b.move_to((3.0, -1.0))))
        for step in range(1, 4):
            world.step()
            np.testing.assert_allclose(position(world, entity), (3.0, -1.0) if step >= steps else 0.0, atol=1e-15)
        assert not body.linear_velocity.any()
    world = make_world()
    entity = mover(world, (0.0, 0.0))
    of(world, entity).move_to((1.0, 0.0))
    assert world.advance(3 * DT) == 3
    assert position(world, entity).tolist() == [1.0, 0.0]
    body = of(world, entity)
    body.move_to((2.0, 0.0))
    body.kind = "dynamic"  # then it goes on
    run(world, 2)
    np.testing.assert_allclose(velocity(world, entity), (60.0, 0.0))


def test_it_stands_where_it_was_driven_in_snapshots_files_and_steps_that_fail(tmp_path):
    world = make_world(gravity=G)
    lift = mover(world, (0.0, 0.0), half=(1.0, 0.25))
    box(world, (0.0, 0.75))
    run(world, 10)
    fails = Calls(Phase.END, lambda: 1 / 0)

    def play(world):
        run(world, 20)
        np.testing.assert_allclose(position(world, lift), (0.1, 0.2), rtol=0, atol=1e-15)
        return world.state_hash()

    before = world.snapshot(), world.state_hash()
    of(world, lift).move_to((0.1, 0.2))
    assert world.state_hash() != before[1]
    kept, moving = world.snapshot(), world.state_hash()
    world.save(tmp_path / "moving")
    world.add_system(fails)
    with pytest.raises(CaromError, match="division by zero"):
        world.step()
    world.remove_system(fails)
    assert world.state_hash() == moving
    first = play(world)
    world.restore(kept)
    assert play(world) == first
    assert play(World.load(tmp_path / "moving", Physics(2, gravity=(0, -G)))) == first
    world.restore(before[0])
    assert world.state_hash() == before[1]
    run(world, 5)
    assert position(world, lift).tolist() == [0.0, 0.0]


def test_what_sleeps_on_it_wakes_and_rides():
    for many in (False, True):
        world = make_world(gravity=G, sleeping=True)
        lift = mover(world, (0.0, 0.0), half=(1.0, 0.25), friction=0.5)
        crate = box(world, (0.0, 0.75), friction=0.5)
        run(world, 120)
        assert of(world, crate).asleep
        for n in range(1, 61):
            place = 0.5 - 0.5 * math.cos(n / 20), 0.25 * n / 20
            world.bodies.kinematic.move_to([place]) if many else of(world, lift).move_to(place)
            world.step()
            assert not of(world, crate).asleep
        offset = position(world, crate) - position(world, lift)
        np.testing.assert_allclose(offset, (0.0, 0.75), rtol=0, atol=1.5 * DT / 2)
        run(world, 120)
        assert of(world, crate).asleep


@pytest.mark.plain
@both_dimensions
def test_many_at_once(d):
    """All but those whose rows are nan, which go on as they did."""
    world = make_world(d)
    ids = [mover(world, flat(d, 3.0 * k, 0.0), velocity=flat(d, 0.0, 6.0), mask=0) for k in range(5)]
    targets = np.arange(5.0 * d).reshape(5, d)
    targets[3] = np.nan
    world.bodies.kinematic.move_to(targets)
    run(world, 2)
    targets[3] = flat(d, 9.0, 0.2)
    np.testing.assert_allclose([position(world, each) for each in ids], targets, rtol=0, atol=1e-14)
    np.testing.assert_allclose(velocity(world, ids[3]), flat(d, 0.0, 6.0))


@pytest.mark.plain
def test_what_cannot_be_is_refused_with_its_entity_and_changes_nothing():
    world = make_world()
    entity, other, still = mover(world, (0.0, 0.0)), ball(world, (9.0, 0.0)), box(world, (5.0, 0.0), kind="static")
    loose = RigidBody(kind="kinematic")
    with pytest.raises(CaromError, match="this RigidBody is in no world yet: a look at"):
        loose.move_to((1, 2))
    body = of(world, entity)
    for call, message in (
        (lambda: body.move_to((1, math.nan)), rf"entity {entity}: RigidBody.move_to must be finite"),
        (lambda: body.move_to((1, 2, 3)), "RigidBody.move_to must have 2 components in this 2D world"),
        (lambda: body.move_to("there"), "RigidBody.move_to must be numbers"),
        (lambda: body.move_to(None), "RigidBody.move_to must be numbers"),
        (lambda: body.move_to((1e307, 0)), rf"entity {entity}: RigidBody.move_to: .* is farther than a step goes"),
        (lambda: body.move_to((1, 2), 0.5), rf"entity {entity}: RigidBody.move_to: it does not turn without a Spin"),
        (lambda: body.move_to((1, 2), math.inf), "RigidBody.move_to: its rotation must be finite"),
        (lambda: body.move_to((1, 2), (1, 0, 0, 0)), "its rotation must be an angle in this 2D world"),
        (lambda: of(world, other).move_to((1, 2)), rf"entity {other}: RigidBody.move_to moves kinematic .* is dynamic"),
        (lambda: of(world, still).move_to((1, 2)), rf"entity {still}: .* this one is static"),
        (lambda: world.bodies.move_to([(1, 2)]), "bodies.kinematic.move_to"),
        (lambda: world.bodies.kinematic.move_to((1, 2)), r"takes positions of shape \(1, 2\), got shape \(2,\)"),
        (lambda: world.bodies.kinematic.move_to([(1, math.nan)]), r"must be finite, got \[1.0, nan\] \(row 0\)"),
        (lambda: world.bodies.kinematic.move_to([(math.inf, 0)]), r"must be finite, got \[inf, 0.0\] \(row 0\)"),
        (lambda: world.bodies.kinematic.move_to([(1, 2)], [1.0]), rf"entity {entity}: move_to: it does not turn"),
    ):
        before = world.state_hash()
        with pytest.raises(ValueError, match=message):
            call()
        assert world.state_hash() == before
        assert not body.linear_velocity.any()
