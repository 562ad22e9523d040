"""Two flippers of a pinball table keep three balls in play: bars that a system turns.

The table leans, so gravity is weak. A flipper swings up when a ball is above it and comes down again; each point of it
throws with its own velocity. The gap between both is narrower than a ball.
"""

import math

import numpy as np

from carom import Phase, Physics, RigidBody, Settings, SphereCollider, System, Transform, World
from carom.framework.elementary import atan2, cos, sin
from carom.plugins.rotation import BoxCollider, Rotation, Spin
from carom.scenes.sizes import whole
from carom.scenes.walls import enclose

BALLS = 3
RADIUS, MASS = 0.25, 1.0
WIDTH, HEIGHT = 8.0, 12.0
GRAVITY = 4.0
LENGTH, THICKNESS = 1.9, 0.24  # of a flipper
PIVOT = (2.0, 1.6)  # of the left one
DOWN, UP = -0.35, 0.45  # rad, its angles
SWING, RETURN = 14.0, 5.0  # rad/s
NEAR = 0.5  # m: a ball that close above a flipper makes it swing
FRICTION, RESTITUTION, BOUNCE = 0.3, 0.4, 0.9
BUMPERS = ((2.4, 8.0), (5.6, 8.0), (4.0, 9.8))
SETTINGS = Settings(dt=1 / 240)
SECONDS = 10.0
VIEW = ((-1.0, -1.0), (WIDTH + 1.0, HEIGHT + 1.0))


class Flippers(System):
    """Turns the flippers: up where a ball is near, until they are up, then down again.

    ``flippers``: entities, and 1 for the left one, -1 for the right one
    """

    phase = Phase.START

    def __init__(self, flippers: dict[int, int]) -> None:
        super().__init__()
        self.flippers = flippers
        self.rising = dict.fromkeys(flippers, False)

    def process(self, dt: float) -> None:
        for flipper, side in self.flippers.items():
            angle = side * self.world.component_for_entity(flipper, Transform).rotation
            if angle >= UP - 1e-9:
                self.rising[flipper] = False
            elif angle <= DOWN + 1e-9:
                self.rising[flipper] = self._ball_is_near(flipper, side)
            way = (UP if self.rising[flipper] else DOWN) - angle
            turn = min(way, SWING * dt) if way > 0 else max(way, -RETURN * dt)
            self.world.component_for_entity(flipper, Spin).angular_velocity = side * turn / dt

    def _ball_is_near(self, flipper: int, side: int) -> bool:
        """Above the outer half."""
        transform = self.world.component_for_entity(flipper, Transform)
        along = np.array([side * cos(DOWN), sin(DOWN)])
        across = np.array([-side * along[1], side * along[0]])
        way = self.world.bodies.dynamic.position - transform.position
        place, height = ((way * one).sum(axis=1) for one in (along, across))
        height -= THICKNESS / 2 + RADIUS
        return bool(((place > 0.4 * LENGTH) & (place < LENGTH + RADIUS) & (height < NEAR) & (height > -RADIUS)).any())


def _bar(world: World, start: tuple[float, float], end: tuple[float, float]) -> None:
    """A static bar from one point to the other."""
    way = np.subtract(end, start)
    world.create_entity(
        Transform(np.add(start, end) / 2, atan2(way[1], way[0])),
        BoxCollider((math.sqrt((way * way).sum()) / 2, THICKNESS / 2), friction=FRICTION, restitution=RESTITUTION),
    )


def build(settings: Settings | None = None, seed: int = 0, *, n: int = BALLS) -> World:
    """``n`` balls at the top, whose places and velocities ``seed`` chooses."""
    n = whole(n, "n")
    world = World(Physics(dimensions=2, gravity=(0.0, -GRAVITY)), Rotation(), settings=settings or SETTINGS)
    enclose(world, (0.0, 0.0), (WIDTH, HEIGHT), restitution=RESTITUTION, friction=FRICTION)
    for x, y in BUMPERS:
        world.create_entity(Transform((x, y)), SphereCollider(0.5, restitution=BOUNCE, friction=FRICTION))
    flippers = {}
    for side in (1, -1):
        x = PIVOT[0] if side > 0 else WIDTH - PIVOT[0]
        outside = 0.0 if side > 0 else WIDTH
        slope = sin(DOWN) / cos(DOWN)
        _bar(world, (outside, PIVOT[1] - slope * PIVOT[0]), (x, PIVOT[1]))  # the lane that leads to it
        flipper = world.create_entity(
            Transform((x, PIVOT[1]), side * DOWN),
            RigidBody(kind="kinematic"),
            Spin(),
            BoxCollider((LENGTH / 2, THICKNESS / 2), offset=(side * LENGTH / 2, 0.0), friction=FRICTION),
        )
        flippers[flipper] = side
    random = np.random.default_rng(seed)
    places = np.stack([(np.arange(n) + 0.5) * WIDTH / n, np.full(n, HEIGHT - 1.0)], axis=1)
    world.create_entities(
        n,
        Transform.many(places + random.uniform(-0.3, 0.3, (n, 2))),
        RigidBody.many(mass=MASS, linear_velocity=random.uniform(-2.0, 2.0, (n, 2))),
        Spin.many(0.0),
        SphereCollider.many(radius=RADIUS, friction=FRICTION, restitution=RESTITUTION),
    )
    world.add_system(Flippers(flippers))
    return world
