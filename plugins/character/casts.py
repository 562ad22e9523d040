"""What a character meets on its way, what it stands on, how deep it is in others: among the rows that are near it."""

from __future__ import annotations

import math

from ...framework.compilation import inlined, part
from ...framework.vectors import add, add_scaled, dot, item, length, negative, scale, sub
from ...systems.queries.compiled import (
    Path,
    box_interval,
    cast,
    front_of,
    inverse_of,
    is_from_front,
    is_one_way,
    is_sensor,
    overlap,
    to_collider,
)
from .records import CLIMB, EXACT

REACH = 10.0  # skins that a cast looks beyond its way
FOOT = 0.8  # of the half extent: what touches farther out is no floor
LEAN = 0.1  # of the half extent: how far it leans towards an edge to see what is behind it
STEEPEST = 0.01  # rise of a normal along up: less is a wall
EDGE_SINE = 1e-3  # of a normal to up: less is flat
STEEP_GROUND, SLOPE, EDGE, RIM = range(4)


@inlined
def is_dynamic(state, j):
    """Whether forces move row j."""
    return j < state.dynamic


@part
def holds(walker, j, out, distance, path):
    """Whether row j, met along that normal, is in the way: what is solid from one side is not from others. What stands
    in it no deeper than its skin stands on it, unless it climbs."""
    state = walker.state
    if not is_one_way(state, j):
        return True
    front = front_of(state, j)
    if walker.dropping or not is_from_front(front, out):
        return False
    if distance > 0.0:
        return True
    comes = dot(front, path.direction) < 0.0 and walker.character.state[walker.row] != CLIMB
    return comes and overlap(state, walker.row, j, path.start)[0] <= walker.skin


@inlined
def across(vector, up):
    """The part of a vector that is not along ``up``."""
    return add_scaled(vector, up, 0.0 - dot(vector, up))


@inlined
def comes_near(state, j, path, reach):
    """Whether the box around the shape on its path meets that around row j's, which is tighter than the one that is
    looked for in grids."""
    centre, half = add(state.bodies.position[j], state.bodies.offset[j]), state.bodies.half_extents[j]
    enter, leave = box_interval(sub(centre, half), add(centre, half), path, reach)
    return enter <= leave + EXACT


@part
def meet_character(walker, j, at, way):
    """(touches, distance, out, point) of another character: each may come half the way to where the other stood at the
    start, up to a plane between them, so that their order does not matter."""
    state = walker.state
    depth, out, point = overlap(state, walker.row, j, walker.start)
    along = 0.0 - dot(out, way)
    if along <= EXACT:
        return False, 0.0, out, point
    return True, (0.5 * (walker.skin - depth) + dot(sub(at, walker.start), out)) / along, out, point


@part
def meet(walker, j, path, reach):
    """(touches, distance, out, point) of row j on a path."""
    if walker.character.present[j]:
        return meet_character(walker, j, path.start, path.direction)
    if not comes_near(walker.state, j, path, reach):
        return False, 0.0, path.direction, path.start
    return cast(walker.state, walker.near, walker.row, j, path, reach, reach)


@part
def cast_near(walker, at, way, reach, ignored):
    """(row, distance, out, point) of what opposes a way first; row -1: it is free."""
    state, near, work = walker.state, walker.near, walker.work
    best, first, normal, touch = -1, reach, way, at
    path = Path(at, way, inverse_of(way), walker.half_extents)
    for k in range(walker.found):
        j = near.row[k]
        if j == ignored or is_sensor(state, j):
            continue
        touches, distance, out, point = meet(walker, j, path, first)
        along = dot(out, way)
        if not touches or distance >= first or along >= -EXACT or not holds(walker, j, out, distance, path):
            continue
        if distance <= 0.0 and is_dynamic(state, j) and along > -0.5:
            continue
        work.inside |= distance <= 0.0 and j >= state.moving
        best, first, normal, touch = j, distance, out, point
    return best, first, normal, touch


@inlined
def is_near(walker, j, at, margin):
    """Whether the box around its shape there comes so near to that around row j's."""
    away, half, close = to_collider(walker.state, at, j), walker.state.bodies.half_extents[j], True
    for m in range(len(away)):
        close &= abs(item(away, m)) <= item(half, m) + item(walker.half_extents, m) + margin
    return close


@part
def grazed(walker, at, way, ignored):
    """(row, back, out, point) of what it has come nearer to than its skin at the end of a way, and how far back that
    began, m, below 0; row -1: nothing. For casts that lies too far ahead, or behind what the way ends at. What it can
    stand on is left to :func:`floor_below`."""
    state, near, skin = walker.state, walker.near, walker.skin
    path = Path(at, way, inverse_of(way), walker.half_extents)
    best, first, normal, touch = -1, 0.0, way, at
    for k in range(walker.found):
        j = near.row[k]
        if j == ignored or is_sensor(state, j) or walker.character.present[j] or not is_near(walker, j, at, skin):
            continue
        depth, out, point = overlap(state, walker.row, j, at)
        slope, late = 0.0 - dot(out, way), depth + skin
        if late <= EXACT or slope <= EXACT or dot(out, walker.up) >= walker.limit:
            continue
        if 0.0 - late / slope < first and holds(walker, j, out, 0.0 - depth, path):
            best, first, normal, touch = j, 0.0 - late / slope, out, point
    return best, first, normal, touch


