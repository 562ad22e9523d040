"""Section C of the accuracy list: extreme or impossible masses, restitutions, sizes, speeds. Either the stated
result or an error at the call; in every case finite bodies stay finite, and no body is lost."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers_extremes import DT, makers
from worlds import EPS, Conserved, ball, both_dimensions, box, make_world, position, run, velocity

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Settings

nowhere = pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])


@pytest.mark.parametrize("mass", [0.0, -1.0, math.nan, math.inf, 1e-320])
def test_c8_masses_that_cannot_be_are_rejected(mass):
    with pytest.raises(ValueError, match=r"RigidBody\.mass must"):
        RigidBody(mass=mass)
    with pytest.raises(ValueError, match=r"RigidBody\.mass must"):
        make_world().create_entities(2, Transform.many(np.zeros((2, 2))), RigidBody.many(mass=[1.0, mass]))


@pytest.mark.parametrize("ratio", [1e12, 1e-12, 1e15, 1e-15])
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


@pytest.mark.parametrize("restitution", [-0.1, math.nan, math.inf])
def test_c9_restitution_that_cannot_be_is_rejected(restitution):
    for make in (lambda **e: SphereCollider(1.0, **e), lambda **e: AABBCollider((1, 1), **e)):
        with pytest.raises(ValueError, match=r"\.restitution must"):
            make(restitution=restitution)


def test_c9_restitution_above_one_gains():
    """Allowed: e = 1.5 multiplies the relative speed by 1.5 and the energy of the apex by 2.25."""
    world = make_world()
    box(world, 0.0, kind="static")
    a = ball(world, -1.01, 1.0, restitution=1.5)
    run(world, 3)
    assert velocity(world, a)[0] == -1.5


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


@nowhere
def test_c11_rejected_at_the_call(bad):
    """Position, velocity, force, impulse, size, step: the error names the field; for an adopted body the entity too."""
    for make in (
        lambda: Transform((bad, 0.0)),
        lambda: RigidBody(linear_velocity=(0.0, bad)),
        lambda: RigidBody(constant_force=(0.0, bad)),
        lambda: SphereCollider(bad),
        lambda: AABBCollider((1.0, bad)),
        lambda: SphereCollider(1.0, offset=(bad, 0.0)),
        lambda: Settings(dt=bad),
    ):
        with pytest.raises(ValueError, match="must"):
            make()
    world = make_world()
    entity = ball(world, 0.0)
    world.step()
    body = world.component_for_entity(entity, RigidBody)
    with pytest.raises(ValueError, match=f"entity {entity}"):
        world.component_for_entity(entity, Transform).position = (bad, 0.0)
    with pytest.raises(ValueError, match=f"entity {entity}"):
        body.linear_velocity = (bad, 0.0)
    for push in (body.apply_force, body.apply_impulse):
        with pytest.raises(ValueError, match="finite"):
            push((bad, 0.0))
    with pytest.raises(ValueError, match="finite"):
        world.advance(bad)
    run(world, 2)
    assert (position(world, entity) == 0).all()


@pytest.mark.parametrize("dt", [0.0, -1 / 60])
def test_c11_steps_must_be_positive(dt):
    with pytest.raises(ValueError, match=r"Settings\.dt"):
        Settings(dt=dt)


@nowhere
@pytest.mark.parametrize("name", ["position", "linear_velocity"])
def test_c11_written_into_columns_it_stays_with_its_body(bad, name):
    """Columns are not checked when written: the fault is reported, all others move as without that body."""
    worlds = [make_world(), make_world()]
    for world in worlds:
        rng = np.random.default_rng(6)
        for k in range(40):
            ball(world, rng.uniform(-3, 3, 2), rng.normal(size=2), restitution=1.0, mask=2 if k == 7 else -1)
    broken, healthy = worlds
    getattr(broken.bodies, name)[7, 0] = bad
    run(broken, 30)
    run(healthy, 30)
    others = np.arange(40) != 7
    for column in ("position", "linear_velocity"):
        found, expected = getattr(broken.bodies, column)[others], getattr(healthy.bodies, column)[others]
        np.testing.assert_array_equal(found, expected)
    assert any(f"entity {broken.bodies.entity[7]}" in fault for fault in broken.faults)
    assert not any("entity" in fault for fault in healthy.faults)


@both_dimensions
def test_c12_huge_velocities(d):
    """v . v overflows at 1e154: bounces of 1e200 and 1e300 still exchange velocities; 1e308 is refused, and affects no
    other body where it is written into a column."""
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


@pytest.mark.parametrize("offset", [0.0, 1e5, 1e7, 1e9])
def test_c6_head_on_far_from_the_origin(offset):
    """The exchange is exact at any offset; its position is known to an ulp of the offset."""
    world = make_world()
    a, b = ball(world, offset - 0.6, 1.0, restitution=1.0), ball(world, offset + 0.6, -1.0, restitution=1.0)
    run(world, 30)
    assert (velocity(world, a)[0], velocity(world, b)[0]) == (-1.0, 1.0)
    assert position(world, a)[0] - offset == pytest.approx(-0.5 - (0.5 - 0.1), abs=40 * EPS * (1 + offset))


def test_c13_sizes_that_cannot_be_are_rejected():
    for make in (
        lambda: SphereCollider(-1.0),
        lambda: AABBCollider((1.0, -1e-300)),
        lambda: AABBCollider.from_bounds((0.0, 1.0), (1.0, 0.0)),
    ):
        with pytest.raises(ValueError, match=r"Collider\.(radius|half_extents) must|lower must not exceed"):
            make()
    SphereCollider(0.0)
    AABBCollider((0.0, 0.0))
    AABBCollider.from_bounds((1.0, 1.0), (1.0, 1.0))


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
