"""Impacts agree with an oracle that tests all pairs all the time: the same ones in order, the same motion.

Not compared: steps in which contacts push, or the cap is reached; a difference counts unless rounding grows as much.
"""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest
from helpers_modes import bullet, each_mode, each_sweep, mode_world, rows_of, velocities
from helpers_pairwise import pairwise
from oracles.impact_queue import Oracle, assert_agrees
from worlds import both_dimensions

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.lab import testing as kit

pytestmark = pytest.mark.early

DT = 1 / 60
SHAKEN, GROWN = 1e-14, 1e-10  # of the scale: perturbation, and the growth beyond which a step is not compared
CAP = 100  # impacts of a body in a step, of which the oracle knows nothing
slow = pytest.mark.slow  # its scenes compile for long


def magnifies(oracle, other):
    """True if a step changes when every body starts from a position perturbed by some rounding errors."""
    rng = np.random.default_rng(0)
    scale = max(np.abs(body.position).max() for body in other.bodies)
    for body in other.bodies:
        body.position = body.position + SHAKEN * scale * rng.normal(size=body.position.shape)
    other.step()
    if [impact.pair.key for impact in oracle.impacts] != [impact.pair.key for impact in other.impacts]:
        return True
    both = zip(oracle.bodies, other.bodies, strict=True)
    return any(np.abs(a.position - b.position).max() > GROWN * scale for a, b in both)


def something_rests(world):
    """True if a pair had a higher impulse in the last step than its impacts."""
    struck, contacts = dict.fromkeys(zip(*pair_columns(world.contacts), strict=True), 0.0), world.contacts
    for a, b, impulse in zip(*pair_columns(contacts.impacts), contacts.impacts.normal_impulse, strict=True):
        struck[a, b] += impulse
    return bool((contacts.normal_impulse > np.array(list(struck.values())) * (1 + 1e-9)).any())


def pair_columns(rows):
    return rows.entity_a.tolist(), rows.entity_b.tolist()


@dataclasses.dataclass
class Told:
    """Counts over the compared steps."""

    steps: int = 0
    left_out: int = 0  # steps that are not compared
    impacts: int = 0
    rounds: int = 0
    crossed: int = 0  # sensors that were met during the step
    differ: int = 0  # steps that differ where rounding grows

    def compare(self, world, steps=1):
        """Compare steps, each from the world's own state."""
        for _ in range(steps):
            oracle, other, before = Oracle(world), Oracle(world), dict(world.stats().counters)
            rested = something_rests(world)
            world.step()
            counters = world.stats().counters
            if rested or something_rests(world) or counters["capped_impacts"] > before["capped_impacts"]:
                self.left_out += 1
                continue
            oracle.step()
            self.steps += 1
            self.impacts += len(oracle.impacts)
            self.rounds += counters["rounds"] - before["rounds"]
            self.crossed += sum(pair.crossed for pair in oracle.pairs)
            try:
                assert_agrees(world, oracle)
            except AssertionError:
                if not magnifies(oracle, other):
                    raise
                self.differ += 1
                return


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


def any_scene(seed, mode, most=12):
    rng = np.random.default_rng(seed)
    d, count = int(rng.integers(2, 4)), int(rng.integers(3, most + 1))
    chosen = {
        "gravity": float(rng.choice([0.0, 9.81, 200.0])),
        "integrator": str(rng.choice(["semi_implicit_euler", "velocity_verlet"])),
        "shapes": str(rng.choice(["balls", "boxes", "mixed"])),
    }
    return scattered(rng, mode, d, count, 10 ** rng.uniform(-2.5, 1.7), **chosen)


@slow
@each_sweep
def test_random_scenes(mode):
    """Three steps each of scenes of all kinds, from a hundredth of a size to 50 sizes in a step."""
    told = Told()
    for seed in range(25):
        with any_scene(seed, mode) as world:
            told.compare(world, 3)
    assert told.impacts > 25
    assert told.left_out < 0.5 * told.steps
    assert told.differ <= 0.02 * told.steps
    assert told.crossed > 0


@slow
@both_dimensions
@each_mode
def test_many_fast_bodies_in_several_rounds(mode, d):
    """70 bodies in a room, a dozen impacts and more: the oracle has no neighbourhoods, search bounds or rounds."""
    told = Told()
    for seed in range(2):
        rng = np.random.default_rng(seed)
        shapes = ("balls", "mixed")[seed]
        with scattered(rng, mode, d, 70, 0.5 if d == 2 else 1.0, shapes=shapes, plain=True) as world:
            told.compare(world)
    assert told.impacts > 20
    assert told.rounds > 0
    assert told.differ == 0


@slow
@each_sweep
@pytest.mark.parametrize("integrator", ["semi_implicit_euler", "velocity_verlet"])
def test_damping_and_constant_forces(mode, integrator):
    """Curved paths, and impacts that damping fades; each integrator meets each dimension and each gravity."""
    told = Told()
    for seed in range(24) if integrator == "semi_implicit_euler" else range(25, 49):
        rng = np.random.default_rng(seed)
        d = 2 + seed % 2
        world = scattered(rng, mode, d, 8, 10 ** rng.uniform(-1, 0.5), gravity=9.81 * (seed % 3), integrator=integrator)
        for entity in world.bodies.entity.tolist():
            if world.has_component(entity, RigidBody):
                body = world.component_for_entity(entity, RigidBody)
                body.linear_damping = float(rng.choice([0.0, 1.0, 30.0]))
                body.constant_force = tuple(body.mass * 30 * rng.normal(size=d))
        told.compare(world, 4)
        world.close()
    assert told.impacts >= 5
    assert told.differ <= 1


