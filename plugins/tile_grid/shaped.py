"""How a shape meets a map near tiles that are not full: each run of the outline as a segment of a chain.

Farther from such tiles the map is one of full tiles, which those are in.
"""

from __future__ import annotations

import collections
import math

from ...framework.compilation import part
from ...framework.jit.stack_arrays import stack_array
from ...framework.vectors import add, add_scaled, divided, dot, length, negative, scale, sub
from ..terrain.segment import BEHIND as SEGMENT_BEHIND
from ..terrain.segment import FOLDED, contact_of_segment, cross
from .contact import box_on_map, cells_under, deepest_contact
from .faces import ALL, FLOORS, ONE_WAYS, plugin
from .outline import BEFORE, BEYOND, FULL, any_shaped, is_inside, next_run, shape_at
from .rectangles import cell_at, grid_of
from .shapes import core_of
from .singly import deepest_tile
from .surface import INSIDE, first_code
from .sweep import LOOKS, ROUNDING, first_touch

LOOKED = 0.05  # of a tile: how far around a shape faces are looked for; farther off there are no seams to see
BEHIND, ON = 0.1, 1e-6  # of a tile: how far the centre of a body in a tile, or of another, may be behind a face that
# pushes it out
REACH = 0.1  # of a tile: how far a face reaches into what follows an inner corner, if nothing is there
SUNK = 0.02  # of a tile: by how much a body may have sunk into a one-way cell
STRIDE, LONGEST = 0.01, 0.1  # of a tile: ways between two looks at a face that a shape is not over
TOUCHED = 8  # faces that a shape touches at once
PARALLEL = 1.0 - 1e-9  # cosine: faces that lean less from each other are one
OPPOSED = -0.1  # cosine: between faces that lean more against each other nothing is pushed out aside

Segment = collections.namedtuple("Segment", "start end before after thickness")


@plugin.kernel
def has_face(run, faces):
    """Whether a run is among the selected faces: slopes are with the walls, so that what goes from a floor to one has
    two contacts."""
    return faces in (ALL, ONE_WAYS) or (run.y0 == run.y1) == (faces == FLOORS)


@plugin.kernel
def is_shaped(packed):
    """Whether a map has a tile that is not full."""
    grid = grid_of(packed)
    start = first_code(grid)
    return start < grid[4] and packed[start + 1, 0] > 0.0


@part
def end_of_segment(end, way, beyond, short, inner, tile):
    """(end, point after it) of a run that leads by ``way`` to its end, and of the edge ``beyond``.

    A segment reaches into what follows an inner corner, by FOLDED of its length or as far as that goes. Tiles may be
    thin there: it must not come out on their other side, nor at all if it is ``short``.
    """
    size = length(way)
    if short != BEYOND:
        cut = min(0.45, FOLDED + (SUNK * tile / size if short == BEFORE else 0.0))
        end = add_scaled(end, way, 0.0 - cut)
        return end, add_scaled(end, way, 1e-3)
    if inner:
        end = add_scaled(end, way, min(0.0, REACH * tile / size - FOLDED))
        beyond = scale(beyond, 0.5)
    return end, add(end, beyond)


@part
def segment_of(run, tile, middle, behind):
    """A run of the outline as a segment of a chain, relative to the map's middle; behind: how far behind it the centre
    of a body may be that it pushes out."""
    half = 0.5 * tile
    start = (half * run.x0 - middle[0], half * run.y0 - middle[1])
    way = (half * (run.x1 - run.x0), half * (run.y1 - run.y0))
    back, ahead = (half * run.before_x, half * run.before_y), (half * run.after_x, half * run.after_y)
    end, after = end_of_segment(add(start, way), way, ahead, run.short_end, cross(way, ahead) > 0.0, tile)
    inner = cross(back, way) > 0.0
    start, before = end_of_segment(start, negative(way), negative(back), run.short_start, inner, tile)
    return Segment(start, end, before, after, behind - SEGMENT_BEHIND * length(sub(end, start)))


@part
def reach_of_shape(b, at, more, tile, size, support, rounding):
    """The rectangle of cells that a shape touches, or has no farther than ``more``."""
    return cells_under(box_on_map(core_of(b, support), rounding(b) + more, at), tile, size)[1]


@part
def outline_contact(a, b, d, cells, support, rounding):
    """The contact with the runs within a rectangle of cells: with the deepest face, or the nearest, that the shape is
    over."""
    grid, tile = grid_of(a.packed), a.tile_size
    middle = (0.5 * grid[1] * tile, 0.5 * grid[2] * tile)
    touched, count = stack_array(TOUCHED, (0.0, 0.0, 0.0, 0.0, 0.0)), 0
    one_way, at = a.faces == ONE_WAYS, 0
    depth, normal, point, first = -math.inf, (0.0, 1.0), d, -1  # of the best of the faces that it is over
    behind = (BEHIND if one_way or is_inside(grid, tile, add(d, middle)) else ON) * tile
    while True:
        at, there, run = next_run(grid, cells, one_way, at)
        if not there:
            break
        if not has_face(run, a.faces):
            continue
        over, deep, n, p = contact_of_segment(segment_of(run, tile, middle, behind), b, d, support, rounding)
        if not over:
            continue
        if deep >= 0.0 and count < TOUCHED:
            touched[count, 0], touched[count, 1], touched[count, 2] = deep, n[0], n[1]
            if deep > depth:
                first = count
            count += 1
        better = deep > depth
        if one_way:
            better = abs(deep) < abs(depth)  # of those one above the other that which it stands on
        if better:
            depth, normal, point = deep, n, p
    if depth >= 0.0:
        if count > 1 and not one_way:
            depth, normal = both_ways(touched, count, first)
        return True, depth, normal, point
    return False, depth, normal, point


