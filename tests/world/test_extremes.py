"""Section C: extreme masses, sizes, speeds, places; bodies created and deleted: the stated result, all stays finite."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from helpers_pairwise import pairwise
from worlds import EPS, Conserved, ball, both_dimensions, box, make_world, position, run, velocity

from carom.components import AABBCollider, RigidBody, SphereCollider
from carom.framework import Settings
from carom.plugins.capsule import CapsuleCollider
from carom.plugins.convex_polygon import ConvexPolygonCollider
from carom.plugins.rotation import BoxCollider

DT = 1 / 60
makers = pytest.mark.parametrize("maker", [ball, box])


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [1e15, 1e-15])
@pytest.mark.parametrize("e", [0.5, 1.0])
def test_c8_mass_ratios_between_walls(ratio, e):
    """A light body bounces between a heavy one and a wall: it never tunnels, and energy does not grow."""
    world = make_world()
    wall = box(world, (0.0, 0.0), kind="static", restitution=e)
    light, heavy = ball(world, 1.1, 0.0, restitution=e), ball(world, 2.5, -0.5, mass=ratio, restitution=e)
    kept = Conserved(world)
    run(world, 300)
    assert position(world, wall)[0] == 0
    assert position(world, light)[0] > 0.5
    assert position(world, heavy)[0] > position(world, light)[0]
    kept.check(momentum=False)


@makers
@pytest.mark.parametrize("tiny", [1e-310, 5e-324])
def test_c10_denormal_sizes_and_velocities(maker, tiny):
    """No NaN and no crash; a neighbour of ordinary size is not affected or bounces as it should."""
    world = make_world()
    size = {"radius" if maker is ball else "half": tiny}
    maker(world, (0.0, 5.0), tiny, restitution=1.0, **size)
    maker(world, (tiny, 5.0), -tiny, restitution=1.0, **size)
    a, b = ball(world, -0.51, 1.0, restitution=1.0), ball(world, 0.51, -1.0)
    small = maker(world, (0.0, -0.501), (tiny, 1.0), **size)  # under the pair, which it may touch
    kept = Conserved(world)
    run(world, 30)
    kept.check()
    assert velocity(world, a)[0] == pytest.approx(-1.0, abs=1.5)
    assert world.entity_exists(small)
    assert np.isfinite(velocity(world, b)).all()


def test_c10_denormal_masses():
    """The smallest mass with a finite inverse works, two of them exchange velocities."""
    world = make_world()
    a, b = (ball(world, x, v, mass=1e-307, restitution=1.0) for x, v in ((-0.51, 1.0), (0.51, -1.0)))
    run(world, 3)
    assert (velocity(world, a)[0], velocity(world, b)[0]) == (-1.0, 1.0)


@pytest.mark.parametrize("dt", [0.0, -1 / 60, math.nan, math.inf, "fast"])
def test_c11_steps_must_be_positive(dt):
    with pytest.raises(ValueError, match=r"Settings\.dt"):
        Settings(dt=dt)


@both_dimensions
def test_c12_huge_velocities(d):
    """v . v overflows at 1e154: 1e300 still bounces; 1e308 is refused, and written it affects no other body."""
    for speed in (1e150, 1e200, 1e300):
        world = make_world(d, dt=1e-3 / speed)
        a, b = ball(world, -0.501, speed, restitution=1.0), ball(world, 0.501, -speed)
        run(world, 3)
        assert velocity(world, a)[0] == pytest.approx(-speed, rel=4 * EPS)
        assert velocity(world, b)[0] == pytest.approx(speed, rel=4 * EPS)
    world = make_world(d)
    for speed in (1e308, -1e308):
        with pytest.raises(ValueError, match=r"RigidBody\.linear_velocity must be at most 1e\+307"):
            ball(world, 0.0, speed)
    for x, speed in ((0.0, 1e308), (0.9, -1e308)):
        fast = ball(world, x, restitution=1.0)
        world.component_for_entity(fast, RigidBody).linear_velocity[0] = speed
    a = ball(world, (0.0, 50.0, 0.0)[:d], 1.0)
    run(world, 10)
    assert velocity(world, a)[0] == 1
    assert position(world, a)[0] == pytest.approx(10 * DT)
    assert len(world.bodies) == 3


@both_dimensions
@pytest.mark.parametrize("size", [1.1e150, 1e200])
def test_sizes_whose_squares_overflow_are_refused_with_their_field(d, size):
    """1e150 m meets its like; more is refused where it is given, in any collider."""
    world = make_world(d)
    large = ball(world, 0.0, radius=1e150)
    box(world, 1.9e150, half=1e150)
    run(world, 2)
    assert len(world.contacts) == 1
    assert np.isfinite(world.bodies.position).all()
    for make, field in (
        (lambda: SphereCollider(size), "SphereCollider.radius"),
        (lambda: AABBCollider((1, size, 1)[:d]), "AABBCollider.half_extents"),
        (lambda: BoxCollider((1, size, 1)[:d]), "BoxCollider.half_extents"),
        (lambda: CapsuleCollider(1.0, size), "CapsuleCollider.half_height"),
        (lambda: SphereCollider(1.0, offset=(size, 0, 0)[:d]), "SphereCollider.offset"),
        (lambda: ConvexPolygonCollider(((0, 0), (size, 0), (0, size))), "ConvexPolygonCollider.vertices"),
    ):
        with pytest.raises(ValueError, match=rf"{field} must be at most 1e\+150.*, got .*{re.escape(repr(size))}"):
            make()
    with pytest.raises(ValueError, match=rf"entity {large}: SphereCollider.radius must be at most 1e\+150"):
        world.component_for_entity(large, SphereCollider).radius = size


@pytest.mark.slow
@both_dimensions
@pytest.mark.parametrize(("maker", "size"), [(ball, {"radius": 0.0}), (box, {"half": 0.0})])
def test_c13_points_bounce(d, maker, size):
    """A point on a box, on a ball and on a sheet without thickness (B9); points need an overlap at a step's end."""
    for target in (
        lambda w: box(w, 0.0, kind="static"),
        lambda w: ball(w, 0.0, kind="static"),
        lambda w: ball(w, 0.5, radius=1.0, kind="static"),
    ):
        world = make_world(d)
        target(world)
        a = maker(world, -0.51, 1.0, restitution=0.5, **size)
        run(world, 2)
        assert velocity(world, a)[0] == -0.5
    world = make_world(d)
    box(world, 0.0, half=(0.0, *(1.0,) * (d - 1)), kind="static")
    a = ball(world, -0.51, 1.0, restitution=0.5)
    run(world, 2)
    assert velocity(world, a)[0] == -0.5


