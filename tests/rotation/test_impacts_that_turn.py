"""Impacts at points that are off the centres: rods, boxes and balls, against closed forms and conservation laws."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from rotation.helpers_turning import G, ball, box, motion, turning_world, wall
from worlds import MODES, run

from carom.components import RigidBody, SphereCollider, Transform
from carom.plugins import capsule, convex_hull, convex_polygon
from carom.plugins.rotation import BoxCollider, Spin


@pytest.mark.parametrize("mode", MODES)
def test_colliders_beside_their_body_bounce_without_loss(mode):
    """They are struck where they are at the time of the impact, not where the step ends."""
    random = np.random.default_rng(4)
    with turning_world(collision=mode) as world:
        for place in itertools.product((0.0, 2.5), (0.0, 2.5)):
            velocity, spin = random.normal(0.0, 2.0, 2) - np.array(place) + 1.25, random.normal(0.0, 3.0)
            box(world, place, (0.2, 0.8), velocity, spin, offset=(0.5, 0.3), restitution=1.0)
        before, momentum, struck = world.kinetic_energy(), world.momentum(), 0
        for _ in range(240):
            world.step()
            struck += len(world.contacts)
        assert struck > 2
        assert world.kinetic_energy() == pytest.approx(before, rel=1e-12)
        assert world.momentum() == pytest.approx(momentum, rel=1e-12)


@pytest.mark.plain
@pytest.mark.parametrize("mode", MODES)
def test_a_rod_that_is_struck_off_centre_turns(mode):
    """By an elastic ball at h: J = 2 v / (1/m + 1/M + h^2 / I). The other end stays at rest if h is l / 6, as that is
    the centre of percussion, and the rod is thin."""
    long, thick, v = 1.2, 1e-3, 3.0
    for h in (long / 6, 0.35, -0.5):
        with turning_world(collision=mode) as world:
            rod = box(world, (0, 0), (long / 2, thick / 2), mass=2.0, restitution=1.0)
            small = ball(world, (h, 0.131), (0, -v), radius=0.1, restitution=1.0)
            run(world, 1)
            while motion(world, small)[0][1] == -v:
                world.step()
            (v_rod, w), (v_small, _) = motion(world, rod), motion(world, small)
        inertia = 2.0 * (long * long + thick * thick) / 12
        j = 2 * v / (1 + 1 / 2 + h * h / inertia)
        assert v_small[1] == pytest.approx(-v + j, rel=1e-9)
        assert (v_rod[1], w) == pytest.approx((-j / 2, -j * h / inertia), rel=1e-9)
        if h == long / 6:
            assert v_rod[1] - w * long / 2 == pytest.approx(0.0, abs=2e-5)


@pytest.mark.parametrize("mode", MODES)
def test_a_flat_landing_does_not_turn(mode):
    """To the bit: with e v, and w = 0."""
    for e in (0.25, 0.5, 1.0):
        with turning_world(collision=mode) as world:
            wall(world, (0, -1), (20, 1), restitution=e)
            entity = box(world, (1.25, 0.52), (0.5, 0.5), (0, -4.0), restitution=e)
            run(world, 4)
            v, w = motion(world, entity)
        assert (v[1], w) == (4.0 * e, 0.0)


HALF, TURNS = np.array((0.5, 0.3, 0.4)), np.arange(6) * math.pi / 3
OCTAHEDRON = 0.3 * np.stack((math.sqrt(2) * np.cos(TURNS), (-1.0) ** np.arange(6), math.sqrt(2) * np.sin(TURNS)), 1)
LYING = {
    "box": BoxCollider(HALF),
    "hull": convex_hull.ConvexHullCollider(HALF * list(itertools.product((-1, 1), repeat=3))),
    "capsule": capsule.CapsuleCollider(0.3, 0.5),
    "octahedron": convex_hull.ConvexHullCollider(OCTAHEDRON),
}


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("mode", [pytest.param("discrete", marks=pytest.mark.plain), "continuous", "event_driven"])
@pytest.mark.parametrize("shape", LYING)
def test_what_lands_flat_in_space_does_not_turn(shape, mode):
    """On the ground, at three bounces, and on its like, which is free: with e v, and w = 0 but for rounding. An
    octahedron lies on three corners, a capsule on its side."""
    turn = (math.sqrt(0.5), 0, 0, math.sqrt(0.5)) if shape == "capsule" else (math.cos(0.3), 0, math.sin(0.3), 0)
    cases = ((0.5, 9.81, False), (1.0, 0.0, False), (0.5, 0.0, True))
    for e, gravity, like in cases[:2] if shape == "octahedron" else cases:  # two of these share a hexagon
        with turning_world(3, gravity, capsule.plugin, convex_hull.plugin, collision=mode) as world:
            if not like:
                wall(world, (0, -1, 0), (20, 1, 20), restitution=e)
            for k in range(2 if like else 1):
                body, collider = RigidBody(1.0, (0, (-4.0, 1.0)[k], 0)), LYING[shape].copy()
                collider.restitution = e
                place = Transform((1.25, 0.32 - 0.61 * k, 0.37), turn)
                entity = world.create_entity(place, body, Spin(), collider)
            for _ in range(40 if gravity else 4):
                world.step()
                v, w = motion(world, entity)
                assert np.abs(w).max() < 1e-12
            assert not gravity or world.stats().counters["impacts"] == 3
            if not gravity:
                assert v[1] == pytest.approx(-2.75 if like else 4.0, rel=1e-12)


def boxes_and_balls(world, seed, n=36, speed=3.0, **collider):
    """Boxes of many sizes and balls on a grid, with any velocities and spins, between four walls."""
    random = np.random.default_rng(seed)
    for x, y in ((0, -5.5), (0, 5.5), (-5.5, 0), (5.5, 0)):
        wall(world, (x, y), (6, 0.5) if x == 0 else (0.5, 6), **collider)
    places = (np.stack(np.meshgrid(np.arange(6), np.arange(6)), -1).reshape(-1, 2)[:n] + 0.5) / 6 * 10 - 5
    for k in range(n):
        body = RigidBody(random.uniform(0.5, 2.0), random.normal(0, speed, 2))
        spin, half = Spin(random.normal(0, 4)), random.uniform(0.2, 0.45, 2)
        shape = BoxCollider(half, **collider) if k % 2 else SphereCollider(0.35, **collider)
        world.create_entity(Transform(places[k], random.uniform(0, 6)), body, spin, shape)
    assert len(world.bodies.dynamic) == n  # all are in the world


@pytest.mark.slow
@pytest.mark.parametrize(("mu", "e"), [(0.0, 1.0), (0.5, 1.0), (0.5, 0.5)])
def test_a_thousand_pairs_keep_momentum_angular_momentum_and_smooth_ones_energy(mu, e):
    """Boxes of any size, mass, angle and spin meet off their centres, each pair on its own."""
    random = np.random.default_rng(7)
    with turning_world(collision="event_driven", max_impacts_per_step=64) as world:
        n = 1000
        away = np.stack(np.meshgrid(np.arange(40), np.arange(25)), -1).reshape(-1, 2) * 8.0
        place = np.concatenate((away, away + np.stack((np.full(n, 1.6), random.uniform(-0.8, 0.8, n)), 1)))
        velocity = np.concatenate((random.uniform(1, 4, (n, 2)) * (1, 0.1), random.uniform(-4, -1, (n, 2)) * (1, 0.1)))
        world.create_entities(
            2 * n, Transform.many(place, random.uniform(0, 6, 2 * n)),
            RigidBody.many(random.uniform(0.2, 5, 2 * n), velocity), Spin.many(random.uniform(-6, 6, 2 * n)),
            BoxCollider.many(random.uniform(0.1, 0.5, (2 * n, 2)), restitution=e, friction=mu),
        )  # fmt: skip
        bodies = world.bodies
        inertia = np.array([spin.moments for _, spin in world.get_component(Spin)]).reshape(-1)

        def of_pairs():
            """Of each pair: energy, momentum, angular momentum about its own origin."""
            m, v, w = bodies.mass, bodies.linear_velocity, bodies.spin.angular_velocity
            x = bodies.position - np.concatenate((away, away))
            about = m * (x[:, 0] * v[:, 1] - x[:, 1] * v[:, 0]) + inertia * w
            energy = 0.5 * m * (v**2).sum(1) + 0.5 * inertia * w**2
            return [values[:n] + values[n:] for values in (energy, m * v[:, 0], m * v[:, 1], about)]

        first = of_pairs()
        run(world, 30)
        last = of_pairs()
        assert world.stats().counters["impacts"] > 500
    assert np.allclose(last[1:3], first[1:3], rtol=1e-12, atol=1e-11)
    if e == 1.0:  # else some pairs rattle until they rest on each other; one corner on a corner may count as resting
        assert np.sum(np.abs(last[3] - first[3]) > 1e-12 * np.abs(first[3]) + 2e-11) <= 1
    if mu == 0.0:
        assert np.sum(np.abs(last[0] / first[0] - 1) > 1e-12) <= 1
        assert np.all(last[0] <= first[0] * (1 + 1e-12))
    else:
        assert np.all(last[0] <= first[0] * (1 + 1e-12))
        assert last[0].sum() < 0.98 * first[0].sum()


@pytest.mark.parametrize("mode", MODES[1:])
def test_where_two_have_bounced_they_do_not_touch_again_as_they_have_turned_since(mode):
    shape = convex_polygon.ConvexPolygonCollider(((-0.4, -0.2), (0.4, -0.3), (0.2, 0.3)), restitution=1.0)
    with turning_world(2, 0, convex_polygon.plugin, collision=mode) as world:
        for place, angle, mass, velocity, spin in (
            ((-1.07270967, 0.55748379), 49.90143473864663, 1.0, (0.54818994, -4.16731752), 43.857732720865975),
            ((-0.34060533, 0.19047684), 5.700842573914769, 2.0, (2.5351161, 8.91141697), 14.667940476500256),
        ):  # fmt: skip
            world.create_entity(Transform(place, angle), RigidBody(mass, velocity), Spin(spin), shape.copy())
        before = world.kinetic_energy()
        world.step()
        assert world.stats().counters["impacts"] == 1
        assert world.kinetic_energy() == pytest.approx(before, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(("mu", "e"), [(0.0, 1.0), (0.4, 0.0), (0.4, 0.5), (0.4, 1.0)])
def test_a_gas_of_boxes_and_balls_never_gains_energy_and_keeps_it_if_smooth_and_elastic(mu, e, mode):
    """To rounding; a smooth one in a discrete world, in which bodies overlap, within 2 %. Nothing leaves."""
    with turning_world(collision=mode, max_impacts_per_step=64) as world:
        boxes_and_balls(world, 4, restitution=e, friction=mu)
        last = first = world.kinetic_energy()
        given = 1e-12 if e > 0.0 else 1e-5  # what does not bounce is left to contacts, which push out overlaps
        given = 2e-2 if mu == 0.0 and mode == "discrete" else given
        for _ in range(120):
            world.step()
            now = world.kinetic_energy()
            assert now <= last * (1 + given)
            last = now
        assert world.stats().counters["impacts"] > 50 or (e == 0.0 and mode != "event_driven")
        assert np.abs(world.bodies.dynamic.position).max() < 5.0
    assert last == pytest.approx(first, rel=given) if mu == 0.0 else last < 0.9 * first


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("seed", [4, pytest.param(6, marks=pytest.mark.long)])
def test_a_smooth_elastic_gas_of_boxes_in_space_keeps_energy(seed, mode):
    """To rounding, over more than 150 impacts; among them corners that slide along faces, and would graze them more
    often than the cap allows."""
    random = np.random.default_rng(seed)
    with turning_world(3, collision=mode, max_impacts_per_step=64) as world:
        room(world, 3.5, 0.5, 4.0, restitution=1.0)
        places = (np.stack(np.meshgrid(*[np.arange(4)] * 3), -1).reshape(-1, 3) + 0.5) * 1.5 - 3
        half, turns = random.uniform(0.2, 0.35, (64, 3)), random.normal(0, 1, (64, 4))
        world.create_entities(
            64, Transform.many(places, turns / np.linalg.norm(turns, axis=1)[:, None]),
            RigidBody.many(linear_velocity=random.normal(0, 2, (64, 3))), Spin.many(random.normal(0, 4, (64, 3))),
            BoxCollider.many(half, restitution=1.0),
        )  # fmt: skip
        energy = world.kinetic_energy()
        for _ in range(100):
            world.step()
            assert world.kinetic_energy() == pytest.approx(energy, rel=1e-12)
        assert world.stats().counters["impacts"] > 150
        assert np.abs(world.bodies.dynamic.position).max() < 3.0


def room(world, far, thick, wide, **collider):
    """Six walls, whose middles are so far from the origin."""
    for k in range(6):
        place, half = np.zeros(3), np.full(3, wide)
        place[k // 2], half[k // 2] = far * (-1) ** k, thick
        wall(world, place, half, **collider)


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("e", [0.0, 0.3, 0.5])
def test_boxes_that_bounce_come_to_rest(e, mode):
    """Four alone, which fall on any corner, and a stack of five that falls askew: on their faces, in their order."""
    random, rough = np.random.default_rng(3), {"restitution": e, "friction": 0.5}
    with turning_world(2, G, collision=mode) as world:
        wall(world, (0, -1), (20, 1), **rough)
        for k in range(4):
            box(world, (3 + 1.5 * k, 2), (0.5, 0.5), rotation=random.uniform(0, 6), **rough)
        for k in range(5):
            place = random.uniform(-0.1, 0.1), 1 + 1.3 * k
            box(world, place, (0.5, 0.5), rotation=random.uniform(-0.3, 0.3), **rough)
        run(world, 600)
        moving = world.bodies.dynamic
        assert world.kinetic_energy() < 1e-9
        assert moving.position[:, 1] == pytest.approx([0.5] * 4 + [0.5 + k for k in range(5)], abs=0.03)
        assert np.abs((moving.rotation + math.pi / 4) % (math.pi / 2) - math.pi / 4).max() < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
def test_a_needle_in_a_room_gains_nothing(mode):
    """Smooth, it spins by some rad in a step about its length, of which it has hardly any inertia. What is pushed out
    of a wall gains height: 1 % of all energy at most, over two seconds."""
    for seed in range(3):
        random = np.random.default_rng(seed)
        with turning_world(3, G, convex_hull.plugin, collision=mode, on_fault="ignore") as world:
            room(world, 4.0, 1.0, 5.0, restitution=0.8)
            points = random.normal(size=(40, 3)) * (1, 0.03, 0.03)
            needle = convex_hull.ConvexHullCollider(0.8 * points / np.abs(points).max(), restitution=0.8)
            needle.offset, turn = -needle.centre_of_mass, random.normal(size=4)
            body, spin = RigidBody(linear_velocity=random.normal(size=3) * 2), Spin(random.normal(size=3) * 3)
            world.create_entity(Transform((-1.7,) * 3, turn / np.linalg.norm(turn)), body, spin, needle)
            lowest = first = world.kinetic_energy() + G * (world.bodies.dynamic.position[0, 1] + 3.0)
            for _ in range(130):
                world.step()
                energy = world.kinetic_energy() + G * (world.bodies.dynamic.position[0, 1] + 3.0)
                assert energy < lowest + 0.01 * first, (seed, world.step_count)
                lowest = min(lowest, energy)


def test_what_strikes_a_crate_that_rocks_bounces_alike_in_all_modes():
    """What tips over on the floor lands as a contact at rest; what else it meets in that step has its restitution."""
    speeds = []
    for mode in MODES:
        with turning_world(2, G, collision=mode) as world:
            wall(world, (0, -1), (20, 1), friction=0.5)
            box(world, (0, 0.6254), (0.5, 0.5), rotation=0.3, mass=10.0, friction=0.5)
            run(world, 10)
            struck = ball(world, (-1.5, 0.6), (10, 0), radius=0.4, restitution=1.0)
            run(world, 25)
            speeds.append(motion(world, struck)[0][0])
    assert max(speeds) < -4.5
    assert max(speeds) - min(speeds) < 0.1
