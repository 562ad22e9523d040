"""Bodies with values that cannot be: named once, taken out, and all others go on to the bit as if they were deleted."""

from __future__ import annotations

import math
import pickle

import esper
import numpy as np
import pytest
from world.helpers_poison import column_of, complaints, rest_of, scenes, told
from worlds import METHODS, MODES, ball, both_dimensions, box, make_world, mostly_2d, position, run, velocity

from carom.components import RigidBody, SphereCollider, Transform
from carom.framework import ForceSystem, Phase, System, World
from carom.plugins import Physics

pytestmark = pytest.mark.plain

each_mode = pytest.mark.parametrize("mode", MODES)
WRONG = {
    "position": math.nan, "linear_velocity": math.inf, "mass": -1.0, "rotation": math.nan, "constant_force": math.inf,
    "gravity_scale": math.nan, "linear_damping": -1.0, "max_linear_speed": -1.0, "step_force": -math.inf,
    "sphere_collider.radius": math.nan, "sphere_collider.restitution": math.nan, "sphere_collider.friction": -1.0,
    "sphere_collider.offset": math.inf,
}  # fmt: skip
WRONG_BOX = {"position": math.nan, "aabb_collider.half_extents": math.nan, "aabb_collider.restitution": math.nan}


VICTIM, STILL, LIFT = 7, 14, 15  # in a pile


