"""Filters of contacts: sensors, layers and masks, in every path of a step."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_filters import DT, assert_same_motion, listen, pairs, up
from worlds import ball, both_dimensions, box, floor, make_world, position, run, velocity

from carom.components import AABBCollider
from carom.framework import Phase, System


@pytest.mark.slow
@both_dimensions
@pytest.mark.parametrize("shape", [ball, box])
def test_a_sensor_between_bouncing_bodies_changes_nothing(d, shape):
    """Two balls bounce to and fro through a sensor, also at the moment of their impact; both begin and end with it."""

    def scene(sensor):
        world = make_world(d)
        a, b = ball(world, -1.0, 2.0, restitution=1.0), ball(world, 1.0, -2.0, restitution=1.0)
        if sensor:
            shape(world, 0.0, kind="static", sensor=True, restitution=1.0)
        return world, a, b

    (plain, a, b), (world, *_) = scene(False), scene(True)
    told = listen(world)
    for _ in range(60):
        plain.step()
        world.step()
        assert_same_motion(plain, world, (a, b))
    assert ("impact", a, b) in told
    others = [event for event in told if event[2] == 3]
    assert {event[0] for event in others} == {"begin", "stay", "end"}
    assert sorted(event for event in others if event[0] != "stay") == [
        ("begin", a, 3), ("begin", b, 3), ("end", a, 3), ("end", b, 3)
    ]  # fmt: skip
    assert not any(world.contacts.impacts.entity_b == 3)


@both_dimensions
@pytest.mark.parametrize("mine", [False, True])
def test_a_sensor_that_falls_or_lies_below_supports_nothing(d, mine):
    """A sensor falls through the floor, and a body through a sensor floor: free fall, v = -g t and the discrete sum."""
    world = make_world(d, gravity=10.0)
    ground = floor(world, sensor=not mine)
    falling = ball(world, up(d, 1.0), sensor=mine)
    told = listen(world)
    run(world, 90)
    steps = np.arange(1, 91)
    assert velocity(world, falling)[1] == pytest.approx(-10 * 90 * DT, rel=1e-12)
    assert position(world, falling)[1] == pytest.approx(1 - 10 * DT**2 * steps.sum(), rel=1e-12)
    assert [event for event in told if event[0] != "stay"] == [("begin", ground, falling), ("end", ground, falling)]
    assert position(world, ground)[1] == -0.5


@both_dimensions
def test_a_sensor_on_a_body_at_rest(d):
    """In, on and just under the floor: a body at rest is unchanged; a sensor that it does not touch never begins."""

    def scene(*tops):
        world = make_world(d, gravity=10.0)
        ground, body = floor(world), box(world, up(d, 0.5))
        sensors = [box(world, up(d, top - 0.25), half=0.25, kind="static", sensor=True) for top in tops]
        return world, ground, body, sensors

    plain, ground, body, _ = scene()
    world, _, _, (reached, missed) = scene(0.1, -0.03)
    told = listen(world)
    for _ in range(60):
        plain.step()
        world.step()
        assert_same_motion(plain, world, (body,))
        assert pairs(world.contacts) == [(ground, body), (body, reached)]
    assert missed not in {entity for event in told for entity in event[1:]}
    assert {contact.entity_b: contact.normal_impulse > 0 for contact in world.contacts.of(body)} == {
        ground: True, reached: False
    }  # fmt: skip


def test_a_sensor_behind_a_wall_is_not_touched_by_what_bounces_off_it():
    """Free flight at 60 m/s would end a metre behind: it is reflected, and touches a sensor on the near side."""
    world = make_world()
    wall = box(world, (0.0, 0.0), half=(0.25, 3), kind="static", restitution=1.0)
    for x in (0.8, -0.9):
        box(world, (x, 0.0), half=(0.2, 3), kind="static", sensor=True)
    flying = ball(world, -0.95, 60.0, radius=0.1, restitution=1.0)
    told = listen(world)
    world.step()  # 0.6 m to the wall, then 0.4 m back: to x = -0.75
    assert position(world, flying)[0] == pytest.approx(-0.75, abs=1e-12)
    assert [event for event in told if event[0] != "stay"] == [
        ("begin", wall, flying), ("begin", 3, flying), ("impact", wall, flying)
    ]  # fmt: skip
    np.testing.assert_allclose(world.contacts.depth[1], 0.15, atol=1e-12)  # the sensor ends at -0.7


def test_sensors_meet_sensors_and_kinematic_bodies_and_are_found_by_queries():
    world = make_world()
    one = ball(world, 0.0, sensor=True)
    two = ball(world, 0.7, kind="kinematic", sensor=True)
    three = box(world, (0.0, 0.7), kind="static")
    world.step()
    assert pairs(world.contacts) == [(one, two), (one, three), (two, three)]
    assert world.query_point((-0.4, 0.0)) == [one]
    assert world.query_sphere((0.35, 0.0), 0.1) == [one, two]
    assert world.query_aabb((-3.0, -3.0), (3.0, 3.0)) == [one, two, three]


def test_a_body_may_become_a_sensor_and_back_between_steps():
    """As a sensor it falls freely and stays in contact; then solid, it is pushed out without gaining speed."""
    world = make_world(gravity=10.0)
    floor(world)
    body = box(world, (0.0, 0.5))
    run(world, 30)
    told = listen(world)
    start = velocity(world, body)[1]
    world.component_for_entity(body, AABBCollider).sensor = True
    run(world, 6)
    assert velocity(world, body)[1] == pytest.approx(start - 10 * 6 * DT, rel=1e-12)
    world.component_for_entity(body, AABBCollider).sensor = False
    world.step()
    assert abs(velocity(world, body)[1]) < 0.2  # 10 m/s^2 in one step: 0.17
    run(world, 200)
    assert position(world, body)[1] == pytest.approx(0.5, abs=0.01)
    assert {event[0] for event in told} == {"stay"}


def test_layers_changed_between_steps_let_go_and_catch_again():
    """A body at rest whose floor is excluded by its mask falls freely in that very step, without support."""
    world = make_world(gravity=10.0)
    ground = floor(world)
    body = box(world, (0.0, 0.5))
    other = box(world, (5.0, 0.5))
    run(world, 60)
    start, told = velocity(world, body)[1], listen(world)
    world.component_for_entity(body, AABBCollider).mask = 2
    world.step()
    assert velocity(world, body)[1] == pytest.approx(start - 10 * DT, rel=1e-12)
    assert told == [("stay", ground, other), ("end", ground, body)]
    told.clear()
    world.component_for_entity(body, AABBCollider).mask = 1
    world.step()
    assert told == [("begin", ground, body), ("stay", ground, other)]
    assert abs(velocity(world, body)[1]) < 0.2
    run(world, 60)
    assert position(world, body)[1] == pytest.approx(0.5, abs=0.01)


def test_layers_changed_by_a_system_hold_from_broad_phase_on():
    """Whole columns written before NARROW are used in this step."""

    class Ghost(System):
        phase = Phase.FORCES

        def process(self, dt):
            self.world.bodies.sphere_collider.mask[:] = 0 if self.world.step_count % 2 else -1

    world = make_world()
    ball(world, 0.0, sensor=True)
    ball(world, 0.5)
    world.add_system(Ghost())
    for step in range(6):
        world.step()
        assert len(world.contacts) == (step + 1) % 2
        assert len(world.contacts.begin) == (step + 1) % 2
