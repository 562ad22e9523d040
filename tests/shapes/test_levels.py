"""Geometry levels: cheap colliders first, a pair hits if every level hits; which must enclose which."""

from __future__ import annotations

import math
import runpy
from pathlib import Path

import numpy as np
import pytest
from helpers_filters import pairs
from oracles import narrow_naive
from worlds import EPS, ball, both_dimensions, box, floor, make_world, position, run, velocity

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.components.colliders import Collider
from carom.framework import Phase, Plugin, Settings, System, UnhandledPairError, World, column
from carom.framework.vectors import scale
from carom.plugins import Physics

COUNTERS = ("first_level_tests", "first_level_hits", "false_positives")


def levelled(world, place, velocity=0.0, *, half=0.5, radius=None, rotation=0.0, sphere=None, kind="dynamic", **last):
    """A box with a sphere around it; the sphere touches the corners unless a radius is given."""
    half = np.broadcast_to(half, world.dimensions)
    radius = float(np.linalg.norm(half)) if radius is None else radius
    place = place if np.ndim(place) else (place, *(0.0,) * (world.dimensions - 1))
    speed = velocity if np.ndim(velocity) else (velocity, *(0.0,) * (world.dimensions - 1))
    return world.create_entity(
        Transform(place, rotation), RigidBody(linear_velocity=speed, kind=kind),
        SphereCollider(radius, **(sphere or {})), AABBCollider(half, **last),
    )  # fmt: skip


ROOT = Path(__file__).resolve().parents[2]


def depth_of(shape_a, shape_b):
    """Depth of two shapes (kind, centre, size), by the oracle."""
    if (shape_a[0], shape_b[0]) == ("box", "sphere"):
        shape_a, shape_b = shape_b, shape_a
    return getattr(narrow_naive, f"{shape_a[0]}_{shape_b[0]}")(*shape_a[1:], *shape_b[1:])[0]


def crowd(d, turned, seed):
    """150 bodies: spheres, boxes, and boxes in larger spheres; and their shapes in the world."""
    rng = np.random.default_rng(seed)
    world, shapes = make_world(d), {}
    for k in range(150):
        rotation = 0.0 if not turned or k % 4 == 3 else (rng.uniform(-3, 3) if d == 2 else rng.normal(size=4))
        place, offset, half = rng.uniform(-3.5, 3.5, d), rng.uniform(-0.3, 0.3, d), rng.uniform(0.05, 0.5, d)
        gap = rng.uniform(-0.1, 0.1, d)
        radius = np.linalg.norm(np.abs(gap) + half) * rng.uniform(1.0, 1.2)
        colliders, levels = [], []
        turn = narrow_naive.rotation_matrix(rotation, d)
        if k % 3 != 1:
            colliders.append(SphereCollider(radius, offset=offset + gap))
            levels.append(("sphere", place + turn @ (offset + gap), radius))
        if k % 3 != 2:
            colliders.append(AABBCollider(half, offset=offset))
            levels.append(("box", place + turn @ offset, narrow_naive.stretched(half, rotation)))
        body = () if k % 5 == 0 else (RigidBody(),)
        entity = world.create_entity(Transform(place, rotation), *body, *colliders)
        shapes[entity] = levels, not body
    return world, shapes


@pytest.mark.slow
@both_dimensions
@pytest.mark.parametrize("turned", [False, True])
def test_a_pair_hits_if_every_level_hits(d, turned):
    """By definition: level k against level k, a body with fewer uses its last; some boxes stick out."""
    world, shapes = crowd(d, turned, 5 + d)
    world.run(Phase.NARROW)
    expected, first_hits, wrong, stuck_out = {}, 0, 0, 0
    entities = sorted(shapes)
    for i, a in enumerate(entities):
        for b in entities[i + 1 :]:
            (levels_a, fixed_a), (levels_b, fixed_b) = shapes[a], shapes[b]
            if fixed_a and fixed_b:
                continue
            count = max(len(levels_a), len(levels_b))
            depths = [
                depth_of(levels_a[min(k, len(levels_a) - 1)], levels_b[min(k, len(levels_b) - 1)])
                for k in range(count)
            ]
            hit = min(depths) >= 0
            if hit:
                expected[a, b] = depths[-1]
            stuck_out += depths[0] < 0 <= depths[-1]
            if count > 1:
                first_hits += depths[0] >= 0
                wrong += depths[0] >= 0 and not hit
    assert pairs(world.contacts) == list(expected)
    np.testing.assert_allclose(world.contacts.depth, list(expected.values()), atol=100 * EPS)
    counters = world.stats().counters
    assert (counters["first_level_hits"], counters["false_positives"]) == (first_hits, wrong)
    assert first_hits <= counters["first_level_tests"] <= counters["candidates"]
    assert len(expected) > 50
    assert wrong > 30
    assert (stuck_out > 0) == turned


