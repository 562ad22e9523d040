"""world.plan() against the columns that are actually allocated."""

from __future__ import annotations

import numpy as np
import pytest

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import System, World

from .worlds import make_world


def arrays_per_body(world):
    """Sizes in bytes of all arrays with as many rows as the body capacity, reached from the world's physics."""
    capacity, found, seen = world.physics.table.capacity, {}, set()
    todo = [world.physics, world.physics.table, *world.systems]
    while todo:
        thing = todo.pop()
        if id(thing) in seen:
            continue
        seen.add(id(thing))
        if isinstance(thing, np.ndarray):
            while thing.base is not None and isinstance(thing.base, np.ndarray):
                thing = thing.base
            if capacity in thing.shape:
                found[id(thing)] = thing
        elif isinstance(thing, dict):
            todo += thing.values()
        elif isinstance(thing, (list, tuple, set)):
            todo += thing
        elif type(thing).__module__.startswith("carom") and not isinstance(thing, (type, World)):
            todo += vars(thing).values() if hasattr(thing, "__dict__") else ()
    return sum(array.nbytes for array in found.values())


COUNT = 150  # bodies created at once, more than the capacity of a new table: exactly that many rows


def many(world, *components):
    places = np.zeros((COUNT, world.dimensions))
    places[:, 0] = 3.0 * np.arange(COUNT)
    world.create_entities(COUNT, Transform.many(places), *components)
    return world


def near(world, *components):
    """The same with two overlapping bodies."""
    many(world, *components)
    world.bodies.position[1] = world.bodies.position[0] + 0.25
    return world


COLLISIONS = {"path_velocity", "origin", "size", "material", "gravity_share", "lower", "upper", "level_offsets", "rank"}
COLLISIONS |= {"boxes", "rows"}
SOLVER = {"supported", "held", "change", "place", "used", "body_rows", "last", "velocity", "moved", "acceleration"}
SOLVER |= {"inverse_mass"}
CURVES = {"path_second", "path_third"}
SWEPT = {"room", "roam_lower", "roam_upper"}
ROTATION = {"axes", "aabb_collider.half_extents, turned"}
FREE = RigidBody.many(mass=1.0)
BALLS = SphereCollider.many(radius=0.5)
CRATES = AABBCollider.many(half_extents=(0.5, 0.5))
GROUPS = (
    "the step", "collisions", "shapes", "curved paths", "swept bodies", "rotation", "contacts at rest",
    "broad phase, pairwise", "broad phase, grid",
)  # fmt: skip
COLUMNS = {
    "free flight": (lambda: many(make_world(), FREE), set()),
    "gravity and a curved path": (lambda: many(make_world(gravity=9.81, integrator="rk4"), FREE), set()),
    "spheres apart": (lambda: many(make_world(), FREE, BALLS), COLLISIONS),
    "spheres that touch": (lambda: near(make_world(), FREE, BALLS), COLLISIONS | SOLVER),
    "spheres that touch, 3D": (lambda: near(make_world(3), FREE, BALLS), COLLISIONS | SOLVER),
    "curved paths": (lambda: many(make_world(integrator="rk4", gravity=9.81), FREE, BALLS), COLLISIONS | CURVES),
    "straight paths": (lambda: many(make_world(integrator="rk4"), FREE, BALLS), COLLISIONS),
    "swept": (lambda: many(make_world(collision="continuous"), FREE, BALLS), COLLISIONS | SWEPT),
    "boxes": (lambda: many(make_world(), FREE, CRATES), COLLISIONS),
    "turned boxes": (lambda: many(_turning(), FREE, CRATES), COLLISIONS | ROTATION),
    "levels": (
        lambda: many(make_world(), FREE, SphereCollider.many(radius=0.8), CRATES),
        COLLISIONS | {"outgrown", "stretches"},
    ),
}


class Turn(System):
    def process(self, dt):
        self.world.bodies.rotation[:] += 0.1


def _turning():
    world = make_world()
    world.add_system(Turn())
    return world


@pytest.mark.parametrize("name", COLUMNS)
def test_the_columns_there_are_those_of_the_plan(name):
    build, expected = COLUMNS[name]
    world = build()
    for _ in range(3):
        world.step()
    plan = world.plan()
    columns = [column for column in plan.columns if column.of == "body"]
    present = {column.column for column in columns if column.group in GROUPS}
    assert present == expected | {"start_velocity", "levels"}
    assert sum(column.bytes for column in columns) * COUNT == arrays_per_body(world)
    world.close()


def test_fields_at_their_defaults_are_distinguished_from_those_in_use():
    world = make_world()
    entity = world.create_entity(Transform((0.0, 0.0)), RigidBody())
    columns = {column.column: column.reason for column in world.plan().columns}
    assert columns["position"] == "what the game has set"
    for name in ("rotation", "constant_force", "linear_damping", "gravity_scale", "max_linear_speed"):
        assert "defaults" in columns[name]
    world.component_for_entity(entity, Transform).rotation = 1.0
    world.component_for_entity(entity, RigidBody).max_linear_speed = 1.0
    columns = {column.column: column.reason for column in world.plan().columns}
    assert columns["rotation"] == columns["max_linear_speed"] == "what the game has set"
