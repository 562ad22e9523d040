"""What worlds do with parts: changes as the game runs, sensors, queries, events, forces."""

from __future__ import annotations

import math

import esper
import numpy as np
import pytest
from parts.helpers_parts import G, U, at, body_of, floor, parts_world, piece
from worlds import MODES, run

from carom import ConvexPolygonCollider, Physics, RigidBody, SphereCollider, Transform, World
from carom.components.rigid_body import WEIGHTLESS
from carom.plugins import convex_polygon
from carom.plugins.joints import Joints, Weld
from carom.plugins.parts import PartOf, Parts
from carom.plugins.rotation import BoxCollider, Rotation, Spin

pytestmark = pytest.mark.plain


def test_parts_go_with_their_body_and_it_loses_what_they_weigh():
    world, parts = parts_world()
    body, left, right = piece(world, parts, (0, 0), U)
    lost = []

    def note(entity, part):
        lost.append((entity, part.mass))

    world.events.on("part_lost", note)
    world.step()
    assert parts.of(body) == [left, right]
    world.delete_entity(left)
    world.step()
    assert (body_of(world, body).mass, lost) == (2.0, [])
    world.component_for_entity(right, PartOf).mass = 1.5
    world.step()
    assert body_of(world, body).mass == 3.0
    body_of(world, body).mass = 9.0  # given: of the whole
    world.step()
    assert body_of(world, body).mass == 9.0
    world.delete_entity(body)
    world.step()
    assert lost == [(right, 1.5)]
    assert world.get_entities() == []


def test_a_body_has_its_own_mass_again_after_a_part_that_is_heavier_than_all_its_digits():
    world, parts = parts_world()
    body, left, right = piece(world, parts, (0, 0), U)
    for heavy in (1e30, 1.0):
        world.component_for_entity(left, PartOf).mass = heavy
        world.step()
        snapshot = world.snapshot()
    assert body_of(world, body).mass == 3.0
    world.component_for_entity(left, PartOf).mass = 1e30
    world.step()
    world.restore(snapshot)
    world.delete_entity(right)
    world.step()
    assert body_of(world, body).mass == 2.5


def test_what_a_part_has_from_its_partof_is_taken_back():
    world, parts = parts_world()
    body, left, _ = piece(world, parts, (0, 0), U)
    world.step()
    spin, offset = world.component_for_entity(body, Spin), world.component_for_entity(left, BoxCollider).offset.copy()
    inertia = spin.moments
    world.component_for_entity(left, BoxCollider).offset = (5, 5)
    body_of(world, left).mass = 7.0
    body_of(world, left).kind = "static"
    body_of(world, left).linear_velocity = (3, 0)
    at(world, left).position, at(world, left).rotation = (9, 9), 1.0
    body_of(world, body).linear_velocity = (1, 0)
    world.step()
    assert world.component_for_entity(left, BoxCollider).offset.tolist() == offset.tolist()
    assert (body_of(world, left).mass, body_of(world, left).kind) == (WEIGHTLESS, "dynamic")
    assert at(world, left).position.tolist() == at(world, body).position.tolist()
    assert (at(world, left).rotation, body_of(world, left).linear_velocity.tolist()) == (0.0, [1, 0])
    assert (spin.moments, body_of(world, body).mass) == (inertia, 3.0)
    world.component_for_entity(left, BoxCollider).offset[:] = 5.0  # in place
    world.refresh_queries()
    assert world.query_sphere((5, 5), 1.0) == []


def test_another_partof_takes_the_place_of_the_first():
    world, parts = parts_world()
    bodies = [world.create_entity(Transform((x, 0)), RigidBody(), SphereCollider(0.5)) for x in (0, 9)]
    part = world.create_entity(PartOf(bodies[0], (1, 0), mass=2.0), SphereCollider(0.5))
    world.step()
    for body, other in (bodies, bodies[::-1]):
        world.add_component(part, PartOf(body, (0, 2), mass=4.0))
        world.step()
        assert [world.component_for_entity(each, RigidBody).mass for each in (body, other)] == [5.0, 1.0]
        assert (parts.of(body), parts.of(other)) == ([part], [])
        assert world.query_point((9 * bodies.index(body), 2)) == [part]


