"""A body on a spring swings once a second.

It starts at (1, 0) at rest, so x(t) = cos(omega t), omega = sqrt(stiffness / mass) = 2 pi 1/s. With a ``damping`` c
the amplitude falls as exp(-c t / 2) and omega becomes sqrt(stiffness / mass - c^2 / 4). Integrators differ in
amplitude, frequency and energy.
"""

import math
from typing import Any

from carom import ForceSystem, Physics, RigidBody, Settings, Transform, World
from carom.scenes.sizes import real

MASS = 1.0
STIFFNESS = (2 * math.pi) ** 2  # N/m: omega = 2 pi
START = (1.0, 0.0)
SETTINGS = Settings(integrator="velocity_verlet")
SECONDS = 5.2
VIEW = ((-1.5, -1.0), (1.5, 1.0))


class SpringToOrigin(ForceSystem):
    """-stiffness x - damping m v on every dynamic body: stiffness in N/m, damping in 1/s."""

    def __init__(self, stiffness: float, damping: float) -> None:
        self.stiffness = stiffness
        self.damping = damping

    def add_forces(self, bodies: Any, time: float) -> None:
        bodies.force[:] -= self.stiffness * bodies.position
        bodies.force[:] -= self.damping * bodies.mass[:, None] * bodies.linear_velocity

    def potential_energy(self, bodies: Any) -> float:
        """Energy of the spring, J; drag has none."""
        return 0.5 * self.stiffness * float((bodies.position**2).sum())


def build(
    settings: Settings | None = None, seed: int = 0, *, stiffness: float = STIFFNESS, damping: float = 0.0
) -> World:
    """1 kg on a spring of ``stiffness`` N/m; ``damping``, 1/s, is a drag of -damping m v. ``seed`` changes nothing."""
    force = SpringToOrigin(real(stiffness, "stiffness"), real(damping, "damping"))
    world = World(Physics(dimensions=2), settings=settings or SETTINGS)
    world.create_entity(Transform(START), RigidBody(mass=MASS))
    world.add_system(force)
    return world
