"""The ways of a character: along the ground, through the air, on a ladder."""

from __future__ import annotations

import collections

from ...framework.compilation import part
from ...framework.vectors import add, add_scaled, divided, dot, item, length, negative, scale, sub
from ...systems.queries.compiled import Path, cast, inverse_of, overlap
from .casts import across, floor_below, is_dynamic, lowered
from .records import AIR, CLIMB, EXACT, FLOOR, STEEP
from .slides import along_floor, note_hit, slide

SLOWER = 1e-6  # of its speed: less is rounding

# What became of it. at: place; level: own velocity across up, rising: along it; tried: with which velocity it moved;
# ground: row of what it stands on, out: its normal, foot: where it is under its middle; fell: velocity along up before
# it landed.
Outcome = collections.namedtuple("Outcome", "at level rising state ground out foot tried fell")


@part
def is_in_ladder(walker, ladder, at):
    """Whether it overlaps one there."""
    near = walker.near
    for k in range(walker.found if len(ladder.present) > 0 else 0):
        j = near.row[k]
        if ladder.present[j] and overlap(walker.state, walker.row, j, at)[0] > 0.0:
            return True
    return False


@part
def is_on_ladder(walker, ladder, at, before, standing):
    """Whether it climbs: it is in a ladder and wants to, but not down into the floor, or did so before, where it may
    stand on the end of one, too."""
    wanted = walker.character.climb[walker.row]
    if before != CLIMB and (wanted == 0.0 or (standing and wanted < 0.0)):
        return False
    if is_in_ladder(walker, ladder, at):
        return True
    return before == CLIMB and is_in_ladder(walker, ladder, add_scaled(at, walker.up, -2.0 * walker.skin))


@part
def rise_on_ladder(walker, ladder, at, rise):
    """How much of a way up leads to no more than its skin above the end of a ladder."""
    down, gap = negative(walker.up), rise + 3.0 * walker.skin
    path = Path(add_scaled(at, walker.up, rise), down, inverse_of(down), walker.half_extents)
    for k in range(walker.found):
        j = walker.near.row[k]
        if ladder.present[j]:
            touches, distance, _, _ = cast(walker.state, walker.near, walker.row, j, path, gap, gap)
            gap = min(gap, distance) if touches else gap
    more = rise + min(0.0, walker.skin - gap)
    return more if more > EXACT else 0.0


@part
def climb(walker, ladder, at, level, dt):
    """Where it gets on a ladder; it stays at the end of it, or on a floor that is there."""
    character, up = walker.character, walker.up
    rising = character.climb[walker.row]
    if rising > 0.0:
        most = rise_on_ladder(walker, ladder, at, rising * dt)
        rising = most / dt if most < rising * dt else rising
    velocity = add_scaled(level, up, rising)
    to = slide(walker, at, scale(velocity, dt), False, False, -1)
    if rising >= 0.0 and not is_in_ladder(walker, ladder, to):
        j, gap, out, _, foot = floor_below(walker, to, 2.0 * walker.skin)
        if j >= 0:
            return Outcome(lowered(walker, to, gap), level, 0.0, FLOOR, j, out, foot, velocity, 0.0)
    return Outcome(to, level, rising, CLIMB, -1, up, to, velocity, 0.0)


@part
def step_over(walker, at, wish, done, height):
    """(taken, place) of going over an edge: up, forward and down, if that leads farther than it has done, to a floor
    that is at most so high and no lower than it snaps to."""
    up, size, hits = walker.up, length(wish), walker.work.hits
    top = slide(walker, at, scale(up, height), False, True, -1)
    walker.work.hits = hits  # above it is nothing that it runs against
    level, raised = across(wish, up), dot(sub(top, at), up)
    ahead = divided(level, length(level))
    over = slide(walker, top, scale(ahead, size), False, False, -1)
    if dot(sub(over, top), ahead) <= dot(done, ahead) + EXACT:
        return False, at
    j, gap, _, floor_height, _ = floor_below(walker, over, raised + walker.character.snap[walker.row])
    foot = dot(at, up) - walker.skin
    for k in range(len(up)):
        foot -= abs(item(up, k)) * item(walker.half_extents, k)
    if j < 0 or gap < -EXACT or not floor_height - foot <= height + walker.skin:
        return False, at
    return True, add_scaled(over, up, 0.0 - gap)


