"""Columns of components that stages of plugins see: as rows come, go and move, in snapshots, and in steps that fail."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_steps import both_ways  # noqa: F401  every test with each

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Component, Plugin, PluginError, Settings, StepError, System, World, column
from carom.framework.vectors import add
from carom.plugins import Physics


class Aging(Component):
    """How many steps it has taken part in, and the sum of its velocities."""

    age = column(0, dtype=int)
    rate = column(1.0, minimum=0.0)
    travel = column(0.0, item="vector")
    old = column(False, dtype=bool)
    turned = column(0.0, item="rotation")


def aging(**more):
    plugin = Plugin("aging")
    writes = ("aging.age", "aging.travel", "aging.old")

    reads = ("sleep_state", "linear_velocity", "aging.rate")

    @plugin.stage(after="put_back", records=(Aging,), reads=reads, writes=writes)
    def grow_old(state, dt, aging):
        """What takes part in a step gets older"""
        for i in range(state.first, state.dynamic):
            if aging.present[i] and state.bodies.sleep_state[i] == 0:
                aging.age[i] += 1
                aging.travel[i] = add(aging.travel[i], state.bodies.linear_velocity[i])
                aging.old[i] = aging.rate[i] * aging.age[i] > 5.0

    return plugin


def world_of(*plugins, d=2, **settings):
    return World(Physics(dimensions=d, gravity=(0.0,) * d), *plugins, settings=Settings(**settings))


@pytest.mark.slow
@pytest.mark.parametrize("d", [2, 3])
def test_rows_that_come_go_and_move_keep_their_values(d):
    """The same by entity in Python, over bodies made one by one and in bulk, deleted, and of changing kinds."""
    random, expected = np.random.default_rng(3), {}
    with world_of(aging(), d=d) as world:
        for step in range(40):
            place = random.uniform(-1e3, 1e3, d)
            if step % 2:
                one = world.create_entity(Transform(place), RigidBody(), Aging(age=step))
                expected[one] = step
                world.create_entity(Transform(place), RigidBody())
            if step % 8 == 0:  # also more than there is room for
                many = world.create_entities(
                    30, Transform.many(random.uniform(-1e3, 1e3, (30, d))), RigidBody.many(),
                    Aging.many(age=np.arange(30)),
                )  # fmt: skip
                expected.update(zip(many, range(30), strict=True))
            for entity in random.permutation(list(expected))[:3].tolist():
                kind = world.component_for_entity(entity, RigidBody).kind
                if kind == "kinematic":
                    world.delete_entity(entity, immediate=True)
                    del expected[entity]
                else:
                    world.component_for_entity(entity, RigidBody).kind = "kinematic"
            world.step()
            for entity in expected:
                if world.component_for_entity(entity, RigidBody).kind == "dynamic":
                    expected[entity] += 1
            assert {e: h.age for e, h in world.get_component(Aging)} == expected
        there = world.bodies.has(Aging)
        found = dict(zip(world.bodies.entity[there].tolist(), world.bodies.aging.age[there].tolist(), strict=True))
        assert found == expected
        assert not world.bodies.aging.age[~there].any()


@pytest.mark.parametrize("d", [2, 3])
def test_columns_of_every_kind_are_read_and_written(d):
    plugin = Plugin("kinds")

    class Kinds(Component):
        number = column(1.5)
        count = column(2, dtype=int)
        flag = column(True, dtype=bool)
        arrow = column(0.25, item="vector")
        turn = column(0.0, item="rotation")
        mood = column("calm", choices=("calm", "wild"))

    names = ("number", "count", "flag", "arrow", "mood")

    @plugin.stage(before="close_step", records=(Kinds,), writes=tuple(f"kinds.{name}" for name in names))
    def change(state, dt, kinds):
        for i in range(state.first, state.moving):
            kinds.number[i] *= 2.0
            kinds.count[i] -= 5
            kinds.flag[i] = not kinds.flag[i]
            kinds.arrow[i] = add(kinds.arrow[i], kinds.arrow[i])
            kinds.mood[i] = 1

    if d == 2:

        @plugin.stage(before="close_step", records=(Kinds,), writes=("kinds.turn",))
        def turn(state, dt, kinds):
            kinds.turn[0] += 0.5

    else:

        @plugin.stage(before="close_step", records=(Kinds,), writes=("kinds.turn",))
        def turn(state, dt, kinds):
            kinds.turn[0, 0], kinds.turn[0, 3] = 0.0, 1.0

    with world_of(plugin, d=d) as world:
        entity = world.create_entity(Transform((0.0,) * d), RigidBody(), Kinds())
        world.step()
        kinds = world.component_for_entity(entity, Kinds)
        assert (kinds.number, kinds.count, kinds.flag, kinds.mood) == (3.0, -3, False, "wild")
        assert kinds.arrow.tolist() == [0.5] * d
        assert np.asarray(kinds.turn).tolist() == (0.5 if d == 2 else [0.0, 0.0, 0.0, 1.0])


def test_a_stage_gives_the_bits_of_a_system():
    class Age(System):
        def process(self, dt):
            bodies = self.world.bodies.dynamic
            bodies.aging.age += 1
            bodies.aging.travel += bodies.linear_velocity
            bodies.aging.old = bodies.aging.rate * bodies.aging.age > 5.0

    hashes = []
    for plugins in ((aging(),), ()):
        with world_of(*plugins) as world:
            world.create_entities(
                10, Transform.many(np.arange(20.0).reshape(10, 2)),
                RigidBody.many(linear_velocity=np.full((10, 2), 0.1)), Aging.many(rate=np.linspace(0, 2, 10)),
            )  # fmt: skip
            if not plugins:
                world.add_system(Age())
            for _ in range(9):
                world.step()
            hashes.append(world.state_hash())
    assert hashes[0] == hashes[1]


def test_a_stage_runs_where_some_body_has_its_components():
    with world_of(aging()) as world:
        bare = world.create_entity(Transform((0, 0)), RigidBody(), SphereCollider(1.0))
        other = world.create_entity(Transform((5, 0)), RigidBody(), SphereCollider(1.0))
        world.step()
        assert "grow_old" not in str(world.plan())
        world.add_component(bare, Aging())
        for _ in range(3):
            world.step()
        assert "plugin aging: What takes part in a step gets older" in str(world.plan())
        assert world.component_for_entity(bare, Aging).age == 3
        world.remove_component(bare, Aging)
        world.add_component(other, Aging(7))
        world.step()
        assert world.component_for_entity(other, Aging).age == 8
        world.delete_entity(other)
        world.step()
        assert "grow_old" not in str(world.plan())


def test_snapshots_and_files_hold_the_columns(tmp_path):
    with world_of(aging()) as world:
        world.create_entities(5, Transform.many(np.zeros((5, 2))), RigidBody.many(), Aging.many(age=np.arange(5)))
        for _ in range(4):
            world.step()
        snapshot = world.snapshot()
        world.save(tmp_path / "world")
        world.create_entity(Transform((9, 9)), RigidBody(), Aging(100))
        for _ in range(4):
            world.step()
        world.restore(snapshot)
        assert world.bodies.aging.age.tolist() == [4, 5, 6, 7, 8]
        for _ in range(3):
            world.step()
        with World.load(tmp_path / "world", Physics(dimensions=2), aging()) as other:
            for _ in range(3):
                other.step()
            assert other.state_hash() == world.state_hash()
            assert other.bodies.aging.age.tolist() == [7, 8, 9, 10, 11]


def test_a_failed_step_puts_the_columns_back():
    plugin = aging()

    @plugin.stage(after="publish_contacts")
    def fail(state, dt):
        if state.step_number == 3 and state.count > 2:
            raise ValueError("too many")

    with world_of(plugin) as world:
        for k in range(2):
            world.create_entity(Transform((10 * k, 0)), RigidBody(linear_velocity=(1, 2)), SphereCollider(1.0), Aging())
        for _ in range(3):
            world.step()
        before = world.bodies.aging.travel.copy()
        late = world.create_entity(Transform((50, 0)), RigidBody(linear_velocity=(1, 1)), Aging(20))
        for _ in range(2):
            with pytest.raises(StepError, match="plugin aging: stage fail: ValueError: too many"):
                world.step()
            assert world.bodies.aging.age.tolist() == [3, 3, 20]
            np.testing.assert_array_equal(world.bodies.aging.travel, [*before.tolist(), [0.0, 0.0]])
            assert not world.bodies.aging.old.any()
        world.delete_entity(late)
        world.step()
        assert world.bodies.aging.age.tolist() == [4, 4]


def resting(*plugins):
    """Two boxes a way apart that fall asleep, and what a stage does to them."""
    world = World(Physics(dimensions=2, gravity=(0, -9.81)), *plugins, settings=Settings(sleeping=True))
    world.create_entity(Transform((0, -1)), AABBCollider((50, 1)))
    boxes = [
        world.create_entity(Transform((x, 0.5)), RigidBody(), AABBCollider((0.5, 0.5)), Aging()) for x in (-20.0, 20.0)
    ]
    for _ in range(60):
        world.step()
    assert world.bodies.dynamic.asleep.all()
    return world, boxes


def test_what_sleeps_is_left_alone_also_in_steps_in_which_others_wake():
    world, (one, two) = resting(aging())
    with world:
        asleep = world.component_for_entity(one, Aging).age
        for _ in range(10):
            world.step()
        assert world.component_for_entity(one, Aging).age == asleep
        world.component_for_entity(two, RigidBody).linear_velocity = (0.0, 3.0)
        for _ in range(10):
            world.step()
        assert world.component_for_entity(one, Aging).age == asleep
        assert world.component_for_entity(two, Aging).age > asleep + 5


@pytest.mark.parametrize("written", ["aging.rate", "aging.age"])
def test_what_stages_name_wakes_what_sleeps_when_it_is_written_in_place(written):
    world, (one, two) = resting(aging())
    with world:
        values = getattr(world.bodies.aging, written.rpartition(".")[2])
        world.step()
        values[world.bodies.row_of(one)] = 3
        world.step()
        asleep = dict(zip(world.bodies.entity.tolist(), world.bodies.asleep.tolist(), strict=True))
        assert asleep[two]
        assert not asleep[one]


def bare(state, dt, aging):
    pass


def uses_rate(state, dt, aging):
    aging.rate[0] = 1.0


@pytest.mark.parametrize(
    ("function", "options", "message"),
    [
        (bare, {"records": (Aging,), "reads": ("aging.ages",)}, "no record has 'aging.ages' .did you mean 'aging.age'"),
        (bare, {"records": (Aging,), "reads": ("thermal.heat",)}, "no record has 'thermal.heat'"),
        (uses_rate, {"records": (Aging,)}, "it uses rate, and names it neither in reads nor in writes"),
        (bare, {"records": (SphereCollider,), "writes": ("sphere_collider.radius",)}, "is for reading only"),
        (bare, {"records": (Aging,), "writes": ("aging.age",), "after": "test_few"}, "may run several times in a step"),
    ],
)
def test_columns_that_a_stage_cannot_have_are_refused_by_name(function, options, message):
    plugin = Plugin("wrong")
    plugin.stage(**{"after": "put_back", **options})(function)
    with pytest.raises(PluginError, match=f"plugin wrong: stage {function.__name__}, after='.*{message}"):
        World(Physics(dimensions=2), plugin)


@pytest.mark.parametrize("records", [Aging, (RigidBody,), (Component,), ("aging",), (3,)])
def test_records_are_component_types_of_ones_own(records):
    with pytest.raises(PluginError, match="plugin wrong: stage bare: records takes a tuple of component types of your"):
        Plugin("wrong").stage(after="put_back", records=records)(bare)


def test_the_function_takes_a_record_for_each_component():
    with pytest.raises(PluginError, match=r"takes \(state, dt, aging\), it must take 2 arguments: \(state, dt\)"):
        Plugin("wrong").stage(after="put_back")(bare)


def test_a_shape_has_columns_that_can_be_read():
    plugin = Plugin("weight")

    @plugin.stage(after="put_back", records=(SphereCollider,), reads=("sphere_collider.radius",), writes=("mass",))
    def weigh(state, dt, sphere_collider):
        for i in range(state.first, state.dynamic):
            if sphere_collider.present[i]:
                state.bodies.mass[i] = 2.0 * sphere_collider.radius[i]

    with world_of(plugin) as world:
        world.create_entity(Transform((0, 0)), RigidBody(), AABBCollider((1, 1)))
        world.create_entity(Transform((9, 0)), RigidBody(), SphereCollider(1.5))
        world.step()
        assert world.bodies.mass.tolist() == [1.0, 3.0]
