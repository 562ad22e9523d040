"""Systems: phases and their order, before and after, plain processors, and one phase alone."""

from __future__ import annotations

import esper
import pytest
from helpers_systems import A, B, C, Note, PlainNote, in_phase
from worlds import ball, make_world

from carom.components import Transform
from carom.framework import CaromError, Phase, ScheduleError, System
from carom.systems import BroadPhase, ContactEvents, ForceAccumulation, Integration, NarrowPhase, Response

pytestmark = pytest.mark.plain

BUILT_IN = {
    Phase.FORCES: "ForceAccumulation",
    Phase.INTEGRATION: "Integration",
    Phase.BROAD: "BroadPhase",
    Phase.NARROW: "NarrowPhase",
    Phase.RESPONSE: "Response",
}


def order(world):
    return [system.name for system in world.systems]


def trace(world, log):
    """Make every built-in system write its name into the log when it runs."""
    for system in world.systems:
        if type(system).__module__.startswith("carom."):
            inner = system.process

            def process(dt, inner=inner, name=system.name):
                log.append(name)
                inner(dt)

            system.process = process
    return log


def test_the_built_in_systems_are_esper_processors_in_the_order_of_the_step():
    world = make_world()
    expected = [ForceAccumulation, Integration, BroadPhase, NarrowPhase, Response, ContactEvents]
    with world:
        found = [esper.get_processor(system) for system in expected]
    assert [type(system) for system in found] == expected
    assert world.systems == found
    priorities = [system.priority for system in found]
    assert priorities == sorted(priorities, reverse=True)
    for system in found:
        assert system.phase.priority - 1000 < system.priority < system.phase.priority
    assert [phase.priority for phase in Phase] == [7000, 6000, 5000, 4000, 3000, 2000, 1000]


@pytest.mark.parametrize("phase", list(Phase))
def test_a_system_runs_in_its_phase_after_the_built_in_one(phase):
    world, log = make_world(), []
    world.add_system(in_phase(A, phase)(log, phase.name))
    trace(world, log)
    world.step()
    expected = []
    for p in Phase:
        expected += [BUILT_IN[p]] if p in BUILT_IN else []
        expected += ["ContactEvents"] if p == Phase.RESPONSE else []
        expected += [phase.name] if p == phase else []
    assert log == expected


def test_plain_processors_run_after_response_or_between_phases():
    world, log = make_world(), []
    trace(world, log)
    world.add_processor(PlainNote(log, "zero"))
    world.add_system(PlainNote(log, "added as a system"))
    world.add_processor(PlainNote(log, "before narrow"), priority=Phase.NARROW.priority)
    world.add_processor(PlainNote(log, "after all"), priority=-5)
    world.add_system(Note(log, "end"))
    world.add_processor(PlainNote(log, "first"), priority=Phase.START.priority + 1)
    world.step()
    assert log == [
        "first", "ForceAccumulation", "Integration", "BroadPhase", "before narrow", "NarrowPhase", "Response",
        "ContactEvents", "end", "zero", "added as a system", "after all",
    ]  # fmt: skip
    assert world.step_count == 1


def test_ties_run_in_order_of_addition():
    world, log = make_world(), []
    for label in "cab":
        world.add_system(Note(log, label))
    world.step()
    assert log == ["c", "a", "b"]


def test_before_and_after_by_type_and_by_instance_in_the_class_and_at_the_call():
    world, log = make_world(), []
    a, b = A(log, "a"), B(log, "b")
    world.add_system(a)
    world.add_system(b, before=A)
    world.add_system(C(log, "c"), before=b)
    world.add_system(type("D", (Note,), {"after": (B,)})(log, "d"), before=a)
    world.step()
    assert log == ["c", "b", "d", "a"]


def test_a_system_without_phase_goes_where_its_neighbour_is():
    world = make_world()
    world.add_system(A(), before=Response)
    world.add_system(B(), after=Integration)
    assert order(world) == [
        "ForceAccumulation", "Integration", "B", "BroadPhase", "NarrowPhase", "A", "Response", "ContactEvents",
    ]  # fmt: skip


