"""Forces: what acts on which body, when, and how often it is asked for."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers_motion import DRIFT, METHODS, STAGES, Oscillator, SpringAndDrag, all_methods, oscillators, record
from oracles import integrators_naive as naive
from worlds import EPS, make_world, position, run, velocity

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Component, ForceSystem, Phase, StepError, System, column

DT = 0.125  # a power of two: sums of steps are exact


def body(world, mass=1.0, velocity=(0.0, 0.0), *, at=(0.0, 0.0), **kwargs):
    """A new body's RigidBody."""
    rigid = RigidBody(mass, velocity, **kwargs)
    world.create_entity(Transform(at), rigid)
    return rigid


class Calls(System):
    """Runs a function in a phase."""

    def __init__(self, phase, function):
        self.phase = phase
        self.function = function

    def process(self, dt):
        self.function()


# -- gravity, constant forces, impulses ----------------------------------------------------------


@all_methods
def test_gravity_scale_and_constant_force(method):
    """a = s g + F / m, each body its own; v_n = n a dt."""
    world = make_world(gravity=(1.0, -10.0), dt=DT, integrator=method)
    rng = np.random.default_rng(1)
    mass, scale, force = rng.uniform(0.1, 9, 40), rng.uniform(-2, 2, 40), rng.normal(size=(40, 2))
    scale[0] = 0.0
    world.create_entities(
        40, Transform.many(np.zeros((40, 2))), RigidBody.many(mass, constant_force=force, gravity_scale=scale)
    )
    positions, velocities = record(world, 20)
    acceleration = scale[:, None] * (1.0, -10.0) + force / mass[:, None]
    t = DT * np.arange(21)[:, None, None]
    np.testing.assert_allclose(velocities, t * acceleration, rtol=1e-13, atol=1e-13)
    expected = (t * t + DRIFT.get(method, 0) * -DT * t) / 2 * acceleration
    np.testing.assert_allclose(positions, expected, rtol=1e-12, atol=1e-12)


def test_gravity_can_be_replaced_between_steps():
    world = make_world(gravity=(0.0, -8.0), dt=DT)
    rigid = body(world)
    world.step()
    world.gravity = (4.0, 0.0)
    world.step()
    assert rigid.linear_velocity.tolist() == [4.0 * DT, -8.0 * DT]


@pytest.mark.parametrize("gravity", [(0, 0, -9.81), (0, float("nan")), 9.81, "down"])
def test_gravity_that_does_not_fit_is_refused(gravity):
    world = make_world()
    with pytest.raises(ValueError, match=r"gravity|could not convert"):
        world.gravity = gravity
    assert world.gravity.tolist() == [0, 0]


def test_impulse_acts_at_once():
    """dv = J / m, before any step; two add up."""
    world = make_world(dt=DT)
    rigid = body(world, 4.0, (1.0, 0.0))
    rigid.apply_impulse((2.0, -8.0))
    assert rigid.linear_velocity.tolist() == [1.5, -2.0]
    world.step()
    rigid.apply_impulse((2.0, 0.0))
    assert rigid.linear_velocity.tolist() == [2.0, -2.0]
    world.step()
    assert world.bodies.position[0].tolist() == [3.5 * DT, -4.0 * DT]


@pytest.mark.parametrize("phase", list(Phase))
def test_impulse_inside_a_system_acts_once(phase):
    """Whatever the phase: after enough steps the velocity holds one impulse per step and no more."""
    world = make_world(dt=DT)
    rigid = body(world, 2.0)
    world.add_system(Calls(phase, lambda: rigid.apply_impulse((1.0, 0.0))))
    run(world, 5)
    assert rigid.linear_velocity.tolist() == [2.5, 0.0]


# -- apply_force ---------------------------------------------------------------------------------


