"""What somebody is told who makes a mistake: at the call that makes it, with the name or the unit that was meant."""

from __future__ import annotations

import math
import threading
import warnings

import numpy as np
import pytest
from worlds import ball, make_world

from carom import (
    BoxCollider,
    Cone,
    ConvexHullCollider,
    Hinge,
    Joints,
    Motor,
    PartOf,
    Parts,
    Phase,
    Physics,
    PhysicsWarning,
    RigidBody,
    Rotation,
    Settings,
    SphereCollider,
    Spin,
    System,
    Transform,
    World,
    create_chain,
    create_height_field,
    create_triangle_mesh,
)  # fmt: skip
from carom.components import AABBCollider
from carom.framework import CaromError, ForceSystem, NoPhysicsError, StepError, UnhandledPairError, units
from carom.plugins import terrain
from carom.plugins.capsule import CapsuleCollider
from carom.plugins.springs import Springs

SMALL = 1e-160 * np.array(((0.5, 0.0, -0.3), (-0.5, 0.1, -0.4), (0.0, 0.6, -0.3), (0.1, -0.5, -0.2), (0.1, 0.0, 0.5)))
HIGH = np.array(((0.0, 1.0), (2.0, 1e200)))
REFUSED = [  # dimensions, what is done with a world, a body of it and its Spin, what the error says
    (2, lambda w, e, s: Hinge(None, RigidBody(), anchor=(0, 0)),
     r"Hinge.b must be an integer: give its entity, .* got a RigidBody"),
    (2, lambda w, e, s: PartOf(Transform((0, 0)), (1, 0)),
     r"PartOf.body must be an integer: give its entity, .* got a Transform"),
    (2, lambda w, e, s: body_of(w, e).apply_torque(3.0),
     r"RigidBody has no attribute 'apply_torque': .*from carom import Spin"),
    (2, lambda w, e, s: body_of(w, e).angular_velocity,
     r"RigidBody has no attribute 'angular_velocity': .*from carom import Spin"),
    (2, lambda w, e, s: setattr(body_of(w, e), "torque", 1.0),
     r"RigidBody has no attribute 'torque': .*from carom import Spin"),
    (2, lambda w, e, s: RigidBody(inertia=2.0), r"RigidBody has no field 'inertia': .*from carom import Spin"),
    (2, lambda w, e, s: body_of(w, e).apply_force((1, 0), at=(0, 1)),
     r"apply_force acts at the centre.*Spin\)\.apply_force\(\.\.\., at="),
    (2, lambda w, e, s: body_of(w, e).apply_impulse((1, 0), at=(0, 1)),
     r"apply_impulse acts at the centre.*\(\.\.\., at="),
    (2, lambda w, e, s: BoxCollider(size=(1, 1)), r"no field 'size' \(did you mean 'half_extents'\?\)"),
    (2, lambda w, e, s: SphereCollider(diameter=2), r"no field 'diameter' \(did you mean 'radius'\?\)"),
    (3, lambda w, e, s: Spin(inertia=(1, 1, 5)),
     r"Spin.inertia must be of a body, no moment exceeds .*, got \[1.0, 1.0, 5.0\]"),
    (3, lambda w, e, s: setattr(s, "inertia", (3, 1, 1)),
     r"entity 1: Spin.inertia must be of a body.*got \[3.0, 1.0, 1.0\]"),
    (3, lambda w, e, s: w.create_entities(2, Spin.many(inertia=[(1, 1, 2), (1, 9, 1)])),
     r"Spin.inertia must be .* \(row 1\), got \[1.0, 9.0"),
    (2, lambda w, e, s: s.apply_torque(1e200), r"entity 1: Spin.apply_torque must be at most 1e\+150 .*got 1e\+200"),
    (2, lambda w, e, s: s.apply_force((1e200, 0), at=(0, 3)),
     r"entity 1: Spin.apply_force: its torque must be at most 1e\+150"),
    (3, lambda w, e, s: setattr(s, "constant_torque", (0, 0, 1e200)),
     r"entity 1: Spin.constant_torque must be at most 1e\+150"),
    (3, lambda w, e, s: ConvexHullCollider(SMALL), r"ConvexHullCollider.hull must be at least 1e-150 m across"),
    (3, lambda w, e, s: create_height_field(w, HIGH, 1.0),
     r"heights must be at most 1e\+150 m, heights\[1, 1\] is 1e\+200"),
    (3, lambda w, e, s: create_triangle_mesh(w, [(0, 0, 0), (0, 0, 1), (1e200, 0, 0)], [(0, 1, 2)]),
     r"vertices must be at most 1e\+150 m, row 2"),
    (2, lambda w, e, s: create_chain(w, [(0, 0), (1, 1e200)]),
     r"points must be at most 1e\+150 m, row 1 is \(1.0, 1e\+200\)"),
    (2, lambda w, e, s: w.step(1 / 60), r"step takes no time, got 0.016.*Settings\(dt=1 / 60\).*world.advance"),
    (2, lambda w, e, s: SphereCollider(0.5, mask=[1, 2]),
     r"SphereCollider.mask must be one scalar: bits of layers, as in 1 << 1 \| 1 << 2, got \[1, 2\]"),
]  # fmt: skip
UNITS = [  # what is made, and the cure
    (lambda: Settings(dt=60), r"Settings.dt = 60 is in seconds: 60 steps a second are 1 / 60, 60 ms are 0.06"),
    (lambda: Settings(dt=1000 / 60), r"Settings.dt = 16.6667 is in seconds: .*, 16.6667 ms are 0.0166667"),
    (lambda: Transform((0, 0), rotation=45), r"Transform.rotation = 45 is in radians, 7.2 turns: .*math.radians\(45\)"),
    (lambda: Transform.many(np.zeros((2, 2)), 90.0).arrays(2, 2), r"Transform.rotation = 90 is in radians"),
    (lambda: PartOf(1, (0, 0), rotation=-90.0), r"PartOf.rotation = -90 is in radians"),
    (lambda: Hinge(None, 1, anchor=(0, 0), limits=(-0.5, 45)), r"Hinge.limits = 45 is in radians"),
    (lambda: Cone(None, 1, anchor=(0, 0, 0), axis=(1, 0, 0), twist=(-30, 30)), r"Cone.twist = -30 is in radians"),
    (lambda: Motor(1, angle=180), r"Motor.angle = 180 is in radians"),
]


