"""Steps and time of a world, also of one without physics."""

from __future__ import annotations

import esper
import helpers_world
import pytest
from helpers_world import Counter, Name
from worlds import ball, make_world

from carom.framework import NoPhysicsError, Settings, World

pytestmark = pytest.mark.plain

esper_is_left_as_it_was = helpers_world.esper_is_left_as_it_was  # a fixture, around every test

NO_PHYSICS = "no physics in this world: World(Physics(...))"


@pytest.mark.parametrize(
    "use",
    [
        lambda w: w.bodies,
        lambda w: w.contacts,
        lambda w: w.gravity,
        lambda w: setattr(w, "gravity", (0, 0)),
        lambda w: w.kinetic_energy(),
        lambda w: w.potential_energy(),
        lambda w: w.momentum(),
        lambda w: w.snapshot(),
        lambda w: w.state_hash(),
        lambda w: w.query_point((0, 0)),
        lambda w: w.prepare(),
        lambda w: w.create_entities(3),
    ],
)
def test_what_needs_physics_says_so(use):
    with pytest.raises(NoPhysicsError) as caught:
        use(World())
    assert str(caught.value) == NO_PHYSICS
    assert isinstance(caught.value, AttributeError)  # so that hasattr(world, "bodies") works


def test_a_world_without_physics_still_steps_its_processors():
    world = World(settings=Settings(dt=0.25))
    counter = Counter()
    world.add_system(counter)
    world.create_entity(Name())
    world.step()
    assert world.advance(0.6) == 2
    assert (counter.count, world.step_count, world.time) == (3, 3, 0.75)


def test_plain_process_wants_the_fixed_step_and_names_advance():
    world = make_world()
    with world:
        for wrong in ((), (1 / 30,), (1 / 60, 1)):
            with pytest.raises(ValueError, match=r"world\.advance"):
                esper.process(*wrong)
        assert world.step_count == 0
        esper.process(world.settings.dt)
        esper.timed_process(world.settings.dt)
        esper.process(dt=world.settings.dt)
    assert world.step_count == 3


def test_an_empty_world_and_a_single_body_step():  # ACCURACY C25
    world = make_world()
    world.step()
    assert len(world.bodies) == len(world.contacts) == 0
    assert world.momentum().tolist() == [0.0, 0.0]
    ball(world, 0.0, 60.0)
    world.step()
    assert world.bodies.position.tolist() == [[1.0, 0.0]]


def test_faults_hold_the_last_hundred():
    world = World()
    for index in range(150):
        world.report_fault(str(index))
    assert world.faults == [str(i) for i in range(50, 150)]
