"""Random histories: whatever a game does, snapshots restored in any order give the same world and the same future."""

from __future__ import annotations

import pickle
import random

import esper
import numpy as np
import pytest
from data.helpers_snapshots import Bullet, Tag, springs_of
from helpers_determinism import Charge, state

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Component, Settings, World
from carom.plugins import Physics, capsule, convex_polygon
from carom.plugins.springs import Springs

pytestmark = pytest.mark.usefixtures("invariants")

TYPES = (
    Transform, RigidBody, SphereCollider, capsule.CapsuleCollider, convex_polygon.ConvexPolygonCollider, Bullet, Charge,
    Tag,
)  # fmt: skip
REMOVABLE = (Bullet, Charge, Tag)


def everything(world):
    """All that can be seen; esper's lists by type agree with its entities."""
    of = {entity: world.components_for_entity(entity) for entity in world._contents().entities}
    values = {
        entity: {
            type(c).__name__: [repr(column.value_of(c)) for column in c.columns.values()]
            for c in components
            if isinstance(c, Component)
        }
        for entity, components in of.items()
    }
    listed = {t.__name__: [entity for entity, _ in world.get_component(t)] for t in TYPES}
    for kind in TYPES:
        assert listed[kind.__name__] == [e for e, components in of.items() if any(type(c) is kind for c in components)]
    alive = [entity for entity in of if world.entity_exists(entity)]
    springs = [repr(spring) for spring in springs_of(world)]
    columns = {name: column for name, column in state(world).items() if "." not in name or name.startswith("now")}
    clock = world.time, world.alpha, world.gravity.tolist()
    counters = world.stats().counters
    return world.state_hash(), values, listed, alive, springs, columns, clock, counters


def plugins():
    return Physics(2, gravity=(0, -9.81)), capsule.plugin, convex_polygon.plugin, Springs()


class Game:
    """A world to which random things happen."""

    def __init__(self, seed):
        self.random = random.Random(seed)
        mode = self.random.choice(("discrete", "continuous", "event_driven"))
        self.world = World(*plugins(), settings=Settings(collision=mode, on_fault="ignore"))
        self.world.create_entity(Transform((0, -1)), AABBCollider((30, 0.5)))
        self.held = []  # handles that the game holds

    def place(self):
        return self.random.uniform(-5, 5), self.random.uniform(0, 8)

    def some(self):
        return self.random.choice(list(self.world._contents().entities) or [self.world.create_entity()])

    def spawn(self):
        r, height = self.random, self.random.uniform(0.4, 0.9)
        collider = r.choice((
            SphereCollider(r.uniform(0.1, 0.5)), capsule.CapsuleCollider(0.2, 0.3),
            convex_polygon.ConvexPolygonCollider(((0, 0), (0.8, 0), (0.4, height))),
        ))  # fmt: skip
        self.world.create_entity(Transform(self.place(), rotation=r.random()), RigidBody(), collider)

    def spawn_many(self):
        radius, place = SphereCollider.many(radius=0.2), Transform.many(self.place())
        self.world.create_entities(self.random.randint(1, 4), place, RigidBody.many(), radius)

    def spawn_what_is_no_body(self):
        self.world.create_entities(self.random.randint(1, 3), Bullet.many(expires=self.random.random()))
        self.world.create_entity(*self.random.choice(((), (Tag(1),), (Bullet(1.0), Tag(2)))))

    def delete(self):
        self.world.delete_entity(self.some(), immediate=self.random.random() < 0.5)

    def give(self):
        r = self.random
        self.world.add_component(self.some(), r.choice((Charge(r.random()), Bullet(r.random()), Tag(3))))

    def make_a_body(self):
        entity = self.some()
        if not self.world.has_component(entity, Transform):
            self.world.add_component(entity, Transform(self.place()))
            self.world.add_component(entity, SphereCollider(0.3))

    def take(self):
        entity = self.some()
        kinds = [type(c) for c in self.world.components_for_entity(entity) if isinstance(c, REMOVABLE)]
        if kinds:
            self.world.remove_component(entity, self.random.choice(kinds))

    def write(self):
        r = self.random
        for handle in self.world.components_for_entity(self.some()):
            if isinstance(handle, Bullet):
                handle.expires = r.random()
            elif isinstance(handle, SphereCollider):
                handle.radius = r.uniform(0.1, 0.5)
            elif isinstance(handle, convex_polygon.ConvexPolygonCollider):
                handle.vertices = ((0, 0), (0.8, 0), (0.4, r.uniform(0.3, 0.9)))
            elif isinstance(handle, RigidBody):
                handle.kind = r.choice(("dynamic", "dynamic", "kinematic", "static"))
                handle.linear_damping = r.choice((0.0, 0.1))
                handle.apply_force((1.0, 2.0))
            if isinstance(handle, Component):
                self.held.append(handle)

    def spoil(self):
        """The body is quarantined until it is mended."""
        speeds = self.world.bodies.dynamic.linear_velocity
        if len(speeds):
            row = self.random.randrange(len(speeds))
            speeds[row] = 0.0 if np.isnan(speeds[row]).any() else np.nan

    def look(self):
        place = self.place()
        self.world.query_point(place)
        self.world.ray_cast(place, (0.0, -1.0), 10.0)
        len(self.world.contacts)

    def connect(self):
        bodies = self.world.bodies.entity.tolist()
        if len(bodies) > 1:
            springs_of(self.world).connect(*self.random.sample(bodies, 2), stiffness=3.0)

    def clear(self):
        if self.random.random() < 0.2:
            with self.world:
                esper.clear_database()

    def advance(self):
        self.world.gravity = (0.0, self.random.uniform(-10, -5))
        self.world.advance(self.random.uniform(0.5, 6) / 60)


ACTIONS = (
    Game.spawn, Game.spawn, Game.spawn_many, Game.spawn_what_is_no_body, Game.delete, Game.give, Game.make_a_body,
    Game.take, Game.write, Game.spoil, Game.look, Game.connect, Game.clear, Game.advance, Game.advance,
)  # fmt: skip


def future(world):
    """The next steps; the world stays after them."""
    return [(world.step(), world.state_hash(), len(world.contacts.begin))[1:] for _ in range(3)]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(9))
def test_snapshots_of_a_random_history_bring_back_the_world_and_its_future(seed, tmp_path):
    game, kept = Game(seed), []
    for _ in range(20):
        choice = game.random.random()
        if choice < 0.75:
            game.random.choice(ACTIONS)(game)
        elif choice < 0.85 and len(kept) < 8:
            snapshot = game.world.snapshot()
            path = tmp_path / str(len(kept))
            game.world.save(path, leave_out=[Tag])
            kept.append([snapshot, pickle.dumps(snapshot), everything(game.world), None, path])
        elif kept:
            one = game.random.choice(kept)
            sent = game.random.random() < 0.3
            game.world.restore(pickle.loads(one[1]) if sent else one[0])
            assert everything(game.world) == one[2]
            if one[3] is None:
                loaded = World.load(one[4], *plugins(), components=[Bullet, Charge])
                one[3] = future(loaded)
                loaded.close()
            game.world.restore(one[0])
            assert future(game.world) == one[3]
            for handle in game.held:
                assert handle.entity is None or game.world.component_for_entity(handle.entity, type(handle)) is handle
