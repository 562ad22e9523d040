"""The cells of a map: the accepted inputs, and the array that a collider stores.

It holds the numbers of columns and rows; then a bit for each cell, ``BITS`` of them in a number, row by row from below,
each row with numbers of its own; then, per corner of a block of ``BLOCK`` x ``BLOCK`` cells, the number of tiles below
and left of it. Four of these sums give the number of tiles in any rectangle of blocks: so finding tiles, and the
rectangles they form, takes time proportional to the logarithm of the distance, not to the size of the map. A cell that
changes is one bit, and a number in the sums above and right of it.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import Any

import numpy as np

EMPTY = " ."  # characters of a map that are not tiles
HEAD = 2  # numbers before the bits
PER_NUMBER, PER_BLOCK = 5, 4  # powers of two:
BITS = 1 << PER_NUMBER  # cells in a number
BLOCK = 1 << PER_BLOCK  # cells along each side of a block
FEW = 64  # cells that change: more have one box around all
MANY = 1000  # the same: more make the whole array again


def cells_of_text(text: str | Iterable[str], *, empty: str = EMPTY) -> np.ndarray:
    """Cells (rows, columns) of a map drawn as text, from top to bottom: a tile for every character not in ``empty``.

    Lines may have different lengths. For a string, empty lines before the first and after the last line are removed,
    and so is the common indentation. ValueError if no cell is left.
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


def array_of(values: Any) -> np.ndarray:
    """As an array; an empty one of floats if they are none, as rows of different lengths."""
    try:
        return np.asarray(values)
    except ValueError:
        return np.empty(0)


def tiles_of(cells: Any) -> np.ndarray:
    """Cells as bool; ValueError if they are not a map."""
    if isinstance(cells, str) or (isinstance(cells, (list, tuple)) and cells and isinstance(cells[0], str)):
        return cells_of_text(cells)
    array = array_of(cells)
    if array.ndim != 2 or not array.size or array.dtype.kind not in "biu":
        got = f"an array of shape {array.shape}, dtype {array.dtype}" if isinstance(cells, np.ndarray) else repr(cells)
        raise ValueError(f"TileGridCollider.cells must be rows of the same length, of bool or integers, got {got}")
    return array != 0


def packed_of(tiles: np.ndarray) -> np.ndarray:
    """The array for these cells."""
    rows, columns = tiles.shape
    words = np.zeros((rows, 4 * words_of(columns)), np.uint8)
    words[:, : -(-columns // 8)] = np.packbits(tiles[::-1], axis=1, bitorder="little")
    sums = np.zeros(_sums_shape(rows, columns))
    blocks = np.zeros((sums.shape[0] - 1, BLOCK, sums.shape[1] - 1, BLOCK), bool)
    blocks.reshape(blocks.shape[0] * BLOCK, -1)[:rows, :columns] = tiles[::-1]
    sums[1:, 1:] = blocks.sum(axis=(1, 3)).cumsum(axis=0).cumsum(axis=1)
    return np.concatenate(((float(columns), float(rows)), words.view("<u4").ravel(), sums.ravel()))


def words_of(columns: int) -> int:
    """How many numbers the bits of a row take."""
    return -(-columns // BITS)


def shape_of(packed: np.ndarray) -> tuple[int, int]:
    """The numbers of rows and columns."""
    return int(packed[1, 0]), int(packed[0, 0])


def _sums_shape(rows: int, columns: int) -> tuple[int, int]:
    return -(-rows // BLOCK) + 1, -(-columns // BLOCK) + 1


def leading_of(packed: np.ndarray) -> int:
    """How many numbers the sums follow from: all before them."""
    rows, columns = shape_of(packed)
    return HEAD + rows * words_of(columns)


def tiles_of_packed(packed: np.ndarray) -> np.ndarray:
    """The inverse of :func:`packed_of`."""
    rows, columns = shape_of(packed)
    words = packed[HEAD : leading_of(packed), 0].astype("<u4").reshape(rows, -1)
    return np.unpackbits(words.view(np.uint8), axis=1, count=columns, bitorder="little")[::-1] != 0


def wrong_with(packed: np.ndarray) -> str | None:
    rows, columns = shape_of(packed) if len(packed) > HEAD else (0, 0)
    length = HEAD + rows * words_of(columns) + math.prod(_sums_shape(rows, columns))
    fits = rows >= 1 and columns >= 1 and len(packed) == length
    if fits and np.array_equal(packed[:, 0], packed_of(tiles_of_packed(packed))):
        return None
    return "must be what TileGridCollider makes of cells"


# -- changes -----------------------------------------------------------------------------------------------------------

Flip = tuple[int, int, int]  # of one cell: column, row from below, 1 if it becomes a tile, else -1
Write = Callable[[np.ndarray], Iterable[int]]  # into the array of a map; returns the places of numbers of bits


def change_of(packed: np.ndarray, cells: np.ndarray, tiles: np.ndarray) -> tuple[Write, np.ndarray] | None:
    """What makes cells (k, 2), by row and column, tiles or empty, and boxes around all that is another then; None if
    they are that already. Of a cell that is there twice the last value holds.

    boxes: (n, 4) columns and rows from below, lower and upper ends
    """
    if len(cells) > MANY:
        before = tiles_of_packed(packed)
        after = before.copy()
        after[cells[:, 0], cells[:, 1]] = tiles
        cells = np.argwhere(after != before)
        if len(cells) > MANY:
            low, high = (len(after) - 1 - cells[:, 0]).min(), (len(after) - 1 - cells[:, 0]).max()
            box = cells[:, 1].min() - 1.0, low - 1.0, cells[:, 1].max() + 2.0, high + 2.0
            return partial(_write_whole, tiles=after), np.array((box,))
        tiles = after[cells[:, 0], cells[:, 1]]
    last = dict(zip(map(tuple, cells.tolist()), tiles.tolist(), strict=True))
    flips = list(_flips_of(packed, last))
    if not flips:
        return None
    low = np.array(flips, float)[:, :2] - 1.0
    high = low + 3.0
    if len(flips) > FEW:
        low, high = low.min(axis=0)[None], high.max(axis=0)[None]
    return partial(_write_flips, flips=flips), np.concatenate((low, high), axis=1)


def _flips_of(packed: np.ndarray, wanted: dict[tuple[int, int], bool]) -> Iterator[Flip]:
    """The cells that are not as wanted."""
    rows, columns = shape_of(packed)
    words = words_of(columns)
    for (row, x), tile in wanted.items():
        y = rows - 1 - row
        bits = int(packed.item(HEAD + y * words + x // BITS))
        if bool(bits >> x % BITS & 1) != tile:
            yield x, y, 1 if tile else -1


def _write_flips(packed: np.ndarray, flips: list[Flip]) -> list[int]:
    rows, columns = shape_of(packed)
    words, places = words_of(columns), []
    sums = packed[HEAD + rows * words :].reshape(_sums_shape(rows, columns))
    for x, y, sign in flips:
        places.append(HEAD + y * words + x // BITS)
        packed[places[-1]] += sign * 2.0 ** (x % BITS)
        sums[y // BLOCK + 1 :, x // BLOCK + 1 :] += sign
    return places


def _write_whole(packed: np.ndarray, tiles: np.ndarray) -> Iterable[int]:
    packed[:, 0] = packed_of(tiles)
    return range(leading_of(packed))
