"""Section C of the accuracy list: odd, extreme and impossible input. Either the stated answer or an error at the call;
in every case what is finite stays so, no body is lost, momentum is kept and energy not raised."""

from __future__ import annotations

import math

import numpy as np
import pytest
from worlds import EPS, Conserved, ball, box, make_world, position, run, velocity

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Settings

DT = 1 / 60
both_dimensions = pytest.mark.parametrize("d", [2, 3])
makers = pytest.mark.parametrize("maker", [ball, box])
nowhere = pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])


# -- coincident and overlapping ------------------------------------------------------------------


@both_dimensions
@makers
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_c1_coincident_at_rest(d, maker, e):
    """They part along the first axis, in position alone: momentum and left-over speed are 0, the slop remains."""
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


@both_dimensions
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("w", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (3.0, -4.0, 0.0), (-1e-3, 2e-3, 0.0)])
def test_c2_coincident_with_relative_velocity(d, w, e):
    """The normal is -w: at e = 1 equal bodies exchange velocities, else e w is left; then they part for good."""
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
    parted = e * np.linalg.norm(w) * 241 * DT  # so far with the speed left, else pushed apart
    least = min(0.99, parted * (1 - 1e-9)) if e else 0.99
    assert np.linalg.norm(position(world, b) - position(world, a)) > least
    kept.check()


@makers
@pytest.mark.parametrize("e", [0.0, 1.0])
def test_c21_overlapping_with_equal_velocities(maker, e):
    """Nothing to divide by: the overlap is repaired, both keep their velocity."""
    world = make_world()
    a, b = maker(world, 0.0, (3.0, 1.0), restitution=e), maker(world, 0.7, (3.0, 1.0), restitution=e)
    kept = Conserved(world)
    run(world, 240)
    for entity in (a, b):
        np.testing.assert_allclose(velocity(world, entity), [3.0, 1.0], rtol=4 * EPS)
    assert position(world, b)[0] - position(world, a)[0] > 0.99
    assert not len(world.contacts.impacts)
    kept.check()


def test_a_heap_of_overlapping_bodies_spreads_slowly():
    """500 discs thrown into 10 x 10: deep overlap is pushed out in position, so hardly any speed comes of it.

    The limit on the speed is that of a reference implementation on this heap: 1.5 sizes a second.
    """
    world = make_world()
    for place in np.random.default_rng(1).uniform(0, 10, (500, 2)):
        ball(world, place)
    total = []
    for _ in range(60):
        world.step()
        total.append(world.contacts.depth.sum())
        assert np.linalg.norm(world.bodies.linear_velocity, axis=1).max() < 1.5
    assert total[-1] < 0.5 * total[0]
    np.testing.assert_allclose(world.momentum(), 0, atol=1e-12)  # of 500 bodies at up to 1.5 m/s


# -- mass and restitution ------------------------------------------------------------------------


@pytest.mark.parametrize("mass", [0.0, -1.0, math.nan, math.inf, 1e-320])
def test_c8_masses_that_cannot_be_are_rejected(mass):
    with pytest.raises(ValueError, match=r"RigidBody\.mass must"):
        RigidBody(mass=mass)
    with pytest.raises(ValueError, match=r"RigidBody\.mass must"):
        make_world().create_entities(2, Transform.many(np.zeros((2, 2))), RigidBody.many(mass=[1.0, mass]))


@pytest.mark.parametrize("ratio", [1e12, 1e-12, 1e15, 1e-15])
@pytest.mark.parametrize("e", [0.5, 1.0])
def test_c8_mass_ratios_between_walls(ratio, e):
    """A light body rattles between a heavy one and a wall: never through, and no energy comes of it."""
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


# -- numbers at the ends of their range ----------------------------------------------------------


@makers
@pytest.mark.parametrize("tiny", [1e-310, 5e-324])
def test_c10_denormal_sizes_and_velocities(maker, tiny):
    """No NaN and no crash; a neighbour of ordinary size is left alone or bounces as it should."""
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
    """Position, velocity, force, impulse, size, step: the error names the field; an adopted body's the entity too."""
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
    """Columns are not checked when written: the fault is reported, everybody else moves as without that body."""
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
    """v . v overflows at 1e154: bounces of 1e200 and 1e300 still exchange velocities; and 1e308 harms nobody."""
    for speed in (1e150, 1e200, 1e300):
        world = make_world(d, dt=1e-3 / speed)
        a, b = ball(world, -0.501, speed, restitution=1.0), ball(world, 0.501, -speed)
        run(world, 3)
        assert velocity(world, a)[0] == pytest.approx(-speed, rel=4 * EPS)
        assert velocity(world, b)[0] == pytest.approx(speed, rel=4 * EPS)
    world = make_world(d)
    ball(world, 0.0, 1e308, restitution=1.0)
    ball(world, 0.9, -1e308, restitution=1.0)
    a = ball(world, (0.0, 50.0, 0.0)[:d], 1.0)
    run(world, 10)
    assert velocity(world, a)[0] == 1
    assert position(world, a)[0] == pytest.approx(10 * DT)
    assert len(world.bodies) == 3