@all_methods
@pytest.mark.parametrize("with_force_system", [False, True])
@pytest.mark.parametrize("phase", list(Phase))
def test_force_applied_in_a_system_acts_for_one_step(method, phase, with_force_system):
    """dv = F dt / m per call: in this step up to INTEGRATION's start, in the next one after it."""
    world = make_world(dt=DT, integrator=method)
    rigid = body(world, 2.0)
    if with_force_system:  # then the stages sum the forces anew
        world.add_system(SpringAndDrag())
        world.create_entity(Transform((0, 5)), RigidBody(), Oscillator(1.0, 0.0))
    calls = []

    def push():
        if world.step_count in (1, 2, 5):
            calls.append(world.step_count)
            rigid.apply_force((4.0, -2.0))
            rigid.apply_force((0.0, 2.0))

    world.add_system(Calls(phase, push))
    gained = []
    for _ in range(8):
        before = rigid.linear_velocity[0]
        world.step()
        gained.append((rigid.linear_velocity[0] - before) / (4.0 * DT / 2.0))
    delay = phase >= Phase.INTEGRATION  # its systems run after the built-in one
    expected = [1.0 if n - delay in (1, 2, 5) else 0.0 for n in range(8)]
    np.testing.assert_allclose(gained, expected, rtol=0, atol=4 * EPS)
    assert rigid.linear_velocity[1] == 0.0
    assert calls == [1, 2, 5]


def test_force_applied_before_integration_acts_in_this_step():
    """A system placed before Integration, in its phase, is not too late."""
    world = make_world(dt=DT)
    rigid = body(world)
    world.add_system(Calls(Phase.INTEGRATION, lambda: rigid.apply_force((1.0, 0.0))), before="Integration")
    run(world, 3)
    assert rigid.linear_velocity[0] == 3 * DT


@pytest.mark.parametrize("adopted", [False, True])
def test_force_applied_outside_is_held_for_the_whole_advance(adopted):
    """In every step of the next advance that takes one, then it clears; an advance of no step keeps it."""
    world = make_world(dt=DT)
    rigid = body(world, 2.0)
    if adopted:
        world.step()
    rigid.apply_force((2.0, 0.0))
    rigid.apply_force((2.0, 0.0))
    assert world.advance(DT / 4) == 0
    assert world.advance(DT / 4) == 0
    assert rigid.linear_velocity[0] == 0.0
    assert world.advance(3 * DT) == 3
    assert rigid.linear_velocity[0] == 3 * 2.0 * DT
    assert world.advance(DT) == 1
    assert rigid.linear_velocity[0] == 3 * 2.0 * DT


def test_force_applied_outside_holds_for_one_step_of_step():
    world = make_world(dt=DT)
    rigid = body(world)
    world.step()  # adopted
    rigid.apply_force((1.0, 0.0))
    world.step()
    world.step()
    assert rigid.linear_velocity[0] == DT


@pytest.mark.parametrize("hz", [2, 4, 8, 16])
def test_force_of_every_frame_does_not_depend_on_the_frame_rate(hz):
    """A key held down for 4 s: v = F t / m whatever the frame rate; 8 steps a second."""
    world = make_world(dt=DT)
    rigid = body(world, 2.0)
    for _ in range(4 * hz):
        rigid.apply_force((3.0, 0.0))
        world.advance(1 / hz)
    assert rigid.linear_velocity[0] == pytest.approx(3.0 * 4.0 / 2.0, rel=1e-14)


def test_force_of_a_system_does_not_depend_on_the_frame_rate():
    """A System is called once per step: the same bits from 2 to 50 frames a second."""
    hashes = set()
    for frame in (1 / 2, 1 / 4, 1 / 8, 1 / 50):
        world = make_world(gravity=9.81, dt=DT)
        rigid = body(world, 2.0)
        world.add_system(Calls(Phase.END, lambda world=world, rigid=rigid: rigid.apply_force((world.step_count, 1.0))))
        while world.step_count < 32:
            world.advance(frame)
        hashes.add(world.state_hash())
    assert len(hashes) == 1


@pytest.mark.parametrize(
    "frame", [DT, 2 * DT, 4 * DT, 8 * DT]
)
def test_force_on_a_body_that_a_system_has_just_made(frame):
    """It acts for one step, like any force that a system applies, whatever the frame rate."""
    world = make_world(dt=DT)
    made = []

    def make():
        if world.step_count == 1:
            made.append(body(world))
            made[0].apply_force((1.0, 0.0))

    world.add_system(Calls(Phase.END, make))
    while world.step_count < 8:
        world.advance(frame)
    assert made[0].linear_velocity[0] == DT


