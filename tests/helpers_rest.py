"""Bodies at rest: towers of boxes and balls, and measures of their stability."""

from __future__ import annotations

import numpy as np
from worlds import box

G = 9.81
SLOP = 0.005  # of a size: the overlap that is not corrected


def tower(world, count, *, x=0.0, bottom=0.5, pitch=1.0, maker=box, masses=None, **collider):
    """``count`` bodies above each other, the lowest centre at height ``bottom``; returns their entities."""
    masses = np.ones(count) if masses is None else masses
    rest = (0.0,) * (world.dimensions - 2)
    return [maker(world, (x, bottom + pitch * k, *rest), mass=masses[k], **collider) for k in range(count)]


def rows_of(world, entities):
    return [world.bodies.row_of(e) for e in entities]


def heights(world, entities):
    return world.bodies.position[rows_of(world, entities), 1].copy()


def overlaps(world, entities):
    """Overlaps, metres, in a tower of unit bodies, from the floor upwards."""
    return 1.0 - np.diff(heights(world, entities), prepend=-0.5)


def speed(world):
    """The largest velocity component of any moving body."""
    return float(np.abs(world.bodies.dynamic.linear_velocity).max())


def energy(world):
    return world.kinetic_energy() + world.potential_energy()


def depths(world):
    return np.maximum(np.asarray(world.contacts.depth), 0.0)
