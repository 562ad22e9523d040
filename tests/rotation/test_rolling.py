"""Round bodies that spin, in contact: rolling, slipping and impacts with friction, against closed forms and laws."""

from __future__ import annotations

import math

import numpy as np
import pytest
from rotation.helpers_turning import G, ball, box, part, pose, turning_world
from worlds import MODES, run

from carom.components import AABBCollider, Collider, RigidBody, SphereCollider, Transform
from carom.framework import Plugin, Settings, World, column
from carom.framework.vectors import add_scaled, dot, length, scale
from carom.plugins import Physics
from carom.plugins.rotation import BoxCollider, Rotation, Spin

SHARE = {2: 1 / 2, 3: 2 / 5}  # inertia of a disc and a ball, over m r^2


def plane(d, slope=0.0, friction=1.0, gravity=G, **settings):
    """A world in which the ground is level and gravity leans by ``slope``."""
    world = turning_world(d, (gravity * math.sin(slope), -gravity * math.cos(slope), 0.0)[:d], **settings)
    ground = AABBCollider((500, 1, 50)[:d], friction=friction)
    world.create_entity(Transform((0, -1, 0)[:d]), RigidBody(kind="static"), ground)
    return world


def motion(world, entity):
    """(velocity, angular velocity as a vector of 3)."""
    w = part(world, entity, Spin).angular_velocity
    return np.array(part(world, entity, RigidBody).linear_velocity), np.array((0, 0, w) if np.ndim(w) == 0 else w)


def driver(world, place, spin, collider):
    """A kinematic body that turns, in space about the third axis."""
    about = spin if len(place) == 2 else (0.0, 0.0, spin)
    return world.create_entity(Transform(place), RigidBody(kind="kinematic"), Spin(about), collider)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("d", [2, 3])
def test_contacts_leave_nothing_faster_than_its_limit(d, mode):
    """Balls and boxes that skid at 12 m/s and would roll with 20 rad/s: after impacts and at rest, in each step."""
    with plane(d, collision=mode) as world:
        for k in range(4):
            shape = BoxCollider((0.5, 0.4, 0.3)[:d], restitution=0.3) if k % 2 else SphereCollider(0.5, restitution=0.5)
            spin = Spin(1 if d == 2 else (0, 0, 1), max_angular_speed=2)
            world.create_entity(Transform((0, 2 + 1.5 * k, 0)[:d]), RigidBody(1, (12, -3, 1)[:d]), spin, shape)
        fastest = []
        for _ in range(120):
            world.step()
            w = world.bodies.dynamic.spin.angular_velocity.reshape(4, -1)
            fastest.append(np.linalg.norm(w, axis=1).max())
    assert max(fastest) == pytest.approx(2, rel=1e-14)


@pytest.mark.parametrize("d", [2, 3])
def test_rolling_friction_stops_a_ball_and_holds_it_on_a_slope(d):
    """On level ground it slows by (b / r) g / (1 + I / m r^2); it stays where tan a < b / r, 1 % to either side."""
    r, b = 0.5, 0.02
    for slope, start, steps in ((0.0, 2.0, 60), (0.99 * b / r, 0.0, 120), (1.01 * b / r, 0.0, 120)):
        with plane(d, math.atan(slope)) as world:
            entity = ball(world, (0, r, 0)[:d], (start, 0, 0)[:d], -start / r, mass=2.0)
            part(world, entity, Spin).rolling_friction = b
            run(world, steps)
            v, w = motion(world, entity)
        if start:
            assert v[0] == pytest.approx(start - b / r * G / (1 + SHARE[d]), rel=1e-3)
            assert w[2] == pytest.approx(-v[0] / r, rel=1e-3)
        else:
            assert v[0] < 1e-3 if slope < b / r else v[0] > 4e-3  # m/s: of the first steps


@pytest.mark.parametrize("by", ["component", "held column"])
@pytest.mark.parametrize("d", [2, 3])
def test_ground_with_rolling_friction_stops_what_rolls_on_it(d, by):
    """Static ground of length b, a ball of a smaller one: it stops after v^2 / 2 a, a = (b / r) g / (1 + I / m r^2).
    Then b is three times as long, and later 0: the ball's own is left."""
    r, b, own, v0 = 0.5, 0.03, 0.01, 1.0
    with turning_world(d, (0, -G, 0)[:d]) as world:
        shape = BoxCollider((50, 1, 50)[:d], friction=1.0)
        spin = Spin(rolling_friction=b)
        ground = world.create_entity(Transform((0, -1, 0)[:d]), RigidBody(kind="static"), spin, shape)
        entity = ball(world, (0, r, 0)[:d], (v0, 0, 0)[:d], -v0 / r, mass=2.0)
        part(world, entity, Spin).rolling_friction = own
        column = world.bodies.spin.rolling_friction
        for length in (b, 3 * b, 0.0):
            if by == "component":
                part(world, ground, Spin).rolling_friction = length
            else:
                column[world.bodies.row_of(ground)] = length
            start, seconds = part(world, entity, Transform).x, v0 * r * (1 + SHARE[d]) / (max(length, own) * G)
            part(world, entity, RigidBody).linear_velocity = (v0, 0, 0)[:d]
            part(world, entity, Spin).angular_velocity = -v0 / r if d == 2 else (0, 0, -v0 / r)
            run(world, math.ceil(60 * seconds) + 30)
            assert part(world, entity, Transform).x - start == pytest.approx(v0 * seconds / 2, rel=0.02)
            assert np.abs(motion(world, entity)[0]).max() < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("d", [2, 3])
