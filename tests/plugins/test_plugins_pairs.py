"""Pairs of plugins: missing pairs, late registration, and errors at run time."""

from __future__ import annotations

import math

import numpy as np
import pytest

from carom.components import RigidBody, SphereCollider, Transform
from carom.components.colliders import Collider
from carom.framework import Plugin, Settings, StepError, UnhandledPairError, World, column
from carom.framework.vectors import divided, length, scale
from carom.plugins import Physics

pytestmark = pytest.mark.plain


def lonely_plugin():
    plugin = Plugin("lonely")

    @plugin.shape(cost=2)
    class LonelyCollider(Collider):
        reach = column(positive=True)

        def bounds(shape, dimensions):
            return (shape.reach, shape.reach) if dimensions == 2 else (shape.reach, shape.reach, shape.reach)

    return plugin, LonelyCollider


_helpers = Plugin("helpers")


@_helpers.kernel
def first_axis(d):
    if len(d) == 2:
        return 1.0, 0.0
    return 1.0, 0.0, 0.0


def lonely_lonely(a, b, d):
    depth = a.reach + b.reach - length(d)
    normal = divided(d, length(d)) if length(d) > 0.0 else first_axis(d)
    return depth >= 0.0, depth, normal, scale(d, 0.5)


lonely_lonely_kernel = _helpers.kernel(lonely_lonely)


def test_a_pair_without_handler_is_an_error_with_both_shapes_and_the_ways_out():
    plugin, lonely = lonely_plugin()
    world = World(Physics(), plugin)
    a = world.create_entity(Transform((0, 0)), lonely(1.0))
    b = world.create_entity(Transform((9, 0)), RigidBody(), SphereCollider(1.0))
    message = (
        rf"LonelyCollider.* can meet in this world, entity {b} and entity {a} for instance, .*register it with "
        r"@plugin.pair, give LonelyCollider a support function, or keep them apart with layer and mask"
    )
    for _ in range(2):
        with pytest.raises(UnhandledPairError, match=message):
            world.step()
    assert world.step_count == 0
    world.component_for_entity(a, lonely).mask = 2  # now it meets no other body
    world.step()
    world.component_for_entity(a, lonely).mask = -1
    with pytest.raises(UnhandledPairError):
        world.step()
    world.delete_entity(b)
    world.step()
    world.close()


def test_what_stands_still_never_meets():
    plugin, lonely = lonely_plugin()
    world = World(Physics(), plugin)
    for place in ((0, 0), (0.5, 0)):
        world.create_entity(Transform(place), lonely(1.0))
    world.create_entity(Transform((0.5, 0)), SphereCollider(1.0))
    world.step()
    alone = world.create_entity(Transform((50, 0)), RigidBody(), lonely(1.0))
    with pytest.raises(UnhandledPairError, match=r"(Lonely|Sphere)Collider and \w+ can meet"):
        world.step()
    world.component_for_entity(alone, lonely).mask = 0
    world.step()
    world.close()


def test_registering_late_and_again_is_seen_at_the_next_step():
    plugin, lonely = lonely_plugin()
    world = World(Physics(), plugin)
    for x in (0.0, 1.5):
        world.create_entity(Transform((x, 0)), RigidBody(), lonely(1.0))
    with pytest.raises(UnhandledPairError):
        world.step()
    plugin.pair(lonely, lonely)(lonely_lonely)
    world.step()
    assert len(world.contacts) == 1

    def never(a, b, d):
        return False, -length(d) - 1.0, lonely_lonely_kernel(a, b, d)[2], d

    plugin.pair(lonely, lonely)(never)
    world.step()
    assert len(world.contacts) == 0
    world.close()


def test_a_plugin_may_join_later():
    plugin, lonely = lonely_plugin()
    plugin.pair(lonely, lonely)(lonely_lonely)
    world = World(Physics())
    world.create_entity(Transform((0, 0)), RigidBody(), lonely(1.0))
    with pytest.raises(UnhandledPairError, match="LonelyCollider is a collider that no plugin of this world"):
        world.step()
    world.add_plugin(plugin)
    world.step()
    assert plugin in world.plugins
    world.close()


def test_a_flat_shape_is_not_for_3d():
    plugin, _ = lonely_plugin()

    @plugin.shape(cost=2)
    class FlatCollider(Collider):
        dimensions = (2,)
        reach = column(positive=True)

        def bounds(shape, dimensions):
            return shape.reach, shape.reach

    world = World(Physics(dimensions=3), plugin)
    entity = world.create_entity(Transform((0, 0, 0)), FlatCollider(1.0))
    with pytest.raises(ValueError, match=f"entity {entity}: FlatCollider is a shape of 2D worlds, this world is 3D"):
        world.step()
    world.close()


