"""Islands at rest sleep: they stay to the bit, cost nothing, and wake for every reason there is."""

from __future__ import annotations

import itertools
import pickle

import numpy as np
import pytest
from worlds import ball, box, floor, make_world

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import ForceSystem, Phase, Settings, System, World
from carom.plugins import Physics, convex_polygon
from carom.plugins.springs import Springs
from carom.systems import Integration
from tests.helpers_pairwise import pairwise

MODES = ("discrete", "continuous", "event_driven")
METHODS = ("explicit_euler", "semi_implicit_euler", "velocity_verlet", "rk4", "yoshida4")
GRAVITY = 9.81


def sleepy_world(d: int = 2, **settings) -> World:
    world = make_world(d, GRAVITY, **{"sleeping": True, **settings})
    floor(world, friction=0.5)
    return world


def tower(world: World, x: float, height: int = 3) -> list[int]:
    """Boxes on the floor, one upon the other."""
    d = world.dimensions or 2
    return [box(world, (x, 0.5 + k, 0.0)[:d], friction=0.5) for k in range(height)]


def is_asleep(world: World, *entities: int) -> list[bool]:
    return [world.component_for_entity(entity, RigidBody).asleep for entity in entities]


def sleep(world: World, *entities: int, steps: int = 90) -> None:
    """Step until these are asleep, and two more steps, so that nothing is about to."""
    for _ in range(steps):
        if all(is_asleep(world, *entities)):
            break
        world.step()
    assert all(is_asleep(world, *entities))
    world.step()
    world.step()
    assert all(is_asleep(world, *entities))


def rows_of(world: World, entities) -> list[tuple]:
    """All that can be seen of these bodies and their contacts."""
    bodies, contacts = world.bodies, world.contacts
    rows = [bodies.row_of(entity) for entity in entities]
    touching = np.isin(contacts.entity_a, entities) | np.isin(contacts.entity_b, entities)
    names = ("entity_a", "entity_b", "point", "normal", "depth", "normal_impulse")
    seen = [getattr(bodies, name)[rows].tobytes() for name in ("position", "linear_velocity", "previous_position")]
    return seen + [getattr(contacts, name)[touching].tobytes() for name in names]


# -- falling asleep ----------------------------------------------------------------------------------------------------


def test_off_by_default_and_nothing_sleeps():
    world = sleepy_world(sleeping=False)
    assert Settings().sleeping is False
    boxes = tower(world, 0.0)
    for _ in range(60):
        world.step()
    assert not any(is_asleep(world, *boxes))
    assert not world.bodies.asleep.any()
    assert "_still" not in world.physics.table.arrays
    assert not any(name in str(world.plan()) for name in ("rest_sleepers", "judge_rest", "leave_out_still"))


@pytest.mark.parametrize(
    ("mode", "method", "d", "substeps"), pairwise(MODES, METHODS, (2, 3), (1, 4)), ids=lambda value: str(value)
)
def test_falls_asleep_and_stays_to_the_bit(mode, method, d, substeps):
    world = sleepy_world(d, collision=mode, integrator=method, substeps=substeps)
    boxes = tower(world, 0.0, 2)
    sleep(world, *boxes)
    before, contacts = world.state_hash(), len(world.contacts)
    assert contacts == 2
    for _ in range(20):
        world.step()
        assert len(world.contacts) == contacts
        assert len(world.contacts.begin) == len(world.contacts.end) == 0
    assert world.state_hash() == before
    assert not world.bodies.dynamic.linear_velocity.any()
    world.component_for_entity(boxes[0], RigidBody).apply_impulse((0.5, 0.0, 0.0)[:d])
    world.step()
    assert not any(is_asleep(world, *boxes))


def test_not_before_half_a_second_at_rest():
    world = sleepy_world()
    boxes = tower(world, 0.0, 1)
    for _ in range(28):
        world.step()
    assert is_asleep(world, *boxes) == [False]
    sleep(world, *boxes)