def test_a_part_without_a_mass_of_its_own_weighs_nothing_while_it_is_a_sensor():
    world, _ = parts_world()
    body = world.create_entity(Transform((0, 0)), RigidBody(), SphereCollider(0.5))
    parts = [world.create_entity(PartOf(body, (x, 0)), SphereCollider(0.5, sensor=x > 0)) for x in (-1, 1)]
    for sensors, mass in (((False, True), 2.0), ((True, True), 1.0), ((True, False), 2.0), ((False, False), 3.0)):
        for part, sensor in zip(parts, sensors, strict=True):
            world.component_for_entity(part, SphereCollider).sensor = sensor
        world.step()
        assert world.component_for_entity(body, RigidBody).mass == mass


def test_parts_in_space_keep_their_turns_when_another_is_deleted():
    world, _ = parts_world(dimensions=3)
    body = world.create_entity(Transform((0, 0, 0)), RigidBody(), BoxCollider((0.2, 0.2, 0.2)))
    turns = ((1.0, 0.0, 0.0, 0.0), (0.6, 0.8, 0.0, 0.0), (0.6, 0.0, 0.8, 0.0))
    first, *others = [
        world.create_entity(PartOf(body, (x, 0.0, 0.0), turn), BoxCollider((0.1, 0.2, 0.3)))
        for x, turn in enumerate(turns)
    ]
    run(world, 2)
    world.delete_entity(first)
    run(world, 2)
    for part, turn in zip(others, turns[1:], strict=True):
        np.testing.assert_allclose(at(world, part).rotation, turn, atol=1e-15)


def test_what_breaks_off_flies_on_by_itself():
    world, parts = parts_world()
    boxes = tuple(((3 * x, 3 * y), half, mass) for (x, y), half, mass in U)  # so that they do not touch
    body, left, right = piece(world, parts, (0, 0), boxes, velocity=(1, 0), spin=2.0)
    run(world, 10)
    momentum, arm = world.momentum(), world.component_for_entity(right, BoxCollider).offset.copy()
    angle = at(world, right).rotation
    world.remove_component(right, PartOf)
    world.step()
    c, s = math.cos(angle), math.sin(angle)
    turned = np.array((c * arm[0] - s * arm[1], s * arm[0] + c * arm[1]))
    velocity = body_of(world, right).linear_velocity
    assert velocity == pytest.approx(np.array((1, 0)) + 2.0 * np.array((-turned[1], turned[0])))
    assert body_of(world, right).mass == 0.5
    assert world.component_for_entity(right, BoxCollider).offset == pytest.approx((0, 0))
    assert parts.of(body) == [left]
    assert momentum[0] == pytest.approx(3.0)


@pytest.mark.compiled
@pytest.mark.parametrize("mass", [None, 0.0, 4.0])
def test_what_breaks_off_takes_impulses_at_once(mass):
    """Mass and velocity are its own from the next step on; an impulse before that counts with them."""
    world, _ = parts_world()
    body = world.create_entity(Transform((0, 0)), RigidBody(linear_velocity=(1, 0)), SphereCollider(0.5))
    part = world.create_entity(PartOf(body, (3, 0), mass=mass), SphereCollider(0.5))
    world.step()
    world.remove_component(part, PartOf)
    body_of(world, part).apply_impulse((2, 4))
    world.step()
    own = mass or 1.0
    assert body_of(world, part).mass == own
    assert body_of(world, part).linear_velocity == pytest.approx((1 + 2 / own, 4 / own))


