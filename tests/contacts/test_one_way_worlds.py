"""One-way colliders in worlds: as lifts, by masks, asleep, in maps and queries, and for how long they hold."""

from __future__ import annotations

import math
import runpy
from pathlib import Path

import numpy as np
import pytest
from contacts.helpers_one_way import REST, SHAPES, G, each_shape, make_world, platform, run, throw
from worlds import position, velocity

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Phase, Settings, System, World
from carom.plugins import Physics, tile_grid
from carom.plugins.capsule import CapsuleCollider
from carom.plugins.joints import Distance, Joints, MousePull, Slider
from carom.plugins.rotation import BoxCollider, Rotation, Spin
from carom.plugins.tile_grid import TileGridCollider

pytestmark = pytest.mark.slow  # its shapes take long to compile


@each_shape
def test_a_lift_carries_and_is_jumped_through(shape):
    """It rises at 2 m/s; a body jumps through it by its velocity relative to the lift, and rides on it."""
    lift = RigidBody(kind="kinematic", linear_velocity=(0, 2))
    world = make_world((Transform((0, 0)), platform(5.0), lift))
    rider = throw(world, (-2, 0.5), shape=shape)
    jumper = throw(world, (2, -2), (0, 12), shape)
    still = world.create_entity(Transform((3.5, 3)), RigidBody(gravity_scale=0), SHAPES[shape]())
    run(world, 3.0)
    top = position(world, 1)[1]
    assert top == pytest.approx(6.0)
    for entity in (rider, jumper, still):  # bodies at rest in the air are picked up
        assert position(world, entity)[1] - top == pytest.approx(0.5, abs=0.01)
        assert velocity(world, entity)[1] == pytest.approx(2, abs=0.01)


@each_shape
def test_a_platform_that_sinks_over_a_body_passes(shape):
    """From above with its back: a body below is not pushed."""
    sinks = RigidBody(kind="kinematic", linear_velocity=(0, -2))
    world = make_world(
        (Transform((0, 3)), platform(5.0), sinks), (Transform((0, -1)), AABBCollider((9, 1))))
    stands = throw(world, (0, 0.5), shape=shape)
    heights = run(world, 2.0, stands)
    assert abs(heights - 0.5).max() < REST


def test_dropping_through_by_the_mask():
    """Excluded from the platform's layer for a moment; once it passes it continues to pass."""
    world = make_world((Transform((0, 0)), platform(layer=2)))
    player = throw(world, (0, 0.5))
    run(world, 0.5)
    collider = world.component_for_entity(player, AABBCollider)
    collider.mask = ~2
    run(world, 0.15)
    assert position(world, player)[1] > 0.3  # its feet are still in it
    collider.mask = -1
    run(world, 1.0)
    assert position(world, player)[1] < -2


def test_shapes_of_other_plugins_and_bodies_with_levels_and_offsets():
    world = make_world(with_capsules=True)
    jumpers = [
        throw(world, (-1.5, -2), (0, 9), CapsuleCollider(0.2, 0.3)),
        world.create_entity(
            Transform((0, -2), math.pi / 2), RigidBody(linear_velocity=(0, 9)), CapsuleCollider(0.2, 0.3)),
        world.create_entity(
            Transform((1.3, -2), math.pi / 2), RigidBody(linear_velocity=(0, 9)),
            AABBCollider((0.3, 0.1), offset=(0.25, 0.0)), SphereCollider(0.6)),
    ]  # fmt: skip
    lows = 0.5, 0.2, 0.3 - 0.25
    low_jump = throw(world, (0.7, -2.0), (0, 6.0), CapsuleCollider(0.2, 0.3))
    heights = run(world, 3.0, *jumpers)
    assert heights.max(0) == pytest.approx([2.0 - 0.15 / 2] * 3, abs=0.1)
    assert heights[-1] == pytest.approx(lows, abs=REST)
    assert position(world, low_jump)[1] < -5


def test_sensors_and_contacts_switched_off_by_others_are_left_alone():
    world = make_world(
        (Transform((0, 0)), platform()),
        (Transform((0, 1)), platform(sensor=True)))  # fmt: skip
    jumper = throw(world, (0, -2), (0, 9))
    ghost = throw(world, (1.5, -2), (0, 9), sensor=True)
    seen = set()
    for _ in range(60):
        world.step()
        seen |= {(contact.entity_a, contact.entity_b) for contact in world.contacts.begin}
    assert seen == {(2, jumper), (1, ghost), (2, ghost)}