def pile(d=2, mode="discrete", gravity=9.81, restitution=0.4, **settings):
    """Balls and boxes that lie on each other, a few of which still move, with a ball as VICTIM in their middle; beside
    them a STILL box and a LIFT with a ball on each.
    """
    world = make_world(d, gravity, collision=mode, **settings)
    up = 1 if d > 1 else 0
    ground = [0.0] * d
    ground[up] = -0.5
    box(world, tuple(ground), half=(9.0, 0.5, 9.0)[:d], kind="static", friction=0.5)
    for k in range(12):
        place = np.array((0.98 * (k % 4), 0.5 + 0.98 * (k // 4), 0.01 * k)[:d])
        speed = np.array((0.5 - 0.1 * k, 0.2 * (k % 3), 0.05)[:d])
        make = ball if k % 2 else box
        make(world, tuple(place), tuple(speed), mass=1.0 + k % 3, restitution=restitution, friction=0.3)
    for x, kind in ((5.0, "static"), (-3.0, "kinematic")):
        box(world, (x, 1.0, 0.0)[:d], kind=kind)
    for x in (5.2, -2.8):
        ball(world, (x, 2.0, 0.0)[:d])
    return world


def write(world, name, value, entity=VICTIM):
    column_of(world, name)[world.bodies.row_of(entity)] = value


def rests(world, entity, steps):
    """After each of so many steps: all but that entity."""
    found = []
    for _ in range(steps):
        world.step()
        found.append(rest_of(world, entity))
    return found


def assert_like_deleted(broken, healthy, steps=8, entity=VICTIM):
    healthy.delete_entity(entity)
    for step in range(steps):
        broken.step()
        healthy.step()
        assert rest_of(broken, entity) == rest_of(healthy, entity), f"step {step}"


@pytest.mark.slow
@mostly_2d
@each_mode
@pytest.mark.compiled
def test_others_go_on_as_if_it_was_deleted(d, mode):
    """Wherever the value stands, and whatever it is, in a body of any kind; the fault names entity and field, once."""
    cases = {VICTIM: WRONG} | dict.fromkeys((STILL, LIFT), WRONG_BOX)
    for entity, wrong in cases.items():
        healthy = pile(d, mode)
        run(healthy, 10)
        healthy.delete_entity(entity)
        expected = rests(healthy, entity, 6)
        for name, value in wrong.items():
            broken = pile(d, mode)
            run(broken, 10)
            write(broken, name, value, entity)
            found = rests(broken, entity, 6)
            assert found == expected, (entity, name)
            (fault,) = told(broken)
            assert fault.startswith(f"entity {entity}: {name} is ")
            assert all(np.isfinite(np.frombuffer(part)).all() for part in found[-1])


@pytest.mark.slow
@pytest.mark.parametrize(
    "settings",
    [
        *({"gravity": gravity, "integrator": method} for gravity in (0.0, 9.81) for method in METHODS),
        {"restitution": 0.0},
    ],
    ids=str,
)
@pytest.mark.compiled
def test_with_every_integrator_and_without_forces_or_bounces(settings):
    """A field that decides what a step computes for all bodies says nothing while its body is out."""
    decide = "constant_force", "linear_damping", "max_linear_speed", "rotation", "mass", "sphere_collider.restitution"
    healthy = pile(**settings)
    run(healthy, 3)
    healthy.delete_entity(VICTIM)
    expected = rests(healthy, VICTIM, 8)
    for name in decide:
        broken = pile(**settings)
        run(broken, 3)
        write(broken, name, WRONG[name])
        assert rests(broken, VICTIM, 8) == expected, name


@pytest.mark.slow
@both_dimensions
@each_mode
@pytest.mark.compiled
def test_a_sum_of_forces_that_is_infinite(d, mode):
    """Found only within the step: the body touches nobody in it. Without the force it takes part again."""

    class Push(ForceSystem):
        force = 0.0

        def add_forces(self, bodies, time):
            if self.force:
                bodies.force[bodies.row_of(VICTIM)] += self.force

    broken, healthy = pile(d, mode), pile(d, mode)
    push = Push()
    broken.add_system(push)
    healthy.add_system(Push())
    run(broken, 10)
    run(healthy, 10)
    before, push.force = position(broken, VICTIM).copy(), math.inf
    assert_like_deleted(broken, healthy)
    (fault,) = told(broken)
    assert fault.startswith(f"entity {VICTIM}: force is [inf")
    np.testing.assert_array_equal(position(broken, VICTIM), before)
    push.force = 0.0
    run(broken, 3)
    assert (position(broken, VICTIM) != before).any()


@pytest.mark.slow
@each_mode
@pytest.mark.compiled
def test_what_a_system_of_the_game_writes(mode):
    """Within the step too: START comes after the look at all columns."""

    class Spoil(System):
        phase = Phase.START
        field = ""

        def process(self, dt):
            if self.field:
                write(self.world, self.field, WRONG[self.field])

    for name in ("mass", "linear_velocity", "sphere_collider.restitution", "sphere_collider.radius"):
        broken, healthy = pile(mode=mode), pile(mode=mode)
        spoils = Spoil(), Spoil()
        for world, spoil in zip((broken, healthy), spoils, strict=True):
            world.add_system(spoil)
            run(world, 6)
        spoils[0].field = name
        assert_like_deleted(broken, healthy)
        assert len(told(broken)) == 1


def spoil_before(world):
    collider = SphereCollider(0.5)
    world.add_component(VICTIM, collider)
    world.remove_component(VICTIM, SphereCollider)
    collider.offset[0] = math.nan
    world.add_component(VICTIM, collider)


VIEWS = {  # of one row, of a handle that is bound later, of one kind
    "constant_force": lambda w: w.component_for_entity(VICTIM, RigidBody).constant_force.__setitem__(0, math.nan),
    "sphere_collider.offset": spoil_before,
    "mass": lambda w: w.bodies.dynamic.mass.__setitem__(w.bodies.row_of(VICTIM), -1.0),
    "rotation": lambda w: w.component_for_entity(VICTIM, Transform).rotation.__setitem__(slice(None), 0.0),
}


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("field", VIEWS)
def test_a_view_of_one_row_or_of_one_kind(field, tmp_path):
    """The step looks at columns of which code has had a view, whatever kind of view; also in a world that was saved."""
    d = 3 if field == "rotation" else 2
    healthy = pile(d)
    run(healthy, 3)
    for way in ("as it is", "restored", "loaded"):
        broken = pile(d)
        run(broken, 3)
        VIEWS[field](broken)
        if way == "restored":
            snapshot = pickle.loads(pickle.dumps(broken.snapshot()))
            broken = pile(d)
            broken.restore(snapshot)
        if way == "loaded":
            broken.save(tmp_path / "spoilt")
            broken = World.load(tmp_path / "spoilt", Physics(dimensions=d))
        state = healthy.snapshot()
        assert_like_deleted(broken, healthy, steps=3)
        healthy.restore(state)
        (fault,) = told(broken)
        assert fault.startswith(f"entity {VICTIM}: {field} is "), way


@pytest.mark.compiled
def test_many_among_many():
    """More than a list of faults holds, in a world with a grid: each is named, once."""
    random = np.random.default_rng(3)
    worlds = [make_world(), make_world()]
    places, speeds = random.uniform(-30, 30, (400, 2)), random.normal(size=(400, 2))
    for world in worlds:
        world.create_entities(
            400, Transform.many(places), RigidBody.many(linear_velocity=speeds),
            SphereCollider.many(radius=0.5, restitution=1.0),
        )  # fmt: skip
        run(world, 2)
    broken, healthy = worlds
    gone = broken.bodies.entity[::3].copy()
    broken.bodies.mass[::3] = -1.0
    for entity in gone.tolist():
        healthy.delete_entity(entity)
    named = set()
    for _ in range(5):
        run(broken, 1)
        run(healthy, 1)
        named.update(told(broken))
        broken.faults.clear()
    assert len(named) == 100  # as many as are kept: each was named in the first step, none again
    stay = ~np.isin(broken.bodies.entity, gone)
    np.testing.assert_array_equal(broken.bodies.position[stay], healthy.bodies.position)


@pytest.mark.compiled
def test_it_stands_still_until_it_is_mended():
    world = make_world(gravity=9.81)
    box(world, (0.0, -0.5), half=(9.0, 0.5), kind="static")
    a = ball(world, (0.0, 3.0), (1.0, 0.0))
    run(world, 2)
    before, speed = position(world, a).copy(), velocity(world, a).copy()
    for _ in range(2):
        world.bodies.mass[world.bodies.row_of(a)] = -1.0
        run(world, 30)
        np.testing.assert_array_equal(position(world, a), before)
        np.testing.assert_array_equal(velocity(world, a), speed)
        assert world.query_nearest(before, max_distance=1.0) is None
        assert len(told(world)) == 1
        world.bodies.mass[world.bodies.row_of(a)] = 1.0
        run(world, 1)
        assert (position(world, a) != before).any()
        before, speed = position(world, a).copy(), velocity(world, a).copy()
    run(world, 60)
    assert position(world, a)[1] == pytest.approx(0.5, abs=1e-2)  # it lies on the floor
    world.faults.clear()
    world.bodies.mass[world.bodies.row_of(a)] = math.nan
    run(world, 3)
    assert len(told(world)) == 1  # it is told anew after it was right


def test_ids_that_mean_other_entities():
    """After esper.clear_database() the ids begin again: the new body is none of those that were out."""
    world = make_world()
    for named in (1, 2):
        a = ball(world, 0.0, 1.0)
        run(world, 2)
        world.bodies.mass[:] = -1.0
        run(world, 2)
        assert len(told(world)) == 1
        assert "quarantined" in {column.column for column in world.plan().columns}
        world.faults.clear()
        if named == 1:
            with world:
                esper.clear_database()
            b = ball(world, 0.0, 1.0)
            assert b == a
            run(world, 3)
            assert told(world) == []
            assert position(world, b)[0] > 0.0
            world.delete_entity(b)


@both_dimensions
@each_mode
def test_too_far_from_the_origin_to_move(d, mode):
    """At 1e15 m numbers are 0.125 m apart, and a step of 1 m/s is 0.017 m: told once, for each axis that is lost."""
    world = make_world(d, collision=mode)
    still = ball(world, (1e15, 5.0, 0.0)[:d])
    lost = ball(world, (1e15, 0.0, 0.0)[:d], (1.0, 2.0, 0.0)[:d])
    near = ball(world, (1e9, 0.0, 0.0)[:d], (1.0, 0.0, 0.0)[:d])
    slow = ball(world, (5.0, 0.0, 0.0)[:d], (1e-18, 0.0, 0.0)[:d])  # does not move either, and should not by much
    fast = ball(world, (1e15, 50.0, 0.0)[:d], (100.0, 0.0, 0.0)[:d])
    for _ in range(5):
        world.step()
    (fault,) = told(world)
    assert fault.startswith(f"entity {lost}: too far from the origin to move: at [1000000000000000.0, ")
    assert "0.125 m apart" in fault
    assert position(world, lost)[0] == 1e15
    assert position(world, lost)[1] > 0.1
    assert position(world, fast)[0] > 1e15
    assert position(world, near)[0] > 1e9
    assert position(world, slow)[0] == 5.0
    assert position(world, still)[0] == 1e15


# Each mode takes every second or third body, each mode others. The flat worlds wait for the long run:
# jit/test_checked_build.py does the same with them; of those in 3D every fifth body does.
SHARES = {"mixed 2D": 3, "mixed 3D": 8, "platformer": 1, "tumbling 2D": 2, "tumbling 3D": 8}


def cases():
    for name, build in scenes():
        kind, _, mode = name.rpartition(" ")
        first, share = MODES.index(mode), SHARES[kind]
        for part in range(2):
            marks = [pytest.mark.slow, pytest.mark.compiled]
            marks += [pytest.mark.long] * (part or "3D" not in name or mode == "continuous")
            victims = slice(first % share + part * share, None, 2 * share)
            yield pytest.param(build, victims, first, id=f"{name} {part}", marks=marks)


@pytest.mark.early
@pytest.mark.parametrize(("build", "victims", "first"), list(cases()))
def test_values_that_cannot_be_in_every_column_of_every_body(build, victims, first):
    """nan, inf, -inf and -1: others stay finite, and as if it was deleted if a fault names the body."""
    assert list(complaints(build, victims, first)) == []
