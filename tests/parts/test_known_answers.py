"""Bodies of several parts against closed forms and conservation laws."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from parts.helpers_parts import CORNER, G, L, U, angular_momentum, at, body_of, floor, parts_world, piece
from worlds import MODES, run

from carom import RigidBody, SphereCollider, Transform, scenes
from carom.plugins.joints import Hinge, Joints
from carom.plugins.parts import PartOf
from carom.plugins.rotation import BoxCollider, Spin


@pytest.mark.parametrize("beyond", [-0.02, 0.02])
def test_a_piece_stays_on_an_edge_up_to_its_centre_of_mass(beyond):
    """A plank with a load on its right end, on a table that ends there: the centre of both, of equal mass, is 0.2 from
    the plank's."""
    world, parts = parts_world((0, -G))
    world.create_entity(Transform((-1.0 + 0.2 - beyond, -0.5)), BoxCollider((1.0, 0.5), friction=0.5))
    plank = piece(
        world, parts, (0, 0.1), (((0, 0), (0.5, 0.1), 1.0), ((0.4, 0.2), (0.1, 0.1), 1.0)), friction=0.5
    )[0]  # fmt: skip
    assert at(world, plank).position == pytest.approx((0.2, 0.2))
    run(world, 60)
    assert abs(at(world, plank).rotation) < 1e-3 if beyond < 0 else at(world, plank).rotation < -0.05


@pytest.mark.plain
def test_masses_add_up_by_the_parallel_axis_theorem():
    world, parts = parts_world()
    body = piece(world, parts, (3, 4), U, angle=0.7)[0]
    masses, centres = np.array([box[2] for box in U]), np.array([box[0] for box in U])
    middle = masses @ centres / masses.sum()
    inertia = sum(
        m * ((a * a + b * b) / 3 + ((c - middle) ** 2).sum())
        for m, c, (a, b) in zip(masses, centres, [box[1] for box in U], strict=True)
    )
    assert body_of(world, body).mass == pytest.approx(3.0, rel=1e-15)
    assert world.component_for_entity(body, Spin).moments == pytest.approx(inertia, rel=1e-14)
    c, s = math.cos(0.7), math.sin(0.7)
    assert at(world, body).position == pytest.approx(
        (3 + c * middle[0] - s * middle[1], 4 + s * middle[0] + c * middle[1])
    )
    assert parts.centre(body) == pytest.approx((0, 0), abs=1e-15)
    world.component_for_entity(body, Spin).apply_torque(2.0)
    world.step()
    assert world.component_for_entity(body, Spin).angular_velocity == pytest.approx(2.0 / 60 / inertia, rel=1e-14)


def test_a_box_cut_into_two_is_the_whole_in_space():
    """Its halves are turned, so that tensors are; it tumbles under no torque, and bounces on a corner."""
    ends = []
    for cut in (False, True):
        world, _ = parts_world((0, -G, 0), 3)
        world.create_entity(Transform((0, -2, 0)), BoxCollider((9, 1, 9), restitution=0.6))
        body = world.create_entity(
            Transform((0, 0.5, 0), rotation=(0.9, 0.1, 0.3, 0.3)), RigidBody(2.0), Spin(np.array((1.0, 2.0, -1.5))),
            BoxCollider((0.2, 0.3, 0.4), restitution=0.6),
        )  # fmt: skip
        if cut:
            world.component_for_entity(body, RigidBody).mass = 1.0
            world.component_for_entity(body, BoxCollider).half_extents = (0.2, 0.3, 0.2)
            world.component_for_entity(body, BoxCollider).offset = (0, 0, -0.2)
            half = math.sqrt(0.5)
            world.create_entity(
                PartOf(body, (0, 0, 0.2), rotation=(half, 0, 0, half)), BoxCollider((0.3, 0.2, 0.2), restitution=0.6)
            )
        run(world, 45)  # it has bounced once
        motion, spin = body_of(world, body), world.component_for_entity(body, Spin)
        assert spin.moments == pytest.approx(np.diag((0.5, 0.4, 0.26)) / 3, abs=1e-15)
        ends.append(np.concatenate((at(world, body).position, motion.linear_velocity, spin.angular_velocity)))
        assert motion.linear_velocity[1] > 0.0
    assert ends[0] == pytest.approx(ends[1], abs=5e-3)  # steps split turns by the axes, in another order


