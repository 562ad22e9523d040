"""Contacts at rest without friction, as a linear complementarity problem that a library solves.

Impulses p >= 0 along the normals change no velocity where they push: A p + b >= 0, p (A p + b) = 0, with A = N M^-1 N^T
and b the change of the normal velocities by forces in a step. These are the conditions of the least squares problem
min |M^-1/2 N^T p + M^1/2 dv|, p >= 0: what is left of it is the change of velocity of each body in the step.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

from .narrow_naive import box_box, sphere_box, sphere_sphere

NEAR = 1e-9  # of the size: a contact if no farther apart than that


def touches(shapes):
    """(a, b, normal from a to b) of all that touch; a shape is (centre, radius) or (centre, half extents)."""
    found = []
    for b, (place_b, half_b) in enumerate(shapes):
        for a, (place_a, half_a) in enumerate(shapes[:b]):
            depth, normal = _geometry(place_a, half_a, place_b, half_b)
            if normal is not None and depth > -NEAR * min(np.min(half_a), np.min(half_b)):
                found.append((a, b, np.asarray(normal)))
    return found


def _geometry(place_a, half_a, place_b, half_b):
    if np.ndim(half_a) == np.ndim(half_b) == 0:
        return sphere_sphere(place_a, half_a, place_b, half_b)[:2]
    if np.ndim(half_a) == 0:
        return sphere_box(place_a, half_a, place_b, half_b)[:2]
    if np.ndim(half_b) == 0:
        depth, normal = sphere_box(place_b, half_b, place_a, half_a)[:2]
        return depth, None if normal is None else -np.asarray(normal)
    return box_box(place_a, half_a, place_b, half_b)[:2]


def solve(contacts, inverse_masses, gained):
    """(impulses, changes of velocity (bodies, d) that are left, whether no others are right) against ``gained``."""
    root = np.sqrt(inverse_masses)
    ways = np.zeros((*np.shape(gained), len(contacts)))
    for k, (a, b, normal) in enumerate(contacts):
        ways[a, :, k], ways[b, :, k] = -root[a] * normal, root[b] * normal
    movable = root > 0.0
    ways, wanted = ways[movable], -np.asarray(gained)[movable] / root[movable, None]
    flat = ways.reshape(-1, len(contacts))
    impulses, _ = nnls(flat, wanted.ravel())
    left = np.zeros(np.shape(gained))
    left[movable] = root[movable, None] * (ways @ impulses - wanted)
    return impulses, left, np.linalg.matrix_rank(flat, tol=1e-6 * np.abs(flat).max()) == len(contacts)
