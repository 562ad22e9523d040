"""Contact geometry of two shapes, written for readability: numpy, one pair at a time, not optimized.

Each function returns (depth, normal from a to b or None if several are right, point or None): depth is positive in
overlap, 0 in touch, negative apart. A shape is a tuple (centre, radius) or (centre, half extents, rotation).
"""

from __future__ import annotations

import itertools
import math

import numpy as np


def rotation_matrix(rotation, d):
    """Of an angle, or of a quaternion w, x, y, z by v' = q v q*, column by column."""
    if d == 2:
        cosine, sine = math.cos(rotation), math.sin(rotation)
        return np.array([[cosine, -sine], [sine, cosine]])
    if np.ndim(rotation) == 0:
        return np.eye(3)
    w, *axis = np.asarray(rotation) / np.linalg.norm(rotation)
    columns = []
    for v in np.eye(3):
        t = 2 * np.cross(axis, v)
        columns.append(v + w * t + np.cross(axis, t))
    return np.array(columns).T


def stretched(half, rotation):
    """Half extents of the box around the turned box, from its corners."""
    turn = rotation_matrix(rotation, len(half))
    corners = [turn @ (np.array(signs) * half) for signs in itertools.product((-1, 1), repeat=len(half))]
    return np.max(corners, axis=0)


def sphere_sphere(a, radius_a, b, radius_b):
    distance = math.dist(a, b)
    depth = radius_a + radius_b - distance
    if distance == 0:
        return depth, None, None
    normal = (b - a) / distance
    # Middle of the overlap on the line of centres: from a's far point back to b's near point.
    return depth, normal, (a + radius_a * normal + b - radius_b * normal) / 2


def sphere_box(a, radius, b, half):
    nearest = np.clip(a, b - half, b + half)
    distance = math.dist(a, nearest)
    if distance > 0:
        return radius - distance, (nearest - a) / distance, nearest
    # Centre inside (or on the box): out through the nearest face, so the box is pushed the other way.
    faces = [(half[k] - sign * (a[k] - b[k]), k, sign) for k in range(len(a)) for sign in (1, -1)]
    room, axis, sign = min(faces)
    others = sorted(face[0] for face in faces)
    if others[1] - others[0] <= 1e-9 * (1 + max(half)):
        return radius + room, None, None  # two faces are equally near: either is right
    normal = np.zeros(len(a))
    normal[axis] = -sign
    point = a.copy()
    point[axis] = b[axis] + sign * half[axis]
    return radius + room, normal, point


def box_box(a, half_a, b, half_b):
    lower, upper = np.maximum(a - half_a, b - half_b), np.minimum(a + half_a, b + half_b)
    overlap = half_a + half_b - np.abs(b - a)
    axis = int(np.argmin(overlap))
    normal = np.zeros(len(a))
    normal[axis] = 1.0 if b[axis] >= a[axis] else -1.0
    point = (lower + upper) / 2
    others = np.sort(overlap)
    if others[1] - others[0] <= 1e-9 * (1 + max(np.abs(others))) or a[axis] == b[axis]:
        normal = None  # two axes overlap equally, or the centres are level: either side is right
    return overlap[axis], normal, point
