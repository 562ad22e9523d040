"""Plugin functions at work: pairs, rules, filters, broad phases, integrators, systems; errors at run time."""

from __future__ import annotations

import math

import numpy as np
import pytest

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.components.colliders import Collider
from carom.framework import Plugin, Settings, StepError, System, UnhandledPairError, World, column
from carom.framework.vectors import divided, length, scale
from carom.plugins import Physics
from carom.plugins.standard_sweeps import ball
from carom.systems import Integrator

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
    world.component_for_entity(a, lonely).group = world.component_for_entity(b, SphereCollider).group = -5
    world.step()
    world.component_for_entity(a, lonely).group = 5
    with pytest.raises(UnhandledPairError):
        world.step()
    world.delete_entity(b)
    world.step()


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


def test_a_sweep_that_fails_names_itself():
    """It works for all inputs of the checks, but for one size its time is out of range."""
    plugin, fragile = lonely_plugin()
    plugin.pair(fragile, fragile)(lonely_lonely)

    @plugin.sweep(fragile, fragile)
    def late(a, b, d, v):
        return (True, 2.0) if 5.0 < max(a.reach, b.reach) < 6.0 else ball(d, v, a.reach + b.reach)

    world = World(Physics(), plugin, settings=Settings(collision="continuous"))
    first = world.create_entity(Transform((0, 0)), RigidBody(linear_velocity=(2000, 0)), fragile(1.0))
    second = world.create_entity(Transform((20, 0)), RigidBody(), fragile(5.5))
    state = world.state_hash()
    with pytest.raises(StepError, match=f"entities {first} and {second}: its sweep returned a time that is not from"):
        world.step()
    assert world.state_hash() == state


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


def test_an_integrator_registered_again_is_seen_at_the_next_step():
    plugin = Plugin("steppers")

    class Still(Integrator):
        order, evaluations = 1, 1

        def advance(self, motion, dt):
            pass

    class Ahead(Still):
        def advance(self, motion, dt):
            motion.position[:, 0] += 1.0

    plugin.integrator("mine")(Still)
    world = World(Physics(), plugin, settings=Settings(integrator="mine"))
    body = world.create_entity(Transform((0, 0)), RigidBody(linear_velocity=(1, 0)))
    world.step()
    assert world.component_for_entity(body, Transform).x == 0.0
    plugin.integrator("mine")(Ahead)
    world.step()
    assert world.component_for_entity(body, Transform).x == 1.0


def approaching(world, distance=1.9, **collider):
    for x, speed in ((0.0, 1.0), (distance, -1.0)):
        world.create_entity(
            Transform((x, 0)), RigidBody(linear_velocity=(speed, 0)), SphereCollider(1.0, restitution=1.0, **collider)
        )


def test_a_mixing_rule_of_a_plugin():
    """Both have e = 1, the rules make .25 and 0 of it: relative speed after / before."""
    plugin = Plugin("rules")
    plugin.mixing_rule("quarter")(lambda x, y: 0.125 * (x + y))
    plugin.mixing_rule("nothing")(lambda x, y: 0.0)
    for rule, e in (("quarter", 0.25), ("nothing", 0.0)):
        with World(Physics(), plugin, settings=Settings(restitution_mixing=rule, restitution_threshold=0.0)) as world:
            approaching(world, 2.01)
            world.step()
            world.step()
            np.testing.assert_allclose(world.bodies.linear_velocity[:, 0], (-e, e), rtol=1e-12, atol=1e-12)
    with pytest.raises(ValueError, match=r"Settings.restitution_mixing must be one of average, .*, got 'quarter'"):
        World(Physics(), settings=Settings(restitution_mixing="quarter"))
    with pytest.raises(ValueError, match=r"Settings.friction_mixing must be one of"):
        World(Physics(), plugin, settings=Settings(friction_mixing="third"))


def test_a_filter_decides_which_bodies_may_meet():
    plugin = Plugin("teams")
    seen = []

    @plugin.pair_filter
    def not_of_one_team(bodies, a, b):
        seen.extend(zip(bodies.entity[a].tolist(), bodies.entity[b].tolist(), strict=True))
        return bodies.entity[a] % 2 != bodies.entity[b] % 2

    world = World(Physics(), plugin)
    for x in (0.0, 0.5, 1.0):
        world.create_entity(Transform((x, 0)), RigidBody(), SphereCollider(1.0))
    world.step()
    assert seen == [(1, 2), (1, 3), (2, 3)]
    assert list(zip(world.contacts.entity_a, world.contacts.entity_b, strict=True)) == [(1, 2), (2, 3)]


