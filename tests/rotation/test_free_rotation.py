"""Bodies that turn without contacts, against closed forms: what torques and damping do, and the free top in 3D."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scipy.special import ellipj, ellipkinc

from carom.components import RigidBody, SphereCollider, Transform
from carom.framework import Settings, World
from carom.plugins import Physics
from carom.plugins.rotation import BoxCollider, Rotation, Spin

pytestmark = pytest.mark.plain
METHODS = {"explicit_euler": 1, "semi_implicit_euler": 1, "velocity_verlet": 2, "yoshida4": 4, "rk4": 4}
# Of the free top: splitting is of order 2 whatever the order of torques.
FREE_ORDER = {"explicit_euler": 2, "semi_implicit_euler": 2, "velocity_verlet": 2, "yoshida4": 4, "rk4": 4}


def space(d, dt=1 / 60, method="velocity_verlet", **settings):
    return World(Physics(d, gravity=0), Rotation(), settings=Settings(dt=dt, integrator=method, **settings))


def turned(q, v):
    """The vector v, turned by the quaternion q."""
    w, u = q[0], np.asarray(q[1:])
    return v + 2 * w * np.cross(u, v) + 2 * np.cross(u, np.cross(u, v))


# -- in a plane -----------------------------------------------------------------------------------


@pytest.mark.parametrize("damping", [0.0, 0.7])
@pytest.mark.parametrize("method", METHODS)
def test_a_constant_torque_in_a_plane(method, damping):
    """w' = t/I - c w: the velocity is exact in every method, the angle from order 2 on; Euler's are wrong by c dt."""
    inertia, torque, w0, seconds = 0.7, 1.9, -3.0, 1.0
    with space(2, method=method) as world:
        entity = world.create_entity(
            Transform((3, 4)), RigidBody(), Spin(w0, inertia, angular_damping=damping, constant_torque=torque)
        )
        for _ in range(60):
            world.step()
        a, c, t = torque / inertia, damping, seconds
        w = w0 * math.exp(-c * t) + (a / c * (1 - math.exp(-c * t)) if c else a * t)
        angle = ((w0 - w) / c + a / c * t) if c else w0 * t + a * t * t / 2
        assert world.component_for_entity(entity, Spin).angular_velocity == pytest.approx(w, rel=1e-12)
        error = world.component_for_entity(entity, Transform).rotation - angle
        bound = 1e-12 if METHODS[method] > 1 else (abs(w - w0) + c * seconds * abs(w0)) / 60
        assert abs(error) <= bound
        assert METHODS[method] > 1 or abs(error) > 1e-3


def test_the_limit_holds_for_what_torques_make_and_for_the_turn():
    with space(2) as world:
        entity = world.create_entity(
            Transform((0, 0)), RigidBody(), Spin(0, 0.1, constant_torque=100, max_angular_speed=2)
        )
        for step in range(30):
            world.step()
            assert abs(world.component_for_entity(entity, Spin).angular_velocity) <= 2
            assert abs(world.component_for_entity(entity, Transform).rotation) <= 2 * (step + 1) / 60 + 1e-12


# -- the free top ---------------------------------------------------------------------------------


def top_at(moments, w0, t):
    """Angular velocity along the body's axes at time t of a free top (Landau and Lifshitz, Mechanics, 37).

    moments ascend, and it turns about the middle axis mostly: 2 T I2 < L^2, and no component is 0.
    """
    i1, i2, i3 = moments
    energy2, l2 = (
        sum(i * w * w for i, w in zip(moments, w0, strict=True)),
        sum((i * w) ** 2 for i, w in zip(moments, w0, strict=True)),
    )
    assert l2 > energy2 * i2
    amplitude = (
        math.sqrt((energy2 * i3 - l2) / (i1 * (i3 - i1))), math.sqrt((energy2 * i3 - l2) / (i2 * (i3 - i2))),
        math.sqrt((l2 - energy2 * i1) / (i3 * (i3 - i1))),
    )  # fmt: skip
    k2 = (i2 - i1) * (energy2 * i3 - l2) / ((i3 - i2) * (l2 - energy2 * i1))
    rate = math.sqrt((i3 - i2) * (l2 - energy2 * i1) / (i1 * i2 * i3))
    # s, c, d at t = 0 with signs: w1 = A c, w2 = B s, w3 = C d up to signs that the equations of motion fix
    s0 = w0[1] / amplitude[1]
    phase = ellipkinc(math.asin(max(-1.0, min(1.0, s0))), k2)
    sign1, sign3 = math.copysign(1, w0[0]), math.copysign(1, w0[2])
    # dw2/dt = (i3 - i1) / i2 w3 w1, in the standard solution w1 w3 > 0 makes s grow
    s, c, d, _ = ellipj(phase + sign1 * sign3 * rate * t, k2)
    return np.array((sign1 * amplitude[0] * c, amplitude[1] * s, sign3 * amplitude[2] * d))


MOMENTS, START = (1.0, 2.0, 3.0), (0.4, 1.1, 1.3)


def spin_top(method, dt, seconds, w0=START, moments=MOMENTS):
    """(angular velocity along its own axes, quaternion, angular momentum before and after along the world's axes)."""
    with space(3, dt, method) as world:
        entity = world.create_entity(Transform((0, 0, 0)), RigidBody(), Spin(w0, moments))
        for _ in range(round(seconds / dt)):
            world.step()
        q = np.array(world.component_for_entity(entity, Transform).rotation)
        w = turned((q[0], *-q[1:]), np.array(world.component_for_entity(entity, Spin).angular_velocity))
    return w, q, np.multiply(moments, w0), turned(q, np.multiply(moments, w))


@pytest.mark.compiled
@pytest.mark.parametrize("method", METHODS)
def test_the_free_top_is_that_of_jacobis_functions_at_the_order_of_the_method(method):
    """Three steps of a third each: the slope of the error over dt is the order within .15."""
    steps = (1 / 15, 1 / 30, 1 / 60)
    errors = [np.linalg.norm(spin_top(method, dt, 4.0)[0] - top_at(MOMENTS, START, 4.0)) for dt in steps]
    orders = [math.log2(one / two) for one, two in itertools.pairwise(errors)]
    assert orders[-1] == pytest.approx(FREE_ORDER[method], abs=0.15), (errors, orders)


@pytest.mark.compiled
@pytest.mark.parametrize("method", ["semi_implicit_euler", "velocity_verlet", "yoshida4"])
def test_momentum_energy_and_the_quaternions_length_stay(method):
    """100 s at 60 Hz: to 1e-12 of themselves."""
    w, q, before, after = spin_top(method, 1 / 60, 100.0)
    assert np.linalg.norm(after - before) <= 1e-12 * np.linalg.norm(before)
    assert abs(np.linalg.norm(q) - 1) <= 1e-14
    energy, start = np.dot(MOMENTS, w * w), np.dot(MOMENTS, np.square(START))
    assert abs(energy / start - 1) <= 1e-12


@pytest.mark.compiled
@pytest.mark.parametrize("turn", [0.5, 2.0, 5.0])
@pytest.mark.parametrize("method", ["velocity_verlet", "rk4"])
def test_what_turns_far_in_a_step_keeps_its_energy(method, turn):
    """Sixty boxes with edges to 1:30, by so many rad in each of 120 steps: at all times to 1e-12."""
    random = np.random.default_rng(0)
    with space(3, method=method) as world:
        spins, transforms, moments = [], [], []
        for k in range(60):
            w0, (x, y, z) = random.normal(size=3), 10 ** random.uniform(-3, 0, 3)
            moments.append(np.array((y + z, x + z, x + y)))
            spin = Spin(60 * turn * w0 / np.linalg.norm(w0), moments[k])
            entity = world.create_entity(Transform((9.0 * k, 0, 0)), RigidBody(), spin)
            spins.append(spin)
            transforms.append(world.component_for_entity(entity, Transform))

        def energies():
            for spin, transform, moment in zip(spins, transforms, moments, strict=True):
                q = np.array(transform.rotation)
                yield np.dot(moment, np.square(turned((q[0], *-q[1:]), np.array(spin.angular_velocity))))

        start, worst = np.array([*energies()]), 0.0
        for _ in range(120):
            world.step()
            worst = max(worst, abs(np.array([*energies()]) / start - 1).max())
        assert worst <= 1e-12


@pytest.mark.compiled
def test_the_middle_axis_flips_when_it_should():
    """Dzhanibekov: the times at which w2 passes 0 are those of the closed form, to .01 s in 50 s at 60 Hz."""
    w0, times, closed = (0.01, 1.0, 0.01), [], []
    with space(3) as world:
        entity = world.create_entity(Transform((0, 0, 0)), RigidBody(), Spin(w0, MOMENTS))
        transform, spin = world.component_for_entity(entity, Transform), world.component_for_entity(entity, Spin)
        last = last_closed = 1.0
        for step in range(3000):
            world.step()
            q = np.array(transform.rotation)
            now = turned((q[0], *-q[1:]), np.array(spin.angular_velocity))[1]
            exact = top_at(MOMENTS, w0, (step + 1) / 60)[1]
            for value, before, found in ((now, last, times), (exact, last_closed, closed)):
                if value * before < 0:
                    found.append((step + before / (before - value)) / 60)
            last, last_closed = now, exact
    assert len(times) == len(closed) >= 2
    assert np.abs(np.subtract(times, closed)).max() < 0.01


@pytest.mark.compiled
@pytest.mark.parametrize("seed", range(6))
def test_axes_that_are_not_the_bodys_own(seed):
    """A sphere beside the body's position has inertia off the diagonal: its momentum stays, and it is that of the
    parallel axis theorem."""
    random = np.random.default_rng(seed)
    offset, w0, m, r = random.uniform(-1, 1, 3), random.uniform(-3, 3, 3), 2.5, 0.4
    tensor = m * (0.4 * r * r * np.eye(3) + offset @ offset * np.eye(3) - np.outer(offset, offset))
    with space(3, method="velocity_verlet") as world:
        entity = world.create_entity(Transform((0, 0, 0)), RigidBody(m), Spin(w0), SphereCollider(r, offset=offset))
        world.bodies  # noqa: B018 - takes them in
        spin, transform = world.component_for_entity(entity, Spin), world.component_for_entity(entity, Transform)
        assert np.allclose(spin.moments, tensor, rtol=1e-12, atol=1e-12)
        for _ in range(120):
            world.step()
        q = np.array(transform.rotation)
        w = turned((q[0], *-q[1:]), np.array(spin.angular_velocity))
    assert np.allclose(turned(q, tensor @ w), tensor @ w0, rtol=1e-11, atol=1e-11)
    assert w @ tensor @ w == pytest.approx(w0 @ tensor @ w0, rel=1e-12)


def test_a_torque_changes_the_angular_momentum_by_itself_times_the_time():
    torque, w0 = np.array((0.3, -1.0, 0.5)), np.array((0.2, 0.1, -0.4))
    with space(3, method="yoshida4") as world:
        entity = world.create_entity(Transform((0, 0, 0)), RigidBody(), Spin(w0, MOMENTS, constant_torque=torque))
        for _ in range(90):
            world.step()
        q = np.array(world.component_for_entity(entity, Transform).rotation)
        w = turned((q[0], *-q[1:]), np.array(world.component_for_entity(entity, Spin).angular_velocity))
    assert np.allclose(turned(q, MOMENTS * w), MOMENTS * w0 + 1.5 * torque, rtol=1e-11)


# -- what turns by itself -------------------------------------------------------------------------


@pytest.mark.compiled
@pytest.mark.parametrize("collision", ["discrete", "continuous", "event_driven"])
def test_a_mill_turns_with_its_angular_velocity_and_its_shape_with_it(collision):
    """A kinematic bar of half length 2 passes a point at distance 1.5 once in half a turn: the query there sees it."""
    with space(2, collision=collision) as world:
        mill = world.create_entity(Transform((0, 0)), RigidBody(kind="kinematic"), Spin(math.pi), BoxCollider((2, 0.1)))
        seen = []
        for _ in range(120):
            world.step()
            seen.append(mill in world.query_sphere((0, 1.5), 0.01))
        assert world.component_for_entity(mill, Transform).rotation == pytest.approx(2 * math.pi, rel=1e-12)
    passes = np.flatnonzero(np.diff(np.concatenate(((0,), seen, (0,)))) == 1)
    assert len(passes) == 2
    assert 20 <= sum(seen[:60]) * 15 <= 75  # 2 asin(.1 / 1.5) / pi of 60 steps are 2.5


def test_a_kinematic_body_in_space_turns_about_the_axis_that_it_is_given():
    w = np.array((0.3, -0.7, 1.1))
    with space(3) as world:
        entity = world.create_entity(Transform((0, 0, 0)), RigidBody(kind="kinematic"), Spin(w), BoxCollider((1, 1, 1)))
        for _ in range(150):
            world.step()
        q = np.array(world.component_for_entity(entity, Transform).rotation)
    angle = 2.5 * np.linalg.norm(w)
    expected = np.array((math.cos(angle / 2), *(math.sin(angle / 2) * w / np.linalg.norm(w))))
    assert min(np.abs(q - expected).max(), np.abs(q + expected).max()) < 1e-12
