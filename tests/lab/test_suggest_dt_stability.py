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


# -- the published table -------------------------------------------------------------------------


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
            assert found.suggested == suggest_dt(world) == SAFETY * found.stability
            assert found.oscillation.frequency == pytest.approx(w * math.sqrt(stiffness), rel=NOISE)
            assert found.oscillation.drag == pytest.approx(w * drag, rel=NOISE)
            assert found.oscillation.entity == (1 if world is place else 2)
            world.close()


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


def test_event_driven_worlds_have_the_limits_of_their_flight():
    """Second order, like velocity Verlet, for any integrator: 2 and 1.91 (B6)."""
    for (stiffness, drag), limit in zip(COLUMNS, TABLE["velocity_verlet"], strict=True):
        found = step_limits(oscillators("explicit_euler", 1 / 60, stiffness, drag, collision="event_driven"))
        assert found.stability == pytest.approx(limit, abs=DIGITS)
        assert found.integrator == "flight"


# -- which oscillation it is ---------------------------------------------------------------------


def chain(n, stiffness=50.0, mass=2.0, damping=0.0, dimensions=2, **settings):
    """n bodies between two walls, joined by springs: w_max = 2 sqrt(k / m) sin(n pi / (2 (n + 1)))."""
    springs = Springs()
    world = World(Physics(dimensions=dimensions), springs, settings=Settings(**settings))
    ends = [
        world.create_entity(
            Transform((float(k), *(0.0,) * (dimensions - 1))),
            RigidBody(mass, kind="dynamic" if 0 < k <= n else "static"),
        )
        for k in range(n + 2)
    ]
    for a, b in itertools.pairwise(ends):
        springs.connect(a, b, stiffness=stiffness, damping=damping)
    return world, 2 * math.sqrt(stiffness / mass) * math.sin(n * math.pi / (2 * (n + 1)))


@pytest.mark.parametrize(("n", "d", "share"), [(2, 2, 0), (7, 3, 0), (30, 2, 0), (60, 2, 0.01), (320, 2, 0.01)])
def test_chains_of_springs(n, d, share):
    """The highest mode is found to rounding of the differences; of more than 60 degrees of freedom to a hundredth."""
    world, highest = chain(n, dimensions=d)
    limits = step_limits(world)
    assert highest * (1 - NOISE - share) <= limits.oscillation.frequency <= highest * (1 + NOISE)
    assert limits.stability == pytest.approx(2 / limits.oscillation.frequency, rel=NOISE)


class Matrices(ForceSystem):
    """F = -K x - C v along the first axis, of bodies of one kilogram."""

    def __init__(self, stiffness, drag):
        self.stiffness, self.drag = stiffness, drag

    def add_forces(self, bodies, time):
        bodies.force[:, 0] -= self.stiffness @ bodies.position[:, 0] + self.drag @ bodies.linear_velocity[:, 0]


def growth_of_system(method, stiffness, drag, damping, h):
    """The largest absolute eigenvalue of one step of coupled bodies, by steps of each state of a basis."""
    n = len(damping)
    world = make_world(dt=h, integrator=method)
    for rate in damping:
        world.create_entity(Transform((0, 0)), RigidBody(linear_damping=rate))
    world.add_system(Matrices(stiffness, drag))
    columns = []
    for state in np.eye(2 * n):
        world.bodies.position[:, 0], world.bodies.linear_velocity[:, 0] = state[:n], state[n:] / h
        world.step()
        columns.append(np.append(world.bodies.position[:, 0], world.bodies.linear_velocity[:, 0] * h))
    world.close()
    return np.abs(np.linalg.eigvals(np.array(columns).T)).max()


@pytest.mark.parametrize(("method", "seed"), list(zip(METHODS, range(len(METHODS)), strict=True)))
def test_coupled_bodies_are_stable_up_to_the_suggestion_and_not_beyond_the_limit(method, seed):
    """Random springs, dampers and linear damping of two to four bodies: the eigenvalues of the world's own step."""
    random = np.random.default_rng(seed)
    n = int(random.integers(2, 5))
    springs, dampers = (random.normal(size=(n, n)) * s for s in (10.0, 2.0))
    stiffness, drag, damping = springs @ springs.T, dampers @ dampers.T, random.uniform(0, 5, n) * (seed % 2)
    world = make_world(integrator=method)
    for rate in damping:
        world.create_entity(Transform((1, 0)), RigidBody(linear_damping=rate))
    world.add_system(Matrices(stiffness, drag))
    limit = step_limits(world).stability
    assert 1e-3 < suggest_dt(world) == SAFETY * limit
    assert growth_of_system(method, stiffness, drag, damping, 0.6 * limit) <= 1 + 1e-9
    assert growth_of_system(method, stiffness, drag, damping, 1.7 * limit) > 1 + 1e-3
    world.close()