def world_of(d, **settings):
    plugins = Physics(d, gravity=(0, -10, 0)[:d]), Rotation(), Joints(), Parts(), terrain.plugin
    return World(*plugins, settings=Settings(**settings))


def body_of(world, entity):
    return world.component_for_entity(entity, RigidBody)


@pytest.mark.parametrize("case", range(len(REFUSED)))
def test_what_cannot_be_is_refused_where_it_is_given_with_the_cure(case):
    d, act, message = REFUSED[case]
    with world_of(d) as world:
        box = BoxCollider((0.5,) * d)
        entity = world.create_entity(Transform((0, 2, 0)[:d]), RigidBody(), Spin(), box)
        assert len(world.bodies) == 1
        before = world.state_hash()
        with pytest.raises((ValueError, TypeError, AttributeError), match=message):
            act(world, entity, world.component_for_entity(entity, Spin))
        assert world.state_hash() == before


@pytest.mark.parametrize("case", range(len(UNITS)))
def test_numbers_of_another_unit_are_told_once(case, monkeypatch):
    monkeypatch.setattr(units, "_told", set())
    make, message = UNITS[case]
    with pytest.warns(PhysicsWarning, match=message) as told:  # noqa: PT031
        make()
        make()
    assert len(told) == 1
    assert told[0].filename == __file__


def test_usual_angles_and_steps_are_not_told(monkeypatch):
    monkeypatch.setattr(units, "_told", set())
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for angle in (0, 1, -29, 12.5, math.radians(90), 100.0 * math.pi, 45.5):
            Transform((0, 0), rotation=angle)
            Hinge(None, 1, anchor=(0, 0), limits=(-abs(angle), None))
        for dt in (1 / 60, 1, 10, 24.5, 3600, 86400.0):
            Settings(dt=dt)