def test_an_order_across_phases_may_be_stated_and_must_be_possible():
    world = make_world()
    world.add_system(in_phase(A, Phase.START)(), before=Response)
    world.add_system(in_phase(B, Phase.END)(), after=Response)
    assert order(world)[0] == "A"
    assert order(world)[-1] == "B"
    with pytest.raises(ScheduleError, match="START and cannot run after Response of phase RESPONSE"):
        world.add_system(in_phase(C, Phase.START)(), after=Response)

    class Base(Note):
        phase = Phase.START

    class Derived(Base):  # its phase is its base's, not one to be moved
        pass

    with pytest.raises(ScheduleError, match="Derived"):
        world.add_system(Derived(), after=Response)
    assert len(order(world)) == 8


def test_cycles_and_unknown_neighbours_are_errors_and_leave_nothing_behind():
    world, log = make_world(), []
    a, b = A(log, "a"), B(log, "b")
    world.add_system(a)
    with pytest.raises(ScheduleError, match=r"cycle: .*A.*B|cycle: .*B.*A"):
        world.add_system(b, before=A, after=A)
    with pytest.raises(ScheduleError, match="before C, which is not in this world"):
        world.add_system(b, before=C)
    world.add_system(b, before=A)  # the failure has left no trace in it
    world.step()
    assert log == ["b", "a"]


def test_two_writers_of_one_column_need_an_order():
    world = make_world()
    writer = type("Writer", (Note,), {"phase": Phase.END, "writes": ("position",)})
    second = type("Second", (Note,), {"phase": Phase.END, "writes": ["mass", "position"]})
    world.add_system(writer())
    with pytest.raises(ScheduleError, match="Writer and Second both write position in phase END"):
        world.add_system(second())
    world.add_system(second(), after=writer)
    third = type("Third", (Note,), {"phase": Phase.END, "writes": ("position",)})
    with pytest.raises(ScheduleError):
        world.add_system(third(), after=writer)  # but neither before nor after Second
    world.add_system(third(), after=second)  # after Writer too then, through Second
    world.add_system(type("Elsewhere", (Note,), {"phase": Phase.START, "writes": ("position",)})())
    assert order(world)[-3:] == ["Writer", "Second", "Third"]


def test_run_forces_alone():
    world = make_world(gravity=10.0)
    ball(world, 0.0, mass=2.0)
    world.run(Phase.FORCES)
    assert world.bodies.force.tolist() == [[0.0, -20.0]]
    assert world.bodies.position.tolist() == [[0.0, 0.0]]
    assert (world.step_count, world.time) == (0, 0.0)


def test_run_integration_alone():
    world = make_world(dt=0.5)
    ball(world, 0.0, 4.0)
    world.run(Phase.INTEGRATION)
    assert world.bodies.position.tolist() == [[2.0, 0.0]]
    assert world.bodies.previous_position.tolist() == [[0.0, 0.0]]


def test_run_narrow_alone_after_placing_two_bodies():
    world = make_world()
    a, b = ball(world, 0.0), ball(world, 0.9)
    world.run(Phase.NARROW)
    assert [(c.entity_a, c.entity_b) for c in world.contacts] == [(a, b)]
    assert world.contacts.depth[0] == pytest.approx(0.1)
    assert world.contacts.normal.tolist() == [[1.0, 0.0]]
    world.component_for_entity(b, Transform).x = 1.1
    world.run(Phase.NARROW)
    assert len(world.contacts) == 0


def test_run_response_alone_bounces_what_overlaps():
    world = make_world()
    ball(world, 0.0, 1.0, restitution=1.0)
    ball(world, 0.9, -1.0, restitution=1.0)
    world.run(Phase.RESPONSE)
    assert world.bodies.linear_velocity[:, 0].tolist() == pytest.approx([-1.0, 1.0])


def test_run_has_the_systems_of_that_phase_alone_and_undoes_what_fails():
    world, log = make_world(), []
    ball(world, 0.0)
    world.add_system(in_phase(A, Phase.FORCES)(log, "forces"))
    world.add_system(Note(log, "end"))
    world.run(Phase.FORCES)
    assert log == ["forces"]

    class Bad(System):
        phase = Phase.INTEGRATION

        def process(self, dt):
            self.world.bodies.position = 9.0
            self.world.run(Phase.FORCES)

    world.add_system(Bad())
    with pytest.raises(CaromError, match="inside"):
        world.run(Phase.INTEGRATION)
    assert world.bodies.position.tolist() == [[0.0, 0.0]]
    world.run(Phase.FORCES)
