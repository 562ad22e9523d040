# pyright: strict, reportUnnecessaryTypeIgnoreComment=true
"""A game that uses the public surface, for ``make typecheck``: strict, so that nothing a user gets is of unknown type.

What is wrong on purpose is marked; the checker complains if it finds nothing there.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carom.components import ALL_LAYERS, AABBCollider, Prefab, RigidBody, SphereCollider, Transform
from carom.framework import (
    Bodies,
    Component,
    Contact,
    ForceSystem,
    Phase,
    Plugin,
    Settings,
    System,
    Vector,
    World,
    array_column,
    column,
)
from carom.framework.typing import Array, ArrayField, VectorField
from carom.plugins import Physics, capsule
from carom.plugins.capsule import CapsuleCollider
from carom.plugins.convex_polygon import ConvexPolygonCollider
from carom.plugins.half_space import HalfSpaceCollider
from carom.plugins.paths import Path
from carom.plugins.springs import Springs
from carom.plugins.tile_grid import TileGridCollider
from carom.plugins.timers import Timer


class Health(Component):
    points: float = column(default=100.0, minimum=0.0)
    wind: VectorField = column(default=0.0, item="vector")
    lives: int = column(default=3, dtype=int)
    path: ArrayField = array_column(2, kw_only=True)


class Sprite:
    def __init__(self, file: str) -> None:
        self.file = file


class Wind(ForceSystem):
    requires = (Health,)

    def add_forces(self, bodies: Bodies, time: float) -> None:
        bodies.force += bodies.health.wind * time


class Steer(System):
    phase = Phase.START
    world: World

    def process(self, dt: float) -> None:
        for entity, (transform, body) in self.world.get_components(Transform, RigidBody):
            if entity > 0 and transform.x > 10.0:
                body.linear_velocity = (-body.linear_velocity[0], 0.0)
                body.apply_force((0.0, 1.0))


plugin = Plugin("typed", version="1.0")


@plugin.mixing_rule("first")
def first_of(x: float, y: float) -> float:
    return 0.5 * (x + y)


@plugin.pair_filter
def all_meet(bodies: Bodies, a: NDArray[np.int64], b: NDArray[np.int64]) -> NDArray[np.bool_]:
    return np.ones(len(a), bool)


@plugin.system
class Counts(System):
    steps = 0

    def process(self, dt: float) -> None:
        self.steps += 1


class Game(World):
    score: int


def colliders() -> list[Component]:
    """Constructor arguments are those of the columns; the last ones are wrong."""
    made: list[Component] = [
        SphereCollider(
            0.5, restitution=0.9, friction=None, offset=(0.0, 1.0), sensor=False, layer=2, mask=ALL_LAYERS, group=1
        ),
        SphereCollider(radius=np.float64(0.5)),
        AABBCollider((0.5, 1.0), layer="walls", mask=("walls", 4), enabled=False, surface_velocity=(1.0, 0.0)),
        AABBCollider(np.ones(2), offset=0.5),
        AABBCollider.from_bounds((0, 0), (1, 1), restitution=0.5),
        CapsuleCollider(0.5, half_height=1.0, friction=0.3),
        HalfSpaceCollider((0.0, 1.0)),
        ConvexPolygonCollider(((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)), corner_radius=0.1),
        ConvexPolygonCollider.box((1.0, 2.0), restitution=0.1),
        AABBCollider((1.0, 0.0), one_way=(0.0, -1.0)),
        TileGridCollider(((1, 0), (1, 1)), 0.5, faces="floors", restitution=0.5),
        Health(80.0, lives=2, path=((0.0, 0.0), (1.0, 1.0))),
        RigidBody(2.0, (1.0, 0.0), kind="kinematic", max_linear_speed=None, ccd=True),
        Path(((0.0, 0.0), (1.0, 1.0)), 2.0, mode="loop", ease=True),
        Timer(1.0, repeat=True),
    ]
    return made


def mistakes() -> None:
    SphereCollider()  # pyright: ignore[reportCallIssue]
    SphereCollider(0.5, bounce=1.0)  # pyright: ignore[reportCallIssue]
    SphereCollider("large")  # pyright: ignore[reportArgumentType]
    SphereCollider(0.5, (0.0, 0.0))  # pyright: ignore[reportCallIssue]
    CapsuleCollider(0.5)  # pyright: ignore[reportCallIssue]
    RigidBody(velocity=(1.0, 0.0))  # pyright: ignore[reportCallIssue]
    RigidBody(kind="moving")  # pyright: ignore[reportArgumentType]
    Path(((0.0, 0.0), (1.0, 1.0)), 2.0, mode="round")  # pyright: ignore[reportArgumentType]
    Timer(repeat=True)  # pyright: ignore[reportCallIssue]
    Health(points="many", path=((0.0, 0.0),))  # pyright: ignore[reportArgumentType]
    TileGridCollider(((1,),), 0.5, bounce=1.0)  # pyright: ignore[reportCallIssue]


def shift(position: Array, by: Vector) -> Array:
    return position + np.asarray(by)


def play(steps: int = 30) -> tuple[float, int, str]:
    """Energy, contacts begun, and the hash at the end."""
    settings = Settings(dt=1 / 120, collision="continuous").replace(substeps=2, on_fault="raise")
    springs = Springs()
    world = Game(Physics(dimensions=2, gravity=(0.0, -9.81)), capsule.plugin, plugin, springs, settings=settings)
    world.score = 0
    begun: list[Contact] = []
    world.on("contact_begin", begun.append)
    world.events.define("won")
    world.on("won", print)
    world.dispatch_event("won", 3)
    world.register(Health)
    world.add_system(Steer(), before=())
    world.add_system(Wind())

    floor: int = world.create_entity(Transform((0.0, -1.0)), AABBCollider((50.0, 1.0), friction=0.5))
    hero = world.create_entity(
        Transform((0.0, 3.0)), RigidBody(2.0), CapsuleCollider(0.3, 0.5), Health(path=((0.0, 0.0),)), Sprite("hero.png")
    )
    ids: range = world.create_entities(
        20, Transform.many(np.random.default_rng(1).uniform(5.0, 14.0, (20, 2))), RigidBody.many(mass=1.0),
        SphereCollider.many(radius=0.2, restitution=0.5),
    )  # fmt: skip
    springs.connect(hero, ids[0], stiffness=10.0)
    saved = world.snapshot()
    for _ in range(steps):
        world.step()
    world.restore(saved)
    taken: int = world.advance(steps * settings.dt)

    body = world.component_for_entity(hero, RigidBody)
    speed: float = float(np.linalg.norm(body.linear_velocity))
    health = world.try_component(hero, Health)
    if health is not None:
        health.points -= speed
        health.wind = 1.0
    sprite = world.component_for_entity(hero, Sprite)
    assert sprite.file.endswith(".png")
    assert world.entity_exists(floor)
    transform = world.component_for_entity(hero, Transform)
    transform.position = shift(transform.position, (0.0, 1.0))
    heavy: NDArray[np.float64] = world.bodies.dynamic.mass
    assert len(heavy) == len(world.bodies.dynamic)
    world.bodies.dynamic.linear_velocity[:, 0] += 1.0

    world.time_scale = 0.5 * world.time_scale
    pebble = Prefab(RigidBody(0.1), SphereCollider(0.05))
    first: int = pebble.spawn(world, position=(20.0, 0.0), mass=0.2)
    pebbles: range = pebble.spawn_many(world, 3, position=np.zeros((3, 2)))
    drawn: NDArray[np.float64] = world.bodies.interpolated_position
    assert first < pebbles[0]
    assert len(drawn) == len(world.bodies)

    below: list[int] = world.query_point((0.0, -0.5))
    near = world.query_nearest((0.0, 0.0))
    hits = world.ray_cast((0.0, 10.0), (0.0, -1.0), 100.0)
    for hit in hits:
        assert hit.distance >= 0.0
    assert below
    assert near is not None
    for entity, other, contact in world.contacts.pairs(Health, AABBCollider):
        assert entity != other
        assert contact.depth >= 0.0
    energy = world.kinetic_energy() + world.potential_energy() + float(world.momentum()[0])
    assert taken + world.step_count + world.time + world.alpha > 0
    counters: dict[str, int] = world.stats().counters
    assert counters["bodies"] > 0
    faults: list[str] = world.faults
    assert not faults
    print(world, world.plan(), sep="\n")
    result = energy, len(begun), world.state_hash()
    world.close()
    return result
