"""Steps and time of a world, also of one without physics."""

from __future__ import annotations

import esper
import helpers_world
import numpy as np
import pytest
from helpers_world import Counter, Name
from worlds import ball, make_world

from carom.framework import CaromError, NoPhysicsError, Settings, System, World

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


def test_settings_are_replaced_between_steps_and_time_goes_on():
    world = make_world(dt=0.5)
    world.step()
    world.settings = world.settings.replace(dt=0.25)
    world.step()
    assert (world.time, world.step_count) == (0.75, 2)
    with pytest.raises(TypeError):
        world.settings = None

    class Meddler(System):
        def process(self, dt):
            self.world.settings = Settings()

    meddler = Meddler()
    world.add_system(meddler)
    with pytest.raises(CaromError, match="between steps"):
        world.step()
    assert world.settings.dt == 0.25


@pytest.mark.parametrize("seconds", [-1.0, float("nan"), float("inf"), "1", None])
def test_advance_takes_a_time(seconds):
    world = World()
    with pytest.raises(ValueError, match="seconds"):
        world.advance(seconds)
    assert world.advance(np.float32(0.0)) == 0


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


@pytest.mark.parametrize("inner", ["facade", "advance", "plain"])
def test_a_step_inside_a_step_is_refused(inner):
    world = make_world()

    class Again(System):
        def process(self, dt):
            {"facade": world.step, "advance": lambda: world.advance(1.0), "plain": lambda: esper.process(dt)}[inner]()

    again = Again()
    world.add_system(again)
    with pytest.raises(CaromError, match="inside"):
        world.step()
    world.remove_system(again)
    world.step()
    assert world.step_count == 1
    assert world.alpha == 0.0


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