@pytest.mark.parametrize("offset", [0.0, 1e5, 1e7, 1e9])
def test_head_on_far_from_the_origin(offset):
    """Exchange is exact wherever it happens; where it happens is known to an ulp of the offset."""
    world = make_world()
    a, b = ball(world, offset - 0.6, 1.0, restitution=1.0), ball(world, offset + 0.6, -1.0, restitution=1.0)
    run(world, 30)
    assert (velocity(world, a)[0], velocity(world, b)[0]) == (-1.0, 1.0)
    assert position(world, a)[0] - offset == pytest.approx(-0.5 - (0.5 - 0.1), abs=40 * EPS * (1 + offset))


def test_sizes_from_1e_minus_9_to_1e9():
    """C4, impact as in B9: a speck of 1e-9 and a moon of 1e9 meet at the moon's surface, 2 m1 / m2 = 2e-54."""
    world = make_world()
    moon = ball(world, (0.0, -1e9), radius=1e9, mass=1e27, restitution=1.0)
    speck = ball(world, (0.0, 1e-3), (0.0, -1e-2), radius=1e-9, mass=1e-27)
    run(world, 12)
    assert velocity(world, speck)[1] == pytest.approx(1e-2, rel=1e-9)
    assert abs(velocity(world, moon)[1]) < 1e-50


# -- points, empty boxes, touching ---------------------------------------------------------------


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


@both_dimensions
@pytest.mark.parametrize("first", [ball, box])
@pytest.mark.parametrize("second", [ball, box])
@pytest.mark.parametrize(("relative", "impacts"), [(0.0, 0), (1.0, 0), (-1.0, 1)])
def test_c14_touching_exactly(d, first, second, relative, impacts):
    """At rest or separating no impulse, approaching one impact at the start of the step, and no repeat of it."""
    world = make_world(d)
    a, b = first(world, 0.0, restitution=1.0), second(world, 1.0, relative, restitution=1.0)
    kept, seen = Conserved(world), []
    for step in range(10):
        world.step()
        seen += [(step, c.time_of_impact) for c in world.contacts.impacts]
        assert len(world.contacts.impacts) or (world.contacts.normal_impulse == 0).all()
    assert seen == [(0, 0.0)] * impacts
    assert velocity(world, b)[0] - velocity(world, a)[0] == abs(relative)
    kept.check()


# -- places --------------------------------------------------------------------------------------


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


def test_c18_bodies_outside_still_collide():
    """Two leave the crowd behind at high speed and meet far away."""
    world = make_world()
    for place in np.random.default_rng(0).uniform(0, 50, (200, 2)):
        ball(world, place, radius=0.1, kind="kinematic")
    a, b = ball(world, (1e7, 1e7 - 20.0), (0.0, 10.0), restitution=1.0), ball(world, (1e7, 1e7), restitution=1.0)
    run(world, 180)
    assert velocity(world, a)[1] == 0
    assert velocity(world, b)[1] == 10.0


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


# -- coming and going ----------------------------------------------------------------------------


def test_c25_no_bodies_and_one_body():
    world = make_world(gravity=9.81)
    run(world, 3)
    assert len(world.contacts) == len(world.bodies) == 0
    assert world.step_count == 3
    one = ball(world, (0, 5))
    run(world, 3)
    assert velocity(world, one)[1] == pytest.approx(-9.81 * 3 / 60)
    world.delete_entity(one)
    run(world, 3)
    assert len(world.bodies) == 0


@pytest.mark.parametrize("immediate", [False, True])
def test_c25_removed_in_the_middle_of_a_collision(immediate):
    """The stale contact is gone, the partner flies on free."""
    world = make_world()
    a, b = ball(world, 0.0), ball(world, 0.8)
    run(world, 2)
    assert len(world.contacts) == 1
    world.delete_entity(b, immediate=immediate)
    before = position(world, a)
    run(world, 5)
    assert len(world.contacts) == 0
    np.testing.assert_array_equal(position(world, a), before)


@pytest.mark.parametrize("e", [0.0, 1.0])
def test_c25_added_inside_another(e):
    """It is pushed out in position; no speed comes of it."""
    world = make_world()
    box(world, 0.0, half=1.0, kind="static", restitution=e)
    run(world, 2)
    inside = ball(world, (0.4, 0.1), restitution=e)
    run(world, 300)
    assert (velocity(world, inside) == 0).all()
    assert position(world, inside)[0] == pytest.approx(1.5, abs=0.006)
    assert position(world, inside)[1] == 0.1


