"""A map of square tiles in 2D as one static collider; what slides along its tiles feels no seams between them.

Tiles have no sides of their own: a shape is tested against rectangles of tiles, as large as they come, so that where
two tiles meet there is nothing to be caught at. Of all rectangles near the shape the one it is deepest in gives the
contact. How many tiles a rectangle of the map holds is known from four sums, whatever its size: looking for tiles, and
for the rectangles they make, takes the logarithm of the distance, and never as long as the map is large.

Faces of a rectangle that border on other tiles are none, and contacts with them are left out, unless the shape is so
deep inside that it meets no others.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable
from typing import Any, ClassVar, Self

import numpy as np

from ..components.colliders import ALL_LAYERS, Collider
from ..framework import Convex, Plugin, array_column, column
from ..framework.columns import Column
from ..framework.compilation import part
from ..framework.stack_arrays import stack_array
from ..framework.vectors import add, add_scaled, divided, dot, length, sub
from .standard_shapes import convex_convex

plugin = Plugin("tile grid", version="1.0")

FACES = ("all", "floors", "walls")
ALL, FLOORS, WALLS = range(3)
DEEP = 16  # tiles: how far beyond a shape rectangles are looked at, so how deep inside of rock depth is still exact
WAITING = 64  # blocks of tiles still to be looked at: two for each halving of the map
SEEN = 8  # rectangles that need not be tested twice
LOOKS = 100  # for the time of a touch; a graze takes about 30
ROUNDING = 4e-16  # of the distance: a gap smaller than that is none
SLANT = 1e-9  # radians; a face that leans by less is none but parallel to the tiles
TIE = 1e-9  # of a tile: which of two contacts is deeper is no matter then

# Arguments, checked as fields are.
LOWER = Column(item="vector", owner="TileGridCollider", name="lower")
EMPTY = " ."  # characters of a map that are no tile


def wrong_with(sums: np.ndarray) -> str | None:
    columns = int(sums[0, 0])
    if columns < 1 or (len(sums) - 1) % (columns + 1) or len(sums) < 1 + 2 * (columns + 1):
        return "must be what TileGridCollider makes of cells"
    return None


def _tiles(cells: Any) -> np.ndarray:
    """Cells as bool; ValueError if they are no map."""
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


def _sums(tiles: np.ndarray) -> np.ndarray:
    rows, columns = tiles.shape
    sums = np.zeros((rows + 1, columns + 1))
    sums[1:, 1:] = tiles[::-1].cumsum(axis=0).cumsum(axis=1)
    return np.concatenate(((float(columns),), sums.ravel()))


def cells_of_text(text: str | Iterable[str], *, empty: str = EMPTY) -> np.ndarray:
    """A map as drawn, lines of text from top to bottom, as cells: a tile for every character that is not in ``empty``.

    Lines may be shorter than others. Of a string empty lines before the first and after the last are left out, and so
    is what all its lines are indented by.
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


