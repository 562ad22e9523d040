"""What wakes an island that sleeps, for every reason, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from contacts.helpers_sleeping import (
    CAUSES,
    EVERYWHERE,
    GRAVITY,
    MODES,
    ground,
    is_asleep,
    part,
    sleep,
    sleeping_tower,
    sleepy_world,
    tower,
    two_towers,
)
from worlds import Calls, ball, box, floor, position, run, velocity

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import ForceSystem, Phase, Settings, World
from carom.plugins import Physics
from carom.plugins.springs import Springs
from carom.systems import Integration


@pytest.fixture(scope="module")
def asleep():
    return two_towers()


def test_rows_that_move_take_their_sleep_along():
    world = sleepy_world()
    first = [ball(world, (-20.0 - 2.0 * k, 0.5)) for k in range(5)]
    boxes = tower(world, 0.0)
    sleep(world, *boxes, *first)
    before = world.bodies.dynamic.position[-3:].copy()
    for entity in first[::2]:
        world.delete_entity(entity)
    for k in range(80):  # the table grows
        ball(world, (30.0 + 2.0 * k, 5.0))
    run(world, 5)
    assert all(is_asleep(world, *boxes, *first[1::2]))
    rows = [world.bodies.row_of(entity) for entity in boxes]
    assert (world.bodies.position[rows] == before).all()
    world.delete_entity(boxes[0])
    world.step()
    assert not any(is_asleep(world, *boxes[1:]))


def test_a_plan_between_falling_asleep_and_the_next_step_changes_nothing():
    world, other = sleepy_world(), sleepy_world()
    seen = []
    for each in (world, other):
        boxes = tower(each, 0.0)
        while not is_asleep(each, boxes[1])[0]:
            each.step()
        if each is world:
            assert "rest_sleepers" in str(each.plan())
        assert len(each.contacts.stay) == len(each.contacts) == 3
        for _ in range(3):
            each.step()
            seen.append((each.state_hash(), len(each.contacts), len(each.contacts.stay)))
    assert seen[:3] == seen[3:]


def test_several_steps_in_one_call_show_the_contacts_that_stay():
    world, stays = sleepy_world(), []
    boxes = tower(world, 0.0)
    world.add_system(Calls(Phase.START, lambda: stays.append(len(world.contacts.stay))))
    for _ in range(12):
        world.advance(5 / 60)
    assert all(is_asleep(world, *boxes))
    assert stays[10:].count(0) == len(stays[10::5])  # in the first step of a call nothing has stayed yet
    assert set(stays[10:]) == {0, 3}


def test_a_replaced_integration_lets_nothing_sleep():
    world, boxes = sleeping_tower()
    world.remove_system(world.get_processor(Integration))
    world.step()
    world.step()
    assert not any(is_asleep(world, *boxes))


def test_a_body_with_a_value_that_cannot_be_wakes_the_others():
    world, boxes = sleeping_tower(on_fault="ignore")
    world.bodies.position[world.bodies.row_of(boxes[0])] = np.nan
    run(world, 30)
    assert not any(is_asleep(world, *boxes))
    assert position(world, boxes[1])[1] < 1.2


def test_settings_and_wake_are_checked():
    with pytest.raises(ValueError, match="sleeping"):
        Settings(sleeping=1)
    world = sleepy_world()
    with pytest.raises(KeyError):
        world.wake(99)


def test_the_contacts_of_the_last_sleeper_end_when_nothing_can_move_any_more():
    world, boxes = sleeping_tower(1)
    assert len(world.contacts) == 1
    world.component_for_entity(boxes[0], RigidBody).kind = "static"
    world.step()
    assert (len(world.contacts), len(world.contacts.end)) == (0, 1)


@pytest.mark.slow
@pytest.mark.parametrize("cause", CAUSES)
def test_what_wakes_an_island(asleep, cause):
    world, boxes, others, snapshot = asleep
    world.settings = world.settings.replace(dt=1 / 60)
    world.restore(snapshot)
    CAUSES[cause](world, boxes)
    run(world, 14 if cause == "touched by kinematic" else 3)
    left = [entity for entity in boxes if world.entity_exists(entity)]
    bodies = [e for e in left if world.component_for_entity(e, RigidBody).kind == "dynamic"]
    assert not any(is_asleep(world, *bodies))
    assert is_asleep(world, *others) == [cause not in EVERYWHERE] * 3


def test_an_island_that_is_disturbed_between_falling_asleep_and_the_next_step():
    for cause in ("in a column", "teleported", "grown", "bottom deleted", "floor moved", "constant force", "told"):
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
    assert position(world, thrown)[0] < 0.5 or mode == "discrete"
    run(world, 3)
    assert position(world, near[1])[0] > 0.0 or (mode == "discrete" and speed > 100.0)


def test_a_bullet_wakes_what_it_sweeps_into():
    world, boxes = sleeping_tower()
    bullet = RigidBody(1.0, (3000.0, 0.0), ccd=True)
    shot = world.create_entity(Transform((-20.0, 1.5)), bullet, SphereCollider(0.05))
    world.step()
    assert not any(is_asleep(world, *boxes))
    assert velocity(world, shot)[0] < 2000.0
    assert velocity(world, boxes[1])[0] > 1000.0


def test_what_is_struck_in_the_second_place_wakes_before_it():
    """A bullet strikes a ball, and that, in the same step, what sleeps."""
    for mode in ("continuous", "event_driven"):
        world, boxes = sleeping_tower(collision=mode)
        first = ball(world, (-3.0, 1.5), (0.0, 0.0), radius=0.3, mass=0.1, restitution=1.0)
        ball(world, (-8.0, 1.5), (500.0, 0.0), radius=0.3, mass=5.0, restitution=1.0)
        world.step()
        assert world.component_for_entity(first, RigidBody).linear_velocity[0] != 0.0
        assert not any(is_asleep(world, *boxes))
        assert (world.bodies.dynamic.position[:3, 1] > 0.4).all()


@pytest.mark.parametrize("integrator", ["semi_implicit_euler", "rk4"])
def test_a_spring_that_changes_wakes(integrator):
    springs, settings = Springs(), Settings(sleeping=True, integrator=integrator)
    world = World(Physics(2, gravity=(0.0, -GRAVITY)), springs, settings=settings)
    floor(world)
    boxes = tower(world, 0.0, 1)
    hook = world.create_entity(Transform((0.0, 3.0)), RigidBody(kind="kinematic"))
    spring = springs.connect(boxes[0], hook, stiffness=1.0, damping=0.2, rest_length=1.0)
    sleep(world, *boxes)
    spring.stiffness = 2.0
    world.step()
    assert is_asleep(world, *boxes) == [False]


EQUAL = {  # what changes nothing
    "settings": lambda world, boxes: setattr(world, "settings", world.settings.replace(dt=1 / 60)),
    "gravity": lambda world, boxes: setattr(world, "gravity", (0.0, -GRAVITY)),
    "velocity": lambda world, boxes: setattr(part(world, boxes[0], RigidBody), "linear_velocity", (0.0, 0.0)),
    "position": lambda world, boxes: setattr(
        part(world, boxes[0], Transform), "position", part(world, boxes[0], Transform).position.copy()
    ),
    "mass": lambda world, boxes: setattr(part(world, boxes[0], RigidBody), "mass", 1.0),
    "limit": lambda world, boxes: setattr(part(world, boxes[0], RigidBody), "max_linear_speed", None),
    "size": lambda world, boxes: setattr(part(world, boxes[0], AABBCollider), "half_extents", (0.5, 0.5)),
    "kind": lambda world, boxes: setattr(part(world, boxes[0], RigidBody), "kind", "dynamic"),
    "floor": lambda world, boxes: setattr(part(world, ground(world), AABBCollider), "friction", 0.5),
}


@pytest.mark.parametrize("mode", MODES)
def test_equal_values_wake_nothing(mode):
    world, boxes = sleeping_tower(collision=mode)
    for cause, write in EQUAL.items():
        write(world, boxes)
        world.step()
        assert all(is_asleep(world, *boxes)), cause


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("mode", MODES)
def test_what_sleeps_falls_at_once_where_gravity_says(mode, d):
    world = sleepy_world(d, collision=mode)
    body, light = box(world, (0.0, 0.5, 0.0)[:d]), box(world, (5.0, 0.5, 0.0)[:d])
    world.component_for_entity(light, RigidBody).gravity_scale = 0.0
    sleep(world, body, light)
    snapshot = world.snapshot()
    hashes = []
    for again in (False, True):
        world.gravity = (0.0, GRAVITY, 0.0)[:d]
        if again:
            world.restore(world.snapshot())  # what wakes is not forgotten
        run(world, 60)
        risen = 0.5 * GRAVITY * (1.0 if mode == "event_driven" else 1.0 + 1 / 60)  # semi-implicit
        assert position(world, body)[1] == pytest.approx(0.5 + risen, abs=2e-3)
        assert is_asleep(world, body, light) == [False, True]
        hashes.append(world.state_hash())
        world.restore(snapshot)
    assert hashes[0] == hashes[1]


@pytest.mark.parametrize("integrator", ["semi_implicit_euler", "rk4"])
def test_a_force_system_that_comes_goes_or_changes_wakes_what_it_pushes(integrator):
    class Wind(ForceSystem):
        strength = 0.5

        def add_forces(self, bodies, time):
            bodies.force += (self.strength, 0.0)

    world, wind = sleepy_world(integrator=integrator), Wind()
    boxes = tower(world, 0.0)
    sleep(world, *boxes)
    for change in (world.add_system, world.remove_system):
        change(wind)
        world.step()
        assert not any(is_asleep(world, *boxes))
        sleep(world, *boxes)
    wind.strength = 0.0
    for change in (world.add_system, world.remove_system):
        change(wind)
        world.step()
        assert all(is_asleep(world, *boxes))
    world.add_system(wind)
    wind.strength = 0.5
    world.step()
    assert not any(is_asleep(world, *boxes))


@pytest.mark.parametrize("column", [False, True])
def test_a_system_that_moves_a_sleeper_within_the_step_wakes_it(column):
    def kick():
        if kicked and column:
            world.bodies.linear_velocity[world.bodies.row_of(kicked.pop()), 0] = 1.0
        elif kicked:
            part(world, kicked.pop(), RigidBody).linear_velocity = (1.0, 0.0)

    world, kicked = sleepy_world(), []
    boxes = tower(world, 0.0)
    world.add_system(Calls(Phase.FORCES, kick))
    sleep(world, *boxes)
    kicked.append(boxes[2])
    world.step()
    assert not any(is_asleep(world, *boxes))
    assert position(world, boxes[2])[0] > 0.0


@pytest.mark.parametrize("cause", ["floor moved", "floor without friction"])
@pytest.mark.parametrize("restored", [False, True])
def test_a_query_hides_no_change_of_what_sleepers_stand_on(cause, restored):
    world, boxes = sleeping_tower()
    ground = min(world.get_entities())
    if cause == "floor moved":
        world.component_for_entity(ground, Transform).position = (0.0, -2.0)
    else:
        world.component_for_entity(ground, AABBCollider).friction = 0.0
    assert world.query_point((0.0, 0.5)) == [boxes[0]]
    if restored:
        snapshot = world.snapshot()
        world.step()
        world.restore(snapshot)
    world.step()
    assert not any(is_asleep(world, *boxes))
