"""Torques of force systems: the order of the integrator holds for turns as it does for places."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
import scipy.linalg
from scipy.integrate import solve_ivp
from scipy.special import ellipj

from carom.components import RigidBody, SphereCollider, Transform
from carom.framework import ForceSystem, Phase, Settings, StepError, System, World
from carom.plugins import Physics
from carom.plugins.rotation import BoxCollider, Rotation, Spin

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


def space(d, method, dt):
    chosen = {"collision": "event_driven"} if method == "flight" else {"integrator": method}
    return World(Physics(d, gravity=0), Rotation(), settings=Settings(dt=dt, **chosen))


def end_of(method, dt, add, spin, start=0.0, seconds=1.0, seen=("rotation",)):
    """Columns of a body of 1 kg after some seconds; another one, without a Spin, makes force systems see copies."""
    d = 3 if np.ndim(spin.angular_velocity) else 2
    with space(d, method, dt) as world:
        entity = world.create_entity(Transform((0.3, *(0.0,) * (d - 1)), start), RigidBody(), spin)
        world.create_entity(Transform((9.0,) * d), RigidBody())
        world.add_system(Forces(add))
        for _ in range(round(seconds / dt)):
            world.step()
        row = world.bodies.row_of(entity)
        found = {"x": world.bodies.position[row, :1], "spin": world.bodies.spin.angular_velocity[row]}
        found["rotation"] = world.bodies.rotation[row]
        return np.concatenate([np.atleast_1d(found[name]) for name in seen])


def check_order(method, end, exact, steps):
    """``end`` (dt) -> numbers: their error over three halvings of dt falls as the integrator says."""
    errors = [np.linalg.norm(end(1 / n) - exact) for n in (steps, 2 * steps, 4 * steps, 8 * steps)]
    orders = [math.log2(one / two) for one, two in itertools.pairwise(errors)]
    assert orders[-1] == pytest.approx(ORDERS[method], abs=0.2), (errors, orders)


def spring(bodies):
    bodies.torque -= STIFFNESS * bodies.rotation


@pytest.mark.compiled
@methods
@pytest.mark.parametrize("damping", [0.0, 0.9])
def test_a_torsion_spring_in_a_plane(method, damping):
    def end(dt):
        return end_of(method, dt, spring, Spin(0.0, MOMENT, angular_damping=damping), 1.1)

    rate = math.sqrt(STIFFNESS / MOMENT - damping**2 / 4)
    exact = 1.1 * math.exp(-damping / 2) * (math.cos(rate) + damping / (2 * rate) * math.sin(rate))
    check_order(method, end, exact, 20)


@pytest.mark.compiled
@methods
def test_a_pendulum_that_goes_over_the_top(method):
    """angle'' = -k sin(angle), from 0: twice Jacobi's amplitude."""

    def swing(bodies):
        bodies.torque -= STIFFNESS * np.sin(bodies.rotation)

    w = 1.3 * 2 * math.sqrt(STIFFNESS / MOMENT)
    _, _, dn, am = ellipj(w / 2, 4 * STIFFNESS / MOMENT / w**2)
    check_order(
        method, lambda dt: end_of(method, dt, swing, Spin(w, MOMENT), seen=("rotation", "spin")), (2 * am, w * dn), 60
    )


@pytest.mark.compiled
@methods
def test_a_force_that_the_angle_changes_and_a_torque_that_the_place_changes(method):
    """Two oscillators of one body, coupled: the exponential of a matrix."""

    def couple(bodies):
        bodies.force[:, 0] -= 5.0 * bodies.position[:, 0] + 2.0 * bodies.rotation
        bodies.torque -= STIFFNESS * bodies.rotation + 2.0 * bodies.position[:, 0]

    rates = np.zeros((4, 4))
    rates[0, 2] = rates[1, 3] = 1.0
    rates[2, :2], rates[3, :2] = (-5.0, -2.0), (-2.0 / MOMENT, -STIFFNESS / MOMENT)
    exact = (scipy.linalg.expm(rates) @ (0.3, 1.1, 0.0, 0.4))[[0, 1, 3]]
    check_order(
        method, lambda dt: end_of(method, dt, couple, Spin(0.4, MOMENT), 1.1, seen=("x", "rotation", "spin")), exact, 20
    )