@part
def nearest_normal(walker, at, margin):
    """The normal of what is nearest to it there, of all within the margin; pieces of a terrain are as one."""
    state, near, character = walker.state, walker.near, walker.character
    deepest, normal = -math.inf, walker.up
    for k in range(walker.found):
        j = near.row[k]
        if not is_sensor(state, j) and not character.present[j] and is_near(walker, j, at, margin):
            depth, out, _ = overlap(state, walker.row, j, at)
            if depth > deepest:
                deepest, normal = depth, out
    return normal


@part
def ground_kind(walker, out, at, point):
    """Whether what it touches there is too steep, a slope that it can walk on, an edge that it can stand on, or the rim
    of one, too far out to stand on.

    At an edge the foot's normal turns as the foot moves: that is tried a little towards it and upwards.
    """
    rise, level = dot(out, walker.up), across(out, walker.up)
    sine, arm = length(level), length(across(point, walker.up))
    if rise < STEEPEST:
        return STEEP_GROUND
    if sine > EDGE_SINE and arm > 0.0:
        step = min(LEAN * walker.half, 0.5 * arm)  # not past an edge
        lift = 2.0 * step / max(rise, 0.1)
        to = add_scaled(add_scaled(at, level, 0.0 - step / sine), walker.up, lift)
        turned = nearest_normal(walker, to, lift)
        x, y = arm - step, arm * rise / sine + lift  # from a point to the middle of the foot
        if 2.0 * (dot(turned, walker.up) - rise) >= y / math.sqrt(x * x + y * y) - rise:
            if arm <= FOOT * walker.half:
                return EDGE
            if rise < walker.limit:
                return RIM
    return SLOPE if rise >= walker.limit else STEEP_GROUND


@part
def floor_below(walker, at, reach):
    """(row, gap, out, height, foot) of the floor that it can walk on within reach, and how far it may go down; row -1:
    none. height: of the touch along up, nan where something else keeps it from getting there; foot: where that floor is
    under its middle.

    What is too steep in between only limits the way: it stands on a floor although a steep wall is nearer.
    """
    state, near, character, work = walker.state, walker.near, walker.character, walker.work
    skin, up = walker.skin, walker.up
    far = reach + REACH * skin
    down = negative(up)
    path = Path(at, down, inverse_of(down), walker.half_extents)
    best, gap, normal, blocked, rim, height, rim_height, foot = -1, far, up, far, far, math.nan, math.nan, at
    for k in range(walker.found):
        j = near.row[k]
        if is_sensor(state, j):
            continue
        touches, distance, out, point = meet(walker, j, path, far)
        rise = dot(out, up)
        if not touches or rise <= EXACT or not holds(walker, j, out, distance, path):
            continue
        work.inside |= distance <= 0.0 and j >= state.moving
        here = distance - skin / max(rise, 0.1)
        kind = SLOPE if rise >= walker.limit else STEEP_GROUND
        if not character.present[j]:
            kind = ground_kind(walker, out, add_scaled(at, down, distance), point)
        if kind == SLOPE or kind == EDGE:  # noqa: SIM109  compiled
            if here < gap:
                best, gap, normal = j, here, out if kind == SLOPE else up
                height = dot(add(at, point), up) - distance
                foot = add_scaled(at, up, dot(point, normal) / dot(up, normal) - distance)
        elif kind == RIM:
            if here < rim:
                rim, rim_height = here, dot(add(at, point), up) - distance
        elif here < blocked:
            blocked = here
    if best >= 0 and (gap > reach + EXACT or gap - max(blocked, 0.0) > 2.0 * skin):
        best = -1
    if rim < gap:
        gap, height = max(rim, 0.0), rim_height
    if blocked < gap:
        gap, height = max(blocked, 0.0), math.nan
    return best, gap, normal, height, foot


@part
def lowered(walker, at, gap):
    """Where it is after going down by the gap; up, where that is negative, only as far as there is room."""
    if gap >= 0.0 or gap > -1e-12:
        return add_scaled(at, walker.up, 0.0 - gap) if gap > 1e-12 else at
    skin = walker.skin
    j, distance, _, _ = cast_near(walker, at, walker.up, 0.5 * skin - gap, -1)
    rise = 0.0 - gap if j < 0 else min(0.0 - gap, max(0.0, distance - 0.5 * skin))
    return add_scaled(at, walker.up, rise)


@part
def deepest(walker, at, first, tolerance):
    """(row, depth) of the worst overlap with what cannot be pushed, of rows from ``first`` on."""
    state, near, character = walker.state, walker.near, walker.character
    worst, deep = -1, tolerance
    for k in range(walker.found):
        j = near.row[k]
        if j < first or is_dynamic(state, j) or is_sensor(state, j) or character.present[j] or is_one_way(state, j):
            continue
        depth, _, _ = overlap(state, walker.row, j, at)
        if depth > deep:
            worst, deep = j, depth
    return worst, deep


@part
def meets_on_way(walker, j, start, stop):
    """Whether it touches row j on a straight way but not where this begins."""
    state, near = walker.state, walker.near
    way = sub(stop, start)
    size = length(way)
    if size == 0.0 or overlap(state, walker.row, j, start)[0] > 0.0:
        return False
    way = scale(way, 1.0 / size)
    path = Path(start, way, inverse_of(way), walker.half_extents)
    if not comes_near(state, j, path, size):
        return False
    touches, distance, _, _ = cast(state, near, walker.row, j, path, size, size)
    return touches and distance <= size