def test_on_a_slope_it_rolls_or_slips_as_newton_says(d, mode):
    """g sin a / (1 + I / m r^2) while tan a < mu (1 + m r^2 / I), else g (sin a - mu cos a): 1 % to either side. The
    forces are constant, so the solver is exact but for the first step. While it rolls the angle follows the way."""
    mu, seconds, r = 0.2, 1.0, 0.5
    for times in (0.1, 0.5, 0.99, 1.01, 1.5):
        slope = math.atan(times * mu * (1 + 1 / SHARE[d]))
        with plane(d, slope, mu, collision=mode) as world:
            entity = ball(world, (0, r, 0)[:d], mass=2.0, friction=mu)
            run(world, 60)
            v, w = motion(world, entity)
            x, q = pose(world, entity)[0], pose(world, entity)[d:]
        rolls = G * math.sin(slope) / (1 + SHARE[d])
        slips = G * (math.sin(slope) - mu * math.cos(slope))
        assert v[0] == pytest.approx(seconds * (rolls if times < 1 else slips), rel=1e-3)
        slip = v[0] + r * w[2]
        assert (abs(slip) < 1e-9) == (times < 1), slip
        if times == 0.1:  # less than a turn
            assert -r * (q[0] if d == 2 else 2 * math.atan2(q[3], q[0])) == pytest.approx(x, rel=1e-3)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("spin", [0.0, 30.0, -30.0])
