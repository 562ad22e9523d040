"""Systems: phases and their order, addition and removal, also within a step, and one phase alone."""

from __future__ import annotations

import esper
import pytest
from schedule.helpers_systems import A, B, C, Note, PlainNote, in_phase
from worlds import ball, make_world

from carom.components import Transform
from carom.framework import CaromError, ForceSystem, NoPhysicsError, Phase, ScheduleError, System, World
from carom.systems import BroadPhase, ContactEvents, ForceAccumulation, Integration, NarrowPhase, Response

pytestmark = pytest.mark.plain


def order(world):
    return [system.name for system in world.systems]


def test_the_built_in_systems_are_esper_processors_in_the_order_of_the_step():
    world = make_world()
    expected = [ForceAccumulation, Integration, BroadPhase, NarrowPhase, Response, ContactEvents]
    with world:
        found = [esper.get_processor(system) for system in expected]
    assert [type(system) for system in found] == expected
    assert world.systems == found
    assert all(system.phase.priority - 1000 < system.priority < system.phase.priority for system in found)
    assert [phase.priority for phase in Phase] == [7000, 6000, 5000, 4000, 3000, 2000, 1000]


def plain(world, log):
    world.add_processor(PlainNote(log, "zero"))
    world.add_system(PlainNote(log, "added as a system"))
    world.add_processor(PlainNote(log, "before narrow"), priority=Phase.NARROW.priority)
    world.add_processor(PlainNote(log, "after all"), priority=-5)
    world.add_system(Note(log, "end"))
    world.add_processor(PlainNote(log, "first"), priority=Phase.START.priority + 1)


def neighbours(world, log):
    """By type and by instance, in the class and at the call."""
    a, b = A(log, "a"), B(log, "b")
    world.add_system(a)
    world.add_system(b, before=A)
    world.add_system(C(log, "c"), before=b)
    world.add_system(type("D", (Note,), {"after": (B,)})(log, "d"), before=a)


def without_phase(world, log):
    world.add_system(A(log, "a"), before=Response)
    world.add_system(B(log, "b"), after=Integration)


def in_each_phase(world, log):
    for phase in reversed(Phase):
        world.add_system(in_phase(A, phase)(log, phase.name))


F, I, B_, N, R = "ForceAccumulation", "Integration", "BroadPhase", "NarrowPhase", "Response"  # noqa: E741
ORDERS = {
    "phases": (in_each_phase, ["START", F, "FORCES", I, "INTEGRATION", B_, "BROAD", N, "NARROW", R, "ContactEvents",
                               "RESPONSE", "END"]),
    "plain processors": (plain, ["first", F, I, B_, "before narrow", N, R, "ContactEvents", "end", "zero",
                                 "added as a system", "after all"]),
    "ties": (lambda w, log: [w.add_system(Note(log, one)) for one in "cab"],
             [F, I, B_, N, R, "ContactEvents", "c", "a", "b"]),
    "neighbours": (neighbours, [F, I, B_, N, R, "ContactEvents", "c", "b", "d", "a"]),
    "without a phase": (without_phase, [F, I, "b", B_, N, "a", R, "ContactEvents"]),
}  # fmt: skip


@pytest.mark.parametrize("name", ORDERS)
def test_systems_run_by_phase_neighbours_and_order_of_addition(name):
    world, log = make_world(), []
    add, expected = ORDERS[name]
    for system in world.systems:
        inner = system.process

        def process(dt, inner=inner, name=system.name):
            log.append(name)
            inner(dt)

        system.process = process
    add(world, log)
    world.step()
    assert log == expected


def test_a_phase_alone_has_its_systems_alone_and_undoes_what_fails():
    world, log = make_world(), []
    a, b = ball(world, 0.0, 1.0, restitution=1.0), ball(world, 0.9, -1.0, restitution=1.0)
    world.add_system(in_phase(A, Phase.NARROW)(log, "narrow"))
    world.add_system(Note(log, "end"))
    world.run(Phase.NARROW)
    assert log == ["narrow"]
    assert [(c.entity_a, c.entity_b) for c in world.contacts] == [(a, b)]
    assert world.contacts.depth[0] == pytest.approx(0.1)
    assert world.contacts.normal.tolist() == [[1.0, 0.0]]
    world.run(Phase.RESPONSE)
    assert world.bodies.linear_velocity[:, 0].tolist() == pytest.approx([-1.0, 1.0])
    world.component_for_entity(b, Transform).x = 1.1
    world.run(Phase.NARROW)
    assert len(world.contacts) == 0

    class Bad(System):
        phase = Phase.INTEGRATION

        def process(self, dt):
            self.world.bodies.position = 9.0
            raise ValueError

    world.add_system(Bad())
    before = world.state_hash()
    with pytest.raises(CaromError, match="Bad"):
        world.run(Phase.INTEGRATION)
    assert world.state_hash() == before
    world.run(Phase.FORCES)


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


