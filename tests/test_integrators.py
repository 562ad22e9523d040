"""Integrators against closed forms, published figures and the textbook's formulas: A7, B1 to B8, C7 of the accuracy
list. A linear problem's n-step answer is a matrix power, so the engine is compared at rounding, not at truncation."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers_motion import DRIFT, METHODS, ORDERS, Oscillator, all_methods, oscillators, record
from oracles import integrators_naive as naive
from worlds import EPS, make_world

from carom.components import RigidBody, Transform
from carom.framework import ForceSystem

# -- constant force: A7 (a) (b), B1, C7 -----------------------------------------------------------


def throw(method, dt, steps, *, v0, g, vx=0.0, d=2, **settings):
    """Positions and velocities of one body thrown upwards from the origin, (steps + 1, d)."""
    world = make_world(d, gravity=g, dt=dt, integrator=method, **settings)
    world.create_entity(Transform((0.0,) * d), RigidBody(3.0, (vx, v0, 0.0)[:d]))
    positions, velocities = record(world, steps)
    return positions[:, 0], velocities[:, 0]


def closed_form(method, dt, steps, v0, g):
    """Height at each step: the parabola, plus or minus g dt t / 2 for the Euler methods."""
    t = dt * np.arange(steps + 1)
    return v0 * t - g * t * t / 2 + DRIFT.get(method, 0) * g * dt * t / 2


def test_fiedler_ten_steps_of_one_second():
    """A7 (a): F = 10, m = 1 from rest, dt = 1: small integers, so exact."""
    world = make_world(dt=1.0, integrator="explicit_euler")
    world.create_entity(Transform((0, 0)), RigidBody(1.0, constant_force=(10.0, 0.0)))
    positions, velocities = record(world, 10)
    assert positions[:, 0, 0].tolist() == [0, 0, 10, 30, 60, 100, 150, 210, 280, 360, 450]
    assert velocities[-1, 0, 0] == 100


@all_methods
def test_fiedler_hundredths_of_a_second(method):
    """A7 (b): dt = 1/100 for 10 s: the true 500 m minus (EE) or plus (SI) a dt t / 2."""
    world = make_world(dt=0.01, integrator=method)
    world.create_entity(Transform((0, 0)), RigidBody(1.0, constant_force=(10.0, 0.0)))
    positions, velocities = record(world, 1000)
    expected = {"explicit_euler": 499.5, "semi_implicit_euler": 500.5}.get(method, 500.0)
    assert positions[-1, 0, 0] == pytest.approx(expected, rel=1e-12)
    assert velocities[-1, 0, 0] == pytest.approx(100.0, rel=1e-12)


# B1: v0, g (per second), Hz, and the published apex of EE, SI and the others
ARCS = [
    *((240.0, 450.0, hz, *apex) for hz, *apex in (
        (60, 66.0, 62.0, 64.0), (30, 68.0, 60.0, 64.0), (20, 70.125, 58.125, 63.9375), (15, 72.0, 56.0, 64.0),
        (10, 76.5, 52.5, 63.75),
    )),
    *((12.0, 30.0, hz, *apex) for hz, *apex in (
        (30, 2.6, 2.2, 2.4), (60, 2.5, 2.3, 2.4), (144, 2.441840, 2.358507, None), (240, 2.425, 2.375, 2.4),
    )),
]  # fmt: skip


@all_methods
@pytest.mark.parametrize(("v0", "g", "hz", "ee", "si", "others"), ARCS)
def test_jump_arc(method, v0, g, hz, ee, si, others):
    """B1: every point of the arc, its apex, and where it lands."""
    dt, vx = 1 / hz, 7.0
    n0 = v0 / (g * dt)
    whole = n0 == pytest.approx(round(n0), abs=1e-9)
    sign = DRIFT.get(method, 0)
    landing = round(2 * n0) + sign if whole else math.ceil(2 * n0) + sign
    positions, velocities = throw(method, dt, landing + 1, v0=v0, g=g, vx=vx)
    scale = v0 * v0 / (2 * g)
    height = positions[:, 1]
    steps = np.arange(landing + 2)
    np.testing.assert_allclose(height, closed_form(method, dt, landing + 1, v0, g), rtol=0, atol=1e-12 * scale)
    np.testing.assert_allclose(velocities[:, 1], v0 - steps * g * dt, rtol=0, atol=1e-12 * v0)
    np.testing.assert_allclose(positions[:, 0], vx * steps * dt, rtol=0, atol=1e-12 * scale)

    apex, n, k = height.max(), round(n0), math.floor(n0 + 1e-9)
    f = n0 - k
    formula = g * dt * dt / 2 * {1: (k + 1) * (k + 2 * f), -1: k * (k - 1 + 2 * f), 0: n * (2 * n0 - n)}[sign]
    assert apex == pytest.approx(formula, rel=1e-12)
    published = {1: ee, -1: si, 0: others}[sign]
    if published is not None:
        assert apex == pytest.approx(published, abs=5e-7)
    if sign == 0:
        assert scale - g * dt * dt / 8 <= apex * (1 + 1e-12)
        assert apex <= scale * (1 + 1e-12)
    if whole:
        assert abs(height[landing]) <= 1e-12 * scale  # back on the ground at that very step, not one sooner
        assert (height[1:landing] > 1e-6 * scale).all()
        assert positions[landing, 0] == pytest.approx(vx * (2 * n0 + sign) * dt, rel=1e-12)


@all_methods
def test_jump_arc_in_three_dimensions(method):
    """B1 holds along the second axis of a 3D world too; the third stays zero."""
    positions, _ = throw(method, 1 / 30, 17, v0=12.0, g=30.0, vx=1.0, d=3)
    np.testing.assert_allclose(positions[:, 1], closed_form(method, 1 / 30, 17, 12.0, 30.0), rtol=0, atol=1e-12)
    assert not positions[:, 2].any()


@all_methods
@pytest.mark.parametrize("dt", [1e-9, 1e-6, 0.25, 1.0, 10.0])
def test_extreme_steps_keep_the_closed_form(method, dt):
    """C7: B1 from a nanosecond to ten seconds."""
    v0, g, steps = 12.0, 30.0, 500
    positions, velocities = throw(method, dt, steps, v0=v0, g=g)
    expected = closed_form(method, dt, steps, v0, g)
    speeds = v0 - g * dt * np.arange(steps + 1)
    tolerance = 10 * steps * EPS
    np.testing.assert_allclose(positions[:, 1], expected, rtol=0, atol=tolerance * np.abs(expected).max())
    np.testing.assert_allclose(velocities[:, 1], speeds, rtol=0, atol=tolerance * np.abs(speeds).max())


@all_methods
def test_substeps_never_change_free_flight(method):
    """Substeps are the solver's: the same bits with any number of them."""
    paths = [throw(method, 1 / 60, 50, v0=12.0, g=9.81, substeps=n)[0] for n in (1, 4, 32)]
    assert np.array_equal(paths[0], paths[1])
    assert np.array_equal(paths[0], paths[2])


