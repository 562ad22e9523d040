"""Spin as a component: inertia from shapes, torques and impulses, what a world keeps of it, and what is refused."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
import scipy.spatial
from rotation.helpers_turning import box, part, turning_world, wall
from scipy.spatial.transform import Rotation as Turn
from worlds import Calls, run

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import CaromError, Phase, StepError, World
from carom.plugins import Physics, capsule, convex_hull, convex_polygon
from carom.plugins.parts import PartOf, Parts
from carom.plugins.rotation import BoxCollider, Rotation, Spin

pytestmark = pytest.mark.plain
SIDE = 400  # of the lattice that sums inertia


def space(d=2, gravity=0, **settings):
    corners = (convex_polygon if d == 2 else convex_hull).plugin
    return turning_world(d, gravity, capsule.plugin, corners, **settings)


def shapes(random, d):
    """Shapes of random sizes, and which points of space each holds."""
    r, h = random.uniform(0.2, 0.8, 2)
    half = random.uniform(0.2, 0.9, d)
    axis = np.arange(d) == 1
    along = lambda x: np.clip(x[..., 1], -h, h)[..., None] * axis  # noqa: E731 - of the capsule's segment
    yield SphereCollider(r), lambda x: np.linalg.norm(x, axis=-1) <= r
    yield BoxCollider(half), lambda x: (np.abs(x) <= half).all(axis=-1)
    yield capsule.CapsuleCollider(r, h), lambda x: np.linalg.norm(x - along(x), axis=-1) <= r
    if d == 3:
        corners = random.uniform(-0.9, 0.9, (12, 3))
        faces = scipy.spatial.ConvexHull(corners).equations
        yield convex_hull.ConvexHullCollider(corners), lambda x: (x @ faces[:, :3].T + faces[:, 3] <= 0).all(axis=-1)
        return
    angles = np.sort(random.uniform(0, 2 * math.pi, 5))
    corners = np.stack((np.cos(angles), np.sin(angles)), axis=-1) * random.uniform(0.4, 0.7) + random.uniform(
        -0.2, 0.2, 2
    )
    for rounding in (0.0, 0.15):
        yield (
            convex_polygon.ConvexPolygonCollider(corners, corner_radius=rounding),
            lambda x, r=rounding: distance_to(corners, x) <= r,
        )


def turned(start, turn):
    """A quaternion w, x, y, z, turned along the world's axes by a vector."""
    return np.roll((Turn.from_rotvec(turn) * Turn.from_quat(np.roll(start, -1))).as_quat(), 1)