def test_what_drifts_flies_or_is_carried_does_not_sleep():
    world = make_world(2, 0.0, sleeping=True)
    drifting, thrown = ball(world, 0.0, 0.001), ball(world, 10.0, 0.0)
    world.component_for_entity(thrown, RigidBody).constant_force = (0.01, 0.0)
    lift = sleepy_world()
    box(lift, (0.0, 5.0), (0.0, 0.1), half=(2.0, 0.5), kind="kinematic")
    carried = box(lift, (0.0, 6.0))
    for _ in range(90):
        world.step()
        lift.step()
    assert not any(is_asleep(world, drifting, thrown))
    assert is_asleep(lift, carried) == [False]


def test_what_slides_slowly_does_not_stop():
    world = sleepy_world()
    slow = box(world, (0.0, 0.05), (0.02, 0.0), half=0.05, friction=0.0)
    for _ in range(120):
        world.step()
    assert world.component_for_entity(slow, RigidBody).linear_velocity[0] == pytest.approx(0.02)


def test_sleeps_on_a_kinematic_body_that_stands_until_it_moves():
    world = sleepy_world()
    lift = box(world, (0.0, 5.0), half=(2.0, 0.5), kind="kinematic")
    carried = tower(world, 0.0, 1)[0]
    world.component_for_entity(carried, Transform).position = (0.0, 6.0)
    sleep(world, carried)
    world.component_for_entity(lift, RigidBody).linear_velocity = (0.0, 1.0)
    world.step()
    assert is_asleep(world, carried) == [False]
    for _ in range(30):
        world.step()
    assert world.component_for_entity(carried, Transform).position[1] > 6.4


def test_a_sleeping_pile_costs_no_pairs_and_no_solving():
    world = sleepy_world()
    boxes = [entity for x in range(0, 8, 2) for entity in tower(world, float(x))]
    sleep(world, *boxes)
    world.reset_stats()
    world.step()
    counters = world.physics.counters()
    for name in ("candidates", "pairs", "contacts", "resting_contacts", "impacts"):
        assert counters[name] == 0, name
    assert len(world.contacts) == 12


# -- waking ------------------------------------------------------------------------------------------------------------


def push(world, boxes):
    world.component_for_entity(boxes[1], RigidBody).apply_force((30.0, 0.0))


def constant(world, boxes):
    world.component_for_entity(boxes[2], RigidBody).constant_force = (0.5, 0.0)


def in_a_column(world, boxes):
    world.bodies.linear_velocity[world.bodies.row_of(boxes[0])] = (0.5, 0.0)


def teleported(world, boxes):
    world.bodies.position[world.bodies.row_of(boxes[2])] += (0.2, 0.5)


def grown(world, boxes):
    world.component_for_entity(boxes[1], AABBCollider).half_extents = (0.6, 0.6)


def heavier(world, boxes):
    world.bodies.mass[world.bodies.row_of(boxes[2])] = 5.0


def other_layer(world, boxes):
    world.component_for_entity(boxes[0], AABBCollider).layer = 4


def sensor(world, boxes):
    world.component_for_entity(boxes[1], AABBCollider).sensor = True


def lighter(world, boxes):
    world.component_for_entity(boxes[1], RigidBody).gravity_scale = 0.5


def gravity(world, boxes):
    world.gravity = (0.0, -5.0)


def settings(world, boxes):
    world.settings = world.settings.replace(dt=1 / 120)


def bottom_deleted(world, boxes):
    world.delete_entity(boxes[0])


def floor_deleted(world, boxes):
    world.delete_entity(min(world.get_entities()))


def floor_moved(world, boxes):
    world.component_for_entity(min(world.get_entities()), Transform).position = (0.0, -2.0)


def floor_without_collider(world, boxes):
    world.remove_component(min(world.get_entities()), AABBCollider)


def without_collider(world, boxes):
    world.remove_component(boxes[1], AABBCollider)


def another_kind(world, boxes):
    world.component_for_entity(boxes[0], RigidBody).kind = "static"


def static_placed(world, boxes):
    world.create_entity(Transform((0.9, 1.5)), AABBCollider((0.5, 0.2)))


def body_placed(world, boxes):
    ball(world, (0.0, 3.49))


def touched(world, boxes):
    ball(world, (-2.0, 1.5), (40.0, 0.0), radius=0.3)


def touched_by_kinematic(world, boxes):
    box(world, (-1.6, 2.5), (3.0, 0.0), kind="kinematic")


def told(world, boxes):
    world.wake(boxes[1])


