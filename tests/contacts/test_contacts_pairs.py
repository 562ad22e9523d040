"""``pairs`` and ``between`` of every list of contacts, against their definition asked entity by entity."""

from __future__ import annotations

import dataclasses

import esper
import numpy as np
import pytest
from worlds import Calls, ball, both_dimensions, make_world, run

from carom.components import RigidBody, Transform
from carom.framework import CaromError, Component, Contact, Phase, column

LISTS = ("contacts", "begin", "stay", "end", "impacts")
FIELDS = [field.name for field in dataclasses.fields(Contact)]


class Missile(Component):
    power = column(default=1.0)


class Enemy(Component): ...


class Unused(Component): ...


class Tag:
    """An ordinary class: no columns."""


class Special(Tag):
    """esper knows components by their own type: this is no Tag."""


class Alias: ...


TYPES = (Missile, Enemy, Tag, Special, Alias, RigidBody, Unused, int)
PAIRS_OF_TYPES = [(first, second) for first in TYPES for second in TYPES]


def rows_of(world, name):
    return world.contacts if name == "contacts" else getattr(world.contacts, name)


def by_definition(world, rows, first, second):
    """What ``pairs`` means: both entities are asked for both components, row by row."""

    def has(entity, component):
        return world.entity_exists(entity) and world.has_component(entity, component)

    for index, (a, b) in enumerate(zip(rows.entity_a.tolist(), rows.entity_b.tolist(), strict=True)):
        if "enabled" in rows._columns and not rows.enabled[index]:
            continue
        if has(a, first) and has(b, second):
            yield index, a, b, rows.row(index)
        elif has(b, first) and has(a, second):
            yield index, b, a, rows.row(index).flipped()


def bits(contact):
    """Type and bits of every field."""
    values = (getattr(contact, name) for name in FIELDS)
    return [(type(v), v.tobytes() if isinstance(v, np.ndarray) else repr(v)) for v in values]


def crowd(d=2, count=60, seed=0, steps=2):
    """Balls of all kinds on top of each other; components of all sorts at random, and lists of all sorts filled."""
    world = make_world(d)
    rng = np.random.default_rng(seed)
    place = [(rng.uniform(-2, 2, d), rng.uniform(-9, 9, d)) for _ in range(count)]
    kinds = ("dynamic", "dynamic", "kinematic", "static")
    entities = [
        ball(world, x, v if k % 4 < 3 else 0.0, kind=kinds[k % 4], restitution=1.0) for k, (x, v) in enumerate(place)
    ]
    for entity in entities:
        for make in (Missile, Enemy, Tag, Special):
            if rng.random() < 0.5:
                world.add_component(entity, make())
        if rng.random() < 0.3:
            world.add_component(entity, Tag(), type_alias=Alias)
    run(world, steps)
    return world, entities


def change(world, entities):
    """Between the step and the loop: entities deleted at once and later, components that came and went."""
    for k, entity in enumerate(entities):
        if k % 9 == 0:
            world.delete_entity(entity, immediate=k % 2 == 0)
        elif k % 7 == 0 and world.has_component(entity, Missile):
            world.remove_component(entity, Missile)
        elif k % 5 == 0:
            world.add_component(entity, Tag())
    world.contacts.enabled[::11] = False


@pytest.mark.slow
@both_dimensions
@pytest.mark.parametrize("changed", [False, True])
def test_pairs_and_between_of_every_list_and_all_types(d, changed):
    """Same pairs, orientation, order and bits; one component on both sides, both components on both, absent types."""
    world, entities = crowd(d)
    if changed:
        change(world, entities)
    found = dict.fromkeys(LISTS, 0)
    for name in LISTS:
        rows = rows_of(world, name)
        for first, second in PAIRS_OF_TYPES:
            expected = list(by_definition(world, rows, first, second))
            pairs = list(rows.pairs(first, second))
            assert [(a, b) for a, b, _ in pairs] == [(a, b) for _, a, b, _ in expected]
            assert [bits(contact) for *_, contact in pairs] == [bits(contact) for *_, contact in expected]
            assert all(type(a) is type(b) is int and type(contact) is Contact for a, b, contact in pairs)
            check_between(rows, first, second, expected)
            found[name] += len(pairs)
    assert min(found.values()) > 20, found


def check_between(rows, first, second, expected):
    between = rows.between(first, second)
    assert [column.dtype for column in between] == [np.int64] * 3
    assert list(zip(*(column.tolist() for column in between), strict=True)) == [row[:3] for row in expected]
    normals = rows.normals_from(between.a, between.rows)
    assert normals.shape == (len(expected), rows.normal.shape[1])
    assert normals.tobytes() == b"".join(contact.normal.tobytes() for *_, contact in expected)


@pytest.mark.plain
@pytest.mark.parametrize("count", [2, 3, 7, 12, pytest.param(150, marks=pytest.mark.compiled)])
def test_few_contacts_and_many(count):
    """Whatever the number of contacts beside the number of entities that have the component."""
    world, entities = crowd(count=count, seed=count)
    for entity in entities[1:]:
        for component in (Missile, Enemy):
            if world.has_component(entity, component):
                world.remove_component(entity, component)
    world.add_component(entities[0], Missile())
    for first, second in [(Missile, Tag), (Tag, Missile), (Missile, Missile), (Missile, RigidBody), (Enemy, Tag)]:
        rows = world.contacts
        expected = list(by_definition(world, rows, first, second))
        assert [bits(contact) for *_, contact in rows.pairs(first, second)] == [bits(row[-1]) for row in expected]
        check_between(rows, first, second, expected)


