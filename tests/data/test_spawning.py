"""What it takes when bodies come and go: work for those alone, not for all that stay. Work is counted, not timed."""

import numpy as np
import pytest
from worlds import both_dimensions

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import World
from carom.plugins import Physics

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
        """Somebody comes, in some steps somebody goes."""
        self.ids.append(self.spawn("kinematic" if step % 3 == 1 else "dynamic"))
        if step % 4 == 3:
            self.world.delete_entity(self.ids.pop(step % len(self.ids)))

    def seen(self):
        """All that may differ."""
        world = self.world
        contacts = [(c.entity_a, c.entity_b, c.depth) for c in world.contacts]
        return world.state_hash(), contacts, sorted(world.query_sphere([0.5 * ROOM] * world.dimensions, 2.0))


@both_dimensions
@pytest.mark.parametrize("size", [0.2, 3.0], ids=["grid", "uneven"])
def test_what_is_kept_of_those_that_stay_is_what_would_be_made_again(d, size):
    kept, again = Level(d, size), Level(d, size)
    for step in range(20):
        for level in (kept, again):
            level.change(step)
            if step == 9:  # another order of rows
                level.world.component_for_entity(level.ids[2], RigidBody).kind = "static"
            if step == 13:
                level.world.delete_entity(level.statics[7])
        again.world.physics.scene.forget()
        kept.world.step()
        again.world.step()
        assert kept.seen() == again.seen()
    assert kept.world.contacts
