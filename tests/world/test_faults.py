"""How faults are told."""

from __future__ import annotations

import logging
import warnings

import esper
import numpy as np
import pytest
from helpers_steps import both_ways  # noqa: F401  every test with each
from worlds import make_world, mostly_2d

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import FaultError, PhysicsWarning, Settings, World
from carom.plugins import Physics
from carom.plugins.joints import Distance, Joints
from carom.plugins.parts import PartOf, Parts
from carom.plugins.rotation import BoxCollider, Rotation, Spin


def fast_body(world, x):
    """So fast that a discrete world may miss what it passes."""
    return world.create_entity(Transform((x, 0.0)), RigidBody(linear_velocity=(0.0, 1e5)), SphereCollider(0.1))


def crowded(on_fault):
    """More impacts than one body may have in a step, in each step."""
    world = make_world(2, collision="continuous", max_impacts_per_step=1, on_fault=on_fault)
    for k in range(10):
        world.create_entity(
            Transform((0.25 * k + 0.001 * k * k, 0.0)), RigidBody(linear_velocity=(40.0 * (5 - k), 0.0)),
            SphereCollider(0.1, restitution=1.0),
        )  # fmt: skip
    return world


def warnings_of(act):
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        act()
    assert all(warning.category is PhysicsWarning for warning in told)
    return told


def test_each_kind_of_fault_is_told_once_for_each_body():
    """Where the game calls, and nothing more while the same goes on, nor if a mended body breaks again."""
    world = make_world(2)
    bodies = [world.create_entity(Transform((x, 0)), RigidBody()) for x in (0, 5)]
    world.step()
    assert not warnings_of(world.step)
    world.bodies.linear_velocity[0] = np.nan
    (told,) = warnings_of(lambda: [world.step() for _ in range(3)])
    assert f"entity {bodies[0]}: linear_velocity is" in str(told.message)
    assert told.filename == __file__
    world.faults.clear()
    world.bodies.linear_velocity[0] = 0.0
    world.step()
    world.bodies.linear_velocity[0] = np.nan
    assert not warnings_of(world.step)
    assert world.faults
    world.bodies.mass[1] = -1.0
    assert [f"entity {bodies[1]}: mass is -1.0" in str(w.message) for w in warnings_of(world.step)] == [True]


def test_a_limit_reached_in_every_step_is_told_once_and_says_what_to_do():
    world = crowded("warn")
    told = warnings_of(lambda: [world.step() for _ in range(3)])
    assert len(told) == 1
    assert len(world.faults) == 1
    assert world.faults[0].endswith(" (3 times, steps 0 to 2)")
    assert "raise Settings.max_impacts_per_step or restitution_threshold, or use smaller steps;" in str(told[0].message)


def test_a_world_that_breaks_as_a_whole_does_not_fill_the_screen():
    world = make_world(2)
    world.create_entities(1000, Transform.many(np.zeros((1000, 2))), RigidBody.many())
    world.bodies.linear_velocity[:] = np.nan
    told = warnings_of(world.step)
    assert len(told) == 10
    assert "991 more faults" in str(told[-1].message)


def test_the_logger_gets_a_line(caplog):
    world = crowded("warn")
    with caplog.at_level(logging.WARNING, "carom"), pytest.warns(PhysicsWarning):
        world.step()
    assert [record.name for record in caplog.records if "impacts beyond" in record.message] == ["carom"]