@all_methods
def test_force_outside_acts_beside_force_systems(method):
    """A constant push on a spring: exact in every stage, so the textbook's x'' = -x + 0.5 from (1, 0)."""
    world = oscillators(method, DT, 1.0)
    (_, rigid), = world.get_component(RigidBody)  # fmt: skip
    for _ in range(20):
        rigid.apply_force((0.5, 0.0))
        world.step()
    x, v = naive.trajectory(method, 1.0, 0.0, DT, 20, lambda x, v, t: 0.5 - x)
    assert position(world, 1)[0] == pytest.approx(x[-1], rel=1e-13)
    assert velocity(world, 1)[0] == pytest.approx(v[-1], rel=1e-13)


@pytest.mark.parametrize("value", [(1.0, 2.0, 3.0), (float("nan"), 0.0), (math.inf, 0.0), [[1.0, 2.0]]])
@pytest.mark.parametrize("verb", ["apply_force", "apply_impulse"])
def test_pushes_that_do_not_fit_are_refused(verb, value):
    """C11: rejected at the call, nothing changes."""
    world = make_world(dt=DT)
    rigid = body(world)
    world.step()
    with pytest.raises(ValueError, match=rf"entity 1: RigidBody.{verb} must"):
        getattr(rigid, verb)(value)
    world.step()
    assert not rigid.linear_velocity.any()


# -- speed limit, kinds --------------------------------------------------------------------------


@all_methods
def test_speed_limit(method):
    """Falling at 10 m/s^2 with a cap of 3 m/s: never faster, and at the cap exactly 3 dt per step."""
    world = make_world(gravity=10.0, dt=DT, integrator=method)
    world.create_entity(Transform((0, 0)), RigidBody(max_linear_speed=3.0))
    world.create_entity(Transform((9, 0)), RigidBody())
    positions, velocities = record(world, 12)
    speed = np.hypot(*velocities[:, 0].T)
    assert (speed <= 3.0 * (1 + 2 * EPS)).all()
    travel = np.hypot(*np.diff(positions[:, 0], axis=0).T)
    assert (travel <= 3.0 * DT * (1 + 1e-14)).all()
    np.testing.assert_allclose(travel[4:], 3.0 * DT, rtol=1e-14)
    assert velocities[-1, 1, 1] == pytest.approx(-12 * 10.0 * DT, rel=1e-14)  # the other body has none


@all_methods
@pytest.mark.parametrize("speed", [1e3, 1e200, 1e308])
def test_speed_limit_holds_after_a_blow(method, speed):
    """C12: the direction is kept and nothing overflows, in the very next step too."""
    world = make_world(dt=DT, integrator=method)
    rigid = body(world, max_linear_speed=5.0)
    rigid.apply_impulse((0.6 * speed, -0.8 * speed))
    world.step()
    np.testing.assert_allclose(rigid.linear_velocity, (3.0, -4.0), rtol=1e-14)
    np.testing.assert_allclose(world.bodies.position[0], (3.0 * DT, -4.0 * DT), rtol=1e-14)


@all_methods
def test_drag_does_not_see_more_than_the_limit(method):
    """A blow of 1e6 m/s against a drag that is stable at the cap: it slows down and never turns round."""
    world = make_world(dt=DT, integrator=method)
    rigid = RigidBody(max_linear_speed=5.0)
    world.create_entity(Transform((0, 0)), rigid, Oscillator(0.0, 1.0))
    world.add_system(SpringAndDrag())
    rigid.apply_impulse((1e6, 0.0))
    _, velocities = record(world, 10)
    assert (velocities[1:, 0, 0] > 0).all()
    assert (velocities[1:, 0, 0] <= 5.0).all()


def test_speed_limit_of_zero_and_none():
    world = make_world(gravity=10.0, dt=DT)
    held = body(world, max_linear_speed=0.0)
    free = body(world, max_linear_speed=None)
    run(world, 3)
    assert held.linear_velocity.tolist() == [0, 0]
    assert world.bodies.position[0].tolist() == [0, 0]
    assert free.linear_velocity[1] == -30 * DT
    free.max_linear_speed = 1.0
    world.step()
    assert free.linear_velocity[1] == -1.0


