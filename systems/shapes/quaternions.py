"""Rotations of bodies, as stages read and write them: unit quaternions w, x, y, z, and the axes that shapes read: the
columns of a rotation matrix, which turns a body's own axes into the world's."""

from __future__ import annotations

import math

import numpy as np

from ...framework.compilation import part
from ...framework.elementary import cos, sin, sines_and_cosines
from ...framework.jit.records.record_type import zero_of
from ...framework.vectors import dot


@part
def product(p, q):
    """The rotation q, then p: unit quaternions w, x, y, z."""
    a, b, c, d = p
    w, x, y, z = q
    return (
        a * w - b * x - c * y - d * z, a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x, a * z + b * y - c * x + d * w,
    )  # fmt: skip


@part
def rotate(q, v, back):
    """The vector v turned by a unit quaternion; ``back``: by its inverse."""
    w, x, y, z = q
    if back:
        w = -w
    a = 2.0 * (y * v[2] - z * v[1])
    b = 2.0 * (z * v[0] - x * v[2])
    c = 2.0 * (x * v[1] - y * v[0])
    return v[0] + w * a + y * c - z * b, v[1] + w * b + z * a - x * c, v[2] + w * c + x * b - y * a


@part
def rotation_in_space(state, i):
    """The quaternion of a body, of length 1."""
    rotation, k = state.bodies.rotation, 4 * i
    w, x, y, z = rotation[k], rotation[k + 1], rotation[k + 2], rotation[k + 3]
    size = math.sqrt(w * w + x * x + y * y + z * z)
    return w / size, x / size, y / size, z / size


@part
def set_rotation(state, i, q):
    """The quaternion of a body."""
    rotation, k = state.bodies.rotation, 4 * i
    size = math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    rotation[k], rotation[k + 1] = q[0] / size, q[1] / size
    rotation[k + 2], rotation[k + 3] = q[2] / size, q[3] / size


@part
def write_axes(state, i):
    """The rotation matrix of a body, where shapes read it."""
    axes, d = state.bodies.axes, len(zero_of(state))
    if len(axes) == 0:
        return
    known = state.bodies.axes_rotation
    if d == 2:
        angle = known[i] = state.bodies.rotation[i]
        cosine, sine, k = cos(angle), sin(angle), 4 * i
        axes[k], axes[k + 1], axes[k + 2], axes[k + 3] = cosine, -sine, sine, cosine
        return
    for k in range(4 * i, 4 * i + 4):
        known[k] = state.bodies.rotation[k]
    w, x, y, z = rotation_in_space(state, i)
    k = 9 * i
    axes[k], axes[k + 1], axes[k + 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    axes[k + 3], axes[k + 4], axes[k + 5] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    axes[k + 6], axes[k + 7], axes[k + 8] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)


@part
def read_axes(state, i):
    """A body in space is turned as its axes are."""
    m, k = state.bodies.axes, 9 * i
    xx, yy, zz = m[k], m[k + 4], m[k + 8]
    x, y, z = m[k + 7] - m[k + 5], m[k + 2] - m[k + 6], m[k + 3] - m[k + 1]
    xy, xz, yz = m[k + 1] + m[k + 3], m[k + 2] + m[k + 6], m[k + 5] + m[k + 7]
    if xx + yy + zz > 0.0:
        set_rotation(state, i, (1.0 + xx + yy + zz, x, y, z))
    elif xx >= yy and xx >= zz:
        set_rotation(state, i, (x, 1.0 + xx - yy - zz, xy, xz))
    elif yy >= zz:
        set_rotation(state, i, (y, xy, 1.0 + yy - xx - zz, yz))
    else:
        set_rotation(state, i, (z, xz, yz, 1.0 + zz - xx - yy))


@part
def turned_tensor(q, tensor):
    """A symmetric matrix (xx, yy, zz, xy, xz, yz) along the axes of a body, along those of the world."""
    xx, yy, zz, xy, xz, yz = tensor
    x, y, z = rotate(q, (1.0, 0.0, 0.0), True), rotate(q, (0.0, 1.0, 0.0), True), rotate(q, (0.0, 0.0, 1.0), True)
    along_x = xx * x[0] + xy * x[1] + xz * x[2], xy * x[0] + yy * x[1] + yz * x[2], xz * x[0] + yz * x[1] + zz * x[2]
    along_y = xx * y[0] + xy * y[1] + xz * y[2], xy * y[0] + yy * y[1] + yz * y[2], xz * y[0] + yz * y[1] + zz * y[2]
    along_z = xx * z[0] + xy * z[1] + xz * z[2], xy * z[0] + yy * z[1] + yz * z[2], xz * z[0] + yz * z[1] + zz * z[2]
    return (
        dot(along_x, x), dot(along_y, y), dot(along_z, z),
        dot(along_x, y), dot(along_x, z), dot(along_y, z),
    )  # fmt: skip


def axes_of(rotation: np.ndarray, dimensions: int) -> np.ndarray:
    """Rotation matrices (n, d, d) of angles (n,) in radians or unit quaternions (n, 4), order w, x, y, z.

    Quaternions are normalized first, so that written columns need not be.
    """
    matrices = np.empty((len(rotation), dimensions, dimensions))
    if dimensions == 2:
        sine, cosine = sines_and_cosines(rotation)
        matrices[:, 0, 0], matrices[:, 0, 1] = cosine, -sine
        matrices[:, 1, 0], matrices[:, 1, 1] = sine, cosine
        return matrices
    w, x, y, z = (rotation / np.linalg.norm(rotation, axis=1, keepdims=True)).T
    matrices[:, 0].T[:] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    matrices[:, 1].T[:] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    matrices[:, 2].T[:] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)
    return matrices