@plugin.shape(cost=20)
class TileGridCollider(Collider):
    """A map of square tiles in a 2D world. It does not turn with the Transform.

    cells
        (rows, columns), true or not zero where there is a tile, or text, see :func:`cells_of_text`; the first row is
        the top one, as maps are drawn
    tile_size
        m, the sides of a tile
    faces
        ``"all"``; ``"floors"``: floors and ceilings only; ``"walls"``: walls only, see :meth:`floors_and_walls`
    lower
        (2,) m, where the map's lower left corner lies, from the Transform's position; without it the map's middle lies
        at ``offset``
    """

    __slots__ = ()

    dimensions: ClassVar[tuple[int, ...]] = (2,)

    # The number of columns; then for each corner of a cell how many tiles lie below and left of it, lowest row first.
    sums = array_column(1, rows=(5, 2**31), check=wrong_with, lengths=False)
    tile_size = column(positive=True)
    faces = column("all", choices=FACES)

    def __init__(
        self,
        cells: Any,
        tile_size: float,
        *,
        faces: str = "all",
        lower: Any = None,
        offset: Any = 0.0,
        restitution: float = 0.0,
        friction: float | None = None,
        sensor: bool = False,
        layer: int = 1,
        mask: int = ALL_LAYERS,
    ) -> None:
        tiles = _tiles(cells)
        size = type(self).tile_size.checked(tile_size)
        if lower is not None:
            if np.any(offset):
                raise ValueError(f"TileGridCollider: lower says where the map lies, and offset too, got {offset!r}")
            offset = np.broadcast_to(LOWER.checked(lower), 2) + 0.5 * size * np.array(tiles.shape[::-1])
        common = {"offset": offset, "restitution": restitution, "friction": friction, "sensor": sensor}
        self._fill({"sums": _sums(tiles), "tile_size": size, "faces": faces, **common, "layer": layer, "mask": mask})

    @classmethod
    def floors_and_walls(cls, cells: Any, tile_size: float, **common: Any) -> tuple[Self, Self]:
        """The map as two colliders, to be given to two entities: its floors and ceilings, and its walls.

        Two bodies have one contact. A body that is pushed against a wall and stands on the floor needs two, which it
        has with two entities, and then stands still. Both share their memory.
        """
        return cls(cells, tile_size, faces="floors", **common), cls(cells, tile_size, faces="walls", **common)

    @classmethod
    def sample(cls, **common: Any) -> Self:
        return cls(((1, 0), (1, 1)), 0.5, **common)

    @property
    def cells(self) -> np.ndarray:
        """(rows, columns) of bool, the top row first; a copy. Assign another to change the map."""
        sums = self.sums[1:, 0].reshape(-1, int(self.sums[0, 0]) + 1)
        return np.diff(np.diff(sums, axis=0), axis=1)[::-1] > 0.0

    @cells.setter
    def cells(self, cells: Any) -> None:
        tiles = _tiles(cells)
        if tiles.shape != self.cells.shape:
            raise ValueError(f"TileGridCollider.cells must keep its shape {self.cells.shape}, got {tiles.shape}")
        self.sums = _sums(tiles)

    def centre_of(self, row: int, column: int) -> np.ndarray:
        """(2,) m, the middle of a cell, from the Transform's position; row 0 is the top one."""
        rows, columns = self.cells.shape
        if not (0 <= row < rows and 0 <= column < columns):
            raise ValueError(f"TileGridCollider.centre_of: the map has {rows} rows and {columns} columns, "
                             f"got row {row}, column {column}")  # fmt: skip
        cell = np.array((column + 0.5 - 0.5 * columns, 0.5 * rows - row - 0.5))
        return np.broadcast_to(self.offset, 2) + cell * self.tile_size

    def __repr__(self) -> str:
        cells = self.cells
        shared = ", ".join(f"{name}={getattr(self, name)!r}" for name in self.stacked_columns)
        return (
            f"<TileGridCollider of {cells.shape[0]} rows and {cells.shape[1]} columns, {int(cells.sum())} tiles, "
            f"tile_size={self.tile_size!r}, {shared}>"
        )

    @staticmethod
    def bounds(shape, dimensions):
        columns = shape.sums[0, 0]
        rows = (len(shape.sums) - 1) / (columns + 1.0) - 1.0
        return 0.5 * columns * shape.tile_size, 0.5 * rows * shape.tile_size



# -- rectangles of cells: columns x0 to x1, rows y0 to y1 (from below), the ends not included ----------------------


@plugin.kernel
def tiles_in(sums, stride, x0, y0, x1, y1):
    """How many tiles a rectangle holds."""
    low, high = 1 + y0 * stride, 1 + y1 * stride
    return (sums[high + x1, 0] - sums[high + x0, 0]) - (sums[low + x1, 0] - sums[low + x0, 0])