def test_systems_run_once_per_step_and_frame_systems_once_per_advance():
    world, log = make_world(dt=0.1), []

    class Frame(System):
        def process(self, dt):
            log.append(("frame", dt, self.world.step_count))

    class Drawing(esper.Processor):
        def process(self, dt):
            log.append("drawn")

    world.add_system(Note(log, "step"))
    frame = Frame()
    world.add_system(frame, frame=True)
    world.add_system(Drawing(), frame=True)
    assert world.advance(0.25) == 2
    assert log == ["step", "step", ("frame", 0.25, 2), "drawn"]
    log.clear()
    assert world.advance(0.01) == 0
    assert log == [("frame", 0.01, 2), "drawn"]
    log.clear()
    world.step()
    assert log == ["step"]
    world.remove_system(frame)
    world.advance(0.0)
    assert log == ["step", "drawn"]


def test_what_cannot_be_added():
    world = make_world()
    with pytest.raises(TypeError, match=r"instance: add_system\(Note\(\)\)"):
        world.add_system(Note)
    with pytest.raises(TypeError, match="System"):
        world.add_system(print)
    with pytest.raises(TypeError, match="ForceSystem"):
        world.add_system(ForceSystem(), frame=True)
    with pytest.raises(TypeError, match="priority"):
        world.add_system(PlainNote([], ""), before=Response)
    with pytest.raises(TypeError, match="instance"):
        world.add_processor(PlainNote)
    with pytest.raises(NoPhysicsError):
        World().add_system(ForceSystem())
    note, field = Note(), ForceSystem()
    for system in (note, field):
        world.add_system(system)
        with pytest.raises(ValueError, match="already"):
            world.add_system(system)
        with pytest.raises(ValueError, match="belongs to one world"):
            make_world().add_system(system)
        world.remove_system(system)
        make_world().add_system(system)  # free again


@pytest.mark.parametrize("plain_process", [False, True], ids=["step", "esper.process"])
def test_what_is_added_or_removed_inside_a_step_joins_or_leaves_at_its_end(plain_process):
    world, log = make_world(), []

    def step():
        with world:
            esper.process(world.settings.dt) if plain_process else world.step()

    late, plain, leaving, kept = Note(log, "late"), PlainNote(log, "plain"), Note(log, "leaving"), Note(log, "kept")

    class Change(System):
        phase = Phase.START

        def process(self, dt):
            if self.world.step_count == 0:
                self.world.add_system(late)
                self.world.add_system(B(log, "after late"), after=late)
                self.world.add_processor(plain)
                self.world.remove_system(leaving)
                self.world.remove_system(kept)
                self.world.add_system(kept)  # added again
                with pytest.raises(ValueError, match="already"):
                    self.world.add_system(late)
                with pytest.raises(KeyError):
                    self.world.remove_system(leaving)
                assert self.world.has_system(late)

    world.add_system(Change())
    world.add_system(leaving)
    world.add_system(kept)
    step()
    assert log == ["leaving", "kept"]
    assert world.step_count == 1
    log.clear()
    step()
    assert log == ["late", "after late", "kept", "plain"]  # in order of addition: ``kept`` was added again last
    assert world.step_count == 2


def test_force_systems_added_inside_a_step_join_at_its_end():
    class Push(ForceSystem):
        def add_forces(self, bodies, time):
            bodies.force[:, 0] += 1.0

    world, push = make_world(dt=1.0), Push()

    class Change(System):
        phase = Phase.START

        def process(self, dt):
            if self.world.step_count < 2:
                (self.world.remove_system if self.world.step_count else self.world.add_system)(push)

    ball(world, 0.0)
    change = Change()
    world.add_system(change)
    world.step()
    assert world.bodies.linear_velocity[0, 0] == 0.0
    world.step()
    assert world.bodies.linear_velocity[0, 0] == 1.0
    world.step()
    assert world.bodies.linear_velocity[0, 0] == 1.0


def test_two_instances_of_a_type_are_removed_one_by_one():
    world, log = make_world(), []
    first, second = Note(log, 1), Note(log, 2)
    world.add_system(first)
    world.add_system(second)
    world.remove_system(first)
    world.step()
    assert log == [2]
    with world:
        assert esper.get_processor(Note) is second
    world.remove_processor(Note)
    world.step()
    assert log == [2]
    assert "process" not in vars(first)  # as it was before it was added


