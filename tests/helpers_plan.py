"""Worlds that run different stages, and the expected stages of each, with the kernels that are called from Python."""

from __future__ import annotations

from worlds import ball, box, floor, make_world

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.components.colliders import Collider
from carom.framework import ForceSystem, Phase, Plugin, System, World, column
from carom.framework.compilation import kernel
from carom.framework.schedule.plan import PlannedKernel
from carom.framework.vectors import divided, length, scale
from carom.plugins import Physics
from carom.systems.broad_phase.brute_force import BRUTE_FORCE_MAX

STEPS = 40

OUTSIDE = {"keep_state", "check_columns", "read_bodies", "check_finite"}  # of no system
AROUND = OUTSIDE | {"keep_start", "end_flight", "check_flight"}  # in every step
FORCES = {"limit_velocities", "sum_forces"}
DRIFT = AROUND | FORCES | {"drift"}
FALL = DRIFT | {"semi_implicit_euler"}
BOXES = {"box_statics", "box_motions", "choose_search", "test_few"}
GRIDS = {"place_statics", "search_uniform_grid", "search_static_grid"}
CANDIDATES = {"order_candidates", "select_pairs", "collect_contacts"}
REST = {"gather", "linearise", "match_warm_start", "solve_contacts", "put_back", "obey_statics"}
REST |= {"store_warm_start"}
RESPONSE = {"begin_response", "predict_rest", "begin_impacts", "resolve_impacts", "find_resting"} | REST
CONTACTS = {"find_touching", "publish_contacts", "compare_contacts"}
COLLISIONS = {"note_path"} | BOXES | CANDIDATES | RESPONSE | CONTACTS
TREE = {"run_tree_pass"}
COPIES = {"copy_blocks"}  # where code of the game runs in a step


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


# Expected: all that can run in the scene, and nothing else.
HITS = FALL | COLLISIONS | {"evaluate_pairs"}
CROWD = HITS | GRIDS
LADDER = {
    "nothing": (lambda: make_world(), AROUND),
    "a static body": (lambda: _with(RigidBody(kind="static")), AROUND),
    "a kinematic body": (lambda: _with(RigidBody(kind="kinematic", linear_velocity=(1.0, 0.0))), AROUND),
    "drifting": (drifting, FALL),
    "drifting, 3D": (lambda: drifting(3), FALL),
    "drifting, rk4": (lambda: drifting(integrator="rk4"), DRIFT | {"verlet_drift"}),
    "damping": (lambda: drifting(damping=0.5), FALL),
    "a limit of speed": (lambda: drifting(limit=1.0), FALL),
    "a system of the game": (with_system, FALL | COPIES),
    "constant force": (with_constant_force, FALL),
    "force system": (pushed, FALL | COPIES | {"push"}),
    "force system, Verlet": (
        lambda: pushed(integrator="velocity_verlet"), DRIFT | COPIES | {"push", "verlet_drift", "verlet_kick"}
    ),
    "force system, rk4": (lambda: pushed(integrator="rk4"), DRIFT | COPIES | {"push", "runge_kutta_stage"}),
    "force system, Yoshida": (
        lambda: pushed(integrator="yoshida4"), DRIFT | COPIES | {"push", "verlet_drift", "verlet_kick"}
    ),
    "gravity": (falling, FALL),
    "gravity, explicit Euler": (lambda: falling(integrator="explicit_euler"), DRIFT | {"explicit_euler"}),
    "gravity, Verlet": (lambda: falling(integrator="velocity_verlet"), DRIFT | {"verlet_drift"}),
    "gravity, 3D": (lambda: falling(3), FALL),
    "spheres": (on_each_other, HITS),
    "a sphere and boxes": (resting, HITS),
    "boxes": (lambda: resting(shape=box), HITS),
    "boxes, turned": (lambda: resting(shape=box, rotation=0.1), HITS),
    "spheres, 3D": (lambda: resting(3), HITS),
    "friction": (lambda: resting(friction=0.5), HITS),
    "restitution": (lambda: resting(restitution=0.5), HITS),
    "a handler": (lambda: resting(handler=True), HITS | COPIES),
    "levels": (with_levels, FALL | COLLISIONS | {"evaluate_levels"}),
    "a plugin's shape": (with_plugin, HITS),
    "a uniform grid": (lambda: crowd(BRUTE_FORCE_MAX + 8), CROWD),
    "a grid of what stands still": (lambda: crowd(20, still=BRUTE_FORCE_MAX + 8), CROWD),
    "two grids": (lambda: crowd(BRUTE_FORCE_MAX + 8, still=BRUTE_FORCE_MAX + 50), CROWD),
    "a tree": (lambda: crowd(BRUTE_FORCE_MAX + 8, radii=(0.5, 0.02, 20.0)), CROWD | TREE),
}  # fmt: skip


def _with(body):
    world = make_world()
    world.create_entity(Transform((0.0, 0.0)), body)
    return world
