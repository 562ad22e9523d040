"""Queries look into the grid of the last step where that goes on, and into another index where it does not."""

from __future__ import annotations

import numpy as np
import pytest
from queries.helpers_queries import GRAZE, Bodies, directions, scene
from worlds import both_dimensions

ASKED = 6  # places, each time


def compare(world, bodies, rng):
    """Answers around random bodies with those of brute force."""
    d = world.dimensions
    bodies.centre[np.searchsorted(bodies.entity, world.bodies.entity)] = world.bodies.position
    centres = bodies.centre[rng.integers(0, len(bodies.entity), ASKED)] + rng.standard_normal((ASKED, d))
    ways, radii = directions(rng, ASKED, d), 2 * rng.random(ASKED)
    spheres, nearest = world.query_spheres(centres, radii), world.query_nearests(centres)
    boxes = world.query_aabbs(centres - radii[:, None], centres + radii[:, None])
    rays = world.ray_casts(centres, ways, 3.0)
    for i in range(ASKED):
        for found, half, sphere in ((spheres[i], radii[i : i + 1], True), (boxes[i], np.full(d, radii[i]), False)):
            gap = bodies.gap(centres[i], half, sphere)
            clear = np.abs(gap) > GRAZE
            assert np.isin(bodies.entity, found)[clear].tolist() == (gap <= 0)[clear].tolist()
            assert (np.diff(found) > 0).all()  # each once, in the order of ids
        assert nearest.distance[i] == pytest.approx(-bodies.depth_of_point(centres[i]).max(), abs=1e-9)
        met, least = bodies.cast(centres[i], ways[i], 3.0, np.zeros(d), True)
        if not (np.abs(least) <= GRAZE).any():
            assert min(rays.distance[i], 4.0) == pytest.approx(min(met.min(), 4.0), abs=1e-6)


@pytest.mark.slow
@both_dimensions
def test_answers_follow_steps_and_writes(d):
    """Bodies that stay near their cells in the grid of the step, cross a few, or are moved far away: a few or many."""
    world, bodies, side = scene(d, 900, seed=4)
    rng, served, outside = np.random.default_rng(4), 0, 0
    for turn in range(12):
        if turn % 3:
            world.step()
        elif turn:
            some = rng.integers(0, len(world.bodies.dynamic), 3 if turn % 2 else 120)
            way = rng.standard_normal((len(some), d)) * rng.choice([0.01, 0.2, 2.0, side], (len(some), 1))
            world.bodies.position[some] += way
            world.refresh_queries()
        compare(world, bodies, rng)
        grid = world.physics.state.grid
        served, outside = served + bool(grid.serves), outside + grid.outside_count
    assert 0 < served < 12
    assert outside > 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("d", "count", "kinds", "grids"),
    [
        (3, 60, ("dynamic",), (False, False)), (2, 900, ("dynamic",) * 3, (False, True)),
        (3, 900, ("dynamic", "dynamic", "kinematic"), (True, True)),
        (2, 900, ("dynamic", *["kinematic"] * 3), (True, False)),
    ],
)  # fmt: skip
def test_answers_while_bodies_sleep(d, count, kinds, grids):
    """Sleepers are found where they are, whichever index has them: after steps, writes, deletions, wakes, restores."""
    world, every, _ = scene(d, count, seed=5, kinds=(*kinds, "static"), sleeping=True)
    bodies, rng, state = every, np.random.default_rng(5), world.physics.state
    for _ in range(120):
        world.step()
    start = world.snapshot()
    for turn in range(9):
        sleepers = world.bodies.entity[: state.sleepers]
        if turn % 7 == 1:
            gone = rng.choice(sleepers, 2, replace=False)
            for entity in gone.tolist():
                world.delete_entity(entity, immediate=True)
            bodies = Bodies(*(column[~np.isin(every.entity, gone)] for column in vars(every).values()))
        elif turn % 7 == 3:
            world.wake(rng.choice(sleepers))
        elif turn % 7 == 5:
            world.bodies.position[rng.integers(0, state.sleepers, 40)] += rng.standard_normal((40, d))
            world.refresh_queries()
        elif turn == 7:
            world.restore(start)
            bodies = every
        elif turn:
            world.step()
            world.step()
        compare(world, bodies, rng)
        if turn == 0:
            assert (bool(state.grid.serves), bool(state.static_grid.serves)) == grids
            assert state.first > 0.8 * len(world.bodies.dynamic)
