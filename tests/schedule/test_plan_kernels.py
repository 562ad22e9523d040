"""world.plan() against the stages that run, the kernels that are called and compiled; and the text of the plan."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from helpers_plan import AROUND, FORCES, LADDER, STEPS, Nudge, drifting, resting
from helpers_processes import run_python
from worlds import ball, make_world

from carom.components import RigidBody, SphereCollider, Transform
from carom.framework import Phase, Plugin, Settings, System, World
from carom.framework.compilation import time_calls
from carom.plugins import Physics


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


@pytest.mark.parametrize("name", LADDER)
def test_the_kernels_that_run_are_those_of_the_plan(name):
    build, expected = LADDER[name]
    world = build()
    before = world.plan()
    steps = record_calls(world, STEPS)
    plan = world.plan()
    assert {kernel for _, kernel in set.union(*steps)} == expected
    assert set.union(*steps) == planned(plan)
    every_step = planned(plan, always=True)
    assert all(every_step <= taken for taken in steps)
    assert {kernel.kernel for kernel in plan.kernels} == expected
    if name != "a tree":  # a grid is tried first
        assert planned(before) == planned(plan)
    assert all(entry.reason for entry in plan.entries)
    assert all(kernel.reason for kernel in plan.kernels)
    world.close()


def test_integrators_of_plugins_name_their_kernels_or_none():
    plugin = Plugin("flights")

    @plugin.integrator("silent")
    class Silent:
        order, evaluations, path = 1, 1, 1

        def advance(self, motion, dt):
            motion.position += dt * motion.velocity

    @plugin.integrator("named")
    class Named(Silent):
        def kernels(self, force_changes):
            return ("mine",)

    for name, expected in (("silent", set()), ("named", {"mine"})):
        world = World(Physics(), plugin, settings=Settings(integrator=name))
        world.create_entity(Transform((0.0, 0.0)), RigidBody())
        assert {k.kernel for k in world.plan().kernels} == AROUND | FORCES | expected
        assert {k for _, k in set.union(*record_calls(world, 2))} == AROUND | FORCES


def test_what_comes_later_is_in_the_plan_at_once():
    def stages(world):
        return {k.kernel for k in world.plan().kernels}

    world = make_world()
    world.step()
    assert not stages(world) & {"sum_forces", "drift", "semi_implicit_euler"}
    world.create_entity(Transform((0.0, 0.0)), RigidBody())
    assert {"sum_forces", "drift", "semi_implicit_euler"} <= stages(world)
    world.settings = dataclasses.replace(world.settings, integrator="velocity_verlet")
    assert "verlet_drift" in stages(world)
    assert "semi_implicit_euler" not in stages(world)
    assert "box_motions" not in stages(world)
    entity = ball(world, (9.0, 9.0))
    assert {"box_motions", "evaluate_pairs"} <= stages(world)
    world.delete_entity(entity, immediate=True)
    assert "evaluate_pairs" not in stages(world)


def test_a_plan_changes_nothing():
    one, other = resting(restitution=0.5), resting(restitution=0.5)
    for _ in range(STEPS):
        one.plan()
        one.step()
        other.step()
    assert one.state_hash() == other.state_hash()


def test_only_handlers_are_called_for():
    world = resting()
    dispatched = []
    world.events.dispatch_many = lambda name, rows: dispatched.append(name)
    for _ in range(STEPS):
        world.step()
    assert not dispatched
    assert "no event has a handler" in str(world.plan())
    world.on("contact_stay", lambda contact: None)
    assert "handlers of contact_stay" in str(world.plan())
    world.step()
    assert dispatched == ["contact_stay"]


def test_friction_is_swept_only_where_there_is_some():
    def is_swept(world):
        for _ in range(STEPS):
            world.step()
        assert world.physics.state.solver.contacts > 0
        return world.physics.state.solver.has_friction

    assert not is_swept(resting())
    assert not is_swept(resting(friction=0.0))
    assert is_swept(resting(friction=0.5))


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


@pytest.mark.parametrize("integrator", ["explicit_euler", "semi_implicit_euler", "velocity_verlet", "rk4", "yoshida4"])
@pytest.mark.parametrize("damping", [0.0, 0.7])
def test_drifting_gives_the_bits_of_the_integrator(integrator, damping):
    """A user system that does nothing makes carom take the general path."""
    worlds = [drifting(damping=damping, integrator=integrator) for _ in range(2)]
    worlds[1].add_system(Nudge())
    for world in worlds:
        world.create_entity(Transform((1 / 3, 0.1)), RigidBody(3.0, (0.7, -1e-9)), SphereCollider(0.5))
        for _ in range(STEPS):
            world.step()
    assert worlds[0].state_hash() == worlds[1].state_hash()


def test_the_printed_plan_has_it_all():
    world = resting(restitution=0.5)
    for _ in range(STEPS):
        world.step()
    plan = world.plan()
    lines = str(plan).splitlines()
    for call in plan.kernels:
        assert any(call.kernel in line and call.reason in line and call.when in line for line in lines)
    for array in plan.columns:
        assert any(array.name in line for line in lines)
    for of in ("body", "pair", "contact", "impact"):
        total = sum(column.bytes for column in plan.columns if column.of == of)
        assert any(line.split() == ["columns,", "bytes", "per", of, str(total)] for line in lines)


def test_a_world_without_physics_has_a_plan():
    world = World(settings=Settings())
    assert world.plan().entries == world.plan().kernels == world.plan().columns == ()
    assert str(world.plan()) == ""


COMPILED = """
import gc
import sys
sys.path.insert(0, sys.argv[2])
import helpers_plan
from carom.framework.jit.dispatchers import KeptDispatcher
from carom.systems.linking import steps
steps.link_possible = lambda *_: None  # what later steps may need, if it is kept
world = helpers_plan.LADDER[sys.argv[1]][0]()
for _ in range(helpers_plan.STEPS):
    world.step()