def test_plain_esper_calls_add_and_remove_systems_as_well():
    world, log = make_world(), []
    early = in_phase(A, Phase.START)(log, "early")
    with world:
        esper.add_processor(PlainNote(log, "plain"))
        esper.add_processor(early, priority=-3)
        esper.process(world.settings.dt)
        assert log == ["early", "plain"]  # a System runs in its phase
        assert early.world is world
        assert world.systems[0] is early
        esper.remove_processor(type(early))
        esper.process(world.settings.dt)
    assert log == ["early", "plain", "plain"]
    world.add_system(Note(log, "new"))  # sorting them again does not bring it back
    world.step()
    assert log[3:] == ["new", "plain"]


def test_a_built_in_system_can_be_taken_out():
    world = make_world(gravity=10.0, dt=1.0)
    ball(world, 0.0, 1.0)
    with world:
        forces = esper.get_processor(ForceAccumulation)
    world.remove_system(forces)
    world.step()
    assert world.bodies.linear_velocity.tolist() == [[1.0, 0.0]]
    world.add_system(forces)
    world.step()
    assert world.bodies.linear_velocity.tolist() == [[1.0, -10.0]]


class Aware(Note):
    """Notes when it joins and leaves; what it may raise then."""

    fails = ""

    def on_add(self, world):
        assert self.world is world
        self.log.append(f"{self.label} joins")
        if "on_add" in self.fails:
            raise ValueError("cannot join")

    def on_remove(self, world):
        self.log.append(f"{self.label} leaves")


class AwareForces(ForceSystem):
    log, label, fails, on_add, on_remove = [], "forces", "", Aware.on_add, Aware.on_remove

    def add_forces(self, bodies, time): ...


def test_systems_are_called_when_they_join_and_leave():
    world, log = make_world(), []
    one, forces, frame, plain = Aware(log, "one"), AwareForces(), Aware(log, "frame"), Aware(log, "plain")
    forces.log = log
    world.add_system(one)
    world.add_system(forces)
    world.add_system(frame, frame=True)
    with world:
        esper.add_processor(plain, priority=3)
        assert log == ["one joins", "forces joins", "frame joins"]
        world.step()
    assert log[3:] == ["plain joins", "one", "plain"]
    world.step()
    log.clear()
    for system in (one, forces, frame, plain):
        world.remove_system(system)
        world.add_system(system, frame=system is frame)  # joins again
    names = "one", "forces", "frame", "plain"
    assert log == [f"{name} {does}" for name in names for does in ("leaves", "joins")]


def test_what_is_added_within_a_step_is_called_at_its_end():
    world, log = make_world(), []

    class Change(System):
        phase = Phase.START

        def process(self, dt):
            if not self.world.step_count:
                for label in ("first", "second"):
                    self.world.add_system(Aware(log, label))
            log.append("step")

    world.add_system(Change())
    world.step()
    assert log == ["step", "first joins", "second joins"]
    world.step()
    assert log[3:] == ["step", "first", "second"]


def test_a_system_that_cannot_join_is_not_in_the_world():
    world, log = make_world(), []
    others = Aware(log, "early"), Aware(log, "late")

    class Change(System):
        phase = Phase.START

        def process(self, dt):
            if not self.world.step_count:
                for system in (others[0], bad, others[1]):
                    self.world.add_system(system)

    class Helped(Aware):
        def on_add(self, world):
            super().on_add(world)
            world.add_system(bad)

    bad, before = Aware(log, "bad"), world.systems
    bad.fails = "on_add"
    for options in ({"before": Response}, {"frame": True}):
        with pytest.raises(ValueError, match="cannot join") as error:
            world.add_system(bad, **options)
        assert error.value.__notes__ == ["in Aware.on_add"]
        assert world.systems == before
        assert not world.has_system(bad)
        assert "phase" not in vars(bad)
    with pytest.raises(ValueError, match="cannot join"):
        world.add_system(Helped(log, "helped"))
    assert world.systems == before
    with world:
        esper.add_processor(bad)
    with pytest.raises(ValueError, match="cannot join"):
        world.step()
    log.clear()
    change = Change()
    world.add_system(change)
    with pytest.raises(ValueError, match="cannot join"):
        world.step()
    assert world.step_count == 1  # the step is complete
    world.step()
    assert log == ["early joins", "bad joins", "late joins", "early", "late"]
    assert set(world.systems) == {*before, change, *others}
