"""The cells of a map: the accepted inputs, and the array that a collider stores.

It holds the numbers of columns and rows; then a bit for each cell, ``BITS`` of them in a number, row by row from below,
each row with numbers of its own; then, if the map has materials or shapes, ``CODES_HEAD``
numbers, the table of materials, and the codes of all cells; then, per corner of a block of ``BLOCK`` x ``BLOCK`` cells,
the number of tiles below and left of it. Four of these sums give the number of
tiles in any rectangle of blocks: so finding tiles, and the rectangles they form, takes time proportional to the
logarithm of the distance, not to the size of the map. A cell that changes is one bit, a number in the sums above and
right of it, and its codes.

In Python a cell is a number: 0 if it is empty, else its material and ``SHAPE`` times its shape.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np

from .materials import MOST, WIDTH, TileShape

EMPTY = " ."  # characters of a map that are not tiles
HEAD = 2  # numbers before the bits
PER_NUMBER, PER_BLOCK = 5, 4  # powers of two:
BITS = 1 << PER_NUMBER  # cells in a number
BLOCK = 1 << PER_BLOCK  # cells along each side of a block
SHAPE = MOST + 1  # a cell is its material and this times its shape
SHAPES = len(TileShape)
CODES_HEAD = 2  # numbers before the table of materials: its rows, and how many cells have another shape than FULL
CODE_BITS, CODES_POWER = 12, 2  # of a number that holds the codes of cells, a power of two of them
PER_CODE_WORD = 1 << CODES_POWER
FEW = 64  # cells that change: more have one box around all
MANY = 1000  # the same: more make the whole array again


def cells_of_text(text: str | Iterable[str], *, empty: str = EMPTY) -> np.ndarray:
    """Cells (rows, columns) of a map drawn as text, from top to bottom: a tile for every character not in ``empty``.

    Lines may have different lengths. For a string, empty lines before the first and after the last line are removed,
    and so is the common indentation. ValueError if no cell is left.
    """
    marks = marks_of_text(text, "cells_of_text")
    return np.array([[mark not in empty for mark in line] for line in marks])


def marks_of_text(text: str | Iterable[str], where: str) -> np.ndarray:
    """(rows, columns) of characters, "" where a line is too short."""
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
        raise ValueError(f"{where}: the map has no cells, got {text!r}")
    return np.array([list(line) + [""] * (width - len(line)) for line in lines])


Entry = int | TileShape | tuple[int, TileShape]


def map_of_text(
    text: str | Iterable[str], legend: Mapping[str, Entry], *, empty: str = EMPTY
) -> tuple[np.ndarray, np.ndarray]:
    """(cells, shapes), each (rows, columns), of a map drawn as text, as for :func:`cells_of_text`. ValueError for a
    character that the legend cannot be read for.

    legend
        for characters: the number of a material, a TileShape, or both, (number, TileShape); others not in ``empty`` are
        full tiles of material 1
    """
    marks = marks_of_text(text, "map_of_text")
    cells = np.array([[mark not in empty for mark in line] for line in marks], np.int64)
    shapes = np.zeros_like(cells)
    for mark, entry in legend.items():
        number, shape = entry if isinstance(entry, tuple) else (1, entry)
        if not isinstance(shape, TileShape):
            number, shape = shape, TileShape.FULL
        if len(mark) != 1 or not isinstance(number, int) or not 0 < number <= MOST:
            raise ValueError(f"map_of_text: the legend gives a character a number from 1 to {MOST}, a TileShape, or "
                             f"both, got {mark!r}: {entry!r}")  # fmt: skip
        at = marks == mark
        cells[at], shapes[at] = number, shape
    return cells, shapes


def array_of(values: Any) -> np.ndarray:
    """As an array; an empty one of floats if they are none, as rows of different lengths."""
    try:
        return np.asarray(values)
    except ValueError:
        return np.empty(0)


def numbers_of(cells: Any, *, plain: bool) -> np.ndarray:
    """Cells as numbers from 0 to MOST, of a plain map only 0 and 1; ValueError if they are not a map."""
    if isinstance(cells, str) or (isinstance(cells, (list, tuple)) and cells and isinstance(cells[0], str)):
        return cells_of_text(cells).astype(np.int64)
    array = array_of(cells)
    if array.ndim != 2 or not array.size or array.dtype.kind not in "biu":
        got = f"an array of shape {array.shape}, dtype {array.dtype}" if isinstance(cells, np.ndarray) else repr(cells)
        raise ValueError(f"TileGridCollider.cells must be rows of the same length, of bool or integers, got {got}")
    if plain:
        return (array != 0).astype(np.int64)
    wrong = np.argwhere((array < 0) | (array > MOST))
    if len(wrong):
        row, x = wrong[0].tolist()
        raise ValueError(f"TileGridCollider.cells: materials are 1 to {MOST}, and 0 for an empty cell, "
                         f"got {array[row, x]} at row {row}, column {x}")  # fmt: skip
    return array.astype(np.int64)


def with_shapes(numbers: np.ndarray, shapes: Any) -> np.ndarray:
    """The cells with shapes (rows, columns), which empty ones have none of; ValueError if these do not fit."""
    array = array_of(shapes)
    if array.shape != numbers.shape or array.dtype.kind not in "iu":
        raise ValueError(f"TileGridCollider.shapes must have the shape {numbers.shape} of the cells, of TileShape, "
                         f"got an array of shape {array.shape}, dtype {array.dtype}")  # fmt: skip
    wrong = np.argwhere((array < 0) | (array >= SHAPES))
    if len(wrong):
        row, x = wrong[0].tolist()
        raise ValueError(f"TileGridCollider.shapes: shapes are those of TileShape, 0 to {SHAPES - 1}, "
                         f"got {array[row, x]} at row {row}, column {x}")  # fmt: skip
    return np.where(numbers > 0, numbers + SHAPE * array.astype(np.int64), 0)


def packed_of(cells: np.ndarray, table: np.ndarray | None = None) -> np.ndarray:
    """The array for these cells; table: of their materials, None: of a plain map, of tiles and empty cells."""
    tiles = cells > 0
    rows, columns = tiles.shape
    words = np.zeros((rows, 4 * words_of(columns)), np.uint8)
    words[:, : -(-columns // 8)] = np.packbits(tiles[::-1], axis=1, bitorder="little")
    sums = np.zeros(_sums_shape(rows, columns))
    blocks = np.zeros((sums.shape[0] - 1, BLOCK, sums.shape[1] - 1, BLOCK), bool)
    blocks.reshape(blocks.shape[0] * BLOCK, -1)[:rows, :columns] = tiles[::-1]
    sums[1:, 1:] = blocks.sum(axis=(1, 3)).cumsum(axis=0).cumsum(axis=1)
    parts = [np.array((columns, rows), float), words.view("<u4").ravel()]
    if table is not None:
        codes = np.zeros((rows, code_words_of(columns) * PER_CODE_WORD), np.int64)
        codes[:, :columns] = cells[::-1]
        joined = (codes.reshape(rows, -1, PER_CODE_WORD) << CODE_BITS * np.arange(PER_CODE_WORD)).sum(axis=2)
        parts += [np.array((len(table), (cells >= SHAPE).sum()), float), table.ravel(), joined.ravel()]
    return np.concatenate((*parts, sums.ravel()))


def words_of(columns: int) -> int:
    """How many numbers the bits of a row take."""
    return -(-columns // BITS)


def code_words_of(columns: int) -> int:
    """How many numbers the codes of a row take."""
    return -(-columns // PER_CODE_WORD)


def shape_of(packed: np.ndarray) -> tuple[int, int]:
    """The numbers of rows and columns."""
    return int(packed[1, 0]), int(packed[0, 0])


def _sums_shape(rows: int, columns: int) -> tuple[int, int]:
    return -(-rows // BLOCK) + 1, -(-columns // BLOCK) + 1


def leading_of(packed: np.ndarray) -> int:
    """How many numbers the sums follow from: all before them."""
    return len(packed) - math.prod(_sums_shape(*shape_of(packed)))


def _after_bits(packed: np.ndarray) -> int:
    rows, columns = shape_of(packed)
    return HEAD + rows * words_of(columns)


def is_plain(packed: np.ndarray) -> bool:
    """Whether the map has neither materials nor shapes."""
    return leading_of(packed) == _after_bits(packed)


def tiles_of_packed(packed: np.ndarray) -> np.ndarray:
    """Which cells are tiles."""
    rows, columns = shape_of(packed)
    words = packed[HEAD : _after_bits(packed), 0].astype("<u4").reshape(rows, -1)
    return np.unpackbits(words.view(np.uint8), axis=1, count=columns, bitorder="little")[::-1] != 0


def table_of_packed(packed: np.ndarray) -> np.ndarray | None:
    """The table of materials, None of a plain map."""
    if is_plain(packed):
        return None
    start = _after_bits(packed)
    table = packed[start + CODES_HEAD : start + CODES_HEAD + int(packed[start, 0]) * WIDTH, 0]
    return table.reshape(-1, WIDTH).copy()


def cells_of_packed(packed: np.ndarray) -> np.ndarray:
    """The inverse of :func:`packed_of`."""
    if is_plain(packed):
        return tiles_of_packed(packed).astype(np.int64)
    rows, columns = shape_of(packed)
    words = packed[_codes_start(packed) : leading_of(packed), 0].astype(np.int64).reshape(rows, -1, 1)
    codes = words >> CODE_BITS * np.arange(PER_CODE_WORD) & (1 << CODE_BITS) - 1
    return codes.reshape(rows, -1)[::-1, :columns]


def _codes_start(packed: np.ndarray) -> int:
    start = _after_bits(packed)
    return start + CODES_HEAD + int(packed[start, 0]) * WIDTH


def cell_of_packed(packed: np.ndarray, row: int, x: int) -> int:
    """One cell of it."""
    rows, columns = shape_of(packed)
    y = rows - 1 - row
    if is_plain(packed):
        return int(packed.item(HEAD + y * words_of(columns) + x // BITS)) >> x % BITS & 1
    word = int(packed.item(_codes_start(packed) + y * code_words_of(columns) + x // PER_CODE_WORD))
    return word >> CODE_BITS * (x % PER_CODE_WORD) & (1 << CODE_BITS) - 1


def wrong_with(packed: np.ndarray) -> str | None:
    wrong = "must be what TileGridCollider makes of cells"
    rows, columns = shape_of(packed) if len(packed) > HEAD else (0, 0)
    if not (rows >= 1 and columns >= 1):
        return wrong
    plain = HEAD + rows * words_of(columns)
    length = plain + math.prod(_sums_shape(rows, columns))
    if len(packed) > length:
        length += CODES_HEAD + int(max(packed[plain, 0], 0.0)) * WIDTH + rows * code_words_of(columns)
    if len(packed) != length:
        return wrong
    return None if np.array_equal(packed[:, 0], packed_of(cells_of_packed(packed), table_of_packed(packed))) else wrong


# -- changes -----------------------------------------------------------------------------------------------------------

Change = tuple[int, int, int, int]  # of one cell: column, row from below, before, after
Write = Callable[[np.ndarray], Iterable[int]]  # into the array of a map; returns the places of leading numbers


def change_of(packed: np.ndarray, places: np.ndarray, cells: np.ndarray) -> tuple[Write, np.ndarray] | None:
    """What makes the cells at places (k, 2), by row and column, others, and boxes around all that is another then; None
    if they are that already. Of a place that is there twice the last value holds.

    boxes: (n, 4) columns and rows from below, lower and upper ends
    """
    if len(places) > MANY:
        before = cells_of_packed(packed)
        after = before.copy()
        after[places[:, 0], places[:, 1]] = cells
        places = np.argwhere(after != before)
        if len(places) > MANY:
            low, high = (len(after) - 1 - places[:, 0]).min(), (len(after) - 1 - places[:, 0]).max()
            box = places[:, 1].min() - 1.0, low - 1.0, places[:, 1].max() + 2.0, high + 2.0
            return partial(_write_whole, cells=after), np.array((box,))
        cells = after[places[:, 0], places[:, 1]]
    last = dict(zip(map(tuple, places.tolist()), cells.tolist(), strict=True))
    changes = list(_changes_of(packed, last))
    if not changes:
        return None
    low = np.array(changes, float)[:, :2] - 1.0
    high = low + 3.0
    if len(changes) > FEW:
        low, high = low.min(axis=0)[None], high.max(axis=0)[None]
    return partial(_write_changes, changes=changes), np.concatenate((low, high), axis=1)


def _changes_of(packed: np.ndarray, wanted: dict[tuple[int, int], int]) -> Iterator[Change]:
    """The cells that are not as wanted."""
    rows = shape_of(packed)[0]
    for (row, x), cell in wanted.items():
        before = cell_of_packed(packed, row, x)
        if before != cell:
            yield x, rows - 1 - row, before, cell


def _write_changes(packed: np.ndarray, changes: list[Change]) -> list[int]:
    (rows, columns), plain = shape_of(packed), is_plain(packed)
    words, touched = words_of(columns), []
    sums = packed[leading_of(packed) :].reshape(_sums_shape(rows, columns))
    shaped = _after_bits(packed) + 1
    for x, y, before, after in changes:
        sign = (after > 0) - (before > 0)
        if sign:
            touched.append(HEAD + y * words + x // BITS)
            packed[touched[-1]] += sign * 2.0 ** (x % BITS)
            sums[y // BLOCK + 1 :, x // BLOCK + 1 :] += sign
        if not plain:
            touched.append(_codes_start(packed) + y * code_words_of(columns) + x // PER_CODE_WORD)
            packed[touched[-1]] += (after - before) * 2.0 ** (CODE_BITS * (x % PER_CODE_WORD))
            touched.append(shaped)
            packed[shaped] += (after >= SHAPE) - (before >= SHAPE)
    return touched


def _write_whole(packed: np.ndarray, cells: np.ndarray) -> Iterable[int]:
    packed[:, 0] = packed_of(cells, table_of_packed(packed))
    return range(leading_of(packed))