# -- springs: A7 (c) (d), B2, B3 -----------------------------------------------------------------


def matrix_powers(method, stiffness, drag, dt, steps, x0=1.0, v0=0.0):
    """The textbook method's (x, v) at steps 0 ... steps, by repeated multiplication with its step matrix."""
    matrix = naive.oscillator_matrix(method, stiffness, drag, dt)
    states = np.empty((steps + 1, 2))
    states[0] = x0, v0
    for n in range(steps):
        states[n + 1] = matrix @ states[n]
    return states


def energy_ratio(positions, velocities, stiffness):
    """E / E0 of bodies of mass 1 on springs; (steps, n)."""
    energy = velocities[..., 0] ** 2 + stiffness * positions[..., 0] ** 2
    return energy / energy[0]


def test_fiedler_damped_spring_gains_energy_with_explicit_euler():
    """A7 (c): k = 15, b = 0.1, x0 = 1000, dt 0.01; the eigenvalue is 1 + dt s, so |.|^2 = 1 - b dt + k dt^2."""
    k, b, dt, steps = 15.0, 0.1, 0.01, 3000
    positions, velocities = record(oscillators("explicit_euler", dt, k, b, x0=1000.0), steps)
    x, v = positions[:, 0, 0], velocities[:, 0, 0]
    s = complex(-b / 2, math.sqrt(k - b * b / 4))
    assert abs(1 + dt * s) ** 2 == pytest.approx(1.0005, rel=1e-12)
    expected = 1000 * (complex(1, s.real / s.imag) * (1 + dt * s) ** np.arange(steps + 1)).real
    np.testing.assert_allclose(x, expected, rtol=0, atol=1e-10 * np.abs(expected).max())
    assert math.hypot(x[-1], v[-1] / math.sqrt(k)) == pytest.approx(2115.0, abs=0.5)


@pytest.mark.parametrize(
    ("dt", "kept", "rk4_phase", "si_phase"), [(0.1, 0.95945, -0.0619, 2.2162), (0.25, 0.025847, None, 15.29)]
)
def test_fiedler_undamped_spring(dt, kept, rk4_phase, si_phase):
    """A7 (d): k = 15 for 90 s: RK4 keeps the phase and loses energy, SI the reverse."""
    omega = math.sqrt(15.0)
    z, steps = omega * dt, round(90 / dt)
    n = np.arange(steps + 1)
    positions, velocities = record(oscillators("rk4", dt, 15.0), steps)
    # one step multiplies x - i v / omega by this number
    factor = complex(1 - z**2 / 2 + z**4 / 24, z - z**3 / 6)
    phasor = positions[:, 0, 0] - 1j * velocities[:, 0, 0] / omega
    np.testing.assert_allclose(phasor, factor**n, rtol=0, atol=1e-10)
    energy = energy_ratio(positions, velocities, 15.0)[-1, 0]
    assert energy == pytest.approx((1 - z**6 / 72 + z**8 / 576) ** steps, rel=1e-10)
    assert energy == pytest.approx(kept, rel=1e-4)
    if rk4_phase is not None:
        assert np.unwrap(np.angle(phasor))[-1] - omega * 90 == pytest.approx(rk4_phase, abs=1e-4)

    positions, _ = record(oscillators("semi_implicit_euler", dt, 15.0), steps)
    turn = 2 * math.asin(z / 2)  # Omega dt
    expected = np.cos((n + 0.5) * turn) / math.cos(turn / 2)
    np.testing.assert_allclose(positions[:, 0, 0], expected, rtol=0, atol=1e-10)
    assert turn * steps - omega * 90 == pytest.approx(si_phase, rel=1e-3)


