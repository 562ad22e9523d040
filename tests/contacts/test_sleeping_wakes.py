"""What sleeps wakes as an island, for every reason there is, and nothing else does."""

from __future__ import annotations

import pytest
from helpers_sleeping import CAUSES, EVERYWHERE, GRAVITY, MODES, is_asleep, sleep, sleepy_world, tower, two_towers
from worlds import ball, floor

from carom.components import RigidBody, SphereCollider, Transform
from carom.framework import ForceSystem, Phase, Settings, System, World
from carom.plugins import Physics
from carom.plugins.springs import Springs


@pytest.fixture(scope="module")
def asleep():
    return two_towers()


@pytest.mark.parametrize("cause", CAUSES)
def test_what_wakes_an_island(asleep, cause):
    world, boxes, others, snapshot = asleep
    world.settings = world.settings.replace(dt=1 / 60)
    world.restore(snapshot)
    CAUSES[cause](world, boxes)
    for _ in range(14 if cause == "touched by kinematic" else 3):
        world.step()
    left = [entity for entity in boxes if world.entity_exists(entity)]
    bodies = [e for e in left if world.component_for_entity(e, RigidBody).kind == "dynamic"]
    assert not any(is_asleep(world, *bodies))
    assert is_asleep(world, *others) == [cause not in EVERYWHERE] * 3


def test_an_island_that_is_disturbed_between_falling_asleep_and_the_next_step():
    for cause in ("in a column", "teleported", "grown", "bottom deleted", "floor moved", "constant force"):
        world = sleepy_world()
        boxes = tower(world, 0.0)
        while not is_asleep(world, boxes[1])[0]:
            world.step()
        CAUSES[cause](world, boxes)
        world.step()
        world.step()
        left = [entity for entity in boxes if world.entity_exists(entity)]
        assert not any(is_asleep(world, *left)), cause


def test_the_same_force_in_every_step_lets_sleep():
    world = sleepy_world()
    boxes = tower(world, 0.0)
    for _ in range(90):
        world.component_for_entity(boxes[1], RigidBody).apply_force((0.0, -3.0))
        world.step()
    assert all(is_asleep(world, *boxes))
    world.step()  # without it
    assert not any(is_asleep(world, *boxes))


def test_a_tower_whose_bottom_goes_falls():
    world = sleepy_world()
    boxes = tower(world, 0.0)
    sleep(world, *boxes)
    world.delete_entity(boxes[0])
    for _ in range(60):
        world.step()
    assert world.component_for_entity(boxes[1], Transform).position[1] == pytest.approx(0.5, abs=0.02)
    assert world.component_for_entity(boxes[2], Transform).position[1] == pytest.approx(1.5, abs=0.02)
    sleep(world, *boxes[1:])


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("speed", [5.0, 400.0])
def test_a_ball_thrown_at_a_sleeping_pile_wakes_that_island_alone(mode, speed):
    world = sleepy_world(collision=mode)
    near, far = tower(world, 0.0), tower(world, 30.0)
    sleep(world, *near, *far)
    thrown = ball(world, (-3.0, 1.5), (speed, 1.0), radius=0.3, mass=0.5, restitution=0.2)
    for _ in range(100):
        world.step()
        if not any(is_asleep(world, *near)):
            break
    assert not any(is_asleep(world, *near))
    assert all(is_asleep(world, *far))
    assert world.component_for_entity(thrown, Transform).position[0] < 0.5 or mode == "discrete"
    for _ in range(3):
        world.step()
    moved = world.component_for_entity(near[1], Transform).position[0]
    assert moved > 0.0 or (mode == "discrete" and speed > 100.0)


def test_a_bullet_wakes_what_it_sweeps_into():
    world = sleepy_world()
    boxes = tower(world, 0.0)
    sleep(world, *boxes)
    bullet = RigidBody(1.0, (3000.0, 0.0), ccd=True)
    shot = world.create_entity(Transform((-20.0, 1.5)), bullet, SphereCollider(0.05))
    world.step()
    assert not any(is_asleep(world, *boxes))
    assert world.component_for_entity(shot, RigidBody).linear_velocity[0] < 2000.0
    assert world.component_for_entity(boxes[1], RigidBody).linear_velocity[0] > 1000.0


def test_what_is_struck_in_the_second_place_wakes_before_it():
    """A bullet strikes a ball, and that, in the same step, what sleeps."""
    for mode in ("continuous", "event_driven"):
        world = sleepy_world(collision=mode)
        boxes = tower(world, 0.0)
        sleep(world, *boxes)
        first = ball(world, (-3.0, 1.5), (0.0, 0.0), radius=0.3, mass=0.1, restitution=1.0)
        ball(world, (-8.0, 1.5), (500.0, 0.0), radius=0.3, mass=5.0, restitution=1.0)
        world.step()
        assert world.component_for_entity(first, RigidBody).linear_velocity[0] != 0.0
        assert not any(is_asleep(world, *boxes))
        assert (world.bodies.dynamic.position[:3, 1] > 0.4).all()


def test_springs_and_other_force_systems_wake():
    springs = Springs()
    world = World(Physics(2, gravity=(0.0, -GRAVITY)), springs, settings=Settings(sleeping=True))
    floor(world)
    boxes = tower(world, 0.0, 1)
    hook = world.create_entity(Transform((0.0, 3.0)), RigidBody(kind="kinematic"))
    spring = springs.connect(boxes[0], hook, stiffness=1.0, damping=0.2, rest_length=1.0)
    sleep(world, *boxes)
    spring.stiffness = 2.0
    world.step()
    assert is_asleep(world, *boxes) == [False]

    class Wind(ForceSystem):
        strength = 0.0

        def add_forces(self, bodies, time):
            bodies.force += (self.strength, 0.0)

    sleep(world, *boxes)
    wind = Wind()
    world.add_system(wind)
    sleep(world, *boxes)
    wind.strength = 0.5
    world.step()
    assert is_asleep(world, *boxes) == [False]


def test_a_system_that_moves_a_sleeper_within_the_step_wakes_it():
    class Kick(System):
        phase = Phase.FORCES
        entity = 0

        def process(self, dt):
            if self.entity:
                self.world.component_for_entity(self.entity, RigidBody).linear_velocity = (1.0, 0.0)
                self.entity = 0

    world = sleepy_world()
    boxes = tower(world, 0.0)
    kick = Kick()
    world.add_system(kick)
    sleep(world, *boxes)
    kick.entity = boxes[2]
    world.step()
    assert not any(is_asleep(world, *boxes))
    assert world.component_for_entity(boxes[2], Transform).position[0] > 0.0
