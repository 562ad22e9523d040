"""Bullets of plugin shapes, so far away that each would tunnel without sweeping."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers_modes import bullet, each_sweep, strikes
from worlds import position, velocity

from carom.components import AABBCollider, SphereCollider, Transform
from carom.framework import Settings, World
from carom.plugins import Physics, capsule, convex_polygon
from carom.plugins.capsule import CapsuleCollider
from carom.plugins.convex_polygon import ConvexPolygonCollider

pytestmark = pytest.mark.slow  # each set of shapes compiles for long
DT = 1 / 60
HEXAGON = 0.3 * np.array([(math.cos(k * math.pi / 3), math.sin(k * math.pi / 3)) for k in range(6)])
FACE = np.array((math.cos(math.pi / 6), 0.5))  # the normal of its first edge
APOTHEM = 0.3 * math.cos(math.pi / 6)


def shaped_world(mode, *plugins, gravity=(0.0, 0.0)):
    settings = Settings(collision="discrete" if mode == "ccd" else mode)
    return World(Physics(dimensions=2, gravity=gravity), *plugins, settings=settings)


SHAPES = {
    "capsule": lambda e: CapsuleCollider(0.1, 0.2, restitution=e),
    "polygon": lambda e: ConvexPolygonCollider(HEXAGON, restitution=e),
    "ball": lambda e: SphereCollider(0.15, restitution=e),
    "box": lambda e: AABBCollider((0.2, 0.1), restitution=e),
}


def reach(shape, direction):
    """The farthest point of a shape in a direction where it is unique: a corner, or the end of a cap."""
    if shape == "ball":
        return 0.15 * direction
    if shape == "capsule":
        return np.array((0.0, math.copysign(0.2, direction[1]))) + 0.1 * direction
    corners = HEXAGON if shape == "polygon" else np.array([(x, y) for x in (-0.2, 0.2) for y in (-0.1, 0.1)])
    return corners[np.argmax(corners @ direction)]


# a, b, normal from a to b, contact point relative to a and to b. Of two shapes with corners one touches with a face.
MEETINGS = [
    ("capsule", "ball", n := np.array((0.6, 0.8)), reach("capsule", n), reach("ball", -n)),
    ("capsule", "ball", n := np.array((1.0, 0.0)), np.array((0.1, 0.15)), reach("ball", -n)),
    ("capsule", "capsule", n := np.array((-0.28, 0.96)), reach("capsule", n), reach("capsule", -n)),
    ("capsule", "box", n := np.array((0.0, 1.0)), reach("capsule", n), np.array((0.13, -0.1))),
    ("polygon", "ball", FACE, APOTHEM * FACE, reach("ball", -FACE)),
    ("polygon", "capsule", FACE, APOTHEM * FACE, reach("capsule", -FACE)),
    ("polygon", "box", FACE, APOTHEM * FACE, reach("box", -FACE)),
    ("polygon", "polygon", FACE, APOTHEM * FACE + 0.05 * np.array((-FACE[1], FACE[0])), None),
]


@each_sweep
def test_every_pair_meets_where_it_should(mode):
    """Traced back from the touch at 100 to 30,000 m/s: time to 1e-12 of the path, normals by iteration to 1e-7."""
    world = shaped_world(mode, capsule.plugin, convex_polygon.plugin)
    rng, expected = np.random.default_rng(4), []
    for lane in range(4 * len(MEETINGS)):
        one, two, n, on_a, on_b = MEETINGS[lane % len(MEETINGS)]
        # a polygon turned by a few degrees meets the face with its corner
        turn = 0.2 if on_b is None else 0.0
        if on_b is None:
            c, s = math.cos(turn), math.sin(turn)
            corners = HEXAGON @ np.array(((c, s), (-s, c)))
            on_b = corners[np.argmax(corners @ -n)]
        toi, speed, e = rng.uniform(0, DT), 10 ** rng.uniform(2, 4.5), (1.0, 0.5)[lane // len(MEETINGS) % 2]
        slip = rng.uniform(-1.0, 1.0) * np.array((-n[1], n[0]))
        w = speed * (slip - n) / np.linalg.norm(slip - n)
        va, vb, lift = -w / 3, 2 * w / 3, np.array((0.0, 3000.0 * lane))
        a = bullet(world, lift - va * toi, va, collider=SHAPES[one](e))
        b = bullet(world, lift + on_a - on_b - vb * toi, vb, mass=2.0, collider=SHAPES[two](e))
        if turn:
            world.component_for_entity(b, Transform).rotation = turn
        impulse = -(1 + e) * (w @ n) / 1.5
        expected.append((one, two, a, b, toi, n, (va - impulse * n, vb + impulse / 2 * n), lift, on_a - on_b, speed))
    hits = strikes(world, 1)
    for one, two, a, b, toi, n, after, lift, offset, speed in expected:
        (k,) = np.flatnonzero(hits.entity_a == a)
        loose = 1e-11 + 1e-12 * (lift[1] + speed * DT)
        assert hits.entity_b[k] == b, (one, two)
        assert hits.time[k] == pytest.approx(toi, abs=2 * loose / speed), (one, two)
        np.testing.assert_allclose(hits.normal[k], n, atol=1e-7, err_msg=f"{one}, {two}")
        for entity, v, start in ((a, after[0], lift), (b, after[1], lift + offset)):
            np.testing.assert_allclose(velocity(world, entity), v, atol=3e-7 * speed)
            np.testing.assert_allclose(position(world, entity), start + v * (DT - toi), atol=3e-7 * speed * DT + loose)
    assert len(hits) == len(expected)


@each_sweep
@pytest.mark.parametrize("e", [0.0, 1.0])
def test_a_one_way_platform_in_the_way_of_bullets(mode, e):
    """From the front at 600 m/s, 10 m per step: stopped or reflected. From behind: the same bits as without it."""
    for start, speed in ((6.0, -600.0), (-6.0, 600.0)):
        world = shaped_world(mode)
        free = shaped_world(mode)
        world.create_entity(Transform((0.0, 0.0)), AABBCollider((2.0, 0.0), one_way=(0.0, 1.0), restitution=e))
        free.create_entity(Transform((0.0, 1e6)), AABBCollider((2.0, 0.0), one_way=(0.0, 1.0)))
        for shape, x in (("ball", -1.0), ("box", 1.0)):
            for w in (world, free):
                bullet(w, (x, start), (0.0, speed), collider=SHAPES[shape](0.0))
        strikes(world, 1)
        strikes(free, 1)
        if speed > 0:
            assert world.bodies.dynamic.position.tolist() == free.bodies.dynamic.position.tolist()
            assert world.bodies.dynamic.linear_velocity.tolist() == [[0.0, 600.0]] * 2
            continue
        heights = np.array((0.15, 0.1))
        left = DT - (6.0 - heights) / 600.0
        np.testing.assert_allclose(world.bodies.dynamic.linear_velocity[:, 1], 600.0 * e, atol=1e-9)
        place = heights + 600.0 * e * left
        np.testing.assert_allclose(world.bodies.dynamic.position[:, 1], place, atol=1e-9 if e else 0.002)
        strikes(world, 10)
        assert (world.bodies.dynamic.position[:, 1] > heights - 0.002).all()
