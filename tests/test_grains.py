"""Gravity that is large against the sizes, and heavy bodies on light ones: at rest nobody passes through anybody."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers_pairwise import pairwise
from helpers_rest import SLOP, heights, speed, tower
from worlds import ball, box, floor, make_world, run

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Settings, World
from carom.plugins import Physics, capsule, convex_polygon, half_space, one_way_segment, tile_grid

MODES = ("discrete", "continuous", "event_driven")
METHODS = ("explicit_euler", "semi_implicit_euler", "velocity_verlet", "rk4", "yoshida4")
DT = 1 / 60
GRAVITIES = (1e-6, 1e-3, 0.05, 0.3, 1.0, 3.0, 10.0, 100.0, 1e4, 1e6)  # g dt^2 of a size
ALLOWED = SLOP + 1e-3  # the slop, and the softness of a stack of five
WIDE = 20.0

# Bodies of one metre. The floors' tops are at 0.
BODIES = {
    "ball": lambda d: SphereCollider(0.5),
    "box": lambda d: AABBCollider((0.5,) * d),
    "capsule": lambda d: capsule.CapsuleCollider(0.25, 0.25),
    "polygon": lambda d: convex_polygon.ConvexPolygonCollider([(-0.5, -0.5), (0.5, -0.5), (0.3, 0.5), (-0.3, 0.5)]),
}
FLOORS = {
    "box": (-1.0, lambda d: AABBCollider((WIDE, 1.0, WIDE)[:d])),
    "half_space": (0.0, lambda d: half_space.HalfSpaceCollider((0.0, 1.0, 0.0)[:d])),
    "tile_grid": (-1.0, lambda d: tile_grid.TileGridCollider(["#" * 20] * 2, 1.0)),
    "one_way": (0.0, lambda d: one_way_segment.OneWaySegmentCollider((-WIDE, 0.0), (WIDE, 0.0))),
}
PLUGINS = (capsule.plugin, half_space.plugin)
PLUGINS_2D = (convex_polygon.plugin, tile_grid.plugin, one_way_segment.plugin)
SHIPPED = [
    (2, "capsule", "box"), (2, "polygon", "box"), (2, "box", "half_space"), (2, "box", "tile_grid"),
    (2, "ball", "one_way"), (3, "capsule", "half_space"),
]  # fmt: skip


def column(d, gravity, mode, method, shape, ground, *, count=5, plugins=()):
    """``count`` bodies at rest on each other on a floor; their entities from below."""
    settings = Settings(dt=DT, collision=mode, integrator=method)
    world = World(Physics(d, gravity=(0.0, -gravity / DT**2, 0.0)[:d]), *plugins, settings=settings)
    top, make = FLOORS[ground]
    world.create_entity(Transform((0.0, top, 0.0)[:d]), make(d))
    return world, [
        world.create_entity(Transform((0.0, 0.5 + k, 0.0)[:d]), RigidBody(), BODIES[shape](d)) for k in range(count)
    ]


def check_column(world, entities, steps=120):
    """At every step in order, none further than the slop from its place."""
    places = 0.5 + np.arange(len(entities))
    for _ in range(steps):
        world.step()
        y = heights(world, entities)
        assert (np.diff(y) > 0).all(), (world.step_count, y)
        assert np.abs(y - places).max() < ALLOWED, (world.step_count, y)


@pytest.mark.parametrize(
    ("d", "shape", "mode", "method", "gravity"), pairwise((2, 3), ("box", "ball"), MODES, METHODS, GRAVITIES)
)
def test_a_stack_of_five_keeps_its_order_and_its_place(d, shape, mode, method, gravity):
    world, entities = column(d, gravity, mode, method, shape, "box")
    check_column(world, entities)


@pytest.mark.slow  # its shapes take long to compile
@pytest.mark.parametrize(("case", "mode", "method", "gravity"), pairwise(SHIPPED, MODES, METHODS, GRAVITIES))
def test_a_stack_of_any_shipped_shape_keeps_its_order_and_its_place(case, mode, method, gravity):
    d, shape, ground = case
    plugins = (*PLUGINS, *PLUGINS_2D) if d == 2 else PLUGINS
    check_column(*column(d, gravity, mode, method, shape, ground, plugins=plugins))


@pytest.mark.parametrize("size", [2e-3, 5e-4])
@pytest.mark.parametrize("mode", MODES)
def test_two_grains_on_each_other(size, mode):
    """Boxes of 2 mm at 60 Hz on Earth changed places, those of 0.5 mm fell through a floor two sizes thick."""
    world = make_world(2, 9.81, collision=mode)
    box(world, (0.0, -size), half=(20 * size, size), kind="static")
    grains = [box(world, (0.0, size * (0.5 + k)), half=0.5 * size) for k in range(2)]
    run(world, 300)
    assert np.abs(heights(world, grains) / size - (0.5, 1.5)).max() < ALLOWED
    assert not world.faults


@pytest.mark.parametrize("maker", [ball, box])
@pytest.mark.parametrize(
    ("dt", "mode", "method", "d"), pairwise((1.0, 10.0), ("continuous", "event_driven"), METHODS, (2, 3))
)
def test_a_falling_body_stops_at_the_floor(dt, mode, method, d, maker):
    """One metre wide, from any height: a floor as thick as it is not passed by what falls 10 to 1,000 sizes a step."""
    for height in (0.3, 3.3, 100.7):
        world = make_world(d, 9.81, dt=dt, collision=mode, integrator=method)
        floor(world)
        body = maker(world, (0.0, 0.5 + height, 0.0)[:d])
        for _ in range(40):
            world.step()
            assert heights(world, [body])[0] > 0.5 - ALLOWED, (height, world.step_count)
        assert heights(world, [body])[0] == pytest.approx(0.5, abs=ALLOWED), height
        assert not world.faults


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(
    "masses",
    [(1, 1, 1e4), (1, 1, 1, 1e3), (1, 1, 1, 1e4), (1, 1e4, 1, 1e4), (1e4, 1, 1, 1e4), (1e4, 1, 1e4, 1), (1, 1, 1, 1)],
)
def test_heavy_on_light_comes_to_rest(mode, masses):
    """Below 1e-3 m/s after ten seconds, with the default settings, and in order."""
    world = make_world(2, 9.81, collision=mode)
    floor(world)
    bodies = tower(world, len(masses), masses=masses)
    run(world, 540)
    fastest = 0.0
    for _ in range(60):
        world.step()
        fastest = max(fastest, speed(world))
    assert fastest < 1e-3
    assert np.abs(heights(world, bodies) - (0.5 + np.arange(len(masses)))).max() < 0.05


@pytest.mark.parametrize("mode", ["discrete", pytest.param("continuous", marks=pytest.mark.slow)])
def test_a_tower_of_a_hundred_stands(mode):
    world = make_world(2, 9.81, collision=mode)
    floor(world)
    bodies = tower(world, 100)
    run(world, 600)
    y = heights(world, bodies)
    assert (np.diff(y) > 0.95).all()
    assert math.isclose(y[-1], 99.5, abs_tol=1.0)
    assert speed(world) < 1e-2
