"""world.plan() against the columns that are actually allocated."""

from __future__ import annotations

import numpy as np
import pytest
from worlds import make_world

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import System, World
from carom.framework.jit.records.record import Record
from carom.framework.jit.records.schema import Scalar
from carom.systems.records import SOLVER_BODIES


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
        elif isinstance(thing, Record):
            fields = thing.schema.fields.items()
            todo += [getattr(thing, name) for name, field in fields if not isinstance(field, Scalar)]
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


def touching(world, *components):
    """The same with the two on their way to each other."""
    near(world, *components)
    world.bodies.linear_velocity[:2, 0] = 1.0, -1.0
    return world


STEP = {"start_velocity", "levels", "kept_previous", "kept_velocity"}
COLLISIONS = {"path_velocity", "origin", "min_extent", "collider_slot", "force_speed_change", "lower", "upper", "rank"}
COLLISIONS |= {"level_offsets", "impact_count", "counted_impacts", "half_extents"}
RESTING = {"held", "place", "supported", "support_change", "to_hold"}
CURVES = {"path_second", "path_third"}
SWEPT = {"search_margin", "search_lower", "search_upper", "caught", "last_impact"}
SWEPT |= {"cluster_root", "cluster_next", "cluster_tail", "cluster_inverse_mass", "cluster_holder"}
ROTATION = {"axes", "aabb_collider.half_extents, rotated"}
FREE = RigidBody.many(mass=1.0)
BALLS = SphereCollider.many(radius=0.5)
CRATES = AABBCollider.many(half_extents=(0.5, 0.5))
GROUPS = (
    "the step", "going back", "collisions", "shapes", "curved paths", "swept bodies", "rotation", "contacts at rest",
    "broad phase, grid", "broad phase, static grid",
)  # fmt: skip
COLUMNS = {
    "free flight": (lambda: many(make_world(), FREE), set()),
    "gravity and a curved path": (lambda: many(make_world(gravity=9.81, integrator="rk4"), FREE), set()),
    "spheres apart": (lambda: many(make_world(), FREE, BALLS), COLLISIONS),
    "spheres that touch": (lambda: touching(make_world(), FREE, BALLS), COLLISIONS | RESTING),
    "spheres that touch, 3D": (lambda: touching(make_world(3), FREE, BALLS), COLLISIONS | RESTING),
    "curved paths": (lambda: many(make_world(integrator="rk4", gravity=9.81), FREE, BALLS), COLLISIONS | CURVES),
    "paths that may curve": (lambda: many(make_world(integrator="rk4"), FREE, BALLS), COLLISIONS | CURVES),
    "swept": (lambda: many(make_world(collision="continuous"), FREE, BALLS), COLLISIONS | SWEPT),
    "boxes": (lambda: many(make_world(), FREE, CRATES), COLLISIONS),
    "turned boxes": (lambda: many(_turning(), FREE, CRATES), COLLISIONS | ROTATION),
    "levels": (
        lambda: many(make_world(), FREE, SphereCollider.many(radius=0.8), CRATES),
        COLLISIONS | {"level_not_enclosing", "stretches"},
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
    present -= {column for column in present if column.startswith("copy of")}
    assert present == expected | STEP
    assert sum(column.bytes for column in columns) * COUNT == arrays_per_body(world)
    at_rest = {column.column for column in plan.columns if column.of == "body at rest"}
    assert at_rest == (set(SOLVER_BODIES) if expected >= RESTING else set())
    world.close()


def test_the_solver_has_room_for_the_bodies_at_rest():
    world = near(make_world(), FREE, BALLS)
    world.step()
    assert 2 <= len(world.physics.state.solver.body_row) < COUNT // 2
    world.bodies.position[:] = 0.1 * np.arange(COUNT)[:, None]  # now all of them touch others
    world.step()
    assert len(world.physics.state.solver.body_row) >= COUNT
    world.close()


def test_fields_at_their_defaults_are_distinguished_from_those_in_use():
    world = make_world()
    entity = world.create_entity(Transform((0.0, 0.0)), RigidBody())
    columns = {column.column: column.reason for column in world.plan().columns}
    assert columns["position"] == "what the game has set"
    assert "defaults" in columns["mass"]
    for name in ("rotation", "constant_force", "linear_damping", "gravity_scale", "max_linear_speed"):
        assert name not in columns  # nothing has asked for them
    _ = world.bodies.gravity_scale
    columns = {column.column: column.reason for column in world.plan().columns}
    assert "defaults" in columns["gravity_scale"]
    world.component_for_entity(entity, Transform).rotation = 1.0
    world.component_for_entity(entity, RigidBody).max_linear_speed = 1.0
    columns = {column.column: column.reason for column in world.plan().columns}
    assert columns["rotation"] == columns["max_linear_speed"] == "what the game has set"