def test_the_order_of_ids_does_not_matter():
    """A body created before the segment: the segment is then the second of the pair."""
    results = []
    for first in (True, False):
        world = World(Physics(dimensions=2, gravity=(0, -G)))
        segment = Transform((0, 0)), platform()
        if not first:
            world.create_entity(*segment)
        jumpers = [throw(world, (-1, -2), (0, 9)), throw(world, (1, 3), (0, -20), "ball")]
        if first:
            world.create_entity(*segment)
        run(world, 2.0)
        results.append([position(world, entity)[1] for entity in jumpers])
    assert results[0] == results[1] == pytest.approx([0.5, 0.5], abs=REST)


def test_the_last_body_that_stands_on_it_is_deleted():
    """Then nothing moves any more, and no contact of the step before is left for systems of NARROW."""
    with World(Physics(2, gravity=(0, -9.81))) as world:
        world.create_entity(Transform((0, 0)), platform())
        body = world.create_entity(Transform((0, 0.5)), RigidBody(), SphereCollider(0.5))
        ended = []
        world.on("contact_end", ended.append)
        for _ in range(30):
            world.step()
        assert len(world.contacts) == 1
        world.delete_entity(body)
        world.step()
        assert len(world.contacts) == 0
        assert [contact.entity_b for contact in ended] == [body]


def test_bad_values_are_named():
    with pytest.raises(ValueError, match=r"AABBCollider\.one_way"):
        platform(one_way=(0, math.nan))
    with pytest.raises(ValueError, match=r"AABBCollider\.one_way"):
        World(Physics(dimensions=3)).create_entity(Transform((0, 0, 0)), AABBCollider(1, one_way=(0, 1)))


@pytest.mark.parametrize("mode", ["discrete", "continuous", "event_driven"])
@pytest.mark.parametrize("d", [2, 3])
def test_a_thick_platform_in_all_modes(mode, d):
    """What jumps through it flies as if alone, to the bit, and lands; so does what bounces; and a rewound game repeats
    itself to the bit, from within the platform and from on top of it."""

    def along(up):
        return (0.0, up, 0.0)[:d]

    def make(one_way):
        world = World(Physics(d, gravity=along(-G)), settings=Settings(collision=mode))
        mask = -1 if one_way else 0
        world.create_entity(Transform(along(-0.2)), AABBCollider((2.0, 0.2, 2.0)[:d], one_way=along(1.0), mask=mask))
        jumper = throw(world, along(-2.0), along(9.0))
        ball = throw(world, (1.4, 3.0, 0.0)[:d], along(-5.0), "ball", restitution=0.5)
        return world, jumper, ball

    world, *entities = make(True)
    heights = [run(world, 0.5, *entities)]
    inside = world.snapshot()
    heights.append(run(world, 2.5, *entities))
    end = world.state_hash()
    world.restore(inside)
    run(world, 2.5, *entities)
    assert world.state_hash() == end
    on_top = world.snapshot()
    hashes = []
    for _ in range(2):
        run(world, 0.2)
        hashes.append(world.state_hash())
        world.restore(on_top)
    assert hashes[0] == hashes[1]
    heights = np.concatenate(heights)
    free, *others = make(False)
    assert np.array_equal(heights[:50, 0], run(free, 50 / 60, others[0])[:, 0])
    assert heights[-1] == pytest.approx([0.5, 0.5], abs=REST)
    assert heights[:, 1].min() > 0.5 - 0.01 - (0.2 if mode == "discrete" else 0.0)


def test_what_stands_on_it_sleeps_and_is_held_when_it_wakes():
    world = make_world(sleeping=True)
    below = world.create_entity(Transform((0, -0.7)), AABBCollider((1.0, 0.1), mask=2))
    inside = throw(world, (0.0, -0.1), layer=2)  # on another floor, through the platform
    stands = throw(world, (1.5, 0.5))
    run(world, 3.0)
    assert all(world.component_for_entity(body, RigidBody).asleep for body in (stands, inside))
    assert velocity(world, stands)[1] == 0.0
    world.component_for_entity(stands, RigidBody).linear_velocity = (0.0, 3.0)
    heights = run(world, 2.0, stands, inside)
    assert heights[:, 0].max() > 0.9
    assert heights[-1] == pytest.approx([0.5, -0.1], abs=REST)
    assert world.component_for_entity(below, Transform).y == -0.7


