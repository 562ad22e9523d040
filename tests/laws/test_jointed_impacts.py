"""Impacts on bodies that joints hold, and of these: they part as the masses that the joints leave ask, and it is told.

A ball strikes a box, or the box with what it is joined to strikes a ball that stands. With J the rows of the joints and
M the masses, an impulse along c moves c (M^-1 - M^-1 J' (J M^-1 J')^-1 J M^-1) c' of the speed at its point.
"""

from __future__ import annotations

import math
from itertools import pairwise as pairwise_of

import numpy as np
import pytest
from helpers_pairwise import pairwise
from laws.helpers_laws import seeds
from worlds import MODES

from carom import AABBCollider, Physics, RigidBody, Settings, SphereCollider, Transform, World
from carom.lab.testing import energy as energy_of
from carom.plugins.joints import Ball, Distance, Hinge, Joints, Slider, Weld
from carom.plugins.rotation import BoxCollider, Rotation, Spin

HALF, RADIUS, SPEED, DT, G = (0.5, 0.25, 0.5), 0.25, 9.0, 1 / 60, 9.81
SECOND = np.array((1.1, 0, 0))  # where the other box of a pair is
KINDS = "weld", "hinge", "slider", "distance", "weld to a box", "hinge to a box", "slider to a box", "distance to a box"
ALONG = np.array((0.6, 0.8, 0.0))  # of the slider of one box
KNOWN_WALLS, STRUCK_GAIN = (6, 39, 45, 46, 48), 1e-3  # seeds whose energy grew up to 443,609 times; of the energy
POINTS = {"distance": ((0, -2.25, 0), (0, -0.25, 0)), "distance to a box": ((0.5, 0.2, 0), (0.6, -0.2, 0))}


def add_joint(world, kind, box, other):
    d = world.dimensions
    a, b = (None, box) if other is None else (box, other)
    middle = (-0.5, 0, 0)[:d] if other is None else tuple(SECOND[:d] / 2)
    name = kind.split()[0]
    if name == "weld":
        return world.create_entity(Weld(a, b, anchor=middle))
    if name == "hinge":
        return world.create_entity(Hinge(a, b, anchor=middle, **({} if d == 2 else {"axis": (0, 0, 1)})))
    if name == "slider":
        return world.create_entity(Slider(a, b, direction=tuple((ALONG if other is None else SECOND / 1.1)[:d])))
    start, end = (place[:d] for place in POINTS[kind])
    return world.create_entity(Distance(a, b, point_a=start, point_b=end))


def moved_by(kind, mass, hit, d):
    """1 / kg that an impulse along y at ``hit``, on the box of that mass, moves there; the other one has half of it."""
    half = np.array(HALF)
    inertia = mass / 3 * (half @ half - half**2)
    inverse = np.concatenate([[1 / m] * 3 + list(share / inertia) for m, share in ((mass, 1), (mass / 2, 2))])
    two, rows = kind.endswith("a box"), []

    def row(along, turn, place=None):
        """What moves along and turns about these, of b as a sees it; place: of the point that moves."""
        found = np.zeros(12)
        for sign, at, centre in ((-1, 0, np.zeros(3)), (1, 6, SECOND)) if two else ((1, 0, np.zeros(3)),):
            found[at : at + 3] = sign * np.array(along)
            arm = np.zeros(3) if place is None else np.array(place) - centre
            found[at + 3 : at + 6] = sign * (np.array(turn) + np.cross(arm, along))
        return found

    axes, name, middle = np.eye(3), kind.split()[0], SECOND / 2 if two else np.array((-0.5, 0, 0))
    if name in ("weld", "hinge"):
        rows += [row(axis, np.zeros(3), middle) for axis in axes]
    if name == "slider":
        across = axes[1:] if two else (np.array((-0.8, 0.6, 0)), axes[2])
        rows += [row(axis, np.zeros(3), SECOND if two else np.zeros(3)) for axis in across]
    if name in ("weld", "slider", "hinge"):
        rows += [row(np.zeros(3), axis) for axis in axes[: 2 if name == "hinge" else 3]]
    if name == "distance":
        start, end = map(np.array, POINTS[kind])
        found = row(end - start, np.zeros(3), end)
        if two:
            found[3:6] = -np.cross(start, end - start)
        rows.append(found)
    if d == 2:
        rows += [np.eye(12)[at + k] for at in (0, 6) for k in (2, 3, 4)]
    c = np.concatenate([(0, 1, 0), np.cross(hit, (0, 1, 0)), np.zeros(6)])
    rows = np.array(rows)
    held = (rows * inverse) @ rows.T
    return c @ (inverse * c) - (rows @ (inverse * c)) @ np.linalg.pinv(held, rcond=1e-10) @ (rows @ (inverse * c))


