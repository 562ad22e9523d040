"""Records of a plugin's own, which its stages share with Python: numbers, and columns that grow within a step."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_steps import both_ways  # noqa: F401  every test with each

from carom.components import RigidBody, SphereCollider, Transform
from carom.framework import NoPhysicsError, Plugin, PluginError, Settings, World
from carom.framework.jit.records.schema import Schema, flag, integer, ints, number, vectors
from carom.framework.vectors import add
from carom.plugins import Physics

WIND = Schema("Wind", strength=number(), blows=flag(), calls=integer())
TRACE = Schema("Trace", count=integer(), calls=integer(), row=ints(), place=vectors(), mark=ints())


def steady():
    """A wind along x whose strength Python sets."""
    plugin = Plugin("wind")

    @plugin.stage(after="sum_forces", records=(WIND,), writes=("force",))
    def blow(state, dt, wind):
        wind.calls += 1
        for i in range(state.force_first, state.dynamic if wind.blows else 0):
            x, y = state.bodies.force[i]
            state.bodies.force[i] = x + wind.strength, y

    return plugin


def world_of(*plugins, count=1, **settings):
    world = World(Physics(dimensions=2), *plugins, settings=Settings(**settings))
    world.create_entities(count, Transform.many(np.arange(2.0 * count).reshape(count, 2)), RigidBody.many())
    return world


def test_each_world_has_its_own_numbers_which_python_sets():
    plugin = steady()
    with world_of(plugin, dt=0.5) as one, world_of(plugin, dt=0.5) as two:
        one.record(WIND).strength = 4.0
        one.record(WIND).blows = True
        for world in (one, two):
            for _ in range(3):
                world.step()
            world.create_entity(Transform((5, 5)), RigidBody(), SphereCollider(1.0))
            world.step()
        assert one.bodies.linear_velocity[0].tolist() == [8.0, 0.0]
        assert not two.bodies.linear_velocity.any()
        assert one.record(WIND).calls == two.record(WIND).calls == 4


def tracing(place):
    """Notes where each body is, as many as there are."""
    plugin = Plugin("trace")

    @plugin.stage(after=place, records=(TRACE,), reads=("position",))
    def note(state, dt, trace):
        trace.calls += 1
        trace.count = 0
        for i in range(state.first, state.dynamic):
            if trace.count < min(len(trace.row), len(trace.place)):
                trace.row[trace.count], trace.place[trace.count] = i, state.bodies.position[i]
            trace.count += 1
        return trace.count

    @plugin.stage(before="close_step", records=(TRACE,), writes=("position",))
    def put(state, dt, trace):
        for k in range(trace.count):
            state.bodies.position[trace.row[k]] = add(trace.place[k], (0.0, 1.0))

    return plugin


@pytest.mark.parametrize("place", ["keep_start", "put_back"])
def test_columns_get_the_rows_that_a_stage_asks_for_within_the_step(place):
    """The other stage uses all of them in the same step; what has room runs once; what was in the rows stays."""
    with world_of(tracing(place), count=3) as world:
        trace, expected = world.record(TRACE), world.bodies.position.copy()
        for count, calls in ((3, 2), (3, 3), (1000, 5), (1000, 6)):
            if count > len(expected):
                more = np.arange(2.0 * (count - len(expected))).reshape(-1, 2)
                world.create_entities(len(more), Transform.many(more), RigidBody.many())
                expected = np.concatenate((expected, more))
            world.step()
            expected[:, 1] += 1.0
            np.testing.assert_array_equal(world.bodies.position, expected)
            assert (trace.count, trace.calls) == (count, calls)
            np.testing.assert_array_equal(trace.row[:count], np.arange(count))
            trace.mark[:3] = trace.mark[:3] + 1 if calls > 2 else 0
        assert trace.mark[:3].tolist() == [3, 3, 3]


def no_rows(state, dt, wind):
    return 3


def some_path(state, dt, trace):
    if trace.count:
        return 3


@pytest.mark.parametrize(("function", "record"), [(no_rows, WIND), (some_path, TRACE)])
def test_only_what_can_get_rows_asks_for_them(function, record):
    with pytest.raises(PluginError, match=f"stage {function.__name__} must return nothing; one with a record of its"):
        Plugin("wrong").stage(after="put_back", records=(record,))(function)


def test_a_world_without_physics_has_no_records():
    with World(steady()) as world, pytest.raises(NoPhysicsError):
        world.record(WIND)