def distance_to(corners, x):
    """From points to a convex polygon, counter-clockwise; 0 inside."""
    best, inside = np.full(x.shape[:-1], np.inf), np.ones(x.shape[:-1], bool)
    for p, q in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        t, d = q - p, x - p
        nearest = np.clip((d @ t) / (t @ t), 0, 1)[..., None] * t
        best = np.minimum(best, np.linalg.norm(d - nearest, axis=-1))
        inside &= t[0] * d[..., 1] - t[1] * d[..., 0] >= 0
    return np.where(inside, 0.0, best)


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("seed", range(3))
def test_inertia_of_uniform_shapes_is_the_sum_over_a_lattice(seed, d):
    """sum m r^2 over points of a lattice, to its spacing; in the step what a torque does, in Python what it says, and
    the energy of turning is that of these points."""
    random = np.random.default_rng(seed)
    count = SIDE if d == 2 else 90
    line = (np.arange(count) + 0.5) / count * 4 - 2
    points = np.stack(np.meshgrid(*(line,) * d, indexing="ij"), axis=-1)
    for shape, holds in shapes(random, d):
        mass, offset, torque = 1.7, random.uniform(-0.5, 0.5, d), 0.3
        held = points[holds(points)] + offset
        square = (held**2).sum(axis=-1).mean()
        expected = mass * (square if d == 2 else square * np.eye(3) - np.einsum("ni,nj->ij", held, held) / len(held))
        with space(d) as world:
            twist = torque if d == 2 else (0, 0, torque)
            entity = world.create_entity(Transform((0,) * d), RigidBody(mass), Spin(constant_torque=twist))
            given = shape.copy()
            given.offset = offset
            world.add_component(entity, given)
            world.step()
            spin = part(world, entity, Spin)
            assert np.allclose(spin.moments, expected, rtol=0.03, atol=0.01 * mass)
            moments = np.linalg.inv(spin.moments)[2, 2] if d == 3 else 1 / spin.moments
            w = spin.angular_velocity if d == 2 else spin.angular_velocity[2]
            assert w == pytest.approx(torque * moments / 60, rel=1e-6)
            spin.angular_velocity = w = random.normal() if d == 2 else random.normal(size=3)
            assert world.kinetic_energy() == pytest.approx(0.5 * np.dot(w, np.dot(expected, w)), rel=0.05)


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("seed", range(4))
def test_an_impulse_at_a_point_gives_momentum_and_angular_momentum(seed, d):
    """dv = j / m and dL = r x j; the velocity of the point is then v + w x r. A force gives as much in its time."""
    random = np.random.default_rng(seed)
    place, at, impulse, w0 = (random.uniform(-2, 2, d) for _ in range(4))
    turn, half = 0.4 if d == 2 else random.normal(size=4), random.uniform(0.3, 1, d)
    arm, spins = np.append(at - place, 0)[:3], []
    for start in (w0[0] if d == 2 else w0, 0.0 if d == 2 else np.zeros(3)):
        with space(d) as world:
            entity = box(world, place, half, spin=start, rotation=turn, mass=2.0)
            world.bodies  # noqa: B018 - takes it in
            spin, body = part(world, entity, Spin), part(world, entity, RigidBody)
            spin.apply_impulse(impulse, at)
            spins.append(np.array(spin.angular_velocity))
            assert np.allclose(body.linear_velocity, impulse / 2.0)
            w = np.array((0, 0, spin.angular_velocity)) if d == 2 else np.array(spin.angular_velocity)
            assert np.allclose(spin.velocity_at(at), body.linear_velocity + np.cross(w, arm)[:d])
            axes = Turn.identity() if d == 2 else Turn.from_quat(np.roll(part(world, entity, Transform).rotation, -1))
            moments = axes.as_matrix() @ (spin.moments * np.eye(3) if d == 2 else spin.moments) @ axes.as_matrix().T
            gained = moments @ (w - (np.array((0, 0, start)) if d == 2 else start))
            assert np.allclose(gained, np.cross(arm, np.append(impulse, 0)[:3]), rtol=1e-12, atol=1e-14)
    with space(d, dt=1e-6) as world:
        entity = box(world, place, half, rotation=turn, mass=2.0)
        world.bodies  # noqa: B018
        part(world, entity, Spin).apply_force(impulse / 1e-6, at)
        world.step()
        assert np.allclose(part(world, entity, Spin).angular_velocity, spins[1], rtol=1e-4)
        assert np.allclose(part(world, entity, RigidBody).linear_velocity, impulse / 2.0)


def test_a_torque_acts_for_the_frame_in_which_it_is_applied_and_in_a_system_for_one_step():
    with space() as world:
        entity = world.create_entity(Transform((0, 0)), RigidBody(), Spin(inertia=0.5))
        world.bodies  # noqa: B018
        spin = part(world, entity, Spin)
        spin.apply_torque(1.0)
        spin.apply_force((0, 3), at=(0.5, 0))
        world.advance(3 / 60)
        assert spin.angular_velocity == pytest.approx((1.0 + 1.5) / 0.5 * 3 / 60)
        assert part(world, entity, RigidBody).linear_velocity[1] == pytest.approx(3 * 3 / 60)
        world.step()
        assert spin.angular_velocity == pytest.approx(2.5 / 0.5 * 3 / 60)
        world.add_system(Calls(Phase.FORCES, lambda: spin.apply_torque(2.0)))
        run(world, 2)
        assert spin.angular_velocity == pytest.approx((2.5 * 3 + 2.0 * 2) / 0.5 / 60)


