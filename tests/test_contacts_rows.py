"""``world.contacts``, which a game reads after a step and may write: columns, pairs and of, enabled."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from helpers_contacts import ids, listen
from worlds import ball, both_dimensions, box, floor, make_world, run, velocity

from carom.components import RigidBody, SphereCollider, Transform
from carom.framework import Component, Phase, System, column

COLUMNS = {"entity_a": 1, "entity_b": 1, "point": 2, "normal": 2, "depth": 1, "normal_impulse": 1, "step": 1}


class Missile(Component):
    power = column(default=1.0)


class Enemy(Component):
    points = column(default=100.0)


# -- columns -------------------------------------------------------------------------------------


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
    entities = [ball(world, rng.uniform(-3, 3, 2), kind=kinds[k % 3]) for k in range(60)]
    world.step()
    for k in (3, 10, 17, 30, 44):
        world.delete_entity(entities[k])
    for k in range(10):
        ball(world, rng.uniform(-3, 3, 2), kind=kinds[k % 3])
    world.step()
    pairs = ids(world.contacts)
    assert len(pairs) > 100
    assert all(a < b for a, b in pairs)
    assert pairs == sorted(set(pairs))
    assert not {entities[k] for k in (3, 10, 17, 30, 44)} & {entity for pair in pairs for entity in pair}
    assert pairs == sorted([*ids(world.contacts.begin), *ids(world.contacts.stay)])


@pytest.mark.compiled
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


# -- pairs and of --------------------------------------------------------------------------------


def duel():
    world = make_world()
    missile, enemy = ball(world, 0.0), ball(world, 0.9)
    other = ball(world, (0.0, 0.9))
    world.add_component(missile, Missile())
    world.add_component(enemy, Enemy())
    world.step()
    return world, missile, enemy, other


def test_pairs_are_oriented_from_first_to_second():
    world, missile, enemy, _ = duel()
    ((a, b, contact),) = world.contacts.begin.pairs(Missile, Enemy)
    assert (a, b) == (contact.entity_a, contact.entity_b) == (missile, enemy)
    apart = world.bodies.position[world.bodies.row_of(enemy)] - world.bodies.position[world.bodies.row_of(missile)]
    np.testing.assert_allclose(contact.normal, apart / np.linalg.norm(apart), rtol=1e-12)
    ((a, b, turned),) = world.contacts.begin.pairs(Enemy, Missile)
    assert (a, b) == (turned.entity_a, turned.entity_b) == (enemy, missile)
    np.testing.assert_array_equal(turned.normal, -contact.normal)
    np.testing.assert_array_equal(turned.point, contact.point)
    assert turned.depth == contact.depth


def test_pairs_of_one_kind_come_once():
    """A == B: every pair of them once, the smaller id first."""
    world = make_world()
    entities = [ball(world, 0.9 * k) for k in range(4)]
    for entity in entities[:3]:
        world.add_component(entity, Missile())
    world.step()
    found = [(a, b) for a, b, _ in world.contacts.pairs(Missile, Missile)]
    assert found == [(entities[0], entities[1]), (entities[1], entities[2])]
    everybody = [(a, b) for a, b, _ in world.contacts.pairs(SphereCollider, RigidBody)]
    assert everybody == list(itertools.pairwise(entities))


@pytest.mark.parametrize("immediate", [False, True])
def test_pairs_skip_the_deleted_also_while_iterating(immediate):
    """A missile that hits three enemies is deleted after the first; pairs with deleted entities do not appear."""
    world = make_world()
    missile = ball(world, 0.0)
    world.add_component(missile, Missile())
    enemies = [ball(world, (0.6 * k - 0.6, 0.7)) for k in range(3)]
    for enemy in enemies:
        world.add_component(enemy, Enemy())
    world.step()
    assert len(list(world.contacts.begin.pairs(Missile, Enemy))) == 3
    world.delete_entity(enemies[0], immediate=immediate)
    seen = []
    for shot, enemy, _ in world.contacts.begin.pairs(Missile, Enemy):
        seen.append(enemy)
        world.delete_entity(shot, immediate=immediate)
    assert seen == [enemies[1]]
    assert list(world.contacts.begin.pairs(Missile, Enemy)) == []


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


# -- enabled -------------------------------------------------------------------------------------


class OneWay(System):
    """Platforms that stop only bodies from above: contacts of bodies that move up are disabled."""

    phase = Phase.NARROW

    def __init__(self, platform):
        self.platform = platform

    def process(self, dt):
        contacts, bodies = self.world.contacts, self.world.bodies
        for row in range(len(contacts)):
            pair = (contacts.entity_a[row], contacts.entity_b[row])
            if self.platform in pair:
                other = pair[0] if pair[1] == self.platform else pair[1]
                k = bodies.row_of(int(other))
                contacts.enabled[row] = bodies.linear_velocity[k, 1] < 0 and bodies.previous_position[k, 1] >= 0.999


@pytest.mark.compiled
def test_one_way_platform():
    """A player jumps up through it, unslowed, and then stands on it."""
    world = make_world(gravity=10.0)
    platform = box(world, 0.0, half=(5, 0.5), kind="static")
    player = ball(world, (0.0, -1.5), (0.0, 10.0))
    world.add_system(OneWay(platform))
    told = []
    listen(world, told, "contact_begin", "contact_end")
    heights = []
    for step in range(1, 181):
        world.step()
        heights.append(world.component_for_entity(player, Transform).y)
        if step < 60:  # 10 - g t, undisturbed through the platform
            assert velocity(world, player)[1] == pytest.approx(10 - 10 * step / 60, abs=1e-12)
    assert max(heights) > 3.3
    assert heights[-1] == pytest.approx(1.0, abs=0.005)
    assert velocity(world, player)[1] == 0
    assert [name for name, *_ in told] == ["contact_begin"]


def test_disabled_contacts_have_no_response_and_end():
    """Disabled in the middle of a bounce at e = 1: no impulse; disabled while touching: the contact ends."""
    world = make_world()
    a, b = ball(world, -0.51, 1.0, restitution=1.0), ball(world, 0.51, -1.0, restitution=1.0)
    rest = ball(world, (0, 50)), ball(world, (0.9, 50))

    class Off(System):
        phase = Phase.NARROW

        def process(self, dt):
            self.world.contacts.enabled[:] = False

    run(world, 0)
    off = Off()
    world.add_system(off)
    told = []
    listen(world, told)
    run(world, 60)
    assert told == []
    assert velocity(world, a)[0] == 1
    assert velocity(world, b)[0] == -1
    world.remove_system(off)
    world.step()
    assert ("contact_begin", 60, *rest) in told
    world.add_system(off)
    world.step()
    assert ("contact_end", 61, *rest) in told


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
