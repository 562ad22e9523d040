"""400 elastic discs at kT = 1, whose pressure is known from statistical mechanics.

Unlike gas2d it starts with Maxwell's velocities at kT = 1 (mass 1), so it needs no warm-up: discs of diameter 1
on a lattice that fill a fraction ``eta`` of a square. Pressure and collision rate show whether impacts are found at
the right place and time; energy does not, because a gas that misses collisions conserves it too. For
eta = 0.3 the pressure is 2.063 n kT / area (virial series of hard discs, Clisby and McCoy, 2006), with the area
that the centres can reach, and each disc collides 2.4 times a second.
"""

import math

import numpy as np
from numpy.typing import NDArray

from carom import Physics, Settings, World
from carom.scenes.bodies import add_spheres, lattice
from carom.scenes.sizes import floor_root, real, whole
from carom.scenes.walls import enclose

BODIES = 400
ETA = 0.3
RADIUS = 0.5
THICKNESS = 10.0  # of the walls: enough for large steps of a discrete world
SETTINGS = Settings(collision="continuous")
SECONDS = 100.0


def side(n: int, eta: float) -> float:
    """The side of the box, metres: ``n`` discs of diameter 1 fill ``eta`` of its area."""
    return math.sqrt(n * math.pi / (4 * eta))


VIEW = ((-1.0, -1.0), (side(BODIES, ETA) + 1.0, side(BODIES, ETA) + 1.0))


def initial_state(n: int, eta: float, seed: int = 0) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Positions and velocities, (n, 2) each: a square lattice, row by row; zero momentum, kinetic energy n."""
    per_row = floor_root(n, 2)
    positions = (lattice(n, per_row) + 0.5) * (side(n, eta) / per_row)
    velocities = np.random.default_rng(seed).normal(size=(n, 2))
    velocities -= velocities.mean(axis=0)
    velocities *= math.sqrt(2 * n / (velocities**2).sum())
    return positions, velocities


def build(settings: Settings | None = None, seed: int = 0, *, n: int = BODIES, eta: float = ETA) -> World:
    """``n`` discs, a square number, that fill ``eta`` of the box, at most pi / 4; ``seed`` chooses the velocities.

    The walls are entities 1 to 4.
    """
    n, eta = whole(n, "n", 4), real(eta, "eta", above=True)
    if floor_root(n, 2) ** 2 != n:
        raise ValueError(f"n must be a square number, got {n}")
    if eta > math.pi / 4:
        raise ValueError(f"eta must be at most pi / 4, where the discs of the lattice touch, got {eta!r}")
    world = World(Physics(dimensions=2), settings=settings or SETTINGS)
    enclose(world, (0.0, 0.0), (side(n, eta), side(n, eta)), thickness=THICKNESS, restitution=1.0)
    add_spheres(world, *initial_state(n, eta, seed), radius=RADIUS, mass=1.0)
    return world
