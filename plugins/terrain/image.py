"""Outlines of what is filled in an image: marching squares, simplified.

(D. Douglas and T. Peucker, "Algorithms for the reduction of the number of points", 1973.)
"""

from __future__ import annotations

from typing import Any

import numpy as np

# Sides of a cell of four pixels (0 below, 1 right, 2 above, 3 left), from which to which its lines run, with what is
# filled on their right; by the filled corners: 1 lower left, 2 lower right, 4 upper right, 8 upper left. Cases 5 and 10
# have two lines: first those that keep the two filled corners apart, then those that join them.
LINES = {
    1: ((3, 0),), 2: ((0, 1),), 3: ((3, 1),), 4: ((1, 2),), 6: ((0, 2),), 7: ((3, 2),), 8: ((2, 3),), 9: ((2, 0),),
    11: ((2, 1),), 12: ((1, 3),), 13: ((1, 0),), 14: ((0, 3),),
}  # fmt: skip
APART = {5: ((3, 0), (1, 2)), 10: ((0, 1), (2, 3))}
JOINED = {5: ((1, 0), (3, 2)), 10: ((2, 1), (0, 3))}
FINEST = 1e-3  # pixels, of a tolerance: lines of the cells themselves do not cross


def outline_of_image(
    image: Any, tolerance: float = 1.0, *, pixel_size: float = 1.0, threshold: float = 0.5
) -> list[np.ndarray]:
    """The closed outlines of what is filled in an image, (n, 2) m each, y up, from its lower left corner: outer ones
    clockwise, those of holes counter-clockwise, the largest first; for ``create_chain(world, loop, loop=True)``, which
    is solid on the filled side, and the outer ones for :func:`carom.plugins.parts.parts_from_outline`. ValueError for
    what is no image.

    image
        (rows, columns), the first row is the top one: true where it is filled, or numbers, such as alpha, which place
        the outline between pixels
    tolerance
        pixels, how far they may be from the outlines of the pixels, and what is smaller is left out; less where they
        would cross
    pixel_size
        m, side length of a pixel
    threshold
        numbers above it are filled; 127 for alpha of 0 to 255
    """
    values = np.asarray(image)
    if values.ndim != 2 or values.dtype.kind not in "biuf" or not values.size or not np.isfinite(values).all():
        raise ValueError(f"outline_of_image: image must be rows and columns of numbers, got shape {values.shape}")
    for name, number in (("tolerance", tolerance), ("pixel_size", pixel_size)):
        if not (0.0 <= number < np.inf) or (name == "pixel_size" and number == 0.0):
            raise ValueError(f"outline_of_image: {name} must be {'above' * (name != 'tolerance') or 'at least'} 0, "
                             f"got {number!r}")  # fmt: skip
    edge = min(2.0 * threshold - float(values.max()), float(values.min()), threshold)  # so that it ends with the image
    padded = np.pad(values[::-1].astype(float), 1, constant_values=edge)
    loops = _loops(padded, threshold)
    found = [_simplified(loop, tolerance) for loop in loops]
    while tolerance > FINEST and _cross(found):
        tolerance *= 0.5
        found = [_simplified(loop, tolerance) for loop in loops]
    return sorted((loop * pixel_size for loop in found if len(loop) > 2), key=lambda loop: -abs(_area(loop)))