made = [thing for thing in gc.get_objects() if isinstance(thing, KeptDispatcher)]
compiled = [k for k in made if k.overloads]
print("compiled", *(k.py_func.__name__ for k in compiled))
print("planned", *(k.kernel for k in world.plan().kernels))
print("3D", any("3D" in str(s) for k in compiled for s in k.overloads))
made = [m.__doc__ or "" for name, m in list(sys.modules.items()) if name.startswith("carom_shapes_")]
print("boxes", any("AABBCollider" in title for title in made))
"""


RUN = {"run_stages", "ticks_now"}  # what calls the stages, and their clock
SHAPES = {"box_rows", "bounds", "evaluate", "batch", "rotated", "corner", "take_together"}  # called by address
SHAPES |= {"finish_found"}  # called where code reads contacts within a step


@pytest.mark.parametrize("name", ["drifting", "spheres", "restitution", "spheres, 3D"])
def test_the_kernels_that_are_compiled_are_those_of_the_plan(name):
    """Compiled, or loaded from the cache: in a process of its own."""
    done = run_python(COMPILED, name, Path(__file__).parents[2])
    assert done.returncode == 0, done.stderr
    answers = {line.split()[0]: line.split()[1:] for line in done.stdout.splitlines()}
    assert set(answers["planned"]) == LADDER[name][1]
    others = set(answers["compiled"]) - set(answers["planned"])
    assert set(answers["planned"]) <= set(answers["compiled"])
    if name == "drifting":
        assert others == RUN
    else:
        assert RUN | {"bounds", "batch"} <= others <= RUN | SHAPES
        assert ("take_together" in others) == (name == "restitution")  # before bodies first meet at the same time
    assert answers["3D"] == [str("3D" in name)]
    assert answers["boxes"] == [str(name not in ("drifting", "spheres"))]