Z = np.array([0.1, 0.5, 1.1, 1.9, 1.99])  # omega dt, below the limit 2; at 1 six samples repeat for ever


def check_symplectic_bands(method, steps, tenth, tolerance):
    """B2: energy within its band in the first and in the last tenth of the run alike, and SI's invariant."""
    world = oscillators(method, 1.0, Z**2)
    early = record(world, tenth)
    for _ in range(steps - 2 * tenth):
        world.step()
    late = record(world, tenth)
    low, high = {
        "semi_implicit_euler": (1 / (1 + Z / 2), 1 / (1 - Z / 2)),
        "velocity_verlet": (1 - Z**2 / 4, np.ones_like(Z)),
    }[method]
    for positions, velocities in (early, late):
        energy = (velocities[..., 0] ** 2 + Z**2 * positions[..., 0] ** 2) / Z**2
        assert (energy >= low * (1 - tolerance)).all()
        assert (energy <= high * (1 + tolerance)).all()
        # and the whole band is used: samples this dense come near both ends
        np.testing.assert_allclose(energy.min(axis=0), low, rtol=5e-3)
        np.testing.assert_allclose(energy.max(axis=0), high, rtol=5e-3)
        if method == "semi_implicit_euler":
            x, v = positions[..., 0], velocities[..., 0]
            invariant = v**2 + Z**2 * x**2 - Z**2 * x * v
            np.testing.assert_allclose(invariant, np.broadcast_to(Z**2, invariant.shape), rtol=tolerance)


@pytest.mark.parametrize("method", ["semi_implicit_euler", "velocity_verlet"])
def test_undamped_spring_stays_in_its_energy_band(method):
    """B2: E/E0 in [1/(1+z/2), 1/(1-z/2)] (SI), [1-z^2/4, 1] (VV); 1e-6 is for 1e7 steps, rounding here is far less."""
    check_symplectic_bands(method, steps=8000, tenth=800, tolerance=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["semi_implicit_euler", "velocity_verlet"])
def test_undamped_spring_stays_in_its_energy_band_for_long(method):
    """B2, C17: 200,000 steps."""
    check_symplectic_bands(method, steps=200_000, tenth=2000, tolerance=1e-6)


@pytest.mark.parametrize("method", ["semi_implicit_euler", "velocity_verlet"])
def test_undamped_spring_frequency(method):
    """B2: cos(Omega dt) = 1 - z^2 / 2, so x_(n+1) + x_(n-1) = 2 cos(Omega dt) x_n for both methods."""
    x = record(oscillators(method, 1.0, Z**2), 300)[0][..., 0]
    np.testing.assert_allclose(x[2:] + x[:-2], (2 - Z**2) * x[1:-1], rtol=0, atol=1e-12 * np.abs(x).max())


@pytest.mark.parametrize(
    ("method", "factor"),
    [
        ("explicit_euler", lambda z: 1 + z**2),
        ("rk4", lambda z: 1 - z**6 / 72 + z**8 / 576),
    ],
)
def test_undamped_spring_energy_per_step(method, factor):
    """B2: E/E0 = (1 + z^2)^n (EE), (1 - z^6/72 + z^8/576)^n (RK4)."""
    steps = 2000
    with np.errstate(over="ignore", invalid="ignore"):  # explicit Euler, later than what is compared
        ratio = energy_ratio(*record(oscillators(method, 1.0, Z[:3] ** 2), steps), Z[:3] ** 2)
    n = np.array([1, 10, 100, 500])
    np.testing.assert_allclose(ratio[n], factor(Z[:3]) ** n[:, None], rtol=10 * 500 * EPS)
    np.testing.assert_allclose(ratio[steps, 0], factor(Z[0]) ** steps, rtol=10 * steps * EPS)


def test_yoshida_keeps_the_energy_of_a_spring():
    """B2's band for the fourth order: a symplectic method's energy swings by O(z^4) and does not drift."""
    z = np.array([0.05, 0.1, 0.2])
    ratio = energy_ratio(*record(oscillators("yoshida4", 1.0, z**2), 3000), z**2)
    early, late = np.abs(ratio[:1500] - 1).max(axis=0), np.abs(ratio[1500:] - 1).max(axis=0)
    np.testing.assert_allclose(early, late, rtol=1e-2)
    np.testing.assert_allclose(np.log2(early[1:] / early[:-1]), 4.0, rtol=0.02)