def _loops(values: np.ndarray, threshold: float) -> list[np.ndarray]:
    """Marching squares: closed lines between the middles of the pixels, of which the outermost are empty."""
    filled = values > threshold
    rows, columns = np.array(values.shape) - 1
    a, b, c, d = filled[:-1, :-1], filled[:-1, 1:], filled[1:, 1:], filled[1:, :-1]
    cases = a + 2 * b + 4 * c + 8 * d
    middle = (values[:-1, :-1] + values[:-1, 1:] + values[1:, 1:] + values[1:, :-1]) / 4.0 > threshold
    # Sides of cells by number: first those along x, of which there is one more row, then those along y.
    along_x = np.arange((rows + 1) * columns).reshape(rows + 1, columns)
    along_y = along_x.size + np.arange(rows * (columns + 1)).reshape(rows, columns + 1)
    sides = along_x[:-1], along_y[:, 1:], along_x[1:], along_y[:, :-1]
    after = np.full(along_x.size + along_y.size, -1)
    for table, where in ((LINES, True), (APART, ~middle), (JOINED, middle)):
        for case, lines in table.items():
            here = (cases == case) & where
            for start, end in lines:
                after[sides[start][here]] = sides[end][here]
    with np.errstate(divide="ignore", invalid="ignore"):
        x = (threshold - values[:, :-1]) / (values[:, 1:] - values[:, :-1])
        y = (threshold - values[:-1]) / (values[1:] - values[:-1])
    i, j = np.indices(x.shape)
    k, m = np.indices(y.shape)
    places = np.concatenate((np.stack((j + x, i), -1).reshape(-1, 2), np.stack((m, k + y), -1).reshape(-1, 2))) - 0.5
    following, loops = after.tolist(), []
    for start in np.flatnonzero(after >= 0).tolist():
        loop = []
        while following[start] >= 0:
            loop.append(start)
            following[start], start = -1, following[start]
        if loop:
            loops.append(places[loop])
    return loops


def _simplified(loop: np.ndarray, tolerance: float) -> np.ndarray:
    """Some of the points of a closed line; the others are at most so far from the line through these."""
    first = int(np.lexsort((loop[:, 1], loop[:, 0]))[0])
    points = np.roll(loop, -first, axis=0)
    second = int(_squares(points - points[0]).argmax())
    closed = np.concatenate((points, points[:1]))
    kept = {0, second}
    parts = [(0, second), (second, len(points))]
    while parts:
        low, high = parts.pop()
        if high - low < 2:
            continue
        way, rest = closed[high] - closed[low], closed[low + 1 : high] - closed[low]
        along = np.zeros(len(rest))
        if way.any():
            along = np.clip((rest * way).sum(axis=1) / _squares(way[None]), 0.0, 1.0)
        apart = np.sqrt(_squares(rest - along[:, None] * way))
        worst = int(apart.argmax())
        if apart[worst] > tolerance + 1e-12:
            middle = low + 1 + worst
            kept.add(middle)
            parts += [(low, middle), (middle, high)]
    return points[sorted(kept)]


def _squares(ways: np.ndarray) -> np.ndarray:
    """Of the lengths of vectors (n, 2)."""
    return ways[:, 0] * ways[:, 0] + ways[:, 1] * ways[:, 1]


def _cross(loops: list[np.ndarray]) -> bool:
    """Whether some of their lines meet elsewhere than at a common end."""
    loops = [loop for loop in loops if len(loop) > 2]
    if not loops:
        return False
    starts, ends = np.concatenate(loops), np.concatenate([np.roll(loop, -1, axis=0) for loop in loops])
    low, high, way = np.minimum(starts, ends), np.maximum(starts, ends), ends - starts
    for k in range(len(starts) - 1):
        others = 1 + k + np.flatnonzero((low[k + 1 :] <= high[k]).all(axis=1) & (high[k + 1 :] >= low[k]).all(axis=1))
        p, q = starts[others] - starts[k], ends[others] - starts[k]
        one = _turn(way[k], p) * _turn(way[k], q) <= 0.0
        other = _turn(way[others], -p) * _turn(way[others], ends[k] - starts[others]) <= 0.0
        beside = (starts[others] == ends[k]).all(axis=1) | (ends[others] == starts[k]).all(axis=1)
        if (one & other & ~beside).any():
            return True
    return False


def _area(loop: np.ndarray) -> float:
    return 0.5 * float(_turn(loop, np.roll(loop, -1, axis=0)).sum())


def _turn(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