@plugin.kernel
def full(sums, stride, x0, y0, x1, y1):
    """Whether all its cells are tiles."""
    return tiles_in(sums, stride, x0, y0, x1, y1) == (x1 - x0) * (y1 - y0)


@plugin.kernel
def moved_side(x0, y0, x1, y1, side, way):
    """The rectangle with its side (left, right, lower, upper) moved outwards."""
    if side == 0:
        return x0 - way, y0, x1, y1
    if side == 1:
        return x0, y0, x1 + way, y1
    if side == 2:
        return x0, y0 - way, x1, y1
    return x0, y0, x1, y1 + way


@part
def grown(sums, stride, x0, y0, x1, y1, side, room):
    """A rectangle full of tiles with one side moved outwards, at most by ``room``, as long as it stays full."""
    low, high = 0, max(room, 0)
    step = high  # most often it can grow all the way, or not at all
    while low < high:
        u0, v0, u1, v1 = moved_side(x0, y0, x1, y1, side, step)
        if full(sums, stride, u0, v0, u1, v1):
            low = step
        else:
            high = step - 1
        step = 1 if low == 0 and step == max(room, 0) else (low + high + 1) // 2
    return moved_side(x0, y0, x1, y1, side, low)


@plugin.kernel
def cell_at(way, count):
    """The cell in which a place lies, in tiles from the map's edge; at the edge for one outside of the map, or NaN."""
    if not way > 0.0:
        return 0
    if way >= count:
        return count - 1
    return int(way)


@plugin.kernel
def gaps(low, high, first, last, tile):
    """How far the interval low to high, in metres, is from cells first to last (negative: inside), from both sides."""
    return low - last * tile, first * tile - high


@plugin.kernel
def tile_support(half, direction):
    """A corner of a rectangle."""
    return (half[0] if direction[0] >= 0.0 else -half[0], half[1] if direction[1] >= 0.0 else -half[1])


@plugin.kernel
def sharp(half):
    return 0.0


@plugin.kernel
def halved(waiting, count, x0, y0, x1, y1, right_first, upper_first):
    """Put both halves of a rectangle, cut across its longer side, where ``count`` is; the first one goes on top."""
    cut_x, cut_y = x1, y1  # of the left or lower half
    if x1 - x0 >= y1 - y0:
        cut_x = (x0 + x1) // 2
        second_first = right_first
    else:
        cut_y = (y0 + y1) // 2
        second_first = upper_first
    for turn in range(2):
        if (turn == 1) == second_first:
            waiting[count, 0] = cut_x if cut_x < x1 else x0
            waiting[count, 1] = cut_y if cut_y < y1 else y0
            waiting[count, 2], waiting[count, 3] = x1, y1
        else:
            waiting[count, 0], waiting[count, 1], waiting[count, 2], waiting[count, 3] = x0, y0, cut_x, cut_y
        count += 1
    return count


@plugin.kernel
def box_around(b, support, around):
    """Left, right, lower and upper end of a shape, from its centre."""
    left, right = support(b, (-1.0, 0.0))[0] - around, support(b, (1.0, 0.0))[0] + around
    return left, right, support(b, (0.0, -1.0))[1] - around, support(b, (0.0, 1.0))[1] + around


@plugin.kernel
def rectangle(x0, y0, x1, y1, tile, middle):
    """Its half extents, and its middle from that of the map."""
    extent = (0.5 * (x1 - x0) * tile, 0.5 * (y1 - y0) * tile)
    return extent, (0.5 * (x0 + x1) * tile - middle[0], 0.5 * (y0 + y1) * tile - middle[1])


@plugin.kernel
def faces_like(n, faces):
    """Whether a contact with that normal is with the faces that count."""
    return faces == ALL or (abs(n[1]) >= abs(n[0])) == (faces == FLOORS)


@plugin.kernel
def solid(sums, stride, x0, y0, x1, y1):
    """Whether cells are all tiles; what lies beyond the map is none."""
    if x0 < 0 or y0 < 0 or x1 >= stride or 1 + (y1 + 1) * stride > len(sums):
        return False
    return full(sums, stride, x0, y0, x1, y1)


