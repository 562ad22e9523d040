"""The cells of a map: the accepted inputs, and the sums that a collider stores.

Four sums give the number of tiles in any rectangle of the map. So finding tiles, and the rectangles they form, takes
time proportional to the logarithm of the distance, not to the size of the map.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable
from typing import Any

import numpy as np

EMPTY = " ."  # characters of a map that are not tiles


def cells_of_text(text: str | Iterable[str], *, empty: str = EMPTY) -> np.ndarray:
    """Cells of a map drawn as text, lines from top to bottom: a tile for every character that is not in ``empty``.

    Lines may have different lengths. For a string, empty lines before the first and after the last line are removed,
    and so is the common indentation.
    """
    if isinstance(text, str):
        lines = textwrap.dedent(text).splitlines()
        while lines and not lines[0].strip():
            del lines[0]
        while lines and not lines[-1].strip():
            del lines[-1]
    else:
        lines = list(text)
    width = max((len(line) for line in lines), default=0)
    if not width:
        raise ValueError(f"cells_of_text: the map has no cells, got {text!r}")
    return np.array([[mark not in empty for mark in line] + [False] * (width - len(line)) for line in lines])


def tiles_of(cells: Any) -> np.ndarray:
    """Cells as bool; ValueError if they are not a map."""
    if isinstance(cells, str) or (isinstance(cells, (list, tuple)) and cells and isinstance(cells[0], str)):
        return cells_of_text(cells)
    try:
        array = np.asarray(cells)
    except ValueError:
        array = np.empty(0)
    if array.ndim != 2 or not array.size or array.dtype.kind not in "biu":
        got = f"an array of shape {array.shape}, dtype {array.dtype}" if isinstance(cells, np.ndarray) else repr(cells)
        raise ValueError(f"TileGridCollider.cells must be rows of the same length, of bool or integers, got {got}")
    return array != 0


def sums_of(tiles: np.ndarray) -> np.ndarray:
    """The number of columns; then, per corner of a cell, the number of tiles below and left of it, lowest row first."""
    rows, columns = tiles.shape
    sums = np.zeros((rows + 1, columns + 1))
    sums[1:, 1:] = tiles[::-1].cumsum(axis=0).cumsum(axis=1)
    return np.concatenate(((float(columns),), sums.ravel()))


def tiles_of_sums(sums: np.ndarray) -> np.ndarray:
    """The inverse of :func:`sums_of`."""
    corners = sums[1:].reshape(-1, int(sums[0]) + 1)
    return np.diff(np.diff(corners, axis=0), axis=1)[::-1] > 0.0


def wrong_with(sums: np.ndarray) -> str | None:
    columns = int(sums[0, 0])
    if columns < 1 or (len(sums) - 1) % (columns + 1) or len(sums) < 1 + 2 * (columns + 1):
        return "must be what TileGridCollider makes of cells"
    return None
