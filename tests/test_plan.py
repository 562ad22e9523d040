"""world.plan() against what happens: the kernels that are called and compiled, the columns that are allocated."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.components.colliders import Collider, column
from carom.framework import ForceSystem, Phase, Plugin, Settings, System, World
from carom.framework.compilation import kernel, time_calls
from carom.framework.plan import PlannedKernel
from carom.framework.vectors import divided, length, scale
from carom.plugins import Physics
from carom.systems.few_boxes import FEW

from .worlds import ball, box, floor, make_world

STEPS = 40

AROUND = {"invert_masses", "all_finite"}
REST = {"gather", "linearise", "recall", "squeeze", "solve_contacts", "put_back", "remember", "predict_support"}
REST |= {"drop_support"}
CONTACTS = {"find_resting", "find_touching", "collect_contacts", "compare_pairs"} | REST
SHAPES = {"any_turned", "box_motion", "sort_pairs", "find_contacts"}
FALL = {"sum_constant_forces", "euler"}
TREE = {"choose_frame", "assign_cells", "place", "ranges_within_levels", "ranges_between", "overlapping"}


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


pebbles = Plugin("pebbles")


@pebbles.shape(cost=1)
class PebbleCollider(Collider):
    size = column(positive=True)

    def bounds(shape, dimensions):
        return (shape.size, shape.size) if dimensions == 2 else (shape.size, shape.size, shape.size)


@pebbles.pair(PebbleCollider, PebbleCollider)
def pebble_pebble(a, b, d):
    apart = length(d)
    depth = a.size + b.size - apart
    normal = divided(d, apart) if apart > 0.0 else scale(d, 0.0)
    if apart == 0.0:
        normal = (1.0, 0.0) if len(d) == 2 else (1.0, 0.0, 0.0)
    return depth >= 0.0, depth, normal, scale(normal, a.size - 0.5 * depth)


def drifting(d=2, damping=0.0, limit=None, **settings):
    world = make_world(d, **settings)
    body = RigidBody(linear_velocity=(1.0,) * d, linear_damping=damping, max_linear_speed=limit)
    world.create_entity(Transform((0.0,) * d), body)
    return world


def falling(d=2, **settings):
    world = make_world(d, gravity=9.81, **settings)
    world.create_entity(Transform((0.0,) * d), RigidBody())
    return world


def pushed(**settings):
    world = drifting(**settings)
    world.add_system(Push())
    return world


def with_constant_force():
    world = make_world()
    world.create_entity(Transform((0.0, 0.0)), RigidBody(constant_force=(1.0, 0.0)))
    return world


def with_system():
    world = drifting()
    world.add_system(Nudge())
    return world


def resting(d=2, friction=None, restitution=0.0, shape=ball, handler=False, rotation=None):
    """Falls two centimetres onto the floor; one that bounces as well, if any does."""
    world = make_world(d, gravity=9.81)
    floor(world)
    turned = {} if rotation is None else {"rotation": rotation}
    shape(world, (0.0, 0.52, 0.0)[:d], (1.0, 0.0, 0.0)[:d], friction=friction, **turned)
    if restitution:
        shape(world, (5.0, 0.6, 0.0)[:d], restitution=restitution)
    if handler:
        world.on("contact_begin", lambda contact: None)
    return world


def on_each_other():
    """Spheres alone: one falls onto a static one."""
    world = make_world(gravity=9.81)
    ball(world, (0.0, 0.0), kind="static")
    ball(world, (0.0, 1.02))
    return world


def with_levels():
    world = make_world(gravity=9.81)
    floor(world)
    world.create_entity(
        Transform((0.0, 0.52)), RigidBody(), SphereCollider(0.8), AABBCollider(0.5)
    )
    return world


def with_plugin():
    world = World(Physics(gravity=(0, -9.81)), pebbles)
    world.create_entity(Transform((0.0, 0.0)), PebbleCollider(0.5))
    world.create_entity(Transform((0.0, 1.02)), RigidBody(), PebbleCollider(0.5))
    return world


def crowd(count, still=0, radii=(0.5,)):
    """Spheres at rest side by side, two that touch, and static ones."""
    world = make_world()
    for k in range(count + still):
        x, y = divmod(k, 30)
        kind = "dynamic" if k < count else "static"
        ball(world, (1.2 * x, 1.2 * y), radius=radii[k % len(radii)], kind=kind)
    ball(world, (-2.0, 0.0))
    ball(world, (-3.02, 0.0), (1.0, 0.0))
    return world


# What runs: everything that can be called in the scene, no more.
FALLS = AROUND | FALL
HITS = FALLS | SHAPES | CONTACTS | {"test_all"}
CROWD = AROUND | {"any_force", "drift"} | SHAPES | CONTACTS
LADDER = {
    "nothing": (lambda: make_world(), AROUND),
    "a static body": (lambda: _with(RigidBody(kind="static")), AROUND),
    "a kinematic body": (lambda: _with(RigidBody(kind="kinematic", linear_velocity=(1.0, 0.0))), AROUND),
    "drifting": (drifting, AROUND | {"any_force", "drift"}),
    "drifting, 3D": (lambda: drifting(3), AROUND | {"any_force", "drift"}),
    "drifting, rk4": (lambda: drifting(integrator="rk4"), AROUND | {"any_force", "drift"}),
    "damping": (lambda: drifting(damping=0.5), AROUND | {"any_force", "drift", "euler"}),
    "a limit of speed": (lambda: drifting(limit=1.0), AROUND | {"any_force", "drift", "limit_distance"}),
    "a system of the game": (with_system, AROUND | {"any_force", "euler"}),
    "constant force": (with_constant_force, AROUND | {"any_force", "sum_constant_forces", "euler"}),
    "force system": (pushed, FALLS | {"push"}),
    "force system, Verlet": (
        lambda: pushed(integrator="velocity_verlet"),
        AROUND | {"sum_constant_forces", "push", "verlet_drift", "verlet_kick"},
    ),
    "force system, rk4": (
        lambda: pushed(integrator="rk4"), AROUND | {"sum_constant_forces", "push", "runge_kutta_stage"}
    ),
    "force system, Yoshida": (
        lambda: pushed(integrator="yoshida4"),
        AROUND | {"sum_constant_forces", "push", "verlet_drift", "verlet_kick"},
    ),
    "gravity": (falling, FALLS),
    "gravity, explicit Euler": (lambda: falling(integrator="explicit_euler"), FALLS),
    "gravity, Verlet": (
        lambda: falling(integrator="velocity_verlet"), AROUND | {"sum_constant_forces", "verlet_drift"}
    ),
    "gravity, 3D": (lambda: falling(3), FALLS),
    "spheres": (on_each_other, HITS),
    "a sphere and boxes": (resting, HITS),
    "boxes": (lambda: resting(shape=box), HITS),
    "boxes, turned": (lambda: resting(shape=box, rotation=0.1), HITS),
    "spheres, 3D": (lambda: resting(3), HITS),
    "friction": (lambda: resting(friction=0.5), HITS),
    "restitution": (lambda: resting(restitution=0.5), HITS | {"resolve_impacts"}),
    "a handler": (lambda: resting(handler=True), HITS),
    "levels": (with_levels, HITS),
    "a plugin's shape": (with_plugin, HITS),
    "a uniform grid": (lambda: crowd(FEW + 8), CROWD | {"even_pairs"}),
    "a grid of what stands still": (lambda: crowd(20, still=FEW + 8), CROWD | {"lay_out", "pairs_inside", "test_all"}),
    "two grids": (lambda: crowd(FEW + 8, still=FEW + 50), CROWD | {"lay_out", "pairs_inside", "even_pairs"}),
    "a tree": (lambda: crowd(FEW + 8, radii=(0.5, 0.02, 20.0)), CROWD | {"even_pairs"} | TREE),
}  # fmt: skip


def _with(body):
    world = make_world()
    world.create_entity(Transform((0.0, 0.0)), body)
    return world


def record_calls(world, steps):
    """(system, kernel) of the calls in each step, those included that compile."""
    taken = []
    time_calls(lambda name, nanoseconds, compiled: taken[-1].add((world._pipeline.measurements.at or "", name)))
    try:
        for _ in range(steps):
            taken.append(set())
            world.step()
    finally:
        time_calls(None)
    return taken


def planned(plan, always=False):
    """The same as the plan has it; ``always``: only what is called in every step."""
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


def arrays_per_body(world):
    """Sizes in bytes of all arrays with as many rows as there is room for bodies, reached from the world's physics."""
    capacity, found, seen = world.physics.table.capacity, {}, set()
    todo = [world.physics, world.physics.table, *world.systems]
    while todo:
        thing = todo.pop()
        if id(thing) in seen:
            continue
        seen.add(id(thing))
        if isinstance(thing, np.ndarray):
            while thing.base is not None and isinstance(thing.base, np.ndarray):
                thing = thing.base
            if capacity in thing.shape:
                found[id(thing)] = thing
        elif isinstance(thing, dict):
            todo += thing.values()
        elif isinstance(thing, (list, tuple, set)):
            todo += thing
        elif type(thing).__module__.startswith("carom") and not isinstance(thing, (type, World)):
            todo += vars(thing).values() if hasattr(thing, "__dict__") else ()
    return sum(array.nbytes for array in found.values())