def test_a_piece_on_a_hinge_has_the_period_of_a_physical_pendulum():
    world, parts = parts_world((0, -G), dt=1 / 120)
    joints = Joints()
    world.add_plugin(joints)
    body = piece(world, parts, (0, 0), L)[0]
    inertia, mass = world.component_for_entity(body, Spin).moments, body_of(world, body).mass
    place = at(world, body).position.copy()
    world.create_entity(Hinge(None, body, anchor=(place[0], place[1] + 0.8)))
    world.component_for_entity(body, Spin).angular_velocity = 0.3
    world.component_for_entity(body, RigidBody).linear_velocity = (0.24, 0.0)
    angles = []
    for _ in range(600):
        world.step()
        angles.append(at(world, body).rotation)
    passes = [k + a / (a - b) for k, (a, b) in enumerate(itertools.pairwise(angles)) if a < 0 <= b]
    swing = math.sqrt((inertia + mass * 0.64) / (mass * G * 0.8))
    k, m = math.sin(max(angles) / 2), 1.0  # the complete elliptic integral, by the arithmetic and geometric mean
    other = math.sqrt(1 - k * k)
    while abs(m - other) > 1e-15:
        m, other = 0.5 * (m + other), math.sqrt(m * other)
    assert np.diff(passes).mean() / 120 == pytest.approx(2 * math.pi * swing / m, rel=3e-4)


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("d", [2, 3])
def test_free_collisions_keep_momentum_and_angular_momentum_and_elastic_ones_energy(d, mode):
    """Those in space rub and are not elastic; what turns freely there is exact on average alone."""
    random, exact = np.random.default_rng(7), d == 2
    world, parts = parts_world(dimensions=d, collision=mode, dt=1 / 60 if exact else 1 / 240)
    material = {"restitution": 1.0} if exact else {"restitution": 0.7, "friction": 0.3}
    bodies, speed = [], 1.5 if exact else 1.0
    for place in itertools.product((0.0, 1.8), (0.0, 1.8), *[(0.0,)] * (d - 2)):
        velocity = random.normal(0.0, speed, d) - np.array(place) + (0.9, 0.9, 0.0)[:d]
        spin = random.normal(0.0, 3.0) if exact else random.normal(0.0, 2.0, 3)
        boxes = U if exact else CORNER
        bodies.append(piece(world, parts, place, boxes, velocity=velocity, spin=spin, **material)[0])
    energies, momentum, turning = [world.kinetic_energy()], world.momentum(), angular_momentum(world, bodies)
    for _ in range(150 if exact else 480):
        world.step()
        energies.append(world.kinetic_energy())
    if exact:
        assert world.stats().counters["impacts"] > 2
        assert energies == pytest.approx([energies[0]] * 151, rel=1e-12)
    else:
        assert energies[-1] < 0.98 * energies[0]
        assert np.diff(energies).max() < 1e-4 * energies[0]
    assert world.momentum() == pytest.approx(momentum, abs=1e-12)
    assert angular_momentum(world, bodies) == pytest.approx(turning, rel=1e-11 if exact else 1e-9)