@both_dimensions
@pytest.mark.parametrize("method", ["explicit_euler", "semi_implicit_euler", "velocity_verlet"])
@pytest.mark.parametrize("e", [0.5, 1.0])
def test_a_ball_that_falls_and_bounces(d, method, e):
    """In a discrete world, with friction, until it comes to rest."""
    world, told = kit.make_world(d, 9.81, integrator=method), Told()
    kit.floor(world)
    kit.ball(world, (0.1, 1.5, 0.0)[:d], (1.0, 0.0, 0.3)[:d], restitution=e, friction=0.2)
    told.compare(world, 80)
    assert told.impacts >= 1
    assert told.differ == 0


@slow
@both_dimensions
@pytest.mark.parametrize("mode", ["discrete", "continuous", "event_driven"])
def test_several_strike_one_at_the_same_time(mode, d):
    """Of any mass and restitution: as the library solves it, to rounding."""
    rng = np.random.default_rng(5)
    told, together = Told(), 0
    for _ in range(8):
        world = kit.make_world(d, collision=mode, max_impacts_per_step=CAP)
        kit.ball(world, np.zeros(d), 0.0, radius=0.5, restitution=0.8)
        for axis, sign in itertools.product(range(d), (-1.0, 1.0)):
            way = sign * np.eye(d)[axis] + rng.normal(size=d) * 0.2
            way /= np.linalg.norm(way)
            kit.ball(world, way * 1.0625, -way * 8.0, radius=0.5, mass=float(rng.uniform(0.5, 2)),
                     restitution=float(rng.choice([0.5, 1.0])))  # fmt: skip
        before = told.impacts
        told.compare(world, 3)
        together += told.impacts > before + 2
        world.close()
    assert together > 4
    assert told.differ == 0


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


def test_a_kinematic_body_runs_into_one_that_is_stopped():
    """It once continued to stop it without end."""
    world = mode_world("continuous", max_impacts_per_step=1)
    ball = kit.ball(world, 0.0, -200.0, radius=0.1, restitution=1.0)
    kit.box(world, (-1.5, 0.0), half=0.4, kind="static")
    kit.box(world, (3.0, 0.0), (-300.0, 0.0), half=(0.1, 1.0), kind="kinematic")
    world.step()
    assert world.stats().counters["capped_impacts"] > 0
    assert kit.position(world, ball)[0] >= -1.0 - 1e-9


def test_a_body_stopped_at_a_wall_is_not_pushed_through_it():
    """A heavy plastic ball hits it from behind, and would continue with it."""
    world = mode_world("continuous", max_impacts_per_step=1, restitution_mixing="min")
    ball = kit.ball(world, (0.0, 0.0), (200.0, 0.0), radius=0.1, restitution=1.0)
    for x in (-0.5, 1.0):
        kit.box(world, (x, 0.0), half=(0.01, 3.0), kind="static", restitution=1.0)
    kit.ball(world, (0.5, 3.2), (-60.0, -220.0), radius=0.1, mass=10.0)
    world.step()
    assert world.stats().counters["capped_impacts"] > 0
    assert kit.position(world, ball)[0] > -0.4


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


@slow
def test_neighbours_in_a_discrete_world_do_not_lose_contacts_to_a_crowd_of_bullets():
    """60 bullets make the step take several rounds; a ball without ccd still meets a wall at its end."""
    rng = np.random.default_rng(3)
    world = mode_world("ccd", 3)
    for _ in range(60):
        body = RigidBody(1.0, tuple(rng.normal(size=3) * 300), ccd=True)
        world.create_entity(Transform(tuple(rng.uniform(-3, 3, 3))), body, SphereCollider(0.02))
    kit.box(world, (9.0, 0.0, 0.0), half=(0.5, 2.0, 2.0), kind="static")
    ball = kit.ball(world, (6.0, 0.0, 0.0), (2.2 / DT, 0.0, 0.0), radius=0.5)
    world.step()
    assert world.stats().counters["rounds"] > 0
    assert kit.position(world, ball)[0] < 8.1


def test_the_oracle_sees_impacts_that_are_wrong():
    world = mode_world("continuous")
    a, b = kit.ball(world, 0.0, 200.0, restitution=1.0), kit.ball(world, 2.5)
    oracle = Oracle(world)
    oracle.bodies[1].position += (1e-6, 0.0)
    world.step(), oracle.step()
    with pytest.raises(AssertionError, match=rf"impact of {a} and {b}: time_of_impact is .*, the oracle says"):
        assert_agrees(world, oracle)
    oracle.impacts.clear()
    with pytest.raises(AssertionError, match=rf"impacts are \[\({a}, {b}\)\], the oracle says \[\]"):
        assert_agrees(world, oracle)