def struck(seed, d, mode, kind, e, strikes, mu=0.0):
    """(restitution by the impulse that is told, energy at the end over that before, change of momentum over that of the
    ball) of an impact: of the ball on the box, or of what is joined on the ball."""
    random = np.random.default_rng(seed)
    mass, phase, hit = 10 ** random.uniform(-1, 3), random.uniform(0.02, 0.98), np.array((0.0, 0.25, 0.0))
    hit[0] = random.uniform(-0.3, 0.4)
    if d == 3 and kind.split()[0] != "distance":
        hit[2] = random.uniform(-0.2, 0.2)
    way = SPEED * DT * (2 + phase)
    with World(Physics(d), Rotation(), Joints(), settings=Settings(collision=mode, dt=DT)) as world:
        speed = (np.eye(d)[1] * SPEED) if strikes else np.zeros(d)
        shape = BoxCollider(HALF[:d], restitution=e, friction=mu)
        box = world.create_entity(Transform((0, 0, 0)[:d]), RigidBody(mass, speed), shape, Spin())
        other = None
        if kind.endswith("a box"):
            other = world.create_entity(Transform(SECOND[:d]), RigidBody(mass / 2, speed), shape.copy(), Spin())
        add_joint(world, kind, box, other)
        place, aside = hit + np.array((0, RADIUS + way, 0)), np.eye(d)[0] * mu * SPEED
        place[:d] -= aside * DT * (2 + phase)
        body = RigidBody(kind="static") if strikes else RigidBody(1.0, -np.eye(d)[1] * SPEED + aside)
        ball = world.create_entity(
            Transform(tuple(place[:d])), body, SphereCollider(RADIUS, restitution=e, friction=mu),
            *(() if strikes else (Spin(),)),
        )  # fmt: skip
        energy, momentum, impacts = world.kinetic_energy(), world.momentum(), []
        while not impacts and world.step_count < 6:
            world.step()
            impacts = [impact for impact in world.contacts.impacts if ball in (impact.entity_a, impact.entity_b)]
        assert impacts, "no impact is told"
        light = moved_by(kind, mass, hit, d) + (0.0 if strikes else 1.0)
        told = impacts[0].normal_impulse * light / SPEED - 1
        return told, world.kinetic_energy() / energy, np.linalg.norm(world.momentum() - momentum) / SPEED


@pytest.mark.slow
@pytest.mark.parametrize("seed", seeds(1, 60))
@pytest.mark.parametrize(("d", "mode", "kind", "e"), pairwise((2, 3), MODES, KINDS, (0.0, 0.5, 1.0)))
def test_what_joints_hold_is_struck_as_what_they_leave(seed, d, mode, kind, e):
    """Restitution within 3 %; contacts take energy; what is joined freely keeps the momentum. Without restitution a
    discrete world has no impacts."""
    if e == 0.0 and mode == "discrete":
        e = 0.3
    told, energy, momentum = struck(seed, d, mode, kind, e, False)
    assert told == pytest.approx(e, abs=0.03)
    assert energy < 1 + 1e-9
    if kind.endswith("a box"):
        assert momentum < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("seed", seeds(1, 60))
