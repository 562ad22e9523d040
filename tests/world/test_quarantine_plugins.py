"""Columns of plugins' components: a value that cannot be names its field and entity, and what is mended goes on."""

from __future__ import annotations

import math

import pytest
from worlds import ball, position, run

from carom import (
    AABBCollider,
    Field,
    Path,
    Paths,
    Physics,
    RigidBody,
    Timer,
    Timers,
    Transform,
    Water,
    Wind,
    World,
    Zones,
)

pytestmark = pytest.mark.plain


def write(world, entity, component, name, value):
    getattr(getattr(world.bodies, component), name)[world.bodies.row_of(entity)] = value


@pytest.mark.parametrize(
    ("zone", "name", "value"),
    [
        (Water(1.0), "water.density", math.nan), (Water(1.0), "water.density", -1.0),
        (Water(1.0), "water.drag", -1.0), (Water(1.0, flow=(1.0, 0)), "water.flow", math.nan),
        (Wind((1.0, 0)), "wind.force", math.nan), (Field(3.0), "field.strength", math.inf),
        (Field(3.0), "field.core", 0.0), (Field(3.0), "field.falloff", -1.0),
    ],
)  # fmt: skip
def test_a_zone_is_named_and_not_what_is_in_it(zone, name, value):
    world = World(Physics(2), Zones())
    place = world.create_entity(Transform((0, 0)), AABBCollider((9, 9), sensor=True), zone.copy())
    inside = ball(world, (1.0, 0), (2.0, 0))
    write(world, place, *name.split("."), value)
    run(world, 30)
    (fault,) = world.faults
    assert fault.startswith(f"entity {place}: {name} is ")
    assert position(world, inside)[0] == pytest.approx(2.0)
    write(world, place, *name.split("."), getattr(zone, name.split(".")[1]))
    before = world.component_for_entity(inside, RigidBody).linear_velocity.copy()
    run(world, 2)
    assert (world.component_for_entity(inside, RigidBody).linear_velocity != before).any()


@pytest.mark.parametrize("value", [math.nan, math.inf, -1.0])
def test_what_follows_a_path_stands_still_until_its_speed_is_mended(value):
    world = World(Physics(2), Paths())
    lift = world.create_entity(Transform((0, 0)), RigidBody(kind="kinematic"), Path([(0, 0), (5, 0)], speed=1.5))
    run(world, 10)
    write(world, lift, "path", "speed", value)
    run(world, 5)
    (fault,) = world.faults
    assert fault.startswith(f"entity {lift}: path.speed is ")
    assert position(world, lift)[0] == pytest.approx(0.25)
    write(world, lift, "path", "speed", 1.5)
    run(world, 10)
    assert position(world, lift)[0] == pytest.approx(0.5)


@pytest.mark.parametrize("value", [math.nan, 0.0, -1.0])
def test_a_timer_waits_until_its_seconds_are_mended(value):
    world, log = World(Physics(2), Timers()), []
    bomb = world.create_entity(Transform((0, 0)), RigidBody(), Timer(0.25, repeat=True))
    world.on("timer", lambda entity, timer: log.append(world.step_count))
    run(world, 10)
    write(world, bomb, "timer", "seconds", value)
    run(world, 10)
    (fault,) = world.faults
    assert fault.startswith(f"entity {bomb}: timer.seconds is ")
    write(world, bomb, "timer", "seconds", 0.25)
    run(world, 30)
    assert log == [20, 29, 44]