def test_a_ball_that_slides_comes_to_roll_with_the_momentum_about_the_ground(d, spin):
    """m r v + I w about a point of the ground stays: v = (v0 - k r w0) / (1 + k), k = I / m r^2."""
    with plane(d, friction=0.3) as world:
        entity = ball(world, (0, 0.5, 0)[:d], (4.0, 0, 0)[:d], spin, mass=2.0, friction=0.3)
        run(world, 240)
        v, w = motion(world, entity)
    k = SHARE[d]
    assert v[0] == pytest.approx((4.0 - k * 0.5 * spin) / (1 + k), rel=1e-9)
    assert v[0] + 0.5 * w[2] == pytest.approx(0, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("seed", range(4))
def test_a_bounce_with_spin_is_that_of_coulomb(seed, d, mode):
    """Normal: -e v. Along the wall: what slips is stopped, by at most mu (1 + e) v; the spin takes its share. The last
    one is elastic, and so rough that it rolls: no slip is given back, as by a superball."""
    random = np.random.default_rng(seed)
    e, mu = (1.0, 100.0) if seed == 3 else (random.uniform(0.3, 1.0), random.uniform(0.02, 0.6))
    v0, w0 = random.uniform(-3, 3, 3), random.uniform(-15, 15, 3)
    v0[1] = -6.0
    if d == 2:
        v0[2] = w0[0] = w0[1] = 0.0
    with plane(d, friction=mu, gravity=0.0, collision=mode) as world:
        spin = w0[2] if d == 2 else w0
        entity = ball(world, (0, 1.0, 0)[:d], v0[:d], spin, mass=2.0, friction=mu, restitution=e)
        run(world, 30)
        v, w = motion(world, entity)
    n, r = np.array((0.0, 1.0, 0.0)), 0.5
    slip = v0 + np.cross(w0, -r * n)
    slip[1] = 0.0
    push = slip / np.linalg.norm(slip) * min(np.linalg.norm(slip) / (1 + 1 / SHARE[d]), mu * (1 + e) * 6.0)
    after = v0 - push
    after[1] = 6.0 * e
    assert np.allclose(np.append(v, 0)[:3], after, rtol=1e-9, atol=1e-9)
    assert np.allclose(w, w0 + np.cross(-r * n, -push) / (SHARE[d] * r * r), rtol=1e-9, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
def test_a_wheel_that_turns_drives_what_lies_on_it(mode):
    """A ball between two kinematic wheels that turn alike comes to turn the other way, as fast at its surface; on two
    that stand still it comes to rest."""
    for height, spin, x in ((0.9, -3.0, 0.0), (0.95, -3.0, 0.0), (1.0, -3.0, 0.0), (1.3, -3.0, 0.0), (0.95, 0.0, 0.02)):
        with turning_world(2, G, collision=mode) as world:
            for side in (-0.8, 0.8):
                driver(world, (side, 0), spin, SphereCollider(0.7, friction=1.0))
            entity = ball(world, (x, height), mass=2.0, friction=1.0)
            run(world, 240 if spin else 600)
            v, w = motion(world, entity)
            assert w[2] == pytest.approx(-spin * 0.7 / 0.5, rel=1e-9, abs=1e-9)
            assert abs(part(world, entity, Transform).x) < 1e-9 or not spin
            assert np.abs(v).max() < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("d", [2, 3])
def test_a_bar_that_turns_throws_with_the_speed_of_its_points(d, mode):
    """v' = u + e (u - v) with u = w r where it strikes, within the turn of the bar in two steps."""
    for e, w, r in ((0.5, 1.0, 2.0), (1.0, 0.5, 1.0), (0.8, -0.6, -1.5)):
        with turning_world(d, collision=mode) as world:
            driver(world, (0, 0, 0)[:d], w, BoxCollider((3, 0.1, 1)[:d], restitution=e))
            body = RigidBody(linear_velocity=(0, -2.0, 0)[:d])
            entity = world.create_entity(Transform((r, 0.34, 0)[:d]), body, SphereCollider(0.2, restitution=e))
            run(world, 12)
            v = part(world, entity, RigidBody).linear_velocity
        u = abs(w * r)
        assert v[1] == pytest.approx(u + e * (u + 2.0), rel=0.02)


@pytest.mark.parametrize("mode", MODES)
def test_a_bar_that_turns_slowly_lifts_and_carries(mode):
    """A ball that cannot slip has the velocity of the point that it touches, below its centre; it stays on the bar.

    Its surface is taken as it is turned where the step ends: half a turn of a step too far, so w dt / 2 of w r t off.
    """
    w, mu = 0.2, 2.0
    with turning_world(2, G, collision=mode) as world:
        driver(world, (0, 0), w, BoxCollider((3, 0.1), friction=mu))
        entity = world.create_entity(Transform((2, 0.3)), RigidBody(), SphereCollider(0.2, friction=mu))
        for step in range(90):
            world.step()
            x, y = part(world, entity, Transform).position
            angle = w * (step + 1) / 60
            assert -math.sin(angle) * x + math.cos(angle) * y == pytest.approx(0.3, abs=1e-3)
        along = math.cos(angle) * x + math.sin(angle) * y
        assert along == pytest.approx(2.0 + 0.2 * w * 1.5, abs=1.5 * w / 120 * w * 2.0 * 1.5)
        assert not world.faults


@pytest.mark.plain
def test_what_turns_farther_than_contacts_can_follow_is_told():
    with turning_world(on_fault="ignore") as world:
        entity = driver(world, (0, 0), 70.0, BoxCollider((1, 0.1), offset=(1, 0)))
        world.create_entity(Transform((1.8, 0.4)), RigidBody(), SphereCollider(0.1))
        world.step()
        assert any(f"entity {entity}: turns so far in a step" in text for text in world.faults)


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(
    ("half", "r", "w", "e"), [(0.1, 0.2, 15.0, 0.0), (0.1, 0.2, 15.0, 0.5), (0.05, 0.1, 25.0, 0.0),
                              (0.02, 0.05, 20.0, 0.0)],
)  # fmt: skip
def test_no_flipper_passes_the_ball_that_it_throws(half, r, w, e, mode):
    """Wherever that lies, and though it turns in a step by several times their thickness farther out: the ball is on
    its face, a twentieth of its width deep at most, as long as it is beside it; and it is as fast as the point that
    throws it."""
    c, s, up = math.cos(-0.4), math.sin(-0.4), half + r + 0.01
    for where in (0.4, 0.8, 1.1, 1.4, 1.8):
        with turning_world(2, G, collision=mode, on_fault="ignore") as world:
            shape = BoxCollider((1, half), offset=(1, 0), restitution=e)
            flipper = world.create_entity(Transform((0, 0), -0.4), RigidBody(kind="kinematic"), Spin(0.0), shape)
            place = Transform((where * c - s * up, where * s + c * up))
            entity = world.create_entity(place, RigidBody(), SphereCollider(r, restitution=e))
            world.step()
            spin, fastest = part(world, flipper, Spin), 0.0
            spin.angular_velocity = w
            for _ in range(5):
                world.step()
                _, _, angle = pose(world, flipper)
                x, y = part(world, entity, Transform).position
                fastest = max(fastest, part(world, entity, RigidBody).linear_velocity[1])
                along, above = math.cos(angle) * x + math.sin(angle) * y, math.cos(angle) * y - math.sin(angle) * x
                assert above > half + r - 0.11 * r or not 0 < along < 2
            assert fastest > (0.85 if e else 0.95) * w * where


@pytest.mark.parametrize("mass", [100.0, 1000.0])
def test_friction_goes_on_to_turn_what_slips_in_place_under_a_heavy_body(mass):
    """In a corner, with mu at floor and wall: r mu m g (1 + mu) / (1 + mu^2). The bodies rest to rounding, and the
    substeps of an island that rests are not all solved."""
    mu, r = 0.1, 0.5
    with plane(2, friction=mu) as world:
        world.create_entity(Transform((-1.5, 0)), RigidBody(kind="static"), AABBCollider((1, 9), friction=mu))
        entity = ball(world, (0, r), 0.0, 1e6, friction=mu)
        world.create_entity(Transform((0, 1.5)), RigidBody(mass), AABBCollider((0.45, 0.5), friction=0.0))
        run(world, 1200)
        before = motion(world, entity)[1][2]
        run(world, 60)
        lost = before - motion(world, entity)[1][2]
    assert lost == pytest.approx(r * mu * (mass + 1) * G * (1 + mu) / (1 + mu * mu) / (r * r / 2), rel=1e-3)


@pytest.mark.parametrize("mode", MODES)
def test_a_ball_with_other_inertia_about_each_axis_rolls_as_the_one_about_its_spin_says(mode):
    """I w0 = (I + m r^2) w, about the ground; I the largest, about which a free body turns steadily."""
    with plane(3, collision=mode) as world:
        entity = ball(world, (0, 0.5, 0), spin=-20.0, mass=2.0)
        part(world, entity, Spin).inertia = (0.2, 0.2, 0.3)
        run(world, 60)
        v, w = motion(world, entity)
    assert v == pytest.approx((0.5 * 20 * 0.3 / (0.3 + 2 * 0.25), 0, 0), rel=1e-4, abs=1e-9)
    assert w == pytest.approx((0, 0, -2 * v[0]), rel=1e-4, abs=1e-9)


def test_a_box_within_a_sphere_that_only_sorts_out_pairs_does_not_roll():
    found = []
    for around in ((), (SphereCollider(1.0, friction=0.3),)):
        with plane(2, friction=0.3) as world:
            entity = box(world, (0, 0.5), (0.5, 0.5), (5, 0), friction=0.3)
            part(world, entity, Spin).inertia = 0.1
            for collider in around:
                world.add_component(entity, collider)
            run(world, 20)
            found.append((*motion(world, entity)[0], *motion(world, entity)[1]))
    assert found[0] == found[1]


rocking = Plugin("rocking")


@rocking.shape(cost=4)
class EllipseCollider(Collider):
    """A smooth shape that is not round, with these half axes."""

    rotates = True
    dimensions = (2,)
    semi = column(item="vector", positive=True)

    @staticmethod
    def support(shape, direction):
        x, y = shape.semi[0] * dot(shape.axes[0], direction), shape.semi[1] * dot(shape.axes[1], direction)
        size = length((x, y))
        return add_scaled(scale(shape.axes[0], shape.semi[0] * x / size), shape.axes[1], shape.semi[1] * y / size)

    @staticmethod
    def bounds(shape, dimensions):
        (a, b), (u, v) = (shape.semi[0], shape.semi[1]), (shape.axes[0], shape.axes[1])
        return length((a * u[0], b * v[0])), length((a * u[1], b * v[1]))

    @staticmethod
    def second_moments(shape, dimensions):
        a, b = shape.semi[0], shape.semi[1]
        return math.pi * a * b, 0.0, 0.0, a * a / 4.0, 0.0, b * b / 4.0


@pytest.mark.slow
def test_an_ellipse_that_rocks_loses_what_the_page_says():
    """Of first order in dt, and never more than it had: docs/plugins/rotation.md."""
    shares = []
    for rate in (60, 120, 240, 960):
        settings = Settings(integrator="velocity_verlet", dt=1 / rate)
        with World(Physics(2, gravity=(0, -10)), Rotation(), rocking, settings=settings) as world:
            ground = BoxCollider((50, 1), friction=1.0)
            world.create_entity(Transform((0, -1)), RigidBody(kind="static"), ground)
            height = math.hypot(math.sin(0.4), 0.5 * math.cos(0.4))
            world.create_entity(Transform((0, height), 0.4), RigidBody(), Spin(), EllipseCollider((1.0, 0.5)))
            energy = [world.kinetic_energy() + world.potential_energy() - 5.0]
            for _ in range(5 * rate):
                world.step()
                energy.append(world.kinetic_energy() + world.potential_energy() - 5.0)
            shares.append(energy[-1] / energy[0])
            assert max(energy) <= 1.001 * energy[0]
    assert shares == pytest.approx((0.32, 0.57, 0.76, 0.94), abs=0.02)
