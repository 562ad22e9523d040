"""Failing systems: the error names the system, and the world goes on; data/test_undo.py asks what it leaves behind."""

from __future__ import annotations

import esper
import pytest
from schedule.helpers_systems import PlainNote
from worlds import ball, make_world

from carom.components import RigidBody, Transform
from carom.framework import CaromError, ForceSystem, NoPhysicsError, Phase, StepError, System


class FailingProcessor(esper.Processor):
    def process(self, dt):
        raise RuntimeError("out of luck")


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
    inner.add_processor(FailingProcessor())

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
                esper.add_processor(FailingProcessor())

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
        requires = RigidBody  # type: ignore[assignment]

    with make_world() as world, pytest.raises(TypeError, match=r"Wind\.requires must be a tuple of component types"):
        world.add_system(Wind())
