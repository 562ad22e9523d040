"""Worlds with swept bodies agree with the oracle, which tests all pairs all the time: the same impacts in the
same order, the same motion, the same contacts.

In these scenes rounding seldom decides anything; where it did (``oracle.doubts``) a step may differ. Impacts of curved
bodies amplify rounding, tenfold and more each: each step starts from the world's own state, and if accuracy is lost
within one step, the oracle must also give another result when its start is perturbed by as much.
"""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest
from helpers_modes import SWEPT, each_mode, each_sweep, mode_world
from oracles.whole_step import Oracle, assert_agrees
from worlds import both_dimensions

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.lab import testing as kit

pytestmark = pytest.mark.slow  # its scenes compile for long

DT = 1 / 60
SHAKEN, GROWN = 1e-14, 1e-10  # of the scale: perturbation, and the growth beyond which a step is not compared


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


@dataclasses.dataclass
class Told:
    """Counts over the compared steps."""

    steps: int = 0
    impacts: int = 0
    rounds: int = 0
    capped: int = 0  # steps in which the cap was reached
    crossed: int = 0  # sensors that were met during the step
    differ: int = 0  # steps that differ where the oracle has doubts, or rounding grows

    def compare(self, world, steps=1):
        """Compare steps, each from the world's own state."""
        for _ in range(steps):
            oracle, other = Oracle(world), Oracle(world)
            before = dict(world.stats().counters)
            world.step()
            oracle.step()
            counters = world.stats().counters
            self.steps += 1
            self.impacts += len(oracle.impacts)
            self.rounds += counters["rounds"] - before["rounds"]
            self.capped += oracle.capped_impacts > 0
            self.crossed += sum(not c.depth and not c.normal_impulse for c in oracle.contacts.values())
            try:
                assert (counters["capped_impacts"] > before["capped_impacts"]) == (oracle.capped_impacts > 0)
                assert_agrees(world, oracle)
            except AssertionError:
                if not oracle.doubts and not magnifies(oracle, other):
                    raise
                self.differ += 1
                return


def scattered(rng, mode, d, count, speed, *, shapes="mixed", gravity=0.0, plain=False, **chosen):
    """``count`` bodies without overlap, sizes over most of a decade, with that speed in sizes per step.

    All kinds, masses over six decades and e from 0 to 1.2, mostly inside a room with thin walls; ``plain``: only
    dynamic elastic bodies of equal mass. In discrete worlds the first body has ccd.
    """
    world = mode_world(mode, d, gravity, **chosen)
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
        "max_impacts_per_step": rng.choice([1, 2, 5, None]),
    }
    return scattered(rng, mode, d, count, 10 ** rng.uniform(-2.5, 1.0 if count > 20 else 1.7), **chosen)


# -- whole steps ---------------------------------------------------------------------------------


@each_sweep
def test_random_scenes(mode):
    """Three steps each of scenes of all kinds, from a hundredth of a size to 50 sizes in a step."""
    told = Told()
    for seed in range(25):
        world = any_scene(seed, mode)
        told.compare(world, 3)
        world.close()
    assert told.impacts > 25
    assert told.differ <= 0.02 * told.steps
    assert told.crossed > 0


@pytest.mark.long
@each_sweep
def test_more_random_scenes(mode):
    """The same with up to 40 bodies; a single body with ccd has few impacts, so it takes more scenes."""
    told = Told()
    for seed in range(1000, 1060) if mode == "ccd" else (*range(1000, 1014), 1018):
        world = any_scene(seed, mode, 40 if seed % 4 == 0 else 12)
        told.compare(world, 3)
        world.close()
    assert told.impacts > 80
    assert told.capped > 3
    assert told.differ <= 0.05 * told.steps


@both_dimensions
@each_mode
def test_many_fast_bodies_in_several_rounds(mode, d):
    """70 bodies in a room, a dozen impacts and more: the oracle has no neighbourhoods, search bounds or rounds."""
    told = Told()
    for seed in range(2):
        rng = np.random.default_rng(seed)
        shapes = ("balls", "mixed")[seed]
        world = scattered(rng, mode, d, 70, 0.5 if d == 2 else 1.0, shapes=shapes, plain=True)
        told.compare(world)
        world.close()
    assert told.impacts > 20
    assert told.rounds > 0
    assert told.differ == 0


