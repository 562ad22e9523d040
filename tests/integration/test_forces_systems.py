"""Force systems: whom they act on, how often they are called, the energy they report; speed limits, other kinds."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_motion import STAGES, Oscillator, SpringAndDrag, all_methods, oscillators, record
from integration.helpers_forces import DT, body
from oracles import integrators_naive as naive
from worlds import EPS, Calls, make_world, position, run, velocity

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Component, ForceSystem, Phase, column

pytestmark = pytest.mark.plain


class Charge(Component):
    value = column(default=0.0)


class Field(ForceSystem):
    """A uniform field that records its calls."""

    requires = (RigidBody, Charge)

    def __init__(self):
        self.calls = []

    def add_forces(self, bodies, time):
        self.calls.append((time, bodies.entity.tolist(), bodies.position.copy(), bodies.linear_velocity.copy()))
        bodies.force[:, 0] += 3.0 * bodies.charge.value

    def potential_energy(self, bodies):
        return float(-(3.0 * bodies.charge.value * bodies.position[:, 0]).sum())


@pytest.mark.slow
@pytest.mark.compiled
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
    """Nothing depends on the state: one evaluation per step for any method."""
    world = make_world(gravity=10.0, dt=DT, integrator=method)
    body(world)
    run(world, 3)
    assert world.stats().counters["force_evaluations"] == 3


@pytest.mark.compiled
@all_methods
def test_two_force_systems_and_gravity_add_up(method):
    world = make_world(gravity=10.0, dt=DT, integrator=method)
    world.create_entity(Transform((0, 0)), RigidBody(2.0, constant_force=(1.0, 0.0)), Charge(1.0))
    world.add_system(Field())
    world.add_system(Field())
    run(world, 2)
    np.testing.assert_allclose(velocity(world, 1), (2 * DT * 7.0 / 2.0, -2 * DT * 10.0), rtol=1e-14)


@pytest.mark.compiled
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
    assert not field.calls  # a potential does not need the forces
    assert make_world().potential_energy() == 0.0
    assert make_world().momentum().tolist() == [0.0, 0.0]


def test_energy_does_not_depend_on_the_history():
    """Summed in the order of the ids: equal bits for any history of the bodies."""
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


# -- bodies with a speed limit, and those that are not dynamic ---------------------------------------


@pytest.mark.compiled
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


@pytest.mark.compiled
@all_methods
@pytest.mark.parametrize("speed", [1e3, 1e200, 1e307])
def test_speed_limit_holds_after_an_impulse(method, speed):
    """C12: the direction is kept and nothing overflows, in the very next step too."""
    world = make_world(dt=DT, integrator=method)
    rigid = body(world, max_linear_speed=5.0)
    rigid.apply_impulse((0.6 * speed, -0.8 * speed))
    world.step()
    np.testing.assert_allclose(rigid.linear_velocity, (3.0, -4.0), rtol=1e-14)
    np.testing.assert_allclose(world.bodies.position[0], (3.0 * DT, -4.0 * DT), rtol=1e-14)


@pytest.mark.compiled
@all_methods
def test_drag_does_not_see_more_than_the_limit(method):
    """An impulse of 1e6 m/s against a drag that is stable at the limit: it slows down and never reverses."""
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


@pytest.mark.compiled
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
    """A body that was pushed without effect does not jump when it becomes dynamic."""
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


@pytest.mark.compiled
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