@all_methods
def test_kinematic_bodies_move_by_their_velocity_alone(method):
    """No gravity, no constant or applied force, no force system, no damping, no impulse, no cap: x = x0 + v t."""
    world = make_world(gravity=10.0, dt=DT, integrator=method)
    rigid = RigidBody(
        2.0, (1.0, -0.5), kind="kinematic", constant_force=(5.0, 5.0), linear_damping=3.0, max_linear_speed=0.1
    )
    world.create_entity(Transform((4, 4)), rigid, Oscillator(9.0, 9.0))
    world.create_entity(Transform((0, 0)), RigidBody(), Oscillator(1.0, 0.0))
    world.add_system(SpringAndDrag())
    rigid.apply_impulse((7.0, 7.0))
    for _ in range(8):
        rigid.apply_force((7.0, 7.0))
        world.step()
    assert position(world, 1).tolist() == [5.0, 3.5]
    assert velocity(world, 1).tolist() == [1.0, -0.5]


@pytest.mark.parametrize("kind", ["kinematic", "static"])
@pytest.mark.parametrize("inside", [False, True])
def test_pushes_on_other_kinds_are_not_kept_for_later(kind, inside):
    """A body that was pushed in vain does not jump once it becomes dynamic."""
    world = make_world(dt=DT)
    rigid = body(world, kind=kind)
    world.step()
    system = Calls(Phase.START, lambda: rigid.apply_force((7.0, 0.0)))
    if inside:
        world.add_system(system)
        run(world, 3)
        world.remove_system(system)
    else:
        rigid.apply_force((7.0, 0.0))
        run(world, 3)
    rigid.kind = "dynamic"
    run(world, 2)
    assert not rigid.linear_velocity.any()


@all_methods
def test_static_bodies_do_not_move(method):
    """A static RigidBody, even with a velocity, and a collider without one."""
    world = make_world(gravity=10.0, dt=DT, integrator=method)
    world.create_entity(Transform((0, 0)), RigidBody(linear_velocity=(1, 1), constant_force=(1, 1), kind="static"))
    world.create_entity(Transform((3, 3)), AABBCollider((1, 1)))
    world.create_entity(Transform((9, 9)), RigidBody(), SphereCollider(0.5))
    positions, velocities = record(world, 5)
    still = slice(world.bodies.dynamic.rows.stop, None)
    assert (positions[:, still] == positions[0, still]).all()
    assert not velocities[1:, still].any()


# -- force systems -------------------------------------------------------------------------------


class Charge(Component):
    value = column(default=0.0)


class Field(ForceSystem):
    """A uniform field, and a record of what it saw."""

    requires = (RigidBody, Charge)

    def __init__(self):
        self.calls = []

    def add_forces(self, bodies, time):
        self.calls.append((time, bodies.entity.tolist(), bodies.position.copy(), bodies.linear_velocity.copy()))
        bodies.force[:, 0] += 3.0 * bodies.charge.value

    def potential_energy(self, bodies):
        return float(-(3.0 * bodies.charge.value * bodies.position[:, 0]).sum())


@all_methods
@pytest.mark.parametrize("charged", [(), (1,), (2, 4), (1, 2, 3, 4)], ids=["none", "one", "some", "all"])
def test_only_bodies_with_what_it_requires_feel_a_force(method, charged):
    """v_n = n 3 q dt for those with a charge, 0 for the others; static and kinematic bodies are never among them."""
    world = make_world(dt=DT, integrator=method)
    for entity in (1, 2, 3, 4):
        extra = (Charge(float(entity)),) if entity in charged else ()
        assert world.create_entity(Transform((entity, 0)), RigidBody(), *extra) == entity
    world.create_entity(Transform((0, 9)), RigidBody(kind="kinematic"), Charge(1.0))
    world.create_entity(Transform((0, 12)), RigidBody(kind="static"), Charge(1.0))
    field = Field()
    world.add_system(field)
    run(world, 4)
    for entity in (1, 2, 3, 4):
        expected = 4 * 3.0 * entity * DT if entity in charged else 0.0
        assert velocity(world, entity).tolist() == [expected, 0.0]
    assert not velocity(world, 5).any()
    assert {tuple(entities) for _, entities, *_ in field.calls} <= {charged}
    assert len(field.calls) == (4 * STAGES[method] if charged else 0)