@pytest.mark.compiled
@methods
def test_a_torsion_spring_about_a_principal_axis(method):
    def twist(bodies):
        bodies.torque[:, 2] -= STIFFNESS * 2 * np.arctan2(bodies.rotation[:, 3], bodies.rotation[:, 0])

    def end(dt):
        q = end_of(method, dt, twist, Spin((0.0, 0.0, 0.7), (0.5, 0.6, MOMENT)), (math.cos(0.5), 0, 0, math.sin(0.5)))
        return np.array(2 * math.atan2(q[3], q[0]))

    rate = math.sqrt(STIFFNESS / MOMENT)
    check_order(method, end, math.cos(rate) + 0.7 / rate * math.sin(rate), 20)


def turned(q, v):
    """Vectors v, turned by quaternions q."""
    w, u = q[..., :1], q[..., 1:]
    return v + 2 * w * np.cross(u, v) + 2 * np.cross(u, np.cross(u, v))


def needle(bodies):
    bodies.torque += np.cross(turned(bodies.rotation, ARM), FIELD)


def heavy_top(w0, seconds):
    """(quaternion, angular velocity along the world's axes) of a needle in a field, by another method."""

    def rates(t, state):
        q, w = state[:4], state[4:]
        back = q * (1, -1, -1, -1)
        moved = np.concatenate(((-q[1:] @ w,), q[0] * w + np.cross(q[1:], w)))  # w along the body's axes
        return np.concatenate((moved / 2, (np.cross(MOMENTS * w, w) + np.cross(ARM, turned(back, FIELD))) / MOMENTS))

    end = solve_ivp(rates, (0, seconds), (1.0, 0, 0, 0, *w0), "DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
    q = end[:4] / np.linalg.norm(end[:4])
    return np.concatenate((q, turned(q, end[4:])))


@pytest.mark.compiled
@methods
def test_a_needle_in_a_field(method):
    """A heavy top of three moments, under a torque that turns with it."""
    w0 = (1.5, -2.0, 0.8)
    check_order(
        method, lambda dt: end_of(method, dt, needle, Spin(w0, MOMENTS), seen=("rotation", "spin")),
        heavy_top(w0, 1.0), 40,
    )  # fmt: skip


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("method", "faster", "bound"),
    [
        ("velocity_verlet", 1, 3e-4), ("yoshida4", 1, 1e-6), ("rk4", 1, 1e-6),
        ("velocity_verlet", 40, 1e-3), ("yoshida4", 40, 1e-3), ("rk4", 40, 1e-3),
    ],
)  # fmt: skip
def test_the_energy_of_a_heavy_top_stays(method, faster, bound):
    """20 s at 60 Hz; and so does the angular momentum along the field, which no torque changes. The fast one turns by
    1.7 rad in a step."""
    w0 = faster * np.array((1.5, -2.0, 0.8))
    end = end_of(method, 1 / 60, needle, Spin(w0, MOMENTS), seconds=20.0, seen=("rotation", "spin"))
    q, w = end[:4], end[4:]
    own = turned(q * (1, -1, -1, -1), w)
    energy, start = own @ (MOMENTS * own) / 2 - turned(q, ARM) @ FIELD, w0 @ (MOMENTS * w0) / 2 - ARM @ FIELD
    assert abs(energy - start) < bound * abs(start)
    along, before = turned(q, MOMENTS * own) @ FIELD, MOMENTS * w0 @ FIELD
    assert abs(along - before) < bound * abs(before)


@pytest.mark.compiled
@pytest.mark.parametrize("method", ["velocity_verlet", "yoshida4", "rk4", "flight"])
def test_a_free_top_beside_a_needle_keeps_its_energy(method):
    """To rounding, as where no force system gives torques."""
    w0 = np.array((1.5, -2.0, 0.8))
    end = end_of(method, 1 / 60, lambda bodies: None, Spin(w0, MOMENTS), seconds=5.0, seen=("rotation", "spin"))
    own = turned(end[:4] * (1, -1, -1, -1), end[4:])
    assert own @ (MOMENTS * own) == pytest.approx(w0 @ (MOMENTS * w0), rel=1e-12)


