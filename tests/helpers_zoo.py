"""Small worlds that together run every kernel: modes, methods, shapes, levels, grids and trees, queries, refusals.

``python -m tests.helpers_zoo NAME...`` prints a hash per scenario of all that can be seen of it.
"""

from __future__ import annotations

import hashlib
import itertools
import math
import sys
from collections.abc import Callable, Iterator

import numpy as np

from carom.components import AABBCollider, Collider, RigidBody, SphereCollider, Transform
from carom.framework import ForceSystem, Plugin, Settings, World, column
from carom.framework.vectors import item, replace, scale
from carom.plugins import Physics, capsule, convex_polygon, half_space, terrain, tile_grid
from carom.plugins.capsule import CapsuleCollider
from carom.plugins.character import Character, Characters, Ladder
from carom.plugins.joints import Ball, Cone, Distance, Hinge, Joints, Motor, MousePull, Slider, Weld
from carom.plugins.paths import Path, Paths
from carom.plugins.rotation import BoxCollider, Rotation, Spin
from carom.plugins.springs import Springs
from carom.plugins.timers import Timer, Timers
from carom.plugins.zones import Field, Water, Wind, Zones, explode

MODES = ("discrete", "continuous", "event_driven")
METHODS = ("explicit_euler", "semi_implicit_euler", "velocity_verlet", "rk4", "yoshida4")
STEPS = 10

gems = Plugin("gems")


@gems.shape(cost=2)
class Gem(Collider):
    """|x| + |y| + |z| <= radius; meets other shapes through its support alone."""

    radius = column(positive=True)

    def bounds(shape, dimensions):
        if dimensions == 2:
            return shape.radius, shape.radius
        return shape.radius, shape.radius, shape.radius

    def support(shape, direction):
        best = 0
        for k in range(len(direction)):
            if abs(item(direction, k)) > abs(item(direction, best)):
                best = k
        return replace(scale(direction, 0.0), best, math.copysign(shape.radius, item(direction, best)))


def seen(world: World) -> str:
    """The state and everything that is told of contacts and faults."""
    digest = hashlib.sha256(world.state_hash().encode())
    contacts = world.contacts
    for rows in (contacts, contacts.begin, contacts.end, contacts.impacts):
        for name in ("entity_a", "entity_b", "point", "normal", "depth", "normal_impulse"):
            digest.update(getattr(rows, name).tobytes())
    digest.update(repr([str(fault) for fault in world.faults]).encode())
    return digest.hexdigest()[:16]


def play(world: World, steps: int = STEPS) -> list[str]:
    """What is seen after each step."""
    found = []
    for _ in range(steps):
        world.step()
        found.append(seen(world))
    return found


