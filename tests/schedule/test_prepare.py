"""What ``world.prepare`` guarantees, and what is there before the first step without it."""

from __future__ import annotations

from pathlib import Path

import pytest
from helpers_processes import output_of
from worlds import ball, make_world

from carom.components import Collider, RigidBody, SphereCollider, Transform
from carom.framework import ForceSystem, Plugin, System, UnhandledPairError, World, column
from carom.framework.compilation import log
from carom.plugins import Physics, capsule, convex_polygon, half_space, tile_grid
from carom.plugins.springs import Springs

# A whole game in a separate process: kernels already loaded would hide what prepare has missed.
GAME = '''
import logging
import sys
import numpy as np
from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Component, ForceSystem, Phase, Settings, System, World, column
from carom.framework.compilation import kernel, log
from carom.plugins import Physics

logging.basicConfig()
logging.getLogger("carom").setLevel(logging.DEBUG)  # who failed says what it loaded last
d, prepared = int(sys.argv[1]), sys.argv[2] == "prepared"


class Idle(System):
    def process(self, dt):
        pass


class Charge(Component):
    value = column(default=0.0)


@kernel
def push(force, charge):
    for i in range(len(force)):
        force[i, 0] += charge[i]


class Field(ForceSystem):
    requires = (RigidBody, Charge)

    def add_forces(self, bodies, time):
        push(bodies.force, bodies.charge.value)


def at(x, y=0.0):
    return (x, y, 0.0)[:d]


def play(integrator):
    world = World(Physics(dimensions=d, gravity=at(0.0, -9.81)), settings=Settings(integrator=integrator))
    world.create_entity(Transform(at(-500)), RigidBody(), Charge(1.0))
    if prepared:
        world.add_system(Field())
        world.prepare(SphereCollider, AABBCollider)
    else:
        world.create_entity(Transform(at(0, -1)), AABBCollider((1.0,) * d))
        world.create_entity(Transform(at(500, 3)), RigidBody(), SphereCollider(0.5, restitution=0.5))
        world.step()
        assert not log.compiled, log.compiled
    ready = len(log.compiled), log.loaded

    def check(after):
        assert (len(log.compiled), log.loaded) == ready, (integrator, after, log.compiled[ready[0]:], log.loaded)

    world.step()
    check("no colliders")
    if not prepared:
        world.add_system(Idle())
    floor = world.create_entity(Transform(at(0, -0.5)), AABBCollider(tuple(0.5 if k == 1 else 1e3 for k in range(d))))
    world.step()
    check("boxes only")
    half, turn = (0.5,) * d, 0.3 if d == 2 else (0.9, 0.1, 0.1, 0.1)
    balls = [
        world.create_entity(Transform(at(2 * k, 0.4)), RigidBody(), SphereCollider(0.5, restitution=0.8 * (k % 2)))
        for k in range(5)
    ]
    for k in range(4):
        world.create_entity(Transform(at(20, 0.5 + k)), RigidBody(), AABBCollider(half, friction=0.3))
    world.create_entity(Transform(at(20, 8), turn), RigidBody(), AABBCollider(half))
    lift = RigidBody(kind="kinematic", linear_velocity=at(0, -1.0))
    world.create_entity(Transform(at(30, 3)), lift, AABBCollider(half))
    world.create_entity(Transform(at(30, 1)), RigidBody(), SphereCollider(0.5, sensor=True))
    limited = RigidBody(max_linear_speed=2.0, linear_damping=0.1, linear_velocity=at(3))
    world.create_entity(Transform(at(40, 3)), limited, SphereCollider(1.0), AABBCollider(half))  # two levels
    bullet = RigidBody(linear_velocity=at(300), ccd=True)
    world.create_entity(Transform(at(50, 3)), bullet, SphereCollider(0.1, restitution=0.5))
    world.create_entity(Transform(at(60, 3)), AABBCollider(half))
    told = []
    for event in ("contact_begin", "contact_stay", "contact_end", "impact"):
        world.on(event, told.append)
    for _ in range(20):
        world.step()
        check("a few bodies")
    world.restore(world.snapshot())
    n = 300
    places, velocities = np.zeros((n, d)), np.zeros((n, d))
    places[:, 0], places[:, 1] = 3.0 * np.arange(n), 30.0 + np.arange(n) % 3
    velocities[:, 1] = -np.geomspace(0.01, 1000.0, n)
    radii, halves = np.geomspace(0.05, 5, n), np.full((n, d), 0.4)
    world.create_entities(
        n, Transform.many(places), RigidBody.many(linear_velocity=velocities), SphereCollider.many(radius=radii)
    )
    world.create_entities(n, Transform.many(places - 20.0), AABBCollider.many(half_extents=halves))
    for _ in range(20):
        world.step()
        check("hundreds of bodies")
    origin, ahead = np.array(at(0, 2)), np.array(at(1))
    points = np.array([origin, ahead])
    world.query_point(origin), world.query_sphere(origin, 3), world.query_aabb(origin, origin + 3)
    check("a query")
    world.query_spheres(points, 3), world.query_aabbs(points, points + 3)
    check("many queries")
    world.neighbours(2.0), world.neighbours(2.0, of=balls)
    check("neighbours")
    world.query_nearest(origin), world.query_nearest(origin, max_distance=3, exclude=floor)
    world.query_nearests(points)
    check("nearest")
    world.ray_cast(origin, ahead), world.ray_cast(origin, ahead, 10, only_nearest=True)
    world.ray_casts(points, ahead), world.ray_casts(points, points - 9, np.array([3.0, 4.0]), excludes=[floor, -1])
    check("rays")
    for shape in (SphereCollider(1.0), AABBCollider(half)):
        world.shape_cast(shape, origin, ahead), world.shape_cast(shape, origin, ahead, only_nearest=True)
        world.shape_casts(shape, points, ahead, excludes=floor, against=True)
        world.overlaps(shape, origin), world.shape_overlaps(shape, points, excludes=[[floor, balls[0]]])
    world.shape_casts(AABBCollider.many(half_extents=halves[:2]), points, points)
    check("moving shapes")
    world.settings = world.settings.replace(geometry="bounds", substeps=2, debug=True)
    world.advance(0.1)
    check("other settings")
    for entity in world.bodies.entity[world.bodies.has(SphereCollider)].tolist():
        world.delete_entity(entity)
    for phase in Phase:
        world.run(phase)
    world.advance(0.1)
    check("no more balls")
    assert told
    world.close()


for integrator in ("semi_implicit_euler", "yoshida4", "rk4", "velocity_verlet", "explicit_euler"):
    play(integrator)
'''


