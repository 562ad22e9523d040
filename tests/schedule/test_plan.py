"""world.plan(): what it lists is what runs and what is allocated, and nothing else."""

from __future__ import annotations

import gc

import esper
import numpy as np
import pytest
from worlds import ball, floor, make_world, run

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import ForceSystem, Phase, Plugin, Settings, System, World
from carom.framework.compilation import kernel, time_calls, timing
from carom.framework.jit.records.record import Record
from carom.framework.jit.records.schema import Scalar
from carom.framework.schedule.plan import PlannedKernel
from carom.plugins import Physics, capsule
from carom.systems.broad_phase.brute_force import BRUTE_FORCE_MAX

STEPS = 15
COUNT = 150  # bodies created at once, more than the capacity of a new table: exactly that many rows


@kernel
def push(force):
    for i in range(len(force)):
        force[i, 0] += 1.0


class Push(ForceSystem):
    def add_forces(self, bodies, time):
        push(bodies.force)

    def kernels(self):
        yield PlannedKernel("push", "one newton along x")


class Nudge(System):
    phase = Phase.START

    def process(self, dt):
        pass


def flying(*systems, kind="dynamic", **settings):
    world = make_world(**settings)
    world.create_entity(Transform((0.0, 0.0)), RigidBody(kind=kind, linear_velocity=(1.0, 1.0)))
    for system in systems:
        world.add_system(system())
    return world


def falling(d=2, **material):
    """A ball falls two centimetres onto the floor, another one eight."""
    world = make_world(d, gravity=9.81)
    floor(world)
    ball(world, (0.0, 0.52, 0.0)[:d], (1.0, 0.0, 0.0)[:d], **material)
    ball(world, (5.0, 0.58, 0.0)[:d], **material)
    return world


def with_levels():
    world = falling()
    world.create_entity(Transform((9.0, 0.52)), RigidBody(), SphereCollider(0.8), AABBCollider(0.5))
    return world


def with_plugin():
    world = World(Physics(gravity=(0, -9.81)), capsule.plugin)
    world.create_entity(Transform((0.0, 0.0)), capsule.CapsuleCollider(0.5, 0.5))
    world.create_entity(Transform((0.0, 2.02)), RigidBody(), capsule.CapsuleCollider(0.5, 0.5))
    return world


def crowd(count, still=0, radii=(0.5,)):
    world = make_world()
    for k in range(count + still):
        x, y = divmod(k, 30)
        kind = "dynamic" if k < count else "static"
        ball(world, (1.2 * x, 1.2 * y), radius=radii[k % len(radii)], kind=kind)
    return world


SCENES = {  # the scene, a kernel that must be in its plan, and one that must not
    "nothing": (make_world, "close_step", "drift"),
    "a kinematic body": (lambda: flying(kind="kinematic"), "close_step", "drift"),
    "free flight": (lambda: flying(gravity=9.81, integrator="explicit_euler"), "explicit_euler", "box_motions"),
    "a system": (lambda: flying(Nudge), "copy_blocks", "verlet_drift"),
    "forces": (lambda: flying(Push, integrator="rk4"), "runge_kutta_stage", "verlet_drift"),
    "forces, Yoshida": (lambda: flying(Push, integrator="yoshida4"), "verlet_kick", "runge_kutta_stage"),
    "bounces": (lambda: falling(restitution=0.5, friction=0.5), "evaluate_pairs", "evaluate_levels"),
    "rest, 3D": (lambda: falling(3), "solve_contacts", "run_tree_pass"),
    "levels": (with_levels, "evaluate_levels", "run_tree_pass"),
    "a plugin's shape": (with_plugin, "evaluate_pairs", "search_uniform_grid"),
    "two grids": (lambda: crowd(BRUTE_FORCE_MAX + 8, BRUTE_FORCE_MAX + 50), "search_static_grid", "run_tree_pass"),
    "a tree": (lambda: crowd(BRUTE_FORCE_MAX + 8, radii=(0.5, 0.02, 20.0)), "run_tree_pass", "evaluate_levels"),
}


def record_calls(world, steps):
    """(system, name) of the stages that ran in each step and of the kernels called from Python, compiling included."""
    taken, physics = [], world.physics

    def record(name, nanoseconds, compiled):
        taken[-1].add((world._pipeline.at, name))

    time_calls(record)
    try:
        for _ in range(steps):
            taken.append(set())
            before = physics.program.counts()[0]
            world.step()
            for k in np.flatnonzero(physics.program.counts()[0] - before).tolist():
                taken[-1].add((physics.system_of_stage(k), physics.program.stages[k].name))
    finally:
        time_calls(None)
    return taken


