"""Bodies that are caught: in a slot little wider than themselves, between a wall that moves and one that stands."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_modes import each_mode
from worlds import ball, both_dimensions, box, make_world, run, velocity

from carom.components import SphereCollider, Transform

DT = 1 / 60


@pytest.mark.slow
@each_mode
@both_dimensions
@pytest.mark.parametrize("gap", [1e-4, 1e-9, 1e-12])
def test_a_ball_in_a_slot_little_wider_than_itself_slides_along_it(d, mode, gap):
    """It stays in the slot, as if free along it, with its energy; a thousand impacts at most, and a fault says so."""
    world = make_world(d, 0.0, collision=mode, dt=DT)
    for side in (-1.0, 1.0):
        place, half = np.zeros(d), np.full(d, 50.0)
        place[0], half[0] = side * (1.5 + 0.5 * gap), 1.0
        box(world, place, half=half, kind="static", restitution=1.0)
    speed = np.zeros(d)
    speed[:2] = 10.0, 3.0
    caught = ball(world, np.zeros(d), speed, radius=0.5, restitution=1.0)
    for _ in range(10):
        world.step()
        assert len(world.contacts.impacts) <= 1001
    place = world.bodies.position[world.bodies.row_of(caught)]
    assert abs(place[0]) <= gap + 1e-12
    np.testing.assert_allclose(place[1:], [10 * DT * 3.0, *np.zeros(d - 2)], rtol=1e-12)
    np.testing.assert_allclose(np.abs(velocity(world, caught)), speed, rtol=1e-12)
    assert any("beyond" in str(fault) for fault in world.faults)


@both_dimensions
@pytest.mark.parametrize("mode", ["continuous", "event_driven"])
@pytest.mark.parametrize("e", [0.0, 0.5])
def test_a_falling_grain_lands_before_it_is_struck(d, mode, e):
    """It falls by more than its floor is thick within the step: what strikes it late must not find it down there."""
    world = make_world(d, 9.81, collision=mode, dt=1 / 20)
    axis = np.eye(d)[1]
    box(world, -0.005 * axis, half=np.where(axis > 0.0, 0.005, 1.0), kind="static", restitution=e)
    grain = ball(world, 0.0101 * axis, radius=0.01, restitution=e)
    ball(world, 0.9301 * axis, -20.0 * axis, radius=0.01, mass=3.0, restitution=e)
    for _ in range(5):
        world.step()
        height = world.bodies.position[world.bodies.row_of(grain), 1]
        assert height == pytest.approx(0.01, abs=2e-4), world.step_count  # 1 % of the size


@each_mode
def test_a_body_in_a_stack_that_loses_its_collider_falls_free(mode):
    """And nothing looks for the shape that it no longer has, which the checked build would see."""
    for place in range(4):
        world = make_world(gravity=(0.0, -9.81), collision=mode, dt=DT)
        box(world, (0.0, -0.5), half=(50.0, 0.5), kind="static")
        stack = [ball(world, (0.1 * (k % 2), 0.5 + k)) for k in range(5)]
        run(world, 60)
        start = world.component_for_entity(stack[place], Transform).position[1]
        speed = velocity(world, stack[place])[1]
        world.remove_component(stack[place], SphereCollider)
        run(world, 30)
        steps = 30 * 30 if mode == "event_driven" else 30 * 31  # on the parabola; by semi-implicit Euler
        fallen = start + 30 * DT * speed - 9.81 * DT**2 * steps / 2
        assert world.component_for_entity(stack[place], Transform).position[1] == pytest.approx(fallen, abs=1e-9)
        heights = [world.component_for_entity(e, Transform).position[1] for e in stack if e != stack[place]]
        assert min(heights) > 0.4
