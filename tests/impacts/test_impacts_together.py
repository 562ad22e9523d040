"""Impacts at the same time: mirrored starts stay mirrored, ids decide nothing, to the bit; momentum and energy."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from helpers_pairwise import pairwise
from worlds import both_dimensions

from carom.lab import testing as kit
from carom.plugins.joints import Distance, Joints
from carom.systems.impacts.group import WORK

each_collision = pytest.mark.parametrize("mode", ["discrete", "continuous", "event_driven"])
TOUCHING = 0.5 * math.sqrt(3) + 1e-15  # rows of balls that touch, and do not overlap by a rounding error


def play(balls, mode, steps, *, d=2, order=None, walls=(), **rules):
    """(steps, balls, 2, d) positions and velocities of the balls (place, velocity, material), created in ``order``."""
    world = kit.make_world(d, collision=mode, max_impacts_per_step=1000, **rules)
    ids = {}
    for n in order if order is not None else range(len(balls)):
        place, velocity, material = balls[n]
        ids[n] = kit.ball(world, tuple(place), tuple(velocity), **material)
    for place, half in walls:
        kit.box(world, place, half=half, kind="static", restitution=1.0)
    states = []
    for _ in range(steps):
        world.step()
        states.append([[kit.position(world, ids[n]), kit.velocity(world, ids[n])] for n in range(len(balls))])
    assert world.stats().counters["capped_impacts"] == 0
    world.close()
    return np.array(states)


def line_up(*rows, **material):
    """Balls (place, velocity, material)."""
    return [(p, v, {"radius": 0.5, **material}) for p, v in rows]


def assert_kept(states, masses, before, energy):
    """Momentum, and energy where it is kept, to rounding."""
    masses = np.asarray(masses)
    velocity = states[:, :, 1]
    momentum = (masses[:, None] * velocity).sum(axis=1)
    scale = np.abs(masses[:, None] * before).sum()
    assert np.abs(momentum - (masses[:, None] * before).sum(axis=0)).max() <= 1e-15 * scale
    if energy:
        kinetic = (masses[:, None] * velocity**2).sum(axis=(1, 2))
        np.testing.assert_allclose(kinetic, (masses[:, None] * before**2).sum(), rtol=4e-15)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mode", "restitution", "gap"),
    pairwise(("discrete", "continuous", "event_driven"), (1.0, 0.9, 0.5), (0.0, 1 / 32)),
)
def test_a_rack_of_fifteen(mode, restitution, gap):
    """Touching and with gaps: mirrored to the bit as long as it rolls, whatever the order of ids, in every mode."""
    spots = [(TOUCHING * row * (1 + gap), (k - row / 2) * (1 + gap)) for row in range(5) for k in range(row + 1)]
    balls = line_up(((-3.0, 0.0), (20.0, 0.0)), *((spot, (0, 0)) for spot in spots), restitution=restitution)
    states = play(balls, mode, 100)
    partners = [0, *(1 + spots.index((x, -y)) for x, y in spots)]
    np.testing.assert_array_equal(states[:, partners] * (1.0, -1.0), states)
    assert_kept(states, np.ones(16), np.array([v for _, v, _ in balls]), restitution == 1.0)
    assert np.abs(states[-1, :, 1]).max(axis=1).min() > 0.0 or restitution == 1.0  # all have been struck
    rng = np.random.default_rng(0)
    for _ in range(2):
        again = play(balls, mode, 100, order=rng.permutation(16))
        np.testing.assert_array_equal(again, states)


@each_collision
@pytest.mark.parametrize("speed", [8.0, 4.0], ids=["struck", "lands"])
def test_what_else_comes_at_that_time_parts_none(mode, speed):
    """A mirrored start stays one, to the bit, where a ball on a rope is struck 1,024 m away at that same time, or one
    lands that is too slow to bounce."""
    e = {"radius": 0.625, "restitution": 1.0}
    balls = [((0.0, 0.75), (0.0, 0.0), e), ((1024.0, 0.75), (0.0, 0.0), e), ((0.0, -0.75), (0.0, 0.0), e),
             ((1023.0 - 4.0625 * speed / 8, 0.0), (speed, 0.0), e), ((-5.0625, 0.0), (8.0, 0.0), e)]  # fmt: skip
    threshold = 3.3 if speed < 8.0 else 0.0  # times 0.8, the cosine at the touch
    near = play(balls[::2], mode, 60, dt=1 / 64, restitution_threshold=threshold)
    world = kit.make_world(collision=mode, dt=1 / 64, restitution_threshold=threshold)
    world.add_plugin(Joints())
    ids = [kit.ball(world, place, velocity, **e) for place, velocity, e in balls]
    if speed == 8.0:
        world.create_entity(Distance(None, ids[1], point_a=(1024.0, 3.0)))
    for _ in range(60):
        world.step()
    states = np.array([[kit.position(world, i), kit.velocity(world, i)] for i in ids[::2]])
    assert np.abs(states[1, 1]).min() > 3.0
    np.testing.assert_array_equal(states[0], states[1] * (1.0, -1.0))
    np.testing.assert_array_equal(states, near[-1])
    world.close()


@pytest.mark.slow
@both_dimensions
@each_collision
def test_any_order_of_ids(mode, d):
    """Stars of balls of any mass, restitution and friction that strike one in their middle all at once."""
    rng = np.random.default_rng(d)
    for _ in range(3):
        balls = [(np.zeros(d), np.zeros(d), {"radius": 0.5, "restitution": 0.8, "friction": 0.3})]
        for axis, sign in itertools.product(range(d), (-1.0, 1.0)):
            way = sign * np.eye(d)[axis]
            for far in range(1, int(rng.integers(2, 4))):
                material = {
                    "radius": 0.5, "mass": float(rng.uniform(0.5, 2)), "friction": float(rng.choice([0.0, 0.5])),
                    "restitution": float(rng.choice([0.5, 1.0])),
                }  # fmt: skip
                balls.append((way * (1.0 + 1.5 * far), -way * 8.0 * far, material))
        states = play(balls, mode, 60, d=d)
        for _ in range(2):
            again = play(balls, mode, 60, d=d, order=rng.permutation(len(balls)))
            np.testing.assert_array_equal(again, states)


@pytest.mark.slow
@both_dimensions
@each_collision
def test_light_and_heavy_keep_their_energy(mode, d):
    """Masses over six decades: where the passes over a group are not enough, what still approaches strikes again."""
    for seed in range(8):
        rng = np.random.default_rng(seed)
        balls = [(np.zeros(d), np.zeros(d), {"radius": 0.5, "mass": 10 ** rng.uniform(-3, 3), "restitution": 1.0})]
        for axis, sign in itertools.product(range(d), (-1.0, 1.0)):
            way = sign * np.eye(d)[axis] + rng.normal(size=d) * 0.15
            way /= np.linalg.norm(way)
            balls.append((way * 1.5, -way * 8.0, {**balls[0][2], "mass": 10 ** rng.uniform(-3, 3)}))
        states = play(balls, mode, 12, d=d)
        assert_kept(states, [m["mass"] for _, _, m in balls], np.array([v for _, v, _ in balls]), energy=False)
        masses = np.array([m["mass"] for _, _, m in balls])[:, None]
        kinetic = (masses * states[:, :, 1] ** 2).sum(axis=(1, 2))
        np.testing.assert_allclose(kinetic, (masses * np.array([v for _, v, _ in balls]) ** 2).sum(), rtol=2e-14)


@pytest.mark.parametrize("restitution", [1.0, 0.3])
def test_a_light_ball_is_not_shot_out_between_two_heavy_ones(restitution):
    """All at once it would leave at 65 to 100 times their speed; one after the other, at twice per impact."""
    speed, across = 5.0, 0.03
    with kit.make_world(2, collision="discrete") as world:
        kit.ball(world, (0, 0), radius=0.5, mass=1e-3, restitution=restitution)
        for x in (-1.0, 1.0):
            kit.ball(world, (1.5 * x, across), (-speed * x, 0), radius=1.0, mass=1e3, restitution=restitution)
        energy = world.kinetic_energy()
        world.step()
        fastest = np.linalg.norm(world.bodies.linear_velocity, axis=1).max()
        assert speed < fastest <= 2.0 * speed * world.stats().counters["impacts"]
        assert world.kinetic_energy() <= energy * (1.0 + 1e-12)


@pytest.mark.slow
def test_groups_take_no_more_work_than_a_step_has():
    """Four hundred elastic balls that overlap: ten thousand impacts at one time, which kept a step busy for seconds."""
    random = np.random.default_rng(0)
    with kit.make_world(2) as world:
        for place, velocity in zip(random.uniform(-2, 2, (400, 2)), random.uniform(-9, 9, (400, 2)), strict=True):
            kit.ball(world, place, velocity, radius=0.5, restitution=1.0)
        momentum = world.bodies.linear_velocity.sum(axis=0)
        visits = []
        for _ in range(3):
            world.step()
            visits.append(world.physics.state.impacts.group_visits)
        assert visits[0] > 0
        assert max(visits) <= WORK  # a group that is too large is solved one after the other
        np.testing.assert_allclose(world.bodies.linear_velocity.sum(axis=0), momentum, rtol=0, atol=1e-9)


@each_collision
def test_into_a_corner_and_onto_a_seam(mode):
    """Two walls at once: each takes its part; two flush boxes share what one would take."""
    walls = [((3.0, 0.0), (1.0, 9.0)), ((0.0, 3.0), (9.0, 1.0))]
    balls = line_up(((0.5, 0.5), (6.0, 6.0)), restitution=1.0)
    states = play(balls, mode, 30, walls=walls)
    assert states[-1, 0, 1].tolist() == [-6.0, -6.0]
    world = kit.make_world(collision=mode)
    for x in (-1.0, 1.0):
        kit.box(world, (x, -1.0), half=1.0, kind="static", restitution=1.0)
    ball = kit.ball(world, (0.0, 2.0), (0.0, -6.0), restitution=1.0)
    impulses = []
    for _ in range(30):
        world.step()
        impulses += world.contacts.impacts.normal_impulse.tolist()
    assert kit.velocity(world, ball).tolist() == [0.0, 6.0]
    assert impulses == [6.0, 6.0]


@each_collision
def test_friction_of_several_takes_no_more_than_there_is(mode):
    """A ball slides onto a seam of rough boxes: together they stop it, and do not send it back."""
    world = kit.make_world(collision=mode)
    for x in (-1.0, 1.0):
        kit.box(world, (x, -1.0), half=1.0, kind="static", restitution=1.0, friction=5.0)
    box = kit.box(world, (-0.5, 1.5), (1.0, -1.0), half=0.5, restitution=1.0, friction=5.0)
    kit.run(world, 90)
    velocity = kit.velocity(world, box)
    assert abs(velocity[0]) <= 1e-15
    assert velocity[1] == 1.0
