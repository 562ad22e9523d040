"""Other plugin functions at work in a world: rules, filters, broad phases, integrators, systems."""

from __future__ import annotations

import math

import numpy as np
import pytest

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Plugin, Settings, StepError, System, World
from carom.plugins import Physics
from carom.systems import Integrator

pytestmark = pytest.mark.plain


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
    world.close()


def approaching(world, distance=1.9, **collider):
    for x, speed in ((0.0, 1.0), (distance, -1.0)):
        world.create_entity(
            Transform((x, 0)), RigidBody(linear_velocity=(speed, 0)), SphereCollider(1.0, restitution=1.0, **collider)
        )


def test_a_mixing_rule_of_a_plugin():
    """Both have e = 1, the rule makes .25 of it: relative speed after / before."""
    plugin = Plugin("rules")
    plugin.mixing_rule("quarter")(lambda x, y: 0.125 * (x + y))
    world = World(Physics(), plugin, settings=Settings(restitution_mixing="quarter", restitution_threshold=0.0))
    approaching(world, 2.01)
    world.step()
    world.step()
    np.testing.assert_allclose(world.bodies.linear_velocity[:, 0], (-0.25, 0.25), rtol=1e-12)
    world.close()
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
    world.close()


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
    world.close()


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
        world.close()
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
    world.close()


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
    for world in worlds:
        world.close()


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
    world.close()


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
    world.close()


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
    world.close()