class Found(System):
    """Records the contacts found by NARROW in each step."""

    phase = Phase.NARROW

    def __init__(self):
        self.steps = []

    def process(self, dt):
        contacts = self.world.contacts
        names = ("entity_a", "entity_b", "depth", "normal", "point")
        self.steps.append({name: getattr(contacts, name).copy() for name in names})


@pytest.mark.slow
@both_dimensions
def test_levels_change_the_cost_and_not_what_is_found(d):
    """From the same state every step finds the same bits with spheres around the boxes."""

    def heap(with_spheres):
        rng = np.random.default_rng(3)
        world = make_world(d, gravity=9.81)
        floor(world)
        for k in range(24):
            place = rng.uniform(-0.8, 0.8, d)
            place[1] = 0.5 + 0.9 * k
            half = rng.uniform(0.25, 0.5, d)
            colliders = [SphereCollider(np.linalg.norm(half))] if with_spheres else []
            collider = AABBCollider(half, restitution=0.4 * (k % 2))
            world.create_entity(Transform(place), RigidBody(1.0 + k % 3), *colliders, collider)
        found = Found()
        world.add_system(found)
        return world, found.steps

    (plain, expected), (several, found) = heap(False), heap(True)
    near = 0
    for _ in range(120):
        several.bodies.position[:] = plain.bodies.position
        several.bodies.linear_velocity[:] = plain.bodies.linear_velocity
        plain.step()
        several.step()
        for name, column_of in expected[-1].items():
            np.testing.assert_array_equal(found[-1][name], column_of)
        near += int((expected[-1]["depth"] < 0).sum())
    assert near > 20
    assert several.stats().counters["false_positives"] > 100
    assert [plain.stats().counters[name] for name in COUNTERS] == [0, 0, 0]


@pytest.mark.parametrize("where", ["far", "near"])
@pytest.mark.parametrize("mode", ["discrete", "continuous", "event_driven"])
@both_dimensions
def test_levels_change_nothing_of_what_rests(d, mode, where):
    """Boxes slide off the end of a floor: they fall from the same step on where a body 1 km away has two levels, or
    each of them has."""
    pad, places = (0.0,) * (d - 2), []
    for levels in (None, where):
        world, rng = make_world(d, 9.81, collision=mode), np.random.default_rng(7)
        world.create_entity(Transform((0.0, -1.0, *pad)), AABBCollider((6.0, 1.0, *(6.0,) * (d - 2)), friction=0.3))
        far = (SphereCollider(2.0),) if levels == "far" else ()
        body = RigidBody(gravity_scale=0)
        world.create_entity(Transform((1000.0, 0.0, *pad)), body, *far, AABBCollider((1.0,) * d))
        ids = []
        for k in range(12):
            half = rng.uniform(0.1, 0.4, d)
            place, speed = (0.9 * k - 5.0, rng.uniform(0.5, 1.5), *pad), (rng.uniform(1.0, 5.0), 0.0, *pad)
            near = (SphereCollider(1.01 * float(np.linalg.norm(half))),) if levels == "near" else ()
            box = AABBCollider(half, friction=0.3)
            ids.append(world.create_entity(Transform(place), RigidBody(linear_velocity=speed), *near, box))
        run(world, 120)
        places.append(np.array([position(world, i) for i in ids]))
        world.close()
    assert places[0][:, 1].min() < -1.0
    np.testing.assert_array_equal(places[0], places[1])


