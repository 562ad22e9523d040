"""suggest_dt and step_limits: speed against thin shapes, no limits and invalid input; the world is not changed."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from helpers_motion import SpringAndDrag, oscillators
from worlds import ball, box, floor, make_world, mostly_2d

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import ForceSystem, NoPhysicsError, Settings, StepError, System, World
from carom.lab.limits.step_length import SAFETY, step_limits, suggest_dt
from carom.plugins import Physics
from carom.plugins.half_space import HalfSpaceCollider
from carom.plugins.half_space import plugin as half_space
from carom.plugins.joints import Distance, Joints
from carom.plugins.parts import PartOf, Parts
from carom.plugins.rotation import BoxCollider, Rotation, Spin
from carom.plugins.springs import Springs

# -- no limits, and invalid input ----------------------------------------------------------------


def test_worlds_in_which_nothing_limits():
    still, falling, empty = make_world(gravity=10), make_world(gravity=10), make_world()
    floor(still)
    box(still, (0, 3), kind="kinematic")
    falling.create_entity(Transform((0, 0)), RigidBody(linear_velocity=(5, 5)))
    empty.add_system(SpringAndDrag())
    for world in (still, falling, empty):
        assert suggest_dt(world) == math.inf
        assert step_limits(world).oscillation is None
        assert "Nothing limits the step" in str(step_limits(world))


def test_forces_that_are_not_finite_are_named():
    class Hole(ForceSystem):
        def add_forces(self, bodies, time):
            bodies.force -= bodies.position / (bodies.position**2).sum(axis=1)[:, None] ** 1.5

    world = make_world()
    entity = ball(world, (0, 0))
    world.add_system(Hole())
    with np.errstate(all="ignore"), pytest.raises(ValueError, match=f"entity {entity}: the forces on it are"):
        suggest_dt(world)
    assert (world.bodies.position == 0).all()
    with pytest.raises(NoPhysicsError):
        suggest_dt(World())


def test_an_error_in_a_force_system_leaves_the_world_as_it_was():
    class Fails(ForceSystem):
        calls = 0

        def add_forces(self, bodies, time):
            self.calls += 1
            assert self.calls <= 3, "out of fuel"

    world = make_world()
    ball(world, (1, 2), (3, 4))
    world.add_system(Fails())
    before = world.state_hash()
    with pytest.raises(AssertionError, match="out of fuel"):
        suggest_dt(world)
    assert world.state_hash() == before


def test_not_inside_a_step():
    class Asks(System):
        def process(self, dt):
            suggest_dt(self.world)

    world = oscillators("rk4", 1 / 60, 1.0)
    world.add_system(Asks())
    with pytest.raises(StepError, match="between steps only"):
        world.step()


# -- the world is not changed --------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("collision", ["discrete", "continuous", "event_driven"])
def test_asking_changes_no_bit_of_what_follows(collision):
    """Bouncing and resting bodies on springs, with calls before each of eight steps around the first impacts, against
    an equal world without calls."""
    hashes = []
    for asked in (False, True):
        springs = Springs()
        world = World(Physics(gravity=(0, -10)), springs, settings=Settings(collision=collision))
        floor(world)
        bodies = [ball(world, (1.2 * k, 1.0 + k % 3), (k - 2.0, 0), restitution=0.2 * k) for k in range(6)]
        for a, b in itertools.pairwise(bodies):
            springs.connect(a, b, stiffness=40.0, damping=0.3)
        world.component_for_entity(bodies[0], RigidBody).apply_force((3.0, 1.0))
        found = []
        for step in range(24):
            if asked and step >= 16:
                before = world.state_hash(), world.stats().counters, list(world.faults), world.time
                suggest_dt(world)
                assert before == (world.state_hash(), world.stats().counters, world.faults, world.time)
            world.step()
            found.append(world.state_hash())
        assert len(world.contacts)
        hashes.append(found)
        world.close()
    assert hashes[0] == hashes[1]


# -- speed against thin shapes -------------------------------------------------------------------


def shot(collision="discrete", speed=30.0, thickness=0.1, radius=0.25, **body):
    world = make_world(collision=collision)
    world.create_entity(Transform((0, 0)), AABBCollider((thickness / 2, 5.0)))
    world.create_entity(
        Transform((-3.0, 0)), RigidBody(linear_velocity=(speed, 0), **body), SphereCollider(radius, restitution=1.0)
    )
    return world


def test_a_ball_and_a_wall():
    """v dt <= w + 2 r."""
    limits = step_limits(shot())
    assert limits.tunnelling == pytest.approx(0.6 / 30)
    assert limits.suggested == pytest.approx(SAFETY * 0.6 / 30)
    assert limits.stability == math.inf
    assert "overlap on a way of 0.6 m" in str(limits)
    assert (limits.passage.entity, limits.passage.other) == (2, 1)
    assert step_limits(shot(ccd=True)).passage is None
    for collision in ("continuous", "event_driven"):
        assert step_limits(shot(collision)).passage is None
    for phase in range(8):  # at the suggested step none tunnels, wherever in a step it arrives
        world = shot()
        world.settings = world.settings.replace(dt=suggest_dt(world))
        world.bodies.dynamic.position[0, 0] -= phase / 8 * 30.0 * world.settings.dt
        for _ in range(10):
            world.step()
        assert world.bodies.dynamic.position[0, 0] < 0.0 > world.bodies.dynamic.linear_velocity[0, 0]
        world.close()


@pytest.mark.parametrize("seed", range(3))
def test_the_first_passage_against_all_pairs(seed):
    """Random sizes, speeds, filters, kinds, sensors, beside a half-space without an end: the shortest
    (size + size') / (speed + speed') of all pairs that meet."""
    random = np.random.default_rng(seed)
    world = World(Physics(), half_space)
    world.create_entity(Transform((0, -90)), HalfSpaceCollider((0.0, 1.0)))
    bodies = []
    for k in range(40):
        kind = ("dynamic", "kinematic", "static")[random.integers(3)]
        velocity = np.zeros(2) if kind == "static" else random.normal(size=2) * 10 ** random.uniform(-1, 2)
        size, layer, mask = 10 ** random.uniform(-2, 1), 2 ** random.integers(3), random.integers(1, 8)
        filters = {"layer": int(layer), "mask": int(mask), "group": k % 3 - 1, "sensor": bool(random.integers(5) == 0)}
        world.create_entity(
            Transform((9.0 * k, 0)), RigidBody(linear_velocity=velocity, kind=kind), SphereCollider(size / 2, **filters)
        )
        if not filters["sensor"]:
            bodies.append((kind, float(np.linalg.norm(velocity)), size, layer, mask, filters["group"]))
    expected = min(
        (a[2] + b[2]) / (a[1] + b[1])
        for a, b in itertools.combinations(bodies, 2)
        if "dynamic" in (a[0], b[0]) and a[3] & b[4] and b[3] & a[4] and a[1] + b[1] > 0 and not a[5] == b[5] != 0
    )
    assert step_limits(world).tunnelling == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("stepped", [False, True])
@mostly_2d
def test_bodies_that_are_connected_meet_others_alone(d, stepped):
    """A hammer of a body, a part of it and a part of that, and two bodies beside it, tied to each other."""
    def limits(*more, **joint):
        world = World(Physics(dimensions=d), Rotation(), Parts(), Joints())

        def body(x, speed=40.0):
            moves = RigidBody(linear_velocity=(0, speed, 0)[:d])
            return world.create_entity(Transform((x, 0, 0)[:d]), moves, Spin(), BoxCollider(0.1))

        a, b, c = body(0), body(1), body(2)
        head = world.create_entity(PartOf(a, (0.3, 0, 0)[:d]), BoxCollider(0.05))
        world.create_entity(PartOf(head, (0.1, 0, 0)[:d]), BoxCollider(0.02))
        for one, other in ((a, b), (b, c), (c, a)):
            world.create_entity(Distance(one, other, **joint))
        for each in more:
            body(*each)
        if stepped:
            world.step()
        return step_limits(world)

    assert limits().passage is None
    assert limits(collide_connected=True).tunnelling == pytest.approx((0.04 + 0.2) / 80)
    assert limits((9.0, 0.0)).tunnelling == pytest.approx((0.04 + 0.2) / 40)
