"""Crates that turn on maps of tiles: they lie on what is straight of the surface with both corners, as on any box."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_modes import MODES
from helpers_pairwise import pairwise

from carom.components import RigidBody, Transform
from carom.framework import Settings, World
from carom.plugins import Physics, tile_grid
from carom.plugins.rotation import BoxCollider, Rotation, Spin
from carom.plugins.tile_grid import TileGridCollider, TileShape

WIDTH, HALF = 20, 0.4


def hill(rise, first, second=None):
    """(cells, shapes): a floor of a row of tiles, and a hill from column 4 to 12 that begins with these shapes."""
    cells, shapes = np.zeros((8, WIDTH), int), np.zeros((8, WIDTH), int)
    cells[7, :] = 1
    cells[7 - rise : 7, 4:12] = 1
    shapes[7 - rise, 4] = first
    if second is not None:
        shapes[7 - rise, 5] = second
    return cells, shapes


MAPS = {
    "plain": hill(1, TileShape.FULL),
    "slope": hill(1, TileShape.SLOPE_UP),
    "gentle slope": hill(1, TileShape.GENTLE_UP_LOW, TileShape.GENTLE_UP_HIGH),
    "half tiles": (hill(1, TileShape.FULL)[0], np.repeat([0] * 6 + [TileShape.LOWER_HALF, 0], WIDTH).reshape(8, WIDTH)),
}


def make_world(name, mode):
    world = World(
        Physics(dimensions=2, gravity=(0, -10)), Rotation(), tile_grid.plugin,
        settings=Settings(sleeping=True, collision=mode),
    )  # fmt: skip
    if name == "one-way":
        cells, shapes = hill(2, TileShape.FULL)
        cells[6, 4:12] = 0
        shapes[5, 4:12] = TileShape.ONE_WAY
        for part in TileGridCollider.with_one_way(cells, 1.0, lower=(0, -1), shapes=shapes, walls=False, friction=0.8):
            world.create_entity(Transform((0, 0)), part)
    else:
        cells, shapes = MAPS[name]
        shaped = {} if name == "plain" else {"shapes": shapes}
        world.create_entity(Transform((0, 0)), TileGridCollider(cells, 1.0, lower=(0, -1), friction=0.8, **shaped))
    return world


def crate(world, place):
    return world.create_entity(Transform(place), RigidBody(), Spin(), BoxCollider((HALF, HALF), friction=0.8))


@pytest.mark.parametrize(("name", "mode"), pairwise((*MAPS, "one-way"), MODES))
def test_crates_that_fall_on_tiles_come_to_rest(name, mode):
    """As they do on a box: within 12 s all are asleep, and none is deeper than stacks of as many sag."""
    world, rng = make_world(name, mode), np.random.default_rng(7)
    for k in range(9):
        crate(world, (rng.uniform(3.0, 12.0), 3.0 + 1.2 * k))
    for _ in range(720):
        world.step()
    assert world.bodies.dynamic.asleep.all()
    assert world.contacts.depth.max() < 0.004


@pytest.mark.parametrize("name", [*MAPS, "one-way"])
def test_a_crate_over_a_ledge_tips_if_its_centre_is_beyond(name):
    """What is straight of the surface ends where the tiles do: the torque of gravity about the edge decides."""
    world = make_world(name, "discrete")
    top = {"half tiles": 0.5, "one-way": 2.0}.get(name, 1.0)
    stays = crate(world, (12.0 - 0.05, top + HALF))
    for _ in range(120):
        world.step()
    assert world.component_for_entity(stays, Transform).y == pytest.approx(top + HALF, abs=0.002)
    world.delete_entity(stays)
    tips = crate(world, (12.0 + 0.05, top + HALF))
    for _ in range(120):
        world.step()
    assert world.component_for_entity(tips, Transform).y < top
    world.close()


def test_a_crate_lies_flat_against_a_wall():
    """Pushed by a force at its middle, without gravity, it keeps its angle and ends beside the wall."""
    world = make_world("plain", "discrete")
    world.gravity = (0, 0)
    body = crate(world, (2.0, 0.45))
    world.component_for_entity(body, RigidBody).constant_force = (5.0, 0.0)
    for _ in range(120):
        world.step()
    place = world.component_for_entity(body, Transform)
    assert place.x == pytest.approx(4.0 - HALF, abs=0.002)
    assert abs(place.rotation) < 1e-6