def test_free_motion_of_what_hangs_together_has_no_limit():
    """Two bodies with a damped spring between them: their centre moves freely, which explicit Euler integrates well."""
    springs = Springs()
    world = World(Physics(), springs, settings=Settings(integrator="explicit_euler"))
    a, b = (world.create_entity(Transform((x, 0)), RigidBody()) for x in (0, 1))
    springs.connect(a, b, stiffness=2.0, damping=0.5)
    assert suggest_dt(world) == pytest.approx(SAFETY * 1.0 / 4.0, rel=1e-5)  # c / k, both doubled


@pytest.mark.parametrize(("method", "limit"), [("semi_implicit_euler", 0.0), ("velocity_verlet", 0.0), ("rk4", 8**0.5)])
def test_forces_that_turn_the_velocity(method, limit):
    """A magnetic field, 5 rad/s: eigenvalues on the imaginary axis."""

    class Field(ForceSystem):
        def add_forces(self, bodies, time):
            v = bodies.linear_velocity
            bodies.force[:] += 5.0 * np.column_stack((-v[:, 1], v[:, 0]))

    world = make_world(integrator=method)
    world.create_entity(Transform((1, 0)), RigidBody(linear_velocity=(1, 0)))
    world.add_system(Field())
    assert step_limits(world).stability == pytest.approx(limit / 5, rel=1e-6)


def test_linear_damping_alone_has_no_limit():
    """It is an integrating factor; beside a spring it gives explicit Euler the limit c / k (derived: det = 1)."""

    def limit(damping, stiffness, method):
        world = make_world(integrator=method)
        world.create_entity(Transform((1, 0)), RigidBody(linear_damping=damping), Oscillator(stiffness))
        world.add_system(SpringAndDrag())
        return step_limits(world).stability

    for method in METHODS:
        assert limit(1e6, 0.0, method) == math.inf
    assert limit(3.0, 100.0, "explicit_euler") == pytest.approx(3.0 / 100.0, rel=1e-6)
    assert limit(3.0, 100.0, "semi_implicit_euler") >= 2 / 10 * (1 - NOISE)


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


def test_angular_damping_counts_beside_torques():
    """As linear damping does beside forces, and alone it has no limit."""
    assert step_limits(turning(2, "explicit_euler", 100.0, 0.0, 3.0)).stability == pytest.approx(3.0 / 100.0, rel=1e-5)
    assert step_limits(turning(2, "explicit_euler", 0.0, 0.0, 1e6)).stability == math.inf


def test_a_rope_at_its_full_length_counts_as_taut():
    springs = Springs()
    world = World(Physics(), springs)
    a, b = world.create_entity(Transform((0, 0)), RigidBody()), world.create_entity(Transform((1, 0)), RigidBody(1.0))
    springs.connect(a, b, stiffness=800.0, only_pulls=True)
    assert step_limits(world).stability == pytest.approx(2 / 40, rel=1e-4)


def test_what_grows_by_itself_limits_no_step():
    """A body on top of a hill: no step could prevent the growth."""
    world = oscillators("velocity_verlet", 1 / 60, [-4.0, 1.0])
    assert step_limits(world).stability == pytest.approx(2.0, rel=NOISE)
    assert suggest_dt(oscillators("velocity_verlet", 1 / 60, -4.0)) == math.inf


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

    found = []
    for stiffness, drag in COLUMNS:
        world = World(Physics(), plugin, settings=Settings(integrator="midpoint"))
        world.create_entity(Transform((1, 0)), RigidBody(), Oscillator(stiffness, drag))
        world.add_system(SpringAndDrag())
        found.append(step_limits(world).stability)
        world.close()
    np.testing.assert_allclose(found, (0, 2, 0.80, 2.0, 2.0), atol=1e-2)
    assert found[0] == 0.0


def test_far_from_the_origin():
    """A spring of 2 rad/s to a point 10,000 km from the origin."""

    class Pull(ForceSystem):
        def add_forces(self, bodies, time):
            bodies.force -= 4.0 * (bodies.position - (1e7, -3e6))

    world = make_world()
    for x in (0, 1, 2):
        world.create_entity(Transform((1e7 + x, -3e6)), RigidBody())
    world.add_system(Pull())
    assert step_limits(world).stability == pytest.approx(1.0, rel=1e-4)
