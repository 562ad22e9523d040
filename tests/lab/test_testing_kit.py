"""The kit for users' tests: each assertion passes for a correct world and reports the error of a wrong one."""

from __future__ import annotations

import math
import subprocess
import sys

import numpy as np
import pytest
from worlds import both_dimensions

from carom.components import RigidBody, SphereCollider, Transform
from carom.framework import ForceSystem, Phase, System
from carom.lab import testing as kit
from carom.lab.measure.bodies import overlaps_of
from carom.plugins.half_space import HalfSpaceCollider
from carom.plugins.half_space import plugin as half_space

G = 9.81
METHODS = ("explicit_euler", "semi_implicit_euler", "velocity_verlet", "rk4", "yoshida4")


class SpeedsUp(System):
    """Injects energy."""

    phase = Phase.END

    def process(self, dt):
        self.world.bodies.dynamic.linear_velocity[:] *= 1.001


class Disables(System):
    """Disables every contact."""

    phase = Phase.NARROW

    def process(self, dt):
        self.world.contacts.enabled[:] = False


@pytest.mark.slow
def test_it_imports_neither_the_command_line_nor_a_test_framework():
    code = "import sys, carom.lab.testing; print('\\n'.join(sys.modules))"
    modules = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert not {"click", "rich", "matplotlib", "pytest", "pymunk"}.intersection(modules)


# -- predictions ---------------------------------------------------------------------------------


@pytest.mark.parametrize("method", METHODS)
def test_flight_is_predicted_for_every_method(method):
    """Tolerance: rounding of 100 steps."""
    world = kit.make_world(gravity=G, integrator=method)
    entity = kit.ball(world, (1, 2), (3, 4))
    kit.run(world, 100)
    x, v = kit.flight_after(100, world.settings.dt, (1, 2), (3, 4), (0, -G), method)
    kit.assert_position(world, entity, x, within=1e-12)
    kit.assert_velocity(world, entity, v, within=1e-12)
    exact = kit.free_flight(100 / 60, (1, 2), (3, 4), (0, -G))[0]
    lag = {"explicit_euler": 1, "semi_implicit_euler": -1}.get(method, 0) * G / 60 * (100 / 60) / 2
    np.testing.assert_allclose(x - exact, (0, lag), atol=1e-12)
    world.gravity = (0, -9.0)  # wrong
    kit.run(world, 1)
    with pytest.raises(AssertionError, match=rf"entity {entity}, step 101: linear_velocity is .* apart, limit 1e-12"):
        kit.assert_velocity(world, entity, np.add(v, (0, -G / 60)), within=1e-12)


def test_falls_bounces_and_impacts_are_predicted():
    """A fall of 2 m is detected within a step of its time; heights within the semi-implicit lag, g dt t / 2 = 5 %."""
    world = kit.make_world(gravity=G, integrator="velocity_verlet", dt=1 / 240)
    floor, entity = kit.floor(world), kit.ball(world, (0, 2.5), restitution=0.8)
    log = kit.ContactLog(world)
    time = kit.run_until(world, lambda: log.count("impact", floor, entity) == 1)
    assert 0 <= time - kit.fall_time(2.0, G) <= 1 / 240
    times = kit.bounce_times(2.0, G, 0.8, 3)
    np.testing.assert_allclose(np.diff(times), [2 * 0.8 * times[0], 2 * 0.64 * times[0]])
    top = 0.0
    while log.count("impact", floor, entity) == 1:
        world.step()
        top = max(top, kit.position(world, entity)[1] - 0.5)
    assert top == pytest.approx(kit.bounce_heights(2.0, 0.8, 1)[0], rel=1e-3)
    assert kit.fall_speed(2.0, G) == pytest.approx(G * kit.fall_time(2.0, G))
    with pytest.raises(AssertionError, match=r"the condition has not come true within 0.1 s \(24 steps\)"):
        kit.run_until(world, lambda: False, seconds=0.1)


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_collisions_are_predicted(e):
    world = kit.make_world(restitution_threshold=0.0)
    a, b = kit.ball(world, 0.0, 3.0, mass=2.0, restitution=e), kit.ball(world, 2.0, -1.0, restitution=e)
    assert kit.impact_time((0, 0), (3, 0), (2, 0), (-1, 0), 1.0) == 0.25
    kit.run(world, 30)
    for entity, v in zip((a, b), kit.collide(2.0, 3.0, 1.0, -1.0, e), strict=True):
        kit.assert_velocity(world, entity, (v, 0), within=1e-9)
    assert kit.collide(1.0, (1.0, -2.0), math.inf, (0.0, 0.0), 1.0, (0.0, -1.0))[0].tolist() == [1.0, 2.0]
    assert kit.impact_time((0, 0), (-3, 0), (2, 0), (1, 0), 1.0) == math.inf