@part
def hidden(sums, stride, x0, y0, x1, y1, n, column0, row0, column1, row1):
    """Whether the face, or the corner, at which a shape meets a rectangle borders on other tiles.

    n: the contact's normal; column0 to row1: the cells under the shape's box.
    """
    beside = x1 if n[0] > 0.0 else x0 - 1
    above = y1 if n[1] > 0.0 else y0 - 1
    if abs(n[0]) > SLANT and abs(n[1]) > SLANT:
        x, y = x1 - 1 if n[0] > 0.0 else x0, y1 - 1 if n[1] > 0.0 else y0
        side, top = solid(sums, stride, beside, y, beside + 1, y + 1), solid(sums, stride, x, above, x + 1, above + 1)
        return side or top
    if abs(n[0]) > SLANT:
        first, last = min(max(row0, y0), y1 - 1), min(max(row1, y0), y1 - 1)
        return solid(sums, stride, beside, first, beside + 1, last + 1)
    first, last = min(max(column0, x0), x1 - 1), min(max(column1, x0), x1 - 1)
    return solid(sums, stride, first, above, last + 1, above + 1)


@part
def deepest_contact(a, b, d, support, rounding):
    """The contact with the rectangle of tiles that the shape is deepest in, or nearest to."""
    sums, tile = a.sums, a.tile_size
    columns = int(sums[0, 0])
    stride = columns + 1
    rows = (len(sums) - 1) // stride - 1
    middle = (0.5 * columns * tile, 0.5 * rows * tile)
    # The box around the shape, seen from the map's lower left corner.
    at = add(d, middle)
    left, right, lower, upper = box_around(b, support, rounding(b))
    left, right, lower, upper = at[0] + left, at[0] + right, at[1] + lower, at[1] + upper
    i0, i1 = cell_at(left / tile, columns), cell_at(right / tile, columns)
    j0, j1 = cell_at(lower / tile, rows), cell_at(upper / tile, rows)
    column0, row0 = i0, j0
    # A shape that ends where a cell begins touches it, and the one before.
    if i0 > 0 and left <= i0 * tile:
        i0 -= 1
    if j0 > 0 and lower <= j0 * tile:
        j0 -= 1
    # Around the shape, ever farther, until there are tiles.
    ring = 0
    while True:
        x0, y0 = max(i0 - ring, 0), max(j0 - ring, 0)
        x1, y1 = min(i1 + 1 + ring, columns), min(j1 + 1 + ring, rows)
        if tiles_in(sums, stride, x0, y0, x1, y1) > 0.0:
            break
        if x0 == 0 and y0 == 0 and x1 == columns and y1 == rows:
            return False, -math.inf, (0.0, 1.0), (0.0, 0.0)
        ring = 2 * ring + 1
    # How far rectangles may grow beyond the shape: ends that are none must never be the nearest way out.
    beyond = DEEP + max(i1 - i0, j1 - j0)
    waiting = stack_array(WAITING, (0, 0, 0, 0))
    seen = stack_array(SEEN, (0, 0, 0, 0))
    count, tested = 1, 0
    waiting[0, 0], waiting[0, 1], waiting[0, 2], waiting[0, 3] = x0, y0, x1, y1
    hit, depth, normal, point, width = False, -math.inf, (0.0, 1.0), (0.0, 0.0), 0.0
    # The deepest of walls and of floors (ceilings): how far it pushes, along its axis.
    wall, floor = 0.0, 0.0
    # Of faces that are none, for what is so far inside that it meets no others.
    inner_depth, inner_normal, inner_point = -math.inf, (0.0, 1.0), (0.0, 0.0)
    nearest = math.inf  # how far the nearest face of any kind is
    nearest_square = math.inf  # of how far the boxes are apart
    tie = TIE * tile
    while True:
        if count == 0:
            # A shape may be farther from a tile beside it than its box is, and then there may be a nearer one.
            need = ring if nearest <= 0.0 else int(min(nearest / tile, 1.0 * columns + rows)) + 1
            if inner_depth > 0.0 and nearest == math.inf:
                need = ring  # deep inside
            if a.faces != ALL:
                need = max(need, 1)  # floors may be nearer than the walls that are asked for
            if need <= ring:
                break
            ring, count = need, 1
            waiting[0, 0], waiting[0, 1] = max(i0 - ring, 0), max(j0 - ring, 0)
            waiting[0, 2], waiting[0, 3] = min(i1 + 1 + ring, columns), min(j1 + 1 + ring, rows)
        count -= 1
        x0, y0, x1, y1 = waiting[count, 0], waiting[count, 1], waiting[count, 2], waiting[count, 3]
        inside = tiles_in(sums, stride, x0, y0, x1, y1)
        if inside == 0.0:
            continue
        gap_left, gap_right = gaps(left, right, x0, x1, tile)
        gap_lower, gap_upper = gaps(lower, upper, y0, y1, tile)
        apart_x, apart_y = max(gap_left, gap_right, 0.0), max(gap_lower, gap_upper, 0.0)
        square = apart_x * apart_x + apart_y * apart_y
        if square > nearest_square:
            continue
        if inside < (x1 - x0) * (y1 - y0):
            across, up = at[0] >= 0.5 * (x0 + x1) * tile, at[1] >= 0.5 * (y0 + y1) * tile
            count = halved(waiting, count, x0, y0, x1, y1, across, up)
            continue
        for turn in range(2):
            # As wide as it goes and then as high; then the other way round.
            u0, v0, u1, v1 = x0, y0, x1, y1
            for k in range(4):
                side = k if turn == 0 else (k + 2) % 4
                room = min(u0, u0 - i0 + beyond)
                if side == 1:
                    room = min(columns - u1, i1 + 1 + beyond - u1)
                elif side == 2:
                    room = min(v0, v0 - j0 + beyond)
                elif side == 3:
                    room = min(rows - v1, j1 + 1 + beyond - v1)
                u0, v0, u1, v1 = grown(sums, stride, u0, v0, u1, v1, side, room)
            known = False
            for k in range(min(tested, SEEN)):
                known |= seen[k, 0] == u0 and seen[k, 1] == v0 and seen[k, 2] == u1 and seen[k, 3] == v1
            if known:
                continue
            place = tested % SEEN
            seen[place, 0], seen[place, 1], seen[place, 2], seen[place, 3] = u0, v0, u1, v1
            tested += 1
            gap_left, gap_right = gaps(left, right, u0, u1, tile)
            gap_lower, gap_upper = gaps(lower, upper, v0, v1, tile)
            gap_x, gap_y = max(gap_left, gap_right), max(gap_lower, gap_upper)
            if -max(gap_x, gap_y) < min(depth, 0.0) - tie:  # no deeper than the boxes are
                continue
            extent, centre = rectangle(u0, v0, u1, v1, tile, middle)
            touches, deep, n, p = convex_convex(extent, b, sub(d, centre), tile_support, support, sharp, rounding)
            if hidden(sums, stride, u0, v0, u1, v1, n, column0, row0, i1, j1):
                if deep > inner_depth:
                    inner_depth, inner_normal, inner_point = deep, n, add(centre, p)
                continue
            nearest = min(nearest, -deep)
            reach = max(nearest, 0.0 if a.faces == ALL else tile) * (1.0 + 1e-9)  # of interest: what is so near
            nearest_square = reach * reach
            if not faces_like(n, a.faces):
                continue
            if deep > abs(wall) and abs(n[1]) <= SLANT:
                wall = deep if n[0] > 0.0 else -deep
            elif deep > abs(floor) and abs(n[0]) <= SLANT:
                floor = deep if n[1] > 0.0 else -deep
            # Of two as deep it is the one that more of the shape stands on.
            along = min(right, u1 * tile) - max(left, u0 * tile)
            if abs(n[0]) > abs(n[1]):
                along = min(upper, v1 * tile) - max(lower, v0 * tile)
            if deep > depth + tie or (deep >= depth - tie and along > width):
                hit, depth, normal, point, width = touches, deep, n, add(centre, p), along
    if nearest > 0.0 and inner_depth > 0.0 and a.faces != WALLS:
        return True, inner_depth, inner_normal, inner_point
    if wall != 0.0 and floor != 0.0:  # in a corner, out of which it goes in one move
        depth = length((wall, floor))
        normal = divided((wall, floor), depth)
    return hit, depth, normal, point