CAUSES = (
    push, constant, in_a_column, teleported, grown, heavier, other_layer, sensor, lighter, gravity, settings,
    bottom_deleted, floor_deleted, floor_moved, floor_without_collider, without_collider, another_kind, static_placed,
    body_placed, touched, touched_by_kinematic, told,
)  # fmt: skip
EVERYWHERE = gravity, settings, floor_deleted, floor_moved, floor_without_collider


@pytest.fixture(scope="module")
def asleep():
    """Two towers that sleep, apart, and their snapshot."""
    world = sleepy_world()
    boxes, others = tower(world, 0.0), tower(world, 20.0)
    sleep(world, *boxes, *others)
    return world, boxes, others, world.snapshot()


@pytest.mark.parametrize("cause", CAUSES, ids=lambda cause: cause.__name__)
def test_what_wakes_an_island(asleep, cause):
    world, boxes, others, snapshot = asleep
    world.settings = world.settings.replace(dt=1 / 60)
    world.restore(snapshot)
    cause(world, boxes)
    for _ in range(14 if cause is touched_by_kinematic else 3):
        world.step()
    left = [entity for entity in boxes if world.entity_exists(entity)]
    bodies = [e for e in left if world.component_for_entity(e, RigidBody).kind == "dynamic"]
    assert not any(is_asleep(world, *bodies))
    assert is_asleep(world, *others) == [cause not in EVERYWHERE] * 3


def test_an_island_that_is_disturbed_between_falling_asleep_and_the_next_step():
    for cause in (in_a_column, teleported, grown, bottom_deleted, floor_moved, constant):
        world = sleepy_world()
        boxes = tower(world, 0.0)
        while not is_asleep(world, boxes[1])[0]:
            world.step()
        cause(world, boxes)
        world.step()
        world.step()
        left = [entity for entity in boxes if world.entity_exists(entity)]
        assert not any(is_asleep(world, *left)), cause.__name__


def test_the_same_force_in_every_step_lets_sleep():
    world = sleepy_world()
    boxes = tower(world, 0.0)
    for _ in range(90):
        world.component_for_entity(boxes[1], RigidBody).apply_force((0.0, -3.0))
        world.step()
    assert all(is_asleep(world, *boxes))
    world.step()  # without it
    assert not any(is_asleep(world, *boxes))


def test_a_tower_whose_bottom_goes_falls():
    world = sleepy_world()
    boxes = tower(world, 0.0)
    sleep(world, *boxes)
    world.delete_entity(boxes[0])
    for _ in range(60):
        world.step()
    assert world.component_for_entity(boxes[1], Transform).position[1] == pytest.approx(0.5, abs=0.02)
    assert world.component_for_entity(boxes[2], Transform).position[1] == pytest.approx(1.5, abs=0.02)
    sleep(world, *boxes[1:])


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("speed", [5.0, 400.0])
def test_a_ball_thrown_at_a_sleeping_pile_wakes_that_island_alone(mode, speed):
    world = sleepy_world(collision=mode)
    near, far = tower(world, 0.0), tower(world, 30.0)
    sleep(world, *near, *far)
    thrown = ball(world, (-3.0, 1.5), (speed, 1.0), radius=0.3, mass=0.5, restitution=0.2)
    for _ in range(100):
        world.step()
        if not any(is_asleep(world, *near)):
            break
    assert not any(is_asleep(world, *near))
    assert all(is_asleep(world, *far))
    assert world.component_for_entity(thrown, Transform).position[0] < 0.5 or mode == "discrete"
    for _ in range(3):
        world.step()
    moved = world.component_for_entity(near[1], Transform).position[0]
    assert moved > 0.0 or (mode == "discrete" and speed > 100.0)


def test_a_bullet_wakes_what_it_sweeps_into():
    world = sleepy_world()
    boxes = tower(world, 0.0)
    sleep(world, *boxes)
    bullet = RigidBody(1.0, (3000.0, 0.0), ccd=True)
    shot = world.create_entity(Transform((-20.0, 1.5)), bullet, SphereCollider(0.05))
    world.step()
    assert not any(is_asleep(world, *boxes))
    assert world.component_for_entity(shot, RigidBody).linear_velocity[0] < 2000.0
    assert world.component_for_entity(boxes[1], RigidBody).linear_velocity[0] > 1000.0