def planned(plan, always=False):
    """The same from the plan; ``always``: only what is called in every step."""
    found = {(entry.system, k.kernel) for entry in plan.entries for k in entry.kernels if not (always and k.when)}
    return found | {("", k.kernel) for k in plan.around if not (always and k.when)}


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_the_kernels_that_run_are_those_of_the_plan(name):
    build, there, absent = SCENES[name]
    with build() as world:
        before = world.plan()
        steps = record_calls(world, STEPS)
        plan = world.plan()
        assert set.union(*steps) == planned(plan)
        assert all(planned(plan, always=True) <= taken for taken in steps)
        if name != "a tree":  # a grid is tried first
            assert planned(before) == planned(plan)
        names = {call.kernel for call in plan.kernels}
        assert there in names
        assert absent not in names
        assert [(entry.system, entry.priority) for entry in plan.entries] == [
            (system.name, system.priority) for system in world.systems
        ]
        text = " ".join(str(plan).split())
        assert all(call.reason and call.kernel in text for call in plan.kernels)
        assert all(array.name in text for array in plan.columns)


@pytest.mark.plain
def test_integrators_of_plugins_name_their_kernels():
    plugin = Plugin("flights")

    @plugin.integrator("named")
    class Named:
        order, evaluations, path = 1, 1, 1

        def advance(self, motion, dt):
            motion.position += dt * motion.velocity

        def kernels(self, force_changes):
            return ("mine",)

    world = World(Physics(), plugin, settings=Settings(integrator="named"))
    world.create_entity(Transform((0.0, 0.0)), RigidBody())
    assert "mine" in {call.kernel for call in world.plan().kernels}


@pytest.mark.plain
def test_what_comes_later_is_in_the_plan_at_once():
    world = flying()
    assert "evaluate_pairs" not in {call.kernel for call in world.plan().kernels}
    entity = ball(world, (9.0, 9.0))
    assert "evaluate_pairs" in {call.kernel for call in world.plan().kernels}
    world.settings = world.settings.replace(integrator="velocity_verlet")
    assert "verlet_drift" in {call.kernel for call in world.plan().kernels}
    world.delete_entity(entity, immediate=True)
    assert "evaluate_pairs" not in {call.kernel for call in world.plan().kernels}


def profiled(world):
    """A step in a block that raises."""

    def block():
        with world.profile():
            world.step()
            assert timing()
            raise ValueError("the game's own")

    with pytest.raises(ValueError, match="the game's own"):
        block()
    assert not timing()


LOOKS = {
    "plan": lambda world: str(world.plan()),
    "prepare": lambda world: world.prepare(AABBCollider),
    "profile": profiled,
    "register": lambda world: world.register(capsule.CapsuleCollider),
    "state": lambda world: (world.snapshot(), world.state_hash(), world.kinetic_energy()),
    "query": lambda world: world.query_sphere((0.0, 1.0), 3.0),
    "print": lambda world: (repr(world), str(world.stats()), repr(world.bodies)),
}


@pytest.mark.parametrize("how", LOOKS)
def test_who_only_looks_changes_nothing(how):
    """No state, no counts, no faults, no esper context; and the step goes on with the same bits."""
    one, other = falling(restitution=0.5), falling(restitution=0.5)
    for world in (one, other):
        world.add_plugin(capsule.plugin)
        run(world, 3)
    gc.collect()  # worlds of other tests leave now, not meanwhile
    contexts = esper.current_world, set(esper.list_worlds())
    for _ in range(STEPS):
        before, forces = one.state_hash(), one.bodies.force.copy()
        LOOKS[how](one)
        steps = int(how == "profile")
        if not steps:
            assert one.state_hash() == before
            np.testing.assert_array_equal(one.bodies.force, forces)
        run(one, 1)
        run(other, 1 + steps)
        assert (one.state_hash(), one.step_count, one.faults) == (other.state_hash(), other.step_count, [])
    assert one.stats().counters == other.stats().counters
    assert (esper.current_world, set(esper.list_worlds())) == contexts


