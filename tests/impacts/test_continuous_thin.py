"""Things without thickness stop each other: they touch on the side that they come from."""

from __future__ import annotations

import itertools
from fractions import Fraction

import numpy as np
import pytest
from helpers_pairwise import pairwise
from worlds import both_dimensions

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.lab import testing as kit

DT, SURE = 1 / 60, Fraction(1, 10**9)

swept = pytest.mark.parametrize("mode", ["continuous", "event_driven"])


def crosses(place, velocity, half, axis, reach):
    """Whether a step from ``place`` surely leads through a box flat along ``axis``; reach: (d,) of what moves."""
    time = -Fraction(place[axis]) / Fraction(velocity[axis])
    if not 0 < time < Fraction(DT):
        return False
    at = [Fraction(x) + Fraction(v) * time for x, v in zip(place, velocity, strict=True)]
    beside = [abs(x) < Fraction(h) + Fraction(r) - SURE for x, h, r in zip(at, half, reach, strict=True)]
    return all(inside for k, inside in enumerate(beside) if k != axis)


@pytest.mark.parametrize(
    ("mode", "d", "kind", "restitution"),
    pairwise(("continuous", "event_driven"), (2, 3), ("point", "flat box", "box point"), (1.0, 0.5, 0.0)),
)
def test_nothing_passes_through(mode, d, kind, restitution):
    """Hundreds of ways through a box without thickness, also far from the origin; whichever of the two moves."""
    rng = np.random.default_rng(d)
    world, cases = kit.make_world(d, collision=mode), []
    for number in range(300):
        axis = int(rng.integers(d))
        half, reach = rng.uniform(0.02, 0.5, d), np.zeros(d)
        half[axis] = 0.0
        if kind == "flat box":
            reach = rng.uniform(0.0, 0.01, d) * (np.arange(d) != axis)
        velocity = rng.uniform(-4, 4, d) * 10 ** rng.uniform(-0.5, 1.5)
        hit = half * rng.uniform(-0.9, 0.9, d)
        centre = np.round(hit + rng.uniform(-0.1, 0.1, d), 6) + 50.0 * number * np.eye(d)[0]
        moving = rng.random() < 0.7  # else the wall comes
        start = centre + hit - velocity * rng.uniform(0.05, 0.95) * DT
        if not crosses(start - centre, velocity, half, axis, reach):
            continue
        small = SphereCollider(0.0, restitution=restitution)
        if "box" in kind:
            small = AABBCollider(tuple(reach), restitution=restitution)
        wall = AABBCollider(tuple(half), restitution=restitution)
        bodies = [(Transform(tuple(centre)), wall), (Transform(tuple(start)), small)]
        speed = RigidBody(1.0, tuple(velocity if moving else -velocity))
        bodies[moving] = (*bodies[moving], speed)
        order = [0, 1] if rng.random() < 0.5 else [1, 0]
        ids = {k: world.create_entity(*bodies[k]) for k in order}
        cases.append((ids[0], ids[1], axis, np.sign(start - centre)[axis]))
    kit.run(world, 3)
    assert len(cases) > 200
    for wall, small, axis, side in cases:
        gap = side * (kit.position(world, small) - kit.position(world, wall))[axis]
        assert gap > 0.0 if restitution > 0.0 else gap > -1e-11


@pytest.mark.slow
@both_dimensions
@pytest.mark.parametrize("integrator", ["semi_implicit_euler", "velocity_verlet"])
@swept
def test_points_stay_in_a_room_without_walls_thickness(mode, integrator, d):
    """Curved paths come back to the wall they have left; no threshold, as contacts at rest need some thickness."""
    for gravity in (0.0, 9.81):
        rules = {"collision": mode, "integrator": integrator, "max_impacts_per_step": 64, "restitution_threshold": 0.0}
        world = kit.make_world(d, gravity, **rules)
        for axis, sign in itertools.product(range(d), (-1, 1)):
            half, place = np.ones(d), np.zeros(d)
            half[axis], place[axis] = 0.0, sign * 1.0
            kit.box(world, place, half=half, kind="static", restitution=1.0)
        rng = np.random.default_rng(3)
        ids = [kit.ball(world, rng.uniform(-0.9, 0.9, d), rng.normal(size=d) * 20 + 5, radius=0.0, restitution=1.0)
               for _ in range(20)]  # fmt: skip
        kit.run(world, 300)
        places = np.array([kit.position(world, i) for i in ids])
        assert np.abs(places).max() <= 1.0 + 1e-12


@swept
def test_on_the_wall_itself(mode):
    """What is struck at the very end of a step, and what begins on the wall, leaves to where it goes."""
    for sign in (-1.0, 1.0):
        world = kit.make_world(2, collision=mode, dt=0.125)
        kit.box(world, (0.0, 0.0), half=(0.0, 1.0), kind="static", restitution=1.0)
        arrives = kit.ball(world, (sign, 0.25), (-8.0 * sign, 0.0), radius=0.0, restitution=1.0)
        leaves = kit.ball(world, (0.0, -0.25), (8.0 * sign, 0.0), radius=0.0, restitution=1.0)
        world.step()
        assert kit.position(world, arrives).tolist() == [0.0, 0.25]
        world.step()
        assert kit.position(world, arrives).tolist() == [sign, 0.25]
        assert kit.position(world, leaves).tolist() == [2.0 * sign, -0.25]