@both_dimensions
def test_the_last_level_gives_contact_and_material(d):
    """Restitution, normal and time of impact are the box's: the sphere around it only rejects pairs."""
    world = make_world(d)
    a = levelled(world, -1.0, 1.0, sphere={"restitution": 0.2, "friction": 3.0}, restitution=1.0)
    b = levelled(world, 1.0, -1.0)
    run(world, 20)
    assert not len(world.contacts)
    assert velocity(world, a)[0] == 1.0
    run(world, 20)  # they meet after 0.5 s with the speeds exchanged
    assert velocity(world, a)[0] == -1.0
    assert position(world, a)[0] == pytest.approx(-0.5 - (40 / 60 - 0.5), abs=1e-12)
    assert velocity(world, b)[0] == 1.0


@both_dimensions
def test_a_level_off_the_centre_turns_with_the_body(d):
    """The box at (1, 0) is at (0, 1) after a quarter turn, and its sphere with it."""
    world = make_world(d)
    rotation = math.pi / 2 if d == 2 else (math.sqrt(0.5), 0, 0, math.sqrt(0.5))
    turned = world.create_entity(
        Transform((0.0,) * d, rotation), RigidBody(),
        SphereCollider(1.0, offset=np.eye(d)[0]), AABBCollider((0.4,) * d, offset=np.eye(d)[0]),
    )  # fmt: skip
    near, far = ball(world, np.eye(d)[1], radius=0.1), ball(world, np.eye(d)[0], radius=0.1)
    world.step()
    assert pairs(world.contacts) == [(turned, near)]
    assert far not in world.contacts.entity_b


@pytest.mark.parametrize("restitution", [0.0, 1.0])
def test_a_level_that_is_outgrown_keeps_them_apart(restitution):
    """The circle of an enlarged square leaves its corners out: a ball on a line through one flies on."""
    for spheres in ([SphereCollider(math.sqrt(0.5))], []):
        world = make_world()
        world.create_entity(Transform((0, 0), math.pi / 4), *spheres, AABBCollider((0.5, 0.5), restitution=restitution))
        nearest = 0.8 * math.sqrt(0.5)
        flying = ball(world, (nearest - 1.0, nearest + 1.0), (1.0, -1.0), radius=0.01)
        run(world, 120)
        assert (velocity(world, flying).tolist() == [1.0, -1.0]) == bool(spheres)


def test_bounds_stops_at_the_first_level():
    """Corner to corner two squares hit by their circles; the contact is theirs, no further test is done. At any level
    layer and mask are those of the last one."""
    for geometry in ("precise", "bounds"):
        world = make_world(geometry=geometry)
        levelled(world, 0.0, layer=2, mask=2, sensor=True, sphere={"sensor": True, "layer": 8, "mask": 8})
        near = levelled(world, (1.2, 0.5), layer=2, mask=2, sensor=True, sphere={"sensor": True, "mask": 1})
        levelled(world, (0.5, 0.5), layer=4, mask=4, sphere={"layer": 2, "mask": 2})
        if geometry == "precise":
            world.component_for_entity(near, Transform).position = (0.7, 0.5)
        world.step()
        assert pairs(world.contacts) == [(1, near)]
    assert world.contacts.depth[0] == pytest.approx(2 * math.sqrt(0.5) - 1.3, abs=4 * EPS)
    np.testing.assert_allclose(world.contacts.normal, [(12 / 13, 5 / 13)], atol=4 * EPS)
    assert velocity(world, 1).tolist() == [0, 0]
    assert [world.stats().counters[name] for name in COUNTERS] == [0, 0, 0]
    (line,) = [line for line in str(world.plan()).splitlines() if "NarrowPhase" in line]
    assert "all pairs of SphereCollider" in line
    assert "AABBCollider" not in line


def test_geometry_can_be_changed_between_steps():
    world = make_world()
    levelled(world, 0.0, kind="static")
    levelled(world, (1.2, 0.5), kind="kinematic")
    for geometry, hits in (("precise", 0), ("bounds", 1), ("precise", 0), ("bounds", 1)):
        world.settings = world.settings.replace(geometry=geometry)
        world.step()
        assert len(world.contacts) == hits
        assert bool(world.query_point((0.0, 0.6))) == hits