def test_a_charge_that_comes_and_goes_is_seen_at_the_next_step():
    world = make_world(dt=DT)
    entity = world.create_entity(Transform((0, 0)), RigidBody())
    world.add_system(Field())
    world.step()
    world.add_component(entity, Charge(1.0))
    world.step()
    world.remove_component(entity, Charge)
    world.step()
    assert velocity(world, entity)[0] == 3.0 * DT


@all_methods
def test_calls_per_step_and_their_times(method):
    """Stages: EE 1, SI 1, VV 2, RK4 4, YO4 4; each at its own time and state (x = t while nothing acts)."""
    world = make_world(dt=DT, integrator=method)
    world.create_entity(Transform((0, 0)), RigidBody(1.0, (1.0, 0.0)), Charge(0.0))
    field = Field()
    world.add_system(field)
    world.reset_stats()
    run(world, 3)
    w = 1 / (2 - 2 ** (1 / 3))
    stages = {
        "explicit_euler": [0], "semi_implicit_euler": [0], "velocity_verlet": [0, 1],
        "rk4": [0, 0.5, 0.5, 1], "yoshida4": [0, w, 1 - w, 1],
    }[method]  # fmt: skip
    expected = [(n + stage) * DT for n in range(3) for stage in stages]
    np.testing.assert_allclose([time for time, *_ in field.calls], expected, rtol=0, atol=1e-14)
    np.testing.assert_allclose([x[0, 0] for _, _, x, _ in field.calls], expected, rtol=0, atol=1e-14)
    assert len(field.calls) == 3 * STAGES[method]
    assert world.stats().counters["force_evaluations"] == 3 * STAGES[method]


@all_methods
def test_forces_without_force_systems_are_summed_once(method):
    """Nothing depends on the state: one evaluation a step whatever the method."""
    world = make_world(gravity=10.0, dt=DT, integrator=method)
    body(world)
    run(world, 3)
    assert world.stats().counters["force_evaluations"] == 3


@all_methods
def test_two_force_systems_and_gravity_add_up(method):
    world = make_world(gravity=10.0, dt=DT, integrator=method)
    world.create_entity(Transform((0, 0)), RigidBody(2.0, constant_force=(1.0, 0.0)), Charge(1.0))
    world.add_system(Field())
    world.add_system(Field())
    run(world, 2)
    np.testing.assert_allclose(velocity(world, 1), (2 * DT * 7.0 / 2.0, -2 * DT * 10.0), rtol=1e-14)


def test_force_systems_are_added_and_removed_by_instance():
    world = make_world(dt=DT)
    world.create_entity(Transform((0, 0)), RigidBody(), Charge(1.0))
    one, two = Field(), Field()
    world.add_system(one)
    world.add_system(two)
    with pytest.raises(ValueError, match="already"):
        world.add_system(one)
    world.step()
    world.remove_system(one)
    world.step()
    assert (len(one.calls), len(two.calls)) == (1, 2)
    assert velocity(world, 1)[0] == 9.0 * DT


@all_methods
def test_a_system_that_adds_to_force_acts_throughout_the_step(method):
    """In phase FORCES, after the sum: a constant push, the same at every stage: textbook x'' = -x + 0.5 t_n."""
    world = oscillators(method, DT, 1.0)

    def push():
        world.bodies.dynamic.force[:, 0] += 0.5 * world.step_count

    world.add_system(Calls(Phase.FORCES, push))
    positions, _ = record(world, 30)
    x, v = 1.0, 0.0
    for n in range(30):
        x, v = naive.STEPS[method](x, v, 0.0, DT, lambda x, v, t, n=n: -x + 0.5 * n)
        assert positions[n + 1, 0, 0] == pytest.approx(x, rel=1e-12, abs=1e-12)


def test_an_error_in_a_force_system_names_it_and_takes_the_step_back():
    class Broken(ForceSystem):
        def add_forces(self, bodies, time):
            bodies.force[:] = 1e9
            raise RuntimeError("no field here")

    world = make_world(gravity=10.0, dt=DT, integrator="rk4")
    body(world)
    world.step()
    before = world.state_hash()
    broken = Broken()
    world.add_system(broken)
    with pytest.raises(StepError) as caught:
        world.step()
    assert "no field here" in str(caught.value)
    assert "Broken" in str(caught.value) + str(getattr(caught.value.__cause__, "__notes__", ""))
    assert world.state_hash() == before
    assert world.step_count == 1
    world.remove_system(broken)
    world.step()
    assert velocity(world, 1)[1] == pytest.approx(-20 * DT, rel=1e-14)


