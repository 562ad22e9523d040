"""Queries look into the grid of the last step where that goes on, and into another index where it does not."""

from __future__ import annotations

import numpy as np
import pytest
from queries.helpers_queries import GRAZE, Bodies, directions, scene
from worlds import ball, both_dimensions, make_world

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform

ASKED = 6  # places, each time


def some_of(bodies, which):
    return Bodies(*(column[which] for column in vars(bodies).values()))


def collider_of(world, entity):
    return world.try_component(entity, SphereCollider) or world.try_component(entity, AABBCollider)


def compare(world, bodies, rng):
    """Answers around random bodies with those of brute force; of bodies whose colliders are off there are none."""
    d = world.dimensions
    bodies.centre[np.searchsorted(bodies.entity, world.bodies.entity)] = world.bodies.position
    centres = bodies.centre[rng.integers(0, len(bodies.entity), ASKED)] + rng.standard_normal((ASKED, d))
    bodies = some_of(bodies, [collider_of(world, entity).enabled for entity in bodies.entity.tolist()])
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


def without_two(world, bodies, among, rng):
    """The bodies, after two entities among these are deleted."""
    gone = rng.choice(among, 2, replace=False)
    for entity in gone.tolist():
        world.delete_entity(entity, immediate=True)
    return some_of(bodies, ~np.isin(bodies.entity, gone))


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
            bodies = without_two(world, every, sleepers, rng)
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


@both_dimensions
def test_what_is_off_is_met_by_no_ray(d):
    """A ray along a row of balls meets those that are on, in order, whether they were switched before the step or after
    it: a kinematic one, which is outside of the grid of many dynamic ones, and some that are in it."""
    world, ways = make_world(d), np.eye(d)
    balls = [ball(world, (3.0 * k, *[0.0] * (d - 1)), 1.0, kind="dynamic" if k else "kinematic") for k in range(100)]
    colliders = [world.component_for_entity(entity, SphereCollider) for entity in balls]
    for turn, k in enumerate((0, 1, 2, 50, 2, 1, 50, 0)):
        colliders[k].enabled = not colliders[k].enabled
        if turn % 2 == 0:
            world.step()
        on = [entity for entity, collider in zip(balls, colliders, strict=True) if collider.enabled]
        assert [hit.entity for hit in world.ray_cast(-5.0 * ways[0], ways[0])] == on
        assert world.ray_casts(-5.0 * ways[:1], ways[0]).entity.tolist() == on[:1]


@pytest.mark.slow
@both_dimensions
@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(
    ("count", "kinds"),
    [
        (40, ("dynamic", "static", "kinematic")),  # none of them in a grid
        (400, ("dynamic",) * 30 + ("kinematic", "static")),  # a few kinematic ones outside of the grid of what moves
        (400, ("dynamic", "static", "kinematic", "static", "static")),  # both grids
        (300, ("dynamic", "static", "static")),
    ],
)
def test_answers_while_colliders_are_switched(d, count, kinds, seed):
    """What is off is not there: whatever is switched off and on, moves, sleeps, changes its kind, comes or goes, with
    steps between and without, answers are those of a loop over all bodies that are on."""
    world, bodies, side = scene(d, count, seed=seed, kinds=kinds, sleeping=True)
    rng = np.random.default_rng([seed, count])
    for _ in range(100 if seed % 2 else 2):
        world.step()
    compare(world, bodies, rng)
    for turn in range(24):
        entities = world.bodies.entity.copy()
        sleepers, statics = entities[: world.physics.state.sleepers], world.bodies.static.entity
        chosen = (entities, sleepers if len(sleepers) else entities, statics)[turn % 3]
        for entity in rng.choice(chosen, min(len(chosen), int(rng.integers(1, 12))), replace=False).tolist():
            collider = collider_of(world, entity)
            collider.enabled = not collider.enabled
        if turn % 4 == 1:
            bodies = without_two(world, bodies, entities, rng)
        elif turn % 4 == 2:
            place, size, kind = rng.random(d) * side, 0.1 + rng.random(), kinds[turn % len(kinds)]
            collider = SphereCollider(size, enabled=bool(rng.random() < 0.5))
            entity = world.create_entity(Transform(place), RigidBody(kind=kind), collider)
            new = [entity], [place], [[size] * d], [True]
            bodies = Bodies(*(np.concatenate(both) for both in zip(vars(bodies).values(), new, strict=True)))
        elif turn % 4 == 3:
            kind = ("kinematic", "dynamic", "static")[turn // 4 % 3]
            world.component_for_entity(int(rng.choice(entities)), RigidBody).kind = kind
        compare(world, bodies, rng)
        if turn % 3 == 0:
            world.step()
            compare(world, bodies, rng)