@pytest.mark.parametrize("how", ["step", "advance", "esper"])
def test_raise_comes_at_the_end_of_a_step_that_is_complete(how):
    """The state is that of a world that ignores its faults, and the world goes on with the steps that were left."""
    loud, quiet = crowded("raise"), crowded("ignore")
    dt = loud.settings.dt

    def esper_step():
        with loud:
            esper.process(dt)

    act = {"step": loud.step, "advance": lambda: loud.advance(3.5 * dt), "esper": esper_step}[how]
    assert not warnings_of(quiet.step)
    wanted = r"step 0 of world .* impacts beyond 1 of a body in one step, the first of entity \d+:"
    with pytest.raises(FaultError, match=wanted):
        act()
    assert (loud.step_count, loud.time, loud.state_hash()) == (1, quiet.time, quiet.state_hash())
    assert loud.faults == quiet.faults
    if how == "advance":
        assert loud.clock.gathered == pytest.approx(2.5 * dt)
    loud.settings = loud.settings.replace(on_fault="ignore")
    loud.step()
    quiet.step()
    assert loud.state_hash() == quiet.state_hash()


def test_a_fault_that_is_an_error_by_a_filter_leaves_the_step_complete():
    world = make_world(2)
    fast_body(world, 0.0)
    fast_body(world, 5.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(PhysicsWarning, match="set its ccd"):
            world.step()
    assert world.step_count == 1


def test_systems_report_faults_of_their_own():
    world = make_world(2)
    world.report_fault("the map has a hole", kind="map")
    world.report_fault("the map has two holes", kind="map")
    assert [str(warning.message) for warning in warnings_of(world.step)] == ["the map has a hole"]
    assert world.faults == ["the map has two holes (2 times, step 0)"]


@mostly_2d
def test_what_has_nothing_to_pass_is_not_too_fast(d):
    """Alone, with a thin part, and tied to another one; and told as soon as there is a body that it may meet."""
    with World(Physics(dimensions=d), Rotation(), Parts(), Joints(), settings=Settings(on_fault="ignore")) as world:
        fast = RigidBody(linear_velocity=(0, 90, 0)[:d])
        body = world.create_entity(Transform((0, 0, 0)[:d]), fast, Spin(), BoxCollider(0.1))
        for more in (
            (), (PartOf(body, (0.5, 0, 0)[:d]), BoxCollider(0.02)),
            (Transform((1, 0, 0)[:d]), RigidBody(linear_velocity=(0, 90, 0)[:d]), Spin(), BoxCollider(0.1)),
        ):  # fmt: skip
            other = world.create_entity(*more)
            if len(more) == 4:
                world.create_entity(Distance(body, other))
            world.step()
            assert not world.faults
        world.create_entity(Transform((9, 0, 0)[:d]), AABBCollider(0.1))
        world.step()
        (fault,) = world.faults
        assert "so fast that discrete collisions may miss" in fault


@mostly_2d
@pytest.mark.parametrize(
    ("fast", "wall", "told"),
    [
        ({}, {}, True), ({"layer": 2}, {}, True), ({"layer": 2}, {"mask": 1}, False), ({"mask": 4}, {}, False),
        ({"mask": 4}, {"layer": 4}, True), ({"group": 3}, {"group": 3}, False), ({"group": 3}, {"group": 4}, True),
        ({"group": 3}, {"group": 3, "mask": 2}, False), ({"ccd": True}, {}, False),
    ],
)  # fmt: skip
def test_what_is_not_swept_is_too_fast_for_what_it_may_meet(d, fast, wall, told):
    """Whatever else is swept: another body with ccd meets all of them."""
    with make_world(d, on_fault="ignore") as world:
        fast, moving = dict(fast), {"linear_velocity": (90, 0, 0)[:d]}
        body = RigidBody(ccd=fast.pop("ccd", False), **moving)
        number = world.create_entity(Transform((0,) * d), body, SphereCollider(0.1, **fast))
        world.create_entity(Transform((0, 50, 0)[:d]), AABBCollider(0.1, **wall))
        for ccd in (None, True):
            if ccd:
                world.create_entity(Transform((0, 9, 0)[:d]), RigidBody(ccd=True), SphereCollider(0.1, mask=0))
            world.faults.clear()
            world.step()
            assert [f"entity {number}: so fast" in fault for fault in world.faults] == [True] * told