# -- symmetries ----------------------------------------------------------------------------------


def brawl(gravity=9.81, turn=lambda v: v, length=1.0, time=1.0, mass=1.0, shuffle=False):
    """40 balls and boxes of several e and mass that bounce and rest on a floor and each other; their states after 1 s.

    turn: a symmetry of the plane; length, time, mass: units; shuffle: another history of the same ids.
    """
    world = make_world(gravity=turn(np.array([0.0, -gravity * length / time**2])), dt=DT * time)
    rng = np.random.default_rng(9)
    half = np.abs(turn(np.array([50.0, 0.5]))) * length
    world.create_entity(Transform(turn(np.array([0.1, -0.5])) * length), AABBCollider(half, restitution=0.2))
    entities, parts = [], []
    for k in range(40):
        place, speed = np.array([rng.uniform(-4, 4), 0.6 + 0.5 * k]), rng.normal(size=2)
        weight, e, size = rng.uniform(0.5, 2), (0.0, 0.5, 1.0)[k % 3], rng.uniform(0.2, 0.5, 2)
        if k % 2:
            collider = SphereCollider(size[0] * length, restitution=e)
        else:
            collider = AABBCollider(np.abs(turn(size)) * length, restitution=e)
        body = RigidBody(weight * mass, turn(speed) * length / time)
        parts.append((Transform(turn(place) * length), body, collider))
        entities.append(world.create_entity(*(parts[-1] if not shuffle else ())))
    if shuffle:
        for k in rng.permutation(40):
            for part in parts[k]:
                world.add_component(entities[k], part)
            assert world.bodies.row_of(entities[k]) >= 0  # adopted one by one, in this order
        for k in rng.permutation(40)[:15]:
            world.remove_component(entities[k], RigidBody)
            assert world.bodies.row_of(entities[k]) >= 0  # among the static ones for a while
            world.add_component(entities[k], parts[k][1].copy())
    run(world, 60)
    rows = [world.bodies.row_of(entity) for entity in entities]
    impacts = world.stats().counters["impacts"]
    return world.bodies.position[rows].copy(), world.bodies.linear_velocity[rows].copy(), impacts


def test_c22_repeated_and_permuted():
    """The same bits when run again, and when the same ids came about in another order."""
    x, v, impacts = brawl()
    assert impacts > 30
    for shuffle in (False, True):
        again = brawl(shuffle=shuffle)
        np.testing.assert_array_equal(again[0], x)
        np.testing.assert_array_equal(again[1], v)


@pytest.mark.parametrize(
    "turn",
    [lambda v: v[::-1].copy(), lambda v: v * [-1, 1], lambda v: v * [1, -1]],
    ids=["swap", "mirror x", "mirror y"],
)
def test_c22_mirrored(turn):
    """2D axes swapped or mirrored: the same bits, mirrored."""
    x, v, *_ = brawl()
    found = brawl(turn=turn)
    np.testing.assert_array_equal(found[0], np.array([turn(row) for row in x]))
    np.testing.assert_array_equal(found[1], np.array([turn(row) for row in v]))


def test_c23_galilean():
    """A velocity added to all: relative motion is the same to 1e-9 (rounding of 1e3 m, amplified by 50 impacts)."""

    def cluster(drift):
        world = make_world()
        rng = np.random.default_rng(9)
        for k in range(36):
            place = 1.6 * np.array([k % 6, k // 6]) + rng.uniform(-0.1, 0.1, 2)
            speed = rng.normal(size=2) - 0.3 * (place - 4.0)
            (box, ball)[k % 2](world, place, speed + drift, restitution=1.0, mass=rng.uniform(0.5, 2.0))
        run(world, 60)
        assert world.stats().counters["impacts"] > 50
        return world.bodies.position - drift * 60 * DT, world.bodies.linear_velocity - drift

    for still, drifting in zip(cluster(np.zeros(2)), cluster(np.array([1e3, -7e2])), strict=True):
        np.testing.assert_allclose(drifting, still, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("length", "time", "mass"),
    [(2.0**20, 1, 1), (2.0**-20, 1, 1), (1, 2.0**-9, 1), (1, 1, 2.0**40), (2.0**-30, 2.0**7, 2.0**-50)],
)
def test_c24_other_units(length, time, mass):
    """Lengths, times and masses in powers of two: bitwise the scaled state, because no tolerance is absolute."""
    x, v, *_ = brawl()
    found = brawl(length=length, time=time, mass=mass)
    np.testing.assert_array_equal(found[0], x * length)
    np.testing.assert_array_equal(found[1], v * length / time)