def test_what_was_to_be_a_part_weighs_something():
    world, _ = parts_world()
    body = world.create_entity(Transform((0, 0)), RigidBody(), SphereCollider(0.5))
    one, other = world.create_entities(2, PartOf.many(body=body, position=(3.0, 0.0)), SphereCollider.many(radius=0.3))
    world.remove_component(one, PartOf)
    world.step()
    assert [body_of(world, entity).mass for entity in (body, one, other)] == [2.0, 1.0, WEIGHTLESS]


def test_parts_of_parts_and_fields_that_change():
    world, parts = parts_world()
    body = world.create_entity(Transform((1, 2), rotation=math.pi / 2), RigidBody(), SphereCollider(0.5))
    arm = world.create_entity(PartOf(body, (1, 0), rotation=math.pi / 2), SphereCollider(0.1))
    hand = world.create_entity(PartOf(arm, (1, 0)), SphereCollider(0.1))
    assert set(world.query_sphere((0, 3), 0.05)) == {hand}  # 1 along the body's x, then 1 along its y
    assert parts.of(body) == [arm, hand]
    world.component_for_entity(hand, PartOf).position = (3, 0)
    world.step()
    assert set(world.query_sphere((-2, 3), 0.05)) == {hand}
    world.component_for_entity(hand, PartOf).body = body
    world.refresh_queries()
    assert set(world.query_sphere((1, 5), 0.05)) == {hand}
    at(world, body).position = (11, 2)
    world.refresh_queries()
    assert set(world.query_sphere((11, 5), 0.05)) == {hand}
    at(world, body).rotation = 0.0
    world.refresh_queries()
    assert set(world.query_sphere((14, 2), 0.05)) == {hand}
    world.component_for_entity(arm, PartOf).position[:] = (2, 0)  # in place
    world.refresh_queries()
    assert set(world.query_sphere((13, 2), 0.05)) == {arm}
    body_of(world, body).kind = "static"
    world.step()
    at(world, body).position = (1, 2)
    world.refresh_queries()
    assert set(world.query_sphere((3, 2), 0.05)) == {arm}
    assert body_of(world, arm).kind == "static"


@pytest.mark.compiled
def test_a_foot_and_a_cone_of_sight_report_as_themselves():
    world = World(Physics(dimensions=2, gravity=(0, -G)), Rotation(), Parts(), convex_polygon.plugin)
    ground = floor(world)
    hero = world.create_entity(Transform((0, 0.52)), RigidBody(2.0), Spin(inertia=1.0), BoxCollider((0.3, 0.5)))
    foot = world.create_entity(PartOf(hero, (0, -0.5)), BoxCollider((0.2, 0.1), sensor=True))
    cone = ConvexPolygonCollider(((0, 0), (6, -2), (6, 2)), sensor=True)
    sight = world.create_entity(PartOf(hero, (0.3, 0.3)), cone)
    thief = world.create_entity(Transform((4, 1.5)), RigidBody(gravity_scale=0), SphereCollider(0.3))
    ghost = world.create_entity(Transform((-4, 1.5)), RigidBody(gravity_scale=0), SphereCollider(0.3))
    run(world, 30)
    pairs = {(contact.entity_a, contact.entity_b) for contact in world.contacts}
    assert pairs == {(ground, hero), (ground, foot), (ground, sight), (sight, thief)}
    assert world.component_for_entity(sight, PartOf).body == hero
    assert body_of(world, hero).mass == 2.0  # sensors weigh nothing
    at(world, hero).rotation = math.pi
    world.step()
    pairs = {(contact.entity_a, contact.entity_b) for contact in world.contacts}
    assert (sight, ghost) in pairs
    assert (sight, thief) not in pairs


