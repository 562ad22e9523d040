"""How a character moves along what it meets, and out of what has moved into it."""

from __future__ import annotations

from ...framework.compilation import inlined, part
from ...framework.vectors import add, add_scaled, divided, dot, item, length, replace, scale, sub
from ...systems.queries.compiled import front_of, is_from_front, is_one_way, is_sensor, overlap
from .casts import REACH, SLOPE, across, cast_near, deepest, grazed, ground_kind, is_dynamic
from .records import EXACT, MOST_HITS, SLIDES

MOST_PLANES = 32
ROUNDS = 20  # over the planes


@inlined
def note_hit(work, j, out):
    """Row j was met."""
    if work.hits < MOST_HITS:
        work.hit_row[work.hits], work.hit_out[work.hits] = j, out
        work.hits += 1


@inlined
def add_plane(work, out, depth):
    """One more plane that holds it."""
    if work.planes < MOST_PLANES:
        work.plane_out[work.planes], work.plane_depth[work.planes] = out, depth
        work.planes += 1


@inlined
def cross(a, b):
    """a x b; in a plane 0, as nothing lies along two lines."""
    result = scale(a, 0.0)
    if len(a) == 3:
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            result = replace(result, k, item(a, i) * item(b, j) - item(a, j) * item(b, i))
    return result


@part
def clipped(work, left):
    """What is left of a way along the newest plane, or along the edge of it and another one; 0 in a corner."""
    newest = work.planes - 1
    size, out = length(left), work.plane_out[newest]
    along = add_scaled(left, out, 0.0 - min(0.0, dot(left, out)))
    for k in range(newest):
        if dot(along, work.plane_out[k]) < -EXACT * size:
            edge = cross(out, work.plane_out[k])
            square = dot(edge, edge)
            along = scale(edge, dot(left, edge) / square) if square > EXACT else scale(left, 0.0)
            for m in range(newest):
                if dot(along, work.plane_out[m]) < -EXACT * size:
                    return scale(left, 0.0)
    return along


@inlined
def along_floor(way, normal, up):
    """A way across up, as long along the floor of that normal."""
    size, rise = length(way), dot(normal, up)
    if size == 0.0 or rise <= 0.0:
        return way
    tilted = add_scaled(way, up, 0.0 - dot(way, normal) / rise)
    return scale(tilted, size / length(tilted))


@part
def climbs(walker, j, out, at, point):
    """Whether it walks on along what it meets; edges are stepped over, but for those of what can be pushed."""
    state, character = walker.state, walker.character
    if character.present[j] or is_dynamic(state, j):
        return dot(out, walker.up) >= walker.limit
    return ground_kind(walker, out, at, point) == SLOPE


@part
def slide(walker, at, wish, is_walking, is_carried, ignored):
    """Where it gets by moving by ``wish`` and along what it meets.

    is_walking
        what is too steep or an edge is as a wall, and it is as fast along a slope
    is_carried
        it may also be moved back
    """
    state, work = walker.state, walker.work
    left, skin = wish, walker.skin
    work.planes = 0
    for _turn in range(SLIDES):
        size = length(left)
        if size < EXACT:
            break
        way = divided(left, size)
        j, distance, out, point = cast_near(walker, at, way, size + REACH * skin, ignored)
        free = max(0.0, distance - skin / max(0.0 - dot(out, way), 1e-3)) if j >= 0 else size
        beside, back, side, touch = grazed(walker, add_scaled(at, way, min(free, size)), way, ignored)
        if beside >= 0:
            j, out, point, free = beside, side, touch, max(0.0, min(free, size) + back)
        elif free >= size:
            if j >= 0 and is_dynamic(state, j) and free < size + skin:
                note_hit(work, j, out)  # it follows what it pushes
            return add(at, left)
        at = add_scaled(at, way, free)
        left = add_scaled(left, way, 0.0 - free)
        note_hit(work, j, out)
        if is_walking:
            touching = add_scaled(at, way, distance - free) if beside < 0 else add_scaled(at, out, 0.0 - skin)
            if climbs(walker, j, out, touching, point):
                left = along_floor(across(left, walker.up), out, walker.up)
            elif dot(out, walker.up) > -0.1:
                level = across(out, walker.up)
                out, work.blocked = divided(level, length(level)), j
        add_plane(work, out, 0.0)
        left = clipped(work, left)
        if not is_carried and dot(left, wish) <= 0.0:
            break
    return at


@part
def pushed_by_planes(work):
    """The shortest way out of all planes."""
    way = scale(work.plane_out[0], 0.0)
    for k in range(work.planes):
        work.plane_push[k] = 0.0
    for _round in range(ROUNDS):
        change = 0.0
        for k in range(work.planes):
            out = work.plane_out[k]
            push = max(0.0, work.plane_push[k] + work.plane_depth[k] - dot(way, out))
            more = push - work.plane_push[k]
            work.plane_push[k] = push
            way = add_scaled(way, out, more)
            change = max(change, abs(more))
        if change < EXACT:
            break
    return way


@part
def part_out(walker, at, rising, ignored):
    """(place, row of what crushes it): out of static and kinematic bodies, the planes of all that overlap together.

    rising
        m/s, its own speed upwards: what holds from above does not pick up what jumps
    """
    state, near, character, work = walker.state, walker.near, walker.character, walker.work
    start, crusher, skin, moved = at, -1, walker.skin, 0.0
    for turn in range(6):
        work.planes, worst = 0, 0.0
        for k in range(walker.found):
            j = near.row[k]
            if j == ignored or is_dynamic(state, j) or is_sensor(state, j):
                continue
            depth, out, _ = overlap(state, walker.row, j, at)
            if character.present[j]:
                if depth > EXACT and turn == 0:
                    add_plane(work, out, 0.5 * (depth + skin))
                    worst = max(worst, 0.5 * (depth + skin))
                continue
            if depth <= EXACT:
                if not is_one_way(state, j) and depth > -2.0 * skin and turn > 0:
                    add_plane(work, out, depth + 0.5 * skin)
                    worst = max(worst, depth + 0.5 * skin)
                continue
            if is_one_way(state, j):  # picked up by one that rises, and by that way at most
                front = front_of(state, j)
                rise = dot(sub(state.bodies.position[j], state.bodies.previous_position[j]), front) / length(front)
                if walker.dropping or rising > 0.0 or not rise > 0.0 or depth > rise + EXACT:
                    continue
                if not is_from_front(front, out):
                    continue
            moved = max(moved, length(sub(state.bodies.position[j], state.bodies.previous_position[j])))
            add_plane(work, out, depth + skin)
            worst = max(worst, depth + skin)
            if j < state.moving or crusher < 0:
                crusher = j
            note_hit(work, j, out)
        if worst <= 0.6 * skin:
            return at, -1
        at = add(at, pushed_by_planes(work))
        if length(sub(at, start)) > walker.half + skin + moved:  # not out on the other side
            return start, crusher
    worst_row, _ = deepest(walker, at, 0, 1e-6)
    if worst_row < 0:
        return at, -1
    return start, crusher if crusher >= 0 else worst_row