@pytest.mark.parametrize("answer", [None, np.ones(7, bool), np.ones(1), True])
def test_a_filter_answers_for_each_pair(answer):
    plugin = Plugin("teams")

    @plugin.pair_filter
    def vague(bodies, a, b):
        return answer

    world = World(Physics(), plugin)
    approaching(world)
    with pytest.raises(StepError, match="plugin teams: pair filter vague must return an array of 1 bool"):
        world.step()
    assert world.step_count == 0


class AllPairs:
    """Every pair of overlapping boxes, by brute force."""

    def pairs(self, lower, upper, moving):
        touching = (lower[:, None] <= upper).all(axis=2) & (lower <= upper[:, None]).all(axis=2)
        first, second = np.nonzero(np.triu(touching, 1))
        return first[first < moving], second[first < moving]


@pytest.mark.compiled
def test_a_broad_phase_of_a_plugin_finds_the_same():
    """The same bits as with carom's own."""
    plugin = Plugin("plain")
    plugin.broad_phase("all pairs")(AllPairs)
    hashes = []
    for settings in (Settings(), Settings(broad_phase="all pairs")):
        world = World(Physics(gravity=(0, -5)), plugin, settings=settings)
        rng = np.random.default_rng(3)
        world.create_entity(Transform((0, -1)), AABBCollider((50, 1)))
        world.create_entities(
            60, Transform.many(rng.uniform(0, 12, (60, 2))), RigidBody.many(), SphereCollider.many(radius=0.5)
        )
        for _ in range(60):
            world.step()
        assert ("all pairs, as the settings say" in str(world.plan())) == (settings.broad_phase != "automatic")
        hashes.append(world.state_hash())
    assert hashes[0] == hashes[1]


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (None, "must return two arrays of rows"),
        ((np.zeros(2), np.zeros(2)), "two integer arrays of one length"),
        ((np.array([0]), np.array([5])), "returned rows 0 and 5: a pair is of two of the 2 rows"),
        ((np.array([1]), np.array([1])), "returned rows 1 and 1"),
    ],
)
def test_a_broad_phase_that_answers_nonsense(answer, message):
    plugin = Plugin("plain")

    @plugin.broad_phase("strange")
    class Strange:
        def pairs(self, lower, upper, moving):
            return answer

    world = World(Physics(), plugin, settings=Settings(broad_phase="strange"))
    approaching(world)
    with pytest.raises(StepError, match=f"broad phase 'strange' .*{message}"):
        world.step()


def test_each_world_gets_its_own_system():
    plugin = Plugin("counting")

    @plugin.system
    class Counter(System):
        steps = 0

        def process(self, dt):
            self.steps += 1

    worlds = [World(Physics(), plugin), World(Physics(), plugin)]
    for _ in range(3):
        worlds[0].step()
    worlds[1].step()
    found = [[s for s in world.systems if isinstance(s, Counter)] for world in worlds]
    assert [[s.steps for s in systems] for systems in found] == [[3], [1]]


def test_a_mixing_rule_that_fails_in_a_step():
    plugin = Plugin("rules")
    plugin.mixing_rule("odd")(lambda x, y: math.nan if x == 0.7 else x * y)
    world = World(Physics(), plugin, settings=Settings(restitution_mixing="odd"))
    for x, speed in ((0.0, 1.0), (1.9, -1.0)):
        world.create_entity(
            Transform((x, 0)), RigidBody(linear_velocity=(speed, 0)), SphereCollider(1.0, restitution=0.7)
        )
    with pytest.raises(StepError, match="a mixing rule of a plugin returned no number from 0"):
        world.step()
    assert np.isfinite(world.bodies.position).all()


def test_a_plugin_joins_whole_or_not_at_all():
    plugin = Plugin("half")

    @plugin.system
    class Good(System):
        def process(self, dt):
            pass

    @plugin.system
    def broken():
        raise RuntimeError("no display")

    world = World(Physics())
    for _ in range(2):
        with pytest.raises(RuntimeError, match="no display") as caught:
            world.add_plugin(plugin)
        assert caught.value.__notes__ == ["plugin half"]
    assert not any(isinstance(system, Good) for system in world.systems)
    assert plugin not in world.plugins
    world.step()


def test_a_system_registered_late_joins_the_worlds_that_run():
    plugin = Plugin("late")
    world = World(Physics(), plugin)
    world.step()
    steps = []

    @plugin.system
    class Late(System):
        def process(self, dt):
            steps.append(dt)

    world.step()
    assert len(steps) == 1