def test_what_stands_still_keeps_its_offset_when_the_kernels_change():
    """Preparing for other shapes in the middle of a run rebuilds the levels: static bodies are boxed again."""
    world = make_world(gravity=10.0)
    ground = world.create_entity(Transform((0, 5)), AABBCollider((5, 0.5), offset=(0, -5.5)))
    body = box(world, (0.0, 0.5))
    run(world, 10)
    world.prepare(SphereCollider)
    run(world, 60)
    assert position(world, body)[1] == pytest.approx(0.5, abs=0.01)
    assert world.query_point((0.0, -0.9)) == [ground]


@pytest.mark.slow
def test_the_example_runs(capsys):
    """Levels find the same contacts as the last one alone; bounds finds the first level's hits."""
    runpy.run_path(str(ROOT / "examples" / "levels.py"))["main"](300)
    lines = capsys.readouterr().out.splitlines()[1:]
    rows = {line[:32].strip(): [int(number) for number in line[32:77].split()] for line in lines}
    for name in ("2D, boxes 1:1", "3D, boxes 1:4", "2D, rocks"):
        plain, several = rows[name], rows[f"{name} in spheres"]
        assert several[4] == plain[4] > 0
        assert several[2] >= several[3] > 0
    assert rows["2D, boxes 1:2 in spheres, bounds"][4] == rows["2D, boxes 1:2 in spheres"][2]


@pytest.mark.slow
@both_dimensions
@pytest.mark.parametrize("scale", [1.0, 1e-9, 1e9])
def test_a_sphere_must_hold_the_corners_of_the_box(d, scale):
    """To a millionth of its radius, at any offset of the two; 1e-5 short is an error that states the difference."""
    half, gap = np.array([0.3, 0.4, 1.2])[:d] * scale, np.array([0.1, -0.2, 0.3])[:d] * scale
    for offset in (np.zeros(d), gap):
        reach = np.linalg.norm(half + np.abs(offset))
        for factor, fits in ((1.0, True), (1 - 0.5e-6, True), (1 - 1e-5, False), (0.5, False)):
            world = make_world(d)
            entity = world.create_entity(
                Transform((0.0,) * d), SphereCollider(factor * reach, offset=-offset), AABBCollider(half)
            )
            if fits:
                world.step()
                continue
            with pytest.raises(ValueError, match=rf"entity {entity}: its SphereCollider is the cheaper level") as error:
                world.step()
            assert f"AABBCollider, which sticks out by {(1 - factor) * reach:.4g}:" in str(error.value)


def test_what_does_not_fit_is_reported_again_until_it_does():
    """Nothing is adopted before; a larger sphere, or none, corrects it. Later changes by the game are not checked."""
    world = make_world()
    ball(world, 9.0)
    first = levelled(world, 0.0, radius=0.7)
    second = levelled(world, 3.0, radius=0.6, rotation=0.6)
    for _ in range(2):
        with pytest.raises(ValueError, match=rf"entity {first}: .*\(1 more entities likewise\)"):
            world.step()
        with pytest.raises(ValueError, match=r"sticks out by 0\.007107"):
            len(world.bodies)
    assert world.step_count == 0
    world.remove_component(first, SphereCollider)
    with pytest.raises(ValueError, match=rf"entity {second}: .*second entity for a shape of its own$"):
        world.step()
    world.component_for_entity(second, SphereCollider).radius = 0.8
    world.step()
    assert len(world.bodies) == 3
    world.component_for_entity(second, SphereCollider).radius = 0.1
    ball(world, 9.0)
    run(world, 3)


def test_a_collider_that_comes_later_is_checked_against_those_that_are_there():
    world = make_world()
    entity = box(world, 0.0)
    world.step()
    for wrong, sticks_out, right in (
        (SphereCollider(0.6), "0.1071", SphereCollider(0.75)),
        (AABBCollider((0.7, 0.7)), "0.2399", AABBCollider((0.5, 0.5))),
    ):
        world.add_component(entity, wrong)
        with pytest.raises(ValueError, match=rf"entity {entity}: .*sticks out by {sticks_out}"):
            world.step()
        world.add_component(entity, right)
        world.step()