def test_plain_esper_calls_and_bulk_creation_make_parts():
    world, parts = parts_world((0, -G))
    body = world.create_entity(Transform((0, 5)), RigidBody(), SphereCollider(0.5))
    esper.switch_world(world.name)
    part = esper.create_entity(PartOf(body, (1, 0), mass=2.0), SphereCollider(0.5))
    many = world.create_entities(
        2, PartOf.many(body=body, position=np.array(((0, 1), (0, -1.0))), mass=0.5), SphereCollider.many(radius=0.2)
    )
    world.step()
    assert parts.of(body) == [part, *many]
    assert body_of(world, body).mass == 4.0
    assert esper.component_for_entity(part, Transform).position == pytest.approx(at(world, body).position)
    esper.delete_entity(part)
    world.step()
    assert body_of(world, body).mass == 2.0
    esper.clear_database()
    first = esper.create_entity(Transform((0, 0)), RigidBody(5.0), SphereCollider(0.5))
    assert first == body
    world.step()
    assert (body_of(world, first).mass, parts.of(first)) == (5.0, [])
    esper.create_entity(PartOf(first, (1, 0), mass=2.0), SphereCollider(0.5))
    world.step()
    assert body_of(world, first).mass == 7.0
    esper.switch_world("default")


@pytest.mark.compiled
def test_forces_and_joints_at_a_part_move_the_body():
    world, parts = parts_world()
    world.add_plugin(Joints())
    body, left, _ = piece(world, parts, (0, 0), U)
    body_of(world, left).apply_force((6.0, 0.0))
    world.step()
    assert body_of(world, body).linear_velocity == pytest.approx((6.0 / 3.0 / 60, 0))
    body_of(world, body).linear_velocity = (0, 0)
    other = world.create_entity(Transform((0, 3)), RigidBody(1.0), Spin(), BoxCollider((0.2, 0.2)))
    world.create_entity(Weld(left, other, anchor=(0, 2)))
    body_of(world, other).linear_velocity = (4, 0)
    run(world, 60)
    assert world.momentum() == pytest.approx((4, 0))
    assert world.component_for_entity(body, Spin).angular_velocity == pytest.approx(
        world.component_for_entity(other, Spin).angular_velocity, abs=1e-6
    )


@pytest.mark.parametrize("swept", ["body", "part", "none"])
def test_ccd_of_a_body_is_that_of_its_parts(swept):
    """A part that has it alone is swept too. What has none may pass, and that is told: a body too whose part has it."""
    world, _ = parts_world(on_fault="ignore")
    world.create_entity(Transform((0, 1)), BoxCollider((0.01, 0.5)))
    moves = RigidBody(linear_velocity=(250, 0), ccd=swept == "body")
    body = world.create_entity(Transform((-1.5, 0)), moves, SphereCollider(0.1))
    part = world.create_entity(PartOf(body, (0, 1)), SphereCollider(0.1))
    assert len(world.bodies) == 3
    body_of(world, part).ccd = swept == "part"
    world.step()
    assert (at(world, body).x < 0.0) == (swept != "none")
    assert any("so fast" in str(fault) for fault in world.faults) == (swept != "body")


def test_a_joint_at_a_part_keeps_the_whole_body_from_touching():
    """And the body that the part belongs to later; what it has left touches then."""
    world, _ = parts_world()
    world.add_plugin(Joints())
    ball = world.create_entity(Transform((0, 0)), RigidBody(), SphereCollider(0.4))
    body, later = (world.create_entity(Transform((x, 0)), RigidBody(), SphereCollider(0.4)) for x in (0.5, -0.5))
    part = world.create_entity(PartOf(body, (0, 0.5)), SphereCollider(0.4))
    joint = world.create_entity(Weld(part, ball, anchor=(0, 0)))

    def touching():
        world.step()
        pairs = {*zip(world.contacts.entity_a.tolist(), world.contacts.entity_b.tolist(), strict=True)}
        return {a + b - ball for a, b in pairs if ball in (a, b)}

    assert touching() == {later}
    world.component_for_entity(part, PartOf).body = later
    assert touching() == {body}
    world.delete_entity(joint, immediate=True)
    assert touching() >= {body, later}