def test_bodies_that_never_turn_are_told_once_in_a_world():
    """A Spin on a static body, and a box that somebody may expect to tip; a part, or a Spin, is what it should be."""
    with world_of(2, on_fault="ignore") as world:
        good = world.create_entity(Transform((0, 0)), RigidBody(), Spin(), BoxCollider((1, 1)))
        world.create_entity(PartOf(good, (2, 0)), BoxCollider((0.5, 0.5)))
        world.create_entity(Transform((0, -5)), BoxCollider((9, 1)))
        world.create_entity(Transform((0, -9)), RigidBody(kind="static"), Spin(), BoxCollider((9, 1)))
        world.step()
        assert world.faults == []
        plain = [world.create_entity(Transform((9 + 3 * k, 0)), RigidBody(), BoxCollider((1, 1))) for k in range(2)]
        still = world.create_entity(Transform((0, 9)), RigidBody(kind="static"), Spin(3.0), BoxCollider((1, 1)))
        world.step()
        world.create_entity(Transform((30, 0)), RigidBody(), BoxCollider((1, 1)))
        for _ in range(3):
            world.step()
        boxes, spin = sorted(world.faults, key=lambda text: "static" in text)
        assert boxes.startswith(f"entity {plain[0]}: a dynamic body with a BoxCollider and no Spin never turns: give")
        assert spin.startswith(f"entity {still}: a static body does not turn by its Spin: RigidBody(kind=")


@pytest.mark.parametrize("at_once", [False, True])
def test_contacts_of_leave_out_what_has_been_deleted_as_pairs_do(at_once):
    """A platform that crumbles: at once, and seen by a system before the next step has found the contacts anew."""
    seen = []

    class Looks(System):
        phase = Phase.START

        def process(self, dt):
            seen.append([contact.entity_b for contact in self.world.contacts.of(player)])

    with world_of(2) as world:
        world.add_system(Looks())
        left, right = (world.create_entity(Transform((x, 0)), BoxCollider((0.5, 0.5))) for x in (-0.5, 0.5))
        player = world.create_entity(Transform((0, 1)), RigidBody(), SphereCollider(0.5), Spin())
        for _ in range(30):
            world.step()
        assert {contact.entity_b for contact in world.contacts.of(player)} == {left, right}
        world.delete_entity(left, immediate=at_once)
        assert [contact.entity_b for contact in world.contacts.of(player)] == [right]
        world.step()
        assert seen[-1] == [right]
        world.delete_entity(player)
        assert world.contacts.of(player) == []


def told_of(world, entity, text, each=lambda k: None):
    """How many faults there are after 30 steps, and whether all tell that of the entity."""
    for k in range(30):
        each(k)
        world.step()
    assert all(fault.startswith(f"entity {entity}: {text}") for fault in world.faults)
    return len(world.faults)


