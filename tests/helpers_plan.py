"""Worlds that run different kernels, and the expected kernels of each."""

from __future__ import annotations

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.components.colliders import Collider, column
from carom.framework import ForceSystem, Phase, Plugin, System, World
from carom.framework.compilation import kernel
from carom.framework.schedule.plan import PlannedKernel
from carom.framework.vectors import divided, length, scale
from carom.plugins import Physics
from carom.systems.broad_phase.brute_force import FEW

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
    """A body falls two centimetres onto the floor, and a bouncing one as well if any restitution is set."""
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
    """Only spheres: one falls onto a static one."""
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


# Expected kernels: all that can be called in the scene, and no others.
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
