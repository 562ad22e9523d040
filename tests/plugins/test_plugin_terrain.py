"""Terrain: chains of segments under what rolls, slides, falls and rests on them."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from worlds import position, velocity

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Settings, World
from carom.plugins import Physics, capsule, convex_polygon, terrain
from carom.plugins.capsule import CapsuleCollider
from carom.plugins.convex_polygon import ConvexPolygonCollider
from carom.plugins.rotation import BoxCollider, Rotation, Spin
from carom.plugins.terrain import ChainSegmentCollider, create_chain
from carom.scenes import hills

pytestmark = pytest.mark.slow  # its shapes take long to compile

G = 10.0
MODES = ("discrete", "continuous", "event_driven")
SHAPES = {
    "ball": lambda **c: SphereCollider(0.4, **c),
    "crate": lambda **c: AABBCollider((0.4, 0.3), **c),
    "box": lambda **c: BoxCollider((0.4, 0.3), **c),
    "capsule": lambda **c: CapsuleCollider(0.2, 0.3, **c),
    "polygon": lambda **c: ConvexPolygonCollider.regular(5, 0.4, **c),
}
each_mode = pytest.mark.parametrize("mode", MODES)


def make_world(gravity=(0.0, -G), **settings):
    plugins = Rotation(), terrain.plugin, capsule.plugin, convex_polygon.plugin
    return World(Physics(dimensions=2, gravity=gravity), *plugins, settings=Settings(**settings))


def throw(world, place, velocity, shape, *, spin=True, rotation=0.0, **collider):
    parts = [Transform(place, rotation), RigidBody(linear_velocity=velocity), SHAPES[shape](**collider)]
    if spin and shape != "crate":
        parts.append(Spin())
    return world.create_entity(*parts)


def angle(world, entity):
    return world.component_for_entity(entity, Transform).rotation


@each_mode
def test_each_segment_has_the_friction_that_the_list_says(mode):
    """Crates, with None, slide v^2 / 2 mu g on each; what lies on the layer that they do not meet falls."""
    frictions = [0.1, 0.3, None, 0.5]
    world = make_world(collision=mode, substeps=8)
    ground = create_chain(
        world, [(-60, 0), (-20, 0), (20, 0), (60, 0), (100, 0)], friction=frictions, layer=[1, 1, 1, 2], thickness=0.1
    )
    assert [world.component_for_entity(e, ChainSegmentCollider).friction for e in ground] == frictions
    crates = [throw(world, (x, 0.3), (4.0, 0.0), "crate", friction=None, mask=1) for x in (-50, -10, 30, 70)]
    for _ in range(300):
        world.step()
    moved = [position(world, crate)[0] - x for crate, x in zip(crates, (-50, -10, 30, 70), strict=True)]
    assert moved[:3] == pytest.approx([8 / (0.1 * G), 8 / (0.3 * G), 20.0], rel=0.02)
    assert position(world, crates[3])[1] < -100


@each_mode
@pytest.mark.parametrize("tilt", [0.0, 0.5])
def test_what_slides_over_a_hundred_joints_keeps_height_speed_and_angle(mode, tilt):
    """At 30 m/s without friction; lengths of segments are uneven. A world that is turned as a whole does the same."""
    along, up = np.array((math.cos(tilt), math.sin(tilt))), np.array((-math.sin(tilt), math.cos(tilt)))
    world = make_world(tuple(-G * up), collision=mode)
    x = np.cumsum(np.random.default_rng(1).uniform(0.3, 1.7, 120)) - 20.0
    create_chain(world, x[:, None] * along, friction=0.0)
    heights = {"ball": 0.4, "crate": 0.3, "box": 0.3, "capsule": 0.2}
    if tilt:
        del heights["crate"]  # it does not turn
    angles = {shape: tilt + (math.pi / 2.0 if shape == "capsule" else 0.0) for shape in heights}  # that one lies
    bodies = {
        shape: throw(world, 6.0 * k * along + height * up, 30.0 * along, shape, friction=0.0, rotation=angles[shape])
        for k, (shape, height) in enumerate(heights.items())
    }
    for _ in range(120):
        world.step()
    for k, (shape, entity) in enumerate(bodies.items()):
        near = 1e-9 if shape == "ball" else 1e-3 if shape == "capsule" else 1e-5  # what turns trembles a little
        assert position(world, entity) @ up == pytest.approx(heights[shape], abs=near)
        assert position(world, entity) @ along == pytest.approx(6.0 * k + 60.0, abs=near)
        assert velocity(world, entity) @ along == pytest.approx(30.0, abs=near)
        if shape != "ball":
            assert angle(world, entity) == pytest.approx(angles[shape], abs=near)


@each_mode
@pytest.mark.parametrize("tilt", [0.3, 1.0])
def test_what_goes_beyond_its_own_length_in_a_step_is_borne_by_what_it_leaves(mode, tilt):
    """At 50 m/s, 0.83 m in a step, over segments of 0.1 m, once it lies on the first one."""
    along, up = np.array((math.cos(tilt), math.sin(tilt))), np.array((-math.sin(tilt), math.cos(tilt)))
    shapes = BoxCollider((0.5, 0.3)), ConvexPolygonCollider(((-0.5, -0.3), (0.5, -0.3), (0.6, 0.0), (0.0, 0.4)))
    for shape, uneven in itertools.product(shapes, (0.0, 0.9)):
        world = make_world(tuple(-G * up), collision=mode, on_fault="ignore")
        ways = 0.1 * (1.0 + uneven * np.random.default_rng(1).uniform(-1, 1, 1300))
        create_chain(world, np.concatenate(((0.0,), 20.0 + np.cumsum(ways)))[:, None] * along)
        body = RigidBody(linear_velocity=50.0 * along)
        entity = world.create_entity(Transform(5.0 * along + 0.3 * up, tilt), body, Spin(), shape.copy())
        for _ in range(120):
            world.step()
            assert position(world, entity) @ up == pytest.approx(0.3, abs=5e-3)
            assert velocity(world, entity) @ along == pytest.approx(50.0, rel=4e-3)
            assert angle(world, entity) == pytest.approx(tilt, abs=0.02)


@each_mode
def test_nobody_passes_the_hills(mode):
    """Sixty bodies of four kinds, thrown about; the centre of each stays above the line for ten seconds."""
    points = hills.ground()
    with hills.build(Settings(collision=mode), seed=3) as world:
        bodies = world.bodies.dynamic.entity.tolist()
        random = np.random.default_rng(0)
        for entity in bodies:
            world.component_for_entity(entity, RigidBody).linear_velocity = random.uniform(-8.0, 8.0, 2)
        for _ in range(600):
            world.step()
            x, y = world.bodies.dynamic.position.T
            assert (y > np.interp(x, *points.T)).all()
        assert len({entity for c in world.contacts for entity in (c.entity_a, c.entity_b)} & set(bodies)) == len(bodies)


@pytest.mark.parametrize("mode", MODES[1:])
def test_nothing_fast_passes_in_swept_worlds(mode):
    """Small and thin bodies that cover many times their size in a step."""
    world = make_world(collision=mode)
    x = np.arange(-40.0, 40.5, 0.5)
    ground = np.stack((x, np.sin(x) + 0.3 * np.sin(5.0 * x)), axis=1)
    create_chain(world, np.concatenate((((-45.0, 60.0),), ground, ((45.0, 60.0),))))
    random = np.random.default_rng(5)
    for k in range(80):
        parts = (SphereCollider(0.02), AABBCollider((0.3, 0.01)), BoxCollider((0.3, 0.15)))[k % 3]
        spin = () if k % 3 == 1 else (Spin(random.uniform(-5.0, 5.0)),)
        way = (random.uniform(-60.0, 60.0), random.uniform(-300.0, -50.0))
        world.create_entity(Transform((-39.5 + k, 20.0)), RigidBody(linear_velocity=way), parts, *spin)
    for _ in range(120):
        world.step()
        places = world.bodies.dynamic.position
        assert (places[:, 1] > np.interp(places[:, 0], *ground.T) - 1e-3).all()


@pytest.mark.parametrize("mode", MODES[1:])
@pytest.mark.parametrize("e", [0.5, 1.0])
def test_no_thin_bar_that_spins_passes_waves_or_peaks(e, mode):
    """100 of up to 500 rad/s, 20 mm thick, 30 steps: their centres stay in front of the line."""
    random, n = np.random.default_rng(10), 100
    x = np.linspace(-8.0, 8.0, 17)
    for k, y in enumerate((0.3 * np.sin(2.0 * x), 0.3 * np.abs(np.mod(x, 2.0) - 1.0))):
        world = make_world(collision=mode, on_fault="ignore")
        for column in range(n):
            create_chain(world, np.stack((x, y), 1), position=(40.0 * column, 0.0), restitution=e, friction=0.5 * k)
        length, angles = random.uniform(0.3, 1.0, n), random.uniform(0, 6, n)
        aside = random.uniform(-2, 2, n)
        high = length * np.abs(np.sin(angles)) + 0.33 + random.uniform(0.001, 0.3, n)
        velocities = np.stack((random.uniform(-5, 5, n), random.uniform(-20, 0, n)), 1)
        world.create_entities(
            n, Transform.many(np.stack((aside + 40.0 * np.arange(n), high), 1), angles),
            RigidBody.many(linear_velocity=velocities), Spin.many(random.uniform(-500, 500, n)),
            BoxCollider.many(np.stack((length, np.full(n, 0.01)), 1), restitution=e, friction=0.5 * k),
        )  # fmt: skip
        for _ in range(30):
            world.step()
        places = world.bodies.dynamic.position
        along = places[:, 0] - 40.0 * np.arange(n)
        assert (places[:, 1] > np.interp(along, x, y) - 0.03)[np.abs(along) < 7.9].all()


@each_mode
def test_a_ball_swings_in_a_parabola_of_many_segments(mode):
    """Without friction the speed is that of the height; and it comes up as high on the other side."""
    world = make_world(collision=mode, dt=1 / 240)
    x = np.linspace(-3.0, 3.0, 1201)
    create_chain(world, np.stack((x, x**2 / 4.0), axis=1))
    start = np.array((-2.0, 1.0)) + 0.1 * np.array((1.0, 1.0)) / math.sqrt(2.0)
    ball = world.create_entity(Transform(start), RigidBody(), SphereCollider(0.1))
    path = []
    for _ in range(480):
        world.step()
        path.append((*position(world, ball), *velocity(world, ball)))
    x, y, u, v = np.array(path).T
    energy = G * y + 0.5 * (u * u + v * v)
    assert energy == pytest.approx(G * start[1], rel=0.02)
    assert y.min() == pytest.approx(0.1, abs=1e-3)
    assert x.max() == pytest.approx(-start[0], abs=0.03)
    assert (y - x**2 / 4.0 > 0.09).all()


@each_mode
def test_boxes_rest_on_slopes_and_across_joints_with_two_points(mode):
    world = make_world(collision=mode)
    slope = math.atan(0.5)
    create_chain(world, [(-10, 5), (0, 0), (2, 0), (3, 0), (4, 0), (14, 5), (24, 5), (24, 0)], friction=0.8)
    places = [(-5.0, 2.5), (9.0, 2.5)]
    boxes = [
        throw(world, (x - 0.3 * side * math.sin(slope), y + 0.3 * math.cos(slope)), (0, 0), "box",
              rotation=side * slope, friction=0.8)
        for (x, y), side in zip(places, (-1.0, 1.0), strict=True)
    ]  # fmt: skip
    boxes.append(throw(world, (3.0, 0.3), (0, 0), "box", friction=0.8))  # above a joint
    boxes.append(throw(world, (23.8, 5.3), (0, 0), "box", friction=0.8))
    before = [(*position(world, entity), angle(world, entity)) for entity in boxes]
    for _ in range(300):
        world.step()
    for entity, was in zip(boxes, before, strict=True):
        assert (*position(world, entity), angle(world, entity)) == pytest.approx(was, abs=1e-3)
        assert velocity(world, entity) == pytest.approx((0, 0), abs=1e-5)


def test_a_ball_in_a_valley_touches_both_sides():
    world = make_world()
    create_chain(world, [(-4, 4), (0, 0), (4, 4)])
    ball = throw(world, (0.0, 0.6), (0, 0), "ball")
    for _ in range(120):
        world.step()
    assert position(world, ball) == pytest.approx((0, 0.4 * math.sqrt(2.0)), abs=2e-3)
    assert [contact.entity_a for contact in world.contacts] == [1, 2]


@each_mode
def test_what_bounces_on_a_joint_bounces_as_high(mode):
    world = make_world(collision=mode, integrator="velocity_verlet")
    create_chain(world, [(x, 0.0) for x in range(-5, 6)], restitution=1.0)
    balls = [throw(world, (x, 1.4), (0, 0), "ball", restitution=1.0) for x in (-3.0, 0.3, 2.0)]
    highest = 0.0
    for k in range(600):
        world.step()
        if k > 480:
            highest = np.maximum(highest, [position(world, ball)[1] for ball in balls])
    assert highest == pytest.approx(1.4, abs=1e-5)


def test_one_side_is_solid():
    """From behind a ball passes; rays see the front only; with a thickness it comes out where it went in."""
    world = make_world(gravity=(0.0, 0.0))
    chain = create_chain(world, [(0, 0), (2, 0), (4, 0)])
    ball = throw(world, (1.0, -1.0), (0, 6.0), "ball")
    for _ in range(60):
        world.step()
    assert position(world, ball)[1] > 4.0
    assert velocity(world, ball)[0] == 0.0
    assert world.ray_cast((1.0, 0.5), (0, -1))[0].entity == chain[0]
    assert not world.ray_cast((3.0, -0.5), (0, 1), max_distance=1.0)
    create_chain(world, [(10, 0), (14, 0)], thickness=0.5)
    inside = throw(world, (12.0, -0.4), (0, 0), "ball")
    for _ in range(120):
        world.step()
    assert position(world, inside)[1] > 0.39


@each_mode
@pytest.mark.parametrize("seed", range(3))
def test_thickness_is_how_far_behind_straight_ground_bodies_are_pushed_out(mode, seed):
    """Of any length of segments, thinner than the balls and thicker; farther behind they fall."""
    random = np.random.default_rng(seed)
    tilt, thickness = random.uniform(-0.5, 0.5), random.uniform(0.3, 2.0)
    along, up = np.array((math.cos(tilt), math.sin(tilt))), np.array((-math.sin(tilt), math.cos(tilt)))
    world = make_world(tuple(-G * up), collision=mode)
    create_chain(world, np.cumsum(random.uniform(0.2, 3.0, 40))[:, None] * along, thickness=thickness)
    behind = random.uniform(0.05, 2.0, 30) * thickness
    behind[np.abs(behind - thickness) < 0.1] = 0.5 * thickness
    balls = [world.create_entity(Transform(x * along - far * up), RigidBody(),
                                 SphereCollider(random.uniform(0.1, 0.6), layer=2, mask=1))
             for x, far in zip(random.uniform(5, 40, 30), behind, strict=True)]  # fmt: skip
    for _ in range(30):
        world.step()
    rises = [position(world, ball) @ up > -far for ball, far in zip(balls, behind, strict=True)]
    assert rises == (behind < thickness).tolist()
    world.close()


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("lean", [0.0, 0.012, -0.012])
def test_a_box_that_overhangs_a_sharp_peak_stands_on_it(mode, lean):
    """Its own face decides at the corner, also one that is almost parallel to the wall there."""
    for x in (0.1, 0.25):
        world = make_world(collision=mode)
        create_chain(world, ((0, 0), (-1, -1), (0, -1))[::-1], loop=True)
        box = ConvexPolygonCollider.box((0.4, 0.4))
        body = world.create_entity(Transform((x, 0.6), lean), RigidBody(), box)
        for _ in range(60):
            world.step()
        assert position(world, body)[1] == pytest.approx(0.4, abs=0.015)
        world.close()


def test_loops_are_solid_on_the_right():
    """Clockwise an island, counter-clockwise a cave, with corners of 90 degrees."""
    world = make_world()
    square = np.array(((-3.0, -1.0), (3.0, -1.0), (3.0, 1.0), (-3.0, 1.0)))
    create_chain(world, square[::-1], loop=True)
    create_chain(world, 4.0 * square, loop=True)
    on_top, below = throw(world, (0.0, 2.0), (3.0, 0), "ball"), throw(world, (0.0, -2.0), (3.0, 0), "ball")
    for _ in range(240):
        world.step()
        for entity in (on_top, below):
            x, y = position(world, entity)
            assert abs(x) < 12.0 - 0.39
            assert abs(y) < 4.0 - 0.39
            assert max(abs(x) - 3.0, abs(y) - 1.0) > 0.25


def test_it_is_saved_and_goes_on_to_the_bit(tmp_path):
    with hills.build(n=8) as world:
        for _ in range(60):
            world.step()
        world.save(tmp_path / "hills")
        plugins = Rotation(), terrain.plugin, capsule.plugin, convex_polygon.plugin
        with World.load(tmp_path / "hills", Physics(dimensions=2, gravity=(0.0, -hills.GRAVITY)), *plugins) as other:
            for _ in range(60):
                world.step()
                other.step()
            assert world.state_hash() == other.state_hash()


@pytest.mark.parametrize(
    ("points", "options", "message"),
    [
        ([(0, 0)], {}, r"create_chain: points must be 2 or more of 2 numbers each, got \[\(0, 0\)\]"),
        ([(0, 0), (1, 0)], {"loop": True}, "points must be 3 or more of 2 numbers"),
        (np.zeros((4, 3)), {}, r"2 numbers each, got an array of shape \(4, 3\)"),
        ("hill", {}, "2 numbers each, got 'hill'"),
        ([(0, 0), (10**400, 0)], {}, r"2 numbers each, got \[\(0, 0\), \(1000"),
        ([(0, 0), (1, math.nan)], {}, r"points must be finite, row 1 is \(1.0, nan\)"),
        ([(0, 0), (1, 0), (1, 0)], {}, r"points 1 and 2 are both \(1.0, 0.0\)"),
        ([(0, 0), (1, 0), (1, 1), (0, 0)], {"loop": True}, r"points 3 and 0 are both \(0.0, 0.0\)"),
        ([(0, 0), (1, 0)], {"thickness": -1.0}, r"ChainSegmentCollider.thickness .*-1.0"),
    ],
)
def test_bad_points_are_refused(points, options, message):
    world = make_world()
    with pytest.raises(ValueError, match=message):
        create_chain(world, points, **options)
    assert not len(world.bodies)


def test_it_is_refused_in_3d_and_on_what_moves():
    world = World(Physics(dimensions=3), terrain.plugin)
    with pytest.raises(ValueError, match="create_chain: a chain is for 2D worlds, this world is 3D"):
        create_chain(world, [(0, 0), (1, 0)])
    world = make_world()
    segment = ChainSegmentCollider((-1, 0), (1, 0), (-1, 0), (1, 0))
    entity = world.create_entity(Transform((0, 0)), RigidBody(), segment)
    with pytest.raises(ValueError, match=f"entity {entity} has ChainSegmentCollider, which no RigidBody can have"):
        world.step()


def test_a_step_in_which_the_queue_of_impacts_grows_has_the_same_bits():
    """A world that has just been restored has less room than the one that has come here by itself."""
    random = np.random.default_rng(61)
    random.choice(4), random.choice(5), random.choice(4), random.choice(3), random.integers(2)
    angles = np.linspace(0, 2 * np.pi, int(random.integers(5, 60)), endpoint=False)
    radii = 12 + random.uniform(-2, 2, len(angles))
    random.choice(2), random.choice(4), random.choice(2), random.choice(2)
    world = make_world(gravity=(0, -9.81), collision="event_driven", integrator="yoshida4", substeps=2)
    cave = np.stack((radii * np.cos(angles), radii * np.sin(angles)), 1)
    create_chain(world, cave, loop=True, friction=0.5)
    for k in range(12):
        kind = random.integers(4)
        if kind == 0:
            shape = SphereCollider(random.uniform(0.3, 0.8), friction=0.5)
        elif kind == 1:
            shape = BoxCollider(random.uniform(0.2, 0.7, 2), friction=0.5)
        elif kind == 2:
            turns = np.linspace(0, 2 * np.pi, int(random.integers(3, 7)), endpoint=False)
            corners = [(float(np.cos(a)) * 0.7, float(np.sin(a)) * 0.7) for a in turns]
            shape = ConvexPolygonCollider(corners, friction=0.5)
        else:
            shape = CapsuleCollider(0.3, 0.4, friction=0.5)
        v = random.normal(size=2)
        v *= 30 / np.linalg.norm(v)
        place = np.array(((k % 4) * 2.5 - 4, (k // 4) * 2.5 - 3))
        where, mass = Transform(place, float(random.uniform(-3, 3))), float(10 ** random.uniform(-1, 1))
        world.create_entity(where, RigidBody(mass=mass, linear_velocity=v), Spin(float(random.uniform(-30, 30))), shape)
    for _ in range(145):
        world.step()
    other = make_world(collision="event_driven", integrator="yoshida4", substeps=2)
    other.restore(world.snapshot())
    world.step()
    other.step()
    assert other.state_hash() == world.state_hash()
