"""How much work a step does, counted: looks for impacts, memory, copies. No times."""

from __future__ import annotations

import numpy as np
import pytest

from carom import scenes
from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import PhysicsWarning, Settings, World
from carom.framework.jit.records.schema import Column
from carom.plugins import Physics
from carom.plugins.rotation import BoxCollider, Rotation, Spin


def test_looks_for_impacts_of_fast_bodies():
    """13 looks an impact: pairs of two bodies, and new pairs of a search; looking at all pairs again took 37."""
    with scenes.get("fastgas").build(Settings(collision="continuous"), 1, n=300) as world:
        state = world.physics.state
        for _ in range(30):
            world.step()
        assert state.refreshes_counted > 100
        assert state.impacts_counted > 10_000
        assert state.looks_counted < 17 * state.impacts_counted


def evaluations_of_a_step(world: World) -> int:
    """How often functions of pairs are called in a step."""
    before = world.physics.state.evaluations_counted
    world.step()
    return world.physics.state.evaluations_counted - before


def settled(scene: str, steps: int, **options) -> World:
    world = scenes.get(scene).build(**options)
    for _ in range(steps):
        world.step()
    return world


@pytest.mark.slow
@pytest.mark.parametrize(("scene", "steps", "options"), [("pyramid", 500, {}), ("pile2d", 900, {"n": 200})])
def test_a_pair_at_rest_is_evaluated_once_a_step(scene, steps, options):
    """Where the step starts; all that follows reads this manifold. Those that are near but do not touch: twice more."""
    with settled(scene, steps, **options) as world:
        pairs = world.physics.state.pairs
        evaluations = evaluations_of_a_step(world)
        assert pairs.touching_count > 0.85 * pairs.count
        assert pairs.count <= evaluations <= pairs.count + 2 * (pairs.resting_count - pairs.touching_count)


@pytest.mark.parametrize("dimensions", [2, 3])
@pytest.mark.parametrize("mode", ["continuous", "event_driven"])
@pytest.mark.parametrize("lying", ["box", "ball"])
def test_what_moves_with_a_turning_body_is_looked_at_as_often_as_it_moves_on_it(dimensions, mode, lying):
    """What a plank carries along passes it by w^2 r dt^2 / 2, a centimetre of the 25 that it goes: a look or two for
    each millimetre, which is an eighth of the slop; not one for each that the plank's tips go."""

    def along(x, y, z=0.0):
        return (x, y, z)[:dimensions]

    w, place = 5.0, (3.0, 0.349)
    spin = w if dimensions == 2 else (0.0, 0.0, w)
    settings = Settings(collision=mode, on_fault="raise")
    with World(Physics(dimensions=dimensions, gravity=along(0.0, 0.0)), Rotation(), settings=settings) as world:
        world.create_entity(
            Transform(along(0.0, 0.0)), RigidBody(mass=1.0), Spin(spin), BoxCollider(along(4.0, 0.1, 0.5))
        )
        shape = BoxCollider(along(0.25, 0.25, 0.25)) if lying == "box" else SphereCollider(0.25)
        body = RigidBody(mass=1.0, linear_velocity=along(-w * place[1], w * place[0]))
        world.create_entity(Transform(along(*place)), body, Spin(spin), shape)
        assert evaluations_of_a_step(world) < 25


def columns_of(*records):
    """Where the columns of some records stand in memory."""
    return {
        getattr(record, name).ctypes.data
        for record in records
        for name, field in record.schema.fields.items()
        if isinstance(field, Column) and len(getattr(record, name))
    }


@pytest.mark.parametrize("scene", ["gas2d", "fastgas"])
def test_a_steady_state_makes_no_columns(scene):
    with scenes.get(scene).build(Settings(collision="continuous"), 1, n=300) as world:
        state = world.physics.state
        for _ in range(60):
            world.step()
        records = (state.bodies, state.candidates, state.pairs, state.merged, state.impacts, state.grid)
        before = columns_of(*records)
        for _ in range(30):
            world.step()
        assert columns_of(*records) == before


def ball_above_a_box() -> tuple[World, int, int]:
    world = World(Physics(dimensions=2, gravity=(0.0, -9.81)))
    box = world.create_entity(Transform((0.0, -0.5)), AABBCollider(half_extents=(5.0, 0.5), restitution=0.5))
    world.create_entity(Transform((0.0, 1.0)), RigidBody(mass=1.0), SphereCollider(radius=0.5))
    world.step()
    return world, box, world.bodies.row_of(box)


@pytest.mark.parametrize("taken", ["before", "between"])
def test_static_rows_of_a_column_that_the_game_holds_are_read_in_each_step(taken):
    world, _, row = ball_above_a_box()
    with world:
        state, boxes = world.physics.state, world.physics.state.statics_version
        positions, inverse_masses = world.bodies.position, world.bodies.inverse_mass
        restitutions = world.bodies.aabb_collider.restitution
        if taken == "before":
            world.step()
        positions[row], inverse_masses[row], restitutions[row] = (40.0, 0.0), 1.0, np.nan
        with pytest.warns(PhysicsWarning, match="restitution is nan"):
            world.step()
        assert state.statics_version > boxes
        assert inverse_masses[row] == 0.0
