"""Worlds whose states are compared bit by bit, and all of their bits."""

from __future__ import annotations

import numpy as np
from worlds import make_world

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Component, ForceSystem, column

STEPS = 220  # of the mixed scene


class Charge(Component):
    value = column(default=0.0)


def state(world):
    """Every column, contacts included, as bytes."""
    bodies, contacts = world.bodies, world.contacts
    columns = {name: getattr(bodies, name).tobytes() for name in bodies.column_names()}
    events = {"begin": contacts.begin, "end": contacts.end, "impacts": contacts.impacts}
    for label, rows in {"now": contacts, **events}.items():
        for name in ("entity_a", "entity_b", "point", "normal", "depth", "normal_impulse", "step"):
            columns[f"{label}.{name}"] = getattr(rows, name).tobytes()
    return columns


def settled(**settings):
    return make_world(gravity=9.81, **settings)


class Swirl(ForceSystem):
    requires = (Charge,)

    def add_forces(self, bodies, time):
        bodies.force[:, 0] -= bodies.charge.value * bodies.position[:, 1]
        bodies.force[:, 1] += bodies.charge.value * np.sin(time)


class Facade:
    """The verbs of a world."""

    def __init__(self, world):
        self.world = world
        self.create, self.delete, self.add, self.remove = (
            world.create_entity, world.delete_entity, world.add_component, world.remove_component,
        )  # fmt: skip

    def step(self):
        self.world.step()


def mixed_scene(world, use):
    """Spheres and boxes thrown at each other over a floor, with creation and deletion; yields after each step."""
    world.add_system(Swirl())
    rng = np.random.default_rng(11)
    use.create(Transform((0.0, -0.5)), AABBCollider((30.0, 0.5), restitution=0.3))
    use.create(Transform((0.0, 3.0)), RigidBody(kind="kinematic", linear_velocity=(0.5, 0.0)), AABBCollider((2.0, 0.2)))
    alive = []
    for step in range(STEPS):
        if step % 3 == 0 and len(alive) < 40:
            collider = (SphereCollider, AABBCollider)[step % 2](rng.uniform(0.2, 0.5), restitution=rng.random())
            body = RigidBody(rng.uniform(0.5, 5.0), rng.normal(size=2) * 4, linear_damping=0.1 * (step % 2))
            extra = [Charge(rng.normal())] if step % 5 == 0 else []
            alive.append(use.create(Transform((rng.uniform(-4, 4), rng.uniform(1, 9))), body, collider, *extra))
        if step % 7 == 6:
            use.delete(alive.pop(int(rng.integers(len(alive)))), immediate=bool(step % 2))
        if step % 11 == 10:
            use.add(alive[0], Charge(1.0))
            use.add(alive[1], RigidBody(2.0, (0.0, 3.0)))
            use.remove(alive[2], RigidBody)
        if step % 11 == 0 and step:
            use.add(alive[2], RigidBody(1.0))
        use.step()
        yield
