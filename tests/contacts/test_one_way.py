"""One-way colliders: solid for bodies from the front, not for others, at any speed and from any side."""

from __future__ import annotations

import math

import numpy as np
import pytest
from contacts.helpers_one_way import REST, SHAPES, G, each_shape, make_world, platform, run, throw
from worlds import position, velocity

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import World
from carom.plugins import Physics
from carom.plugins.capsule import CapsuleCollider
from carom.plugins.capsule import plugin as capsule

pytestmark = pytest.mark.slow  # its shapes take long to compile


@each_shape
def test_a_jump_passes_and_lands(shape):
    """As high as without the platform, to the bit; then it stands on it, with a single begin."""
    free = World(Physics(dimensions=2, gravity=(0, -G)))
    alone = free.create_entity(Transform((0, -2)), RigidBody(linear_velocity=(0, 9)))
    world = make_world()
    jumper = throw(world, (0, -2), (0, 9), shape)
    rise = run(free, 0.9, alone)
    heights = run(world, 0.9, jumper)
    assert np.array_equal(heights, rise)
    assert not len(world.contacts.begin)
    begun = []
    for _ in range(120):
        world.step()
        begun += list(world.contacts.begin)
    assert position(world, jumper)[1] == pytest.approx(0.5, abs=REST)
    assert velocity(world, jumper)[1] == pytest.approx(0, abs=1e-6)
    assert [(contact.entity_a, contact.entity_b) for contact in begun] == [(1, jumper)]
    assert begun[0].normal == pytest.approx((0, 1))
    free.close()


@each_shape
@pytest.mark.parametrize("apex", [-0.4, 0.0, 0.3, 0.47])
def test_a_jump_that_ends_inside_falls_back(shape, apex):
    """Varies the apex of the centre over the platform; from 0.5 on it would stand. The fall is free."""
    world = make_world(integrator="velocity_verlet")
    speed = math.sqrt(2 * G * (apex + 2))
    jumper = throw(world, (0, -2), (0, speed), shape)
    t = np.arange(1, 91) / 60
    heights = run(world, 1.5, jumper)[:, 0]
    assert abs(heights - (-2 + speed * t - G * t**2 / 2)).max() < 1e-12
    assert heights.max() == pytest.approx(apex, abs=G / 60**2 / 8)  # sampled


@each_shape
@pytest.mark.parametrize("speed", [0, 10, 30, 45])
def test_falls_are_stopped_at_any_speed_that_does_not_leap_over_it(shape, speed):
    """A body of size 1 at 45 m/s moves 0.75 per step: its centre may be below the platform in between."""
    for phase in (0.0, 0.1, 0.2, 0.35, 0.6):
        world = make_world()
        faller = throw(world, (0.3, 2 + phase), (1.0, -speed), shape)
        heights = run(world, 0.9, faller)
        assert heights[-1] == pytest.approx(0.5, abs=REST)
        assert heights.min() > 0.45


@pytest.mark.parametrize("angle", [0.5, *(pytest.param(angle, marks=pytest.mark.long) for angle in (0.0, -2.0))])
def test_thousands_of_bodies_from_everywhere(angle):
    """What was never so high that the end meets it within 60 degrees flies freely, to the bit; what came from the front
    never gets behind."""
    rng, n, radius, size, seconds = np.random.default_rng(7), 4_000, 0.3, 4.0, 1.0
    places, speeds = rng.uniform(-5, 5, (n, 2)), rng.uniform(-8, 8, (n, 2))
    paths = []
    for segment in (True, False):
        world = World(Physics(dimensions=2, gravity=(0, -G)), capsule)
        collider = CapsuleCollider(0.0, size / 2, one_way=(-1, 0), mask=-1 if segment else 0)
        world.create_entity(Transform((0, 0), angle - math.pi / 2), collider)
        world.create_entity(Transform((1e5, -1)), AABBCollider(0.5))
        balls = SphereCollider.many(radius=radius, layer=2, mask=1)
        world.create_entities(n, Transform.many(places), RigidBody.many(linear_velocity=speeds), balls)
        path = [world.bodies.dynamic.position.copy()]
        for _ in range(round(60 * seconds)):
            world.step()
            path.append(world.bodies.dynamic.position.copy())
        paths.append(np.array(path))
    met, free = paths
    along, out = np.array((math.cos(angle), math.sin(angle))), np.array((-math.sin(angle), math.cos(angle)))
    low, at = free @ out - radius, free @ along
    behind = (low < -0.5 * radius).all(0)  # all the time
    assert behind.sum() > 400
    assert np.array_equal(met[:, behind], free[:, behind])
    crosses = (low[:-1] > 0) & (low[1:] < 0)
    first = crosses.argmax(0)
    lands = crosses.any(0) & (low[0] > 0) & (abs(at) < size / 2)[[first, first + 1], np.arange(n)].all(0)
    lands &= abs(met @ along).max(0) < size / 2  # as long as it is over the segment
    assert lands.sum() > 20
    assert (met[:, lands] @ out).min() > radius - 0.01


