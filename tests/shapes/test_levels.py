"""Geometry levels: several colliders on one body, cheap first; a pair hits if every level hits."""

from __future__ import annotations

import math
import runpy
from pathlib import Path

import numpy as np
import pytest
from helpers_levels import COUNTERS, levelled, pairs
from oracles import narrow_naive
from worlds import EPS, ball, both_dimensions, box, floor, make_world, position, run, velocity

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Phase, System

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
    assert pairs(world) == list(expected)
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


def test_layer_and_mask_are_those_of_the_last_level():
    world = make_world()
    levelled(world, 0.0, sphere={"layer": 2, "mask": 2}, layer=4, mask=4)
    levelled(world, 0.5, sphere={"layer": 1, "mask": 1}, layer=4, mask=4)
    levelled(world, 0.25, sphere={"layer": 4, "mask": 4})
    world.step()
    assert len(world.contacts) == 1


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
    assert pairs(world) == [(turned, near)]
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
    """Corner to corner two squares hit by their circles; the contact is theirs, no further test is done."""
    world = make_world(geometry="bounds")
    levelled(world, 0.0, layer=2, mask=2, sensor=True, sphere={"sensor": True})
    levelled(world, (1.2, 0.5), layer=2, mask=2, sensor=True, sphere={"sensor": True})
    levelled(world, (0.5, 0.5), layer=4, mask=4)
    world.step()
    assert world.contacts.depth[0] == pytest.approx(2 * math.sqrt(0.5) - 1.3, abs=4 * EPS)
    np.testing.assert_allclose(world.contacts.normal, [(12 / 13, 5 / 13)], atol=4 * EPS)
    assert len(world.contacts) == 1  # layer, mask and sensor are still those of the last level
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


def test_a_query_uses_the_last_level():
    world = make_world()
    entity = levelled(world, 0.0)
    world.step()
    assert world.query_point((0.49, 0.49)) == [entity]
    assert world.query_point((0.0, 0.6)) == []  # in the circle, not in the square


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
