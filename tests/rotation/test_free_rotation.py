"""Bodies that turn without contacts, against closed forms: what torques and damping do, and the free top in 3D."""

from __future__ import annotations

import math

import numpy as np
import pytest
from rotation.helpers_turning import own_spin, part, turned, turning_world
from scipy.special import ellipj, ellipkinc
from worlds import MODES, run

from carom.components import RigidBody, SphereCollider, Transform
from carom.framework import ForceSystem
from carom.plugins.rotation import BoxCollider, Spin

pytestmark = pytest.mark.plain
METHODS = {"explicit_euler": 1, "semi_implicit_euler": 1, "velocity_verlet": 2, "yoshida4": 4, "rk4": 4}


@pytest.mark.compiled
@pytest.mark.parametrize("damping", [0.0, 0.7])
@pytest.mark.parametrize("method", METHODS)
def test_a_constant_torque_in_a_plane(method, damping):
    """w' = t/I - c w: the velocity is exact in every method, the angle from order 2 on; Euler's are wrong by c dt."""
    inertia, torque, w0, seconds = 0.7, 1.9, -3.0, 1.0
    with turning_world(integrator=method) as world:
        entity = world.create_entity(
            Transform((3, 4)), RigidBody(), Spin(w0, inertia, angular_damping=damping, constant_torque=torque)
        )
        run(world, 60)
        a, c, t = torque / inertia, damping, seconds
        w = w0 * math.exp(-c * t) + (a / c * (1 - math.exp(-c * t)) if c else a * t)
        angle = ((w0 - w) / c + a / c * t) if c else w0 * t + a * t * t / 2
        assert part(world, entity, Spin).angular_velocity == pytest.approx(w, rel=1e-12)
        error = part(world, entity, Transform).rotation - angle
        bound = 1e-12 if METHODS[method] > 1 else (abs(w - w0) + c * seconds * abs(w0)) / 60
        assert abs(error) <= bound
        assert METHODS[method] > 1 or abs(error) > 1e-3


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


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("aside", [0.0, 1e-300, 1e-17, 1e-13, 1e-9])
@pytest.mark.parametrize("axis", range(3))
def test_a_turn_about_a_principal_axis_is_of_constant_rate(axis, aside):
    """What is aside of that of the middle moment grows by 3 in a step at most."""
    w = 3.0 * np.eye(3)[axis] + aside * np.array((1.0, -2.0, 0.5))
    with turning_world(3) as world:
        entity = world.create_entity(Transform((0, 0, 0)), RigidBody(), Spin(w, MOMENTS))
        run(world, 10)
        q = np.array(part(world, entity, Transform).rotation)
    assert q[0] == pytest.approx(math.cos(0.25), abs=1e-14 + 10 * aside)
    assert q[1 + axis] == pytest.approx(math.sin(0.25), abs=1e-14 + 10 * aside)


class Nothing(ForceSystem):
    """Beside it the turns are those of a world with torques of force systems."""

    requires = (Spin,)

    def add_forces(self, bodies, time):
        pass


