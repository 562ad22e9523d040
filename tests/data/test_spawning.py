"""What it takes when bodies come and go: work for those alone, not for all that stay. Work is counted, not timed."""

import numpy as np
import pytest
from worlds import both_dimensions

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.components.spin import Spin
from carom.framework import World
from carom.framework.data.column_copies import ColumnCopies
from carom.plugins import Physics
from carom.plugins.rotation import BoxCollider, Rotation
from carom.systems import scene
from carom.systems.plugin_stages.plugin_stages import PluginStages
from carom.systems.quarantine.quarantine import Checked

STATICS = 400  # enough for a grid of their own
ROOM = 12.0  # m


class Level:
    """A world of many static boxes and a few spheres that move among them."""

    def __init__(self, dimensions, size=0.2):
        self.random = np.random.default_rng(1)
        self.world = World(Physics(dimensions=dimensions))
        places = self.random.uniform(0.0, ROOM, (STATICS, dimensions))
        half = self.random.uniform(0.5 * size, size, (STATICS, dimensions))
        self.statics = self.world.create_entities(
            STATICS, Transform.many(places), RigidBody.many(kind="static"), AABBCollider.many(half)
        )
        self.ids = [self.spawn() for _ in range(5)]
        self.world.step()
        self.ids.append(self.spawn())  # makes room for as many bodies again
        self.world.step()

    def spawn(self, kind="dynamic"):
        place = tuple(self.random.uniform(0.0, ROOM, self.world.dimensions))
        return self.world.create_entity(Transform(place), RigidBody(kind=kind), SphereCollider(radius=0.4))

    def change(self, step):
        """Somebody comes, in some steps somebody goes, once another order of rows."""
        self.ids.append(self.spawn("kinematic" if step % 3 == 1 else "dynamic"))
        if step % 4 == 3:
            self.world.delete_entity(self.ids.pop(step % len(self.ids)))
        if step == 9:
            self.world.component_for_entity(self.ids[2], RigidBody).kind = "static"
        if step == 13:
            self.world.delete_entity(self.statics[7])


class Turning:
    """Boxes and spheres that turn, in the air, of which some come and go."""

    def __init__(self, dimensions, n):
        self.world, self.ids = World(Physics(dimensions=dimensions), Rotation()), []
        for _ in range(n):
            self.spawn()
        self.world.step()
        self.world.delete_entity(self.spawn())  # if they are just as many as there is room for
        self.world.step()

    def spawn(self, box=False, height=0.0):
        d, k = self.world.dimensions, len(self.ids)
        rotation, spin = (0.3 * k, 1.0) if d == 2 else ((1.0, 0.1 * k, 0.2, 0.3), (1.0, 0.2, 0.3))
        shape = BoxCollider(0.4) if box else SphereCollider(0.4)
        place = Transform((1.5 * k, height, 0.0)[:d], rotation)
        self.ids.append(self.world.create_entity(place, RigidBody(), shape, Spin(spin)))
        return self.ids[-1]

    def change(self, step):
        """Also one that turns otherwise, and one that is taken out and mended later."""
        if step % 3 == 0:
            self.spawn(box=step % 2 == 0, height=1.0)
        if step % 4 == 3:
            self.world.delete_entity(self.ids.pop(step % len(self.ids)))
        if step == 9:
            turn = 0.5 if self.world.dimensions == 2 else (1.0, 0.5, 0.0, 0.0)
            self.world.component_for_entity(self.ids[step % len(self.ids)], Transform).rotation = turn
        if step in (12, 18):
            self.world.bodies.dynamic.linear_velocity[2] = np.nan if step == 12 else 0.0


@both_dimensions
@pytest.mark.parametrize("n", [10, 50])
def test_of_bodies_that_turn_only_those_that_come_are_looked_at(d, n, monkeypatch):
    work = dict.fromkeys(("axes", "stages bound", "columns checked", "copies bound"), 0)

    def count(owner, name, what, amount=lambda *args: 1):
        function = getattr(owner, name)

        def counted(*args):
            work[what] += amount(*args)
            return function(*args)

        monkeypatch.setattr(owner, name, counted)

    turning = Turning(d, n)
    count(scene, "axes_of", "axes", lambda rotation, dimensions: len(rotation))
    count(PluginStages, "_bind", "stages bound")
    count(Checked, "bad", "columns checked")
    count(ColumnCopies, "_bind_columns", "copies bound")
    turning.spawn()
    turning.world.step()
    assert work == dict.fromkeys(work, 0) | {"axes": 1}
    for entity in turning.ids[2], turning.ids[-1]:
        turning.world.delete_entity(entity)
        turning.world.step()
    assert work["axes"] == 1
    turning.world.component_for_entity(turning.ids[3], Transform).rotation = 1.0 if d == 2 else (1.0, 1.0, 0.0, 0.0)
    turning.world.step()
    assert work == dict.fromkeys(work, 0) | {"axes": 2}


def seen(world):
    """All that may differ."""
    contacts = [(c.entity_a, c.entity_b, c.depth) for c in world.contacts]
    near = world.query_sphere([0.5 * ROOM] * world.dimensions, 2.0)
    return world.state_hash(), contacts, sorted(near), world.faults


@pytest.mark.slow
@both_dimensions
@pytest.mark.parametrize(
    "build", [Level, lambda d: Level(d, 3.0), lambda d: Turning(d, 6)], ids=["grid", "uneven", "turning"]
)
def test_what_is_kept_of_those_that_stay_is_what_would_be_made_again(d, build):
    kept, again = build(d), build(d)
    for step in range(24):
        for one in (kept, again):
            one.change(step)
        physics = again.world.physics
        physics.scene.forget()
        physics.plugin_stages._bound = None
        kept.world.step()
        again.world.step()
        assert seen(kept.world) == seen(again.world)
    assert (kept.world.faults if isinstance(kept, Turning) else kept.world.contacts)