@pytest.mark.compiled
@pytest.mark.parametrize("mode", MODES)
def test_a_table_that_is_pressed_into_the_floor_is_put_back_once_not_by_each_foot(mode):
    world, _ = parts_world((0, -G), collision=mode)
    floor(world)
    table = world.create_entity(Transform((0, 0.3)), RigidBody(0.1))
    for x in (-0.5, 0.0, 0.5):
        world.create_entity(PartOf(table, (x, 0), mass=0.1), BoxCollider((0.1, 0.3)))
    press = RigidBody(kind="kinematic", linear_velocity=(0, -0.5))
    world.create_entity(Transform((0, 0.7)), press, BoxCollider((1.0, 0.05)))
    heights = []
    for _ in range(20):
        world.step()
        heights.append(at(world, table).y - 0.3)
    assert max(heights) < 1e-9
    assert -0.0101 < min(heights) < -0.005  # .05 of the smallest extent


@pytest.mark.compiled
@pytest.mark.parametrize("mode", MODES)
def test_pieces_of_one_group_fall_through_each_other_and_onto_all_else(mode):
    world, parts = parts_world((0, -G), collision=mode, sleeping=True)
    ground, met = floor(world, friction=0.5), set()
    pieces = [piece(world, parts, (0.05 * k, 0.5 + 0.8 * k), U, group=1 + k // 2, friction=0.5) for k in range(4)]
    group = {entity: 1 + k // 2 for k, own in enumerate(pieces) for entity in own}
    world.on("contact_begin", lambda contact: met.add((contact.entity_a, contact.entity_b)))
    world.on("impact", lambda contact: met.add((contact.entity_a, contact.entity_b)))
    run(world, 180)
    groups = {(group.get(a, 0), group.get(b, 0)) for a, b in met if ground not in (a, b)}
    assert groups
    assert groups <= {(1, 2), (2, 1)}
    assert all(any((ground, entity) in met for entity in own) for own in pieces[:2])
    heights = [at(world, own[0]).y for own in pieces]
    assert min(heights) > 0.2
    assert max(heights) < 1.3  # stacked one on the other they are 2.4 m high




@pytest.mark.parametrize("d", [2, 3])
def test_what_breaks_off_a_spinning_body_takes_its_momentum_along(d):
    """A dumbbell that spins freely loses one ball: each goes on with the velocity that its middle had, w x r, and the
    momentum of both is that of before, to rounding."""
    random = np.random.default_rng(d)
    for _ in range(5):
        world, parts = parts_world(dimensions=d)
        spin = random.normal(0, 4) if d == 2 else random.normal(0, 4) * np.array((0.0, 0.0, 1.0))
        velocity, masses = random.normal(0, 3, d), random.uniform(0.5, 4.0, 2)
        body = world.create_entity(
            Transform(random.normal(0, 1, d)), RigidBody(masses[0], velocity), Spin(spin), SphereCollider(0.3)
        )
        ball = world.create_entity(PartOf(body, np.eye(d)[0] * 2.0, mass=masses[1]), SphereCollider(0.3))
        parts.balance(body)
        for _ in range(7):
            world.step()
        turning, place = world.component_for_entity(body, Spin), world.component_for_entity(body, Transform)
        angle = place.rotation if d == 2 else 2.0 * math.atan2(place.rotation[3], place.rotation[0])
        way = 2.0 * masses[1] / masses.sum()  # from the ball that stays to the centre of both
        middle = place.position - way * np.array((math.cos(angle), math.sin(angle), 0.0)[:d])
        wanted = turning.velocity_at(middle).copy()
        world.remove_component(ball, PartOf)
        parts.balance(body, moving=True)
        world.step()
        moving = [body_of(world, each) for each in (body, ball)]
        np.testing.assert_allclose(moving[0].linear_velocity, wanted, rtol=0, atol=1e-12)
        momentum = sum(each.mass * each.linear_velocity for each in moving)
        np.testing.assert_allclose(momentum, masses.sum() * velocity, rtol=0, atol=1e-12)
