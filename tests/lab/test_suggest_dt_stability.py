"""suggest_dt and step_limits: known limits of stability, and the oscillation that limits the step."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from helpers_motion import METHODS, NOISE, Oscillator, SpringAndDrag, all_methods, oscillators
from oracles import integrators_naive as naive
from worlds import make_world

from carom.components import RigidBody, Transform
from carom.framework import ForceSystem, Plugin, Settings, World
from carom.lab.limits.stability import stability_limits
from carom.lab.limits.step_length import SAFETY, step_limits, suggest_dt
from carom.plugins import Physics
from carom.plugins.rotation import Rotation, Spin
from carom.plugins.springs import Springs
from carom.systems import Integrator
from carom.systems.integration.integrators import STANDARD_INTEGRATORS

# B6: undamped, drag alone (dt = limit / c), then damping ratios 0.05, 0.5 and 1; as (stiffness, drag) at omega = 1
COLUMNS = [(1.0, 0.0), (0.0, 1.0), (1.0, 0.1), (1.0, 1.0), (1.0, 2.0)]
TABLE = {
    "explicit_euler": (0, 2, 0.1, 1.0, 2.0),
    "semi_implicit_euler": (2, 2, 1.902, 1.236, 0.828),
    "velocity_verlet": (2, 2, 1.91, 2.0, 1.0),
    "rk4": (2 * math.sqrt(2), 2.7853, 2.91, 2.62, 2.7853),
}
DIGITS = 3e-3  # of the table


class Force(ForceSystem):
    """A function of position and velocity, (n, d) N."""

    def __init__(self, function):
        self.function = function

    def add_forces(self, bodies, time):
        bodies.force[:] += self.function(bodies.position, bodies.linear_velocity)


class Torsion(ForceSystem):
    """Torque = -k angle - c w, in 3D about the last axis."""

    requires = (Spin,)

    def __init__(self, stiffness, drag):
        self.stiffness, self.drag = stiffness, drag

    def add_forces(self, bodies, time):
        w, q = bodies.spin.angular_velocity, bodies.rotation
        if q.ndim == 1:
            bodies.torque -= self.stiffness * q + self.drag * w
        else:
            bodies.torque[:, 2] -= self.stiffness * 2 * np.arctan2(q[:, 3], q[:, 0]) + self.drag * w[:, 2]


def turning(d, method, stiffness, drag, damping=0.0, dt=1 / 60):
    """A body of 0.8 kg m^2 turned by 1 mrad, and one without a Spin that takes no part."""
    world = World(Physics(d, gravity=0), Rotation(), settings=Settings(integrator=method, dt=dt))
    spin = Spin(0.0 if d == 2 else (0.0, 0.0, 0.0), 0.8 if d == 2 else (2.0, 1.5, 0.8), angular_damping=damping)
    turn = 1e-3 if d == 2 else (math.cos(5e-4), 0.0, 0.0, math.sin(5e-4))
    world.create_entity(Transform((1,) * d), RigidBody())
    world.create_entity(Transform((2,) * d, turn), RigidBody(mass=5.0), spin)
    world.add_system(Torsion(0.8 * stiffness, 0.8 * drag))
    return world


# -- the published table -------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("method", TABLE)
def test_the_limits_are_those_of_the_table(method):
    """B6, for w = 40 /s, of places and of turns: 0.9 of the limit is suggested; 0 where no step is stable."""
    w = 40.0
    for k, ((stiffness, drag), limit) in enumerate(zip(COLUMNS, TABLE[method], strict=True)):
        place = oscillators(method, 1 / 60, stiffness * w * w, drag * w, mass=1.0, v0=1.0)
        for world in (place, turning(2 + k % 2, method, stiffness * w * w, drag * w)):
            before = world.state_hash()
            found = step_limits(world)
            assert world.state_hash() == before
            assert found.stability * w == pytest.approx(limit, abs=DIGITS)
            assert found.suggested == SAFETY * found.stability
            assert k or found.suggested == suggest_dt(world)
            assert found.oscillation.frequency == pytest.approx(w * math.sqrt(stiffness), rel=NOISE)
            assert found.oscillation.drag == pytest.approx(w * drag, rel=NOISE)
            assert found.oscillation.entity == (1 if world is place else 2)
            world.close()


@pytest.mark.slow
@all_methods
def test_limits_are_those_of_the_textbooks_step(method):
    """For damping ratios between those of the table, and Yoshida's method, which is not in it."""
    drags = (0.0, 0.02, 0.3, 0.7, 1.5, 3.0, 10.0)
    limits = stability_limits(STANDARD_INTEGRATORS[method], "discrete", 1.0, drags)
    for drag, limit in zip(drags, limits, strict=True):
        expected = naive.stability_limit(method, 1.0, drag)
        assert limit == pytest.approx(expected if expected > 1e-5 else 0.0, rel=1e-6, abs=1e-9)


