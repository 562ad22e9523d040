"""Torques of force systems: the order of the integrator holds for turns as it does for places."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.linalg
from helpers_pairwise import half, pairwise
from rotation.helpers_turning import box, part, turned, turning_world, wall
from scipy.integrate import solve_ivp
from scipy.special import ellipj
from worlds import run

from carom.components import RigidBody, SphereCollider, Transform
from carom.framework import ForceSystem, Phase, StepError, System
from carom.plugins.rotation import Spin

pytestmark = pytest.mark.plain
ORDERS = {"explicit_euler": 1, "semi_implicit_euler": 1, "velocity_verlet": 2, "yoshida4": 4, "rk4": 4, "flight": 2}
methods = pytest.mark.parametrize("method", ORDERS)
STIFFNESS, MOMENT = 7.0, 0.8
MOMENTS, ARM, FIELD = np.array((0.5, 0.8, 1.1)), np.array((0.2, -0.1, 0.3)), np.array((1.0, 0.5, -2.0))


class Forces(ForceSystem):
    """A function adds them, to bodies with a Spin."""

    requires = (Spin,)

    def __init__(self, add):
        self.add = add

    def add_forces(self, bodies, time):
        self.add(bodies)


def chosen(method):
    return {"collision": "event_driven"} if method == "flight" else {"integrator": method}


def space(d, method, dt=1 / 60):
    return turning_world(d, dt=dt, **chosen(method))


def end_of(method, dt, add, spin, start=0.0, seconds=1.0, seen=("rotation",)):
    """Columns of a body of 1 kg after some seconds; another one, without a Spin, makes force systems see copies."""
    d = 3 if np.ndim(spin.angular_velocity) else 2
    with space(d, method, dt) as world:
        entity = world.create_entity(Transform((0.3, *(0.0,) * (d - 1)), start), RigidBody(), spin)
        world.create_entity(Transform((9.0,) * d), RigidBody())
        world.add_system(Forces(add))
        run(world, round(seconds / dt))
        row = world.bodies.row_of(entity)
        found = {"x": world.bodies.position[row, :1], "spin": world.bodies.spin.angular_velocity[row]}
        found["rotation"] = world.bodies.rotation[row]
        return np.concatenate([np.atleast_1d(found[name]) for name in seen])


def spring(bodies):
    bodies.torque -= STIFFNESS * bodies.rotation


def swing(bodies):
    bodies.torque -= STIFFNESS * np.sin(bodies.rotation)


def couple(bodies):
    bodies.force[:, 0] -= 5.0 * bodies.position[:, 0] + 2.0 * bodies.rotation
    bodies.torque -= STIFFNESS * bodies.rotation + 2.0 * bodies.position[:, 0]


def needle(bodies):
    bodies.torque += np.cross(turned(bodies.rotation, ARM), FIELD)


def damped():
    """The angle of a torsion spring."""
    rate = math.sqrt(STIFFNESS / MOMENT - 0.9**2 / 4)
    return 1.1 * math.exp(-0.45) * (math.cos(rate) + 0.45 / rate * math.sin(rate))


def over_the_top():
    """(angle, spin) of a pendulum, angle'' = -k sin(angle), from 0: twice Jacobi's amplitude."""
    _, _, dn, am = ellipj(OVER / 2, 4 * STIFFNESS / MOMENT / OVER**2)
    return 2 * am, OVER * dn


def coupled():
    """(place, angle, spin) of two oscillators of one body: the exponential of a matrix."""
    rates = np.zeros((4, 4))
    rates[0, 2] = rates[1, 3] = 1.0
    rates[2, :2], rates[3, :2] = (-5.0, -2.0), (-2.0 / MOMENT, -STIFFNESS / MOMENT)
    return (scipy.linalg.expm(rates) @ (0.3, 1.1, 0.0, 0.4))[[0, 1, 3]]


