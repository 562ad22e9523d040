"""The springs plugin: closed forms, energy, order, deleted bodies, bad input."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from carom.components import RigidBody, SphereCollider, Transform
from carom.framework import CaromError, NoPhysicsError, Settings, World
from carom.plugins import Physics
from carom.plugins.springs import Springs

pytestmark = pytest.mark.plain

ORIGIN = {2: (0.0, 0.0), 3: (0.0, 0.0, 0.0)}


def make(dimensions=2, gravity=0, **settings):
    springs = Springs()
    world = World(Physics(dimensions=dimensions, gravity=gravity), springs, settings=Settings(**settings))
    return world, springs


def body(world, *position, mass=1.0, velocity=0, kind="dynamic"):
    return world.create_entity(Transform(position), RigidBody(mass=mass, linear_velocity=velocity, kind=kind))


def x(world, entity):
    return world.component_for_entity(entity, Transform).position


def run(world, seconds):
    for _ in range(round(seconds / world.settings.dt)):
        world.step()


@pytest.mark.slow
@pytest.mark.parametrize("dimensions", [2, 3])
@pytest.mark.compiled
def test_two_masses_swing_as_the_closed_form_says(dimensions):
    """Length L + A cos(w t), w^2 = k (m + M) / (m M); Verlet's phase error is w t (w h)^2 / 24, 1.5e-6 here."""
    world, springs = make(dimensions, integrator="velocity_verlet", dt=1 / 1000)
    a = body(world, *ORIGIN[dimensions], mass=1.0)
    end = (3.0, 4.0) if dimensions == 2 else (3.0, 0.0, 4.0)
    b = body(world, *end, mass=3.0)
    springs.connect(a, b, 4.5, stiffness=12.0)
    w, centre = math.sqrt(12.0 / 0.75), 0.75 * np.array(end)
    assert springs.highest_frequency == pytest.approx(w, rel=1e-14)
    energy = world.potential_energy()
    assert energy == pytest.approx(0.5 * 12.0 * 0.5**2)
    worst = 0.0
    for _ in range(1000):
        world.step()
        expected = 4.5 + 0.5 * math.cos(w * world.time)
        assert np.linalg.norm(x(world, b) - x(world, a)) == pytest.approx(expected, abs=3e-6)
        worst = max(worst, abs(world.kinetic_energy() + world.potential_energy() - energy))
    assert worst < energy * (w * 1e-3) ** 2  # Verlet's energy oscillates by (w h)^2 / 4 and does not drift
    np.testing.assert_allclose((x(world, a) + 3 * x(world, b)) / 4, centre, atol=1e-12)
    np.testing.assert_allclose(world.momentum(), 0.0, atol=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize(("integrator", "tolerance"), [("velocity_verlet", 2e-5), ("rk4", 1e-9)])
@pytest.mark.compiled
def test_a_damped_oscillator_on_a_wall(integrator, tolerance):
    """x'' = -k x - c x' on mass 1: x = A e^(-c t / 2) (cos w t + c / (2 w) sin w t), w^2 = k - c^2 / 4."""
    world, springs = make(integrator=integrator, dt=1 / 500)
    wall, mass = body(world, 0.0, 0.0, kind="static"), body(world, 2.5, 0.0)
    springs.connect(wall, mass, 2.0, stiffness=9.0, damping=0.6)
    w = math.sqrt(9.0 - 0.09)
    for _ in range(1000):
        world.step()
        t = world.time
        expected = 0.5 * math.exp(-0.3 * t) * (math.cos(w * t) + 0.3 / w * math.sin(w * t))
        assert x(world, mass)[0] - 2.0 == pytest.approx(expected, abs=tolerance)
    assert x(world, wall).tolist() == [0.0, 0.0]


@pytest.mark.compiled
def test_a_chain_of_100_hangs_as_it_should():
    """Weights on springs: the k-th from the top carries all below it, so its spring is (101 - k) m g / k longer."""
    world, springs = make(gravity=(0.0, -10.0), dt=1 / 200)
    chain = [body(world, 0.0, 0.0, kind="static")]
    carried = itertools.accumulate(0.1 + (101 - k) * 0.01 * 10.0 / 200.0 for k in range(1, 101))
    chain += [body(world, 0.0, -depth, mass=0.01) for depth in carried]
    for upper, lower in itertools.pairwise(chain):
        springs.connect(upper, lower, 0.1, stiffness=200.0, damping=0.02)
    assert springs.highest_frequency == pytest.approx(2 * math.sqrt(200.0 / 0.01))
    before = world.bodies.position.copy()
    run(world, 0.25)
    np.testing.assert_allclose(world.bodies.position, before, atol=1e-10)
    assert [spring.tension for spring in springs][::33] == pytest.approx([10.0, 6.7, 3.4, 0.1], rel=1e-9)


@pytest.mark.slow
@pytest.mark.compiled
def test_a_rope_only_pulls():
    world, springs = make(integrator="velocity_verlet", dt=1 / 1000)
    post, ball = body(world, 0.0, 0.0, kind="static"), body(world, 1.0, 0.0, velocity=(-1.0, 0.0))
    rope = springs.connect(post, ball, 2.0, stiffness=4000.0, only_pulls=True)
    run(world, 2.5)  # past the post, slack all the way
    assert rope.tension == 0.0
    assert x(world, ball)[0] == pytest.approx(-1.5, abs=1e-12)
    assert world.potential_energy() == 0.0
    run(world, 1.0)  # taut at -2, and back as fast as it came
    assert world.bodies.linear_velocity[world.bodies.row_of(ball), 0] == pytest.approx(1.0, rel=1e-3)
    assert rope.length < 2.0


def test_damping_never_makes_a_rope_push():
    world, springs = make()
    a, b = body(world, 0.0, 0.0), body(world, 1.1, 0.0, velocity=(-5.0, 0.0))
    rope = springs.connect(a, b, 1.0, stiffness=1.0, damping=10.0, only_pulls=True)
    assert rope.tension == 0.0
    rope.only_pulls = False
    assert rope.tension == pytest.approx(0.1 - 50.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("integrator", "collision"),
    [("semi_implicit_euler", "discrete"), ("velocity_verlet", "continuous"), ("semi_implicit_euler", "event_driven")],
)
@pytest.mark.compiled
def test_the_limit_of_stiffness_is_where_the_page_says(integrator, collision):
    for ratio, holds in ((1.98, True), (2.02, False)):
        world, springs = make(integrator=integrator, dt=1 / 60, collision=collision)
        a, b = body(world, 0.0, 0.0, mass=1.0), body(world, 1.01, 0.0, mass=4.0)
        springs.connect(a, b, 1.0, stiffness=(ratio * 60) ** 2 / 1.25)
        for _ in range(300):
            world.step()
        length = abs(x(world, b)[0] - x(world, a)[0])
        assert bool(abs(length - 1.0) < 0.2) is holds
        assert (world.faults == []) is holds
    assert "springs: dt = 0.0167 s is too long" in world.faults[0]


def test_too_much_damping_is_reported_too():
    world, springs = make(dt=0.1)
    a, b = body(world, 0.0, 0.0), body(world, 1.0, 0.0)
    spring = springs.connect(a, b, stiffness=0.0, damping=10.5)
    world.step()
    assert "they hold up to dt = 0.0952 s" in world.faults[0]
    spring.damping = 5.0
    assert spring.connected


@pytest.mark.compiled
def test_the_order_of_creation_changes_no_bit():
    def hash_of(order, turned):
        world, springs = make(3, dt=1 / 120)
        rng = np.random.default_rng(3)
        bodies = [body(world, *rng.normal(size=3), mass=rng.uniform(1, 2)) for _ in range(12)]
        ends = [(i, j) for i in range(12) for j in range(i)]
        stiffness = rng.uniform(1, 9, len(ends))
        for k in order(list(range(len(ends)))):
            a, b = ends[k][::-1] if turned else ends[k]
            springs.connect(bodies[a], bodies[b], 1.0, stiffness=stiffness[k], damping=0.1)
            springs.connect(bodies[a], bodies[b], 1.5, stiffness=1.0, only_pulls=True)
        run(world, 1.0)
        return world.state_hash(), world.potential_energy()

    first = hash_of(list, turned=False)
    assert hash_of(lambda ks: ks[::-1], turned=False) == first
    assert hash_of(list, turned=True) == first


def test_a_spring_goes_with_its_body_and_says_so():
    world, springs = make()
    a, b, c = (body(world, float(k), 0.0) for k in range(3))
    lost, kept = springs.connect(a, b, stiffness=1.0), springs.connect(b, c, stiffness=1.0)
    heard = []
    world.on("spring_lost", heard.append)
    world.delete_entity(a)
    world.step()
    assert heard == [lost]
    assert not lost.connected
    assert kept.connected
    assert list(springs) == [kept]
    lost.remove()  # again, without effect
    with pytest.raises(CaromError, match="not connected any more"):
        _ = lost.length
    world.step()
    assert heard == [lost]
    assert world.faults == []


def test_a_removed_body_is_no_obstacle_before_the_next_step():
    world, springs = make()
    a, b = body(world, 0.0, 0.0), body(world, 1.0, 0.0)
    springs.connect(a, b, 0.5, stiffness=1.0)
    world.delete_entity(b, immediate=True)
    assert world.potential_energy() == 0.0


def test_removing_and_changing_springs():
    world, springs = make()
    a, b = body(world, 0.0, 0.0), body(world, 1.0, 0.0)
    spring = springs.connect(a, b, 0.5, stiffness=2.0)
    other = springs.connect(b, a, 1.0, stiffness=1.0)
    assert springs.of(a) == [spring, other]
    assert spring.tension == 1.0
    spring.rest_length, spring.stiffness = 0.0, 3.0
    assert spring.tension == 3.0
    assert springs.highest_frequency == pytest.approx(math.sqrt(8.0))
    spring.remove()
    assert not spring.connected
    assert len(springs) == 1
    springs.clear()
    world.step()
    assert not np.any(world.bodies.linear_velocity)
    assert springs.highest_frequency == 0.0


def test_bodies_at_one_point_are_pulled_nowhere():
    world, springs = make()
    a, b = body(world, 1.0, 1.0), body(world, 1.0, 1.0)
    springs.connect(a, b, 2.0, stiffness=5.0)
    world.step()
    assert np.isfinite(world.bodies.position).all()
    assert not np.any(world.bodies.linear_velocity)


def test_static_kinematic_and_collider_only_partners():
    world, springs = make()
    lift = body(world, 0.0, 0.0, kind="kinematic", velocity=(0.0, 1.0))
    wall = world.create_entity(Transform((5.0, 0.0)), SphereCollider(0.1))
    ball = body(world, 0.0, -1.0)
    springs.connect(lift, ball, 1.0, stiffness=10.0)
    springs.connect(wall, ball, 5.0, stiffness=0.1)
    run(world, 1.0)
    assert x(world, ball)[1] > -1.0
    assert x(world, lift)[1] == pytest.approx(1.0)
    assert x(world, wall).tolist() == [5.0, 0.0]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"stiffness": -1.0}, r"Spring.stiffness must be a finite number of at least 0, got -1.0"),
        ({"stiffness": math.nan}, "Spring.stiffness .* got nan"),
        ({"stiffness": "2"}, "Spring.stiffness .* got '2'"),
        ({"damping": math.inf}, "Spring.damping .* got inf"),
        ({"damping": True}, "Spring.damping .* got True"),
        ({"rest_length": -0.1}, "Spring.rest_length .* got -0.1"),
        ({"only_pulls": 1}, "Spring.only_pulls must be True or False, got 1"),
    ],
)
def test_bad_numbers_are_refused(change, message):
    world, springs = make()
    a, b = body(world, 0.0, 0.0), body(world, 1.0, 0.0)
    with pytest.raises(ValueError, match=message):
        springs.connect(a, b, **{"stiffness": 1.0, **change})
    assert len(springs) == 0
    spring = springs.connect(a, b, stiffness=1.0)
    (name, value), *_ = change.items()
    with pytest.raises(ValueError, match=message):
        setattr(spring, name, value)
    assert spring.stiffness == 1.0


