"""The kit for users' tests, in games in which bodies come and go."""

from __future__ import annotations

import numpy as np
import pytest
from worlds import both_dimensions

from carom.components import RigidBody, SphereCollider, Transform
from carom.framework import Phase, System
from carom.lab import testing as kit


class Spawner(System):
    """Each 5th step a ball comes, and the oldest goes; each 7th step three come at once."""

    phase = Phase.END

    def __init__(self, seed):
        self.random, self.balls = np.random.default_rng(seed), []

    def process(self, dt):
        d, count = self.world.dimensions, self.world.step_count
        if count % 5 == 0:
            place, velocity = self.random.uniform(-4, 4, d), self.random.uniform(-3, 3, d)
            self.balls.append(kit.ball(self.world, place, velocity, mass=self.random.uniform(1, 3), restitution=1.0))
        if count % 5 == 0 and len(self.balls) > 6:
            self.world.delete_entity(self.balls.pop(0), immediate=bool(count % 2))
        if count % 7 == 0:
            places = Transform.many(self.random.uniform(10, 20, (3, d)))
            self.world.create_entities(3, places, RigidBody.many(linear_velocity=self.random.uniform(-1, 1, (3, d))))


class Boosts(System):
    phase = Phase.END

    def process(self, dt):
        if self.world.step_count == 60:
            self.world.bodies.dynamic.linear_velocity[0] += 1e-6


def game(d=2, seed=3):
    """Balls that do not meet, under no force but one that has a potential: gravity in free space."""
    world = kit.make_world(d, gravity=9.81, integrator="velocity_verlet")
    world.add_system(Spawner(seed))
    for k in range(4):
        world.create_entity(
            Transform(np.full(d, 100.0 + 3 * k)), RigidBody(linear_velocity=np.full(d, 1.0)),
            SphereCollider(0.5, mask=0),
        )  # fmt: skip
    return world


@pytest.mark.slow
@both_dimensions
def test_energy_is_followed_while_bodies_come_and_go(d):
    """Also what the test itself creates and deletes between two steps."""
    world = game(d)
    kept = kit.Conserved(world, relative=1e-9, following=True)
    kit.run(world, 100, kept.assert_finite, kept.assert_energy, kept.assert_energy_not_raised)
    for _ in range(10):
        entity = kit.ball(world, np.full(d, 50.0), np.full(d, -2.0))
        kept.assert_energy()
        kit.run(world, 2, kept.assert_energy)
        world.delete_entity(entity)
        kit.run(world, 2, kept.assert_energy)
    with pytest.raises(AssertionError, match=r"\d+ bodies, there were 4; came: \d+"):
        kept.assert_same_bodies()


def test_momentum_is_followed_and_what_physics_does_is_still_found():
    world = kit.make_world(2)
    world.add_system(Spawner(1))
    kit.ball(world, (50, 50))
    world.add_system(Boosts())
    kept = kit.Conserved(world, following=True)
    kit.run(world, 60, kept.assert_momentum)
    with pytest.raises(AssertionError, match=r"momentum is .* kg m/s apart, limit"):
        kit.run(world, 2, kept.assert_momentum)
    kept.close()
    assert not [system for system in world.systems if system.name.startswith("_")]


def test_without_following_the_message_says_what_came_and_went():
    world = kit.make_world(2)
    first = kit.ball(world, (0, 0), (1, 0))
    kit.ball(world, (9, 0))
    kept = kit.Conserved(world)
    world.delete_entity(first)
    new = kit.ball(world, (20, 0))
    kit.run(world, 1, kept.assert_finite)
    with pytest.raises(AssertionError, match=rf"came \({new}\) or went \({first}\): Conserved.*following=True"):
        kept.assert_momentum()
    with pytest.raises(AssertionError, match=rf"entity {first}, step 1: it is no body, or no more"):
        kit.assert_position(world, first, (0, 0))


def test_rest_is_looked_at_while_bodies_come_and_go():
    """A box that appears at rest is at rest; one that appears above the floor falls."""
    world = kit.make_world(2, gravity=9.81)
    kit.floor(world)
    boxes = [kit.box(world, (3.0 * k, 0.5)) for k in range(4)]

    class Swaps(System):
        def process(self, dt):
            if self.world.step_count == 20:
                self.world.delete_entity(boxes[0])
            if self.world.step_count == 30:
                kit.box(self.world, (-9.0, 0.25), half=0.25)

    world.add_system(Swaps())
    kit.assert_at_rest(world, steps=60)
    assert len(world.bodies.dynamic) == 4
    late = kit.box(world, (-20.0, 0.51))
    with pytest.raises(AssertionError, match=rf"entity {late}, step \d+: (moves at|has drifted by)"):
        kit.assert_at_rest(world, steps=60)