# -- energy --------------------------------------------------------------------------------------


def test_energies_and_momentum():
    """KE = sum m v^2 / 2, PE = -sum (m s g + F) . x plus what force systems say, p = sum m v; dynamic bodies only."""
    world = make_world(gravity=(1.0, -10.0), dt=DT)
    world.create_entity(Transform((2, 3)), RigidBody(4.0, (1, 2), constant_force=(5, 0)), Charge(2.0))
    world.create_entity(Transform((-1, 1)), RigidBody(2.0, (0, -3), gravity_scale=0.5))
    world.create_entity(Transform((7, 7)), RigidBody(9.0, (1, 1), kind="kinematic"), Charge(5.0))
    world.create_entity(Transform((8, 8)), SphereCollider(1.0))
    assert world.kinetic_energy() == 0.5 * (4 * 5 + 2 * 9)
    assert world.momentum().tolist() == [4.0, 2.0]
    gravity_and_constant = -((4 + 5) * 2 - 40 * 3) - (-1 * 1 - 10 * 1)
    assert world.potential_energy() == gravity_and_constant
    field = Field()
    world.add_system(field)
    assert world.potential_energy() == gravity_and_constant - 3.0 * 2.0 * 2.0
    world.add_system(SpringAndDrag())  # no body has an Oscillator: nothing to add
    assert world.potential_energy() == gravity_and_constant - 12.0
    assert not field.calls  # a potential needs no forces
    assert make_world().potential_energy() == 0.0
    assert make_world().momentum().tolist() == [0.0, 0.0]


def test_energy_does_not_depend_on_the_history():
    """Summed in the order of the ids: equal bits however the bodies came about."""
    rng = np.random.default_rng(4)
    values = rng.normal(size=(6, 4)) * 10.0 ** rng.integers(-6, 6, (6, 1))
    straight, detour = make_world(gravity=9.81), make_world(gravity=9.81)
    for x, y, vx, vy in values:
        straight.create_entity(Transform((x, y)), RigidBody(1.3, (vx, vy)))
    for x, y, vx, vy in values:  # static first, dynamic in the opposite order
        detour.create_entity(Transform((x, y)), RigidBody(1.3, (vx, vy), kind="static"))
    run(detour, 1)
    for entity in range(6, 0, -1):
        rigid = detour.component_for_entity(entity, RigidBody)
        rigid.kind = "dynamic"
        rigid.linear_velocity = values[entity - 1, 2:]
    assert straight.kinetic_energy() == detour.kinetic_energy()
    assert straight.potential_energy() == detour.potential_energy()
    assert np.array_equal(straight.momentum(), detour.momentum())


@pytest.mark.parametrize("method", METHODS[2:])
def test_total_energy_of_a_throw_is_constant(method):
    """VV, RK4 and YO4 are exact under gravity: KE + PE to rounding."""
    world = make_world(gravity=9.81, integrator=method)
    body(world, 3.0, (4.0, 20.0), constant_force=(1.0, 0.0), at=(1.0, 2.0))
    start = world.kinetic_energy() + world.potential_energy()
    for _ in range(300):
        world.step()
        scale = world.kinetic_energy() + abs(world.potential_energy())
        assert abs(world.kinetic_energy() + world.potential_energy() - start) < 10 * 300 * EPS * scale


def test_total_energy_of_springs_includes_their_potential():
    """B2 through the world's own sums: VV keeps KE + PE within 1 - z^2/4 of the start's amplitude energy."""
    omega = np.array([1.0, 2.0, 3.0])
    world = oscillators("velocity_verlet", 0.1, 5.0 * omega**2, mass=5.0)
    start = world.kinetic_energy() + world.potential_energy()
    assert start == pytest.approx(0.5 * (5.0 * omega**2).sum(), rel=1e-15)
    for _ in range(500):
        world.step()
        energy = world.kinetic_energy() + world.potential_energy()
        assert start * (1 - (0.1 * omega.max()) ** 2 / 4) <= energy <= start * (1 + 1e-12)