@methods
@pytest.mark.parametrize("d", [2, 3])
def test_a_failed_step_and_a_snapshot_bring_back_every_bit(d, method):
    class Fails(System):
        armed = False

        def process(self, dt):
            if self.armed:
                raise RuntimeError("as ordered")

    with space(d, method, 1 / 60) as world:
        spin = Spin(0.7 if d == 2 else (0.3, 0.7, -1.0))
        world.create_entity(Transform((0,) * d, 0.3 * (d == 2)), RigidBody(), spin, SphereCollider(0.5))
        fails = Fails()
        world.add_system(fails)
        world.add_system(Forces(spring if d == 2 else needle))
        for _ in range(10):
            world.step()
        kept, before = world.snapshot(), world.state_hash()
        fails.armed = True
        with pytest.raises(StepError, match="as ordered"):
            world.step()
        assert world.state_hash() == before
        fails.armed = False
        for _ in range(10):
            world.step()
        later = world.state_hash()
        world.restore(kept)
        for _ in range(10):
            world.step()
        assert world.state_hash() == later


def test_what_a_flight_takes_out_has_not_turned():
    """A body whose place becomes nan in a step is put back, with its rotation and its spin."""
    far = [False]

    def add(bodies):
        spring(bodies)
        if far[0]:
            bodies.force[0] = math.inf

    with space(2, "rk4", 1 / 60) as world:
        entity = world.create_entity(Transform((0, 0), 1.0), RigidBody(), Spin(0.5, 1.0))
        world.add_system(Forces(add))
        world.step()
        body, spin = world.component_for_entity(entity, Transform), world.component_for_entity(entity, Spin)
        before = body.rotation, spin.angular_velocity
        far[0] = True
        with pytest.warns(UserWarning, match="takes no part"):
            world.step()
        assert (body.rotation, spin.angular_velocity) == before


@methods
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("wrong", [math.nan, -math.inf, 1e200])
def test_a_torque_that_cannot_be_takes_its_body_out(wrong, d, method):
    """As a force that cannot be does: it is named once, stands still, and others go on to the bit as without it."""
    torque = [0.3]

    def push(bodies):
        bodies.torque[:-1] += torque[0]
        bodies.torque[-1] += 0.3

    def mover(world, x):
        spin = Spin(0.5, 1.0) if d == 2 else Spin((0.5, 0.4, 0.3), MOMENTS)
        return world.create_entity(Transform((x, *(0.0,) * (d - 1))), RigidBody(linear_velocity=(1.0,) * d), spin)

    with space(d, method, 1 / 60) as world, space(d, method, 1 / 60) as alone:
        world.settings = world.settings.replace(on_fault="ignore")
        victim, other, same = mover(world, 0.0), mover(world, 9.0), mover(alone, 9.0)
        for each in (world, alone):
            each.add_system(Forces(push))
            each.step()
        body, spin = world.component_for_entity(victim, Transform), world.component_for_entity(victim, Spin)
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
            one, two = (getattr(w.component_for_entity(e, kind), field) for w, e in ((world, other), (alone, same)))
            assert np.all(one == two)
        torque[0] = 0.3
        world.step()
        assert np.all(spin.angular_velocity != before[2])
        assert body.position[0] > before[0][0]


@pytest.mark.parametrize("name", ["force", "torque"])
def test_what_would_be_lost_is_refused(name):
    """Forces and torques written where no step takes them; a force after FORCES is one that acts."""

    class Writes(System):
        def process(self, dt):
            getattr(self.world.bodies.dynamic, name)[:] += 3.0

    with space(2, "rk4", 1 / 60) as world:
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
                velocity = world.component_for_entity(entity, RigidBody).linear_velocity
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

    gravity = (0.0, -10.0, 0.0)[:d]
    with World(Physics(d, gravity=gravity), Rotation(), settings=Settings(sleeping=True)) as world:
        floor = BoxCollider((50.0, 1.0, 50.0)[:d], friction=0.8)
        world.create_entity(Transform((0.0, -1.0, 0.0)[:d]), RigidBody(kind="static"), floor)
        boxes = [
            world.create_entity(Transform((x, 0.5, 0.0)[:d]), RigidBody(), *spin, BoxCollider((0.5,) * d))
            for x, spin in ((0.0, (Spin(),)), (5.0, ()))
        ]
        world.add_system(Forces(twist))
        for _ in range(120):
            world.step()
        asleep = [bool(world.bodies.asleep[world.bodies.row_of(box)]) for box in boxes]
        assert asleep == [True, True]
        strength[0] = 0.1
        for _ in range(120):
            world.step()
            assert [bool(world.bodies.asleep[world.bodies.row_of(box)]) for box in boxes] == [False, True]