STIFFNESS = 4 * math.pi**2  # period 1 s
DAMPING_RATIOS = np.array([0.0, 0.05, 0.5, 1.0, 1.5])  # under, critically and over-damped


def damped_oscillation(zeta, t):
    """B3: exact (x, v) from (1, 0) of x'' = -w^2 x - 2 zeta w x', by the matrix exponential's eigenvalues."""
    w = math.sqrt(STIFFNESS)
    if zeta == 1.0:
        return (1 + w * t) * math.exp(-w * t), -w * w * t * math.exp(-w * t)
    root = np.sqrt(complex(zeta * zeta - 1))
    s1, s2 = w * (-zeta + root), w * (-zeta - root)
    e1, e2 = np.exp(s1 * t), np.exp(s2 * t)
    return ((s1 * e2 - s2 * e1) / (s1 - s2)).real, (s1 * s2 * (e2 - e1) / (s1 - s2)).real


@all_methods
def test_damped_spring_is_the_matrix_power(method):
    """B3: 400 steps of every damping equal the textbook method's matrix power at rounding; mass 2 instead of 1."""
    dt, steps = 1 / 100, 400
    drag = 2 * DAMPING_RATIOS * math.sqrt(STIFFNESS)
    world = oscillators(method, dt, 2 * STIFFNESS, 2 * drag, x0=0.7, v0=-2.0, mass=2.0)
    positions, velocities = record(world, steps)
    for i, c in enumerate(drag):
        expected = matrix_powers(method, STIFFNESS, c, dt, steps, 0.7, -2.0)
        scale = np.abs(expected).max(axis=0)
        got = np.column_stack((positions[:, i, 0], velocities[:, i, 0]))
        np.testing.assert_allclose(got / scale, expected / scale, rtol=0, atol=10 * steps * EPS)