def test_sliding_is_predicted():
    """Within one step's change of speed: the friction of the first step counts from its start."""
    world = kit.make_world(gravity=G)
    kit.floor(world)
    entity = kit.box(world, (0, 0.5), 4.0, friction=0.5)
    kit.run(world, 60)
    assert kit.sliding_time(4.0, 0.5, G) < 1.0
    assert abs(kit.position(world, entity)[0] - kit.sliding_distance(4.0, 0.5, G)) < 4.0 / 60
    kit.assert_at_rest(world)


class Attraction(ForceSystem):
    """A spring of 4 N/m to the origin."""

    requires = (RigidBody,)

    def add_forces(self, bodies, time):
        bodies.force[:] -= 4.0 * bodies.position


def test_springs_orbits_and_damping_are_predicted():
    world = kit.make_world(integrator="rk4", dt=1 / 100)
    spring, orbit = kit.ball(world, (1, 0), (0, 0), mass=2.0), kit.ball(world, (0, 50), (100, 0))
    world.add_system(Attraction())
    kit.run(world, 100)
    x, v = kit.spring(1.0, 4.0, 2.0, (1, 0))
    kit.assert_position(world, spring, x, within=1e-7)
    kit.assert_velocity(world, spring, v, within=1e-7)
    # a spring attracts like 4 r: on a circle v = 2 r, as under strength / r^2 with strength 4 r^3
    assert np.linalg.norm(kit.position(world, orbit)) == pytest.approx(50, rel=1e-7)
    assert kit.orbit_speed(4 * 50.0**3, 50.0) == pytest.approx(100.0)
    damped = kit.make_world(gravity=G)
    entity = damped.create_entity(Transform((0, 0)), RigidBody(linear_damping=2.0), SphereCollider(0.1))
    kit.run(damped, 60)
    kit.assert_velocity(damped, entity, kit.damped_velocity(1.0, (0, 0), (0, -G), 2.0), within=1e-12)
    with pytest.raises(ValueError, match=r"integrator must be one of explicit_euler, .* got 'euler'"):
        kit.flight_after(1, 0.1, 0, 0, 0, "euler")


# -- assertions ----------------------------------------------------------------------------------


@both_dimensions
def test_what_is_conserved(d):
    """Elastic balls in free space conserve both; friction and e < 1 lose energy, and a system that adds some is
    detected."""
    world = kit.make_world(d)
    for x in range(5):
        kit.ball(world, 1.5 * x, (-1.0) ** x, restitution=1.0)
    kept = kit.Conserved(world)
    kit.run(world, 100, kept.assert_finite, kept.assert_momentum, kept.assert_energy, kept.assert_energy_not_raised)
    world.add_system(SpeedsUp())
    with pytest.raises(AssertionError, match=r"step 10\d: energy is .* J, it was 2.5 J: \+0.005 J, limit 2.5e-12"):
        kit.run(world, 5, kept.assert_energy_not_raised)
    world.bodies.dynamic.linear_velocity[0, 0] += 1.0
    with pytest.raises(AssertionError, match=r"momentum is .* kg m/s apart, limit"):
        kept.assert_momentum()
    world.bodies.dynamic.position[2, 1] = np.nan
    with pytest.raises(AssertionError, match=rf"entity {world.bodies.entity[2]}, step \d+: position is \[.*nan"):
        kept.assert_finite()


def test_energy_that_is_lost_is_not_kept():
    world = kit.make_world()
    kit.ball(world, 0.0, 1.0), kit.ball(world, 1.1, -1.0)
    kept = kit.Conserved(world)
    kit.run(world, 20, kept.assert_energy_not_raised, kept.assert_momentum)
    with pytest.raises(AssertionError, match=r"step 20: energy is 0 J, it was 1 J: -1 J"):
        kept.assert_energy()


def resting_pair(**settings):
    world = kit.make_world(gravity=G, **settings)
    return world, kit.floor(world), kit.box(world, (0, 0.5)), kit.ball(world, (0, 1.5))