def test_a_torque_needs_a_force_system_that_requires_a_spin():
    class Torsion(ForceSystem):
        def add_forces(self, bodies, time):
            bodies.torque += 1.0

    with space(2, "rk4", 1 / 60) as world:
        world.create_entity(Transform((0, 0)), RigidBody(), Spin(0.5, 1.0))
        world.add_system(Torsion())
        with pytest.raises(StepError, match=r"Torsion: what adds to bodies.torque needs requires = \(Spin,\)"):
            world.step()


def test_torques_end_with_their_system():
    with space(2, "rk4", 1 / 60) as world:
        entity = world.create_entity(Transform((0, 0), 1.0), RigidBody(), Spin(0.5, 1.0))
        system = Forces(spring)
        world.add_system(system)
        world.step()
        assert "turn_on_way" in {kernel.kernel for kernel in world.plan().kernels}
        world.remove_system(system)
        spin = world.component_for_entity(entity, Spin)
        before = spin.angular_velocity
        world.step()
        assert spin.angular_velocity == before != 0.5
        assert "turn_on_way" not in {kernel.kernel for kernel in world.plan().kernels}


@methods
@pytest.mark.parametrize("d", [2, 3])
def test_limits_of_speed_and_damping_that_no_step_resolves(d, method):
    """At most 2 rad/s and that turn; and what damps in a small part of a step neither swings nor overflows."""

    def push(bodies):
        bodies.torque += 50.0

    for spin in ({"max_angular_speed": 2.0}, {"angular_damping": 30_000.0}):
        with space(d, method, 1 / 60) as world:
            inertia = 0.1 if d == 2 else MOMENTS
            entity = world.create_entity(Transform((0,) * d), RigidBody(), Spin(inertia=inertia, **spin))
            world.add_system(Forces(push))
            for step in range(20):
                world.step()
                w = np.linalg.norm(world.component_for_entity(entity, Spin).angular_velocity)
                assert 1.0 < w <= 2.0 + 1e-15 if "max_angular_speed" in spin else 1e-4 < w < 0.02
                if d == 2:
                    assert abs(world.component_for_entity(entity, Transform).rotation) <= 2 * (step + 1) / 60 + 1e-12


@pytest.mark.compiled
@methods
@pytest.mark.parametrize("d", [2, 3])
def test_a_wheel_on_the_ground_goes_as_under_a_constant_torque(d, method):
    """Contacts take what the torque has made of the spin: places and turns to 1e-6 of each other after a second."""

    def drive(bodies):
        bodies.torque -= 1.0 if d == 2 else np.array((0.0, 0.0, 1.0))

    ends = []
    for given in (True, False):
        chosen = {"collision": "event_driven"} if method == "flight" else {"integrator": method}
        gravity = (0.0, -10.0, 0.0)[:d]
        with World(Physics(d, gravity=gravity), Rotation(), settings=Settings(**chosen)) as world:
            floor = BoxCollider((50.0, 1.0, 50.0)[:d], friction=0.8)
            world.create_entity(Transform((0.0, -1.0, 0.0)[:d]), RigidBody(kind="static"), floor)
            torque = -1.0 if d == 2 else (0.0, 0.0, -1.0)
            spin = Spin(constant_torque=torque) if given else Spin()
            wheel = world.create_entity(
                Transform((0.0, 0.5, 0.0)[:d]), RigidBody(), spin, SphereCollider(0.5, friction=0.8)
            )
            if not given:
                world.add_system(Forces(drive))
            for _ in range(60):
                world.step()
            body = world.component_for_entity(wheel, Transform)
            ends.append(np.concatenate((body.position, np.atleast_1d(spin.angular_velocity))))
    assert ends[0][0] > 0.4
    assert np.allclose(*ends, rtol=0, atol=1e-6)