def test_what_is_struck_in_the_second_place_wakes_before_it():
    """A bullet strikes a ball, and that, in the same step, what sleeps."""
    for mode in ("continuous", "event_driven"):
        world = sleepy_world(collision=mode)
        boxes = tower(world, 0.0)
        sleep(world, *boxes)
        first = ball(world, (-3.0, 1.5), (0.0, 0.0), radius=0.3, mass=0.1, restitution=1.0)
        ball(world, (-8.0, 1.5), (500.0, 0.0), radius=0.3, mass=5.0, restitution=1.0)
        world.step()
        assert world.component_for_entity(first, RigidBody).linear_velocity[0] != 0.0
        assert not any(is_asleep(world, *boxes))
        assert (world.bodies.dynamic.position[:3, 1] > 0.4).all()


def test_springs_and_other_force_systems_wake():
    springs = Springs()
    world = World(Physics(2, gravity=(0.0, -GRAVITY)), springs, settings=Settings(sleeping=True))
    floor(world)
    boxes = tower(world, 0.0, 1)
    hook = world.create_entity(Transform((0.0, 3.0)), RigidBody(kind="kinematic"))
    spring = springs.connect(boxes[0], hook, stiffness=1.0, damping=0.2, rest_length=1.0)
    sleep(world, *boxes)
    spring.stiffness = 2.0
    world.step()
    assert is_asleep(world, *boxes) == [False]

    class Wind(ForceSystem):
        strength = 0.0

        def add_forces(self, bodies, time):
            bodies.force += (self.strength, 0.0)

    sleep(world, *boxes)
    wind = Wind()
    world.add_system(wind)
    sleep(world, *boxes)
    wind.strength = 0.5
    world.step()
    assert is_asleep(world, *boxes) == [False]


def test_a_system_that_moves_a_sleeper_within_the_step_wakes_it():
    class Kick(System):
        phase = Phase.FORCES
        entity = 0

        def process(self, dt):
            if self.entity:
                self.world.component_for_entity(self.entity, RigidBody).linear_velocity = (1.0, 0.0)
                self.entity = 0

    world = sleepy_world()
    boxes = tower(world, 0.0)
    kick = Kick()
    world.add_system(kick)
    sleep(world, *boxes)
    kick.entity = boxes[2]
    world.step()
    assert not any(is_asleep(world, *boxes))
    assert world.component_for_entity(boxes[2], Transform).position[0] > 0.0


# -- the same as without -----------------------------------------------------------------------------------------------


def halves(sleeping: bool, d: int, mode: str) -> tuple[World, list[int], list[int]]:
    """A tower that comes to rest, and far from it balls that bounce and roll among boxes."""
    world = sleepy_world(d, sleeping=sleeping, collision=mode)
    still = tower(world, 0.0) + tower(world, 3.0, 2)
    lively = tower(world, 50.0)
    for k, e in itertools.product(range(4), (0.0, 0.9)):
        place = (47.0 + 2.0 * k, 2.0 + k + 3.0 * e, 0.1 * k)[:d]
        lively.append(ball(world, place, (1.0 - k, -2.0, 0.3)[:d], radius=0.3, restitution=e, friction=0.3))
    return world, still, lively


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("d", [2, 3])
def test_what_is_awake_has_the_same_bits_as_without_sleeping(d, mode):
    (on, still, lively), (off, _, _) = halves(True, d, mode), halves(False, d, mode)
    kicks, slept = np.random.default_rng(1), 0
    for step in range(110):
        for entity in lively if step % 12 == 0 else ():
            velocity = kicks.uniform(-3.0, 3.0, d)
            for world in (on, off):
                world.component_for_entity(entity, RigidBody).linear_velocity = velocity
        on.step()
        off.step()
        slept += all(is_asleep(on, *still))
        assert not any(is_asleep(on, *lively))
        assert rows_of(on, lively) == rows_of(off, lively), step
    assert slept > 60