@part
def walk(walker, at, level, kept, lift, dt):
    """Where it gets on the ground, which may end. kept, lift: what it keeps then of what has carried it."""
    state, character, work = walker.state, walker.character, walker.work
    up, normal, first = walker.up, character.floor_normal[walker.row], work.hits
    way, work.blocked = scale(along_floor(level, normal, up), dt), -1
    to = slide(walker, at, way, True, False, -1)
    blocked, high, taken, tried = work.blocked, character.step_height[walker.row], False, level
    if blocked >= 0 and high > 0.0 and not is_dynamic(state, blocked):
        hits = work.hits
        taken, over = step_over(walker, at, way, sub(to, at), high)
        met, work.hits = work.hits, hits
        if taken:  # what it has met is on the way over, not the edge
            to, work.hits = over, first
            for k in range(hits, met):
                note_hit(work, work.hit_row[k], work.hit_out[k])
    gone = sub(to, at)
    if not taken and work.hits > first and length(gone) < (1.0 - SLOWER) * length(way):
        ahead = across(gone, up)  # as fast as it got along the floor
        level = scale(ahead, length(gone) / (dt * max(length(ahead), EXACT)))
    j, gap, out, _, foot = floor_below(walker, to, character.snap[walker.row])
    if j >= 0:
        to = lowered(walker, to, gap)
        return Outcome(to, level, 0.0, FLOOR, j, out, foot, tried, 0.0)
    velocity = along_floor(level, normal, up)
    rising = dot(velocity, up) + max(lift, 0.0 - character.max_fall[walker.row])
    return Outcome(to, add(across(velocity, up), kept), rising, AIR, -1, up, to, tried, 0.0)


@part
def fall(walker, at, level, rising, jumped, ignored, dt):
    """Where it gets in the air, on the parabola, and whether it has landed."""
    character, work = walker.character, walker.work
    i, up, max_fall, first = walker.row, walker.up, character.max_fall[walker.row], work.hits
    start, rising = rising, max(rising - walker.gravity * dt, 0.0 - max_fall)
    slowest = character.wall_slide[i]
    if slowest == slowest and character.on_wall[i] and dot(walker.wish, character.wall_normal[i]) < 0.0:
        rising = max(rising, 0.0 - slowest)
    tried, fell = add_scaled(level, up, 0.5 * (start + rising)), rising
    way = scale(tried, dt)
    to = slide(walker, at, way, False, False, ignored)
    velocity, steep = add_scaled(level, up, rising), False
    for k in range(first, work.hits):
        hit, rise = work.hit_out[k], dot(work.hit_out[k], up)
        steep |= rise > 1e-3 and length(across(hit, up)) > 1e-3
        if rise < walker.limit or rising <= 0.0:
            velocity = add_scaled(velocity, hit, 0.0 - min(0.0, dot(velocity, hit)))
    level, rising = across(velocity, up), dot(velocity, up)
    now, ground, normal, foot = AIR, -1, up, to
    if not jumped and (rising <= EXACT or work.hits > first):
        j, gap, out, _, below = floor_below(walker, to, 2.0 * walker.skin)
        stayed = length(sub(to, at)) < 1e-3 * length(way) + 1e-6
        if j >= 0 and dot(velocity, out) <= walker.gravity * dt + EXACT:  # no more than falls back in a step
            to = lowered(walker, to, gap)
            now, ground, normal, foot = FLOOR, j, out, below
        elif rising > EXACT:
            now = AIR
        elif stayed and work.hits > first + 1:  # wedged, as between two slopes that are both too steep
            now, ground, normal = FLOOR, work.hit_row[work.hits - 1], scale(up, 0.0)
        elif steep:
            now = STEEP
    return Outcome(to, level, rising, now, ground, normal, foot, tried, fell)
