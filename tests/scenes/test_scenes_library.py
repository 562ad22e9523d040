"""Game-like scenes: mazes, belts, lifts; crates come to rest and are carried."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_rest import SLOP, G, depths
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from carom.components import AABBCollider, Transform
from carom.framework import Settings
from carom.scenes import conveyor, lift, maze, platforms


@pytest.mark.parametrize(("side", "seed"), [(1, 0), (2, 0), (7, 3), (32, 0)])
def test_the_maze_has_one_way_to_every_cell(side, seed):
    """All cells are reached, with one passage less than there are cells: a tree. The outer wall is closed."""
    right, above = maze.cut(side, np.random.default_rng(seed))
    passages = np.concatenate((np.argwhere(~right) @ (side, 1), np.argwhere(~above) @ (side, 1)))
    ahead = np.repeat((side, 1), ((~right).sum(), (~above).sum()))
    graph = coo_matrix((np.ones(len(passages)), (passages, passages + ahead)), shape=(side**2, side**2))
    assert connected_components(graph, directed=False)[0] == 1
    assert len(passages) == side**2 - 1
    assert right[-1].all()
    assert above[:, -1].all()


@pytest.mark.parametrize(("side", "seed"), [(1, 0), (6, 1), (12, 2)])
def test_the_boxes_are_the_walls_and_nothing_else(side, seed):
    right, above = maze.cut(side, np.random.default_rng(seed))
    centres, halves = maze.wall_boxes(side, np.random.default_rng(seed))

    def covered(x, y):
        return bool((np.abs(centres - (x * maze.CELL, y * maze.CELL)) <= halves).all(axis=1).any())

    for x in range(side):
        for y in range(side):
            assert not covered(x + 0.5, y + 0.5)
            assert covered(x + 1, y + 0.5) == right[x, y]
            assert covered(x + 0.5, y + 1) == above[x, y]
    assert all(covered(0, k + 0.5) and covered(k + 0.5, 0) for k in range(side))
    assert len(centres) < (right.sum() + above.sum() + 2 * side) or side == 1  # runs of wall are one box


@pytest.mark.slow
@pytest.mark.parametrize("dt", [1 / 60, 1 / 37, 1 / 200])
def test_the_belt_never_tears_and_the_chute_keeps_its_time(dt):
    """Slats keep their spacing and cover the belt; crate k drops in the step that contains k EVERY."""
    with conveyor.build(Settings(dt=dt), n=4) as world:
        for step in range(round(4.0 / dt)):
            dropped = min(4, int(world.time / conveyor.EVERY + 1e-9) + 1)
            on_their_way = 0 if step == 0 else len(world.bodies.dynamic)
            assert dropped - on_their_way in (0, 1)
            world.step()
            x = np.sort(world.bodies.kinematic.position[:, 0])
            np.testing.assert_allclose(np.diff(x), conveyor.SLAT, rtol=0, atol=1e-11)
            assert x[0] - conveyor.SLAT / 2 <= conveyor.SPEED * dt + 1e-9
            assert x[-1] + conveyor.SLAT / 2 >= conveyor.LENGTH - conveyor.SLAT
        assert len(world.bodies.dynamic) == 4


def steps(world, seconds):
    for _ in range(round(seconds / world.settings.dt)):
        world.step()


def kinetic_energy_per_body(world):
    """Kinetic energy per body in units of m g d: the height, in diameters, that it could lift a body."""
    dynamic = world.bodies.dynamic
    return 0.5 * (np.asarray(dynamic.linear_velocity) ** 2).sum(axis=1).mean() / G


def test_crates_come_to_rest_on_the_platforms():
    with platforms.build() as world:
        steps(world, 10.0)
        position = world.bodies.dynamic.position
        assert kinetic_energy_per_body(world) < 1e-4
        assert depths(world).mean() < 0.02
        assert ((position[:, 0] > 0) & (position[:, 0] < platforms.WIDTH) & (position[:, 1] > 0)).all()
        x, y = position.T
        for start, end, height in platforms.PLATFORMS:  # no centre inside one, and a crate on each
            assert not ((x > start) & (x < end) & (y > height - platforms.THICKNESS) & (y < height)).any()
            assert ((x > start) & (x < end) & (y > height) & (y < height + 2)).any()


@pytest.mark.slow
def test_the_lift_and_the_ferry_keep_their_schedule_and_take_their_crates_along():
    """The schedule to rounding: no drift from summed velocities. Each crate keeps its place on its carrier to a
    twentieth of its size, under 0.75 to 1.25 of its weight."""
    with lift.build() as world:
        steps(world, 0.5)
        offsets = []
        for _ in range(round(1.5 * lift.LIFT_PERIOD * 60)):
            world.step()
            for _, (shuttle, transform) in world.get_components(lift.Shuttle, Transform):
                np.testing.assert_allclose(transform.position, shuttle.place(world.time), rtol=0, atol=1e-12)
            lifted, ferried = world.bodies.kinematic.position
            crates = world.bodies.dynamic.position
            offsets.append(np.concatenate([crates[:3] - lifted, crates[3:] - ferried]))
        offsets = np.array(offsets)
        assert np.ptp(offsets, axis=0).max() < 0.05
        np.testing.assert_array_equal(offsets[:, :3, 0], 0.0)
        np.testing.assert_allclose(
            offsets[0, :, 1], lift.THICKNESS / 2 + 0.5 + np.array([0, 1, 2, 0]), rtol=0, atol=4 * 1.25 * SLOP
        )


def test_the_conveyor_brings_every_crate_to_the_bin():
    """A crate reaches the belt's speed within v / (mu g) = 0.34 s of its landing and keeps it to the end."""
    with conveyor.build() as world:
        riding = []
        for _ in range(25 * 60):
            world.step()
            dynamic = world.bodies.dynamic
            x, y = dynamic.position.T
            rides = (x > conveyor.DROP[1][0] + 3.0) & (x < conveyor.LENGTH - 3.0) & (y > 0)
            riding += dynamic.linear_velocity[rides, 0].tolist()
        assert len(riding) > 1000
        np.testing.assert_allclose(riding, conveyor.SPEED, rtol=0, atol=0.05)
        position = world.bodies.dynamic.position
        half = np.array(
            [world.component_for_entity(int(crate), AABBCollider).half_extents for crate in world.bodies.dynamic.entity]
        )
        assert len(position) == conveyor.CRATES
        assert (position[:, 0] - half[:, 0] > conveyor.BIN[0] - 0.02).all()
        assert (position[:, 0] + half[:, 0] < conveyor.BIN[1] + 0.02).all()
        assert (position[:, 1] < 0).all()
        assert np.abs(world.bodies.dynamic.linear_velocity[:, 1]).max() < 1e-3  # on the slick floor some still slide
