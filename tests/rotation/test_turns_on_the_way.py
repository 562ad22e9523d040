"""What turns far in a step meets what it passes, against poses sampled throughout the step."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from rotation.helpers_turning import box, part, turning_world, wall
from worlds import MODES, run

from carom.components import RigidBody, SphereCollider, Transform
from carom.plugins.rotation import BoxCollider, Spin

PAIRS, APART, POSES = 250, 40.0, 4000
HALF = np.array((1.0, 0.01))


def least_gaps(places, velocities, angles, spins, radii, dt):
    """Of each pair, by looks at so many times: the gap of a ball from a bar about the origin, negative inside."""
    least = np.full(len(places), np.inf)
    for t in np.linspace(0.0, dt, POSES):
        angle, at = angles + spins * t, places + velocities * t
        c, s = np.cos(angle), np.sin(angle)
        own = np.abs(np.stack((c * at[:, 0] + s * at[:, 1], c * at[:, 1] - s * at[:, 0]), 1)) - HALF
        outside = np.hypot(*np.maximum(own, 0.0).T)
        least = np.minimum(least, outside + np.minimum(own.max(axis=1), 0.0) - radii)
    return least


@cache
def bars_and_balls(seed, fastest):
    """Kinematic bars, and a ball beside each: their motions, and the least gaps in a step and in what a usual substep
    looks ahead."""
    random, dt = np.random.default_rng(seed), 1 / 60
    spins, angles = random.uniform(-fastest, fastest, PAIRS), random.uniform(-3, 3, PAIRS)
    velocities, radii = random.uniform(-5, 5, (PAIRS, 2)), random.uniform(0.02, 0.2, PAIRS)
    direction, far = random.uniform(-np.pi, np.pi, PAIRS), random.uniform(0.1, 1.4, PAIRS)
    places = far[:, None] * np.stack((np.cos(direction), np.sin(direction)), 1)
    motions = places, velocities, angles, spins, radii
    free = least_gaps(*motions, 0.0) > 0.02  # apart where the step starts
    motions = [column[free] for column in motions]
    return *motions, least_gaps(*motions, dt), least_gaps(*motions, 1.25 * dt)


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("fastest", [50.0, 500.0])
@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.long)])
def test_a_thin_bar_passes_through_no_ball_and_strikes_none_that_it_does_not_meet(seed, fastest, mode):
    places, velocities, angles, spins, radii, gaps, soon = bars_and_balls(seed, fastest)
    with turning_world(collision=mode, on_fault="ignore") as world:
        balls = []
        for k, place in enumerate(places):
            centre, turns = np.array((k * APART, 0.0)), RigidBody(kind="kinematic")
            world.create_entity(Transform(centre, angles[k]), turns, Spin(spins[k]), BoxCollider(HALF))
            body = RigidBody(linear_velocity=velocities[k])
            balls.append(world.create_entity(Transform(centre + place), body, SphereCollider(radii[k])))
        world.step()
        after = world.bodies.linear_velocity[world.bodies.rows_of(balls)]
    struck = np.abs(after - velocities).max(axis=1) > 1e-9
    assert struck[gaps < -1e-3].all()
    assert not struck[soon > 5e-3].any()
    assert min((gaps < -1e-3).sum(), (gaps > 1e-3).sum()) > 15


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("e", [0.9, 1.0])
@pytest.mark.parametrize("w", [1.0, 3.0, 9.0])
def test_a_kinematic_bar_takes_along_what_stands_in_its_way(w, e, d, mode):
    """However it bounces: it never is deeper in it than a twentieth of its width, and leaves as fast as it was hit."""
    half, radius, x, y = np.array((2.0, 0.1, 0.5)), 0.15, 1.2, 0.5
    with turning_world(d, collision=mode) as world:
        about = w if d == 2 else (0.0, 0.0, w)
        bar = world.create_entity(Transform((0,) * d), RigidBody(kind="kinematic"), Spin(about), BoxCollider(half[:d]))
        collider = SphereCollider(radius, restitution=e)
        ball = world.create_entity(Transform((x, y, 0)[:d]), RigidBody(), Spin(), collider)
        least = np.inf
        for _ in range(round(0.8 / w * 60)):
            world.step()
            q = np.atleast_1d(part(world, bar, Transform).rotation)
            angle, at = q[0] if d == 2 else 2 * np.arctan2(q[3], q[0]), np.array(part(world, ball, Transform).position)
            least = min(least, np.cos(angle) * at[1] - np.sin(angle) * at[0])  # of its middle above that of the bar
        speed = np.linalg.norm(part(world, ball, RigidBody).linear_velocity)
    assert least > half[1] + 0.9 * radius - 1e-6
    assert speed > 0.9 * w * x


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("w", [0.2, 2.0])
def test_a_turntable_whose_rim_goes_far_carries_a_box_level(w, mode):
    """It leaves the circle by w dt / 2 of its way, outwards; but for the next order, w dt of that, and a little."""
    seconds, dt, about = 2.0, 1 / 60, np.array((0, w, 0))
    with turning_world(3, 10, collision=mode, dt=dt) as world:
        table = BoxCollider((9, 0.5, 9), friction=2)
        world.create_entity(Transform((0, -0.5, 0)), RigidBody(kind="kinematic"), Spin(about), table)
        entity = box(world, (1, 0.1, 0), (0.1, 0.1, 0.1), (0, 0, -w), about, friction=2)
        run(world, round(seconds / dt))
        place = part(world, entity, Transform)
        x, q = np.array(place.position), np.array(place.rotation)
    assert abs(x[1] - 0.1) < 1e-4
    assert np.hypot(q[1], q[3]) < 1e-3  # half the tilt
    out = w * w * dt * seconds / 2
    assert np.hypot(x[0], x[2]) == pytest.approx(np.exp(out), rel=2e-3 + w * dt * out)


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES[1:])
@pytest.mark.parametrize("d", [2, 3])
def test_boxes_that_turn_and_fall_through_more_than_a_floor_in_a_step_stay_above_it(d, mode):
    random, boxes = np.random.default_rng(0), 30
    with turning_world(d, 9.81, dt=0.4, collision=mode, on_fault="ignore") as world:
        material: dict[str, Any] = {"restitution": 0.5, "friction": 0.5}
        wall(world, (0, -1, 0)[:d], (1e4, 1.0, 1e4)[:d], **material)
        for k in range(boxes):
            angle, spin = random.uniform(-3, 3), random.uniform(-6, 6)
            turned: Any = angle
            if d == 3:
                spin, turned = random.uniform(-6, 6, d), random.normal(size=4)
                turned /= np.linalg.norm(turned)
            place = (k * APART, random.uniform(2, 10), 0)[:d]
            box(world, place, random.uniform(0.3, 0.7, d), spin=spin, rotation=turned, **material)
        for _ in range(40):
            world.step()
            assert world.bodies.dynamic.position[:, 1].min() > -1.0
        assert world.bodies.dynamic.position[:, 1].min() > 0.0


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
def test_what_turns_fast_does_not_sink_into_what_the_floor_stops(mode):
    """A box that turns and the bar below it fall as fast: on their free ways they may not touch, but the bar is
    stopped. Neither that nor the box's second corner in a step leads in by more than a quarter of its half side: what
    the floor puts out goes into the box."""
    hits = 0
    for seed in range(30):
        random = np.random.default_rng((seed, 5))
        speed, below = random.uniform(2, 8), 0.25 + random.uniform(0, 0.2) * 8 / 60
        with turning_world(collision=mode, on_fault="ignore") as world:
            wall(world, (0, -1), (20, 1))
            bar = box(world, (0, below), (1, 0.25), (0, -speed))
            above = below + 0.25 + np.sqrt(0.125) + random.uniform(0, 0.1)
            place, angle = (random.uniform(-0.3, 0.3), above), random.uniform(0, 1)
            spin = random.choice([-1, 1]) * random.uniform(15, 25)
            turning = box(world, place, (0.25, 0.25), (0, -speed), spin, angle)
            for _ in range(6):
                world.step()
                met = (world.contacts.entity_a == bar) & (world.contacts.entity_b == turning)
                assert (world.contacts.depth[met] < 0.25 * 0.25).all(), seed
                hits += met.any()
    assert hits > 30