def at(d: int, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> tuple[float, ...]:
    return (x, y, z)[:d]


def mixed(d: int, mode: str, count: int = 14, **settings) -> World:
    """Bodies of all convex shapes fall into a box; every third is a bullet, some are rotated, some kinematic."""
    random = np.random.default_rng(d)
    plugins = [capsule.plugin, half_space.plugin, *([convex_polygon.plugin] if d == 2 else [])]
    world = World(Physics(d, gravity=at(d, 0.0, -9.81)), *plugins, settings=Settings(collision=mode, **settings))
    world.create_entity(Transform(at(d)), half_space.HalfSpaceCollider(at(d, 0.0, 1.0), friction=0.5, restitution=0.3))
    for side, axis in itertools.product((-1, 1), (0, 2) if d == 3 else (0,)):
        place, half = [0.0, 2.0, 0.0][:d], [3.0, 3.0, 3.0][:d]
        place[axis], half[axis] = 2.0 * side, 0.2
        world.create_entity(Transform(tuple(place)), AABBCollider(tuple(half), restitution=0.5))
    for k in range(count):
        look = {"restitution": random.uniform(), "friction": random.uniform()}
        shapes = [
            SphereCollider(random.uniform(0.2, 0.3), **look),
            AABBCollider(tuple(random.uniform(0.1, 0.3, d)), **look),
            capsule.CapsuleCollider(0.15, 0.2, **look),
        ]
        if d == 2:
            shapes.append(convex_polygon.ConvexPolygonCollider([(-0.2, -0.2), (0.3, -0.2), (0.0, 0.3)], **look))
        place = (*random.uniform(-1.5, 1.5, 1), 0.4 + 0.2 * k, *random.uniform(-1.5, 1.5, d - 2))
        turned = 0.3 * k if d == 2 else tuple(random.normal(size=4))
        body = RigidBody(
            mass=random.uniform(0.5, 3.0), linear_velocity=tuple(random.uniform(-8, 8, d)), ccd=k % 3 == 0,
            max_linear_speed=6.0 if k == 5 else None, linear_damping=0.2 if k == 6 else 0.0,
            kind="kinematic" if k == 7 else "dynamic",
        )  # fmt: skip
        world.create_entity(Transform(place, rotation=turned), body, shapes[k % len(shapes)])
    return world


def platformer(mode: str) -> World:
    plugins = (capsule.plugin, tile_grid.plugin, convex_polygon.plugin)
    world = World(Physics(2, gravity=(0.0, -9.81)), *plugins, settings=Settings(collision=mode))
    world.create_entity(Transform((0.0, 0.0)), tile_grid.TileGridCollider(["#....#", "#.#..#", "######"], 1.0))
    world.create_entity(Transform((0.0, 1.0)), AABBCollider((1.0, 0.0), one_way=(0.0, 1.0)))
    for k, collider in enumerate((capsule.CapsuleCollider(0.2, 0.3), SphereCollider(0.2), AABBCollider((0.2, 0.2)))):
        body = RigidBody(linear_velocity=(2.0 - k, -6.0 * k))
        world.create_entity(Transform((-0.8 + 0.7 * k, 1.6 + 0.3 * k)), body, collider)
    corners = convex_polygon.ConvexPolygonCollider([(-0.2, -0.2), (0.2, -0.2), (0.0, 0.2)])
    world.create_entity(Transform((0.5, 0.8)), RigidBody(linear_velocity=(3.0, 1.0)), corners)
    return world


def tumbling(d: int, mode: str) -> World:
    """Boxes, balls and a capsule with a Spin fall onto each other beside a mill; one has no Spin."""
    world = World(Physics(d, gravity=at(d, 0.0, -9.81)), Rotation(), capsule.plugin, settings=Settings(collision=mode))
    world.create_entity(Transform(at(d)), RigidBody(kind="static"), BoxCollider((9.0, 0.5, 9.0)[:d], friction=0.5))
    about, turned = (lambda w: w) if d == 2 else (lambda w: (0.3, -w, w)), 0.7 if d == 2 else (1.0, 0.3, 0.1, 0.4)
    mill = BoxCollider((1.0, 0.2, 0.2)[:d], friction=0.5)
    world.create_entity(Transform(at(d, -1.5, 1.5)), RigidBody(kind="kinematic"), Spin(about(2.0)), mill)
    for k in range(5):
        shapes = BoxCollider((0.3, 0.4, 0.2)[:d], friction=0.5), SphereCollider(0.3, restitution=0.4, friction=0.5)
        spin = Spin(about(3.0 - k), constant_torque=about(0.2), angular_damping=0.1 * k, max_angular_speed=4.0)
        body = RigidBody(1.0 + k, at(d, 2.0 - k, -3.0))
        shape = capsule.CapsuleCollider(0.2, 0.3, friction=0.5) if k == 4 else shapes[k % 2]
        world.create_entity(Transform(at(d, 0.4 * k - 0.8, 1.1 + 0.62 * k), turned), body, spin, shape)
    world.create_entity(Transform(at(d, 0.5, 2.2)), RigidBody(), SphereCollider(0.2))
    return world


def joined(d: int, mode: str) -> World:
    """Two bodies with each kind of joint, of each rule: held, limited, driven, sprung; beside them a floor."""
    world = World(Physics(d, gravity=at(d, 0.5, -9.81)), Rotation(), Joints(), settings=Settings(collision=mode))
    world.create_entity(Transform(at(d, 0.0, -0.9)), BoxCollider((40.0, 0.1, 9.0)[:d], friction=0.5))
    axis, turned = at(d, 0.3, 1.0, 0.5), 0.4 if d == 2 else (1.0, 0.3, 0.1, 0.4)
    about: dict[str, object] = {"axis": axis} if d == 3 else {}
    joints = [
        lambda a, b, x: Hinge(None, a, x, motor_speed=9.0, max_torque=2.0, limits=(-0.1, 0.2), **about),
        lambda a, b, x: Hinge(a, b, x, frequency=2.0, damping_ratio=0.2, **about),
        lambda a, b, x: Ball(a, b, x),
        lambda a, b, x: Weld(a, b, x),
        lambda a, b, x: Slider(a, b, axis, limits=(-0.01, 0.05), motor_speed=1.0, max_force=5.0),
        lambda a, b, x: Slider(None, b, axis, frequency=3.0),
        lambda a, b, x: Distance(a, b, point_a=x),
        lambda a, b, x: Distance(a, length=(0.0, 0.1)),
        lambda a, b, x: Distance(a, b, frequency=4.0, damping_ratio=0.5),
        lambda a, b, x: Motor(a, b, speed=2.0, max_torque=1.0, **about),
        lambda a, b, x: Motor(b, angle=0.5, **about),
        lambda a, b, x: MousePull(a, x, at(d, 1.0, 2.0), max_force=50.0),
        *([lambda a, b, x: Cone(a, b, x, axis, swing=0.05, twist=(-0.02, 0.02))] if d == 3 else []),
    ]
    for k, joint in enumerate(joints):
        ends = [
            world.create_entity(
                Transform(at(d, 3.0 * k - 18.0 + x, y), turned), RigidBody(1.0 + x), Spin(),
                BoxCollider((0.3, 0.2, 0.25)[:d], friction=0.5),
            )
            for x, y in ((0.0, 0.0), (0.8, -0.4))
        ]  # fmt: skip
        world.create_entity(joint(*ends, at(d, 3.0 * k - 17.5, 0.3, 0.1)))
    return world


def struck(d: int, mode: str) -> World:
    """A ball strikes a beam of welds with a flap at its end."""
    world = World(Physics(d, gravity=at(d, 0.0, -9.81)), Rotation(), Joints(), settings=Settings(collision=mode))
    look, half = {"restitution": 0.5, "friction": 0.4}, (0.5, 0.25, 0.5)[:d]
    beam = [
        world.create_entity(Transform(at(d, 1.1 * k)), RigidBody(1.0 + k), Spin(), BoxCollider(half, **look))
        for k in range(3)
    ]
    about: dict[str, object] = {"axis": (0.0, 0.0, 1.0)} if d == 3 else {}
    for joint in (
        Weld(None, beam[0], at(d, -0.5)), Weld(beam[0], beam[1], at(d, 0.55), breaking_force=1e4),
        Hinge(beam[1], beam[2], at(d, 1.65), limits=(-0.1, 0.2), **about),
    ):  # fmt: skip
        world.create_entity(joint)
    ball = RigidBody(0.5, at(d, 2.0, -20.0))
    world.create_entity(Transform(at(d, 1.0, 0.9, 0.1)), ball, Spin(), SphereCollider(0.25, **look))
    return world


def ground(d: int, mode: str) -> World:
    """What rolls, slides, lands and is buried on hills."""
    plugins = Rotation(), terrain.plugin, capsule.plugin
    world = World(Physics(d, gravity=at(d, 0.0, -9.81)), *plugins, settings=Settings(collision=mode))
    height = 0.4 * np.sin(1.7 * np.arange(12.0 if d == 2 else 6.0))
    if d == 2:
        terrain.create_chain(world, np.stack((np.arange(12.0), height), axis=1), thickness=0.1, friction=0.3)
    else:
        field = height[:, None] + 0.1 * np.arange(4.0)
        terrain.create_height_field(world, field, 1.0, position=(0.0, 0.0, -1.5), thickness=0.1, friction=0.3)
    for k in range(10 if d == 2 else 4):
        shapes = SphereCollider(0.3), BoxCollider((0.3, 0.2, 0.25)[:d]), capsule.CapsuleCollider(0.15, 0.2)
        place = at(d, 0.5 + k, height[k] + 0.1 * (k % 5), 0.1 * k - 0.4)
        turned = 0.5 * k if d == 2 else (1.0, 0.2 * k, 0.3, 0.1)
        body = RigidBody(linear_velocity=at(d, 2.0 - k % 3, -6.0), ccd=k % 4 == 0)
        world.create_entity(Transform(place, turned), body, Spin(), shapes[k % 3])
    return world


def levels(d: int, mode: str) -> World:
    """Entities with several colliders, sensors among them, and layers."""
    world = World(Physics(d, gravity=at(d, 0.0, -9.81)), settings=Settings(collision=mode))
    world.create_entity(Transform(at(d, 0.0, -1.0)), AABBCollider(tuple(1.0 if k == 1 else 9.0 for k in range(d))))
    for k in range(6):
        body = RigidBody(linear_velocity=at(d, 1.0 - k, -4.0), ccd=k == 2)
        look = {"sensor": True} if k == 4 else {"restitution": 0.5, "layer": 1 + k % 2}
        half = tuple(0.25 if k == 0 else 0.2 for k in range(d))
        place = Transform(at(d, 0.7 * k - 2.0, 0.4 + 0.1 * k))
        if k % 2:
            world.create_entity(place, body, SphereCollider(0.3, **look))
        else:
            world.create_entity(place, body, SphereCollider(0.4, **look), AABBCollider(half, **look))
    return world


def crowd(d: int, mode: str, sizes: float, moving: int = 200) -> World:
    """Among 200 that do not move so many do that candidates come from grids; of very different sizes, from trees, and
    they only feel each other: hundreds that overlap would take Python minutes."""
    random = np.random.default_rng(5)
    world = World(Physics(d), settings=Settings(collision=mode))
    side = 40.0 if d == 2 else 16.0
    for k in range(200 + moving):
        place, radius = tuple(random.uniform(-side, side, d)), 0.2 * np.exp(sizes * random.uniform() ** 16)
        if k < 200:
            world.create_entity(Transform(place), AABBCollider((radius,) * d))
        else:
            body = RigidBody(linear_velocity=tuple(random.uniform(-30.0, 30.0, d)))
            look = {"sensor": True} if sizes > 4.0 else {"restitution": 1.0}
            world.create_entity(Transform(place), body, SphereCollider(radius, **look))
    return world


def break_shot(d: int, mode: str) -> World:
    """One ball strikes two at once, while a light one is pinched between two heavy ones."""
    world = World(Physics(d), settings=Settings(collision=mode))
    for x, y, speed in ((-2.0, 0.0, 30.0), (0.0, 0.51, 0.0), (0.0, -0.51, 0.0)):
        body = RigidBody(linear_velocity=at(d, speed))
        world.create_entity(Transform(at(d, x, y)), body, SphereCollider(0.5, restitution=1.0, friction=0.2))
    for x, y, mass in ((-1.5, 9.03, 1e3), (0.0, 9.0, 1e-3), (1.5, 9.03, 1e3)):
        body = RigidBody(mass=mass, linear_velocity=at(d, -5.0 * x))
        world.create_entity(Transform(at(d, x, y)), body, SphereCollider(1.0 if x else 0.5, restitution=1.0))
    return world


def buried(d: int) -> World:
    """Convex shapes deep in each other, and gems that meet all others by their supports alone."""
    world = World(Physics(d, gravity=at(d, 0.0, -9.81)), gems, capsule.plugin)
    world.create_entity(Transform(at(d, 0.0, -1.0)), AABBCollider((1.0,) * d, friction=0.4))
    half = (0.3, 0.2, 0.25)[:d]
    for k, collider in enumerate((Gem(0.4), capsule.CapsuleCollider(0.2, 0.2), AABBCollider(half), Gem(0.3))):
        turned = 0.7 * k if d == 2 else (math.cos(0.4 * k), math.sin(0.4 * k), 0.0, 0.0)
        place = at(d, 0.05 * k, 0.1 + 0.02 * k, 0.01 * k)
        world.create_entity(Transform(place, rotation=turned), RigidBody(), collider)
    return world


def heavy_on_light(d: int) -> World:
    world = World(Physics(d, gravity=at(d, 0.0, -9.81)))
    world.create_entity(Transform(at(d, 0.0, -1.0)), AABBCollider((1.0,) * d))
    for k, mass in enumerate((1.0, 1.0, 1e4)):
        world.create_entity(Transform(at(d, 0.0, 0.5 + k)), RigidBody(mass=mass), SphereCollider(0.5))
    return world


def bullets(d: int, mode: str) -> World:
    """Fast bodies, each caught between others: many impacts in a step, on paths that are bent by gravity."""
    world = World(Physics(d, gravity=at(d, 0.0, -300.0)), settings=Settings(collision=mode, dt=1 / 30))
    for x in (-1.0, 1.0):
        world.create_entity(Transform(at(d, x)), AABBCollider((0.1,) * d, restitution=1.0))
    for k in range(3):
        body = RigidBody(linear_velocity=at(d, 90.0, 10.0 * k), ccd=True)
        world.create_entity(Transform(at(d, 0.4 * k - 0.4, 0.01 * k)), body, SphereCollider(0.05, restitution=0.9))
    world.create_entity(Transform(at(d, 0.0, -1.0)), AABBCollider(tuple(1.0 if k != 1 else 0.1 for k in range(d))))
    return world


class Pull(ForceSystem):
    """A force of the game, by position and velocity."""

    def add_forces(self, bodies, time):
        bodies.force -= 3.0 * bodies.position + 0.1 * bodies.linear_velocity


def swinging(d: int, method: str) -> World:
    springs = Springs()
    world = World(Physics(d, gravity=at(d, 0.0, -1.0)), springs, settings=Settings(integrator=method))
    world.add_system(Pull())
    masses = [
        world.create_entity(Transform(at(d, 1.0 * k)), RigidBody(mass=1.0 + k), SphereCollider(0.1)) for k in range(3)
    ]
    springs.connect(masses[0], masses[1], stiffness=10.0, damping=0.1)
    springs.connect(masses[1], masses[2], stiffness=20.0)
    return world


def told(answer: object) -> str:
    """Every number of an answer."""
    columns = getattr(answer, "__dict__", {}) or {0: answer}
    return " ".join(str(value.tobytes() if isinstance(value, np.ndarray) else value) for value in columns.values())


def asked(d: int) -> list[str]:
    """Queries of every kind, few bodies and many."""
    found = []
    worlds = [mixed(d, "discrete", 8), crowd(d, "discrete", 4.0, 20), buried(d)]
    for world in [*worlds, *([platformer("discrete")] if d == 2 else [])]:
        world.step()
        for k in range(3):
            point, way = at(d, 0.3 * k, 0.5 * k, 0.1), at(d, 1.0, -0.5 * k, 0.2)
            points = np.array([point, at(d, 1.0, 1.0, 1.0)])
            found += [
                told(answer)
                for answer in (
                    world.query_point(point), world.query_sphere(point, 1.0), world.query_aabb(point, points[1] + 1.0),
                    world.query_nearest(point), world.query_nearests(points), world.neighbours(0.5),
                    world.query_spheres(points, 1.0), world.query_aabbs(points, points + 1.0),
                    world.ray_cast(point, way), world.ray_cast(point, way, only_nearest=True),
                    world.ray_casts(points, np.array([way, way])),
                    world.shape_cast(SphereCollider(0.2), point, way),
                    world.shape_cast(AABBCollider((0.2,) * d), point, way, only_nearest=True),
                    world.shape_casts(SphereCollider(0.2), points, np.array([way, way])),
                    world.shape_casts(SphereCollider(0.2), points, np.array([way, way]), masks=[1, 2], against=True),
                    world.overlaps(AABBCollider((0.5,) * d), point), world.shape_overlaps(SphereCollider(0.8), points),
                )
            ]  # fmt: skip
    return [hashlib.sha256(text.encode()).hexdigest()[:16] for text in found]


def sleepers(d: int, mode: str) -> list[str]:
    """A tower that sleeps on a kinematic floor, beside a zone; a ball comes by, and wakes it."""
    world = World(Physics(d, gravity=at(d, 0.0, -9.81)), settings=Settings(collision=mode, dt=1 / 30, sleeping=True))
    floor = AABBCollider((20.0, 0.5, 20.0)[:d], friction=0.5)
    world.create_entity(Transform(at(d, 0.0, -0.5)), RigidBody(kind="kinematic"), floor)
    for k in range(2):
        box = AABBCollider((0.5, 0.5, 0.5)[:d], friction=0.5)
        world.create_entity(Transform(at(d, 0.0, 0.5 + k), 0.0), RigidBody(), box)
    world.create_entity(Transform(at(d, 0.0, 1.0)), AABBCollider((0.2, 0.2, 0.2)[:d], sensor=True))
    ball = RigidBody(0.5, at(d, 6.0), gravity_scale=0.0)
    world.create_entity(Transform(at(d, -5.2, 1.3)), ball, SphereCollider(0.3))
    found = []
    for _ in range(28):
        world.step()
        found.append(f"{seen(world)}/{np.count_nonzero(world.bodies.asleep)}/{len(world.contacts.stay)}")
    assert found[17].split("/")[1] == "2"
    assert found[27].split("/")[1] == "0"
    return found


def characters(d: int) -> list[str]:
    """Heroes that jump, ride, climb, push, fall through, stand on each other and are crushed."""
    rng = np.random.default_rng(d)
    world = World(Physics(d, gravity=at(d, 0, -30)), capsule.plugin, Rotation(), Characters())
    sides = (*at(d, 9, 0.5), 9)[:d]
    world.create_entity(Transform(at(d, 0, -0.5)), AABBCollider(sides, surface_velocity=at(d, 0.5)))
    world.create_entity(Transform(at(d, -3, 1.5)), AABBCollider(at(d, 0.5, 1.5, 9)))
    world.create_entity(Transform(at(d, 2.5, 0.1)), AABBCollider(at(d, 0.6, 0.1, 9)))
    world.create_entity(Transform(at(d, -1, 1.9)), AABBCollider(at(d, 1, 0, 1), one_way=at(d, 0, 1)))
    world.create_entity(Transform(at(d, 0.3, 2)), AABBCollider(at(d, 0.4, 2, 1), sensor=True), Ladder())
    world.create_entity(Transform(at(d, 4.5, 0.5)), RigidBody(), Spin(), BoxCollider(0.5, friction=0.5))
    turn = -0.4 if d == 2 else (math.cos(0.2), 0.0, 0.0, -math.sin(0.2))
    world.create_entity(Transform(at(d, 6.5, 0.3), turn), BoxCollider(at(d, 1, 0.4, 2)))
    lift = RigidBody(kind="kinematic", linear_velocity=at(d, 0, 2))
    world.create_entity(Transform(at(d, -1.5, -0.3)), lift, AABBCollider(at(d, 0.7, 0.3, 1)))
    press = RigidBody(kind="kinematic", linear_velocity=at(d, 0, -2))
    world.create_entity(Transform(at(d, 6.8, 3)), press, AABBCollider(at(d, 0.7, 0.3, 1)))
    for x in (-2.3, -1.5, 0.3, 1.3, 3.4, 6.8):
        own = Character(wall_slide=2.0, wall_jump=5.0, air_jumps=1, jump_cut=0.5, pushable=x > 0, weight=20.0)
        shape = CapsuleCollider(0.3, 0.3) if x > 1 else AABBCollider(at(d, 0.3, 0.6, 0.3))
        world.create_entity(Transform(at(d, x, 0.9)), RigidBody(kind="kinematic"), shape, own)
    found, me = [], world.bodies.character
    for step in range(45 if d == 2 else 24):
        if step % 6 == 0:
            heroes = len(me.climb)
            me.move[:] = rng.uniform(-5, 5, me.move.shape)
            me.climb[:], me.drop[:] = rng.uniform(-3, 3, heroes), rng.random(heroes) < 0.3
            me.jump[:] = rng.random(heroes) < 0.5
        world.step()
        found.append(seen(world))
    return found


def zones(d: int) -> list[str]:
    """What floats, is blown and attracted; an explosion."""
    world = World(Physics(d, gravity=at(d, 0, -10)), capsule.plugin, Rotation(), Zones())
    for x, component in ((0, Water(400.0, flow=0.5)), (0, Wind(at(d, 2.0))), (3, Field(4.0))):
        world.create_entity(Transform(at(d, x)), AABBCollider(at(d, 5, 3, 5), sensor=True), component)
    turn = 0.5 if d == 2 else (math.cos(0.25), 0.0, 0.6 * math.sin(0.25), 0.8 * math.sin(0.25))
    shapes = SphereCollider(0.5), AABBCollider(0.4), BoxCollider(at(d, 0.6, 0.3, 0.5)), CapsuleCollider(0.3, 0.4)
    for k, shape in enumerate(shapes):
        spin = (Spin(),) if k > 1 else ()
        place = Transform(at(d, 2 * k - 3, 2.8), turn if k > 1 else 0.0)
        world.create_entity(place, RigidBody(mass=90.0), *spin, shape)
    found = play(world, 3)
    return [*found, *map(str, explode(world, at(d, 0, 1), 4.0, 50.0, shielded=True)), *play(world, 2)]


def clockwork(d: int) -> list[str]:
    """Paths and timers, of bodies and of others, gone back to once."""
    world = World(Physics(d), Timers(), Paths(), settings=Settings(dt=0.1))
    for k, mode in enumerate(("back_and_forth", "loop", "once")):
        path = Path([at(d, k), at(d, k, 1), at(d, k + 1, 1)], 2.0, mode=mode, ease=k == 1)
        body = RigidBody(kind="kinematic")
        world.create_entity(Transform(at(d, k, -0.3 * k)), body, SphereCollider(0.2), path, Timer(0.25, repeat=k > 0))
        world.create_entity(Timer(0.35, repeat=k == 2))
    rung: list[int] = []
    world.on("timer", lambda entity, timer: rung.append(entity))
    found, kept = play(world, 8), world.snapshot()
    again = play(world, 6)
    world.restore(kept)
    assert play(world, 6) == again
    return [*found, *again, *map(str, rung)]


def scenarios() -> Iterator[tuple[str, Callable[[], list[str]]]]:
    """By name; calling one plays it."""
    for d, mode in itertools.product((2, 3), MODES):
        yield f"mixed {d}D {mode}", lambda d=d, mode=mode: play(mixed(d, mode))
        yield f"levels {d}D {mode}", lambda d=d, mode=mode: play(levels(d, mode))
        yield f"bullets {d}D {mode}", lambda d=d, mode=mode: play(bullets(d, mode), 8)
    for mode in MODES:
        yield f"platformer {mode}", lambda mode=mode: play(platformer(mode))
    for d, mode, sizes, moving in (
        (2, MODES[0], 0.5, 200), (3, MODES[1], 0.5, 20), (3, MODES[0], 6.0, 194), (2, MODES[2], 0.5, 20),
    ):  # fmt: skip
        name = f"crowd {d}D {mode} {sizes} {moving}"
        yield name, lambda d=d, mode=mode, sizes=sizes, moving=moving: play(crowd(d, mode, sizes, moving), 1)
    for k, method in enumerate(METHODS):
        yield f"swinging {method}", lambda k=k, method=method: play(swinging(2 + k % 2, method))
        yield f"thrown {method}", lambda k=k, method=method: play(mixed(3 - k % 2, "discrete", 4, integrator=method), 5)
    for d, mode in ((2, MODES[0]), (3, MODES[2])):
        yield f"break shot {d}D {mode}", lambda d=d, mode=mode: play(break_shot(d, mode), 5)
    for d in (2, 3):  # fewer steps in space, where each costs Python much more
        yield f"buried {d}D", lambda d=d: play(buried(d), 3)
        yield f"heavy on light {d}D", lambda d=d: play(heavy_on_light(d), 2)
        yield f"asked {d}D", lambda d=d: asked(d)
        yield f"tumbling {d}D", lambda d=d: play(tumbling(d, MODES[d - 2]), 12 - 3 * d)
        yield f"struck {d}D", lambda d=d: play(struck(d, MODES[d - 1]), 3)
        yield f"joined {d}D", lambda d=d: play(joined(d, MODES[0]), 12 - 3 * d)
        yield f"characters {d}D", lambda d=d: characters(d)
        yield f"zones {d}D", lambda d=d: zones(d)
        yield f"clockwork {d}D", lambda d=d: clockwork(d)
        yield f"ground {d}D", lambda d=d: play(ground(d, MODES[d - 2]), 9 - 2 * d)
    for d, mode in zip((2, 3, 2), MODES, strict=True):
        yield f"sleepers {d}D {mode}", lambda d=d, mode=mode: sleepers(d, mode)


if __name__ == "__main__":
    for name, run in scenarios():
        if name in sys.argv[1:]:
            print(name, *run(), sep=",", flush=True)
