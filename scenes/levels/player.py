"""One player among 10,000 objects, with a range query in each step and contacts with what is in its way.

The scene for the broad phase: each step the player's radar makes one query that must not examine all
10,000 objects, and its body collides with the few that it meets. The objects, discs and boxes, are at rest until
they are pushed.
"""

from __future__ import annotations

import math

import numpy as np

from ...components import AABBCollider, RigidBody, SphereCollider, Transform
from ...framework import Phase, Settings, System, World
from ...plugins import Physics
from ..protocol import Scene
from ..walls import enclose

OBJECTS = 10_000
PER_ROW = 101  # a lattice of 10,201 places; the 201 nearest to the player stay empty
SPACING = 2.0  # metres between places
SIDE = PER_ROW * SPACING
PLAYER_RADIUS, PLAYER_MASS = 2.0, 40.0
SPEED = 40.0  # metres/s
LAP_RATE = 0.3  # radians/s along the eight
THRUST = 8.0  # 1/s: rate at which the player's velocity follows the desired one
RADAR_RADIUS = 8.0
DRAG = 1.5  # 1/s, of the objects


class Pilot(System):
    """Flies the player along a figure of eight: a force proportional to the velocity error."""

    phase = Phase.START

    def __init__(self, player: int) -> None:
        super().__init__()
        self.player = player

    def process(self, dt: float) -> None:
        transform = self.world.component_for_entity(self.player, Transform)
        body = self.world.component_for_entity(self.player, RigidBody)
        angle = LAP_RATE * self.world.time
        aim = SIDE / 2 + 0.36 * SIDE * np.array([math.sin(angle), math.sin(2 * angle)])
        wish = 2.0 * (aim - transform.position)
        wish *= min(1.0, SPEED / max(math.hypot(*wish), 1e-9))
        body.apply_force(PLAYER_MASS * THRUST * (wish - body.linear_velocity))


class Radar(System):
    """Keeps the ids of the entities within RADAR_RADIUS of the player in ``near``."""

    phase = Phase.END

    def __init__(self, player: int) -> None:
        super().__init__()
        self.player = player
        self.near: np.ndarray = np.empty(0, np.int64)

    def process(self, dt: float) -> None:
        position = self.world.component_for_entity(self.player, Transform).position
        self.near = np.asarray(self.world.query_sphere(position, RADAR_RADIUS))


def build(settings: Settings | None = None, seed: int = 0) -> World:
    """The player starts in the middle; ``seed`` chooses the objects' places and sizes."""
    world = World(Physics(dimensions=2, gravity=(0.0, 0.0)), settings=settings or Settings.balanced())
    enclose(world, (0.0, 0.0), (SIDE, SIDE), thickness=2.0)
    player = world.create_entity(
        Transform((SIDE / 2, SIDE / 2)),
        RigidBody(mass=PLAYER_MASS, ccd=True),
        SphereCollider(radius=PLAYER_RADIUS, restitution=0.2),
    )

    random = np.random.default_rng(seed)
    index = np.arange(PER_ROW**2)
    places = (np.stack([index % PER_ROW, index // PER_ROW], axis=1) + 0.5) * SPACING
    order = np.argsort(np.hypot(*(places - SIDE / 2).T), kind="stable")
    places = places[np.sort(order[-OBJECTS:])]
    extents = random.uniform(0.25, 0.6, OBJECTS)  # radius or half extent
    places += random.uniform(-1, 1, (OBJECTS, 2)) * (SPACING / 2 - extents)[:, None]
    discs, boxes = extents[::2], extents[1::2]
    world.create_entities(
        len(discs),
        Transform.many(places[::2]),
        RigidBody.many(mass=math.pi * discs**2, linear_damping=DRAG),
        SphereCollider.many(radius=discs, restitution=0.2),
    )
    world.create_entities(
        len(boxes),
        Transform.many(places[1::2]),
        RigidBody.many(mass=4 * boxes**2, linear_damping=DRAG),
        AABBCollider.many(half_extents=np.stack([boxes, boxes], axis=1), restitution=0.2),
    )
    world.add_system(Pilot(player))
    world.add_system(Radar(player))
    return world


SCENE = Scene(
    name="player",
    description="one player ploughs through 10,000 discs and boxes",
    build=build,
    seconds=21.0,
    view=((-2.0, -2.0), (SIDE + 2.0, SIDE + 2.0)),
)
