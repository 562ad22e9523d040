"""One step of one character: what carries it, out of what has come into it, jumps, its own way, what it knows then."""

from __future__ import annotations

import math

from ...framework.compilation import inlined, part
from ...framework.elementary import cos
from ...framework.vectors import add, add_scaled, divided, dot, item, length, negative, replace, scale, smallest, sub
from ...systems.queries.compiled import (
    half_extents_of_row,
    is_one_way,
    is_sensor,
    make_gather,
    meets,
    surface_velocity_of,
)
from .casts import across, deepest, is_dynamic, meets_on_way
from .records import (
    AIR,
    CLIMB,
    CRUSHED,
    EXACT,
    FLOOR,
    HIT,
    LANDED,
    LEAVE_ALL,
    LEAVE_NOTHING,
    NEVER,
    Walker,
)  # fmt: skip
from .slides import cross, part_out, slide
from .ways import climb, fall, is_on_ladder, walk

JUMP_SPEED = 9.0  # m/s, if nothing else is given
FARTHEST_CARRIED = 1.0  # m in a step; what goes farther was put elsewhere
NEAR_BY = 0.25  # m: room around what it may reach in a step
SOLE = 0.5  # of the least half extent: how far below its foot the floor is looked at, on which only an edge may stand
DROPS_FOR = 0.1  # s in which it falls through what holds from above,
DROPS_AT_MOST = 1.0  # where gravity is weak,
DROPS_AGAIN = 0.2  # and until when it does not begin anew
WALL = 0.9  # of a normal across up: is a wall
CEILING = -0.5  # of a normal along up: is above

gather = make_gather(meets)


# -- vectors ---------------------------------------------------------------------------------------


@inlined
def up_of(state, character, i):
    """Its unit vector upwards: its own, else against gravity, else along the second axis."""
    up = character.up[i]
    size = length(up)
    if not size > 0.0:  # nan where it has none
        up = negative(state.gravity[0])
        size = length(up)
        if not size > 0.0:
            up = replace(scale(up, 0.0), 1, 1.0)
            size = 1.0
    return divided(up, size)


@inlined
def wish_of(character, i, up):
    """The velocity that it wants across up: in a plane to the right of up, in space a vector."""
    wish = up
    if len(up) == 2:
        speed = character.move[i, 0]
        return replace(replace(wish, 0, speed * item(up, 1)), 1, 0.0 - speed * item(up, 0))
    for k in range(3):
        wish = replace(wish, k, character.move[i, k])
    return across(wish, up)


@inlined
def axis_of(state, j, k):
    """Axis k of row j, in the world."""
    axis, d = scale(state.bodies.position[j], 0.0), len(state.bodies.position[j])
    if len(state.bodies.axes) == 0:
        return replace(axis, k, 1.0)
    for m in range(d):
        axis = replace(axis, m, state.bodies.axes[(j * d + m) * d + k])
    return axis


@part
def turned(vector, x_before, y_before, x, y):
    """A vector, turned as two axes have."""
    result = add(scale(x, dot(vector, x_before)), scale(y, dot(vector, y_before)))
    if len(vector) == 3:
        result = add_scaled(result, cross(x, y), dot(vector, cross(x_before, y_before)))
    return result


@inlined
def differs(a, b):
    """Whether two vectors differ in any bit."""
    different = False
    for k in range(len(a)):
        different |= item(a, k) != item(b, k)
    return different


# -- what it stands on -----------------------------------------------------------------------------


@part
def row_of(state, entity, known):
    """The row of a body, -1 if there is none; known: where it was."""
    if entity < 0:
        return -1
    if 0 <= known < state.count and state.bodies.entity[known] == entity:
        return known
    for j in range(state.count):  # rows have moved
        if state.bodies.entity[j] == entity:
            return j
    return -1


@part
def row_of_floor(state, character, i):
    """The row of what it stands on, -1: nothing."""
    return row_of(state, character.floor_entity[i], character.floor_row[i])