def test_what_a_game_turns_by_hand_is_told_once_where_something_touches_it():
    """A flipper; one that is placed anew now and then, or touches nothing, is not told, nor one that has a Spin."""
    for told, every, height, spin in ((1, 1, 0.7, ()), (0, 5, 0.7, ()), (0, 1, 9.0, ()), (0, 1, 0.7, (Spin(),))):
        with world_of(2, on_fault="ignore") as world:
            placed = Transform((0, 0))
            flipper = world.create_entity(placed, RigidBody(kind="kinematic"), BoxCollider((2, 0.2)), *spin)
            world.create_entity(Transform((0.5, height)), RigidBody(), SphereCollider(0.5), Spin())

            def turn(k, placed=placed, every=every):
                placed.rotation = 0.01 * (k // every)

            assert told_of(world, flipper, "a kinematic body whose Transform.rotation is set", turn) == told


def test_chains_that_are_solid_above_are_told_in_the_first_step():
    """A ceiling beside a floor is not."""
    ground = np.array(((-5.0, 0.0), (0.0, -0.5), (5.0, 0.3)))
    for told, chains in ((1, [ground[::-1]]), (0, [ground]), (0, [ground[::-1] + np.array((0, 5)), ground])):
        with world_of(2, on_fault="ignore") as world:
            first, *_ = [create_chain(world, points)[0] for points in chains]
            assert told_of(world, first, "all chains are solid above") == told


def test_a_chain_that_is_gone_before_a_step_is_not_looked_at():
    with world_of(2, on_fault="ignore") as world:
        snapshot = world.snapshot()
        create_chain(world, [(1, 0), (-1, 0)])
        world.restore(snapshot)
        world.step()
        assert world.faults == []


def test_the_place_of_a_part_that_is_ignored_is_told():
    """Not where it is that of the body, or where the part belongs."""
    for told, place in ((0, (0, 0)), (0, (3, 2)), (0, (4, 2)), (1, (7, 7))):
        with world_of(2, on_fault="ignore") as world:
            body = world.create_entity(Transform((3, 2)), RigidBody(), Spin(), BoxCollider((0.5, 0.5)))
            part = world.create_entity(Transform(place), PartOf(body, (1, 0)), BoxCollider((0.5, 0.5)))
            assert told_of(world, part, "a part is where PartOf.position puts it") == told


@pytest.mark.parametrize("requires", [(), (SphereCollider,)], ids=["all bodies", "some bodies"])
@pytest.mark.parametrize("shape", [(3,), (7, 2)])
def test_forces_of_a_wrong_shape_name_the_system_and_both_shapes(requires, shape):
    class Wind(ForceSystem):
        def add_forces(self, bodies, time):
            bodies.force = np.ones(shape)

    Wind.requires = requires
    world = make_world(2)
    ball(world, (0, 0))
    world.create_entity(Transform((9, 9)), RigidBody())
    world.add_system(Wind())
    with pytest.raises(StepError) as caught:
        world.step()
    bodies = 1 if requires else 2
    assert f"in force system Wind: ValueError: bodies.force has shape ({bodies}, 2), got shape {shape}" in str(
        caught.value
    )


def test_worlds_are_stepped_in_one_thread_at_a_time():
    """Another thread gets an error and changes nothing; afterwards it may step."""
    inside, leave = threading.Event(), threading.Event()

    class Waits(System):
        def process(self, dt):
            inside.set()
            assert leave.wait(10)

    first, second = make_world(2), make_world(2)
    first.add_system(Waits())
    thread = threading.Thread(target=first.step)
    thread.start()
    assert inside.wait(10)
    try:
        for step in (second.step, lambda: second.advance(1.0)):
            with pytest.raises(CaromError, match="another thread"):
                step()
    finally:
        leave.set()
        thread.join()
    assert (first.step_count, second.step_count) == (1, 0)
    second.step()
    assert second.step_count == 1


def test_a_body_in_no_layer_is_refused():
    world = make_world(2)
    collider = world.component_for_entity(ball(world, (0, 0)), SphereCollider)
    for make in (
        lambda: SphereCollider(1.0, layer=0), lambda: setattr(collider, "layer", 0),
        lambda: world.create_entities(
            2, Transform.many(np.zeros((2, 2))), AABBCollider.many((1.0, 1.0), layer=np.array([2, 0]))
        ),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=r"layer must not be 0.*mask=0"):
            make()
    collider.layer, collider.mask = -(2**63), 0
    assert len(world.bodies) == 1


def test_frames_in_milliseconds_are_told_once():
    world = make_world(2)
    world.advance(3.0)  # somebody has dragged the window
    world.advance(0.016)
    world.advance(16)
    with pytest.warns(PhysicsWarning, match=r"advance takes seconds.*milliseconds / 1000"):
        world.advance(17)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        world.advance(16)
    assert len(world.faults) == 1


def test_a_shape_of_carom_without_its_plugin_names_it():
    world = make_world(2)
    world.create_entity(Transform((0, 0)), RigidBody(), CapsuleCollider(0.2, 0.2))
    with pytest.raises(UnhandledPairError, match=r"capsule\.plugin"):
        world.step()


def test_springs_before_physics_say_in_which_order():
    with pytest.raises(NoPhysicsError, match=r"before it: World\(Physics"):
        World(Springs(), Physics())


def test_arrays_keep_their_last_values_when_the_world_closes():
    world = make_world(2)
    for x in range(100):
        ball(world, (2.0 * x, 0), (1.0, 2.0))
    position, velocity = world.bodies.position, world.bodies.dynamic.linear_velocity
    before = position.copy()
    world.close()
    np.testing.assert_array_equal(position, before)
    assert (velocity == (1.0, 2.0)).all()