@pytest.mark.parametrize(("d", "mode", "kind", "e"), pairwise((2, 3), MODES, KINDS, (0.3, 1.0)))
def test_rough_impacts_on_what_joints_hold_take_energy(seed, d, mode, kind, e):
    """A ball that comes at a slant, with friction .5."""
    _, energy, momentum = struck(seed, d, mode, kind, e, False, 0.5)
    assert energy < 1 + 1e-9
    if kind.endswith("a box"):
        assert momentum < 1e-9


@pytest.mark.parametrize("seed", seeds(1, 60))
@pytest.mark.parametrize(("d", "mode", "kind", "e"), pairwise((2, 3), MODES, KINDS[4:], (0.3, 1.0)))
def test_what_joints_hold_strikes_as_what_they_leave(seed, d, mode, kind, e):
    """Two boxes fly at a ball that stands."""
    told, energy, _ = struck(seed, d, mode, kind, e, True)
    assert told == pytest.approx(e, abs=0.03)
    assert energy < 1 + 1e-9


@pytest.mark.parametrize(("breaks", "mode"), pairwise((False, True), MODES))
def test_joints_bear_what_they_answer_an_impact_with(breaks, mode):
    """A weld to the world takes all that a ball loses, twice its momentum, in the step of the impact; it breaks where
    that is more than it may bear."""
    with World(Physics(2), Rotation(), joints := Joints(), settings=Settings(collision=mode, dt=DT)) as world:
        box = world.create_entity(Transform((0, 0)), RigidBody(), BoxCollider(HALF[:2], restitution=1.0), Spin())
        force = 2 * SPEED / DT * (0.99 if breaks else 1.01)
        weld = world.create_entity(Weld(None, box, anchor=(0, 0), breaking_force=force))
        place = 0, HALF[1] + RADIUS + 1.5 * SPEED * DT
        ball = RigidBody(linear_velocity=(0, -SPEED)), SphereCollider(RADIUS, restitution=1.0)
        world.create_entity(Transform(place), *ball)
        world.step()
        world.step()
        if breaks:
            assert len(joints) == 0
        else:
            assert joints.state(weld).impulse == pytest.approx((0, 2 * SPEED), abs=1e-9)


@pytest.mark.parametrize("e", [0.5, 1.0])
def test_a_flap_on_its_stop_is_a_wall_from_above_and_a_flap_from_below(e):
    """Gravity presses it on the stop, which holds it against a ball from above and not against one from below."""
    half, lever = np.array((1.0, 0.1)), 1.7
    for side in (1, -1):
        gravity = (0, -G)
        with World(Physics(2, gravity=gravity), Rotation(), Joints(), settings=Settings(dt=1 / 240)) as world:
            box = BoxCollider(half, restitution=e, friction=0)
            flap = world.create_entity(Transform((0, 0)), RigidBody(), box, Spin())
            world.create_entity(Hinge(None, flap, anchor=(-1, 0), limits=(0, 1)))
            for _ in range(60):
                world.step()
            speed, inertia = 6.0, 4 / 3 * half @ half / 4 + 1
            ball = world.create_entity(
                Transform((lever - 1, side * (half[1] + RADIUS + 0.01))), RigidBody(1.0, (0, -side * speed)),
                SphereCollider(RADIUS, restitution=e, friction=0), Spin(),
            )  # fmt: skip
            world.step()
            assert len(world.contacts.impacts) == 1
            light = 1.0 if side == 1 else 1 + lever**2 / inertia
            after = world.component_for_entity(ball, RigidBody).linear_velocity[1]
            assert side * after == pytest.approx(speed * ((1 + e) / light - 1), abs=0.03 * speed)


@pytest.mark.parametrize(("lifted", "joint", "d"), pairwise((1, 2, 3), (Hinge, Distance), (2, 3)))
def test_a_cradle_on_pins_swings_on(lifted, joint, d):
    """Driven by events, 11 s: .95 of the energy of five balls, of which some were lifted."""
    z, length = (0.0,) * (d - 2), 2.0
    settings = Settings(collision="event_driven", dt=DT)
    with World(Physics(d, gravity=(0, -G, *z)), Rotation(), Joints(), settings=settings) as world:
        for k in range(5):
            angle = -0.5 if k < lifted else 0.0
            place = k + length * math.sin(angle), -length * math.cos(angle), *z
            body = RigidBody(), SphereCollider(0.5, restitution=1.0), Spin()
            ball = world.create_entity(Transform(place), *body)
            pin = {"anchor": (k, 0, *z)} if joint is Hinge else {"point_a": (k, 0, *z), "point_b": place}
            pin |= {"axis": (0, 0, 1)} if joint is Hinge and d == 3 else {}
            world.create_entity(joint(None, ball, **pin))

        lowest = -5 * G * length
        start = energy_of(world) - lowest
        for _ in range(round(11 / DT)):
            world.step()
        assert 0.95 * start < energy_of(world) - lowest < 1.02 * start


