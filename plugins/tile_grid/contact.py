"""The deepest contact of a shape with a map of tiles.

Faces of a rectangle that border on other tiles are internal. Contacts with them are ignored, unless the shape is so
deep inside that it meets no other faces.
"""

from __future__ import annotations

import math

from ...framework.compilation import part
from ...framework.jit.stack_arrays import stack_array
from ...framework.vectors import add, divided, length, sub
from ..standard_shapes import convex_convex
from .collider import ALL, WALLS
from .rectangles import (
    SLANT,
    TIE,
    WAITING,
    box_around,
    cell_at,
    faces_like,
    gaps,
    grown,
    halved,
    hidden,
    rectangle,
    sharp,
    tile_support,
    tiles_in,
)

DEEP = 16  # tiles: rectangles extend at most this far beyond a shape, so depth inside solid rock is exact up to it
SEEN = 8  # recent rectangles that are not tested again


@part
def deepest_contact(a, b, d, support, rounding):
    """The contact with the rectangle of tiles that the shape overlaps most, or is nearest to."""
    sums, tile = a.sums, a.tile_size
    columns = int(sums[0, 0])
    stride = columns + 1
    rows = (len(sums) - 1) // stride - 1
    middle = (0.5 * columns * tile, 0.5 * rows * tile)
    # The box around the shape, relative to the map's lower left corner.
    at = add(d, middle)
    left, right, lower, upper = box_around(b, support, rounding(b))
    left, right, lower, upper = at[0] + left, at[0] + right, at[1] + lower, at[1] + upper
    i0, i1 = cell_at(left / tile, columns), cell_at(right / tile, columns)
    j0, j1 = cell_at(lower / tile, rows), cell_at(upper / tile, rows)
    column0, row0 = i0, j0
    # A shape that ends exactly where a cell begins touches that cell and the one before.
    if i0 > 0 and left <= i0 * tile:
        i0 -= 1
    if j0 > 0 and lower <= j0 * tile:
        j0 -= 1
    # Enlarge the searched area around the shape until it contains tiles.
    ring = 0
    while True:
        x0, y0 = max(i0 - ring, 0), max(j0 - ring, 0)
        x1, y1 = min(i1 + 1 + ring, columns), min(j1 + 1 + ring, rows)
        if tiles_in(sums, stride, x0, y0, x1, y1) > 0.0:
            break
        if x0 == 0 and y0 == 0 and x1 == columns and y1 == rows:
            return False, -math.inf, (0.0, 1.0), (0.0, 0.0)
        ring = 2 * ring + 1
    # How far rectangles may grow beyond the shape: cut ends must never be the nearest way out.
    beyond = DEEP + max(i1 - i0, j1 - j0)
    waiting = stack_array(WAITING, (0, 0, 0, 0))
    seen = stack_array(SEEN, (0, 0, 0, 0))
    count, tested = 1, 0
    waiting[0, 0], waiting[0, 1], waiting[0, 2], waiting[0, 3] = x0, y0, x1, y1
    hit, depth, normal, point, width = False, -math.inf, (0.0, 1.0), (0.0, 0.0), 0.0
    # The deepest wall and floor (ceiling) contacts: signed depth along their axis.
    wall, floor = 0.0, 0.0
    # The deepest internal face, for a shape so far inside that it meets no other faces.
    inner_depth, inner_normal, inner_point = -math.inf, (0.0, 1.0), (0.0, 0.0)
    nearest = math.inf  # distance of the nearest face of any kind
    nearest_square = math.inf  # squared limit of the distance between boxes
    tie = TIE * tile
    while True:
        if count == 0:
            # A shape may be farther from a near tile than its box is; then another tile may be nearer.
            need = ring if nearest <= 0.0 else int(min(nearest / tile, 1.0 * columns + rows)) + 1
            if inner_depth > 0.0 and nearest == math.inf:
                need = ring  # deep inside
            if a.faces != ALL:
                need = max(need, 1)  # floors may be nearer than the requested walls, or the reverse
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
            # Grow in width, then in height; then the other way round.
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
            if -max(gap_x, gap_y) < min(depth, 0.0) - tie:  # the depth is at most the overlap of the boxes
                continue
            extent, centre = rectangle(u0, v0, u1, v1, tile, middle)
            touches, deep, n, p = convex_convex(extent, b, sub(d, centre), tile_support, support, sharp, rounding)
            if hidden(sums, stride, u0, v0, u1, v1, n, column0, row0, i1, j1):
                if deep > inner_depth:
                    inner_depth, inner_normal, inner_point = deep, n, add(centre, p)
                continue
            nearest = min(nearest, -deep)
            reach = max(nearest, 0.0 if a.faces == ALL else tile) * (1.0 + 1e-9)  # search distance
            nearest_square = reach * reach
            if not faces_like(n, a.faces):
                continue
            if deep > abs(wall) and abs(n[1]) <= SLANT:
                wall = deep if n[0] > 0.0 else -deep
            elif deep > abs(floor) and abs(n[0]) <= SLANT:
                floor = deep if n[1] > 0.0 else -deep
            # Of two equally deep contacts take the one with more of the shape above the face.
            along = min(right, u1 * tile) - max(left, u0 * tile)
            if abs(n[0]) > abs(n[1]):
                along = min(upper, v1 * tile) - max(lower, v0 * tile)
            if deep > depth + tie or (deep >= depth - tie and along > width):
                hit, depth, normal, point, width = touches, deep, n, add(centre, p), along
    if nearest > 0.0 and inner_depth > 0.0 and a.faces != WALLS:
        return True, inner_depth, inner_normal, inner_point
    if wall != 0.0 and floor != 0.0:  # in a corner: combine both into one contact
        depth = length((wall, floor))
        normal = divided((wall, floor), depth)
    return hit, depth, normal, point