@part
def ride_of(state, character, i, at, floor, up, dt):
    """How far what it stands on has carried it in this step: as the point of the floor under its middle, or, if up has
    turned since, as on a planet, as its middle itself."""
    then, now, foot = character.floor_place[i], state.bodies.position[floor], character.floor_arm[i]
    x, y, out = axis_of(state, floor, 0), axis_of(state, floor, 1), character.floor_normal[i]
    ride, middle = sub(now, then), sub(at, then)
    if differs(x, character.floor_x[i]) or differs(y, character.floor_y[i]):
        arm = middle if length(across(sub(middle, foot), up)) > EXACT else foot
        ride = add(ride, sub(turned(arm, character.floor_x[i], character.floor_y[i], x, y), arm))
    if length(ride) > FARTHEST_CARRIED:
        ride = scale(ride, 0.0)
    sole = add_scaled(add(now, foot), out, 0.0 - SOLE * smallest(state.bodies.half_extents[i]))
    return add_scaled(ride, across(surface_velocity_of(state, floor, sole, out), out), dt)


@inlined
def stands_on(state, character, i, floor, out, foot):
    """It knows where it stands."""
    character.floor_entity[i], character.floor_row[i] = state.bodies.entity[floor], floor
    character.floor_place[i], character.floor_normal[i] = state.bodies.position[floor], out
    character.floor_x[i], character.floor_y[i] = axis_of(state, floor, 0), axis_of(state, floor, 1)
    character.floor_arm[i] = sub(foot, state.bodies.position[floor])


@inlined
def stands_nowhere(character, i):
    """It knows of no floor."""
    character.floor_entity[i], character.floor_row[i] = -1, -1
    character.floor_normal[i] = scale(character.floor_normal[i], 0.0)


@part
def carried(walker, ride, floor, left, rising):
    """(place, row of what crushes it) after the ride on its floor, and out of what has moved into it.

    left
        the row of a floor that it jumps off
    """
    at = walker.start
    if dot(ride, ride) > 0.0 and left < 0:
        at = slide(walker, at, ride, False, True, floor)
    at, crusher = part_out(walker, at, rising, left)
    if crusher >= 0 and deepest(walker, at, walker.state.moving, 1e-6)[0] >= 0:
        at = walker.start
    return at, crusher


# -- jumps -----------------------------------------------------------------------------------------


@part
def jump_speed_of(character, i, gravity):
    """m/s, from the height if one is given."""
    height, speed = character.jump_height[i], character.jump_speed[i]
    if height == height:
        return math.sqrt(2.0 * gravity * height)
    return speed if speed == speed else JUMP_SPEED


@inlined
def count_times(character, i, standing, dt):
    """How long ago it stood, the key was pressed, it touched a wall, it let go of a platform."""
    character.since_floor[i] = 0.0 if standing else character.since_floor[i] + dt
    character.since_press[i] += dt
    character.since_wall[i] += dt
    character.since_drop[i] += dt
    if character.jump[i] and not character.held[i]:
        character.since_press[i] = 0.0
    character.held[i] = character.jump[i]


@part
def jump(walker, standing, climbing, level, rising, kept, lift, speed):
    """(jumps, velocity across up, along up): from the floor or a ladder, off a wall, or once more in the air."""
    character, i = walker.character, walker.row
    if standing or climbing:
        character.air_jumped[i] = 0
    jumps = False
    if character.since_press[i] <= character.buffer[i]:
        if climbing or character.since_floor[i] <= character.coyote[i]:
            level = add(level, kept) if standing else level
            rising, jumps = speed + max(lift, 0.0), True  # from what sinks it is as high as from what rests
        elif character.wall_jump[i] > 0.0 and character.since_wall[i] <= character.coyote[i]:
            level, rising, jumps = scale(character.wall_normal[i], character.wall_jump[i]), speed, True
            if character.wall_jump_up[i] == character.wall_jump_up[i]:
                rising = character.wall_jump_up[i]
        elif character.air_jumped[i] < character.air_jumps[i] and character.since_press[i] == 0.0:
            character.air_jumped[i] += 1
            rising, jumps = speed, True
    if jumps:
        character.since_press[i] = character.since_floor[i] = character.since_wall[i] = NEVER
        character.jumping[i] = True
    elif character.jumping[i] and (rising <= 0.0 or not character.jump[i]):  # the key was let go
        character.jumping[i] = False
        rising *= character.jump_cut[i] if rising > 0.0 else 1.0
    return jumps, level, rising


@inlined
def towards(character, i, level, wish, rate):
    """The velocity across up, on the way to the one that it wants; it does not brake what pushes it."""
    change, pushed = sub(wish, level), character.pushed[i]
    if dot(change, pushed) < 0.0:
        change = add_scaled(change, pushed, 0.0 - dot(change, pushed) / dot(pushed, pushed))
    size = length(change)
    return add(level, change if size <= rate else scale(change, rate / size))


