"""How much work a step does, counted: looks for impacts, memory, copies. No times."""

from __future__ import annotations

import numpy as np
import pytest

from carom import scenes
from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import PhysicsWarning, Settings, StepError, World
from carom.framework.jit.records.schema import Column
from carom.plugins import Physics, convex_polygon, half_space
from carom.plugins.convex_polygon import ConvexPolygonCollider
from carom.plugins.half_space import HalfSpaceCollider
from carom.systems.codes import CHECK_FLIGHT


def test_looks_for_impacts_of_fast_bodies():
    """Each impact is followed by a look at the pairs of two bodies, and a new search by one at the pairs that are new:
    13 looks an impact; where each search looked at all pairs again it was 37."""
    with scenes.get("fastgas").build(Settings(collision="continuous"), 1, n=300) as world:
        state = world.physics.state
        for _ in range(30):
            world.step()
        assert state.refreshes_counted > 100
        assert state.impacts_counted > 10_000
        assert state.looks_counted < 17 * state.impacts_counted


def test_looks_of_a_slow_gas():
    """A look at each contact, and after its impact at the pairs of both bodies."""
    with scenes.get("gas2d").build(Settings(), 1, n=1000) as world:
        for _ in range(30):
            world.step()
        state = world.physics.state
        assert state.impacts_counted > 1000
        assert state.looks_counted < 4 * state.impacts_counted


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


@pytest.mark.parametrize(("scene", "steps", "options"), [("pyramid", 500, {}), ("pile2d", 900, {"n": 200})])
def test_a_pair_at_rest_is_evaluated_once_a_step(scene, steps, options):
    """Where the step starts; all that follows reads this manifold. Those that are near but do not touch: twice more."""
    with settled(scene, steps, **options) as world:
        pairs = world.physics.state.pairs
        evaluations = evaluations_of_a_step(world)
        assert pairs.touching_count > 0.85 * pairs.count
        assert pairs.count <= evaluations <= pairs.count + 2 * (pairs.resting_count - pairs.touching_count)


def test_a_pair_at_rest_that_is_a_plugins_is_evaluated_once_a_step():
    """Also on a slope, and if it may bounce."""
    world = World(Physics(dimensions=2, gravity=(0.0, -10.0)), half_space.plugin, convex_polygon.plugin)
    world.create_entity(Transform((0.0, 0.0)), HalfSpaceCollider((-0.1, 1.0), friction=1.0))
    world.create_entity(
        Transform((0.0, 0.5)), RigidBody(mass=1.0),
        ConvexPolygonCollider([(-0.5, -0.45), (0.5, -0.55), (0.4, 0.5)], restitution=0.2, friction=1.0),
    )  # fmt: skip
    with world:
        for _ in range(300):
            world.step()
        assert world.physics.state.pairs.resting_count == 1
        assert evaluations_of_a_step(world) == 1


def test_a_pile_that_settles_is_evaluated_at_most_twice_a_step():
    """Where the step starts and where it ends; and pairs near each other where free flight leads."""
    with settled("pile2d", 180, n=200) as world:
        pairs = world.physics.state.pairs
        total = sum(evaluations_of_a_step(world) for _ in range(10))
        assert total < 10 * 2.3 * pairs.count


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


def free_world():
    world = World(Physics(gravity=(0, -10)))
    for k in range(5):
        world.create_entity(Transform((k, 0)), RigidBody(linear_velocity=(k, 1)))
    world.step()
    return world


def test_a_world_without_colliders_keeps_its_velocities_once():
    with free_world() as world:
        state = world.physics.state
        state.bodies.kept_velocity[:] = 7.0
        world.step()
        assert (state.bodies.kept_velocity == 7.0).all()
        assert not state.velocity_kept


def test_a_failed_step_without_colliders_is_put_back():
    """It fails after the flight, when positions and velocities are those of the end of the step."""
    with free_world() as world:
        world.bodies.position[0], world.bodies.linear_velocity[0] = (1e20, 0), (5, 1)  # so far out it cannot move
        before = {name: np.array(getattr(world.bodies, name)) for name in ("position", "linear_velocity")}
        previous = world.physics.state.bodies.previous_position[:5].copy()

        def fail(dt):
            raise RuntimeError("as asked")

        world.physics.program.handlers[CHECK_FLIGHT] = fail
        with pytest.raises(StepError, match="as asked"):
            world.step()
        for name, values in before.items():
            np.testing.assert_array_equal(getattr(world.bodies, name), values)
        np.testing.assert_array_equal(world.physics.state.bodies.previous_position[:5], previous)


def test_what_the_check_of_the_flight_has_seen_is_not_looked_for_again():
    """And what goes wrong is seen all the same."""
    with free_world() as world:
        state = world.physics.state
        assert state.flight_usual
        assert state.finite
        world.bodies.position[0] = (1e12, 0)
        world.step()
        assert not state.flight_usual
        assert state.finite


def ball_above_a_box() -> tuple[World, int, int]:
    world = World(Physics(dimensions=2, gravity=(0.0, -9.81)))
    box = world.create_entity(Transform((0.0, -0.5)), AABBCollider(half_extents=(5.0, 0.5), restitution=0.5))
    world.create_entity(Transform((0.0, 1.0)), RigidBody(mass=1.0), SphereCollider(radius=0.5))
    world.step()
    return world, box, world.bodies.row_of(box)


def test_static_rows_are_not_read_again_while_nothing_can_have_written_them():
    """What is written into the table past all that code of the game can reach is not seen: no stage has looked."""
    world, box, row = ball_above_a_box()
    with world:
        table, state = world.physics.table, world.physics.state
        boxes = state.statics_version
        table.arrays["position"][row] = 40.0
        table.arrays["inverse_mass"][row] = 1.0
        table.arrays["aabb_collider.restitution"][row] = np.nan
        for _ in range(5):
            world.step()
        assert state.statics_version == boxes
        assert state.bodies.inverse_mass[row] == 1.0
        assert not world.faults
        world.component_for_entity(box, Transform).rotation = 0.0  # any assignment to a static body
        with pytest.warns(PhysicsWarning, match="restitution is nan"):
            world.step()
        assert state.statics_version > boxes
        assert state.bodies.inverse_mass[row] == 0.0


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


def test_memory_of_impacts_covers_rows_that_become_static():
    """Impacts are counted for what moves; a body that has had some, and is static now, has none."""
    world, _, _ = ball_above_a_box()
    with world:
        body = world.create_entity(
            Transform((3.0, 0.45)), RigidBody(mass=1.0, linear_velocity=(0.0, -5.0)),
            SphereCollider(radius=0.5, restitution=1.0),
        )  # fmt: skip
        world.step()
        state = world.physics.state
        assert state.bodies.impact_count[world.bodies.row_of(body)] == 1
        world.component_for_entity(body, RigidBody).kind = "static"
        world.step()
        assert not state.bodies.impact_count[state.moving : state.count].any()
