"""Systems: calls per step and per frame, addition and removal, also in the middle of a step."""

from __future__ import annotations

import esper
import pytest
from helpers_systems import A, B, Note, PlainNote, in_phase
from worlds import ball, make_world

from carom.framework import ForceSystem, NoPhysicsError, Phase, System, World
from carom.systems import ForceAccumulation, Response

pytestmark = pytest.mark.plain


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
