"""A lift and a ferry carry crates up, down and across.

Both are kinematic: contacts do not change their motion, and the crates on them follow. The lift accelerates with at
most 0.25 g, so the crates stay on it; the ferry with half of the limit of friction, so its crate does not slide.
"""

import math

import numpy as np
from numpy.typing import NDArray

from carom import AABBCollider, Component, Phase, Physics, RigidBody, Settings, System, Transform, World, column
from carom.framework.elementary import cos
from carom.framework.typing import VectorField
from carom.scenes.sizes import whole
from carom.scenes.walls import block

GRAVITY, FRICTION = 9.81, 0.6
CRATES = 3
THICKNESS = 0.5
LIFT_HEIGHT, LIFT_PERIOD = 8.0, 8.0  # metres, seconds: peak acceleration 2.5 m/s^2
FERRY_WIDTH, FERRY_PERIOD = 10.0, 8.0  # peak acceleration 3.1 m/s^2; friction passes on 5.9
SECONDS = 12.0
VIEW = ((-4.0, -2.0), (18.0, 13.0))


class Shuttle(Component):
    """Goes from ``start`` by ``travel`` metres and back, smoothly, in ``period`` seconds."""

    start: VectorField = column(default=0.0, item="vector")
    travel: VectorField = column(default=0.0, item="vector")
    period: float = column(default=1.0, positive=True)

    def place(self, time: float) -> NDArray[np.float64]:
        """Its position at ``time``."""
        return np.asarray(self.start) + np.asarray(self.travel) * (1 - cos(2 * math.pi * time / self.period)) / 2


class Drive(System):
    """Gives each Shuttle the velocity that leads to its position at the end of the step."""

    phase = Phase.START

    def process(self, dt: float) -> None:
        for _, (body, transform, shuttle) in self.world.get_components(RigidBody, Transform, Shuttle):
            body.linear_velocity = (shuttle.place(self.world.time + dt) - transform.position) / dt


def _platform(world: World, start: tuple[float, float], travel: tuple[float, float], period: float) -> int:
    return world.create_entity(
        Transform(start),
        RigidBody(kind="kinematic"),
        AABBCollider((2.0, THICKNESS / 2), friction=FRICTION),
        Shuttle(start=start, travel=travel, period=period),
    )


def _crate(world: World, x: float, y: float) -> int:
    return world.create_entity(Transform((x, y)), RigidBody(mass=1.0), AABBCollider((0.5, 0.5), friction=FRICTION))


def build(settings: Settings | None = None, seed: int = 0, *, crates: int = CRATES) -> World:
    """``crates`` on the lift and one on the ferry, all at rest relative to them; ``seed`` changes nothing.

    Created in this order: ground, lift, ferry, the lift's crates from the lowest up, the ferry's crate.
    """
    crates = whole(crates, "crates", 0)
    world = World(Physics(dimensions=2, gravity=(0.0, -GRAVITY)), settings=settings)
    block(world, (-4.0, -2.0), (18.0, -1.0), friction=FRICTION)
    _platform(world, (0.0, -THICKNESS / 2), (0.0, LIFT_HEIGHT), LIFT_PERIOD)
    _platform(world, (5.0, -THICKNESS / 2), (FERRY_WIDTH, 0.0), FERRY_PERIOD)
    for level in range(crates):
        _crate(world, 0.0, 0.5 + level)
    _crate(world, 5.0, 0.5)
    world.add_system(Drive())
    return world
