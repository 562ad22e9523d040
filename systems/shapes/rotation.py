"""Rotation as the game sets it, as axes: the columns of a body's rotation matrix turn its own axes into the world's."""

from __future__ import annotations

import numpy as np

from ...framework.elementary import sines_and_cosines


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