def spin_top(dt, seconds, systems=(), **settings):
    """(angular velocity along its own axes, quaternion, angular momentum before and after along the world's axes)."""
    with turning_world(3, dt=dt, **settings) as world:
        for system in systems:
            world.add_system(system)
        entity = world.create_entity(Transform((0, 0, 0)), RigidBody(), Spin(START, MOMENTS))
        run(world, round(seconds / dt))
        q, w = np.array(part(world, entity, Transform).rotation), own_spin(world, entity)
    return w, q, np.multiply(MOMENTS, START), turned(q, np.multiply(MOMENTS, w))


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("method", METHODS)
def test_the_free_top_is_that_of_jacobis_functions(method):
    """Whatever the step."""
    exact = top_at(MOMENTS, START, 4.0)
    for dt in (1 / 2, 1 / 15, 1 / 60):
        assert np.linalg.norm(spin_top(dt, 4.0, integrator=method)[0] - exact) < 1e-12


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize(
    ("method", "beside"),
    [("semi_implicit_euler", False), *((method, beside) for method in ("velocity_verlet", "yoshida4") for beside in
     (False, True)), ("rk4", True), ("flight", True)],
)  # fmt: skip
def test_momentum_energy_and_the_quaternions_length_stay(method, beside):
    """100 s at 60 Hz: to 1e-12 of themselves. Beside a force system, energy in 5 s."""
    chosen = {"collision": "event_driven"} if method == "flight" else {"integrator": method}
    w, q, before, after = spin_top(1 / 60, 5.0 if beside else 100.0, [Nothing()] if beside else (), **chosen)
    energy, start = np.dot(MOMENTS, w * w), np.dot(MOMENTS, np.square(START))
    assert abs(energy / start - 1) <= 1e-12
    assert abs(np.linalg.norm(q) - 1) <= 1e-14
    assert beside or np.linalg.norm(after - before) <= 1e-12 * np.linalg.norm(before)


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("turn", [0.5, 2.0, 5.0])
@pytest.mark.parametrize("method", ["velocity_verlet", "rk4"])
def test_what_turns_far_in_a_step_keeps_its_energy(method, turn):
    """Sixty boxes with edges to 1:30, by so many rad in each of 120 steps: at all times to 1e-12."""
    random = np.random.default_rng(0)
    with turning_world(3, integrator=method) as world:
        moments = []
        for k in range(60):
            w0, (x, y, z) = random.normal(size=3), 10 ** random.uniform(-3, 0, 3)
            moments.append((y + z, x + z, x + y))
            spin = Spin(60 * turn * w0 / np.linalg.norm(w0), moments[k])
            world.create_entity(Transform((9.0 * k, 0, 0)), RigidBody(), spin)
        bodies = world.bodies

        def energies():
            back = bodies.rotation * (1, -1, -1, -1)
            return np.sum(moments * turned(back, bodies.spin.angular_velocity) ** 2, axis=1)

        start = energies()
        for _ in range(120):
            world.step()
            assert abs(energies() / start - 1).max() <= 1e-12


@pytest.mark.slow
@pytest.mark.compiled
def test_what_is_nearly_a_sphere_keeps_its_energy_and_momentum():
    """Moments that differ by 1e-14 to 1e-2 of themselves, at 60 Hz: in 1,000 steps both to 2e-12."""
    random = np.random.default_rng(1)
    moments = 0.2 * (1 + np.geomspace(1e-14, 1e-2, 100)[:, None] * random.uniform(0, 1, (100, 3)))
    with turning_world(3, integrator="velocity_verlet") as world:
        for k, (own, w0) in enumerate(zip(moments, random.normal(scale=3.0, size=(100, 3)), strict=True)):
            world.create_entity(Transform((9.0 * k, 0, 0)), RigidBody(), Spin(w0, own))
        bodies, found = world.bodies, []
        for steps in (0, 1000):
            run(world, steps)
            w = turned(bodies.rotation * (1, -1, -1, -1), bodies.spin.angular_velocity)
            found.append((np.sum(moments * w**2, axis=1), turned(bodies.rotation, moments * w)))
    (energy, momentum), (energy_after, momentum_after) = found
    assert abs(energy_after / energy - 1).max() <= 2e-12
    assert (np.linalg.norm(momentum_after - momentum, axis=1) / np.linalg.norm(momentum, axis=1)).max() <= 2e-12


@pytest.mark.slow
@pytest.mark.compiled
def test_the_middle_axis_flips_when_it_should():
    """Dzhanibekov: the times at which w2 passes 0 are those of the closed form, to .01 s in 50 s at 60 Hz."""
    w0, passes = (0.01, 1.0, 0.01), []
    with turning_world(3, integrator="velocity_verlet") as world:
        entity, found = world.create_entity(Transform((0, 0, 0)), RigidBody(), Spin(w0, MOMENTS)), [1.0]
        for _ in range(3000):
            world.step()
            found.append(own_spin(world, entity)[1])
    for w in (np.array(found), np.array([top_at(MOMENTS, w0, step / 60)[1] for step in range(3001)])):
        before = np.flatnonzero(w[:-1] * w[1:] < 0)
        passes.append((before + w[before] / (w[before] - w[before + 1])) / 60)
    assert len(passes[0]) == len(passes[1]) >= 2
    assert np.abs(np.subtract(*passes)).max() < 0.01