# -- what it does to others, and knows ---------------------------------------------------------------


@part
def push(walker, j, out, dt):
    """(pushes, force) with which it pushes row j in the next step, so that this gets no faster than it wants to be."""
    state, character, work = walker.state, walker.character, walker.work
    bodies, i, level = state.bodies, walker.row, across(out, walker.up)
    size, force = length(level), character.push_force[walker.row]
    if size < 0.5 or dot(walker.wish, level) >= 0.0 or force == 0.0:
        return False, level
    ahead = divided(level, 0.0 - size)
    wanted = dot(walker.wish, ahead)
    if character.present[j]:
        if not character.pushable[j]:
            return False, level
        gained = force * dt / bodies.mass[j]
    elif is_dynamic(state, j):
        mass, speed, resisted, gained = bodies.mass[j], dot(bodies.linear_velocity[j], ahead), 0.0, 0.0
        if character.push_entity[i] == bodies.entity[j]:
            before, pushed = dot(bodies.start_velocity[j], ahead), dot(character.push[i], ahead)
            resisted = max(0.0, pushed - mass * (speed - before) / dt)
            gained = pushed * dt / mass if before <= wanted else 0.0
        force = min(force, max(0.0, mass * (wanted - speed) / dt + resisted))
    else:
        return False, level
    if work.most_push[j] == 0.0:
        work.pushed[work.pushes] = j
        work.pushes += 1
    work.push[j] = add_scaled(work.push[j], ahead, gained)
    work.most_push[j] = max(work.most_push[j], wanted)
    return not character.present[j], scale(ahead, force)


@inlined
def tell(work, event, entity, other, normal, speed):
    """Note an event; there is room for all of a step."""
    k = work.events
    work.event[k], work.entity[k], work.other[k] = event, entity, other
    work.normal[k], work.speed[k] = normal, speed
    work.events = k + 1


@part
def tell_hits(walker, floor, first, velocity, carried, stop, dt):
    """What it has run against on its own way, and which sensors it has come into."""
    state, near, work, start = walker.state, walker.near, walker.work, walker.start
    me = state.bodies.entity[walker.row]
    for k in range(first, work.hits):
        j, speed = work.hit_row[k], 0.0 - dot(velocity, work.hit_out[k])
        known = j == floor or speed <= 0.0
        for m in range(first, k):
            known |= work.hit_row[m] == j
        if not known:
            tell(work, HIT, me, state.bodies.entity[j], work.hit_out[k], speed)
    for k in range(walker.found):
        j = near.row[k]
        if is_sensor(state, j):
            met = meets_on_way(walker, j, start, carried)
            if met or meets_on_way(walker, j, carried, stop):
                way = sub(stop, start)
                tell(work, HIT, me, state.bodies.entity[j], divided(way, 0.0 - length(way)), length(way) / dt)


@part
def look_at_hits(walker, in_air, dt):
    """Walls, ceilings, and what it pushes."""
    state, character, work = walker.state, walker.character, walker.work
    i, wall, ceiling, pushed, force = walker.row, -1, False, -1, scale(walker.up, 0.0)
    for k in range(work.hits):
        j, hit = work.hit_row[k], work.hit_out[k]
        side = across(hit, walker.up)
        if length(side) > WALL:
            wall = j
            character.wall_normal[i] = divided(side, length(side))
        ceiling |= dot(hit, walker.up) < CEILING
        pushes, given = push(walker, j, hit, dt)
        if pushes:
            pushed, force = j, given
    character.on_wall[i], character.on_ceiling[i] = wall >= 0, ceiling
    character.wall_entity[i] = state.bodies.entity[wall] if wall >= 0 else -1
    if wall >= 0 and in_air:
        character.since_wall[i] = 0.0
    character.push_row[i], character.push[i] = pushed, force
    character.push_entity[i] = state.bodies.entity[pushed] if pushed >= 0 else -1


# -- a step ----------------------------------------------------------------------------------------


@part
def look_around(state, near, i, start, extents, reach):
    """How many rows there are within reach, in ``near.row``."""
    low, high = start, start
    for k in range(len(extents)):
        low = replace(low, k, item(start, k) - item(extents, k) - reach)
        high = replace(high, k, item(start, k) + item(extents, k) + reach)
    return gather(state, near, i, low, high)