@pytest.mark.long
@both_dimensions
@each_sweep
def test_more_fast_bodies(mode, d):
    """Each mode with each integrator, each kind of shapes, in the plane and in space; and each two of these."""
    told, left_out = Told(), SWEPT.index(mode)
    for seed in range(100, 103) if d == 2 else range(103, 106):
        if seed % 3 == (1 + left_out + d) % 3:
            continue
        rng = np.random.default_rng(seed)
        integrator, shapes = ("semi_implicit_euler", "velocity_verlet")[seed % 2], ("balls", "boxes", "mixed")[seed % 3]
        world = scattered(
            rng, mode, d, 70, 0.8 if d == 2 else 1.5, shapes=shapes, gravity=9.81 * (seed % 2), integrator=integrator
        )
        told.compare(world)
        world.close()
    assert told.impacts > 20
    assert told.rounds > 0 or mode == "ccd"
    assert told.differ <= 1


@both_dimensions
@each_sweep
def test_several_steps_together(mode, d):
    """Without resetting the state: a few elastic balls in a room, ten steps, until rounding has grown by some
    decades."""
    world = scattered(np.random.default_rng(7), mode, d, 4, 0.4, shapes="balls", gravity=9.81, plain=True)
    oracle = Oracle(world)
    for _ in range(10):
        world.step()
        oracle.step()
        assert_agrees(world, oracle)


@each_sweep
@pytest.mark.parametrize("integrator", ["semi_implicit_euler", "velocity_verlet"])
def test_damping_and_constant_forces(mode, integrator):
    """They curve the paths, and damp the velocity changes of impacts: on straight paths, parabolas, flights. Both
    integrators meet each dimension and each gravity, and these each other."""
    told = Told()
    for seed in range(3) if integrator == "semi_implicit_euler" else range(3, 6):
        rng = np.random.default_rng(seed)
        d = 2 + seed % 2
        world = scattered(rng, mode, d, 8, 10 ** rng.uniform(-1, 0.5), gravity=9.81 * (seed % 3), integrator=integrator)
        for entity in world.bodies.entity.tolist():
            if world.has_component(entity, RigidBody):
                body = world.component_for_entity(entity, RigidBody)
                body.linear_damping = float(rng.choice([0.0, 1.0, 30.0]))
                body.constant_force = tuple(body.mass * 100 * rng.normal(size=d))
        told.compare(world, 4)
        world.close()
    assert told.impacts > 5
    assert told.differ <= 1


@pytest.mark.parametrize("cap", [1, 2])
@each_sweep
def test_beyond_the_cap_what_loses_energy_sticks(mode, cap):
    """Plastic balls fly into a corner in a row: clusters grow, meet each other, and the walls stop them."""
    told, sticks = Told(), 0
    for seed in range(4):
        rng = np.random.default_rng(seed)
        world = mode_world(mode, 2, max_impacts_per_step=cap)
        kit.box(world, (1.0, 0.0), half=(0.05, 3.0), kind="static")
        kit.box(world, (0.0, -1.0), half=(3.0, 0.05), kind="static")
        for k in range(6):
            place = np.array((0.3 - 0.3 * k, 0.2 + 0.25 * k)) + rng.uniform(-0.03, 0.03, 2)
            body = RigidBody(10 ** rng.uniform(-1, 1), (200.0 + 40 * k, -150.0 - 40 * k), ccd=True)
            world.create_entity(Transform(tuple(place)), body, SphereCollider(0.1, restitution=float(k == 2)))
        oracle = Oracle(world)
        oracle.step()
        sticks += sum(impact.kind == "stick" for impact in oracle.impacts)
        told.compare(world)  # only one step: in the next, rounding decides which of them still touch
        world.close()
    assert sticks > 4
    assert told.differ == 0


@each_mode
def test_fast_bodies_among_what_rests(mode):
    """Boxes at rest on a floor, and bullets that hit them."""
    told = Told()
    for seed in range(3):
        rng = np.random.default_rng(seed)
        world = mode_world(mode, 2, 9.81)
        kit.floor(world)
        for k in range(4):
            kit.box(world, (1.5 * k, 0.5), restitution=0.3, friction=0.5, mass=10 ** rng.uniform(-1, 1))
        kit.run(world, 10)
        for _ in range(3):
            start, way = rng.uniform((-9, 0.5), (-6, 4)), rng.uniform((20, -9), (300, 3))
            kit.ball(world, start, way, radius=0.1, mass=10 ** rng.uniform(-2, 1), restitution=rng.choice([0, 0.5, 1]))
        told.compare(world, 20)
        world.close()
    assert told.impacts > 5
    assert told.differ <= 3