@pytest.mark.parametrize("seed", seeds(3, 60, known=(12,)))
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("d", [2, 3])
def test_what_circles_strikes_with_its_energy_whenever_in_a_step(d, mode, seed):
    """Without gravity a ball circles about its pin at w and strikes one of e = 1 that hangs beside it. Some
    (w dt)^2 / 4 of the energy goes with 4 substeps, wherever in the step that is; flying freely till then loses .9."""
    random = np.random.default_rng(seed)
    length, w, z = random.uniform(0.4, 1.0), random.uniform(4, 8), (0.0,) * (d - 2)
    lost = []
    for phase in np.arange(5) / 5:
        with World(Physics(d), Rotation(), Joints(), settings=Settings(collision=mode, dt=DT)) as world:
            for k, angle, rate in ((0, -0.8 - phase * w * DT, w), (1, 0.0, 0.0)):
                place = 0.2 * k + length * math.sin(angle), -length * math.cos(angle), *z
                velocity = rate * length * math.cos(angle), rate * length * math.sin(angle), *z
                spin = Spin(angular_velocity=rate if d == 2 else (0, 0, rate))
                body = RigidBody(1.0, velocity), SphereCollider(0.1, restitution=1.0, friction=0.0), spin
                ball = world.create_entity(Transform(place), *body)
                axis = {} if d == 2 else {"axis": (0, 0, 1)}
                world.create_entity(Hinge(None, ball, anchor=(0.2 * k, 0, *z), **axis))
            before, after = 0.0, []
            while len(after) < 5:  # an impact where a step ends bends the way in the next one
                start = world.kinetic_energy()
                world.step()
                if after or len(world.contacts.impacts) > 0:
                    before = before or start
                    after.append(world.kinetic_energy())
            lost.append((1 - after[-1] / before) / (w * DT) ** 2)
    assert min(lost) > 0.0
    assert max(lost) < 0.3
    assert np.ptp(lost) < 0.02


@pytest.mark.parametrize("seed", seeds(12, 200))
@pytest.mark.parametrize("d", [2, 3])
def test_impacts_within_what_ropes_join_keep_momentum(d, seed):
    """Four boxes on a rope and two rods, free: a taut rope answers, or would pull and does not; to rounding."""
    random = np.random.default_rng(seed)
    with World(Physics(d), Rotation(), Joints(), settings=Settings(collision=MODES[seed % 3])) as world:
        boxes = []
        for k in range(4):
            body = RigidBody(random.uniform(0.5, 3), random.normal(0, 1, d))
            spin = random.normal(0, 1) if d == 2 else random.normal(0, 1, 3)
            body = body, BoxCollider((0.4, 0.2, 0.3)[:d], restitution=1), Spin(spin)
            boxes.append(world.create_entity(Transform((1.3 * k, 0, 0)[:d]), *body))
        rope = random.integers(3)
        for k, (a, b) in enumerate(pairwise_of(boxes)):
            world.create_entity(Distance(a, b, length=(0, 1.4) if k == rope else None))
        world.step()
        momentum, size = world.momentum(), (world.bodies.mass @ abs(world.bodies.linear_velocity)).sum()
        for _ in range(250):
            world.step()
        assert abs(world.momentum() - momentum).max() < 1e-12 * size