def test_a_stack_stands_on_it_however_heavy():
    """A light box under 400 times its mass overlaps by more than the slack; a supported body stays supported."""
    world = make_world()
    light = throw(world, (0, 0.5))
    heavy = world.create_entity(Transform((0, 1.5)), RigidBody(mass=400.0), AABBCollider(0.5))
    heights = run(world, 5, light, heavy)
    assert heights[-1, 0] > 0.4
    assert heights[-1, 1] > 1.2
    assert [contact.entity_a for contact in world.contacts.of(light)].count(light) == 2
    assert 1 in [contact.entity_b for contact in world.contacts.of(light)]


@each_shape
def test_a_body_from_the_side_passes(shape):
    """The end of a platform is not a wall: the normal of a ball leans by more than 60 degrees below height 0.25."""
    for height in (-0.45, 0.0, 0.24):
        world = make_world()
        walker = world.create_entity(
            Transform((-4, height)), RigidBody(linear_velocity=(6, 0), gravity_scale=0), SHAPES[shape]())  # fmt: skip
        run(world, 1.3, walker)
        assert position(world, walker) == pytest.approx((-4 + 6 * 78 / 60, height))


def test_a_body_that_falls_past_the_end_is_not_caught():
    """A box that falls beside the end and moves in under it: it meets the line where it is not over the segment."""
    world = make_world()
    faller = throw(world, (-2.7, 2.0), (1.5, -20.0))
    run(world, 0.2, faller)
    assert velocity(world, faller)[0] == pytest.approx(1.5)
    assert position(world, faller)[1] < -1.0
    on_the_edge = throw(world, (-2.45, 2.0), (0.0, -20.0))
    run(world, 0.5, on_the_edge)
    assert position(world, on_the_edge)[1] == pytest.approx(0.5, abs=REST)


@each_shape
def test_slides_off_the_end(shape):
    """Never thrown: it leaves with its speed, and falls freely, past the end."""
    world = make_world()
    slider = throw(world, (0, 0.5), (2.0, 0.0), shape)
    heights = run(world, 2.2, slider)
    assert velocity(world, slider)[0] == pytest.approx(2.0, abs=0.6 if shape == "ball" else 1e-9)
    assert heights.max() < 0.5 + 1e-6
    assert heights[-1, 0] < -1.0
    assert velocity(world, slider)[1] < -5.0


@each_shape
def test_a_row_of_segments_and_floors_has_no_seams(shape):
    """From a floor onto segments, over their seams, and onto a floor again."""
    pieces = [(Transform((4 * k, 0)), platform()) for k in range(3)]
    floors = [(Transform((x, -0.5)), AABBCollider((2, 0.5))) for x in (-4, 12)]
    world = make_world(*pieces, *floors)
    slider = throw(world, (-4, 0.5), (5.0, 0.0), shape)
    heights = run(world, 3.2, slider)
    assert velocity(world, slider)[0] == pytest.approx(5.0, abs=1e-9)
    assert abs(heights - 0.5).max() < REST


@pytest.mark.parametrize("angle", [0.4, math.pi])
def test_the_front_turns_with_the_transform(angle):
    """Without gravity: a ball from the front stays outside, one from the back comes through."""
    for front, offset in ((-1, (0.0, 0.0)), (1, (1.0, -2.0))):
        world = World(Physics(dimensions=2), capsule)
        line = CapsuleCollider(0.0, 2.0, one_way=(front, 0), restitution=1.0, offset=offset)
        world.create_entity(Transform((3, 4), angle), line)
        world.create_entity(Transform((1e5, -1)), AABBCollider(0.5))
        turn = np.array(((math.cos(angle), -math.sin(angle)), (math.sin(angle), math.cos(angle))))
        middle = np.array((3, 4)) + turn @ offset
        out = turn @ (front, 0)
        ahead = throw(world, middle + 2.9 * out, -5 * out, "ball")
        behind = throw(world, middle + turn @ (0, 1.2) - 3 * out, 5 * out, "ball")
        run(world, 1.0)
        assert (position(world, ahead) - middle) @ out == pytest.approx(0.5 + 2.6, abs=1e-9)
        assert (position(world, behind) - middle) @ out == pytest.approx(2.0)
