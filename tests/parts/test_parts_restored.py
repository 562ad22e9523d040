"""Bodies of parts go on to the bit: after a restore, from a file, in their sleep; and are drawn where they are."""

from __future__ import annotations

import numpy as np
import pytest
from parts.helpers_parts import G, U, at, body_of, floor, parts_world, piece
from worlds import run

from carom import Physics, RigidBody, SphereCollider, Transform, World
from carom.plugins.parts import PartOf, Parts
from carom.plugins.rotation import BoxCollider, Rotation, Spin

pytestmark = pytest.mark.plain


@pytest.mark.compiled
@pytest.mark.parametrize("kind", ["dynamic", "kinematic"])
def test_pieces_are_drawn_as_one_and_anew_where_they_were_put(kind):
    """A part has its body's place, and its turn: half a step late both, and from a teleport on where they are."""
    world, parts = parts_world()
    body = piece(world, parts, (0.0, 0.0), velocity=(6.0, -3.0), spin=30.0)[0]
    body_of(world, body).kind = kind
    world.advance(1.5 / 60)
    world.advance(1.0 / 60)
    drawn, turn = world.bodies.interpolated_position, world.bodies.interpolated_rotation
    start = at(world, body).position - np.array((6.0, -3.0)) / 60
    np.testing.assert_allclose(drawn, [start + np.array((6.0, -3.0)) / 120] * 2, rtol=0, atol=1e-12)
    np.testing.assert_allclose(turn, [30.0 * 1.5 / 60] * 2, rtol=0, atol=1e-12)
    of_kind = getattr(world.bodies, kind)
    np.testing.assert_array_equal(of_kind.interpolated_position, drawn)
    at(world, body).position, at(world, body).rotation = (100.0, 0.0), 2.0
    world.advance(0.0)
    for drawn, exact in ((world.bodies.interpolated_position, (100.0, 0.0)), (world.bodies.interpolated_rotation, 2.0)):
        np.testing.assert_array_equal(drawn, [exact] * 2)


@pytest.mark.slow
@pytest.mark.compiled
def test_snapshots_rollback_and_files_go_on_to_the_bit(tmp_path):
    world, parts = parts_world((0, -G))
    floor(world, friction=0.5)
    pieces = [piece(world, parts, (0.3 * k, 0.8 + 1.2 * k), U, angle=0.4, friction=0.5) for k in range(2)]
    run(world, 20)
    snapshot = world.snapshot()

    def hashes():
        found = []
        for k in range(25):
            if k == 5:
                world.delete_entity(pieces[0][1])
            world.step()
            found.append(world.state_hash())
        return found

    first = hashes()
    world.restore(snapshot)
    world.save(tmp_path / "pieces.carom")
    assert hashes() == first
    world.restore(snapshot)
    assert world.entity_exists(pieces[0][1])
    loaded = World.load(tmp_path / "pieces.carom", Physics(dimensions=2, gravity=(0, -G)), Rotation(), Parts())
    run(world, 25)
    run(loaded, 25)
    assert loaded.state_hash() == world.state_hash()


@pytest.mark.parametrize("kind", ["dynamic", "static"])
def test_worlds_are_the_same_after_restore_where_the_velocity_of_what_moves_otherwise_was_written(kind):
    """That of a body with parts, of a part, and of a static body, which has none."""
    world, parts = parts_world((0, -G))
    body, part, *_ = piece(world, parts, (0, 2), U)
    world.component_for_entity(body, RigidBody).kind = kind
    run(world, 2)
    for entity, velocity in ((body, (3.0, 1.0)), (part, (-2.0, 0.0))):
        world.component_for_entity(entity, RigidBody).linear_velocity = velocity
        before = world.state_hash()
        snapshot = world.snapshot()
        run(world, 1)
        after = world.state_hash()
        world.restore(snapshot)
        assert world.state_hash() == before
        run(world, 1)
        assert world.state_hash() == after


@pytest.mark.compiled
def test_pieces_sleep_as_one_and_wake_to_the_bit():
    world, parts = parts_world((0, -G), sleeping=True)
    floor(world, friction=0.5)
    frame = world.create_entity(Transform((0, 0.4)), RigidBody(), Spin())  # without a collider of its own
    pieces = [
        [frame, *(world.create_entity(PartOf(frame, (x, 0)), BoxCollider((0.2, 0.4))) for x in (-0.4, 0.4))],
        piece(world, parts, (3, 0.5), (((0, 0), (0.5, 0.15), 2.0), ((0, -0.25), (0.5, 0.1), 2.0)), friction=0.5),
    ]
    for _ in range(150):
        world.step()
        if all(body_of(world, entity).asleep for own in pieces for entity in own):
            break
    else:
        raise AssertionError("something does not sleep")
    rested = [at(world, own[0]).position.copy() for own in pieces]
    run(world, 5)
    snapshot, hashes = world.snapshot(), []
    for _ in range(2):
        body_of(world, pieces[0][0]).apply_impulse((0, 2.0))
        run(world, 12)
        assert [body_of(world, entity).asleep for own in pieces for entity in own] == [False] * 3 + [True] * 2
        hashes.append(world.state_hash())
        world.restore(snapshot)
    assert hashes[0] == hashes[1]
    assert [at(world, own[0]).position.tolist() for own in pieces] == [place.tolist() for place in rested]
    world.create_entity(Transform((3.2, 1.2)), RigidBody(linear_velocity=(0, -2)), SphereCollider(0.1))
    run(world, 15)
    assert not body_of(world, pieces[1][1]).asleep


@pytest.mark.compiled
def test_pieces_in_space_sleep_on_where_a_snapshot_is_restored():
    world, parts = parts_world((0, 0, -G), 3, sleeping=True)
    world.create_entity(Transform((0, 0, -1)), BoxCollider((50.0, 50.0, 1.0), friction=0.5))
    turns = np.random.default_rng(1).normal(size=(12, 4))  # some are no unit quaternions to the last bit
    bodies = []
    for x, turn in enumerate(turns):
        box = BoxCollider((0.9, 0.9, 0.3))
        bodies.append(world.create_entity(Transform((3 * x, 0, 0.3)), RigidBody(), Spin(), box))
        unit = turn / np.linalg.norm(turn)
        world.create_entity(PartOf(bodies[-1], (0, 0, 0.4), unit, mass=0.1), BoxCollider((0.1, 0.2, 0.1)))
        parts.balance(bodies[-1])
    run(world, 90)
    assert all(body_of(world, body).asleep for body in bodies)
    snapshot = world.snapshot()
    world.step()
    after = world.state_hash()
    world.restore(snapshot)
    world.step()
    assert all(body_of(world, body).asleep for body in bodies)
    assert world.state_hash() == after