def test_forces_are_not_summed_where_none_acts():
    """The column is zero all the same, and forces applied later count; also those left by a user system."""
    world = make_world()
    entity = world.create_entity(Transform((0.0, 0.0)), RigidBody())
    body = world.component_for_entity(entity, RigidBody)
    body.apply_force((60.0, 0.0))
    world.step()
    np.testing.assert_array_equal(world.bodies.force, [[60.0, 0.0]])
    np.testing.assert_allclose(body.linear_velocity, [1.0, 0.0], rtol=1e-15)
    for _ in range(2):
        world.step()
        np.testing.assert_array_equal(world.bodies.force, [[0.0, 0.0]])
        np.testing.assert_allclose(body.linear_velocity, [1.0, 0.0], rtol=1e-15)
    assert world.stats().counters["force_evaluations"] == 1

    class Wind(System):
        phase = Phase.FORCES

        def process(self, dt):
            self.world.bodies.force[:] += 60.0

    wind = Wind()
    world.add_system(wind)
    world.step()
    np.testing.assert_allclose(body.linear_velocity, [2.0, 1.0], rtol=1e-15)
    world.remove_system(wind)
    world.step()
    np.testing.assert_allclose(body.linear_velocity, [2.0, 1.0], rtol=1e-15)


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["explicit_euler", "semi_implicit_euler", "velocity_verlet", "rk4", "yoshida4"])
@pytest.mark.parametrize("damping", [0.0, 0.7])
def test_drifting_gives_the_bits_of_the_integrator(integrator, damping):
    """A user system that does nothing makes carom take the general path."""
    worlds = [flying(*systems, integrator=integrator) for systems in ((), (Nudge,))]
    for world in worlds:
        body = RigidBody(3.0, (0.7, -1e-9), linear_damping=damping)
        world.create_entity(Transform((1 / 3, 0.1)), body, SphereCollider(0.5))
        for _ in range(STEPS):
            world.step()
    assert worlds[0].state_hash() == worlds[1].state_hash()


def arrays_per_body(world):
    """Of all arrays with a row for each body, reached from the world's physics; those of grids have some to spare."""
    rows, found, seen = {world.physics.table.capacity, world.physics.state.grid.rows_of("keys")}, {}, set()
    todo = [world.physics, world.physics.table, *world.systems]
    while todo:
        thing = todo.pop()
        if id(thing) in seen:
            continue
        seen.add(id(thing))
        if isinstance(thing, np.ndarray):
            while thing.base is not None and isinstance(thing.base, np.ndarray):
                thing = thing.base
            if (rows - {0}) & set(thing.shape):
                found[id(thing)] = thing
        elif isinstance(thing, Record):
            fields = thing.schema.fields.items()
            todo += [getattr(thing, name) for name, field in fields if not isinstance(field, Scalar)]
        elif isinstance(thing, dict):
            todo += thing.values()
        elif isinstance(thing, (list, tuple, set)):
            todo += thing
        elif type(thing).__module__.startswith("carom") and not isinstance(thing, (type, World)):
            todo += vars(thing).values() if hasattr(thing, "__dict__") else ()
    return sum(array.nbytes // max(array.shape) * world.physics.table.capacity for array in found.values())


def many(world, *components, touching=False):
    places = np.zeros((COUNT, world.dimensions))
    places[:, 0] = 3.0 * np.arange(COUNT)
    world.create_entities(COUNT, Transform.many(places), RigidBody.many(mass=1.0), *components)
    if touching:
        world.bodies.position[1] = world.bodies.position[0] + 0.25
        world.bodies.linear_velocity[:2, 0] = 1.0, -1.0
    return world


BALLS, CRATES = SphereCollider.many(radius=0.5), AABBCollider.many(half_extents=(0.5, 0.5))


@pytest.mark.parametrize(
    "build",
    [
        lambda: many(make_world()),
        lambda: many(make_world(3), BALLS, touching=True),
        lambda: many(make_world(integrator="rk4", gravity=9.81), BALLS, touching=True),
        lambda: many(make_world(collision="continuous"), BALLS),
        lambda: many(make_world(), SphereCollider.many(radius=0.8), CRATES),
    ],
    ids=["free flight", "rest, 3D", "curved paths", "swept", "levels"],
)
def test_the_columns_there_are_those_of_the_plan(build):
    with build() as world:
        for _ in range(3):
            world.step()
        columns = [column for column in world.plan().columns if column.of == "body"]
        assert sum(column.bytes for column in columns) * COUNT == arrays_per_body(world)


@pytest.mark.plain
def test_fields_at_their_defaults_are_distinguished_from_those_in_use():
    world = make_world()
    entity = world.create_entity(Transform((0.0, 0.0)), RigidBody())
    reasons = {column.column: column.reason for column in world.plan().columns}
    assert reasons["position"] == "what the game has set"
    assert "defaults" in reasons["mass"]
    assert not reasons.keys() & {"rotation", "gravity_scale", "max_linear_speed"}  # nothing has asked for them
    _ = world.bodies.gravity_scale
    world.component_for_entity(entity, Transform).rotation = 1.0
    reasons = {column.column: column.reason for column in world.plan().columns}
    assert "defaults" in reasons["gravity_scale"]
    assert reasons["rotation"] == "what the game has set"


@pytest.mark.plain
def test_a_world_without_physics_has_a_plan():
    plan = World(settings=Settings()).plan()
    assert plan.entries == plan.kernels == plan.columns == ()
    assert str(plan) == ""
