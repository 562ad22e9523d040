"""Failing systems: the error names the system, the step is undone, and the world can continue."""

from __future__ import annotations

import itertools

import esper
import numpy as np
import pytest
from schedule.helpers_systems import PlainNote, in_phase
from worlds import ball, make_world

from carom.components import RigidBody, Transform
from carom.framework import CaromError, Component, ForceSystem, NoPhysicsError, Phase, StepError, System, column


class Fuel(Component):
    left = column(10.0)


class Health:
    points = 100


class Failing:
    """Changes everything, then raises."""

    def act(self, world):
        bodies = world.bodies
        for name in bodies.column_names():
            view = getattr(bodies, name)
            if view.flags.writeable and view.dtype == float:
                view += 1.0
        for _, health in world.get_component(Health):
            health.points -= 1
        raise RuntimeError("out of luck")


class FailingSystem(System, Failing):
    def process(self, dt):
        self.act(self.world)


class FailingForce(ForceSystem, Failing):
    def add_forces(self, bodies, time):
        self.act(self.world)


class FailingProcessor(esper.Processor, Failing):
    world = None

    def process(self, dt):
        self.act(self.world)


def damaged_world(integrator="semi_implicit_euler"):
    """A world with all kinds of state, after a few steps."""
    world = make_world(gravity=9.81, integrator=integrator)
    for x in range(4):
        e = ball(world, (0.95 * x, 0.5), (x, 0.0), restitution=0.5)
        world.add_component(e, Fuel(x))
        world.add_component(e, Health())
    ball(world, (0.0, -10.0), kind="static", radius=10.0)
    for _ in range(3):
        world.step()
    world.component_for_entity(1, RigidBody).apply_force((3.0, 0.0))
    return world


def columns(world):
    return {name: getattr(world.bodies, name).copy() for name in world.bodies.column_names()}


def failing(world, kind):
    if kind == "force system":
        bad = FailingForce()
    elif kind == "processor":
        bad = FailingProcessor()
        bad.world = world
    elif kind == "handler":
        bad = FailingSystem()
        world.on("contact_stay", lambda contact: bad.act(world))
        return None
    else:
        bad = in_phase(FailingSystem, Phase[kind])()
    world.add_system(bad)
    return bad


def same_columns(now, before):
    derived = {"force", "inverse_mass"}  # recomputed in every step
    for name in before.keys() - derived:
        np.testing.assert_array_equal(now[name], before[name], err_msg=name)
    return True


KINDS = ["START", "FORCES", "INTEGRATION", "BROAD", "NARROW", "RESPONSE", "END", "force system", "processor", "handler"]


@pytest.mark.parametrize(("kind", "how"), list(zip(KINDS, itertools.cycle(("step", "advance", "esper.process")))))
def test_an_error_leads_back_to_the_start_of_the_step(kind, how):
    world = damaged_world()
    undisturbed = damaged_world()
    bad = failing(world, kind)
    before, digest = columns(world), world.state_hash()
    clock = (world.time, world.step_count)
    touching = [(c.entity_a, c.entity_b, c.normal_impulse) for c in world.contacts]
    name = {"processor": "FailingProcessor", "force system": "FailingForce", "handler": "contact_stay"}.get(
        kind, "FailingSystem"
    )
    go = {"step": lambda dt: world.step(), "advance": world.advance, "esper.process": esper.process}[how]
    with pytest.raises(StepError, match=f"{name}.*RuntimeError: out of luck") as caught, world:
        go(world.settings.dt)
    assert isinstance(caught.value.__cause__, RuntimeError)
    assert world.state_hash() == digest
    assert same_columns(columns(world), before)
    assert (world.time, world.step_count) == clock
    assert [(c.entity_a, c.entity_b, c.normal_impulse) for c in world.contacts] == touching
    assert all(health.points < 100 for _, health in world.get_component(Health))  # user data is not restored
    if bad is None:
        return
    world.remove_system(bad)
    for w in (world, undisturbed):
        for _ in range(5):
            w.step()
    assert world.state_hash() == undisturbed.state_hash()  # as if nothing had happened
    assert [c.entity_b for c in world.contacts.begin] == [c.entity_b for c in undisturbed.contacts.begin]


def test_an_error_of_any_type_is_named():
    for error in (ValueError("v"), KeyError("k"), CaromError("c"), NoPhysicsError("n"), ZeroDivisionError("z")):
        world = make_world()

        class Bad(esper.Processor):
            def process(self, dt, error=error):
                raise error

        world.add_processor(Bad())
        with pytest.raises(StepError, match=f"system Bad failed in step 0 .*{type(error).__name__}"):
            world.step()


def test_an_interrupt_goes_through_as_it_is_and_undoes_the_step():
    world = make_world()
    e = ball(world, 0.0, 60.0)

    class Interrupt(System):
        def process(self, dt):
            raise KeyboardInterrupt

    interrupt = Interrupt()
    world.add_system(interrupt)
    with pytest.raises(KeyboardInterrupt):
        world.step()
    assert world.component_for_entity(e, Transform).x == 0.0
    world.remove_system(interrupt)
    world.step()
    assert world.component_for_entity(e, Transform).x == 1.0


def test_an_error_in_a_world_stepped_by_a_system_undoes_both():
    inner, outer = make_world(), make_world()
    ball(inner, 0.0, 60.0)
    ball(outer, 0.0, 60.0)
    inner.add_system(FailingSystem())

    class Inner(System):
        def process(self, dt):
            inner.step()

    outer.add_system(Inner())
    with pytest.raises(StepError):
        outer.step()
    for world in (inner, outer):
        assert world.bodies.position.tolist() == [[0.0, 0.0]]
        assert world.step_count == 0


def test_one_plain_processor_may_serve_two_worlds():
    log = []
    shared = PlainNote(log, "shared")
    worlds = [make_world() for _ in range(2)]
    for world in worlds:
        world.add_processor(shared)
        world.step()
    assert log == ["shared", "shared"]
    shared.log = None
    for world in worlds:
        e = ball(world, 0.0, 60.0)
        with pytest.raises(StepError, match=f"PlainNote failed .*{world.name}"):
            world.step()
        assert world.component_for_entity(e, Transform).x == 0.0
    worlds[0].close()
    shared.log = log
    worlds[1].step()
    assert len(log) == 3


def test_a_processor_added_within_a_plain_step_joins_at_its_end_and_its_failure_does_not_lock_the_world():
    world = make_world()
    e = ball(world, 0.0, 60.0)

    class Adds(System):
        phase = Phase.START

        def process(self, dt):
            if self.world.step_count == 0:
                bad = FailingProcessor()
                bad.world = self.world
                esper.add_processor(bad)

    world.add_system(Adds())
    with world:
        esper.process(world.settings.dt)
    assert world.component_for_entity(e, Transform).x == 1.0
    with world, pytest.raises(StepError, match="FailingProcessor"):
        esper.process(world.settings.dt)
    with world:
        esper.remove_processor(FailingProcessor)
        esper.remove_processor(Adds)
        esper.process(world.settings.dt)
    assert world.component_for_entity(e, Transform).x == 2.0
    assert world.step_count == 2


def test_what_a_force_system_requires_is_looked_at_where_it_is_added():
    class Wind(ForceSystem):
        requires = Fuel  # type: ignore[assignment]

    with make_world() as world, pytest.raises(TypeError, match=r"Wind\.requires must be a tuple of component types"):
        world.add_system(Wind())
