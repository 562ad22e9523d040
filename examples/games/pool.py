"""A shot at two balls of pool on a table with pockets: carom trade examples/games/pool.py"""

from __future__ import annotations

import numpy as np

from carom import AABBCollider, Component, Physics, RigidBody, SphereCollider, System, Transform, World, column

LENGTH, WIDTH, RADIUS = 2.54, 1.27, 0.028575  # m
seconds = 4.0


class Ball(Component):
    """Its number; 0 is the cue ball."""

    number: int = column(default=0, dtype=int)


class Pocket(Component):
    """Takes balls whose centres are near."""


class Pockets(System):
    """Takes balls from the table, and tells which and when."""

    def __init__(self):
        super().__init__()
        self.potted = {}

    def process(self, dt):
        for _, ball, _ in self.world.contacts.begin.pairs(Pocket, Ball):
            self.potted[self.world.component_for_entity(ball, Ball).number] = self.world.time
            self.world.delete_entity(ball)


def build(settings, seed=0, balls=6):
    world = World(Physics(dimensions=2, gravity=(0, 0)), settings=settings)
    world.add_system(Pockets())
    for place, half in (
        ((LENGTH / 2, -0.05), (LENGTH / 2 + 0.1, 0.05)), ((LENGTH / 2, WIDTH + 0.05), (LENGTH / 2 + 0.1, 0.05)),
        ((-0.05, WIDTH / 2), (0.05, WIDTH / 2)), ((LENGTH + 0.05, WIDTH / 2), (0.05, WIDTH / 2)),
    ):  # fmt: skip
        world.create_entity(Transform(place), AABBCollider(half, restitution=0.8))
    for x in (0, LENGTH / 2, LENGTH):
        for y in (0, WIDTH):
            world.create_entity(Transform((x, y)), SphereCollider(0.05, sensor=True), Pocket())
    random = np.random.default_rng(seed)
    where = [(0.6, 0.64), *((1.6 + 0.06 * (k // 2), 0.6 + 0.065 * (k % 2)) for k in range(balls))]
    for number, (x, y) in enumerate(where):
        place = np.array((x, y)) + random.uniform(-1e-4, 1e-4, 2)
        body = RigidBody(mass=0.17, linear_velocity=(4.0, 0.13) if number == 0 else (0, 0), linear_damping=0.35)
        world.create_entity(Transform(place), body, SphereCollider(RADIUS, restitution=0.95), Ball(number))
    return world


def compared(world):
    """What carom trade compares: the balls by their numbers; None is a ball that is potted."""
    potted = world.get_processor(Pockets).potted
    found = {f"ball {ball.number}": place.position for _, (ball, place) in world.get_components(Ball, Transform)}
    return {"potted": len(potted), **{f"ball {number}": None for number in potted}, **found}
