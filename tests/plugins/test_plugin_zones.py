"""Zones: what floats, drifts and orbits, against closed forms; and explosions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from worlds import METHODS, MODES, ball, both_dimensions, box, mostly_2d, position, run, velocity

from carom import (
    AABBCollider,
    BoxCollider,
    CapsuleCollider,
    ConvexPolygonCollider,
    Field,
    NoPhysicsError,
    PartOf,
    Parts,
    Physics,
    RigidBody,
    Rotation,
    Settings,
    SphereCollider,
    Spin,
    Transform,
    Water,
    Wind,
    World,
    Zones,
    explode,
)
from carom.plugins import capsule, convex_polygon
from carom.plugins.zones.displacement import box_below

G, DT = 10.0, 1 / 60


def flat(d, x=0.0, y=0.0):
    return (x, y, 0.0)[:d]


def world_of(d=2, *plugins, gravity=G, **settings):
    return World(
        Physics(d, gravity=flat(d, 0.0, -gravity)), Rotation(), Zones(), *plugins, settings=Settings(**settings)
    )


def zone(world, component, half=(50.0, 5.0), at=(0.0, 0.0), **collider):
    """A box from y = -5 to 5 m."""
    d = world.physics.dimensions
    shape = AABBCollider((*half, half[0])[:d], sensor=True, **collider)
    return world.create_entity(Transform(flat(d, *at)), shape, component)


def turned(world, entity):
    return world.component_for_entity(entity, Spin).angular_velocity


def below(r, y, d):
    """The area or volume of a disc or ball below what is y above its centre."""
    if d == 2:
        return r * r * math.acos(-y / r) + y * math.sqrt(r * r - y * y)
    return math.pi / 3.0 * (r + y) ** 2 * (2.0 * r - y)


def test_what_is_below_a_plane_in_a_turned_box():
    """Against a sum over columns, whose rule has kinks: 1e-5 of the volume. Edges are level, or nearly so, in some."""
    random, (nodes, weights) = np.random.default_rng(3), np.polynomial.legendre.leggauss(200)
    for case in range(24):
        h, n = random.uniform(0.2, 1.0, 3), random.normal(size=3)
        n[: case % 3] *= (1.0, 1e-2, 1e-5, 0.0)[case % 4]
        n /= np.linalg.norm(n)
        s = random.uniform(-1.1, 1.1) * np.abs(n) @ h
        up = int(np.argmax(np.abs(n)))
        one, two = (k for k in range(3) if k != up)
        a, b = np.meshgrid(nodes * h[one], nodes * h[two], indexing="ij")
        top = np.clip((s - n[one] * a - n[two] * b) / n[up], -h[up], h[up])
        low, high = (-h[up], top) if n[up] > 0 else (top, h[up])
        area, found = np.outer(weights * h[one], weights * h[two]), np.zeros(4)
        found[0] = ((high - low) * area).sum()
        found[1 + up] = (0.5 * (high**2 - low**2) * area).sum()
        found[1 + one], found[1 + two] = ((c * (high - low) * area).sum() for c in (a, b))
        scale = 8.0 * np.prod(h)
        np.testing.assert_allclose(box_below(tuple(n), tuple(h), float(s)), found, rtol=0, atol=1e-5 * scale)


@pytest.mark.slow
@mostly_2d
@pytest.mark.parametrize("mode", MODES)
def test_what_is_lighter_floats_as_deep_as_its_density_says(d, mode):
    random, world = np.random.default_rng(d), world_of(d, collision=mode)
    zone(world, Water(1000.0, drag=4.0))
    boxes, balls, dice = {}, {}, {}
    for k, share in enumerate(random.uniform(0.1, 0.9, 5)):
        boxes[box(world, flat(d, 4.0 * k, 5.0), half=0.5, mass=1000.0 * share)] = share
        r = random.uniform(0.3, 0.8)
        whole = below(r, r, d)
        balls[ball(world, flat(d, -4.0 - 4.0 * k, 5.0), radius=r, mass=1000.0 * share * whole)] = r, share * whole
        raft = Transform(flat(d, 4.0 * k, 7.0)), RigidBody(800.0 * share), Spin(), BoxCollider((1.0, 0.2, 0.5)[:d])
        dice[world.create_entity(*raft)] = share
    for entity in dice:
        world.component_for_entity(entity, Transform).x += 22.0
    run(world, 900)
    for entity, share in boxes.items():
        assert 5.0 - position(world, entity)[1] + 0.5 == pytest.approx(share, abs=1e-9)
    for entity, (r, volume) in balls.items():
        assert below(r, 5.0 - position(world, entity)[1], d) == pytest.approx(volume, abs=1e-9)
    for entity, share in dice.items():
        assert 5.0 - position(world, entity)[1] + 0.2 == pytest.approx(0.4 * share, abs=1e-6)
    assert np.abs(world.bodies.dynamic.linear_velocity).max() < 1e-6


@both_dimensions
def test_what_is_all_in_it_is_lifted_by_its_own_area_or_volume(d):
    """Capsules and polygons of the water's density hover, wherever; half as heavy they rise with g, plus nothing."""
    world = world_of(d, capsule.plugin, *((convex_polygon.plugin,) if d == 2 else ()))
    zone(world, Water(2.0, drag=0.0))
    volume = 4 * 0.3 * 0.5 + math.pi * 0.09 if d == 2 else math.pi * 0.09 + 4 / 3 * math.pi * 0.027
    shapes = [(CapsuleCollider(0.3, 0.5), volume)]
    if d == 2:
        shapes.append((ConvexPolygonCollider([(0, 0), (1.0, 0), (0.2, 0.8)]), 0.4))
    for k, (shape, volume) in enumerate(shapes):
        for heavy in (1.0, 0.5):
            place = Transform(flat(d, 5.0 * k + 20.0 * heavy, 2.0), 0.3 if d == 2 else (1.0, 0.0, 0.0, 0.1))
            world.create_entity(
                place, RigidBody(2.0 * volume * heavy), Spin(inertia=1.0 if d == 2 else (1,) * 3), shape.copy()
            )
    run(world, 12)
    np.testing.assert_allclose(
        world.bodies.dynamic.linear_velocity, [flat(d, 0.0, y) for y in (0.0, 12 * DT * G) * len(shapes)], atol=1e-12
    )