@plugin.pair(TileGridCollider, Convex)
def tile_grid_convex(a, b, d, support, rounding):
    """Kept out of the kernels that call it: it is long, and they are several."""
    return deepest_contact(a, b, d, support, rounding)


@plugin.kernel
def passing(low, high, v, start, stop, enter, leave):
    """The part of the time from ``enter`` to ``leave`` in which low to high, moving by v, is over start to stop."""
    if v == 0.0:
        return enter, leave if high >= start and low <= stop else -1.0
    one, two = (start - high) / v, (stop - low) / v
    return max(enter, min(one, two)), min(leave, max(one, two))


@part
def first_touch(a, b, d, v, support, rounding):
    """When a shape that moves first touches a tile: through all rectangles full of tiles on its way, nearest first.

    With each it is found as between convex shapes: a plane lies in the gap, and it is free to move up to that.
    """
    sums, tile = a.sums, a.tile_size
    columns = int(sums[0, 0])
    stride = columns + 1
    rows = (len(sums) - 1) // stride - 1
    middle = (0.5 * columns * tile, 0.5 * rows * tile)
    at = add(d, middle)
    left, right, lower, upper = box_around(b, support, rounding(b))
    left, right, lower, upper = at[0] + left, at[0] + right, at[1] + lower, at[1] + upper
    waiting = stack_array(WAITING, (0, 0, 0, 0))
    waiting[0, 0], waiting[0, 1], waiting[0, 2], waiting[0, 3] = 0, 0, columns, rows
    count, best = 1, math.inf
    tie = TIE * tile
    while count > 0:
        count -= 1
        x0, y0, x1, y1 = waiting[count, 0], waiting[count, 1], waiting[count, 2], waiting[count, 3]
        inside = tiles_in(sums, stride, x0, y0, x1, y1)
        if inside == 0.0:
            continue
        enter, leave = passing(left, right, v[0], x0 * tile - tie, x1 * tile + tie, 0.0, min(best, 1.0))
        enter, leave = passing(lower, upper, v[1], y0 * tile - tie, y1 * tile + tie, enter, leave)
        if not enter <= leave:
            continue
        if inside < (x1 - x0) * (y1 - y0):
            count = halved(waiting, count, x0, y0, x1, y1, v[0] < 0.0, v[1] < 0.0)
            continue
        extent, centre = rectangle(x0, y0, x1, y1, tile, middle)
        time = enter
        for look in range(LOOKS):
            way = sub(add_scaled(d, v, time), centre)
            touches, deep, n, _ = convex_convex(extent, b, way, tile_support, support, sharp, rounding)
            rate = -dot(v, n)
            touches |= -deep <= ROUNDING * length(way) and (look > 0 or rate > 0.0)
            if touches or not rate > 0.0:
                break
            further = time - deep / rate
            if further > min(best, 1.0):
                break
            touches = look == LOOKS - 1 or not further > time
            if touches:
                break
            time = further
        if touches and faces_like(n, a.faces):
            best = min(best, time)
    return best <= 1.0, best


@plugin.sweep(TileGridCollider, Convex)
def tile_grid_convex_sweep(a, b, d, v, support, rounding):
    return first_touch(a, b, d, v, support, rounding)
