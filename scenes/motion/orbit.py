"""A planet runs ten times around its ellipse.

The sun is at the origin, GM = 1 and the semi-major axis 1, so one orbit takes 2 pi seconds. The planet starts at the
perihelion, where it is fastest, at (1 - e, 0) with the speed sqrt((1 + e) / (1 - e)) upwards (Kepler's ellipse; e is
the eccentricity). After each orbit it must be back there. Its energy is -1/2 for any e, its angular momentum
sqrt(1 - e^2).
"""

import math
from typing import Any

import numpy as np

from carom import ForceSystem, Physics, RigidBody, Settings, Transform, World
from carom.scenes.sizes import real

ECCENTRICITY = 0.6
PERIOD = 2 * math.pi
STEPS_PER_PERIOD = 1000
PERIODS = 10
SETTINGS = Settings(dt=PERIOD / STEPS_PER_PERIOD, integrator="velocity_verlet")
SECONDS = PERIODS * PERIOD
VIEW = ((-2.2, -1.2), (1.2, 1.2))


class Sun(ForceSystem):
    """Attracts every dynamic body to the origin by m / r^2: GM = 1."""

    def add_forces(self, bodies: Any, time: float) -> None:
        x = bodies.position
        square = (x * x).sum(axis=1, keepdims=True)
        bodies.force[:] -= bodies.mass[:, None] * x / (square * np.sqrt(square))

    def potential_energy(self, bodies: Any) -> float:
        """-m / r, J: 0 at infinity."""
        x = bodies.position
        return -float((bodies.mass / (x * x).sum(axis=1) ** 0.5).sum())


def build(settings: Settings | None = None, seed: int = 0, *, eccentricity: float = ECCENTRICITY) -> World:
    """One planet of mass 1 at its perihelion; ``eccentricity`` from 0, a circle, to below 1. ``seed`` changes
    nothing."""
    e = real(eccentricity, "eccentricity")
    if e >= 1:
        raise ValueError(f"eccentricity must be below 1, got {eccentricity!r}")
    world = World(Physics(dimensions=2), settings=settings or SETTINGS)
    speed = math.sqrt((1 + e) / (1 - e))
    world.create_entity(Transform((1 - e, 0.0)), RigidBody(mass=1.0, linear_velocity=(0.0, speed)))
    world.add_system(Sun())
    return world