@pytest.mark.parametrize("d", [2, 3])
def test_after_prepare_or_the_first_step_nothing_compiles_and_nothing_loads(d):
    """Every integrator, few bodies and hundreds, impacts, rest, levels, sensors, platforms, queries, a force system."""
    for how in ("prepared", "kept"):  # the second process has not prepared, but finds what the first one kept
        output_of(GAME, d, how)


README_LOOP = """
import re
import sys
from carom.framework import World
from carom.framework.compilation import log

code = next(block for block in re.findall("```python\\n(.*?)```", open(sys.argv[1]).read(), re.S) if "advance" in block)
counts, advance = [], World.advance


def counted(world, seconds):
    advance(world, seconds)
    if world.step_count:
        counts.append((len(log.compiled), log.loaded))


World.advance = counted
exec(code)
assert len(counts) > 500 and len(set(counts)) == 1, sorted(set(counts))
"""


@pytest.mark.slow
def test_the_game_of_the_readme_waits_for_nothing_after_its_first_frame():
    readme = Path(__file__).parents[2] / "README.md"
    output_of(README_LOOP, readme)


def test_worlds_with_every_plugin_can_be_prepared_and_no_system_is_made_or_run():
    """Springs are an object of one world, and so are systems of the game: prepare makes no second ones."""
    made, updates = [], []

    class Counting(System):
        def __init__(self):
            made.append(self)

        def process(self, dt):
            updates.append(dt)

    game = Plugin("game")
    game.system(Counting)
    springs = Springs()
    shapes = [module.plugin for module in (capsule, convex_polygon, half_space, tile_grid)]
    world = World(Physics(dimensions=2), game, springs, *shapes)
    world.add_system(Counting())
    springs.connect(ball(world, (0, 0)), ball(world, (3, 0)), stiffness=10.0)
    world.create_entity(Transform((0.0, -5.0)), half_space.HalfSpaceCollider(normal=(0.0, 1.0)))
    world.prepare()
    assert (len(made), updates) == (2, [])
    ready = list(log.compiled), log.loaded
    world.step()
    assert (log.compiled, log.loaded) == ready
    assert len(updates) == 2


def test_force_systems_are_called_for_the_present_bodies():
    seen = []

    class Watch(ForceSystem):
        requires = (RigidBody, SphereCollider)

        def add_forces(self, bodies, time):
            seen.append(len(bodies))
            bodies.force[:] += 1e6

    world = make_world()
    world.add_system(Watch())
    world.prepare()
    assert seen == []  # no bodies, no calls
    ball(world, 0)
    world.create_entity(Transform((9, 9)), RigidBody())
    world.prepare()
    assert set(seen) == {1}
    assert not world.bodies.force.any()
    assert world.stats().counters["force_evaluations"] == 0


def test_what_cannot_be_prepared():
    world = make_world()
    for wrong in (SphereCollider(1.0), int, "SphereCollider"):
        with pytest.raises(TypeError, match="prepare takes component types"):
            world.prepare(wrong)

    class StrangeCollider(Collider):
        radius = column(positive=True)

    with pytest.raises(UnhandledPairError, match="StrangeCollider"):
        world.prepare(StrangeCollider)
    world.step()  # and nothing of it is left