def test_bad_bodies_are_refused():
    world, springs = make()
    a = body(world, 0.0, 0.0)
    with pytest.raises(ValueError, match="got entity 1 twice"):
        springs.connect(a, a, stiffness=1.0)
    ghost = world.create_entity(Transform((0.0, 0.0)))
    for wrong in (ghost, 99, None, "ball"):
        with pytest.raises(ValueError, match=r"b must be the entity of a body .* got"):
            springs.connect(a, wrong, stiffness=1.0)


def test_a_body_is_connected_in_the_step_in_which_it_is_made():
    """As joints are: a hook that a handler makes where something lands. It acts from the next step on."""
    world, springs = make(gravity=(0, -10))
    world.create_entity(Transform((0, -1)), SphereCollider(1.0))
    ball, made = world.create_entity(Transform((0, 0.3)), RigidBody(), SphereCollider(0.2)), []

    def hook(contact):
        made.append(world.create_entity(Transform((0, 2)), RigidBody(), SphereCollider(0.2)))
        springs.connect(ball, made[0], stiffness=50.0)

    world.on("contact_begin", hook)
    while not made:
        world.step()
    (spring,) = springs
    assert spring.rest_length == pytest.approx(2.0 - x(world, ball)[1])
    world.step()
    assert spring.connected
    with pytest.raises(ValueError, match="b must be the entity of a body"):
        springs.connect(ball, world.create_entity(Transform((0, 0))), stiffness=1.0)


def test_springs_belong_to_one_world():
    with pytest.raises(CaromError, match="in no world yet"):
        Springs().connect(1, 2, stiffness=1.0)
    with pytest.raises(NoPhysicsError, match="plugin springs needs physics before it"):
        World(Springs())
    world, springs = make()
    with pytest.raises(ValueError, match="each world takes its own Springs"):
        World(Physics(), springs)
    world.close()
    World(Physics(), springs).step()