@pytest.mark.slow
@pytest.mark.parametrize("seed", seeds(1, 60, (3,)))
@pytest.mark.parametrize("mode", MODES)
def test_rings_of_welds_under_stones_gain_no_energy(seed, mode):
    """A house whose welds hold more than once over what they hold, on a floor: no step adds 5e-4 of the energy."""
    random = np.random.default_rng(seed)
    plugins = Physics(2, gravity=(0, -G)), Rotation(), Joints()
    with World(*plugins, settings=Settings(collision=mode)) as world:

        def part(place, half, mass):
            body = Transform(place), RigidBody(mass), BoxCollider(half, friction=0.7), Spin()
            return world.create_entity(*body)

        world.create_entity(Transform((0, -0.5)), BoxCollider((30, 0.5), friction=0.7))
        posts = [part((x, 1.2), (0.15, 1), 25) for x in (-2, 2)]
        floor = [part((x, 0.1), (0.75, 0.1), 30) for x in (-2, -0.5, 1, 2.5)]
        roof = part((0, 2.35), (2.3, 0.15), 25)
        welds = [(*floor[k : k + 2], (1.5 * k - 1.25, 0.1)) for k in range(3)]
        for post, below, x in zip(posts, floor[::2], (-2, 2), strict=True):
            welds += [(below, post, (x, 0.2)), (post, roof, (x, 2.2))]
        for a, b, place in welds:
            world.create_entity(Weld(a, b, anchor=place))
        for k in range(6):
            velocity = random.uniform((-6, -20), (6, 0))
            stone = RigidBody(random.uniform(5, 80), velocity), SphereCollider(0.4, restitution=0.4 * (k % 3))
            world.create_entity(Transform((random.uniform(-2, 2), 4 + 1.5 * k)), *stone, Spin())
        start = last = energy_of(world)
        for _ in range(150):
            world.step()
            assert energy_of(world) < last + 5e-4 * start
            last = energy_of(world)
            assert np.linalg.norm(np.subtract(*plugins[2].anchors()), axis=1).max() < 0.05


@pytest.mark.parametrize("seed", seeds(4, 60))
@pytest.mark.parametrize("mode", MODES[1:])
@pytest.mark.parametrize("d", [2, 3])
def test_a_pin_through_the_middle_leaves_one_motion_for_both_impulses(d, mode, seed):
    """A kinematic ball at v strikes a box that can only turn, x beside its pin, with friction: the first impact gives
    it I (1 + e) v / x^2, and none is rounding over rounding."""
    random = np.random.default_rng(seed)
    e, x = random.uniform(0, 1), random.choice((-1, 1)) * random.uniform(0.1, 0.4)
    inertia = 2.0 / 3 * (HALF[0] ** 2 + HALF[1] ** 2)
    with World(Physics(d), Rotation(), Joints(), settings=Settings(collision=mode)) as world:
        shape = BoxCollider(HALF[:d], friction=1.0, restitution=e)
        box = world.create_entity(Transform((0,) * d), RigidBody(2.0), shape, Spin())
        world.create_entity(Hinge(None, box, anchor=(0,) * d, **({} if d == 2 else {"axis": (0, 0, 1)})))
        along = random.uniform(-2, 2)
        body = RigidBody(linear_velocity=(along, -SPEED, 0)[:d], kind="kinematic")
        way = 0.9 - HALF[1] - RADIUS
        place = (x - along * way / SPEED, 0.9, 0)[:d]
        world.create_entity(Transform(place), body, SphereCollider(RADIUS, friction=1.0, restitution=e))
        told = []
        for _ in range(6):
            world.step()
            told += world.contacts.impacts.normal_impulse.tolist()
        assert told[0] == pytest.approx(inertia * (1 + e) * SPEED / x**2, rel=1e-6)
        assert max(told) < 1e13 * told[0]
        assert np.isfinite(world.kinetic_energy())