def test_exact_flights_do_not_depend_on_the_step():
    """Also where parts of one body are struck one after the other within a step, which turns all of it each time."""
    ends = []
    for rate in (4, 120):
        world, parts = parts_world(collision="event_driven", dt=1 / rate)
        body = piece(world, parts, (0, 0), U, spin=1.5, restitution=1.0)[0]
        balls = [
            world.create_entity(Transform(place), RigidBody(0.3, velocity), SphereCollider(0.1, restitution=1.0))
            for place, velocity in (
                ((-2.0, 0.4), (5.0, 0.0)), ((1.9, 0.3), (-4.0, 0.0)),
                ((0.2, -2.0), (0.0, 6.0)), ((0.1, 3.0), (0.0, -8.0)),
            )
        ]  # fmt: skip
        run(world, rate // 2)
        spin = world.component_for_entity(body, Spin).angular_velocity
        ends.append([*at(world, body).position, spin, *(body_of(world, ball).linear_velocity[1] for ball in balls)])
        assert np.abs(ends[-1][3:]).min() > 0.1  # each has struck it
    assert ends[0] == pytest.approx(ends[1], abs=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["continuous", "event_driven"])
@pytest.mark.parametrize("cut", [True, False])
@pytest.mark.parametrize("struck", [False, True])
def test_what_starts_unrotated_meets_what_it_turns_to_in_its_first_step(mode, cut, struck):
    """An arm of 2 m that turns, or is struck so that it does, sweeps towards a ball, as in many short steps; balls far
    away bound what is known of the neighbours."""
    ends = []
    for rate in (2, 256):
        world, _ = parts_world(collision=mode, dt=1 / rate)
        offset = (0, 0) if cut else (2, 0)
        arm = BoxCollider((0.2, 0.1), offset=offset, restitution=1.0)
        hub = [Transform((0, 0)), RigidBody(1.0), Spin(0.0 if struck else 4.0, inertia=2.0)]
        body = world.create_entity(*hub, *(() if cut else (arm,)))
        if cut:
            world.create_entity(PartOf(body, (2, 0), mass=0.0), arm)
        if struck:
            world.create_entity(Transform((1.9, -0.5)), RigidBody(1.0, (0, 20.0)), SphereCollider(0.1, restitution=1.0))
        balls = [
            world.create_entity(Transform(place), RigidBody(1.0), SphereCollider(0.15, restitution=1.0))
            for place in ((0.72, 2.7 if struck else 1.86), (-1.6, -1.1), *((50 + 3 * k, 40) for k in range(100)))
        ]
        run(world, rate // 2)
        ends.append([world.component_for_entity(body, Spin).angular_velocity])
        ends[-1].extend(np.ravel([body_of(world, ball).linear_velocity for ball in balls[:2]]))
    assert np.abs(ends[1][1:3]).max() > 1.0
    assert ends[0] == pytest.approx(ends[1], abs=1e-4)


def test_what_bounces_on_a_part_of_what_rests_finds_it_at_rest():
    world, parts = parts_world((0, -G))
    floor(world, friction=0.5)
    boxes = ((0, 1.0), (1.0, 0.1), 1e6), ((-0.8, 0.45), (0.1, 0.45), 1e6), ((0.8, 0.45), (0.1, 0.45), 1e6)
    legs = (boxes[1], boxes[2], boxes[0])  # the top is a part
    own = ((0.0, 0.0), legs[0][1], 1e6)
    table = piece(
        world, parts, legs[0][0], (own, *(((x + 0.8, y - 0.45), half, m) for (x, y), half, m in legs[1:])), friction=0.5
    )  # fmt: skip
    run(world, 30)
    ball = world.create_entity(Transform((0.3, 2.0)), RigidBody(), SphereCollider(0.1, restitution=1.0))
    fell = 2.0 - 1.2
    while body_of(world, ball).linear_velocity[1] <= 0.0:
        world.step()
    now = body_of(world, ball).linear_velocity[1] ** 2 / 2 + G * (at(world, ball).y - 1.2)
    assert now == pytest.approx(G * fell, rel=0.02)
    assert at(world, table[0]).rotation == pytest.approx(0.0, abs=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["continuous", "event_driven"])
@pytest.mark.parametrize("restitution", [0.0, 1.0])
def test_fast_pieces_do_not_pass_walls(mode, restitution):
    random = np.random.default_rng(3)
    world, parts = parts_world(collision=mode)
    for x, y in ((-3, 0), (3, 0), (0, -3), (0, 3)):
        half = (0.05, 3.2) if x else (3.2, 0.05)
        world.create_entity(Transform((x, y)), BoxCollider(half, restitution=restitution))
    bodies = []
    for place in itertools.product((-1.5, 0.0, 1.5), (-1.0, 1.0)):
        velocity, spin = random.normal(0.0, 60.0, 2), random.normal(0.0, 3.0)
        bodies.append(piece(world, parts, place, U, velocity=velocity, spin=spin, restitution=restitution)[0])
    energy = world.kinetic_energy()
    gain = 1e-9 if restitution else 1e-5  # what does not bounce is pushed out of overlaps
    for _ in range(120):
        world.step()
        places = np.array([at(world, body).position for body in bodies])
        assert (np.abs(places) < 3.0).all()
        now = world.kinetic_energy()
        assert now <= energy * (1 + gain)
        energy = max(now, 1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
def test_pieces_of_the_scene_start_apart_and_stay_in_their_bin(mode):
    scene = scenes.get("pieces")
    with scene.build(scene.settings.replace(collision=mode), n=25) as world:
        world.step()
        assert len(world.contacts) == 0
        energy = world.kinetic_energy() + world.potential_energy()
        run(world, 300)
        places = world.bodies.dynamic.position
        assert (places > 0.1).all()
        assert (places[:, 0] < 7.5 - 0.1).all()
        assert world.kinetic_energy() < 1e-3
        assert world.potential_energy() < 0.6 * energy


def test_a_turning_platform_of_parts_carries_what_lies_on_its_arms():
    """A kinematic body and its parts move alike, and are moved by nothing."""
    world, _ = parts_world((0, -G))
    hub = world.create_entity(
        Transform((0, 0)), RigidBody(kind="kinematic", linear_velocity=(1, 0)), BoxCollider((0.2, 0.2))
    )
    arm = world.create_entity(PartOf(hub, (2, 0)), BoxCollider((1.0, 0.2), friction=1.0))
    load = world.create_entity(Transform((2, 0.45)), RigidBody(), Spin(), BoxCollider((0.25, 0.25), friction=1.0))
    run(world, 90)
    assert at(world, hub).position == pytest.approx((1.5, 0))
    assert at(world, arm).position == pytest.approx((1.5, 0))
    assert at(world, load).position == pytest.approx((3.5, 0.45), abs=0.06)
    assert body_of(world, load).linear_velocity == pytest.approx((1, 0), abs=1e-3)


def test_spheres_of_a_dumbbell_push_each_other_by_their_body_alone():
    """Two overlapping parts do not touch, and a body without a Spin or a collider of its own moves as one."""
    world, parts = parts_world()
    body = world.create_entity(Transform((0, 0)), RigidBody(1.0))
    ends = [world.create_entity(PartOf(body, (x, 0), mass=0.5), SphereCollider(0.6)) for x in (-0.5, 0.5)]
    ball = world.create_entity(
        Transform((3, 0)), RigidBody(2.0, linear_velocity=(-2, 0)), SphereCollider(0.5, restitution=1.0)
    )
    world.component_for_entity(ends[1], SphereCollider).restitution = 1.0
    seen = set()
    for _ in range(90):
        world.step()
        seen |= {(contact.entity_a, contact.entity_b) for contact in world.contacts}
    assert seen == {(ends[1], ball)}
    assert body_of(world, body).linear_velocity == pytest.approx((-2, 0))
    assert body_of(world, ball).linear_velocity == pytest.approx((0, 0), abs=1e-12)
    assert world.momentum() == pytest.approx((-4, 0))
    assert parts.of(body) == ends


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("place", [(0.1, 2.3), (0.3, 1.2)])
def test_a_table_that_a_thousand_kilograms_fall_on_is_not_driven_into_the_floor(place, mode):
    world, _ = parts_world((0, -G), collision=mode, on_fault="ignore")
    material: dict[str, Any] = {"friction": 0.5, "restitution": 0.6}
    floor(world, **material)
    table = world.create_entity(Transform((0, 0.3)), RigidBody(0.1), Spin())
    for x in (-0.6, 0.0, 0.6):
        world.create_entity(PartOf(table, (x, 0), mass=0.1), BoxCollider((0.1, 0.3), **material))
    world.create_entity(Transform(place), RigidBody(1000.0, (0, -20)), BoxCollider((1.0, 0.3), **material), Spin())
    for _ in range(40):
        world.step()
        turned = at(world, table).rotation
        lowest = at(world, table).y - 0.7 * abs(np.sin(turned)) - 0.3 * abs(np.cos(turned))
        assert lowest > -0.3  # half of a foot