def fragile_plugin():
    """Works for all inputs of the checks, and fails for sizes between."""
    plugin, fragile = lonely_plugin()

    @plugin.pair(fragile, fragile)
    def touchy(a, b, d):
        if 3.0 < max(a.reach, b.reach) < 4.0:
            raise ValueError("this size is too much")
        hit, depth, normal, point = lonely_lonely_kernel(a, b, d)
        return hit, (math.nan if 5.0 < max(a.reach, b.reach) < 6.0 else depth), normal, point

    return plugin, fragile


@pytest.mark.parametrize(
    ("size", "message"),
    [(3.5, "entities 2 and 3: ValueError: this size is too much"),
     (5.5, "entities 2 and 3 returned a contact that is not finite")],
)  # fmt: skip
def test_a_pair_that_fails_names_itself_and_the_step_is_undone(size, message):
    """Columns and clock are unchanged; without the culprit the world continues."""
    plugin, fragile = fragile_plugin()
    world = World(Physics(gravity=(0, -10)), plugin)
    bystander = world.create_entity(Transform((0, 50)), RigidBody(linear_velocity=(1, 0)), fragile(1.0))
    world.create_entity(Transform((0, 0)), RigidBody(), fragile(1.0))
    culprit = world.create_entity(Transform((1, 0)), RigidBody(), fragile(size))
    state = world.state_hash()
    with pytest.raises(StepError, match="plugin lonely: pair touchy of LonelyCollider and LonelyCollider") as caught:
        world.step()
    if size < 5:
        assert "ValueError: this size is too much" in str(caught.value)
    else:
        assert message.split(" ", 3)[3] in str(caught.value)
    assert f"entities {culprit - 1} and {culprit}" in str(caught.value)
    assert (world.step_count, world.state_hash()) == (0, state)
    world.delete_entity(culprit)
    world.step()
    assert world.component_for_entity(bystander, Transform).x == pytest.approx(1 / 60)
    world.close()


def test_a_sweep_that_fails_names_itself():
    """It works for all inputs of the checks, but for one size its time is out of range."""
    plugin, fragile = lonely_plugin()
    plugin.pair(fragile, fragile)(lonely_lonely)

    @plugin.sweep(fragile, fragile)
    def late(a, b, d, v):
        return (True, 2.0) if 5.0 < max(a.reach, b.reach) < 6.0 else (False, 0.0)

    world = World(Physics(), plugin, settings=Settings(collision="continuous"))
    first = world.create_entity(Transform((0, 0)), RigidBody(linear_velocity=(2000, 0)), fragile(1.0))
    second = world.create_entity(Transform((20, 0)), RigidBody(), fragile(5.5))
    state = world.state_hash()
    with pytest.raises(StepError, match=f"entities {first} and {second}: its sweep returned a time that is not from"):
        world.step()
    assert world.state_hash() == state
    world.close()


def odd_plugin(what):
    """A round shape that is wrong at a size which the checks do not test."""
    plugin = Plugin("odd")

    def bounds(shape, dimensions):
        reach = math.nan if what == "bounds" and shape.reach == 0.75 else shape.reach
        return (reach, reach) if dimensions == 2 else (reach, reach, reach)

    def support(shape, direction):
        return scale(direction, math.nan if what == "support" and shape.reach == 0.75 else 0.0)

    members = {"reach": column(positive=True), "bounds": bounds, "support": support}
    members["rounding"] = lambda shape: shape.reach
    return plugin, plugin.shape(cost=2)(type("OddCollider", (Collider,), members))


@pytest.mark.parametrize(
    ("what", "message"),
    [
        ("bounds", "plugin odd: bounds of OddCollider, entity 1 are not numbers from 0"),
        ("support", r"of OddCollider and SphereCollider \(support by plugin odd\), entities 1 and 2: .*not finite"),
    ],
)
@pytest.mark.parametrize("d", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_other_functions_of_a_shape_that_fail(what, message, d):
    plugin, odd = odd_plugin(what)
    world = World(Physics(dimensions=d), plugin)
    world.create_entity(Transform(np.zeros(d)), RigidBody(), odd(0.75))
    world.create_entity(Transform(0.5 * np.eye(d)[0]), RigidBody(), SphereCollider(0.5))
    with pytest.raises(StepError, match=message):
        world.step()
    assert world.step_count == 0
    world.close()