def test_a_limit_beyond_which_a_longer_step_is_stable_again():
    """Yoshida's method takes one Verlet step, not three, from linear_damping * dt = 5 on: the first limit counts."""
    limit = stability_limits(STANDARD_INTEGRATORS["yoshida4"], "discrete", 3.158, 0.0261, 4.444)[0]
    assert 0.4 < limit < 5 / 4.444 * (1 + 1e-9)


@pytest.mark.slow
def test_event_driven_worlds_have_the_limits_of_their_flight():
    """Second order, like velocity Verlet, for any integrator: 2 and 1.91 (B6)."""
    for (stiffness, drag), limit in zip(COLUMNS, TABLE["velocity_verlet"], strict=True):
        found = step_limits(oscillators("explicit_euler", 1 / 60, stiffness, drag, collision="event_driven"))
        assert (found.stability, found.integrator) == (pytest.approx(limit, abs=DIGITS), "flight")


@pytest.mark.slow
def test_an_integrator_of_a_plugin():
    """Midpoint (B6): 0, 2, 0.80, 2.0, 2.0."""
    plugin = Plugin("midpoint")

    @plugin.integrator("midpoint")
    class Midpoint(Integrator):
        order, evaluations = 2, 2

        def advance(self, motion, dt):
            v0 = motion.velocity.copy()
            motion.position += dt / 2 * v0
            motion.velocity += dt / 2 * motion.inverse_mass[:, None] * motion.force
            middle = motion.velocity.copy()
            motion.evaluate(dt / 2)
            motion.position[:] = motion.start_position + dt * middle
            motion.velocity[:] = v0 + dt * motion.inverse_mass[:, None] * motion.force

    for (stiffness, drag), limit in zip(COLUMNS, (0, 2, 0.80, 2.0, 2.0), strict=True):
        with World(Physics(), plugin, settings=Settings(integrator="midpoint")) as world:
            world.create_entity(Transform((1, 0)), RigidBody(), Oscillator(stiffness, drag))
            world.add_system(SpringAndDrag())
            found = step_limits(world).stability
        assert found == (pytest.approx(limit, abs=1e-2) if limit else 0.0)
        world.close()


# -- what takes part -----------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(("n", "d", "share"), [(2, 2, 0), (7, 3, 0), (30, 2, 0), (60, 2, 0.01), (320, 2, 0.01)])
def test_chains_of_springs(n, d, share):
    """n bodies between two walls, w_max = 2 sqrt(k / m) sin(n pi / (2 (n + 1))), is found to rounding of the
    differences; of more than 60 degrees of freedom to a hundredth."""
    springs = Springs()
    world = World(Physics(dimensions=d), springs)
    ends = [world.create_entity(Transform((float(k), *(0.0,) * (d - 1))),
                                RigidBody(2.0, kind="dynamic" if 0 < k <= n else "static"))
            for k in range(n + 2)]  # fmt: skip
    for a, b in itertools.pairwise(ends):
        springs.connect(a, b, stiffness=50.0)
    highest, limits = 2 * 5.0 * math.sin(n * math.pi / (2 * (n + 1))), step_limits(world)
    assert highest * (1 - NOISE - share) <= limits.oscillation.frequency <= highest * (1 + NOISE)
    assert limits.stability == pytest.approx(2 / limits.oscillation.frequency, rel=NOISE)


def growth_of_system(method, force, damping, h):
    """The largest absolute eigenvalue of one step of bodies on a line, by steps of each state of a basis."""
    n = len(damping)
    world = make_world(dt=h, integrator=method)
    world.create_entities(n, Transform.many(np.zeros((n, 2))), RigidBody.many(linear_damping=damping))
    world.add_system(Force(force))
    columns = []
    for state in np.eye(2 * n):
        world.bodies.position[:, 0], world.bodies.linear_velocity[:, 0] = state[:n], state[n:] / h
        world.step()
        columns.append(np.append(world.bodies.position[:, 0], world.bodies.linear_velocity[:, 0] * h))
    world.close()
    return np.abs(np.linalg.eigvals(np.array(columns).T)).max()