@pytest.mark.parametrize("seed", seeds(0, 60, KNOWN_WALLS))
def test_walls_that_joints_hold_gain_nothing_where_they_are_struck(seed):
    """Ropes go slack between what they join, welds are torn, some bodies have all their impacts of a step."""
    rng = np.random.default_rng([seed, 93])
    mode, e, mu = rng.choice(MODES[1:]), rng.choice([0.3, 0.8, 1.0]), rng.choice([0.0, 0.3, 1.0])
    turns, dt = rng.random() < 0.75, rng.choice([1 / 30, 1 / 60, 1 / 240])
    settings = Settings(collision=str(mode), dt=float(dt), substeps=int(rng.choice([1, 4, 8])), on_fault="ignore")
    world = World(Physics(2, gravity=0), Rotation(), Joints(), settings=settings)
    gap, wide, high = rng.choice([0, 0.001, 0.05]), int(rng.integers(2, 5)), int(rng.integers(2, 7))

    def body(place, velocity, mass, radius, round_one):
        box = (BoxCollider if turns else AABBCollider)((radius, radius), restitution=e, friction=mu)
        shape = SphereCollider(radius, restitution=e, friction=mu) if round_one else box
        spin = (Spin(5.0 * rng.normal() if any(velocity) else 0.0),) if turns else ()
        return world.create_entity(Transform(tuple(place)), RigidBody(mass, tuple(velocity)), shape, *spin)

    with world:
        places = [np.array((x, y - high / 2)) * (1 + gap) for x in range(wide) for y in range(high)]
        wall = [body(place, (0, 0), 10 ** rng.uniform(-1, 1), 0.5, rng.random() < 0.5) for place in places]
        for k in range(len(wall) - 1):
            middle, kind = tuple((places[k] + places[k + 1]) / 2), rng.integers(4)
            if kind == 1 or (kind > 1 and not turns):
                length = float(np.linalg.norm(places[k + 1] - places[k]))
                world.create_entity(Distance(wall[k], wall[k + 1], length=(0, length)))
            elif kind > 1:
                world.create_entity((Ball, Weld)[kind - 2](wall[k], wall[k + 1], anchor=middle))
        for k, way in enumerate((1, -1)[: rng.integers(1, 3)]):
            start = (-3.0 if way > 0 else wide + 5.0, rng.uniform(-1, 1))
            speed, mass = way * rng.choice([30, 150]), rng.choice([1, 20, 500])
            body(start, (speed, rng.normal()), mass, (0.3, 1.0)[k], rng.random() < 0.6)
        world.step()
        before, most = world.kinetic_energy(), 0.0
        for _ in range(40):
            world.step()
            most = max(most, world.kinetic_energy())
    assert most <= before * (1 + STRUCK_GAIN), (most / before, mode)


@pytest.mark.slow
@pytest.mark.parametrize("seed", seeds(0, 60, (5004, 5007, 5010)))
@pytest.mark.parametrize("kind", ["hinge", "distance"])
def test_a_flat_floor_has_one_normal(kind, seed):
    """However little a joint leaves of the speed at which they near it, or part from it: 1e-18 m/s."""
    random, mode = np.random.default_rng(seed), MODES[seed % 3]
    settings = Settings(collision=mode, integrator="yoshida4", on_fault="ignore")
    with World(Physics(3, gravity=(0, -G, 0)), Rotation(), Joints(), settings=settings) as world:
        floor = world.create_entity(Transform((0, -1, 0)), RigidBody(kind="static"), BoxCollider((200, 1, 200)))
        balls = []
        for k in range(2):
            at, mass = (0.9 * k, random.uniform(0.8, 2), 0), random.uniform(0.5, 6)
            body = RigidBody(mass, (*random.normal(0, 3, 2), 0))
            collider = SphereCollider(random.uniform(0.2, 0.42), friction=0.0, restitution=0.4)
            spin = (Spin(random.normal(0, 4, 3)),) if kind == "hinge" or seed % 2 else ()
            balls.append(world.create_entity(Transform(at), body, collider, *spin))
        middle = np.mean(world.bodies.position[world.bodies.rows_of(balls)], axis=0)
        world.create_entity(Hinge(*balls, anchor=middle, axis=(0, 0, 1)) if kind == "hinge" else Distance(*balls))
        for _ in range(200):
            world.step()
            for contact in world.contacts.of(floor):
                assert abs(contact.normal[1]) > 1 - 1e-12