def test_rest_overlap_and_contacts_of_a_right_world():
    world, floor, box, ball = resting_pair()
    log = kit.ContactLog(world)
    kit.assert_at_rest(world, steps=120)
    kit.assert_touching(world, floor, box)
    kit.assert_apart(world, floor, ball)
    kit.assert_no_overlap(world)
    kit.assert_inside(world, (-1, 0), (1, 2))
    log.assert_began(box, floor)
    log.assert_ended(box, floor, times=0)
    log.assert_struck(ball, box, times=0)


def test_rest_overlap_and_contacts_of_a_wrong_world():
    world, floor, box, ball = resting_pair()
    log = kit.ContactLog(world)
    world.add_system(Disables())
    with pytest.raises(AssertionError, match=rf"entity ({box}|{ball}), step 1: moves at 0.164 sizes per second, limit"):
        kit.assert_at_rest(world)
    with pytest.raises(AssertionError, match=r"has drifted by .* sizes, limit 0.001"):
        kit.assert_at_rest(world, speed=math.inf)
    with pytest.raises(AssertionError, match=rf"{floor} does not touch {box}; it touches nothing"):
        kit.assert_touching(world, floor, box)
    with pytest.raises(AssertionError, match=rf"{box} and {floor} began to touch 0 times, expected 1"):
        log.assert_began(box, floor)
    kit.run(world, 10)
    with pytest.raises(AssertionError, match=rf"step \d+: {floor} and {box} overlap by 0.\d+ of the smaller"):
        kit.assert_no_overlap(world)
    with pytest.raises(AssertionError, match=rf"entity {box}, step \d+: position .* is outside of 0.5 to 2; 2 of 2"):
        kit.assert_inside(world, 0.5, 2)
    log.close()


def test_overlaps_are_those_of_solid_bodies_of_which_one_moves():
    """In sizes of the smaller: of balls 0.1 / 1, of boxes 0.2 / 0.5, of a ball in a half-space 0.25 / 1."""
    world = kit.make_world(dt=1e-9)
    world.add_plugin(half_space)
    world.add_system(Disables())  # of what would part them
    world.create_entity(Transform((0, -1)), HalfSpaceCollider((0, 1)))
    kit.ball(world, (0, 9)), kit.ball(world, (0.9, 9))
    kit.box(world, (5, 9), half=(0.5, 0.25), kind="static"), kit.box(world, (5, 9.3), half=(0.25, 0.25))
    kit.ball(world, (9, -0.75))
    kit.ball(world, (0, 20), sensor=True), kit.ball(world, (0.9, 20))
    kit.box(world, (5, 20), kind="static"), kit.box(world, (5.5, 20), kind="kinematic")
    kit.ball(world, (9, 20), mask=0), kit.ball(world, (9.5, 20))
    world.step()
    _, _, depth, size = overlaps_of(world)
    assert sorted(depth / size) == pytest.approx([0.1, 0.25, 0.4])
    world.close()


def test_a_contact_where_none_should_be():
    world, floor, box, _ = resting_pair()
    kit.run(world, 2)
    with pytest.raises(AssertionError, match=rf"step 2: {floor} touches {box}, overlapping by"):
        kit.assert_apart(world, floor, box)


def heap_of(order):
    world = kit.make_world(gravity=G)
    kit.floor(world)
    bodies = [(Transform((0.3 * k, 1 + k)), RigidBody(1.0 + k), SphereCollider(0.5, restitution=0.3)) for k in range(5)]
    kit.create_in_order(world, bodies, order)
    return world


def test_the_same_bits():
    one, other = heap_of([0, 1, 2, 3, 4]), heap_of([3, 1, 4, 0, 2])
    kit.run(one, 60)
    kit.run(other, 60)
    kit.assert_same_bits(one, other)
    other.bodies.dynamic.position[0, 0] += 1e-15
    entity = int(other.bodies.entity[0])
    with pytest.raises(AssertionError, match=rf"entity {entity}, step 60 and 60: position is"):
        kit.assert_same_bits(one, other)
    kit.assert_frame_rate_free(lambda: heap_of([0, 1, 2, 3, 4]), seconds=1.0)


def test_what_depends_on_the_frame_rate_is_seen():
    class PerFrame(System):
        def process(self, dt):
            self.world.bodies.dynamic.linear_velocity[:, 0] += 0.1

    def build():
        world = heap_of([0, 1, 2, 3, 4])
        world.add_system(PerFrame(), frame=True)
        return world

    with pytest.raises(AssertionError, match=r"entity \d+, step 60 and 60: "):
        kit.assert_frame_rate_free(build, seconds=1.0)
