"""One player ploughs through 10,000 discs and boxes.

The scene for the broad phase: each step the player's radar makes one query that must not examine all
10,000 objects, and its body collides with the few that it meets. The objects are at rest until they are pushed.
"""

import math

import numpy as np

from carom import Phase, Physics, RigidBody, Settings, SphereCollider, System, Transform, World
from carom.framework.elementary import sin
from carom.scenes.bodies import add_discs_and_boxes, lattice
from carom.scenes.walls import enclose

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
SECONDS = 21.0
VIEW = ((-2.0, -2.0), (SIDE + 2.0, SIDE + 2.0))


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
        aim = SIDE / 2 + 0.36 * SIDE * np.array([sin(angle), sin(2 * angle)])
        wish = 2.0 * (aim - transform.position)
        wish *= min(1.0, SPEED / max(math.sqrt((wish * wish).sum()), 1e-9))
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
    world = World(Physics(dimensions=2), settings=settings)
    enclose(world, (0.0, 0.0), (SIDE, SIDE), thickness=2.0)
    player = world.create_entity(
        Transform((SIDE / 2, SIDE / 2)),
        RigidBody(mass=PLAYER_MASS, ccd=True),
        SphereCollider(radius=PLAYER_RADIUS, restitution=0.2),
    )

    random = np.random.default_rng(seed)
    places = (lattice(PER_ROW**2, PER_ROW) + 0.5) * SPACING
    order = np.argsort(((places - SIDE / 2) ** 2).sum(axis=1), kind="stable")
    places = places[np.sort(order[-OBJECTS:])]
    extents = random.uniform(0.25, 0.6, OBJECTS)  # radius or half extent
    places += random.uniform(-1, 1, (OBJECTS, 2)) * (SPACING / 2 - extents)[:, None]
    add_discs_and_boxes(world, places, np.zeros_like(places), extents, restitution=0.2, damping=DRAG)
    world.add_system(Pilot(player))
    world.add_system(Radar(player))
    return world
