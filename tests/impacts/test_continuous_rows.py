"""Swept bodies against rows: pushed, struck, seams of floors, tile maps; damping and forces around a bounce."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers_modes import MODES, SWEPT, bullet, mode_world, positions, velocities
from helpers_pairwise import pairwise
from worlds import box, run

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import ForceSystem, Settings, World
from carom.plugins import Physics, tile_grid
from carom.plugins.tile_grid import TileGridCollider

G = 10.0


@pytest.mark.parametrize(("mode", "gap", "speed"), pairwise(SWEPT, (0.0, 0.01, 0.5), (10.0, 30.0, 300.0)))
def test_a_kinematic_ram_loses_no_body(mode, gap, speed):
    """None ends up behind it, in order, each as fast as the ram, or up to a quarter faster (docs/limits.md)."""
    world = mode_world(mode, max_impacts_per_step=64)
    row = [bullet(world, k * (0.2 + gap), 0.0, radius=0.1) for k in range(5)]
    ram = bullet(world, -0.5, speed, half=(0.02, 1.0), kind="kinematic")
    run(world, 10 + int(3 * 60 * gap))
    x = positions(world, [ram, *row])[:, 0]
    assert (np.diff(x) > 0.1).all()
    fast = velocities(world, row)[:, 0] / speed
    assert (fast > 0.999).all()
    assert (fast < 1.25).all()


def tile_world(cells, faces="all", gravity=0.0, **settings):
    world = World(Physics(2, (0.0, -gravity)), tile_grid.plugin, settings=Settings(**settings))
    cells = np.array(cells, bool)
    world.create_entity(Transform((0, 0)), TileGridCollider(cells, 1.0, lower=(0, 0), faces=faces, restitution=1.0))
    return world


@pytest.mark.slow  # maps of tiles take long to compile
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("gravity", [0.0, G])
def test_a_map_is_struck_in_two_places_in_one_step(mode, gravity):
    """Floor, then wall of one map: mirrored at 1.1 and at 8.9, where a ball of 0.1 touches."""
    cells = np.zeros((10, 10), bool)
    cells[-1] = cells[:, -1] = True
    world = tile_world(cells, gravity=gravity, collision=mode)
    ball = bullet(world, (5.0, 3.0), (390.0, -310.0), restitution=1.0)
    world.step()
    assert len(world.contacts.impacts) == 2
    x, y = positions(world, [ball])[0]
    assert x == pytest.approx(2 * 8.9 - (5.0 + 390 / 60), abs=1e-9)
    assert y == pytest.approx(2 * 1.1 - (3.0 - 310 / 60), abs=0.01 if gravity else 1e-9)


@pytest.mark.slow  # maps of tiles take long to compile
@pytest.mark.parametrize("faces", ["all", "walls"])
@pytest.mark.parametrize(
    "settings",
    [{"collision": "continuous"}, {"collision": "continuous", "integrator": "velocity_verlet"},
     {"collision": "event_driven"}],
)  # fmt: skip
def test_no_shot_passes_the_wall_of_a_map(faces, settings):
    """Through free air at 500 m/s at the walls of a room of tiles, on straight and on curved paths."""
    cells = np.ones((10, 20), bool)
    cells[1:-1, 1:-1] = False
    world = tile_world(cells, faces, G, **settings)
    shots = [
        bullet(world, (14.2, 2.5 + 0.5 * k), (500.0, (-1) ** k * 10.0 * k), half=0.05, mask=1, layer=2)
        for k in range(10)
    ]
    world.step()
    assert (positions(world, shots)[:, 0] < 19.0).all()
    assert len(world.contacts.impacts) >= len(shots)


@pytest.mark.slow  # maps of tiles take long to compile
def test_what_falls_beside_a_wall_of_tiles_falls_on():
    """A centimetre of air between: it is not stopped at any speed."""
    cells = np.zeros((100, 2), bool)
    cells[:, 1] = True
    world = tile_world(cells, gravity=G, collision="continuous", integrator="velocity_verlet")
    ball = bullet(world, (0.89, 95.0), (0.0, -60.0))
    run(world, 30)
    assert positions(world, [ball])[0] == pytest.approx((0.89, 95.0 - 30.0 - 0.5 * G * 0.25), abs=1e-9)
    assert not len(world.contacts.impacts)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mode", "integrator", "tolerance"),
    [("discrete", "semi_implicit_euler", 1e-12), ("continuous", "semi_implicit_euler", 1e-12),
     ("continuous", "velocity_verlet", 3e-3), ("event_driven", "velocity_verlet", 1e-12)],
)  # fmt: skip
def test_an_elastic_bounce_of_a_damped_body(mode, integrator, tolerance):
    """The speed is v0 e^(-c t), as if there were no wall; on Verlet's path to second order, (c dt)^2 / 2 = 3.5e-3."""
    for phase in range(8):
        world = mode_world(mode, integrator=integrator)
        box(world, (3.0, 0.0), half=(0.5, 5.0), kind="static", restitution=1.0)
        body = RigidBody(linear_velocity=(20.0, 0.0), linear_damping=5.0)
        ball = world.create_entity(Transform((0.02 * phase, 0.0)), body, SphereCollider(0.1, restitution=1.0))
        run(world, 30)
        assert velocities(world, [ball])[0, 0] == pytest.approx(-20.0 * math.exp(-5.0 * 0.5), rel=tolerance)
        world.close()


class Spring(ForceSystem):
    def add_forces(self, bodies, time):
        bodies.force[:, 0] -= 4.0 * bodies.position[:, 0]

    def potential_energy(self, bodies):
        return 2.0 * (bodies.position[:, 0] ** 2).sum()


@pytest.mark.slow
def test_a_spring_with_a_wall_is_of_second_order_in_event_driven_worlds():
    """An elastic wall at its centre, x = |cos 2t|: half the step gives a quarter of the error, with some scatter."""
    errors = []
    for rate in (60, 120, 240):
        square = 0.0
        for phase in range(6):
            world = mode_world("event_driven", dt=1 / rate)
            world.create_entity(Transform((-1.0, 0.0)), AABBCollider((0.9, 5.0), restitution=1.0))
            angle = 0.2 * phase
            body = RigidBody(linear_velocity=(-2.0 * math.sin(angle), 0.0))
            ball = world.create_entity(Transform((math.cos(angle), 0.0)), body, SphereCollider(0.1, restitution=1.0))
            world.add_system(Spring())
            run(world, 3 * rate)
            square += (positions(world, [ball])[0, 0] - abs(math.cos(angle + 6.0))) ** 2
            world.close()
        errors.append(math.sqrt(square / 6))
    assert 3.0 < errors[0] / errors[1] < 6.0
    assert 3.0 < errors[1] / errors[2] < 6.0