@pytest.mark.slow
@pytest.mark.parametrize(("method", "seed"), list(zip(METHODS, range(len(METHODS)), strict=True)))
def test_coupled_bodies_grow_from_about_the_limit_on(method, seed):
    """Random springs, dampers and linear damping of two to four bodies: the eigenvalues of the world's own step. Modes
    that springs and drag do not share may have another limit, by less than 1.6 times."""
    random = np.random.default_rng(seed)
    n = int(random.integers(2, 5))
    springs, dampers = (random.normal(size=(n, n)) * s for s in (10.0, 2.0))
    stiffness, drag, damping = springs @ springs.T, dampers @ dampers.T, random.uniform(0, 5, n) * (seed % 2)

    def force(x, v):
        return -(stiffness @ x + drag @ v) * (1, 0)

    world = make_world(integrator=method)
    world.create_entities(n, Transform.many(np.ones((n, 2))), RigidBody.many(linear_damping=damping))
    world.add_system(Force(force))
    limit = step_limits(world).stability
    assert limit > 1e-3
    assert growth_of_system(method, force, damping, 0.6 * limit) <= 1 + 1e-9
    assert growth_of_system(method, force, damping, 1.6 * limit) > 1 + 1e-3
    world.close()


@pytest.mark.slow
@pytest.mark.parametrize(("d", "method"), [(2, "semi_implicit_euler"), (3, "velocity_verlet"), (2, "rk4")])
def test_a_turning_body_grows_beyond_the_limit_alone(d, method):
    for drag in (0.0, 20.0):
        with turning(d, method, 1600.0, drag) as world:
            limit = step_limits(world).stability
        for part, grows in ((0.97, False), (1.05, True)):
            with turning(d, method, 1600.0, drag, dt=part * limit) as world:
                largest = 0.0
                for _ in range(200):
                    world.step()
                    largest = max(largest, float(np.abs(world.bodies.spin.angular_velocity).max()))
                assert (largest > 0.4) == grows


def limit_under(force, method="semi_implicit_euler", place=(1.0, 0.0), damping=0.0):
    world = make_world(integrator=method)
    world.create_entity(Transform(place), RigidBody(linear_velocity=(1, 0), linear_damping=damping))
    world.add_system(Force(force))
    return step_limits(world).stability


@pytest.mark.parametrize(("method", "limit"), [("semi_implicit_euler", 0.0), ("velocity_verlet", 0.0), ("rk4", 8**0.5)])
def test_forces_that_turn_the_velocity(method, limit):
    """A magnetic field, 5 rad/s: eigenvalues on the imaginary axis."""
    found = limit_under(lambda x, v: 5.0 * np.column_stack((-v[:, 1], v[:, 0])), method)
    assert found == pytest.approx(limit / 5, rel=1e-6)


@pytest.mark.slow
def test_damping_alone_has_no_limit():
    """It is an integrating factor; beside a spring it gives explicit Euler the limit c / k (derived: det = 1)."""
    for method in METHODS:
        assert limit_under(lambda x, v: 0.0 * x, method, damping=1e6) == math.inf
    assert limit_under(lambda x, v: -100.0 * x, "explicit_euler", damping=3.0) == pytest.approx(0.03, rel=1e-6)
    assert limit_under(lambda x, v: -100.0 * x, damping=3.0) >= 2 / 10 * (1 - NOISE)
    assert step_limits(turning(2, "explicit_euler", 100.0, 0.0, 3.0)).stability == pytest.approx(0.03, rel=1e-5)
    assert step_limits(turning(2, "explicit_euler", 0.0, 0.0, 1e6)).stability == math.inf


def test_free_motion_and_what_grows_by_itself_limit_no_step():
    """Two bodies with a damped spring between them: their centre moves freely, which explicit Euler integrates well. A
    body on top of a hill: no step could prevent the growth. A rope at its full length counts as taut."""
    for settings, options, expected in (
        ({"integrator": "explicit_euler"}, {"stiffness": 2.0, "damping": 0.5}, 1.0 / 4.0),  # c / k, both doubled
        ({}, {"stiffness": 400.0, "only_pulls": True}, 2 / math.sqrt(800.0)),
    ):
        springs = Springs()
        world = World(Physics(), springs, settings=Settings(**settings))
        a, b = (world.create_entity(Transform((x, 0)), RigidBody()) for x in (0, 1))
        springs.connect(a, b, **options)
        assert step_limits(world).stability == pytest.approx(expected, rel=1e-4)
    assert step_limits(oscillators("velocity_verlet", 1 / 60, [-4.0, 1.0])).stability == pytest.approx(2.0, rel=NOISE)
    assert suggest_dt(oscillators("velocity_verlet", 1 / 60, -4.0)) == math.inf


def test_far_from_the_origin():
    """A spring of 2 rad/s to a point 10,000 km from the origin."""
    assert limit_under(lambda x, v: -4.0 * (x - (1e7, -3e6)), place=(1e7 + 1, -3e6)) == pytest.approx(1.0, rel=1e-4)
