"""``world.contacts``, which a game reads after a step: columns, their order, and ``of``."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_filters import pairs as ids
from worlds import ball, both_dimensions, box, floor, make_world, run

COLUMNS = {"entity_a": 1, "entity_b": 1, "point": 2, "normal": 2, "depth": 1, "normal_impulse": 1, "step": 1}


@both_dimensions
def test_columns_and_their_shapes(d):
    """Before any step and after, empty or not: the same columns, dtypes and shapes; impacts also have their time."""
    world = make_world(d)
    for _ in range(3):
        contacts = world.contacts
        for rows in (contacts, contacts.begin, contacts.stay, contacts.end, contacts.impacts):
            for name, rank in COLUMNS.items():
                values = getattr(rows, name)
                assert values.shape == ((len(rows), d) if rank == 2 else (len(rows),))
                assert values.dtype == (np.int64 if name in ("entity_a", "entity_b", "step") else np.float64)
        assert world.contacts.enabled.dtype == bool
        assert world.contacts.impacts.time_of_impact.shape == (len(world.contacts.impacts),)
        if not len(world.bodies):
            for k in range(3):
                ball(world, 0.9 * k, -k, restitution=1.0)
        world.step()
    assert len(world.contacts) >= 2
    with pytest.raises(AttributeError, match=r"contacts have no column 'colour'; they have entity_a, entity_b"):
        _ = world.contacts.colour


def test_canonical_order_whatever_the_history():
    """entity_a < entity_b, sorted; bodies of all kinds, some deleted and created in between so that rows are mixed."""
    world = make_world()
    rng = np.random.default_rng(3)
    kinds = ("dynamic", "kinematic", "static")
    entities = [ball(world, rng.uniform(-5, 5, 2), kind=kinds[k % 3]) for k in range(60)]
    world.step()
    for k in (3, 10, 17, 30, 44):
        world.delete_entity(entities[k])
    for k in range(10):
        ball(world, rng.uniform(-5, 5, 2), kind=kinds[k % 3])
    world.step()
    pairs = ids(world.contacts)
    assert len(pairs) > 30
    assert all(a < b for a, b in pairs)
    assert pairs == sorted(set(pairs))
    assert not {entities[k] for k in (3, 10, 17, 30, 44)} & {entity for pair in pairs for entity in pair}
    assert pairs == sorted([*ids(world.contacts.begin), *ids(world.contacts.stay)])


def test_normal_impulse_is_the_momentum_exchanged():
    """Impact: m1 (1 + e) w / 2 for equal masses; at rest: m g dt in every step, of a pile the load above included."""
    world = make_world()
    ball(world, -0.51, 1.0, mass=2.0, restitution=0.5)
    ball(world, 0.51, -1.0, mass=2.0)
    run(world, 1)
    assert world.contacts.normal_impulse[0] == pytest.approx(1.0 * 1.5 * 2.0, rel=1e-14)
    assert world.contacts.impacts.normal_impulse[0] == world.contacts.normal_impulse[0]

    world = make_world(gravity=9.81)
    floor(world)
    for k in range(3):
        box(world, (0, 0.5 + k), mass=1.0 + k)
    run(world, 120)
    load = 9.81 / 60 * np.array([6.0, 5.0, 3.0])  # on the floor, on the lowest, on the middle one
    np.testing.assert_allclose(world.contacts.normal_impulse, load, rtol=1e-3)


def test_of_looks_from_the_entity():
    """The normal points away from the given entity, as needed to test what it stands on."""
    world = make_world(gravity=9.81)
    ground = floor(world)
    player = ball(world, (0, 0.5))
    stone = ball(world, (0, 1.5))
    run(world, 10)
    standing = [c.entity_b for c in world.contacts.of(player) if c.normal[1] < -0.7]
    assert standing == [ground]
    assert {c.entity_b for c in world.contacts.of(player)} == {ground, stone}
    assert all(c.entity_a == player for c in world.contacts.of(player))
    assert [c.normal.tolist() for c in world.contacts.of(ground)] == [[0, 1]]
    assert world.contacts.of(12345) == []


def test_a_record_of_a_contact_cannot_be_written():
    """The error names the column to write instead."""
    world = make_world()
    ball(world, 0.0)
    ball(world, 0.5)
    world.step()
    (contact,) = world.contacts
    for name in ("enabled", "depth"):
        with pytest.raises(AttributeError, match=rf"{name} cannot be set; write the columns: world.contacts.enabled"):
            setattr(contact, name, 0.0)
    world.close()