@pytest.mark.compiled
def test_what_spins_stays_awake_and_what_has_stopped_sleeps():
    """So does what a small torque turns."""
    with space(gravity=10, sleeping=True) as world:
        wall(world, (0, -1), (10, 1))
        still, turns, twisted = (
            world.create_entity(Transform((x, 0.5)), RigidBody(), spin, SphereCollider(0.5))
            for x, spin in ((-3, Spin()), (3, Spin(2)), (6, Spin(inertia=1.0, constant_torque=0.005)))
        )
        run(world, 120)
        assert [part(world, e, RigidBody).asleep for e in (still, turns, twisted)] == [True, False, False]
        assert part(world, turns, Transform).rotation == pytest.approx(4.0)
        assert part(world, twisted, Spin).angular_velocity == pytest.approx(0.01)


@pytest.mark.compiled
@pytest.mark.parametrize("way", range(4))
def test_what_the_game_does_to_the_spin_of_a_sleeper_wakes_it(way):
    """It rolls then as one that never slept: m r v + I w about the ground stays, k = 1/2."""
    with space(gravity=10, sleeping=True) as world:
        wall(world, (0, -1), (50, 1), friction=0.5)
        entity = world.create_entity(Transform((0, 0.5)), RigidBody(), Spin(), SphereCollider(0.5, friction=0.5))
        run(world, 100)
        body, spin = part(world, entity, RigidBody), part(world, entity, Spin)
        assert body.asleep
        if way == 0:
            spin.angular_velocity = -5.0
        elif way == 1:
            world.bodies.spin.angular_velocity[world.bodies.rows_of([entity])] = -5.0
        elif way == 2:
            spin.apply_impulse((1, 0), (0, 0.9))
        else:
            spin.apply_torque(-20.0)
        run(world, 60)
        about_ground = (5 * 0.125, 5 * 0.125, 0.9, 20 / 60)[way]
        assert not body.asleep
        assert body.linear_velocity[0] == pytest.approx(about_ground / (0.5 + 0.125 / 0.5), rel=1e-9)


@pytest.mark.compiled
@pytest.mark.parametrize("collider", [(), (SphereCollider(1),)])
def test_the_slow_hand_of_a_clock_does_not_fall_asleep(collider):
    hour = math.tau / 43200
    with space(sleeping=True) as world:
        colliders = [one.copy() for one in collider]
        hand = world.create_entity(Transform((0, 0)), RigidBody(kind="kinematic"), Spin(hour), *colliders)
        run(world, 300)
        assert part(world, hand, Transform).rotation == pytest.approx(5 * hour)