def test_records_are_copies():
    """Writing into the arrays of a contact changes neither the columns nor another record."""
    world, _ = crowd()
    before = world.contacts.normal.copy(), world.contacts.point.copy()
    for *_, contact in world.contacts.pairs(RigidBody, Transform):
        contact.normal[:] = contact.point[:] = np.nan
    for contact in world.contacts:
        contact.normal[:] = contact.point[:] = np.nan
    found = world.contacts.between(RigidBody, Transform)
    world.contacts.normals_from(found.a, found.rows)[:] = np.nan
    np.testing.assert_array_equal((world.contacts.normal, world.contacts.point), before)
    assert np.isfinite([contact.normal for *_, contact in world.contacts.pairs(RigidBody, Transform)]).all()


def disturb(world, rng, entities, found):
    """One of the things that the body of a loop may do."""
    _, a, b = found
    alive = [entity for entity in entities if world.entity_exists(entity)]
    other = int(rng.choice(alive)) if alive else None
    match int(rng.integers(9)):
        case 0:
            if world.entity_exists(a):
                world.delete_entity(a)
        case 1:
            if world.entity_exists(b):
                world.delete_entity(b, immediate=True)
        case 2 if other:
            world.delete_entity(other, immediate=bool(rng.integers(2)))
        case 3 if other:
            world.add_component(other, Missile())
        case 4 if other:
            if world.has_component(other, Enemy):
                world.remove_component(other, Enemy)
                world.get_component(Enemy)
        case 5 if other:  # pass it on: as many as before
            holder = next((e for e in alive if world.has_component(e, Missile)), None)
            if holder:
                world.add_component(other, world.remove_component(holder, Missile))
        case 6:
            world.create_entity(Missile(), Enemy())
        case 7:
            world.contacts.enabled[rng.integers(len(world.contacts))] ^= True
        case 8:
            pass


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_what_the_loop_changes_counts_at_once(seed):
    """Deleted, tagged, untagged, disabled by the body of the loop: the rows that follow are as by definition."""
    took = []
    for way in ("definition", "pairs"):
        world, entities = crowd(count=80, seed=seed)
        rng = np.random.default_rng(seed)
        for entity in entities[::2]:
            world.add_component(entity, Missile())
        rows, seen = world.contacts, []
        loop = by_definition(world, rows, Missile, Enemy) if way == "definition" else rows.pairs(Missile, Enemy)
        for *_, contact in loop:
            seen.append((contact.entity_a, contact.entity_b, bits(contact)))
            disturb(world, rng, entities, (0, contact.entity_a, contact.entity_b))
        took.append(seen)
    assert took[0] == took[1]
    assert len(took[0]) > 20


def test_in_a_system_and_from_another_world():
    """Inside a step, inside another world's block and outside of both: the same world's entities."""
    world, _ = crowd(steps=0)
    other, _ = crowd(count=5, seed=1)
    told = []

    def look():
        begin = world.contacts.begin
        told.append([(a, b) for a, b, _ in begin.pairs(Missile, Tag)])
        told.append(list(zip(*(c.tolist() for c in begin.between(Missile, Tag)[1:]), strict=True)))

    world.add_system(Calls(Phase.END, look))
    world.step()
    with other:
        inside = [(a, b) for a, b, _ in world.contacts.begin.pairs(Missile, Tag)]
        assert esper.current_world == other.name
    assert told == [inside, inside]
    assert inside


def test_a_step_within_the_loop():
    """The loop goes on over the rows it began with, as long as their entities live."""
    world, _ = crowd()
    before = [bits(contact) for *_, contact in world.contacts.pairs(RigidBody, Transform)]
    seen = []
    for *_, contact in world.contacts.pairs(RigidBody, Transform):
        seen.append(bits(contact))
        if len(seen) % 20 == 1:
            world.step()
    assert seen == before


@pytest.mark.plain
def test_a_closed_world_says_so():
    """Also when the loop closes it; a list without rows asks nothing."""
    world, _ = crowd(count=12)
    empty, full = make_world().contacts.begin, world.contacts.begin
    loop = full.pairs(RigidBody, Transform)
    next(loop)
    world.close()
    for ask in (lambda: next(loop), lambda: list(full.pairs(Tag, Tag)), lambda: full.between(Tag, Tag)):
        with pytest.raises(CaromError, match="is closed"):
            ask()
    assert list(empty.pairs(Tag, Tag)) == []
    assert [len(column) for column in empty.between(Tag, Tag)] == [0, 0, 0]


def test_what_is_no_type():
    world, _ = crowd(count=12)
    for verb in (world.contacts.pairs, world.contacts.between):
        for wrong in ([], Tag()):
            with pytest.raises(TypeError, match="component types"):
                verb(Tag, wrong)