COUNT = 150  # bodies made at once, more than a new table has room for: exactly as many rows


def many(world, *components):
    places = np.zeros((COUNT, world.dimensions))
    places[:, 0] = 3.0 * np.arange(COUNT)
    world.create_entities(COUNT, Transform.many(places), *components)
    return world


def near(world, *components):
    """The same, where two of them overlap."""
    many(world, *components)
    world.bodies.position[1] = world.bodies.position[0] + 0.25
    return world


COLLISIONS = {"path_velocity", "origin", "size", "material", "gravity_share", "lower", "upper", "level_offsets", "rank"}
COLLISIONS |= {"boxes", "rows"}
SOLVER = {"supported", "held", "change", "place", "used", "body_rows", "last", "velocity", "moved", "acceleration"}
SOLVER |= {"inverse_mass"}
CURVES = {"path_second", "path_third"}
SWEPT = {"room", "roam_lower", "roam_upper"}
ROTATION = {"axes", "aabb_collider.half_extents, turned"}
FREE = RigidBody.many(mass=1.0)
BALLS = SphereCollider.many(radius=0.5)
CRATES = AABBCollider.many(half_extents=(0.5, 0.5))
GROUPS = (
    "the step", "collisions", "shapes", "curved paths", "swept bodies", "rotation", "contacts at rest",
    "broad phase, pairwise", "broad phase, grid",
)  # fmt: skip
COLUMNS = {
    "free flight": (lambda: many(make_world(), FREE), set()),
    "gravity and a curved path": (lambda: many(make_world(gravity=9.81, integrator="rk4"), FREE), set()),
    "spheres apart": (lambda: many(make_world(), FREE, BALLS), COLLISIONS),
    "spheres that touch": (lambda: near(make_world(), FREE, BALLS), COLLISIONS | SOLVER),
    "spheres that touch, 3D": (lambda: near(make_world(3), FREE, BALLS), COLLISIONS | SOLVER),
    "curved paths": (lambda: many(make_world(integrator="rk4", gravity=9.81), FREE, BALLS), COLLISIONS | CURVES),
    "straight paths": (lambda: many(make_world(integrator="rk4"), FREE, BALLS), COLLISIONS),
    "swept": (lambda: many(make_world(collision="continuous"), FREE, BALLS), COLLISIONS | SWEPT),
    "boxes": (lambda: many(make_world(), FREE, CRATES), COLLISIONS),
    "turned boxes": (lambda: many(_turning(), FREE, CRATES), COLLISIONS | ROTATION),
    "levels": (
        lambda: many(make_world(), FREE, SphereCollider.many(radius=0.8), CRATES),
        COLLISIONS | {"outgrown", "stretches"},
    ),
}