@pytest.mark.slow
@both_dimensions
@makers
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_c1_coincident_at_rest(d, maker, e):
    """They separate along the first axis, in position alone: momentum and residual speed are 0, the slop remains."""
    world = make_world(d)
    a, b = maker(world, 0.25, restitution=e), maker(world, 0.25, restitution=e)
    kept = Conserved(world)
    run(world, 240)
    gap = position(world, b) - position(world, a)
    assert 0.99 < abs(gap[0]) < 1.0 + 1e-12
    assert (gap[1:] == 0).all()
    assert (velocity(world, a) == 0).all()
    assert (velocity(world, b) == 0).all()
    kept.check()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("d", "w", "e"),
    pairwise((2, 3), ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (3.0, -4.0, 0.0), (-1e-3, 2e-3, 0.0)), (0.0, 0.5, 1.0)),
)
def test_c2_coincident_with_relative_velocity(d, w, e):
    """The normal is -w: at e = 1 equal bodies exchange velocities, else e w is left; then they separate for good."""
    world = make_world(d)
    w = np.array(w[:d])
    a, b = ball(world, (0.0,) * d, w / 2, restitution=e), ball(world, (0.0,) * d, -w / 2, restitution=e)
    kept = Conserved(world)
    run(world, 1)
    if e:
        np.testing.assert_allclose(velocity(world, a), -e * w / 2, atol=4 * EPS * np.linalg.norm(w))
    run(world, 240)
    if e:
        np.testing.assert_allclose(velocity(world, b) - velocity(world, a), e * w, atol=1e-13 * np.linalg.norm(w))
    parted = e * np.linalg.norm(w) * 241 * DT  # distance with the residual speed, else pushed apart
    least = min(0.99, parted * (1 - 1e-9)) if e else 0.99
    assert np.linalg.norm(position(world, b) - position(world, a)) > least
    kept.check()


@both_dimensions
@pytest.mark.parametrize("spacing", [1.0, 2.0**-30, 2.0**30])
def test_c18_on_split_lines_on_edges_and_outside(d, spacing):
    """Touching balls on a lattice of powers of two: every neighbour pair is a contact; so is a pair far outside."""
    world = make_world(d)
    n = 8 if d == 2 else 5
    lattice = np.stack(np.meshgrid(*[np.arange(n) * spacing] * d), axis=-1).reshape(-1, d)
    for place in lattice:
        ball(world, place, radius=spacing / 2)
    outside = 2.0**20 * spacing
    places = [(outside + k * spacing, *(-outside,) * (d - 1)) for k in (0, 1)]
    far = [ball(world, place, radius=spacing / 2) for place in places]
    world.step()
    assert len(world.contacts) == d * n ** (d - 1) * (n - 1) + 1
    assert len(world.contacts.of(far[0])) == 1


@both_dimensions
def test_c20_one_ulp_apart(d):
    """Points one ulp apart in a world 1e6 wide: the tree stops descending; they do not touch, equal ones do."""
    world = make_world(d)
    for k in range(100):
        ball(world, (1e6 * k / 99,) * d, radius=0.0)
    p = 1.0
    for place in (p, p, np.nextafter(p, 2.0)):
        ball(world, place, radius=0.0)
    world.step()
    assert len(world.contacts) == 1


@pytest.mark.parametrize("e", [0.0, 1.0])
def test_c25_added_inside_another(e):
    """It is pushed out in position, without gaining speed."""
    world = make_world()
    box(world, 0.0, half=1.0, kind="static", restitution=e)
    run(world, 2)
    inside = ball(world, (0.4, 0.1), restitution=e)
    run(world, 300)
    assert (velocity(world, inside) == 0).all()
    assert position(world, inside)[0] == pytest.approx(1.5, abs=0.006)
    assert position(world, inside)[1] == 0.1
