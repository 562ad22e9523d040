"""What only a plugin's systems use: components, events and records that worlds know as soon as they take it."""

from __future__ import annotations

import numpy as np
import pytest

from carom.components import RigidBody, Transform
from carom.framework import Component, NoPhysicsError, Phase, Plugin, PluginError, StepError, System, World, column
from carom.framework.jit.records.schema import Schema, flag, floats, number
from carom.plugins import Physics

pytestmark = pytest.mark.plain


class Fuse(Component):
    left = column(2.0, unit="s")


def bombs(**more):
    """Counts down in a column, tells of it in an event, and sums in a record."""
    plugin = Plugin("bombs", version="1.0", needs_physics=True)
    plugin.component(Fuse)
    plugin.event("bang", "fizzle")
    heat = plugin.record(Schema("Heat", total=number(), hot=flag(), trace=floats()))

    @plugin.system
    class Burn(System):
        phase = Phase.START

        def on_add(self, world):
            self.heat, self.columns = world.record(heat), world.bodies.fuse.left
            self.heat.reserve(3, "trace")

        def process(self, dt):
            fuse = self.world.bodies.fuse
            fuse.left -= dt
            self.heat.total += dt
            self.heat.hot = True
            self.heat.trace[0] -= dt
            for entity in self.world.bodies.entity[self.world.bodies.has(Fuse) & (fuse.left < 0)].tolist():
                self.world.dispatch_event("bang", entity)

    return plugin, heat


def test_a_world_knows_them_as_soon_as_it_takes_the_plugin(tmp_path):
    plugin, heat = bombs()
    with World(Physics(2), plugin) as world:
        seen = []
        world.on("bang", seen.append)
        assert world.bodies.fuse.left.shape == (0,)
        assert plugin.adds() == {
            "components": ["Fuse"], "events": ["bang", "fizzle"], "records": ["Heat"], "systems": ["Burn"],
        }  # fmt: skip
        world.save(tmp_path / "empty")
        one = world.create_entity(Transform((0, 0)), RigidBody(), Fuse(left=2.5 * world.settings.dt))
        two = world.create_entity(Transform((9, 0)), RigidBody())
        world.step()
        snapshot, kept = world.snapshot(), [world.record(heat).total, world.record(heat).trace.tolist()]
        world.save(tmp_path / "game")
        for _ in range(2):
            world.step()
        assert seen == [one]
        later = world.bodies.fuse.left.tolist(), world.record(heat).total
        world.restore(snapshot)
        assert [world.record(heat).total, world.record(heat).trace.tolist()] == kept
        with World.load(tmp_path / "game", Physics(2), bombs()[0]) as other:
            heat_there = other.record(other.plugins[1].records["Heat"])
            for each, record in ((world, world.record(heat)), (other, heat_there)):
                assert record.hot is True
                for _ in range(2):
                    each.step()
                assert (each.bodies.fuse.left.tolist(), record.total) == later
            assert not other.bodies.has(Fuse)[other.bodies.row_of(two)]
        World.load(tmp_path / "empty", Physics(2), bombs()[0]).close()


def test_also_what_is_declared_or_taken_later():
    plugin = Plugin("late")
    with World(plugin, Physics(2)) as world, World(Physics(3)) as other, World(plugin) as bare:
        plugin.component(Fuse)
        plugin.event("bang")
        other.add_plugin(plugin)
        for each in (world, other, bare):
            each.on("bang", print)
        assert world.bodies.fuse.left.shape == other.bodies.fuse.left.shape == (0,)
        world.create_entity(Fuse(left=1.0))
        world.step()
        assert len(world.bodies) == 0  # it is no body

        class Declare(System):
            def process(self, dt):
                plugin.component(type("Wick", (Component,), {"length": column(1.0)}))

        world.add_system(Declare())
        with pytest.raises(Exception, match="component Wick can be registered between steps only"):
            world.step()
        assert list(plugin.declared) == [Fuse] == list(world.registry.declared)


def test_what_a_world_cannot_have_is_refused_and_changes_nothing():
    plugin, _ = bombs()
    with pytest.raises(NoPhysicsError, match=r"plugin bombs needs physics before it: World\(Physics\(...\), plugin\)"):
        World(plugin, Physics(2))
    with World(Physics(2), plugin) as world:
        for register, message in (
            (
                lambda other: other.component(Fuse),
                "plugin others: component Fuse is registered already, by plugin bombs",
            ),
            (lambda other: other.event("bang"), "plugin others: event bang is registered already, by plugin bombs"),
            (lambda other: other.event("impact"), "plugin others: event impact is one of carom's own names"),
            (lambda other: other.record(Schema("Heat", x=number())), "record Heat is registered already"),
            (
                lambda other: other.component(type("Mass", (Component,), {"kilos": column(1.0)})),
                "bodies have mass already",
            ),
        ):
            other = Plugin("others")
            register(other)
            with pytest.raises(PluginError, match=message):
                world.add_plugin(other)
            assert [each.name for each in world.plugins] == ["physics", "bombs"]
            late = Plugin("others")
            world.add_plugin(late)
            with pytest.raises(PluginError, match=message):
                register(late)
            assert not late.adds()
            world.registry.drop(late)
            world.plugins = world.plugins[:-1]
        assert not world.registry.declare.__self__.physics.table.in_step
        world.create_entity(Transform((0, 0)), RigidBody(), Fuse())
        world.step()
        assert np.isclose(world.bodies.fuse.left[0], 2.0 - world.settings.dt)


def test_functions_run_before_and_after_a_step_and_what_they_raise_undoes_it():
    plugin, said = Plugin("around"), []
    plugin.before_step(lambda world: said.append(("before", world.step_count)))

    @plugin.after_step
    def end(world):
        said.append(("after", world.bodies.position[0, 0]))
        if world.step_count == 1:
            raise ValueError("not this one")

    with World(Physics(dimensions=2), plugin) as world:
        world.create_entity(Transform((0, 0)), RigidBody(linear_velocity=(60, 0)))
        world.on("contact_begin", lambda *_: None)  # code of the game
        world.step()
        assert said == [("before", 0), ("after", pytest.approx(1.0))]
        with pytest.raises(StepError, match="not this one"):
            world.step()
        assert world.step_count == 1
        assert world.bodies.position[0, 0] == pytest.approx(1.0)
    with pytest.raises(PluginError, match=r"plugin around: after_step takes a function \(world\), got 3"):
        plugin.after_step(3)
