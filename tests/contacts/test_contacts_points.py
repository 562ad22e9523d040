"""Where contacts are: of what has parted within the step the place where the two met; points at corners of bodies."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from helpers_pairwise import pairwise
from worlds import MODES, ball, both_dimensions, make_world, position, run

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Settings, World
from carom.plugins import Physics, capsule
from carom.plugins.capsule import CapsuleCollider
from carom.plugins.rotation import BoxCollider, Rotation, Spin

TARGETS = {
    "ball": lambda d, **fields: SphereCollider(0.1, **fields),
    "axis-aligned": lambda d, **fields: AABBCollider((0.02, 0.5, 0.5)[:d], **fields),
    "capsule": lambda d, **fields: CapsuleCollider(0.02, 0.5, **fields),
    "box": lambda d, **fields: BoxCollider((0.02, 0.5, 0.5)[:d], **fields),
}


@pytest.mark.parametrize(
    ("mode", "d", "target", "sensor", "first"),
    pairwise(MODES, (2, 3), tuple(TARGETS), ("none", "target", "shot"), ("target", "shot")),
)
def test_a_shot_meets_where_its_way_leads_into_the_target(mode, d, target, sensor, first):
    """By plane geometry: on the side of entry, though the step ends metres beyond; contacts, begin, pairs and handlers
    say the same, and so do impacts where there is one."""
    world = World(Physics(d), Rotation(), capsule.plugin, settings=Settings(collision=mode))
    y, radius, told = 0.05, 0.02, []
    start, speed = np.array((-7.3, y, 0))[:d], np.array((300.0, 0, 0))[:d]
    make = {
        "target": lambda: world.create_entity(
            Transform((0, 0, 0)[:d]), TARGETS[target](d, sensor=sensor == "target", restitution=0.4)
        ),
        "shot": lambda: world.create_entity(
            Transform(tuple(start)), RigidBody(linear_velocity=tuple(speed), ccd=True),
            SphereCollider(radius, sensor=sensor == "shot", restitution=0.4),
        ),
    }  # fmt: skip
    ids = {name: make[name]() for name in sorted(make, key=lambda name: name != first)}
    world.on("contact_begin", told.append)
    while not len(world.contacts):
        world.step()
        assert world.step_count < 9
    out = np.array((-math.sqrt(0.12**2 - y * y), y, 0)) / 0.12 if target == "ball" else np.array((-1.0, 0, 0))
    point = (0.1 * out if target == "ball" else np.array((-0.02, y, 0)))[:d]
    normal = out[:d] if ids["target"] < ids["shot"] else -out[:d]
    contacts = world.contacts
    assert len(contacts.impacts) == (sensor == "none")
    if sensor != "none" or target == "ball":
        assert np.linalg.norm(position(world, ids["shot"]) - point) > 1.0
    pairs = [contact for _, _, contact in contacts.pairs(Transform, Transform)]
    for one in (*contacts, *contacts.begin, *contacts.impacts, *pairs, *told):
        assert one.point == pytest.approx(point, abs=1e-6)
        assert one.normal == pytest.approx(normal, abs=1e-5)
    assert len(told) == len(pairs) == 1


@pytest.mark.parametrize("mode", MODES)
def test_of_several_impacts_of_a_pair_the_last_one_counts(mode):
    """A ball that flies to and fro between two walls, and along them, by reflection; it meets each of them thrice."""
    world = make_world(collision=mode)
    walls = [
        world.create_entity(Transform((x, 0)), AABBCollider((0.5, 99), restitution=1.0)) for x in (-1.0, 1.0)
    ]  # with a metre between them
    body = RigidBody(linear_velocity=(372.0, 60.0), ccd=True)
    world.create_entity(Transform((0.0, 0.0)), body, SphereCollider(0.0, restitution=1.0))
    world.step()
    contacts = world.contacts
    assert len(contacts.impacts) == 6
    assert contacts.entity_a.tolist() == walls
    ways = 0.5 + np.array((5, 4))  # metres across, to the last impact with the left and with the right wall
    assert contacts.point[:, 1] == pytest.approx(ways / 372 * 60, rel=1e-9)
    assert contacts.point[:, 0] == pytest.approx((-0.5, 0.5), abs=1e-9)


@pytest.mark.parametrize("mode", MODES)
def test_what_bounces_touched_where_it_bounced(mode):
    """Off balls that stand still, also where no body is swept: on their surface, not halfway to where it is by now."""
    world, seen = make_world(gravity=9.81, collision=mode), 0
    still = [ball(world, (3 * k, 0), kind="static", restitution=0.8) for k in range(8)]
    for k in range(8):
        ball(world, (3 * k + 0.05 * k, 1.5 + 0.23 * k), radius=0.1, restitution=0.8)
    for _ in range(90):
        world.step()
        for contact in world.contacts.impacts:
            (same,) = world.contacts.of(contact.entity_b)
            away = np.linalg.norm(same.point - position(world, contact.entity_a))
            assert contact.entity_a in still
            assert away == pytest.approx(0.5, abs=2e-3)
            seen += 1
    assert seen > 8


def test_a_sensor_that_is_left_within_the_step_was_met_where_the_two_overlapped():
    """What begins the step in a sensor and ends it elsewhere: between the two surfaces, not where it has gone."""
    world = make_world(collision="continuous")
    world.create_entity(Transform((0, 0)), SphereCollider(0.5, sensor=True))
    world.create_entity(Transform((0.4, 0)), RigidBody(linear_velocity=(120, 0)), SphereCollider(0.2))
    world.step()
    assert world.contacts.depth.tolist() == [0.0]
    assert 0.2 <= world.contacts.point[0, 0] <= 0.5


# -- manifolds ------------------------------------------------------------------------------------

FIRST = pytest.mark.parametrize("first", [0, 1])  # which of the two has the smaller id


def turning_boxes(d, bodies, order, **settings):
    """(world of boxes that turn, under gravity; their entities). bodies: (kind, place, half extents, velocity,
    friction, rotation) each; order: of their ids."""
    world, ids = World(Physics(d, gravity=(0, -9.81, 0)[:d]), Rotation(), settings=Settings(**settings)), {}
    for k in order:
        kind, place, half, velocity, friction, rotation = bodies[k]
        body = RigidBody(kind=kind, linear_velocity=tuple(velocity[:d]))
        spin = [Spin()] if kind == "dynamic" else []
        collider = BoxCollider(half[:d], friction=friction)
        ids[k] = world.create_entity(Transform(place[:d], rotation), body, *spin, collider)
    return world, [ids[k] for k in range(len(bodies))]


def corners(world, entity):
    """(2^d, d) of a box; turned in a plane only."""
    transform, half = (world.component_for_entity(entity, one) for one in (Transform, BoxCollider))
    out = np.array(list(itertools.product((-1, 1), repeat=world.dimensions))) * half.half_extents
    if world.dimensions == 2:
        c, s = math.cos(transform.rotation), math.sin(transform.rotation)
        out = out @ np.array(((c, s), (-s, c)))
    return transform.position + out


def off_corners(world, *entities):
    """How far each point of the manifold is from the nearest corner of these."""
    there = np.concatenate([corners(world, entity) for entity in entities])
    return np.array([np.linalg.norm(there - point, axis=1).min() for point in world.contacts.manifold.point])


@both_dimensions
@FIRST
@pytest.mark.parametrize("belt", [0.0, -4.0, 9.0])
def test_the_points_of_a_box_that_slides_are_its_lower_corners(d, first, belt):
    """On a floor that stands still, or moves itself, as fast or faster; v dt is its own width."""
    floor = ("kinematic" if belt else "static", (0, -1, 0), (90, 1, 90), (belt, 0, 0), 0.02, 0.0)
    crate = ("dynamic", (0, 0.05, 0), (0.05,) * 3, (6.0, 0, 1.0), 0.02, 0.0)
    world, (_, sliding) = turning_boxes(d, [floor, crate], (0, 1) if first == 0 else (1, 0))
    most = 0
    for _ in range(30):
        world.step()
        assert off_corners(world, sliding) == pytest.approx(np.zeros(len(world.contacts.manifold)), abs=1e-4)
        most = max(most, len(world.contacts.manifold))
    assert most == 2 ** (d - 1)


@both_dimensions
@FIRST
def test_the_points_of_a_pillar_that_bears_what_slides_are_its_own(d, first):
    """A slab over the end of a post that is narrower."""
    post = ("static", (0, -0.5, 0), (0.05, 0.5, 0.05), (0, 0, 0), 0.0, 0.0)
    slab = ("dynamic", (-0.6, 0.05, 0), (2, 0.05, 2), (6.0, 0, 0), 0.0, 0.0)
    world, (pillar, _) = turning_boxes(d, [post, slab], (0, 1) if first == 0 else (1, 0))
    run(world, 4)
    for _ in range(6):
        world.step()
        assert len(world.contacts.manifold)
        assert off_corners(world, pillar).max() < 1e-3


@both_dimensions
@FIRST
@pytest.mark.parametrize("way", [-1, 1])
def test_of_two_boxes_of_one_size_each_has_its_own_points(d, first, way):
    """The upper one slides off: what they share ends at a corner of each of them."""
    lower = ("static", (0, 0.5, 0), (0.5,) * 3, (0, 0, 0), 0.0, 0.0)
    upper = ("dynamic", (0.1 * way, 1.5, 0), (0.5,) * 3, (5.0 * way, 0, 0), 0.0, 0.0)
    world, both = turning_boxes(d, [lower, upper], (0, 1) if first == 0 else (1, 0))
    for _ in range(4):
        world.step()
        ends = np.sort(world.contacts.manifold.point[:, 0])
        x = position(world, both[1])[0]
        assert (ends[0], ends[-1]) == pytest.approx((max(-0.5, x - 0.5), min(0.5, x + 0.5)), abs=1e-3)


def test_the_points_of_what_tumbles_are_corners_too():
    """Boxes that fall on a floor at many angles, turn and slide: to 1 mm, but for 5 % of the points, in steps in which
    blows turn them."""
    rng = np.random.default_rng(6)
    bodies = [("static", (0, -1), (90, 1), (0, 0), 0.3, 0.0)]
    for k in range(20):
        velocity = (rng.uniform(-4, 4), 0)
        bodies.append(("dynamic", (3 * k - 30, 0.5 + 0.1 * k), (0.2, 0.1), velocity, 0.3, rng.uniform(-3, 3)))
    world, entities = turning_boxes(2, bodies, rng.permutation(21).tolist())
    off = []
    for _ in range(120):
        world.step()
        off += off_corners(world, *entities[1:]).tolist()
    assert len(off) > 2000
    assert np.quantile(off, 0.95) < 1e-3