@pytest.mark.compiled
@pytest.mark.parametrize("seed", range(6))
def test_axes_that_are_not_the_bodys_own(seed):
    """A sphere beside the body's position has inertia off the diagonal: its momentum stays, and it is that of the
    parallel axis theorem."""
    random = np.random.default_rng(seed)
    offset, w0, m, r = random.uniform(-1, 1, 3), random.uniform(-3, 3, 3), 2.5, 0.4
    tensor = m * (0.4 * r * r * np.eye(3) + offset @ offset * np.eye(3) - np.outer(offset, offset))
    with turning_world(3, integrator="velocity_verlet") as world:
        entity = world.create_entity(Transform((0, 0, 0)), RigidBody(m), Spin(w0), SphereCollider(r, offset=offset))
        world.bodies  # noqa: B018 - takes them in
        spin, transform = part(world, entity, Spin), part(world, entity, Transform)
        assert np.allclose(spin.moments, tensor, rtol=1e-12, atol=1e-12)
        run(world, 120)
        q, w = np.array(transform.rotation), own_spin(world, entity)
    assert np.allclose(turned(q, tensor @ w), tensor @ w0, rtol=1e-11, atol=1e-11)
    assert w @ tensor @ w == pytest.approx(w0 @ tensor @ w0, rel=1e-12)


def test_a_torque_changes_the_angular_momentum_by_itself_times_the_time():
    torque, w0 = np.array((0.3, -1.0, 0.5)), np.array((0.2, 0.1, -0.4))
    with turning_world(3, integrator="yoshida4") as world:
        entity = world.create_entity(Transform((0, 0, 0)), RigidBody(), Spin(w0, MOMENTS, constant_torque=torque))
        run(world, 90)
        q, w = np.array(part(world, entity, Transform).rotation), own_spin(world, entity)
    assert np.allclose(turned(q, MOMENTS * w), MOMENTS * w0 + 1.5 * torque, rtol=1e-11)


@pytest.mark.compiled
@pytest.mark.parametrize("collision", MODES)
def test_a_mill_turns_with_its_angular_velocity_and_its_shape_with_it(collision):
    """A kinematic bar of half length 2 passes a point at distance 1.5 once in half a turn: the query there sees it."""
    with turning_world(collision=collision) as world:
        mill = world.create_entity(Transform((0, 0)), RigidBody(kind="kinematic"), Spin(math.pi), BoxCollider((2, 0.1)))
        seen = []
        for _ in range(120):
            world.step()
            seen.append(mill in world.query_sphere((0, 1.5), 0.01))
        assert part(world, mill, Transform).rotation == pytest.approx(2 * math.pi, rel=1e-12)
    passes = np.flatnonzero(np.diff(np.concatenate(((0,), seen, (0,)))) == 1)
    assert len(passes) == 2
    assert 20 <= sum(seen[:60]) * 15 <= 75  # 2 asin(.1 / 1.5) / pi of 60 steps are 2.5


@pytest.mark.compiled
def test_a_kinematic_body_in_space_turns_about_the_axis_that_it_is_given():
    w = np.array((0.3, -0.7, 1.1))
    with turning_world(3, integrator="velocity_verlet") as world:
        entity = world.create_entity(Transform((0, 0, 0)), RigidBody(kind="kinematic"), Spin(w), BoxCollider((1, 1, 1)))
        run(world, 150)
        q = np.array(part(world, entity, Transform).rotation)
    angle = 2.5 * np.linalg.norm(w)
    expected = np.array((math.cos(angle / 2), *(math.sin(angle / 2) * w / np.linalg.norm(w))))
    assert min(np.abs(q - expected).max(), np.abs(q + expected).max()) < 1e-12