@pytest.mark.compiled
def test_a_world_with_the_plugin_but_without_a_spin_runs_the_same_stages_and_bits():
    found, places = [], np.random.default_rng(0).uniform(1, 5, (20, 2))
    for plugins in ((), (Rotation(),)):
        with World(Physics(2, gravity=(0, -10)), *plugins) as world:
            world.create_entity(Transform((0, 0)), RigidBody(kind="static"), AABBCollider((5, 0.5)))
            world.create_entities(20, Transform.many(places), RigidBody.many(), SphereCollider.many(0.3))
            run(world, 60)
            found.append((world.state_hash(), str(world.plan()).partition("columns, bytes per body")[0]))
    assert found[0] == found[1]


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("seed", range(2))
def test_a_collider_that_is_gone_for_a_moment_leaves_the_inertia_as_it_was(seed, d, tmp_path):
    """Free flight of lopsided boxes and a part is to the bit that of twins which keep theirs, also in a file;
    torques, impulses and energy too. Another mass counts, and so does another collider."""
    random, found = np.random.default_rng(seed), []
    values = [(random.uniform(0.1, 0.6, d), random.uniform(-0.3, 0.3, d), random.uniform(0.5, 4)) for _ in range(4)]
    for goes in (False, True):
        with World(Physics(d), Rotation(), Parts()) as world:
            bodies = []
            for k, (half, offset, mass) in enumerate(values):
                body = RigidBody(mass), Spin(2.0 if d == 2 else (2.0, 1.0, -3.0)), BoxCollider(half, offset=offset)
                bodies.append(world.create_entity(Transform(9.0 * k * np.eye(d)[0]), *body))
            turn, half = 0.7 if d == 2 else (0.8, 0.36, 0.48, 0.0), (0.2, 0.5, 0.3)[:d]
            bodies.append(world.create_entity(PartOf(bodies[0], np.eye(d)[0], turn, mass=0.3), BoxCollider(half)))
            world.step()
            removed = [part(world, body, BoxCollider) for body in bodies if goes]
            for body in bodies[: len(removed)]:
                world.remove_component(body, BoxCollider)
            for _ in range(10):
                part(world, bodies[1], RigidBody).mass += 0.1
                part(world, bodies[2], Spin).apply_torque(0.5 if d == 2 else (0.5, 0.1, 0.2))
                part(world, bodies[3], Spin).apply_impulse(np.eye(d)[1], at=(27.5, 0.1, 0.2)[:d])
                world.step()
            if goes:
                world.save(tmp_path / "twin")
                world = World.load(tmp_path / "twin", Physics(d), Rotation(), Parts())
            for body, collider in zip(bodies, removed, strict=False):
                world.add_component(body, collider.copy())
            run(world, 3)
            found.append((*[getattr(world.bodies, name).copy() for name in ("position", "rotation", "linear_velocity")],
                          world.bodies.spin.angular_velocity.copy(), world.kinetic_energy()))  # fmt: skip
    for kept, without in zip(*found, strict=True):
        np.testing.assert_array_equal(kept, without)


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("seed", range(2))
def test_what_turns_is_drawn_evenly_at_144_hz(seed, d):
    """Constant spins of round bodies: a step behind, each has turned by w (t - dt), from any rotation, in 3D about any
    axis and with either sign of the quaternion. Columns and Transforms say the same; what does not turn stays."""
    random = np.random.default_rng(seed)
    with space(d) as world:
        spins = random.uniform(-20, 20, (12, 3)) if d == 3 else random.uniform(-20, 20, 12)
        transforms = [Transform(5.0 * k * np.eye(d)[0], random.normal(size=4) if d == 3 else k) for k in range(13)]
        for k, each in enumerate(transforms[:12]):
            body = RigidBody(linear_velocity=np.eye(d)[1], kind=("dynamic", "kinematic")[k % 2])
            world.create_entity(each, body, Spin(spins[k]), SphereCollider(0.5))
        world.create_entity(transforms[12], SphereCollider(0.5))
        starts = np.array([each.rotation for each in transforms])
        for n in range(1, 100):
            world.advance(1 / 144)
            passed = max(n / 144 - 1 / 60, 0.0)
            rows = world.bodies.rows_of(np.array([each.entity for each in transforms]))
            places, drawn = world.bodies.interpolated_position[rows], world.bodies.interpolated_rotation[rows]
            np.testing.assert_allclose(places[:12, 1], passed, rtol=0, atol=1e-9)
            for k, each in enumerate(transforms):
                np.testing.assert_array_equal(each.interpolated_rotation, drawn[k])
                np.testing.assert_array_equal(each.interpolated_position, places[k])
                way = passed * spins[k] if k < 12 else 0.0 * spins[0]
                right = starts[k] + way if d == 2 else turned(starts[k], way)
                error = min(np.abs(drawn[k] - right).max(), np.abs(drawn[k] + right).max() if d == 3 else np.inf)
                assert error < 1e-9