@pytest.mark.parametrize("half", [(1.0, 0.2), (0.2, 1.0), (0.5, 0.5)])
@mostly_2d
def test_a_raft_rights_itself_as_its_metacentre_says(d, half):
    """Waterplane moment over displaced volume less half of what is above the middle of it; a tall one tips over."""
    world, (a, b), share, tilt = world_of(d), half, 0.4, 1e-4
    zone(world, Water(1000.0, drag=0.0))
    rotation = tilt if d == 2 else (math.cos(tilt / 2), 0.0, 0.0, math.sin(tilt / 2))
    mass, inertia = 4000.0 * a * b * share, 0.75
    raft = world.create_entity(
        Transform(flat(d, 0.0, 5.0 + b - 2.0 * b * share), rotation), RigidBody(mass),
        Spin(inertia=inertia if d == 2 else (inertia, 0.5, inertia)), BoxCollider((a, b, 0.5)[:d]),
    )  # fmt: skip
    world.step()
    metacentre = a * a / (6.0 * b * share) - b * (1.0 - share)
    found = turned(world, raft) if d == 2 else turned(world, raft)[2]
    assert found == pytest.approx(-mass * G * metacentre * tilt / inertia * DT, rel=1e-3)
    np.testing.assert_allclose(velocity(world, raft), 0.0, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("settings", [{"integrator": name} for name in METHODS] + [{"collision": "event_driven"}])
def test_the_terminal_velocity_in_water(settings):
    """Weight less lift over drag, beside the flow: v = g (m / (rho V) - 1) / drag, exact in every method."""
    world = world_of(**settings)
    zone(world, Water(1000.0, 3.0, (1.5, 0.0)), half=(100.0, 500.0))
    stone, cork = (box(world, (x, 0.0), mass=mass) for x, mass in ((-5.0, 2000.0), (5.0, 500.0)))
    run(world, 900)
    np.testing.assert_allclose(velocity(world, stone), (1.5, -G / 3.0), rtol=0, atol=1e-9)
    np.testing.assert_allclose(velocity(world, cork), (1.5, G * 0.5 / 3.0), rtol=0, atol=1e-9)


def test_drag_never_throws_back():
    """A thousand times as light as what it displaces, at a rate of 50,000 1/s: at the flow's speed, never beyond."""
    for settings in ({}, {"integrator": "velocity_verlet"}, {"integrator": "rk4"}, {"collision": "event_driven"}):
        world = world_of(gravity=0.0, **settings)
        zone(world, Water(1000.0, 50.0, (2.0, 0.0)))
        light = box(world, (0.0, 0.0), (-7.0, 3.0), mass=1.0)
        spinner = world.create_entity(Transform((5, 0)), RigidBody(1.0), Spin(9.0), BoxCollider((0.5, 0.5)))
        speeds = []
        for _ in range(120):
            world.step()
            speeds.append(velocity(world, light) - (2.0, 0.0))
            assert np.abs(speeds[-1]).max() <= 9.0
        assert np.abs(speeds[-1]).max() < 1e-9
        assert abs(turned(world, spinner)) < 1e-9


@both_dimensions
def test_wind_pushes_what_is_in_it_up_to_its_terminal_velocity(d):
    world = world_of(d, Parts(), gravity=0.0)
    zone(world, Wind(flat(d, 6.0)), half=(1000.0, 5.0), mask=1)
    body = RigidBody(2.0, linear_damping=1.5)
    inside = world.create_entity(Transform(flat(d)), body, SphereCollider(0.5))
    touching = world.create_entity(Transform(flat(d, 0.0, 5.4)), RigidBody(2.0), SphereCollider(0.5))
    limited = world.create_entity(Transform(flat(d, 0.0, 2.0)), RigidBody(max_linear_speed=0.5), SphereCollider(0.5))
    pair = world.create_entity(Transform(flat(d, 0.0, -2.0)), RigidBody(3.0))
    for x in (-1.0, 1.0):
        world.create_entity(PartOf(pair, position=flat(d, x), mass=0.0), SphereCollider(0.25))
    left = [
        world.create_entity(Transform(flat(d, 0.0, 5.6)), RigidBody(), SphereCollider(0.5)),
        world.create_entity(Transform(flat(d, -9.0)), RigidBody(), SphereCollider(0.5, layer=2)),
        world.create_entity(Transform(flat(d, -12.0)), RigidBody(), SphereCollider(0.5, sensor=True)),
        world.create_entity(Transform(flat(d, -15.0)), RigidBody(kind="kinematic"), SphereCollider(0.5)),
    ]
    run(world, 60)
    np.testing.assert_allclose(velocity(world, inside), flat(d, 2.0 * -math.expm1(-1.5)), rtol=1e-12)
    np.testing.assert_allclose(velocity(world, touching), flat(d, 3.0), rtol=1e-12)
    np.testing.assert_allclose(velocity(world, pair), flat(d, 2.0), rtol=1e-12)  # once for all of its parts
    np.testing.assert_allclose(velocity(world, limited), flat(d, 0.5), rtol=1e-12)
    assert not any(velocity(world, each).any() for each in left)
    run(world, 1200)
    np.testing.assert_allclose(velocity(world, inside), flat(d, 2.0), rtol=1e-12)


ORBITS = [
    ("explicit_euler", None),
    ("semi_implicit_euler", 2e-2),
    ("velocity_verlet", 2e-3),
    ("rk4", 1e-6),
    ("yoshida4", 1e-5),
]


@pytest.mark.slow
@pytest.mark.parametrize(("integrator", "error"), ORBITS[1:])
@mostly_2d
def test_orbits_close_as_well_as_the_method_is(d, integrator, error):
    """An ellipse with falloff 2 and of a third of its axis in eccentricity: where it was after four rounds of T = 2 pi
    sqrt(a^3 / k), by energy; the place is right to a part of the way that the method's order says."""
    k, a, e = 16.0, 4.0, 1 / 3
    world = world_of(d, gravity=0.0, integrator=integrator, dt=2.0 * math.pi * math.sqrt(a**3 / k) / 800)
    entity = world.create_entity(Transform(flat(d)), SphereCollider(20.0, sensor=True), Field(k))
    start, speed = a * (1.0 - e), math.sqrt(k / a * (1.0 + e) / (1.0 - e))
    moon = ball(world, flat(d, start), flat(d, 0.0, speed), radius=0.1, mass=3.0)
    for _ in range(3200):
        world.step()
    v, r = velocity(world, moon), np.linalg.norm(position(world, moon))
    assert 0.5 * v @ v - k / r == pytest.approx(-k / (2.0 * a), rel=0.4 * error)
    assert np.linalg.norm(position(world, moon) - flat(d, start)) < 8.0 * math.pi * a * error
    assert world.has_component(entity, Field)


def test_fields_of_other_falloffs():
    """The same everywhere; repelling, by energy; and in the core a spring with that period."""
    settings = {"gravity": 0.0, "integrator": "rk4"}
    world = world_of(**settings)
    world.create_entity(Transform((0, 0)), SphereCollider(100.0, sensor=True), Field(-3.0, 0.0))
    away = ball(world, (2.0, 0.0))
    run(world, 60)
    np.testing.assert_allclose(position(world, away), (3.5, 0.0), rtol=1e-12)
    world = world_of(**settings)
    world.create_entity(Transform((0, 0)), SphereCollider(100.0, sensor=True), Field(-4.0, 2.0))
    away = ball(world, (2.0, 0.0))
    run(world, 120)
    assert 0.5 * velocity(world, away)[0] ** 2 == pytest.approx(4.0 * (0.5 - 1.0 / position(world, away)[0]), rel=1e-7)
    world = world_of(**settings, dt=2.0 * math.pi / 200)
    world.create_entity(
        Transform((1.0, 0)), SphereCollider(3.0, offset=(-1.0, 0.0), sensor=True), Field(8.0, 2.0, core=2.0)
    )
    swings = ball(world, (1.5, 0.0), radius=0.1)  # a = 8 / 2^2 r / 2 = r
    run(world, 400)
    np.testing.assert_allclose(position(world, swings), (1.5, 0.0), rtol=0, atol=1e-5)


def test_what_floats_sleeps_until_the_water_changes_and_wind_wakes():
    world = world_of(sleeping=True)
    sea = zone(world, Water(1000.0, 4.0))
    rafts = [box(world, (3.0 * k, 5.0), mass=300.0) for k in range(3)]
    world.create_entity(Transform((-20.0, 20.0)), AABBCollider((5.0, 1.0)))
    dry = box(world, (-20.0, 21.5), friction=0.2)
    run(world, 700)
    assert world.bodies.dynamic.asleep.all()
    before = position(world, rafts[0])
    run(world, 100)
    assert np.array_equal(position(world, rafts[0]), before)
    world.component_for_entity(sea, Water).density = 900.0
    world.step()
    asleep = dict(zip(world.bodies.dynamic.entity.tolist(), world.bodies.dynamic.asleep.tolist(), strict=True))
    assert asleep == {**dict.fromkeys(rafts, False), dry: True}
    gust = zone(world, Wind((5.0, 0.0)), half=(10.0, 5.0), at=(-20.0, 22.0))
    run(world, 30)
    assert velocity(world, dry)[0] == pytest.approx((5.0 - 0.2 * G) * 29 * DT, abs=1.001 * (5.0 - 0.2 * G) * DT)
    world.delete_entity(gust)
    run(world, 300)
    assert world.component_for_entity(dry, RigidBody).asleep


def test_snapshots_and_files_go_on_to_the_bit(tmp_path):
    world = world_of()
    for component in (Water(1000.0, 1.0, (0.5, 0.0)), Wind((50.0, 0.0)), Field(5.0, 1.0)):
        zone(world, component)
    for k in range(5):
        box(world, (3.0 * k, 5.0), mass=300.0)
        world.create_entity(Transform((3.0 * k, 8.0), 0.3), RigidBody(300.0), Spin(), BoxCollider((0.6, 0.4)))
    run(world, 50)
    kept = world.snapshot()
    world.save(tmp_path / "sea")
    run(world, 50)
    hashes = [world.state_hash()]
    world.restore(kept)
    run(world, 50)
    other = World.load(tmp_path / "sea", Physics(2), Rotation(), Zones())
    run(other, 50)
    assert hashes == [world.state_hash()] == [other.state_hash()]


# -- explosions -----------------------------------------------------------------------------------


@mostly_2d
def test_an_impulse_falls_off_to_the_place_that_is_nearest(d):
    """Balls, a box by its side and by its corner, and one that turns; the sum is the momentum, and the angular one."""
    world = world_of(d, gravity=0.0)
    balls = {ball(world, flat(d, x, 0.5), radius=0.5, mass=2.0): abs(x) - 0.5 for x in (2.0, -3.0)}
    side, corner, far = box(world, flat(d, 0.0, -3.0)), box(world, flat(d, 2.5, 2.5)), box(world, flat(d, 9.0))
    where = Transform(flat(d, -2.0, 2.5))
    spinner = world.create_entity(
        where, RigidBody(2.0), Spin(inertia=2.0 if d == 2 else (2.0,) * 3), BoxCollider((1.0,) * d)
    )
    still = box(world, flat(d, 5.0, 0.0), kind="static")
    point = np.array(flat(d, 0.0, 0.5))
    hit = explode(world, point, 4.0, 10.0)
    assert hit == sorted([*balls, side, corner, spinner])
    pushes = {}
    for entity, distance in balls.items():
        pushes[entity] = flat(d, math.copysign(10.0 * (1.0 - distance / 4.0), position(world, entity)[0]))
    pushes[side] = flat(d, 0.0, -10.0 * (1.0 - 3.0 / 4.0))
    for entity, place in ((corner, (2.0, 2.0)), (spinner, (-1.0, 1.5))):
        way = np.array(flat(d, *place)) - point
        size = np.linalg.norm(way)
        pushes[entity] = 10.0 * (1.0 - size / 4.0) * way / size
    for entity, push in pushes.items():
        mass = world.component_for_entity(entity, RigidBody).mass
        np.testing.assert_allclose(velocity(world, entity) * mass, push, rtol=0, atol=1e-9)
    np.testing.assert_allclose(world.momentum(), sum(map(np.array, pushes.values())), rtol=0, atol=1e-9)
    turn = turned(world, spinner) if d == 2 else turned(world, spinner)[2]
    push, arm = pushes[spinner], np.array(flat(d, 1.0, -1.0))
    assert turn == pytest.approx((arm[0] * push[1] - arm[1] * push[0]) / 2.0, abs=1e-9)
    assert not velocity(world, far).any()
    assert not velocity(world, still).any()


def test_what_a_ray_meets_shields_but_sensors_and_what_holds_the_bomb():
    world = world_of(2, Parts(), gravity=0.0)
    bomb, open_, behind = ball(world, (0.0, 0.0), radius=0.3), ball(world, (0.0, 2.0)), ball(world, (3.0, 0.0))
    box(world, (1.5, 0.0), half=(0.2, 1.0), kind="static")
    zone(world, Wind((0.0, 0.0)), half=(0.1, 5.0), at=(-1.0, 0.0))
    seen = ball(world, (-2.0, 0.0))
    frame = world.create_entity(Transform((0.0, -2.0)), RigidBody())
    for y in (-0.6, 0.6):
        world.create_entity(PartOf(frame, position=(0.0, y)), SphereCollider(0.3))
    assert explode(world, (0.0, 0.1), 4.0, 5.0, shielded=True) == sorted([bomb, open_, seen, frame])
    assert not velocity(world, behind).any()
    assert velocity(world, frame)[1] == pytest.approx(-5.0 * (1.0 - 1.2 / 4.0) / 3.0)  # its nearest part, once
    assert behind in explode(world, (0.0, 0.1), 4.0, 5.0)
    assert explode(world, (0.0, 0.1), 4.0, 5.0, mask=2) == []


@both_dimensions
def test_an_explosion_pushes_sensors_too_but_no_zone_that_a_body_carries(d):
    world = world_of(d, Parts(), gravity=0.0)
    gem, solid = (world.create_entity(Transform(flat(d, x)), RigidBody(), SphereCollider(0.5, sensor=x > 0))
                  for x in (2.0, -2.0))  # fmt: skip
    guard = ball(world, flat(d, 0.0, 6.0))
    world.create_entity(PartOf(guard), SphereCollider(8.0, sensor=True))
    world.create_entity(Transform(flat(d, 0.0, -2.0)), RigidBody())  # nothing that could be hit
    assert explode(world, flat(d, 0.0), 4.0, 5.0) == sorted([gem, solid])
    np.testing.assert_array_equal(velocity(world, gem), -velocity(world, solid))


def test_an_explosion_wakes():
    world = world_of(sleeping=True)
    box(world, (0.0, -1.0), half=(50.0, 1.0), kind="static")
    crate = box(world, (0.0, 0.5))
    run(world, 100)
    assert world.component_for_entity(crate, RigidBody).asleep
    assert explode(world, (-1.5, 0.5), 3.0, -2.0) == [crate]  # it pulls
    world.step()
    assert velocity(world, crate)[0] < -0.5


def test_what_cannot_be_is_refused():
    with pytest.raises(
        NoPhysicsError, match=r"plugin zones needs physics before it: World\(Physics\(...\), Zones\(\)\)"
    ):
        World(Zones())
    with pytest.raises(ValueError, match=r"Wind does nothing without its plugin: .*Zones"):
        World(Physics(2)).create_entity(Transform((0, 0)), SphereCollider(1.0), Wind((1, 0)))
    world = world_of()
    with pytest.raises(ValueError, match="Water acts on what is in a collider, and its entity has none"):
        world.create_entity(Transform((0, 0)), Water(1.0))
    for make, field in (
        (lambda: Wind((math.nan, 0)), "Wind.force must be finite"), (lambda: Wind("east"), "Wind.force must be numb"),
        (lambda: Water(-1.0), "Water.density must be at least 0"), (lambda: Water(1.0, -2.0), "Water.drag must be at"),
        (lambda: Water(1.0, flow=(1, math.inf)), "Water.flow must be finite"),
        (lambda: Field(math.inf), "Field.strength must be finite"), (lambda: Field(1.0, -1.0), "Field.falloff must be"),
        (lambda: Field(1.0, core=0.0), "Field.core must be positive"),
        (lambda: explode(world, (0, 0, 0), 1.0, 1.0), "explode: point must be 2 finite numbers"),
        (lambda: explode(world, None, 1.0, 1.0), "explode: point must be 2 finite numbers"),
        (lambda: explode(world, (0, 0), 0.0, 1.0), "explode: radius must be a finite number above 0, got 0.0"),
        (lambda: explode(world, (0, 0), 1.0, math.nan), "explode: impulse must be a finite number, got nan"),
        (lambda: explode(world, (0, 0), 1.0, True), "explode: impulse must be a finite number, got True"),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=field):
            make()
    with pytest.raises(ValueError, match=r"Wind\.force must have 2 components"):
        world.create_entity(Transform((0, 0)), SphereCollider(1.0, sensor=True), Wind((1, 0, 0)))