@all_methods
def test_observed_order(method):
    """B3: the error after 4/5 of a period falls by 2^p from dt = T/200 to T/400, p within 5 % (a whole period of the
    undamped spring is a special case: SI's first-order error is periodic).

    Yoshida's composition is of fourth order for forces that do not depend on velocity: undamped only.
    """
    zetas = DAMPING_RATIOS[:1] if method == "yoshida4" else DAMPING_RATIOS
    drag = 2 * zetas * math.sqrt(STIFFNESS)
    exact = np.array([damped_oscillation(zeta, 0.8) for zeta in zetas])
    errors = []
    for steps in (200, 400):
        positions, velocities = record(oscillators(method, 1 / steps, STIFFNESS, drag), 4 * steps // 5)
        got = np.column_stack((positions[-1, :, 0], velocities[-1, :, 0]))
        errors.append(np.hypot(*((got - exact) / (1.0, math.sqrt(STIFFNESS))).T))
    orders = np.log2(errors[0] / errors[1])
    np.testing.assert_allclose(orders, ORDERS[method], rtol=0.05)


class Pushes(ForceSystem):
    """A force that depends on time alone: F = 6 t."""

    def add_forces(self, bodies, time):
        bodies.force[:, 0] += 6.0 * time


@all_methods
def test_forces_that_depend_on_time(method):
    """Stages see their own time: x'' = 6 t from rest gives x = t^3, which RK4 and Yoshida integrate exactly; the others
    as the textbook does."""
    dt, steps = 0.125, 40
    world = make_world(dt=dt, integrator=method)
    world.create_entity(Transform((0, 0)), RigidBody())
    world.add_system(Pushes())
    positions, velocities = record(world, steps)
    x, v = naive.trajectory(method, 0.0, 0.0, dt, steps, lambda x, v, t: 6 * t)
    np.testing.assert_allclose(positions[:, 0, 0], x, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(velocities[:, 0, 0], v, rtol=1e-12, atol=1e-13)
    if ORDERS[method] == 4:
        t = dt * np.arange(steps + 1)
        np.testing.assert_allclose(positions[:, 0, 0], t**3, rtol=1e-12, atol=1e-13)
        np.testing.assert_allclose(velocities[:, 0, 0], 3 * t**2, rtol=1e-12, atol=1e-13)


# -- orbits: B4, B5 ------------------------------------------------------------------------------


class NewtonianGravity(ForceSystem):
    """A sun of GM = 1 at the origin, or (``mutual``) bodies of mass 1 that attract each other, G = 1."""

    def __init__(self, mutual=False):
        self.mutual = mutual

    def add_forces(self, bodies, time):
        bodies.force[:] += self.pull(bodies.position)

    def pull(self, x):
        if not self.mutual:
            return -x / np.sum(x * x, axis=1, keepdims=True) ** 1.5
        apart = x[None] - x[:, None]
        cube = np.sum(apart**2, axis=2) ** 1.5
        np.fill_diagonal(cube, 1.0)
        return np.sum(apart / cube[..., None], axis=1)


PERIOD_STEPS = 1000
# B4: after 1000 periods: largest relative energy error, position error, angular momentum error
ORBIT = {
    "explicit_euler": (0.84, None, None),
    "semi_implicit_euler": (3.95e-5, 0.175, 2e-13),
    "velocity_verlet": (3.9e-10, 0.0827, 2e-13),
    "rk4": (1.7e-9, 8.3e-6, 8.5e-10),
    "yoshida4": (2.6e-13, 9.1e-6, 2e-13),
}


def orbit(method, periods):
    """Largest energy and angular momentum error and the final position error of a circular orbit, GM = r = 1."""
    world = make_world(dt=2 * math.pi / PERIOD_STEPS, integrator=method)
    world.create_entity(Transform((1, 0)), RigidBody(1.0, (0, 1)))
    world.add_system(NewtonianGravity())
    energy_error = momentum_error = 0.0
    for _ in range(periods):
        positions, velocities = (a[:, 0] for a in record(world, PERIOD_STEPS))
        energy = 0.5 * np.sum(velocities**2, axis=1) - 1 / np.hypot(*positions.T)
        spin = positions[:, 0] * velocities[:, 1] - positions[:, 1] * velocities[:, 0]
        energy_error = max(energy_error, np.abs(energy + 0.5).max())
        momentum_error = max(momentum_error, np.abs(spin - 1).max())
    return energy_error, math.dist(positions[-1], (1, 0)), momentum_error


def check_orbit(method, periods):
    """What is bounded keeps its bound, what grows (RK4's energy, all phases) has its share of the thousand periods'."""
    energy, position, momentum = ORBIT[method]
    got = orbit(method, periods)
    share = periods / 1000
    if method == "explicit_euler":
        expected, _ = naive.trajectory(
            method, np.array([1.0, 0.0]), np.array([0.0, 1.0]), 2 * math.pi / PERIOD_STEPS, periods * PERIOD_STEPS,
            lambda x, v, t: -x / (x @ x) ** 1.5,
        )  # fmt: skip
        assert got[1] == pytest.approx(math.dist(expected[-1], (1, 0)), rel=1e-9)
        assert got[0] < 1.2 * energy
        return
    assert got[0] < 1.2 * energy * (share if method == "rk4" else 1)
    assert got[1] < 1.2 * position * share
    assert got[2] < 1.2 * momentum * (share if method == "rk4" else 1)


@all_methods
def test_circular_orbit_of_a_few_periods(method):
    """B4 shortened."""
    check_orbit(method, 3)


@pytest.mark.slow
@all_methods
def test_circular_orbit_of_a_hundred_periods(method):
    """B4: 100,000 steps."""
    check_orbit(method, 100)


@pytest.mark.slow
def test_circular_orbit_of_a_thousand_periods():
    """B4: a million steps of velocity Verlet; 1.2 times the measured figures."""
    for got, measured in zip(orbit("velocity_verlet", 1000), ORBIT["velocity_verlet"], strict=True):
        assert got < 1.2 * measured


# B5: return error after one period with 1000 and 10000 steps
FIGURE_EIGHT = {
    "explicit_euler": (0.86, 0.081),
    "semi_implicit_euler": (1.0e-2, 1.0e-3),
    "velocity_verlet": (6.4e-5, 6.7e-7),
    "rk4": (2.4e-8, 3e-8),
    "yoshida4": (None, 3e-8),  # not published; limited by the eight digits of the start as RK4 is
}


def figure_eight(method, steps):
    """Positions of the three bodies at the start and after one period, by the engine and by the textbook."""
    x1, v3 = np.array([0.97000436, -0.24308753]), np.array([-0.93240737, -0.86473146])
    x0, v0 = np.array([x1, -x1, 0 * x1]), np.array([-v3 / 2, -v3 / 2, v3])
    dt = 6.32591398 / steps
    world = make_world(dt=dt, integrator=method)
    world.create_entities(3, Transform.many(x0), RigidBody.many(1.0, v0))
    world.add_system(NewtonianGravity(mutual=True))
    for _ in range(steps):
        world.step()
    np.testing.assert_allclose(world.momentum(), 0, atol=1e-12)
    return x0, world.bodies.position.copy(), dt, v0


@all_methods
def test_figure_eight(method):
    """B5: Chenciner and Montgomery's orbit comes back after one period; 1.25 times the published two digits."""
    x0, x, dt, v0 = figure_eight(method, 1000)
    pull = NewtonianGravity(mutual=True).pull
    expected, _ = naive.trajectory(method, x0, v0, dt, 1000, lambda x, v, t: pull(x))
    np.testing.assert_allclose(x, expected[-1], rtol=0, atol=1e-10)
    error, published = np.abs(x - x0).max(), FIGURE_EIGHT[method][0]
    if published is not None:
        assert error < 1.25 * published
    else:
        assert error < FIGURE_EIGHT["velocity_verlet"][0] / 10  # fourth order against second


@pytest.mark.slow
@all_methods
def test_figure_eight_with_ten_thousand_steps(method):
    """B5."""
    x0, x, *_ = figure_eight(method, 10_000)
    assert np.abs(x - x0).max() < 1.25 * FIGURE_EIGHT[method][1]


# -- stability: B6, C16 --------------------------------------------------------------------------

# limits of z = omega dt without damping, of drag dt without spring, and of z at three damping ratios
LIMITS = {
    "explicit_euler": (0, 2, 0.1, 1.0, 2.0),
    "semi_implicit_euler": (2, 2, 1.902, 1.236, 0.828),
    "velocity_verlet": (2, 2, 1.91, 2.0, 1.0),
    "rk4": (2 * math.sqrt(2), 2.7853, 2.91, 2.62, 2.7853),
}
ROWS = [(1.0, 0.0), (0.0, 1.0), (1.0, 0.1), (1.0, 1.0), (1.0, 2.0)]  # (stiffness, drag) of those columns, omega = 1


def at_share_of_limit(method, share):
    """(stiffness, drag) in steps of 1 s that lie at that share of each limit above zero."""
    limits = [naive.stability_limit(method, *row) for row in ROWS]
    return np.array(
        [(k * (share * h) ** 2, c * share * h) for (k, c), h in zip(ROWS, limits, strict=True) if h > 1e-3]
    )


@pytest.mark.parametrize("method", LIMITS)
def test_textbook_limits_are_the_published_ones(method):
    """B6: the table has three or four digits; the tests below use the textbook's step matrix."""
    limits = [naive.stability_limit(method, *row) for row in ROWS]
    np.testing.assert_allclose(limits, LIMITS[method], rtol=0, atol=3e-3)


def step_matrices(method, stiffness, drag):
    """The engine's own (x, v) -> (x, v) of one step of 1 s, for each oscillator: one step of both basis states."""
    columns = []
    for x0, v0 in ((1.0, 0.0), (0.0, 1.0)):
        positions, velocities = record(oscillators(method, 1.0, stiffness, drag, x0=x0, v0=v0), 1)
        columns.append(np.stack((positions[1, :, 0], velocities[1, :, 0]), axis=-1))
    return np.stack(columns, axis=-1)


@all_methods
def test_stability_limits(method):
    """B6: at 0.999 of a limit no eigenvalue of the engine's step leaves the unit circle (a million steps stay bounded);
    at 1.01 one does, far enough for a millionfold growth in a million steps."""
    for share, stable in ((0.999, True), (1.01, False)):
        stiffness, drag = at_share_of_limit(method, share).T
        matrices = step_matrices(method, stiffness, drag)
        textbook = [naive.oscillator_matrix(method, k, c, 1.0) for k, c in zip(stiffness, drag, strict=True)]
        np.testing.assert_allclose(matrices, textbook, rtol=0, atol=1e-13)
        radius = np.abs(np.linalg.eigvals(matrices)).max(axis=1)
        if stable:
            assert (radius <= 1 + 1e-13).all()
        else:
            assert (1e6 * np.log(radius) > math.log(1e6)).all()


def check_stable_run(method, steps):
    stiffness, drag = at_share_of_limit(method, 0.999).T
    world = oscillators(method, 1.0, stiffness, drag, v0=1.0)
    for _ in range(steps // 1000):
        positions, _ = record(world, 1000)
        # critical damping has a double eigenvalue, whose n lambda^n first reaches 1 / (e (1 - 0.999)) = 368 times z
        assert np.abs(positions).max() < 2000
    assert not world.faults


@all_methods
def test_bounded_just_below_the_limit(method):
    """B6, C16."""
    check_stable_run(method, 2000)


@pytest.mark.slow
@all_methods
def test_bounded_just_below_the_limit_for_long(method):
    """B6, C16: 30,000 steps; the eigenvalues say the rest."""
    check_stable_run(method, 30_000)


@all_methods
def test_growth_just_above_the_limit(method):
    """B6, C16: at 1.01 the run grows as its matrix power says (1e-6: double eigenvalues of critical damping magnify
    rounding by n^2); explicit Euler grows at any z without damping."""
    stiffness, drag = at_share_of_limit(method, 1.01).T
    if method == "explicit_euler":
        stiffness, drag = np.append(stiffness, 0.01), np.append(drag, 0.0)
    steps = 600
    positions, velocities = record(oscillators(method, 1.0, stiffness, drag, v0=1.0), steps)
    got = np.stack((positions[-1, :, 0], velocities[-1, :, 0]), axis=-1)
    for i, (k, c) in enumerate(zip(stiffness, drag, strict=True)):
        expected = np.linalg.matrix_power(naive.oscillator_matrix(method, k, c, 1.0), steps) @ (1.0, 1.0)
        np.testing.assert_allclose(got[i], expected, rtol=0, atol=1e-6 * np.abs(expected).max())


def test_double_root_of_semi_implicit_euler():
    """C16: exactly at z = 2 the amplitude grows linearly, x_n = (-1)^n (1 + 2 n) from (1, 0)."""
    x = record(oscillators("semi_implicit_euler", 1.0, 4.0), 200)[0][:, 0, 0]
    n = np.arange(201)
    assert np.array_equal(x, (-1.0) ** n * (1 + 2 * n))


def test_what_explodes_is_reported():
    """B6, B7: explicit Euler with drag at dt = 2.5 tau grows by 1.5 per step; once not finite, a fault names the body
    and the other bodies are as they would be without it."""
    world = oscillators("explicit_euler", 1.0, 0.0, [2.5, 0.5], v0=1.0)
    alone = oscillators("explicit_euler", 1.0, 0.0, 0.5, v0=1.0)
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(1800):  # 1.5^1750 > 1.8e308
            world.step()
            alone.step()
    entity = int(world.bodies.entity[0])
    assert any(f"entity {entity}:" in fault for fault in world.faults)
    assert not any(f"entity {entity + 1}:" in fault for fault in world.faults)
    assert np.array_equal(world.bodies.position[1], alone.bodies.position[0])


# -- drag: B7 ------------------------------------------------------------------------------------

TAU, G = 0.8, 9.81
V_T = G * TAU  # terminal speed


@pytest.mark.parametrize("method", METHODS[:2])
def test_drag_force_of_the_euler_methods(method):
    """B7: F = -k v with k = m / tau: v_n = v_t (1 - (1 - dt/tau)^n); the position is the sum of old (EE) or new (SI)
    velocities."""
    dt, steps, mass = 1 / 60, 600, 2.5
    world = oscillators(method, dt, 0.0, mass / TAU, x0=0.0, mass=mass, gravity=(G, 0.0))
    positions, velocities = record(world, steps)
    expected = V_T * (1 - (1 - dt / TAU) ** np.arange(steps + 1))
    np.testing.assert_allclose(velocities[:, 0, 0], expected, rtol=0, atol=1e-13 * V_T)
    moved = dt * (expected[:-1] if method == "explicit_euler" else expected[1:])
    np.testing.assert_allclose(positions[1:, 0, 0], np.cumsum(moved), rtol=1e-12)


@all_methods
def test_drag_force_of_every_method_is_the_textbooks(method):
    """B7: the n-step answer of x'' = g - v / tau: with u = v - v_t the problem is linear, u' = -u / tau."""
    dt, steps = 1 / 20, 200
    velocities = record(oscillators(method, dt, 0.0, 1 / TAU, x0=0.0, gravity=(G, 0.0)), steps)[1]
    factor = naive.oscillator_matrix(method, 0.0, 1 / TAU, dt)[1, 1]
    expected = V_T * (1 - factor ** np.arange(steps + 1))
    np.testing.assert_allclose(velocities[:, 0, 0], expected, rtol=0, atol=1e-13 * V_T)
    if method in ("velocity_verlet", "rk4"):  # and near the true speed, as the order says
        true = -V_T * np.expm1(-dt * np.arange(steps + 1) / TAU)
        np.testing.assert_allclose(velocities[:, 0, 0], true, rtol=0, atol=V_T * (dt / TAU) ** ORDERS[method])


@all_methods
@pytest.mark.parametrize("dt", [1e-3, 1 / 60, 0.5 * TAU])
def test_terminal_speed_is_a_fixed_point(method, dt):
    """B7: a body at terminal speed stays there, 1e-14, with drag as a force and as linear_damping.

    Where steps are short, half ulps gather until they are pulled back: tau / dt of them.
    """
    world = oscillators(method, dt, 0.0, 1 / TAU, x0=0.0, v0=V_T, gravity=(G, 0.0))
    damped = world.create_entity(Transform((0, 0)), RigidBody(1.0, (V_T, 0.0), linear_damping=1 / TAU))
    _, velocities = record(world, 500)
    assert world.bodies.row_of(damped) == 1
    np.testing.assert_allclose(velocities[..., 0], V_T, rtol=max(1e-14, EPS * TAU / dt))


class Nothing(ForceSystem):
    """Its presence alone makes the integrators evaluate every stage."""

    def add_forces(self, bodies, time):
        pass


def damped_fall(method, dt, steps, staged=False):
    """Positions and velocities along x of a body from rest under g and linear_damping 1 / tau."""
    world = make_world(gravity=(G, 0.0), dt=dt, integrator=method)
    world.create_entity(Transform((0, 0)), RigidBody(3.0, linear_damping=1 / TAU))
    if staged:
        world.add_system(Nothing())
    positions, velocities = record(world, steps)
    return positions[:, 0, 0], velocities[:, 0, 0]


staged_or_not = pytest.mark.parametrize("staged", [False, True], ids=["constant", "staged"])


@all_methods
@staged_or_not
@pytest.mark.parametrize("dt", [1e-9, 1 / 60, 2.5 * TAU, 100 * TAU])
def test_linear_damping_has_the_exact_velocity(method, dt, staged):
    """B7: v = v_t (1 - e^(-t/tau)) for every method and step; a nanosecond loses no force, 2.5 tau stays monotone.

    Yoshida's middle step goes back in time: e^(1.7 * 2.5) = 70 times the rounding.
    """
    steps = 200
    _, velocity = damped_fall(method, dt, steps, staged)
    t = dt * np.arange(steps + 1)
    magnified = 70 if method == "yoshida4" and staged else 1
    np.testing.assert_allclose(velocity, -V_T * np.expm1(-t / TAU), rtol=magnified * 10 * steps * EPS)
    assert (np.diff(velocity) >= -magnified * 4 * EPS * V_T).all()


@pytest.mark.parametrize(
    ("method", "staged"),
    [("velocity_verlet", False), ("rk4", False), ("yoshida4", False), ("velocity_verlet", True), ("yoshida4", True)],
)
@pytest.mark.parametrize("dt", [1 / 60, 2.5 * TAU, 100 * TAU])
def test_linear_damping_has_the_exact_position(method, staged, dt):
    """B7: y = v_t (t - tau (1 - e^(-t/tau))): where no force depends on the state, and in every Verlet step."""
    y, _ = damped_fall(method, dt, 200, staged)
    t = dt * np.arange(201)
    np.testing.assert_allclose(y, V_T * (t + TAU * np.expm1(-t / TAU)), rtol=1e-11, atol=1e-15)


@pytest.mark.parametrize("method", ["explicit_euler", "semi_implicit_euler", "rk4"])
def test_linear_damping_has_the_methods_order_in_position(method):
    """B7: the position error falls by 2^p, p within 5 %."""
    errors = []
    for steps in (40, 80):
        y, _ = damped_fall(method, 2.0 / steps, steps, staged=True)
        errors.append(abs(y[-1] - V_T * (2.0 + TAU * math.expm1(-2.0 / TAU))))
    assert math.log2(errors[0] / errors[1]) == pytest.approx(ORDERS[method], rel=0.05)


@all_methods
def test_linear_damping_has_the_methods_order_with_a_spring(method):
    """Damping beside a force that depends on position keeps the method's order: exact solution of B3, zeta = 0.5."""
    w, errors = math.sqrt(STIFFNESS), []
    for steps in (200, 400):
        world = make_world(dt=1 / steps, integrator=method)
        world.create_entity(Transform((1, 0)), RigidBody(linear_damping=w), Oscillator(STIFFNESS))
        world.add_system(SpringForce())
        positions, velocities = record(world, steps)
        x, v = damped_oscillation(0.5, 1.0)
        errors.append(math.hypot(positions[-1, 0, 0] - x, (velocities[-1, 0, 0] - v) / w))
    assert math.log2(errors[0] / errors[1]) == pytest.approx(ORDERS[method], rel=0.05)


@all_methods
def test_heavily_damped_bodies_creep(method):
    """c = 600 / s at 60 Hz on a spring of 600 N/m: x = e^(-t) to the first order, (k / c) dt = 1/60.

    A body without damping beside it does not notice.
    """
    world = make_world(dt=1 / 60, integrator=method)
    world.create_entity(Transform((1, 0)), RigidBody(linear_damping=600.0), Oscillator(600.0))
    world.create_entity(Transform((1, 0)), RigidBody(), Oscillator(1.0))
    world.add_system(SpringForce())
    positions, _ = record(world, 60)
    np.testing.assert_allclose(positions[:, 0, 0], np.exp(-np.arange(61) / 60), rtol=0.05)
    expected = matrix_powers(method, 1.0, 0.0, 1 / 60, 60)[:, 0]
    np.testing.assert_allclose(positions[:, 1, 0], expected, rtol=0, atol=1e-13)


class SpringForce(ForceSystem):
    requires = (Oscillator,)

    def add_forces(self, bodies, time):
        bodies.force[:] -= bodies.oscillator.stiffness[:, None] * bodies.position


# -- time reversal: B8 ---------------------------------------------------------------------------


class Network(ForceSystem):
    """Springs between bodies: F = -K x."""

    def __init__(self, stiffness):
        self.stiffness = stiffness

    def add_forces(self, bodies, time):
        bodies.force[:] -= self.stiffness @ bodies.position


def return_error(method, steps=1000):
    """Forward, velocities turned round, back: how far from the start, relative to the largest coordinate."""
    rng = np.random.default_rng(8)
    n = 100
    springs = np.triu(rng.random((n, n)) < 0.05, 1) * rng.uniform(1.0, 5.0, (n, n))
    springs = springs + springs.T
    start = rng.uniform(-1, 1, (n, 2))
    world = make_world(dt=1 / 60, integrator=method)
    world.create_entities(n, Transform.many(start), RigidBody.many(rng.uniform(0.5, 2, n), rng.normal(size=(n, 2))))
    world.add_system(Network(np.diag(springs.sum(axis=1)) - springs))
    for _ in range(2):
        for _ in range(steps):
            world.step()
        world.bodies.linear_velocity[:] *= -1
    return np.abs(world.bodies.position - start).max()


@all_methods
def test_time_reversal(method):
    """B8: 100 bodies, springs, no collisions. VV and YO4 are their own adjoints and come back; the others do not."""
    error = return_error(method)
    if method in ("velocity_verlet", "yoshida4"):
        assert error < 1e-12
    else:
        assert error > 1e-9  # else the test would not tell
