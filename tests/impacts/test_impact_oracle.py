"""Impacts agree with a naive oracle that watches all pairs all the time; and what happens beyond the cap on impacts."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from helpers_modes import bullet, each_mode, each_sweep, mode_world, rows_of, velocities
from helpers_pairwise import pairwise
from oracles import impacts_naive
from scipy.optimize import nnls
from worlds import both_dimensions

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.lab import testing as kit

pytestmark = pytest.mark.early

DT = 1 / 60
CAP = 100  # impacts of a body in a step, of which the oracle knows nothing


def compare(world, most=12):
    """(impacts, crossings) of a step that is the oracle's: order, times, normals, impulses, sensors and motion.

    UnsureError if there are more impacts: rounding shows then.
    """
    ends, impacts, crossed = impacts_naive.step(world, most)
    sensors = {entity for entity in ends for kind in (SphereCollider, AABBCollider)
               if world.has_component(entity, kind) and world.component_for_entity(entity, kind).sensor}  # fmt: skip
    world.step()
    rows = world.contacts.impacts
    if len(rows) > most:
        raise impacts_naive.UnsureError
    assert list(zip(rows.entity_a.tolist(), rows.entity_b.tolist(), strict=True)) == [row[1:3] for row in impacts]
    if impacts:
        times, _, _, normals, impulses = zip(*impacts, strict=True)
        np.testing.assert_allclose(rows.time_of_impact, times, rtol=0, atol=1e-8 * DT)
        np.testing.assert_allclose(rows.normal, normals, rtol=0, atol=1e-8)
        np.testing.assert_allclose(rows.normal_impulse, impulses, rtol=0, atol=1e-8 * max(impulses))
    places, speeds = (np.array([end[k] for end in ends.values()]) for k in (0, 1))
    at = rows_of(world, ends)
    np.testing.assert_allclose(world.bodies.position[at], places, rtol=0, atol=1e-8 * np.abs(places).max())
    np.testing.assert_allclose(world.bodies.linear_velocity[at], speeds, rtol=0, atol=1e-8 * np.abs(speeds).max())
    pairs = set(zip(world.contacts.entity_a.tolist(), world.contacts.entity_b.tolist(), strict=True))
    assert {pair for pair in pairs if sensors & {*pair}} == {pair for pair in crossed if sensors & {*pair}}
    return len(impacts), len(crossed)


def scattered(rng, mode, d, count, speed, *, shapes="mixed", gravity=0.0, plain=False, **chosen):
    """Bodies of most kinds without overlap, with that speed in sizes per step; plain: dynamic, elastic, alike."""
    world = mode_world(mode, d, gravity, max_impacts_per_step=CAP, **chosen)
    width = 0.62 * count ** (1 / d)
    if plain or rng.random() < 0.7:
        wall = width + 0.6
        for axis, sign in itertools.product(range(d), (-1, 1)):
            half, place = np.full(d, wall), np.zeros(d)
            half[axis], place[axis] = 0.01, sign * wall
            kit.box(world, place, half=half, kind="static", restitution=1.0 if plain else rng.choice([0, 0.3, 1, 1.2]))
    places, halves, tries = [], [], 0
    while len(places) < count:
        tries += 1
        sphere = shapes == "balls" or (shapes == "mixed" and rng.random() < 0.5)
        half = 10 ** rng.uniform(-0.9, -0.3, d)
        half = np.full(d, half[0]) if sphere or rng.random() < 0.5 else half
        place = rng.uniform(-width, width, d) * 1.2 ** (tries // (50 * count))
        if any((np.abs(place - p) < 1.02 * (half + h)).all() for p, h in zip(places, halves, strict=True)):
            continue
        first = not places
        kind = str(rng.choice(["dynamic"] * 6 + ["static", "kinematic"])) if not (plain or first) else "dynamic"
        mass = 10 ** (rng.uniform(-3, 3) if not plain else rng.uniform(-0.3, 0.3))
        velocity = rng.normal(size=d) * speed * 2 * half.min() / DT
        material = {
            "restitution": 1.0 if plain else float(rng.choice([0, 0.3, 1, 1.2])),
            "friction": 0.0 if plain else float(rng.choice([0, 0.5])),
            "sensor": bool(not (plain or first) and rng.random() < 0.12),
        }
        collider = SphereCollider(half[0], **material) if sphere else AABBCollider(tuple(half), **material)
        body = RigidBody(mass if kind == "dynamic" else 1.0, tuple(velocity * (kind != "static")), kind=kind,
                         ccd=mode == "ccd" and first)  # fmt: skip
        world.create_entity(Transform(tuple(place)), body, collider)
        places.append(place)
        halves.append(half)
    return world


@pytest.mark.slow
@each_mode
@pytest.mark.parametrize("curved", [False, True])
def test_random_scenes(mode, curved):
    """Of all kinds, from one size to ten in a step; on straight paths and on parabolas of their own."""
    impacts = crossed = steps = 0
    for seed in range(12):
        rng = np.random.default_rng(seed)
        chosen = {"shapes": str(rng.choice(["balls", "boxes", "mixed"])), "integrator": "velocity_verlet"}
        chosen |= {"gravity": float(rng.choice([9.81, 200.0])) * curved, "restitution_threshold": 0.0}
        speed = 10 ** rng.uniform(0.0, 1.0)
        with scattered(rng, mode, int(rng.integers(2, 4)), int(rng.integers(3, 10)), speed, **chosen) as world:
            for entity in world.bodies.dynamic.entity.tolist() if curved else ():
                body = world.component_for_entity(entity, RigidBody)
                body.constant_force = tuple(body.mass * 30 * rng.normal(size=world.dimensions))
            for _ in range(2):
                try:
                    found = compare(world)
                except impacts_naive.UnsureError:
                    break
                impacts, crossed, steps = impacts + found[0], crossed + found[1], steps + 1
    assert impacts > 20
    assert crossed > 2
    assert steps > 11


@pytest.mark.slow
@pytest.mark.parametrize(("mode", "d"), [("continuous", 2), ("event_driven", 3)])
def test_many_fast_bodies_in_several_rounds(mode, d):
    """70 bodies in a room, a dozen impacts and more: the oracle has no neighbourhoods, search bounds or rounds."""
    with scattered(np.random.default_rng(0), mode, d, 70, 2.0, shapes="balls", plain=True) as world:
        assert compare(world, most=1000)[0] > 10
        assert world.stats().counters["rounds"] > 0


@pytest.mark.slow
@both_dimensions
@pytest.mark.parametrize("mode", ["discrete", "continuous", "event_driven"])
def test_several_strike_one_at_the_same_time(mode, d):
    """Of any mass and restitution: each pair parts at e times its approach or faster, p >= 0, p (A p - wanted) = 0."""
    rng, left_out = np.random.default_rng(5), 0
    for _ in range(8):
        world = kit.make_world(d, collision=mode, max_impacts_per_step=CAP)
        struck, striking, wanted, ways = kit.ball(world, np.zeros(d), restitution=0.5), [], [], []
        masses, restitutions = rng.uniform(0.5, 2, 2 * d), rng.choice([0.5, 1.0], 2 * d)
        for k, (axis, sign) in enumerate(itertools.product(range(d), (-1.0, 1.0))):
            way = sign * np.eye(d)[axis] + rng.normal(size=d) * 0.1
            way /= np.linalg.norm(way)
            speed = 8.0 if mode == "discrete" else rng.choice([0.25, 8.0])  # a discrete world lets none be shot out
            place, mass, e = way * (1.0 + speed / 128), masses[k], restitutions[k]
            striking.append(kit.ball(world, place, -way * speed, mass=mass, restitution=e))
            wanted.append(speed * (1.0 + e))
            ways.append(np.concatenate([-way, *(way * (m == k) / np.sqrt(masses[m]) for m in range(2 * d))]))
        ways = np.array(ways).T  # by the square roots of the masses, so that A = ways^T ways
        impulses = nnls(ways, np.linalg.lstsq(ways.T, wanted, rcond=None)[0])[0]
        kit.run(world, 1)
        rows = world.contacts.impacts
        first = dict(zip(rows.entity_b.tolist(), rows.normal_impulse, strict=True), default=0.0)
        assert rows.entity_a[0] == struck
        np.testing.assert_allclose([first.get(entity, 0.0) for entity in striking], impulses, atol=1e-9)
        left_out += (impulses == 0).sum()
        world.close()
    assert left_out > 0 or mode == "discrete"


@pytest.mark.slow
@pytest.mark.parametrize(("d", "cap", "pillar"), pairwise((2, 3), (1, 2), (False, True)))
def test_beyond_the_cap_nothing_is_lost(d, cap, pillar):
    """50 clusters of elastic bullets: stopped bodies keep their velocity, so each keeps momentum and energy."""
    world = mode_world("continuous", d, max_impacts_per_step=cap)
    clusters = []
    for lane in range(50):
        rng = np.random.default_rng(lane)
        places = [np.zeros(d)] if pillar else []
        while len(places) < 3 + lane % 6:
            place = rng.uniform(-2, 2, d)
            if all(np.linalg.norm(place - other) > 1.001 for other in places):
                places.append(place)
        lift = 1e5 * lane * np.eye(d)[1]
        if pillar:
            kit.ball(world, places.pop(0) + lift, kind="static")
        speeds = [rng.normal(size=d) * 300 - 100 * place for place in places]
        clusters.append(
            [bullet(world, p + lift, v, radius=0.5, restitution=1.0) for p, v in zip(places, speeds, strict=True)]
        )
    before = [velocities(world, ids) for ids in clusters]
    capped = 0
    for _ in range(10):
        world.step()
        capped += world.stats().counters["capped_impacts"]
        for ids, start in zip(clusters, before, strict=True):
            now = world.bodies.linear_velocity[rows_of(world, ids)]
            if not pillar:
                np.testing.assert_allclose(now.sum(axis=0), start.sum(axis=0), rtol=0, atol=1e-12 * np.abs(start).sum())
            assert (now**2).sum() == pytest.approx((start**2).sum(), rel=1e-12)
    assert capped > 0


@pytest.mark.slow
@pytest.mark.parametrize("cap", [1, 2])
@each_sweep
def test_what_loses_energy_sticks(mode, cap):
    """Plastic balls fly into a corner in a row: none passes its walls, and energy is not raised."""
    for seed in range(4):
        rng = np.random.default_rng(seed)
        world = mode_world(mode, 2, max_impacts_per_step=cap)
        kit.box(world, (1.0, 0.0), half=(0.05, 3.0), kind="static")
        kit.box(world, (0.0, -1.0), half=(3.0, 0.05), kind="static")
        for k in range(6):
            place = np.array((0.3 - 0.3 * k, 0.2 + 0.25 * k)) + rng.uniform(-0.03, 0.03, 2)
            body = RigidBody(10 ** rng.uniform(-1, 1), (200.0 + 40 * k, -150.0 - 40 * k), ccd=True)
            world.create_entity(Transform(tuple(place)), body, SphereCollider(0.1, restitution=float(k == 2)))
        kept = kit.Conserved(world)
        world.step()
        kept.assert_energy_not_raised()
        assert world.stats().counters["capped_impacts"] > 0
        place = world.bodies.dynamic.position
        assert (place[:, 0] < 0.95).all()
        assert (place[:, 1] > -0.95).all()
        world.close()


def test_a_stopped_body_stays_there_whatever_carried_it():
    """A box at rest on a floor is hit twice; the resting prediction must not have pushed it into the floor."""
    world = mode_world("continuous", 2, 100.0, max_impacts_per_step=1)
    kit.floor(world)
    box = kit.box(world, (0.0, 0.5), restitution=1.0)
    kit.run(world, 30)
    height = kit.position(world, box)[1]
    kit.ball(world, (-2.0, 0.5), (300.0, 0.0), radius=0.1, restitution=1.0)
    kit.ball(world, (4.0, 0.5), (-300.0, 0.0), radius=0.1, restitution=1.0)
    world.step()
    assert world.stats().counters["capped_impacts"] > 0
    assert kit.position(world, box)[1] == pytest.approx(height, abs=1e-3)
    kit.assert_touching(world, box, box + 2)