def test_waking_goes_on_as_if_nothing_had_happened():
    """The impulses that carry a tower are there again: it does not sag."""
    world = sleepy_world()
    boxes = tower(world, 0.0, 6)
    sleep(world, *boxes)
    before = world.bodies.dynamic.position.copy()
    impulses = world.contacts.normal_impulse.copy()
    world.wake(boxes[0])
    world.step()
    assert not any(is_asleep(world, *boxes))
    np.testing.assert_allclose(world.contacts.normal_impulse, impulses, rtol=1e-2)
    np.testing.assert_allclose(world.bodies.dynamic.position, before, atol=1e-5)
    assert len(world.contacts.begin) == len(world.contacts.end) == 0


# -- contacts ----------------------------------------------------------------------------------------------------------


def test_contacts_of_sleepers_are_listed_in_order_and_make_no_events():
    world = sleepy_world()
    boxes = tower(world, 0.0)
    rolling = ball(world, (-10.0, 0.3), (1.0, 0.0), radius=0.3)
    late = tower(world, 10.0)
    told = []
    for name in ("contact_begin", "contact_end"):
        world.on(name, lambda contact, name=name: told.append((name, contact.entity_a, contact.entity_b)))
    world.step()
    told.clear()
    sleep(world, *boxes, *late)
    contacts = world.contacts
    assert not is_asleep(world, rolling)[0]
    assert len(contacts) == 7
    pairs = list(zip(contacts.entity_a.tolist(), contacts.entity_b.tolist(), strict=True))
    assert pairs == sorted(pairs)
    assert set(contacts.step.tolist()) == {world.step_count - 1}
    assert (contacts.normal_impulse > 0.0).all()
    assert len(contacts.stay) == 7
    assert told == []
    world.wake(boxes[0])
    world.step()
    assert told == []
    world.delete_entity(late[2])
    world.step()
    assert told == [("contact_end", late[1], late[2])]


def test_contact_stay_is_told_of_sleepers():
    world = sleepy_world()
    boxes = tower(world, 0.0, 2)
    stays = []
    world.on("contact_stay", lambda contact: stays.append((contact.entity_a, contact.entity_b)))
    sleep(world, *boxes)
    stays.clear()
    world.step()
    assert len(stays) == 2


def test_sensors_do_not_wake_and_tell_who_comes_and_goes():
    world = sleepy_world()
    boxes = tower(world, 0.0, 2)
    zone = world.create_entity(Transform((0.0, 1.0)), AABBCollider((2.0, 2.0), sensor=True))
    sleep(world, *boxes)
    assert len(world.contacts) == 4
    passing = ball(world, (-3.0, 1.0), (4.0, 0.0), radius=0.2, sensor=True)
    world.component_for_entity(passing, RigidBody).gravity_scale = 0.0
    begun = ended = 0
    for _ in range(90):
        world.step()
        begun += len(world.contacts.begin.of(boxes[0]))
        ended += len(world.contacts.end.of(boxes[0]))
    assert all(is_asleep(world, *boxes))
    assert (begun, ended) == (1, 1)
    world.delete_entity(zone)
    world.step()
    assert len(world.contacts.end) == 2
    assert all(is_asleep(world, *boxes))


def test_disabling_the_contact_of_sleepers_wakes_them():
    class Trapdoor(System):
        phase = Phase.NARROW
        open = False

        def process(self, dt):
            if self.open:
                self.world.contacts.enabled[:] = False

    world = sleepy_world()
    boxes = tower(world, 0.0, 1)
    trapdoor = Trapdoor()
    world.add_system(trapdoor)
    sleep(world, *boxes)
    trapdoor.open = True
    world.step()
    assert is_asleep(world, *boxes) == [False]
    for _ in range(30):
        world.step()
    assert world.component_for_entity(boxes[0], Transform).position[1] < 0.0
    assert is_asleep(world, *boxes) == [False]


def test_one_way_platforms_that_look_at_velocities_hold_sleepers():
    class OneWay(System):
        phase = Phase.NARROW

        def process(self, dt):
            contacts, bodies = self.world.contacts, self.world.bodies
            rows = [bodies.row_of(entity) for entity in contacts.entity_b.tolist()]
            contacts.enabled[:] = bodies.linear_velocity[rows, 1] < 0.0

    world = sleepy_world()
    tower(world, 0.0, 1)
    world.add_system(OneWay())
    heights = [world.step() or world.bodies.dynamic.position[0, 1] for _ in range(100)]
    assert min(heights) > 0.49