class Turn(System):
    def process(self, dt):
        self.world.bodies.rotation[:] += 0.1


def _turning():
    world = make_world()
    world.add_system(Turn())
    return world


@pytest.mark.parametrize("name", COLUMNS)
def test_the_columns_there_are_those_of_the_plan(name):
    build, expected = COLUMNS[name]
    world = build()
    for _ in range(3):
        world.step()
    plan = world.plan()
    columns = [column for column in plan.columns if column.of == "body"]
    present = {column.column for column in columns if column.group in GROUPS}
    assert present == expected | {"start_velocity", "levels"}
    assert sum(column.bytes for column in columns) * COUNT == arrays_per_body(world)
    world.close()


def test_fields_at_their_defaults_are_told_from_those_in_use():
    world = make_world()
    entity = world.create_entity(Transform((0.0, 0.0)), RigidBody())
    columns = {column.column: column.reason for column in world.plan().columns}
    assert columns["position"] == "what the game has set"
    for name in ("rotation", "constant_force", "linear_damping", "gravity_scale", "max_linear_speed"):
        assert "defaults" in columns[name]
    world.component_for_entity(entity, Transform).rotation = 1.0
    world.component_for_entity(entity, RigidBody).max_linear_speed = 1.0
    columns = {column.column: column.reason for column in world.plan().columns}
    assert columns["rotation"] == columns["max_linear_speed"] == "what the game has set"


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
        assert {k.kernel for k in world.plan().kernels} == AROUND | {"any_force"} | expected
        assert {k for _, k in set.union(*record_calls(world, 2))} == AROUND | {"any_force"}