@part
def move_one(state, near, character, ladder, work, i, dt):
    """Where character i will be, into ``work.place``, and all that it knows then."""
    bodies, before, up = state.bodies, character.state[i], up_of(state, character, i)
    start, velocity = add(bodies.position[i], bodies.offset[i]), add(character.velocity[i], character.pushed[i])
    gravity = character.gravity[i] if character.gravity[i] == character.gravity[i] else length(state.gravity[0])
    wish, speed = wish_of(character, i, up), jump_speed_of(character, i, gravity)
    # what carries it
    floor, standing, ride = row_of_floor(state, character, i), before == FLOOR, scale(start, 0.0)
    standing = standing and floor >= 0 and meets(state, i, floor) and not is_sensor(state, floor)
    put = differs(bodies.position[i], character.place[i])  # by the game
    if standing and not put:
        ride = ride_of(state, character, i, start, floor, up, dt)
    count_times(character, i, standing, dt)
    rising = dot(velocity, up)
    if character.drop[i] and standing and character.since_drop[i] > DROPS_AGAIN and is_one_way(state, floor):
        character.since_drop[i], standing, rising = 0.0, False, 0.0
    left = -1
    if standing and character.since_press[i] <= character.buffer[i] and dot(ride, ride) > 0.0:
        left = floor  # it jumps as the step begins, and what moves stays behind
    reach = (length(velocity) + length(wish) + abs(character.climb[i]) + speed + gravity * dt) * dt + length(ride)
    reach += character.step_height[i] + character.snap[i] + 20.0 * character.skin[i] + NEAR_BY
    extents, since, skin = half_extents_of_row(state, i), character.since_drop[i], character.skin[i]
    dropping = since < DROPS_FOR or (since < DROPS_AT_MOST and gravity * since * since < 8.0 * skin)  # it is in it
    walker = Walker(
        state, near, character, work, i, start, extents, smallest(extents), up, skin,
        cos(character.max_slope[i]), dropping, gravity, wish, look_around(state, near, i, start, extents, reach),
    )  # fmt: skip
    work.hits, work.inside = 0, False
    at, crusher = carried(walker, ride, floor, left, rising)
    begin, first = at, work.hits
    # jumps, and how fast it wants to be
    climbing = is_on_ladder(walker, ladder, at, before, standing)
    kept, lift = scale(ride, 0.0), dot(ride, up) / dt if character.leave[i] != LEAVE_NOTHING else 0.0
    if character.leave[i] == LEAVE_ALL:
        kept = across(scale(ride, 1.0 / dt), up)
    else:
        lift = max(lift, 0.0)
    jumps, level, rising = jump(walker, standing, climbing, across(velocity, up), rising, kept, lift, speed)
    standing = standing and not jumps and dot(character.floor_normal[i], up) != 0.0  # wedged: it falls in each step
    climbing = climbing and not jumps
    rate = character.acceleration[i] if standing or climbing else character.air_acceleration[i]
    level = towards(character, i, level, wish, rate * dt)
    # its own way
    if climbing:
        end = climb(walker, ladder, at, level, dt)
    elif standing:
        end = walk(walker, at, level, kept, lift, dt)
        if end.state == AIR:
            character.since_floor[i] = 0.0
    else:
        end = fall(walker, at, level, rising, jumps, left, dt)
    at, velocity = end.at, add_scaled(end.level, up, end.rising if end.state != FLOOR else 0.0)
    if work.inside or left >= 0:  # it was put into what rests, or came from behind a chain
        at, crusher = part_out(walker, at, end.rising, -1)
    # what it knows then
    if end.state == FLOOR:
        character.since_floor[i], character.jumping[i] = 0.0, False
        stands_on(state, character, i, end.ground, end.out, end.foot)
        if before != FLOOR and before != CLIMB:
            tell(work, LANDED, bodies.entity[i], bodies.entity[end.ground], end.out, max(0.0, 0.0 - end.fell))
    else:
        stands_nowhere(character, i)
    look_at_hits(walker, end.state == AIR, dt)
    by = bodies.entity[crusher] if crusher >= 0 else -1
    if by >= 0:
        velocity = scale(velocity, 0.0)
        if character.crushed[i] < 0:
            tell(work, CRUSHED, bodies.entity[i], by, scale(up, 0.0), 0.0)
    character.crushed[i] = by
    tell_hits(walker, end.ground, first, end.tried, begin, at, dt)
    character.state[i], work.velocity[i], character.floor_velocity[i] = end.state, velocity, scale(ride, 1.0 / dt)
    work.place[i] = add(bodies.position[i], sub(at, start))