def test_what_is_held_apart_by_disabled_contacts_does_not_sleep():
    class Off(System):
        phase = Phase.NARROW

        def process(self, dt):
            self.world.contacts.enabled[:] = False

    world = make_world(2, 0.0, sleeping=True)
    pair = ball(world, 0.0), ball(world, 0.9)
    off = Off()
    world.add_system(off)
    for _ in range(60):
        world.step()
    assert not any(is_asleep(world, *pair))
    world.remove_system(off)
    world.step()
    assert len(world.contacts.begin) == 1


# -- snapshots, files, failures ----------------------------------------------------------------------------------------


def go_on(world: World, boxes: list[int], steps: int = 12) -> list[str]:
    """Hashes of steps in which a sleeper is pushed."""
    hashes = []
    for step in range(steps):
        if step == 3:
            world.component_for_entity(boxes[1], RigidBody).apply_impulse((0.4, 0.0))
        world.step()
        contacts = world.contacts
        hashes.append(f"{world.state_hash()} {contacts.normal_impulse.tobytes().hex()} {len(contacts.begin)}")
    return hashes


@pytest.mark.parametrize("when", ["due", "asleep", "woken"])
def test_snapshots_and_files_go_on_to_the_bit(when, tmp_path):
    world = World(
        Physics(2, gravity=(0.0, -GRAVITY)), convex_polygon.plugin, settings=Settings(sleeping=True)
    )
    floor(world, friction=0.5)
    boxes = tower(world, 0.0)
    corners = ((-0.5, -0.5), (0.5, -0.5), (0.0, 0.5))
    world.create_entity(Transform((5.0, 0.5)), RigidBody(), convex_polygon.ConvexPolygonCollider(corners))
    while not is_asleep(world, boxes[1])[0]:
        world.step()
    if when != "due":
        sleep(world, *boxes)
    if when == "woken":
        world.wake(boxes[0])
    snapshot = world.snapshot()
    world.save(tmp_path / "world.npz")
    expected = go_on(world, boxes)
    world.restore(snapshot)
    assert go_on(world, boxes) == expected
    world.restore(pickle.loads(pickle.dumps(snapshot)))
    assert go_on(world, boxes) == expected
    loaded = World.load(tmp_path / "world.npz", Physics(2), convex_polygon.plugin)
    assert loaded.settings.sleeping
    assert go_on(loaded, boxes) == expected


def test_a_world_that_does_not_sleep_goes_on_from_a_snapshot_of_one_that_does():
    world, other = sleepy_world(), sleepy_world(sleeping=False)
    boxes = tower(world, 0.0)
    sleep(world, *boxes)
    other.restore(world.snapshot())
    other.step()
    assert not any(is_asleep(other, *boxes))
    assert len(other.contacts) == 3
    assert len(other.contacts.begin) == len(other.contacts.end) == 0
    assert "_still" in other.physics.table.arrays
    world.restore(other.snapshot())
    assert not any(is_asleep(world, *boxes))
    sleep(world, *boxes)


def test_a_snapshot_from_before_wakes_what_sleeps():
    world = sleepy_world()
    boxes = tower(world, 0.0)
    for _ in range(5):
        world.step()
    snapshot = world.snapshot()
    first = [world.step() or world.state_hash() for _ in range(10)]
    sleep(world, *boxes)
    world.restore(snapshot)
    assert not any(is_asleep(world, *boxes))
    assert [world.step() or world.state_hash() for _ in range(10)] == first


@pytest.mark.parametrize("cause", [push, touched, bottom_deleted, static_placed], ids=lambda cause: cause.__name__)
def test_a_failed_step_is_undone(asleep, cause):
    class Failing(System):
        phase = Phase.RESPONSE

        def process(self, dt):
            raise ValueError("no")

    world, boxes, _, snapshot = asleep
    world.settings = world.settings.replace(dt=1 / 60)
    world.restore(snapshot)
    cause(world, boxes)
    kept = world.snapshot()
    world.step()
    expected = [world.state_hash(), *go_on(world, boxes[1:], 5)]
    world.restore(kept)
    failing = Failing()
    world.add_system(failing)
    for _ in range(2):
        with pytest.raises(Exception, match="no"):
            world.step()
    world.remove_system(failing)
    world.step()
    assert [world.state_hash(), *go_on(world, boxes[1:], 5)] == expected