def test_a_platform_that_can_be_moved():
    """It hangs in the air. What passes does not push it; what lands on it does: momentum is kept."""
    world = World(Physics(2))
    plank = world.create_entity(Transform((0, 0)), RigidBody(mass=3.0), platform())
    behind = throw(world, (-1.0, -2.0), (0.0, 3.0))
    lands = throw(world, (1.0, 2.0), (0.0, -4.0))
    run(world, 2.0)
    assert velocity(world, behind)[1] == 3.0
    assert velocity(world, plank)[1] == pytest.approx(-1.0)
    assert velocity(world, lands)[1] == pytest.approx(-1.0)


def test_a_map_of_platforms():
    cells = np.array([[0, 1, 1, 1, 0], [0, 0, 0, 0, 0], [0, 0, 0, 0, 0], [1, 1, 1, 1, 1]])
    world = World(Physics(2, gravity=(0, -G)), tile_grid.plugin)
    world.create_entity(Transform((0, 0)), TileGridCollider(cells, 1.0, lower=(0, -1), faces="floors", one_way=(0, 1)))
    jumper = throw(world, (2.5, 0.6), (0.0, 9.5), AABBCollider(0.3))
    heights = run(world, 3.0, jumper)
    assert heights.max() == pytest.approx(0.6 + 9.5**2 / 2 / G, abs=0.1)
    assert heights[-1, 0] == pytest.approx(3.3, abs=REST)


def test_queries_find_it_from_its_front():
    world = make_world((Transform((0, 0)), AABBCollider((2.0, 0.5), one_way=(0, 2))))
    shape = AABBCollider(0.25)
    for start, way, share in (
        ((0, 2), (0, -4), 1.25 / 4), ((0, -2), (0, 4), None), ((-4, 0), (4, 0), None), ((0, 0.3), (0, -4), None),
        ((0, 0.75), (0, -1), 0.0), ((0, 0.75), (0, 1), None),
    ):  # fmt: skip
        shares = [] if share is None else [pytest.approx(share)]
        assert [hit.fraction for hit in world.shape_cast(shape, start, way)] == shares
        met = world.ray_cast(start, way, max_distance=np.hypot(*way))
        assert [hit.point[1] for hit in met] == [0.5] * len(shares)
    assert world.query_point((0, 0)) == world.query_aabb((-1, -1), (1, 1)) == []
    assert world.query_point((0, 0), one_way=True) == world.query_aabb((-1, -1), (1, 1), one_way=True) == [1]


def test_it_can_be_set_at_any_time():
    """Between steps, of a collider that has been solid: with the next step it lets pass."""
    world = make_world((Transform((0, 0)), AABBCollider((2, 0.2))))
    below = throw(world, (0, -1.0), (0, 6.0))
    run(world, 0.4)
    assert position(world, below)[1] < -0.7
    world.component_for_entity(1, AABBCollider).one_way = (0, 1)
    world.component_for_entity(below, RigidBody).linear_velocity = (0, 9.0)
    assert run(world, 0.5, below).max() > 0.7


@each_shape
@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_twenty_jumps_of_any_height_end_on_it(shape, restitution):
    """Free flight up through it, for any gap at the end of a step; then at rest on it, with one begin."""
    world = make_world((Transform((0, 0)), platform(30.0)))
    speeds = 9.0 + 0.1 * np.arange(20)
    jumpers = [throw(world, (2.5 * k - 25, -2), (0, speed), shape, restitution=restitution)
               for k, speed in enumerate(speeds)]  # fmt: skip
    heights, begun = [], []
    for _ in range(240):
        world.step()
        heights.append([position(world, each)[1] for each in jumpers])
        begun += list(world.contacts.begin)
    steps = np.arange(1, 51)[:, None]
    free = -2 + speeds * steps / 60 - G * steps * (steps + 1) / 2 / 60**2
    np.testing.assert_allclose(heights[:50], free, atol=1e-12)
    np.testing.assert_allclose(heights[-1], 0.5, atol=REST)
    if restitution == 0.0:
        assert sorted((contact.entity_a, contact.entity_b) for contact in begun) == [(1, each) for each in jumpers]


SENDERS = {
    "slider": lambda world, ball, up: world.create_entity(Slider(None, ball, direction=(0, 1), motor_speed=15.0 * up)),
    "pull": lambda world, ball, up: world.create_entity(
        MousePull(ball, grip=position(world, ball), target=(0, up), frequency=5.0, max_force=800.0)),
    "spring": lambda world, ball, up: world.create_entity(
        Distance(None, ball, point_a=(0, 5 * up), length=5.0, frequency=6.0, damping_ratio=1.0)),
    "blow": lambda world, ball, up: world.create_entity(
        Transform(position(world, ball) - (0, 0.55 * up)), RigidBody(10.0, linear_velocity=(0, 12 * up)),
        SphereCollider(0.2, restitution=1.0, layer=2)),
    "push": lambda world, ball, up: world.create_entity(
        Transform(position(world, ball) - (0, 0.41 * up)), RigidBody(kind="kinematic", linear_velocity=(0, 12 * up)),
        AABBCollider((0.3, 0.1), layer=2)),
}  # fmt: skip