def test_what_comes_later_is_in_the_plan_at_once():
    world = drifting()
    world.step()
    assert "euler" not in {k.kernel for k in world.plan().kernels}
    world.gravity = (0.0, -9.81)
    assert {"sum_constant_forces", "euler"} <= {k.kernel for k in world.plan().kernels}
    world.gravity = (0.0, 0.0)
    assert "any_turned" not in {k.kernel for k in world.plan().kernels}
    entity = ball(world, (9.0, 9.0))
    assert {"any_turned", "find_contacts"} <= {k.kernel for k in world.plan().kernels}
    world.delete_entity(entity, immediate=True)
    assert "find_contacts" not in {k.kernel for k in world.plan().kernels}


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
    assert "nobody listens" in str(world.plan())
    world.on("contact_stay", lambda contact: None)
    assert "handlers of contact_stay" in str(world.plan())
    world.step()
    assert dispatched == ["contact_stay"]


def test_friction_is_swept_only_where_there_is_some():
    def solver(world):
        return next(k.reason for k in world.plan().kernels if k.kernel == "solve_contacts")

    assert "without its sweeps" in solver(resting())
    assert "without its sweeps" in solver(resting(friction=0.0))
    assert solver(resting(friction=0.5)) == "with friction"


def test_forces_are_not_summed_where_none_acts():
    """The column is zero all the same, and what is applied later counts; also what a system of the game has left."""
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
    """A system of the game that does nothing makes carom go the long way."""
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
import sys
sys.path.insert(0, sys.argv[2])
from tests import test_plan
from carom.framework import compilation
world = test_plan.LADDER[sys.argv[1]][0]()
for _ in range(test_plan.STEPS):
    world.step()
compiled = [k for k in compilation._kernels if k.overloads]
print("compiled", *(k.py_func.__name__ for k in compiled))
print("planned", *(k.kernel for k in world.plan().kernels))
print("3D", any("UniTuple(float64, 3)" in str(s) for k in compiled for s in k.overloads))
made = [m.__doc__ or "" for name, m in list(sys.modules.items()) if name.startswith("carom_shapes_")]
print("boxes", any("AABBCollider" in title for title in made))
"""


@pytest.mark.parametrize("name", ["drifting", "gravity", "spheres", "restitution", "spheres, 3D"])
def test_the_kernels_that_are_compiled_are_those_of_the_plan(name):
    """Compiled, or loaded from the cache: in a process of its own."""
    command = [sys.executable, "-c", COMPILED, name, str(Path(__file__).parents[1])]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=300)
    answers = {line.split()[0]: line.split()[1:] for line in done.stdout.splitlines()}
    assert set(answers["compiled"]) == set(answers["planned"]) == LADDER[name][1]
    assert answers["3D"] == [str("3D" in name)]
    assert answers["boxes"] == [str(name not in ("drifting", "gravity", "spheres"))]