def test_sensor_and_solid_do_not_mix():
    world = make_world()
    entity = levelled(world, 0.0, sphere={"sensor": True})
    for sensor, solid, becomes in ((SphereCollider, AABBCollider, False), (AABBCollider, SphereCollider, True)):
        world.component_for_entity(entity, sensor).sensor = True
        message = f"entity {entity}: its {sensor.__name__} is a sensor and its {solid.__name__} is solid.*second entity"
        for _ in range(2):
            with pytest.raises(ValueError, match=message):
                world.step()
        world.component_for_entity(entity, SphereCollider).sensor = becomes
        world.step()
    assert world.step_count == 2


class DiscCollider(Collider):
    """A sphere by another name, with a higher cost."""

    dimensions = (2,)
    reach = column(minimum=0.0)

    @staticmethod
    def bounds(shape, dimensions):
        return shape.reach, shape.reach

    @staticmethod
    def support(shape, direction):
        return scale(direction, 0.0)

    @staticmethod
    def rounding(shape):
        return shape.reach


def disc_world(cost=5.0):
    plugin = Plugin("discs")
    plugin.shape(cost=cost)(DiscCollider)
    return World(Physics(dimensions=2), plugin, settings=Settings())


def nested(world, place, *, radius=1.5, half=1.0, reach=0.9):
    """A disc in a box in a sphere."""
    return world.create_entity(
        Transform(place), RigidBody(kind="kinematic"), AABBCollider((half, half)), DiscCollider(reach),
        SphereCollider(radius),
    )  # fmt: skip


def test_three_levels_of_which_one_is_a_plugins():
    """Cases where each of them decides; the middle level of three is tested against the last of two."""
    world = disc_world()
    a, b = nested(world, (0, 0)), nested(world, (9, 9))
    two = world.create_entity(Transform((-9, 9)), RigidBody(), AABBCollider((1, 1)), SphereCollider(1.5))
    for other, place, hits, counts in (
        (b, (2.3, 2.0), 0, (1, 0, 0)),  # beyond the spheres, 3.05 apart
        (b, (2.1, 2.0), 0, (1, 1, 1)),  # within the spheres, beyond the boxes
        (b, (1.9, 1.9), 0, (1, 1, 1)),  # the boxes overlap, the discs are 2.7 apart
        (b, (1.2, 1.2), 1, (1, 1, 0)),
        (two, (1.0, 2.1), 0, (1, 1, 1)),  # the boxes are apart
        (two, (1.8, 1.8), 0, (1, 1, 1)),  # the boxes overlap; from the box to the disc's centre 1.13
        (two, (1.2, 1.2), 1, (1, 1, 0)),
    ):
        world.component_for_entity(other, Transform).position = place
        world.reset_stats()
        world.step()
        assert pairs(world.contacts) == [(a, other)][:hits], place
        assert tuple(world.stats().counters[name] for name in COUNTERS) == counts, place
        world.component_for_entity(other, Transform).position = (9, 9) if other == b else (-9, 9)


def test_shapes_of_others_are_checked_by_the_boxes_around_them():
    for sizes, out in (
        ({"reach": 1.1}, "AABBCollider is the cheaper level and must enclose its DiscCollider.*out by 0.1:"),
        ({"radius": 1.4}, "SphereCollider is the cheaper level and must enclose its AABBCollider"),
    ):
        world = disc_world()
        nested(world, (0, 0), **sizes)
        with pytest.raises(ValueError, match=out):
            world.step()
    world = disc_world(cost=1.0)  # as cheap as a sphere, and first by name
    world.create_entity(Transform((0, 0)), DiscCollider(1.0), SphereCollider(1.1))
    with pytest.raises(ValueError, match=r"DiscCollider is the cheaper level .* SphereCollider, .* out by 0\.1:"):
        world.step()


def test_an_unregistered_collider_is_named():
    world = make_world()
    world.create_entity(Transform((0, 0)), DiscCollider(1.0))
    with pytest.raises(UnhandledPairError, match="DiscCollider is a collider that no plugin"):
        world.step()