def sent(mode, sender, place, up, **plate):
    """Heights of a ball that a joint or another body has sent up or down within its first step, at a plate 0.1 thick
    which the others do not meet."""
    world = World(Physics(2), Rotation(), Joints(), settings=Settings(collision=mode, on_fault="ignore"))
    world.create_entity(Transform((0, -0.05)), AABBCollider((5.0, 0.05), **{"mask": 1, **plate}))
    ball = world.create_entity(Transform((0, place)), RigidBody(), Spin(), SphereCollider(0.3, restitution=0.5))
    other = SENDERS[sender](world, ball, up)
    heights = run(world, 1 / 60, ball)
    if sender == "push":
        world.component_for_entity(other, RigidBody).linear_velocity = (0, 0)
    heights = np.concatenate((heights, run(world, 0.2, ball)))
    world.close()
    return heights


@pytest.mark.parametrize("mode", ["discrete", "continuous", "event_driven"])
@pytest.mark.parametrize("sender", SENDERS)
def test_what_is_sent_within_a_step_is_stopped_as_by_a_floor(mode, sender):
    """At rest above it, then on it or in it by the end of the step in which a joint or a blow has sent it: free flight
    foresaw nothing of that. What is sent from below or inside goes as if there were nothing, to the bit."""
    for gap in (0.02, 0.05, 0.11, 0.17):
        stopped, floor = (sent(mode, sender, 0.3 + gap, -1, one_way=way) for way in ((0, 1), 0))
        assert min(stopped[-1], floor[-1]) > 0.1
    for place, up in ((-0.45, 1), (0.1, -1), (-0.05, 1)):
        met, free = (sent(mode, sender, place, up, one_way=(0, 1), mask=mask) for mask in (1, 0))
        inside = np.cumsum(free[:, 0] > 0.3) == 0  # until it has left
        assert np.array_equal(met[inside], free[inside])


@pytest.mark.parametrize("way", [0, (0, 1)])
def test_what_is_disabled_lets_through_what_a_motor_drives(way):
    """A contact whose ``enabled`` a system clears stops nothing, however far a joint moves the body in a step."""

    class Clear(System):
        phase = Phase.NARROW

        def process(self, dt):
            self.world.contacts.enabled[:] = False

    world = World(Physics(2, gravity=(0, -G)), Rotation(), Joints())
    world.create_entity(Transform((0, -0.05)), AABBCollider((5.0, 0.05), one_way=way))
    ball = world.create_entity(Transform((0, 0.3)), RigidBody(), Spin(), SphereCollider(0.3))
    run(world, 0.1)
    world.add_system(Clear())
    world.create_entity(Slider(None, ball, direction=(0, 1), motor_speed=-15.0))
    heights = run(world, 0.1, ball)[:, 0]
    assert np.diff(heights) == pytest.approx(-15 / 60)


@pytest.mark.parametrize("mode", ["discrete", "continuous"])
def test_a_pile_on_it_is_the_same_to_the_bit_as_on_a_floor(mode):
    """Boxes that tumble: corners that turn into it within a step come from the front."""
    ends = []
    for way in ((0, 0, 0), (0, 1, 0)):
        rng = np.random.default_rng(3)
        world = World(Physics(3, gravity=(0, -G, 0)), Rotation(), settings=Settings(collision=mode))
        world.create_entity(Transform((0, 0, 0)), AABBCollider((30, 0.1, 30), one_way=way, friction=0.6))
        for k in range(12):
            place = rng.uniform(-1.2, 1.2), 1.0 + 0.8 * k, rng.uniform(-1, 1)
            world.create_entity(Transform(place), RigidBody(), Spin(rng.uniform(-15, 15, 3)), BoxCollider(0.3))
        for _ in range(120):
            world.step()
        ends.append(world.bodies.dynamic.position.copy())
    assert ends[0][:, 1].min() > 0.3
    np.testing.assert_array_equal(*ends)


def test_the_example_runs(capsys):
    runpy.run_path(str(Path(__file__).resolve().parents[2] / "examples" / "one_way_platform.py"), run_name="__main__")
    lines = capsys.readouterr().out.splitlines()
    assert ["stands on the platform" in line for line in lines[-3:]] == [True, False, False]
    assert "stands on the floor" in lines[-1]