@part
def both_ways(touched, count, first):
    """(depth, normal) of the shortest way out of the deepest of several faces, and of one more that it keeps."""
    deep, n = touched[first, 0], (touched[first, 1], touched[first, 2])
    depth, normal = deep, n
    for k in range(count):
        m = (touched[k, 1], touched[k, 2])
        cosine = dot(n, m)
        if k == first or not OPPOSED <= cosine <= PARALLEL:
            continue
        left = (touched[k, 0] - cosine * deep) / (1.0 - cosine * cosine)
        if left > 0.0:
            way = add_scaled(scale(n, (deep - cosine * touched[k, 0]) / (1.0 - cosine * cosine)), m, left)
            if length(way) > depth:
                depth, normal = length(way), divided(way, length(way))
    return depth, normal


@part
def is_with_full(a, contact):
    """Whether what a map with shapes is nearest with, if all its tiles count as full, is a full one; or nothing."""
    _, depth, normal, point = contact
    if depth == -math.inf:
        return True
    grid, tile = grid_of(a.packed), a.tile_size
    x, y = add_scaled(point, normal, 0.5 * depth - INSIDE * tile)
    shape = shape_at(grid, cell_at(x / tile + 0.5 * grid[1], grid[1]), cell_at(y / tile + 0.5 * grid[2], grid[2]))
    return shape == FULL


@part
def shaped_contact(a, b, d, support, rounding):
    """The contact of a shape with a map that has tiles that are not full."""
    grid, tile = grid_of(a.packed), a.tile_size
    size, one_way = (grid[1], grid[2]), a.faces == ONE_WAYS
    if one_way and not is_shaped(a.packed):
        return False, -math.inf, d, d
    place = add(d, (0.5 * size[0] * tile, 0.5 * size[1] * tile))
    cells = reach_of_shape(b, place, LOOKED * tile, tile, size, support, rounding)
    outlined, found, reach = one_way or any_shaped(grid, cells), (False, -math.inf, d, d), LOOKED * tile
    if outlined:
        found = outline_contact(a, b, d, cells, support, rounding)
        if found[0]:
            return found
    if not outlined or (not one_way and is_inside(grid, tile, place)):
        full = deepest_contact(a, b, d, support, rounding)
        if outlined or full[0] or a.faces != ALL or is_with_full(a, full):
            return full
        reach -= full[1]
    elif found[1] > -math.inf:
        reach = -found[1]
    single = deepest_tile(a, b, d, -math.inf if one_way else found[1], reach, support, rounding)
    better = single[1] < 0.0 if one_way else single[1] > found[1]
    return single if better else found


@part
def touch_of_segment(segment, b, motion, times, grid, support, rounding):
    """(whether, when) a shape that moves by v from d on first touches a segment, between two times. motion: (d, v);
    grid: (side of a tile, faces)."""
    (d, v), (tile, faces) = motion, grid
    (time, until), speed, before = times, length(v), times[0]
    for look in range(2 * LOOKS):
        at = add_scaled(d, v, time)
        over, deep, n, _ = contact_of_segment(segment, b, at, support, rounding)
        if not over:
            before = time
            time += min(max(-deep, STRIDE * tile), LONGEST * tile) / speed
        else:
            rate = -dot(v, n)
            if look == 0 and faces == ONE_WAYS and deep > SUNK * tile:
                return False, 0.0
            touches = deep >= 0.0 or (-deep <= ROUNDING * length(at) and (look > 0 or rate > 0.0))
            if touches and look > 0 and deep > 0.0 and rate > 0.0:  # it has come over it within a stride
                time = max(before, time - deep / rate)
            if touches or not rate > 0.0:
                return touches, time
            further = time - deep / rate
            if not further > time:
                return True, time
            time = further
        if time > until:
            break
    return False, 0.0


@part
def shaped_touch(a, b, d, v, support, rounding):
    """When a moving shape first touches a map that has tiles that are not full: by windows in which it moves by no more
    than a tile; where no such tile is near, it first goes on to the next tile of any shape."""
    grid, tile, faces = grid_of(a.packed), a.tile_size, a.faces
    if not is_shaped(a.packed):
        return False, 0.0
    size, speed = (grid[1], grid[2]), length(v)
    middle = (0.5 * size[0] * tile, 0.5 * size[1] * tile)
    if speed == 0.0:
        hit, _, _, _ = shaped_contact(a, b, d, support, rounding)
        return hit, 0.0
    time, window = 0.0, tile / speed
    while time <= 1.0:
        here = add_scaled(d, v, time)
        cells = reach_of_shape(b, add(here, middle), tile, tile, size, support, rounding)
        shaped = any_shaped(grid, cells)
        if not shaped and faces == ALL:
            hit, share = first_touch(a, b, here, scale(v, 1.0 - time), support, rounding)
            if not hit:
                return False, 0.0
            ahead = time + share * (1.0 - time)
            cells = reach_of_shape(b, add(add_scaled(d, v, ahead), middle), tile, tile, size, support, rounding)
            if not any_shaped(grid, cells):
                return True, min(ahead, 1.0)
            if ahead > time:
                time = ahead
                continue
        best, until, at = math.inf, min(time + window, 1.0), 0
        while shaped or faces != ONE_WAYS:
            at, there, run = next_run(grid, cells, faces == ONE_WAYS, at)
            if not there:
                break
            segment = segment_of(run, tile, middle, ON * tile)
            if not has_face(run, faces):
                continue
            hit, when = touch_of_segment(segment, b, (d, v), (time, min(until, best)), (tile, faces), support, rounding)
            if hit:
                best = min(best, when)
        if best <= 1.0:
            return True, best
        if until >= 1.0:
            break
        time = until
    return False, 0.0
