"""Boxes that turn by their contacts at rest: tipping, sliding, standing and falling, against statics and laws."""

from __future__ import annotations

import math

import numpy as np
import pytest
from rotation.helpers_turning import G, box, motion, part, pose, turned, turning_world, wall
from worlds import MODES, Calls, run

from carom.components import RigidBody, SphereCollider, Transform
from carom.framework import Phase
from carom.plugins import capsule, convex_hull, convex_polygon, half_space
from carom.plugins.capsule import CapsuleCollider
from carom.plugins.convex_hull import ConvexHullCollider
from carom.plugins.convex_polygon import ConvexPolygonCollider
from carom.plugins.rotation import BoxCollider, Spin


def ground(slope=0.0, friction=0.5, d=2, **settings):
    """A world in which the ground is level, its surface at 0, and gravity leans by ``slope``."""
    world = turning_world(d, (G * math.sin(slope), -G * math.cos(slope), 0)[:d], **settings)
    wall(world, (0, -1, 0)[:d], (100, 1, 50)[:d], friction=friction)
    return world


@pytest.mark.parametrize("mode", MODES)
def test_a_box_tips_where_its_centre_stands_over_its_edge(mode):
    """At tan a = width / height, 1 % to either side; it lies on its side then."""
    for times in (0.99, 1.01):
        with ground(math.atan(times * 0.5), friction=2.0, collision=mode) as world:
            entity = box(world, (0, 0.5), (0.25, 0.5), friction=2.0)
            run(world, 300)
            x, y, angle = pose(world, entity)
        if times < 1.0:
            assert (abs(x), y, abs(angle)) == pytest.approx((0, 0.5, 0), abs=1e-6)
        else:
            assert (y, angle) == pytest.approx((0.25, -math.pi / 2), abs=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
def test_a_box_slides_where_friction_ends_and_does_not_turn(mode):
    """At tan a = mu, 1 % to either side; with g (sin a - mu cos a), but for the first steps, in which it settles
    and keeps some mm/s."""
    mu, seconds = 0.3, 1.0
    for times in (0.99, 1.01, 1.5):
        slope = math.atan(times * mu)
        with ground(slope, mu, collision=mode) as world:
            entity = box(world, (0, 0.5), (0.5, 0.5), friction=mu)
            run(world, 60)
            x, y, angle = pose(world, entity)
        way = 0.5 * G * max(0.0, math.sin(slope) - mu * math.cos(slope)) * seconds**2
        assert x == pytest.approx(way, rel=0.02, abs=4e-3)
        assert (y, angle) == pytest.approx((0.5, 0.0), abs=1e-6)


@pytest.mark.parametrize(("d", "mode"), [*((2, mode) for mode in MODES), (3, "discrete")])
def test_ten_boxes_stand(d, mode):
    """Turned by less than 2.5e-4 after 10 s; they sag by what soft contacts give."""
    with ground(d=d, collision=mode) as world:
        entities = [box(world, (0, 0.5 + k, 0)[:d], (0.5,) * d, friction=0.5) for k in range(10)]
        run(world, 600)
        poses, angles = np.array([pose(world, entity)[:d] for entity in entities]), world.bodies.dynamic.rotation
        assert (np.abs(angles) if d == 2 else 2 * np.abs(angles[:, 1:])).max() < 2.5e-4
        assert np.abs(np.delete(poses, 1, axis=1)).max() < 2e-3
        assert poses[:, 1] == pytest.approx(np.arange(10) + 0.5, abs=0.04)
        assert d == 2 or world.kinetic_energy() < 1e-8


@pytest.mark.slow
def test_dominoes_fall_at_a_speed_that_does_not_depend_on_the_step():
    """Within 2 % from 1/60 s on."""
    speeds = []
    for rate in (60, 120, 240):
        with ground(friction=0.5, dt=1 / rate) as world:
            entities = [
                box(world, (0.5 * k, 0.5), (0.05, 0.5), spin=-2.0 if k == 0 else 0.0, friction=0.5) for k in range(40)
            ]
            fallen = {}
            while 30 not in fallen:
                world.step()
                for k in (15, 30):
                    if k not in fallen and pose(world, entities[k])[2] < -0.2:
                        fallen[k] = world.time
                assert world.time < 10.0
        speeds.append(7.5 / (fallen[30] - fallen[15]))
    assert speeds[0] == pytest.approx(speeds[2], rel=0.02)
    assert speeds[1] == pytest.approx(speeds[2], rel=0.02)


def test_the_manifold_has_the_corners_that_bear_it():
    """Two in a plane; their impulses are its weight, and that of what stands on one side is at that corner."""
    with ground() as world:
        low = box(world, (0, 0.5), (1, 0.5), mass=2.0, friction=0.5)
        high = box(world, (0.75, 1.25), (0.25, 0.25), friction=0.5)
        world.create_entity(Transform((5, 0.5)), RigidBody(mass=1.0), SphereCollider(0.5))
        run(world, 60)
        points = world.contacts.manifold
        assert points.contact.tolist() == [0, 0, 1, 2, 2]
        of_low = points.entity_b == low
        assert np.sort(points.point[of_low][:, 0]) == pytest.approx((-1, 1), abs=2e-4)
        left, right = points.normal_impulse[of_low][np.argsort(points.point[of_low][:, 0])] * 60 / G
        assert (left, right) == pytest.approx((1 + 0.125, 1 + 0.875), rel=1e-3)
        assert points.normal_impulse[points.entity_b == high].sum() * 60 / G == pytest.approx(1.0, rel=1e-3)
        assert [contact.entity_a for contact in points] == points.entity_a.tolist()


def test_the_impulses_of_a_manifold_are_that_of_its_contact():
    """Of boxes that fall on a corner, bounce and come to rest; in some steps an impact and rest give a part each."""
    rng, mixed = np.random.default_rng(4), 0
    with ground() as world:
        for k in range(30):
            tilt, height = rng.uniform(-0.6, 0.6), rng.uniform(0.6, 3)
            box(world, (3 * k, height), (0.5, 0.25), rotation=tilt, restitution=0.25 * (k % 3))
        for _ in range(150):
            world.step()
            points, contacts, impacts = world.contacts.manifold, world.contacts, world.contacts.impacts
            given = np.bincount(points.contact, points.normal_impulse, len(contacts))
            assert given == pytest.approx(contacts.normal_impulse, rel=1e-9, abs=1e-6)
            struck = np.bincount(impacts.entity_b, impacts.normal_impulse, 99)[contacts.entity_b]
            mixed += np.count_nonzero((struck > 0) & (contacts.normal_impulse > 1.01 * struck))
    assert mixed


def test_the_manifold_outlives_its_bodies():
    """Without entity_a each contact is one row, as it was; the rows of others have moved."""
    with ground() as world:
        lower = [box(world, (3 * k, 0.5), (1, 0.5), friction=0.5) for k in range(4)]
        upper = [box(world, (3 * k, 1.25), (0.25, 0.25), friction=0.5) for k in range(4)]
        run(world, 5)
        world.delete_entity(lower[1], immediate=True)
        spawned = [box(world, (3 * k, 9), (1, 0.5)) for k in range(99)]
        assert len(world.bodies) > len(spawned)
        points, contacts = world.contacts.manifold, world.contacts
        for k in range(4):
            mine = points.entity_b == upper[k]
            assert np.count_nonzero(mine) == 2 - (k == 1)
            assert points.point[mine].mean(axis=0) == pytest.approx((3 * k, 1), abs=1e-3)
            given = contacts.normal_impulse[contacts.entity_b == upper[k]]
            assert points.normal_impulse[mine].sum() == pytest.approx(given[0])


@pytest.mark.slow
@pytest.mark.parametrize("seconds", [10, pytest.param(60, marks=pytest.mark.long)])
def test_a_pyramid_of_fifty_rows_stands_still(seconds):
    """1,275 boxes: from 5 s on none creeps by a millimetre, and none overlaps by .0125."""
    with ground(friction=0.6) as world:
        rows, half = 50, 0.25
        for row in range(rows):
            for k in range(rows - row):
                box(world, ((k - (rows - row - 1) / 2) * 0.52, half + 2 * half * row), (half, half), friction=0.6)
        run(world, 300)
        before = np.array(world.bodies.dynamic.position)
        run(world, 60 * seconds - 300)
        assert np.abs(world.bodies.dynamic.position - before).max() < 1e-3
        assert world.kinetic_energy() < 1e-6
        assert world.contacts.depth.max() < 0.0125


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.long) for k in (1, 2))])
def test_a_house_of_cards_stands(seed):
    """Five storeys of cards that lean on each other's corners, about 20 degrees from upright."""
    lean, thick, long = math.radians(20 + np.random.default_rng(seed).uniform(-1, 1)), 0.02, 0.5
    with ground(friction=0.6) as world:
        high = 2 * (long * math.cos(lean) + thick * math.sin(lean))
        wide = 2 * (long * math.sin(lean) + thick * math.cos(lean))
        base = 0.0
        for storey in range(5):
            for k in range(5 - storey):
                x = (k - (4 - storey) / 2) * 2 * wide
                for side in (-1, 1):
                    place = x + side * wide / 2, base + high / 2
                    box(world, place, (thick, long), rotation=side * lean, friction=0.6)
            base += high
            for k in range(4 - storey):
                box(world, ((k - (3 - storey) / 2) * 2 * wide, base + thick), (0.98 * wide, thick), friction=0.6)
            base += 2 * thick
        before = np.array(world.bodies.dynamic.position)
        run(world, 600)
        assert np.abs(world.bodies.dynamic.position - before).max() < 2e-3
        assert world.kinetic_energy() < 1e-5


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "lightest", "seconds", "left"), [
        (1, 0.1, 30, 0.1), *(pytest.param(*case, marks=pytest.mark.long) for case in (
            (0, 1.0, 20, 1e-3), (1, 1.0, 20, 1e-3), (0, 0.01, 30, 0.1)
        )),
    ],
)  # fmt: skip
def test_mixed_shapes_between_walls_come_to_rest_and_nobody_leaves(seed, lightest, seconds, left):
    """200 boxes, balls, capsules and polygons, also of masses up to 100 kg with others of 10 g, which take longer. One
    heap in 42 of 1:100, that of seed 0, wedges a capsule of .1 kg .12 m deep between bodies of 2 and 6 kg."""
    random = np.random.default_rng(seed)
    with turning_world(2, G, capsule.plugin, convex_polygon.plugin) as world:
        for place, half in (((0, -1), (60, 1)), ((-7, 50), (1, 51)), ((7, 50), (1, 51))):
            wall(world, place, half, friction=0.5)
        for k in range(200):
            shape = (
                BoxCollider(random.uniform(0.15, 0.4, 2), friction=0.5),
                SphereCollider(random.uniform(0.2, 0.4), friction=0.5),
                CapsuleCollider(0.2, random.uniform(0.1, 0.25), friction=0.5),
                ConvexPolygonCollider.regular(3 + k % 4, random.uniform(0.25, 0.45), friction=0.5),
            )[k % 4]
            place = k % 11 - 5 + random.uniform(-0.05, 0.05), 0.6 + 1.05 * (k // 11)
            mass = lightest ** random.uniform(-1, 1)
            world.create_entity(Transform(place, random.uniform(-3, 3)), RigidBody(mass=mass), Spin(), shape)
        run(world, 60 * seconds)
        x, y = world.bodies.dynamic.position.T
        assert np.abs(x).max() < 6.0
        assert y.min() > 0.0
        assert world.kinetic_energy() < left
        assert world.contacts.depth.max() < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("d", [2, 3])
def test_what_falls_askew_comes_to_lie_on_a_side(d, mode):
    """On a large box and on ground without end."""
    random = np.random.default_rng(5)
    for endless in (True, False):
        with turning_world(d, G, half_space.plugin, collision=mode) as world:
            if endless:
                world.create_entity(Transform((0,) * d), half_space.HalfSpaceCollider((0, 1, 0)[:d], friction=0.5))
            else:
                wall(world, (0, -1, 0)[:d], (50, 1, 50)[:d], friction=0.5)
            turns = [0.6, 0.7] if d == 2 else [(0.9, 0.3, 0.1, 0.3), random.normal(size=4)]
            entities = [
                box(world, (4 * k, 1.3 + 0.2 * k, 0)[:d], (0.5,) * d, rotation=turn, friction=0.5)
                for k, turn in enumerate(turns)
            ]
            run(world, 300)
            for entity in entities:
                place, q = pose(world, entity)[:d], part(world, entity, Transform).rotation
                assert place[1] == pytest.approx(0.5, abs=1e-4)
                assert np.abs(motion(world, entity)[1]).max() < 1e-9
                up = turned(np.multiply(q, (1, -1, -1, -1)), np.eye(3)[1]) if d == 3 else (math.sin(q), math.cos(q), 0)
                assert np.sort(np.abs(up)) == pytest.approx((0, 0, 1), abs=1e-3)


def test_what_rests_does_not_notice_that_another_one_wakes():
    """The impulses of its contacts stay at their points, where those of the other come back among them."""
    ends = []
    for wakes in (False, True):
        with turning_world(2, G, sleeping=True) as world:
            wall(world, (0, -1), (20, 1), friction=0.5)
            sleeper, other = (box(world, at, (0.3, 0.2), friction=0.5) for at in ((-5.0, 0.2), (5.0, 6.0)))
            run(world, 72)  # it has landed, but does not sleep yet
            if wakes:
                part(world, sleeper, RigidBody).apply_impulse((-1.0, 0.0))
            world.step()
            assert part(world, sleeper, RigidBody).asleep is not wakes
            ends.append((*pose(world, other), *motion(world, other)[0]))
    assert ends[0] == ends[1]


def test_no_end_of_a_face_that_overlaps_is_left_out():
    """A box that is a quarter deep in another one, and askew: both of its lower corners push, else it would tip."""
    for turn in (0.05, 0.09, 0.12, 0.14):
        with turning_world() as world:
            box(world, (0, 0), (1, 0.5))
            half_height = 0.5 * (math.cos(turn) + math.sin(turn))
            upper = box(world, (0, 0.5 + half_height - 0.25), (0.5, 0.5), rotation=turn)
            world.step()
            assert abs(motion(world, upper)[1]) < 1e-3, turn


@pytest.mark.parametrize("spin", [0.1, 0.4, 0.8])
def test_contacts_tell_the_depth_of_boxes_as_they_are_turned_in_the_end(spin):
    """A box that turns between two walls is stopped where it is: its overlap follows from its angle, to a thousandth of
    the slop."""
    pushes = 0
    with turning_world() as world:
        for x in (-1.6, 1.6):
            wall(world, (x, 0), (1, 4), friction=0.5)
        entity = box(world, (0, 0), (0.55, 0.5), spin=spin)
        for _ in range(120):
            world.step()
            place = part(world, entity, Transform)
            reach = 0.55 * abs(math.cos(place.rotation)) + 0.5 * abs(math.sin(place.rotation))
            for contact in world.contacts:
                if contact.normal_impulse > 0.0:
                    assert contact.depth == pytest.approx(max(0.0, reach + abs(place.x) - 0.6), abs=5e-6)
                    pushes += 1
    assert pushes


@pytest.mark.parametrize("e", [0.8, 1.0])
def test_a_floor_whose_contact_is_disabled_holds_a_box_no_more_than_one_that_is_gone(e):
    """Nor do any of its points while a ball strikes the box in the same step."""

    def open_trapdoor():
        world.contacts.enabled[world.contacts.entity_a == floor] = False

    found = []
    for deleted in (False, True):
        with turning_world(2, 10, dt=1 / 30) as world:
            floor = wall(world, (0, -0.5), (2, 0.5))
            low = box(world, (0, 0.5), (0.5, 0.5))
            high = world.create_entity(Transform((0, 30)), RigidBody(), SphereCollider(0.25, restitution=e))
            run(world, 40)
            part(world, high, Transform).position = (0.1, 1.37)
            part(world, high, RigidBody).linear_velocity = (0, -4)
            if deleted:
                world.delete_entity(floor)
            else:
                world.add_system(Calls(Phase.NARROW, open_trapdoor))
            world.step()
            found.append([part(world, body, RigidBody).linear_velocity[1] for body in (low, high)])
    assert found[0] == pytest.approx(found[1], abs=1e-12)


def drop_stone(world, place, random, corners):
    """A stone of so many corners, on a sphere of 0.5, turned at random."""
    points = random.normal(size=(corners, 3))
    stone = ConvexHullCollider(0.5 * points / np.linalg.norm(points, axis=1)[:, None], friction=0.5)
    stone.offset = -stone.centre_of_mass
    world.create_entity(Transform(place, tuple(random.normal(size=4))), RigidBody(), Spin(), stone)


def test_stones_come_to_rest_on_a_floor():
    """They have no energy then, and are no deeper in the floor than what they weigh presses them."""
    with turning_world(3, 9.81, convex_hull.plugin) as world:
        wall(world, (0, -1, 0), (30, 1, 3), friction=0.5)
        for k, seed in enumerate((8, 9, 10, 11)):
            drop_stone(world, (4 * k, 0.8, 0), np.random.default_rng(seed), 10)
        run(world, 900)
        for _ in range(30):
            world.step()
            assert world.contacts.depth.max() < 1e-3
            assert world.kinetic_energy() < 1e-10


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
def test_stones_of_many_corners_lie_still(mode):
    """Each on three points, of which some hardly push. One of 30 may rock on: of 1,800 others 14 do, on faces that are
    nearly in one plane."""
    random = np.random.default_rng(MODES.index(mode))
    with turning_world(3, 9.81, convex_hull.plugin, collision=mode) as world:
        wall(world, (0, -1, 0), (30, 1, 30), friction=0.5)
        for k in range(30):
            drop_stone(world, (4 * (k % 6) - 10, 1, 4 * (k // 6) - 10), random, random.integers(12, 41))
        run(world, 1200)
        rocking = np.abs(world.bodies.dynamic.spin.angular_velocity).max(axis=1) > 1e-5
        assert rocking.sum() <= 1
        assert world.kinetic_energy() < 1e-4