def test_a_kinematic_body_runs_into_one_that_the_cap_has_stopped():
    """It once continued to stop it without end."""
    world = mode_world("continuous", max_impacts_per_step=1)
    kit.ball(world, 0.0, -200.0, radius=0.1, restitution=1.0)
    kit.box(world, (-1.5, 0.0), half=0.4, kind="static")
    kit.box(world, (3.0, 0.0), (-300.0, 0.0), half=(0.1, 1.0), kind="kinematic")
    told = Told()
    told.compare(world)
    assert told.capped == 1


def test_a_body_stopped_at_a_wall_is_not_pushed_through_it():
    """A heavy plastic ball hits it from behind, and would continue with it."""
    world = mode_world("continuous", max_impacts_per_step=1, restitution_mixing="min")
    ball = kit.ball(world, (0.0, 0.0), (200.0, 0.0), radius=0.1, restitution=1.0)
    for x in (-0.5, 1.0):
        kit.box(world, (x, 0.0), half=(0.01, 3.0), kind="static", restitution=1.0)
    kit.ball(world, (0.5, 3.2), (-60.0, -220.0), radius=0.1, mass=10.0)
    told = Told()
    told.compare(world)
    assert told.capped == 1
    assert kit.position(world, ball)[0] > -0.4


def test_contacts_include_what_touches_a_body_that_the_cap_has_stopped():
    """A slow box overlaps it by a tenth of the slop at the end of the step."""
    world = mode_world("continuous", max_impacts_per_step=1)
    ball = kit.ball(world, (0.0, 0.0), (-200.0, 0.0), radius=0.1, restitution=1.0)
    kit.box(world, (-1.5, 0.0), half=0.4, kind="static")
    kit.box(world, (1.0, 0.0), half=0.1, kind="static")
    box = kit.box(world, (0.8, 0.201), (0.0, -0.066), half=0.1)
    told = Told()
    told.compare(world)
    assert told.differ == 0
    kit.assert_touching(world, ball, box)


def test_a_stopped_body_stays_there_whatever_carried_it():
    """A box at rest on a floor is hit twice; the resting prediction must not have pushed it into the floor."""
    world = mode_world("continuous", 2, 100.0, max_impacts_per_step=1)
    kit.floor(world)
    box = kit.box(world, (0.0, 0.5), restitution=1.0)
    kit.run(world, 30)
    height = kit.position(world, box)[1]
    kit.ball(world, (-2.0, 0.5), (300.0, 0.0), radius=0.1, restitution=1.0)
    kit.ball(world, (4.0, 0.5), (-300.0, 0.0), radius=0.1, restitution=1.0)
    told = Told()
    told.compare(world)
    assert told.capped == 1
    assert kit.position(world, box)[1] == pytest.approx(height, abs=1e-3)
    kit.assert_touching(world, box, box + 2)


def test_neighbours_in_a_discrete_world_do_not_lose_contacts_to_a_crowd_of_bullets():
    """60 bullets make the step take several rounds; a ball without ccd still meets a wall at its end."""
    rng = np.random.default_rng(3)
    world = mode_world("ccd", 3)
    for _ in range(60):
        body = RigidBody(1.0, tuple(rng.normal(size=3) * 300), ccd=True)
        world.create_entity(Transform(tuple(rng.uniform(-3, 3, 3))), body, SphereCollider(0.02))
    kit.box(world, (9.0, 0.0, 0.0), half=(0.5, 2.0, 2.0), kind="static")
    ball = kit.ball(world, (6.0, 0.0, 0.0), (2.2 / DT, 0.0, 0.0), radius=0.5)
    told = Told()
    told.compare(world)
    assert told.rounds > 0
    assert kit.position(world, ball)[0] < 8.1


def test_the_oracle_sees_impacts_that_are_wrong():
    world = mode_world("continuous")
    a, b = kit.ball(world, 0.0, 200.0, restitution=1.0), kit.ball(world, 2.5)
    oracle = Oracle(world)
    oracle.bodies[1].position += (1e-6, 0.0)
    world.step(), oracle.step()
    with pytest.raises(AssertionError, match=rf"impact of {a} and {b}, step 1: time_of_impact is .*, the oracle says"):
        assert_agrees(world, oracle)
    oracle.impacts.clear()
    with pytest.raises(AssertionError, match=rf"step 1: impacts are \[\({a}, {b}\)\], the oracle says \[\]"):
        assert_agrees(world, oracle)
