"""Systems of the game in place of built-in ones: contacts are counted and told as before."""

from __future__ import annotations

import numpy as np
import pytest
from worlds import make_world

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Phase, System
from carom.systems import ContactEvents, ForceAccumulation, Response

pytestmark = pytest.mark.plain


class PushApart(System):
    """What overlaps moves apart, and loses the speed at which it approaches."""

    phase = Phase.RESPONSE
    before = (ContactEvents,)

    def process(self, dt):
        contacts, bodies = self.world.contacts, self.world.bodies.dynamic
        rows = {entity: row for row, entity in enumerate(bodies.entity.tolist())}
        for k in np.flatnonzero(contacts.depth > 0.0):
            for entity, sign in ((contacts.entity_a[k], -1.0), (contacts.entity_b[k], 1.0)):
                row, away = rows.get(int(entity)), sign * contacts.normal[k]
                if row is not None:
                    bodies.position[row] += contacts.depth[k] * away
                    bodies.linear_velocity[row] -= min(bodies.linear_velocity[row] @ away, 0.0) * away


def game(balls=40, **settings):
    world = make_world(2, gravity=10.0, **settings)
    world.create_entity(Transform((0, -1)), AABBCollider((50, 1)))
    for k in range(balls):
        world.create_entity(Transform((2.0 * k - 40, 1.0 + 0.1 * k)), RigidBody(), SphereCollider(0.5))
    return world


def history_of(world, steps):
    """(begins, ends) as handlers hear them and as the columns say, in each step."""
    heard, told = [], []
    world.on("contact_begin", lambda contact: heard.append((world.step_count, "begin", contact.entity_b)))
    world.on("contact_end", lambda contact: heard.append((world.step_count, "end", contact.entity_b)))
    for _ in range(steps):
        count = world.step_count
        world.step()
        for name in ("begin", "end"):
            told += [(count, name, entity) for entity in getattr(world.contacts, name).entity_b.tolist()]
    return sorted(heard), sorted(told)


@pytest.mark.compiled
def test_a_response_of_the_game_counts_contacts_and_calls_handlers():
    """Each ball begins to touch the floor in the step in which it meets it, with the built-in response as well."""
    mine, theirs = game(), game()
    mine.remove_processor(Response)
    mine.add_system(PushApart())
    heard, told = history_of(mine, 60)
    assert heard == told
    begun = {entity: step for step, name, entity in reversed(heard) if name == "begin"}
    expected = {entity: step for step, name, entity in reversed(history_of(theirs, 60)[0]) if name == "begin"}
    assert begun.keys() == expected.keys() == set(mine.bodies.dynamic.entity.tolist())
    assert all(abs(begun[entity] - expected[entity]) <= 1 for entity in begun)
    counters, built_in = mine.stats().counters, theirs.stats().counters
    assert counters["contacts"] == pytest.approx(built_in["contacts"], rel=0.1)
    for name in ("bodies", "force_evaluations"):
        assert counters[name] == built_in[name]
    assert (mine.bodies.dynamic.position[:, 1] > 0.49).all()


def test_disabled_contacts_neither_begin_nor_last():
    world, heard = game(balls=2), []
    world.remove_processor(Response)

    class Ignore(System):
        phase = Phase.NARROW

        def process(self, dt):
            contacts = self.world.contacts
            contacts.enabled[contacts.entity_b == 2] = False

    world.add_system(Ignore())
    world.on("contact_begin", lambda contact: heard.append(contact.entity_b))
    for _ in range(60):
        world.step()
    assert heard == [3]


@pytest.mark.compiled
def test_forces_of_the_game_in_place_of_the_sum():
    """``force`` is set by the game alone; what follows takes it as the built-in sum's."""

    class Weight(System):
        phase = Phase.FORCES
        writes = ("force",)

        def process(self, dt):
            bodies = self.world.bodies.dynamic
            bodies.force[:] = bodies.mass[:, None] * self.world.gravity

    mine, theirs = game(balls=3), game(balls=3)
    mine.remove_processor(ForceAccumulation)
    mine.add_system(Weight())
    for world in (mine, theirs):
        for _ in range(60):
            world.step()
    assert mine.state_hash() == theirs.state_hash()
    assert mine.stats().counters["contacts"] == theirs.stats().counters["contacts"] > 0