def heavy_top():
    """(quaternion, angular velocity along the world's axes) of a needle in a field, by another method."""

    def rates(t, state):
        q, w = state[:4], state[4:]
        back = q * (1, -1, -1, -1)
        moved = np.concatenate(((-q[1:] @ w,), q[0] * w + np.cross(q[1:], w)))  # w along the body's axes
        return np.concatenate((moved / 2, (np.cross(MOMENTS * w, w) + np.cross(ARM, turned(back, FIELD))) / MOMENTS))

    end = solve_ivp(rates, (0, 1.0), (1.0, 0, 0, 0, *TUMBLE), "DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
    q = end[:4] / np.linalg.norm(end[:4])
    return np.concatenate((q, turned(q, end[4:])))


OVER, TUMBLE = 1.3 * 2 * math.sqrt(STIFFNESS / MOMENT), (1.5, -2.0, 0.8)
MOTIONS = {  # forces, the spin and the angle of the body, what is seen, its exact values after a second, steps in it
    "a damped torsion spring": (spring, Spin(0.0, MOMENT, angular_damping=0.9), 1.1, ("rotation",), damped, 20),
    "a pendulum over the top": (swing, Spin(OVER, MOMENT), 0.0, ("rotation", "spin"), over_the_top, 60),
    "coupled oscillators": (couple, Spin(0.4, MOMENT), 1.1, ("x", "rotation", "spin"), coupled, 20),
    "a needle in a field": (needle, Spin(TUMBLE, MOMENTS), 0.0, ("rotation", "spin"), heavy_top, 40),
}


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize(("motion", "method"), half(MOTIONS, ORDERS))
def test_errors_fall_with_the_step_as_the_integrator_says(motion, method):
    """From four to eight times the steps."""
    add, spin, start, seen, exact, steps = MOTIONS[motion]
    exact, counts = exact(), (4 * steps, 8 * steps)
    errors = [np.linalg.norm(end_of(method, 1 / n, add, spin.copy(), start, seen=seen) - exact) for n in counts]
    assert math.log2(errors[0] / errors[1]) == pytest.approx(ORDERS[method], abs=0.2), errors


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize(
    ("method", "faster", "bound"),
    [("velocity_verlet", 1, 3e-4), ("rk4", 1, 1e-6), ("velocity_verlet", 40, 1e-3), ("yoshida4", 40, 1e-3)],
)
def test_the_energy_of_a_heavy_top_stays(method, faster, bound):
    """10 s at 60 Hz; and so does the angular momentum along the field, which no torque changes. The fast one turns by
    1.7 rad in a step."""
    w0 = faster * np.array(TUMBLE)
    end = end_of(method, 1 / 60, needle, Spin(w0, MOMENTS), seconds=10.0, seen=("rotation", "spin"))
    q, w = end[:4], end[4:]
    own = turned(q * (1, -1, -1, -1), w)
    energy, start = own @ (MOMENTS * own) / 2 - turned(q, ARM) @ FIELD, w0 @ (MOMENTS * w0) / 2 - ARM @ FIELD
    assert abs(energy - start) < bound * abs(start)
    along, before = turned(q, MOMENTS * own) @ FIELD, MOMENTS * w0 @ FIELD
    assert abs(along - before) < bound * abs(before)


@pytest.mark.slow
@pytest.mark.compiled
@methods
@pytest.mark.parametrize("d", [2, 3])
def test_a_failed_step_and_a_snapshot_bring_back_every_bit(d, method):
    class Fails(System):
        armed = False

        def process(self, dt):
            if self.armed:
                raise RuntimeError("as ordered")

    with space(d, method) as world:
        spin = Spin(0.7 if d == 2 else (0.3, 0.7, -1.0))
        world.create_entity(Transform((0,) * d, 0.3 * (d == 2)), RigidBody(), spin, SphereCollider(0.5))
        fails = Fails()
        world.add_system(fails)
        world.add_system(Forces(spring if d == 2 else needle))
        run(world, 10)
        kept, before = world.snapshot(), world.state_hash()
        fails.armed = True
        with pytest.raises(StepError, match="as ordered"):
            world.step()
        assert world.state_hash() == before
        fails.armed = False
        run(world, 10)
        later = world.state_hash()
        world.restore(kept)
        run(world, 10)
        assert world.state_hash() == later


@pytest.mark.slow
@pytest.mark.parametrize(("wrong", "d", "method"), pairwise((math.nan, -math.inf, 1e200), (2, 3), tuple(ORDERS)))
def test_a_torque_that_cannot_be_takes_its_body_out(wrong, d, method):
    """As a force that cannot be does: it is named once, stands still, and others go on to the bit as without it."""
    torque = [0.3]

    def push(bodies):
        bodies.torque[:-1] += torque[0]
        bodies.torque[-1] += 0.3

    def mover(world, x):
        spin = Spin(0.5, 1.0) if d == 2 else Spin((0.5, 0.4, 0.3), MOMENTS)
        return world.create_entity(Transform((x, *(0.0,) * (d - 1))), RigidBody(linear_velocity=(1.0,) * d), spin)

    with space(d, method) as world, space(d, method) as alone:
        world.settings = world.settings.replace(on_fault="ignore")
        victim, other, same = mover(world, 0.0), mover(world, 9.0), mover(alone, 9.0)
        for each in (world, alone):
            each.add_system(Forces(push))
            each.step()
        body, spin = part(world, victim, Transform), part(world, victim, Spin)
        before = body.position.tolist(), np.array(body.rotation), np.array(spin.angular_velocity)
        torque[0] = wrong
        for _ in range(3):
            world.step()
            alone.step()
        value = wrong if d == 2 else [wrong] * 3
        assert world.faults == [
            f"entity {victim}: torque is {value}; until it is mended the body takes no part in the simulation"
        ]
        assert body.position.tolist() == before[0]
        assert np.all(body.rotation == before[1])
        assert np.all(spin.angular_velocity == before[2])
        for kind, field in ((Transform, "position"), (Transform, "rotation"), (Spin, "angular_velocity")):
            one, two = (getattr(part(w, e, kind), field) for w, e in ((world, other), (alone, same)))
            assert np.all(one == two)
        torque[0] = 0.3
        world.step()
        assert np.all(spin.angular_velocity != before[2])
        assert body.position[0] > before[0][0]


@pytest.mark.compiled
@pytest.mark.parametrize("name", ["force", "torque"])
def test_what_would_be_lost_is_refused(name):
    """Forces and torques written where no step takes them; a force after FORCES is one that acts."""

    class Writes(System):
        def process(self, dt):
            getattr(self.world.bodies.dynamic, name)[:] += 3.0

    with space(2, "rk4") as world:
        entity = world.create_entity(Transform((0, 0)), RigidBody(), Spin(0.5, 1.0))
        world.add_system(Forces(spring))
        world.step()
        for bodies in (world.bodies, world.bodies.dynamic):
            with pytest.raises(ValueError, match="read-only"):
                getattr(bodies, name)[:] = 3.0
            with pytest.raises(ValueError, match="read-only"):
                setattr(bodies, name, 3.0)
        for phase in (Phase.START, Phase.FORCES, Phase.INTEGRATION, Phase.END):
            Writes.phase = phase
            system = Writes()
            world.add_system(system)
            if name == "force" and phase == Phase.FORCES:
                world.step()
                velocity = part(world, entity, RigidBody).linear_velocity
                assert velocity == pytest.approx([3.0 / 60] * 2)
            else:
                with pytest.raises(StepError, match=r"Writes.*read-only"):
                    world.step()
            world.remove_system(system)


@pytest.mark.compiled
@pytest.mark.parametrize("d", [2, 3])
def test_a_torque_wakes_what_sleeps_and_keeps_it_awake(d):
    strength = [0.0]

    def twist(bodies):
        bodies.torque += strength[0] if d == 2 else np.array((0.0, 0.0, strength[0]))

    def asleep():
        return [part(world, body, RigidBody).asleep for body in (turns, other)]

    with turning_world(d, 10.0, sleeping=True) as world:
        wall(world, (0.0, -1.0, 0.0)[:d], (50.0, 1.0, 50.0)[:d], friction=0.8)
        turns, other = (box(world, (x, 0.5, 0.0)[:d], (0.5,) * d) for x in (0.0, 5.0))
        world.remove_component(other, Spin)
        world.add_system(Forces(twist))
        run(world, 120)
        assert asleep() == [True, True]
        strength[0] = 0.1
        for _ in range(120):
            world.step()
            assert asleep() == [False, True]


def test_a_torque_needs_a_force_system_that_requires_a_spin():
    class Torsion(ForceSystem):
        def add_forces(self, bodies, time):
            bodies.torque += 1.0

    with space(2, "rk4") as world:
        world.create_entity(Transform((0, 0)), RigidBody(), Spin(0.5, 1.0))
        world.add_system(Torsion())
        with pytest.raises(StepError, match=r"Torsion: what adds to bodies.torque needs requires = \(Spin,\)"):
            world.step()


def test_torques_end_with_their_system():
    with space(2, "rk4") as world:
        entity = world.create_entity(Transform((0, 0), 1.0), RigidBody(), Spin(0.5, 1.0))
        system, spin = Forces(spring), part(world, entity, Spin)
        world.add_system(system)
        world.step()
        assert "turn_on_way" in {kernel.kernel for kernel in world.plan().kernels}
        world.remove_system(system)
        before = spin.angular_velocity
        world.step()
        assert spin.angular_velocity == before != 0.5
        assert "turn_on_way" not in {kernel.kernel for kernel in world.plan().kernels}


@pytest.mark.slow
@pytest.mark.compiled
@methods
@pytest.mark.parametrize("d", [2, 3])
def test_limits_of_speed_and_damping_that_no_step_resolves(d, method):
    """At most 2 rad/s and that turn, also under a constant torque; and what damps in a small part of a step neither
    swings nor overflows."""

    def push(bodies):
        bodies.torque += 50.0

    torque = 50.0 if d == 2 else (50.0,) * 3
    for given, spin in (
        (False, {"max_angular_speed": 2.0}), (True, {"max_angular_speed": 2.0, "constant_torque": torque}),
        (False, {"angular_damping": 30_000.0}),
    ):  # fmt: skip
        with space(d, method) as world:
            inertia = 0.1 if d == 2 else MOMENTS
            entity = world.create_entity(Transform((0,) * d), RigidBody(), Spin(inertia=inertia, **spin))
            if not given:
                world.add_system(Forces(push))
            for step in range(20):
                world.step()
                w = np.linalg.norm(part(world, entity, Spin).angular_velocity)
                assert 1.0 < w <= 2.0 + 1e-15 if "max_angular_speed" in spin else 1e-4 < w < 0.02
                if d == 2:
                    assert abs(part(world, entity, Transform).rotation) <= 2 * (step + 1) / 60 + 1e-12


@pytest.mark.slow
@pytest.mark.compiled
@methods
@pytest.mark.parametrize("d", [2, 3])
def test_a_wheel_on_the_ground_goes_as_under_a_constant_torque(d, method):
    """Contacts take what the torque has made of the spin: places and turns to 1e-6 of each other after a second."""
    torque, ends = -1.0 if d == 2 else np.array((0.0, 0.0, -1.0)), []

    def drive(bodies):
        bodies.torque += torque

    for given in (True, False):
        with turning_world(d, 10.0, **chosen(method)) as world:
            wall(world, (0.0, -1.0, 0.0)[:d], (50.0, 1.0, 50.0)[:d], friction=0.8)
            spin = Spin(constant_torque=torque) if given else Spin()
            place, shape = Transform((0.0, 0.5, 0.0)[:d]), SphereCollider(0.5, friction=0.8)
            wheel = world.create_entity(place, RigidBody(), spin, shape)
            if not given:
                world.add_system(Forces(drive))
            run(world, 60)
            ends.append(np.concatenate((part(world, wheel, Transform).position, np.atleast_1d(spin.angular_velocity))))
    assert ends[0][0] > 0.4
    assert np.allclose(*ends, rtol=0, atol=1e-6)