def test_rows_that_move_take_their_sleep_along():
    world = sleepy_world()
    first = [ball(world, (-20.0 - 2.0 * k, 0.5)) for k in range(5)]
    boxes = tower(world, 0.0)
    sleep(world, *boxes, *first)
    before = world.bodies.dynamic.position[-3:].copy()
    for entity in first[::2]:
        world.delete_entity(entity)
    for k in range(80):  # the table grows
        ball(world, (30.0 + 2.0 * k, 5.0))
    for _ in range(5):
        world.step()
    assert all(is_asleep(world, *boxes, *first[1::2]))
    rows = [world.bodies.row_of(entity) for entity in boxes]
    assert (world.bodies.position[rows] == before).all()
    world.delete_entity(boxes[0])
    world.step()
    assert not any(is_asleep(world, *boxes[1:]))


def test_a_plan_between_falling_asleep_and_the_next_step_changes_nothing():
    world, other = sleepy_world(), sleepy_world()
    seen = []
    for each in (world, other):
        boxes = tower(each, 0.0)
        while not is_asleep(each, boxes[1])[0]:
            each.step()
        if each is world:
            assert "rest_sleepers" in str(each.plan())
        assert len(each.contacts.stay) == len(each.contacts) == 3
        for _ in range(3):
            each.step()
            seen.append((each.state_hash(), len(each.contacts), len(each.contacts.stay)))
    assert seen[:3] == seen[3:]


def test_several_steps_in_one_call_show_the_contacts_that_stay():
    class Look(System):
        phase = Phase.START

        def process(self, dt):
            stays.append(len(self.world.contacts.stay))

    stays = []
    world = sleepy_world()
    boxes = tower(world, 0.0)
    world.add_system(Look())
    for _ in range(12):
        world.advance(5 / 60)
    assert all(is_asleep(world, *boxes))
    assert stays[10:].count(0) == len(stays[10::5])  # in the first step of a call nothing has stayed yet
    assert set(stays[10:]) == {0, 3}


def test_a_replaced_integration_lets_nothing_sleep():
    world = sleepy_world()
    boxes = tower(world, 0.0)
    sleep(world, *boxes)
    world.remove_system(world.get_processor(Integration))
    world.step()
    world.step()
    assert not any(is_asleep(world, *boxes))


def test_without_its_collider_the_last_sleeper_falls():
    world = sleepy_world()
    boxes = tower(world, 0.0, 1)
    sleep(world, *boxes)
    world.remove_component(boxes[0], AABBCollider)
    for _ in range(30):
        world.step()
    assert world.component_for_entity(boxes[0], Transform).position[1] < 0.0


def test_turned_off_all_wake():
    world = sleepy_world()
    boxes = tower(world, 0.0)
    sleep(world, *boxes)
    world.settings = world.settings.replace(sleeping=False)
    world.step()
    assert not any(is_asleep(world, *boxes))
    assert len(world.contacts) == 3
    assert len(world.contacts.begin) == len(world.contacts.end) == 0
    world.component_for_entity(boxes[0], RigidBody).linear_velocity = (1.0, 0.0)
    world.step()
    assert world.component_for_entity(boxes[0], Transform).position[0] > 0.0


def test_a_body_with_a_value_that_cannot_be_wakes_the_others():
    world = sleepy_world(on_fault="ignore")
    boxes = tower(world, 0.0)
    sleep(world, *boxes)
    world.bodies.position[world.bodies.row_of(boxes[0])] = np.nan
    for _ in range(30):
        world.step()
    assert not any(is_asleep(world, *boxes))
    assert world.component_for_entity(boxes[1], Transform).position[1] < 1.2


def test_queries_find_sleepers():
    world = sleepy_world()
    boxes = tower(world, 0.0)
    sleep(world, *boxes)
    assert world.query_sphere((0.0, 1.5), 0.2) == [boxes[1]]
    world.step()
    assert all(is_asleep(world, *boxes))


def test_settings_and_wake_are_checked():
    with pytest.raises(ValueError, match="sleeping"):
        Settings(sleeping=1)
    world = sleepy_world()
    with pytest.raises(KeyError):
        world.wake(99)