@pytest.mark.compiled
@pytest.mark.parametrize("d", [2, 3])
def test_what_is_turned_by_hand_has_lost_its_spin_or_sleeps_is_drawn_as_it_is(d):
    with space(d, (0, -10, 0)[:d], sleeping=True) as world:
        world.create_entity(Transform(-np.eye(d)[1]), BoxCollider(np.where(np.arange(d) == 1, 1.0, 90.0), friction=0.5))
        hand, lost, falls = (Transform(np.eye(d)[1] * (4.0, 3.0, 0.52)[k] + 9.0 * k * np.eye(d)[0]) for k in range(3))
        for each in (hand, lost, falls):
            own = RigidBody(kind="dynamic" if each is falls else "kinematic")
            spin = 0.0 if each is falls else 3.0 * np.eye(3)[2] if d == 3 else 3.0
            world.create_entity(each, own, Spin(spin), BoxCollider([0.5] * d, friction=0.5))
        tilt = 0.02 if d == 2 else (math.cos(0.01), 0.0, 0.0, math.sin(0.01))
        falls.rotation = tilt
        world.advance(2.5 / 60)
        assert np.any(hand.interpolated_rotation != hand.rotation)
        assert np.any(lost.interpolated_rotation != lost.rotation)
        hand.rotation = tilt
        world.remove_component(lost.entity, Spin)
        world.advance(0.0)
        np.testing.assert_array_equal(hand.interpolated_rotation, hand.rotation)
        kept, drawn = world.snapshot(), world.bodies.interpolated_rotation
        world.advance(2 / 60)
        np.testing.assert_array_equal(lost.interpolated_rotation, lost.rotation)
        world.restore(kept)
        np.testing.assert_array_equal(world.bodies.interpolated_rotation, drawn)
        while not part(world, falls.entity, RigidBody).asleep:
            assert world.time < 10.0
            world.step()
        world.step()
        world.advance(0.5 / 60)
        np.testing.assert_array_equal(falls.interpolated_rotation, falls.rotation)


REFUSED = [  # dimensions, plugins, components, what the error says
    (2, [Rotation], (Spin(1), AABBCollider((1, 1))), "entity {} has Spin, which no AABBCollider can have"),
    (2, [], (Spin(1), SphereCollider(1)), "Spin does nothing without its plugin"),
    (2, [], (BoxCollider((1, 1)),), "World(Physics(...), Rotation()), from carom.plugins.rotation"),
    (2, [Rotation], (Spin(1),), "entity {}: ValueError: Spin.inertia is None, and it has no collider that tells it"),
    (3, [Rotation], (Spin(1.0), SphereCollider(1)), "Spin.angular_velocity must be 3 numbers in this 3D"),
    (2, [Rotation], (Spin((0, 0, 1)), SphereCollider(1)), "Spin.angular_velocity must be one number in this 2D"),
]


@pytest.mark.parametrize(("d", "plugins", "components", "message"), REFUSED, ids=range(len(REFUSED)))
def test_what_cannot_spin_is_refused_by_entity_with_the_cure(d, plugins, components, message):
    with World(Physics(d, gravity=0), *(plugin() for plugin in plugins)) as world:
        other = world.create_entity(Transform((9,) * d), RigidBody(), SphereCollider(1))

        def create_and_step():
            world.create_entity(Transform((0,) * d), RigidBody(), *(one.copy() for one in components))
            world.step()

        with pytest.raises((CaromError, ValueError), match=re.escape(message.format(other + 1))):
            create_and_step()
        if world.entity_exists(other + 1):
            world.delete_entity(other + 1, immediate=True)
        world.step()
        assert world.entity_exists(other)


@pytest.mark.parametrize("beside", [(), (BoxCollider((1, 1)),)], ids=["alone", "with a collider"])
def test_a_spin_without_a_rigid_body_is_refused_until_it_has_one(beside):
    with space() as world:
        entity = world.create_entity(Transform((0, 0)), Spin(1.0, 1.0), *(one.copy() for one in beside))
        with pytest.raises(ValueError, match=f"entity {entity} has Spin, but no RigidBody, which Spin needs"):
            world.step()
        world.add_component(entity, RigidBody())
        world.step()
        assert part(world, entity, Transform).rotation == pytest.approx(1 / 60)


def test_wrong_values_of_spin_are_refused_where_they_are_given():
    wrong = {
        "inertia": [0, -1], "angular_damping": [-1], "angular_velocity": [math.nan, 1e200], "max_angular_speed": [-1],
    }  # fmt: skip
    for name, values in wrong.items():
        for value in values:
            with pytest.raises(ValueError, match=rf"Spin\.{name}"):
                Spin(**{name: value})
    with pytest.raises(CaromError, match="belongs to no body"):
        Spin(1.0).velocity_at((0, 0))
    with space(on_fault="ignore") as world:
        entity = world.create_entity(Transform((0, 0)), RigidBody(), Spin(1), SphereCollider(1))
        world.step()
        columns = {"angular_velocity": math.nan, "constant_torque": math.nan, "step_torque": math.inf, "inertia": -1.0}
        for name, value in (columns | {"angular_damping": -1.0, "max_angular_speed": -1.0}).items():
            column = getattr(world.bodies.spin, name)
            before, column[0] = column[0], value
            world.step()
            (fault,) = world.faults
            assert fault.startswith(f"entity {entity}: spin.{name} is {value}; until it is mended")
            column[0] = before
            world.step()
            world.faults.clear()
        part(world, entity, Spin).inertia = 1e-9
        part(world, entity, Spin).apply_torque(9e149)
        with pytest.raises(StepError, match=rf"entity {entity}: ValueError: a torque is so large"):
            world.step()


@pytest.mark.parametrize("d", [2, 3])
def test_bodies_made_at_once_have_an_inertia_of_their_own_or_that_of_their_shape(d):
    given, whole = (0.7, [[0.5]]) if d == 2 else ((0.7, 0.8, 0.9), 0.4 * np.eye(3))
    with space(d) as world:
        parts = Transform.many(np.eye(3)[:, :d] * 9), RigidBody.many(), SphereCollider.many(1)
        world.create_entities(3, Spin.many(inertia=[None, given, None]), *parts)
        world.step()
        moments = [np.atleast_2d(spin.moments) for _, spin in world.get_component(Spin)]
        assert np.allclose(moments, [whole, np.diag(np.atleast_1d(given)), whole])
        with pytest.raises(ValueError, match=r"Spin.inertia must be numbers, got \[None, 'heavy', None\]"):
            world.create_entities(3, Spin.many(inertia=[None, "heavy", None]), *parts)


@pytest.mark.parametrize("d", [2, 3])
def test_a_push_that_is_refused_changes_nothing(d):
    with space(d) as world:
        entity = world.create_entity(Transform((0,) * d), RigidBody(), Spin(), SphereCollider(1))
        world.step()
        spin, at = part(world, entity, Spin), world.state_hash()
        with pytest.raises(ValueError, match=rf"entity {entity}: Spin.angular_velocity must be at most 1e\+150"):
            spin.apply_impulse((0, 1e10, 0)[:d], at=(1e200, 0, 0)[:d])
        spin.apply_torque(9e149 if d == 2 else (0, 0, 9e149))
        pushed = world.state_hash()
        with pytest.raises(ValueError, match=rf"entity {entity}: Spin.apply_force: its torque must be at most 1e\+150"):
            spin.apply_force((0, 1e148, 0)[:d], at=(1e4, 0, 0)[:d])
        assert world.state_hash() == pushed != at


def test_an_impulse_does_not_turn_a_rod_about_its_own_axis():
    """It has no inertia about it."""
    with space(3) as world:
        entity = world.create_entity(Transform((0, 0, 0)), RigidBody(3.0), Spin(), BoxCollider((1, 0, 0)))
        world.step()
        spin = part(world, entity, Spin)
        spin.apply_impulse((0, 2, 1), at=(1, 1, 0))  # twist (1, -1, 2), inertia (0, 1, 1)
        assert spin.angular_velocity == pytest.approx((0, -1, 2))


def test_the_spin_of_a_deleted_body_says_so():
    world = space()
    entity = world.create_entity(Transform((0, 0)), RigidBody(), SphereCollider(0.5), Spin())
    world.step()
    spin = world.component_for_entity(entity, Spin)
    world.delete_entity(entity)
    world.step()
    for use in (
        lambda: spin.apply_torque(1.0), lambda: spin.apply_force((1, 0), at=(0, 0)), lambda: spin.moments,
        lambda: spin.apply_impulse((1, 0), at=(0, 0)), lambda: spin.velocity_at((0, 0)),
    ):  # fmt: skip
        with pytest.raises(CaromError, match="that of a deleted entity does no more"):
            use()
