"""One step of one character: what carries it, out of what has come into it, its jumps, its way, what it knows then."""

from __future__ import annotations

import math

from ...framework.compilation import inlined, part
from ...framework.vectors import add, add_scaled, divided, dot, item, length, negative, replace, scale, sub
from ...systems.narrow_phase.one_way import is_one_way
from ...systems.queries.compiled import is_sensor, make_gather, meets, overlap
from ...systems.shapes.dispatch import half_extents
from ...systems.shapes.surfaces import along_world, any_surface_runs
from .casts import (
    across,
    deepest,
    floor_below,
    is_dynamic,
    lowered,
    meets_on_way,
)
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
    STEEP,
    Walker,
)
from .slides import along_floor, cross, part_out, slide

JUMP_SPEED = 9.0  # m/s, if nothing else is given
FARTHEST_CARRIED = 1.0  # m in a step; what goes farther was put elsewhere
SLOWER = 1e-6  # of its speed: less is rounding
NEAR_BY = 0.25  # m: room around what it may reach in a step
DROPS_FOR = 0.1  # s in which it falls through what holds from above,
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
    """How far what it stands on has carried it in this step."""
    then, now = character.floor_place[i], state.bodies.position[floor]
    ride = scale(at, 0.0)
    x, y = axis_of(state, floor, 0), axis_of(state, floor, 1)
    moved, turns = differs(then, now), differs(x, character.floor_x[i]) or differs(y, character.floor_y[i])
    if moved or turns:
        way = sub(now, then)
        if length(way) <= FARTHEST_CARRIED:
            ride = way
            if turns:
                arm = sub(at, then)
                ride = add(ride, sub(turned(arm, character.floor_x[i], character.floor_y[i], x, y), arm))
    if any_surface_runs(state):
        surface = state.colliders.surface_velocity[state.bodies.collider_slot[floor], floor]
        ride = add_scaled(ride, across(along_world(state, floor, surface), character.floor_normal[i]), dt)
    return ride


@inlined
def stands_on(state, character, i, floor, out):
    """It knows where it stands."""
    character.floor_entity[i], character.floor_row[i] = state.bodies.entity[floor], floor
    character.floor_place[i], character.floor_normal[i] = state.bodies.position[floor], out
    character.floor_x[i], character.floor_y[i] = axis_of(state, floor, 0), axis_of(state, floor, 1)


# -- its own way -----------------------------------------------------------------------------------


@part
def jump_speed_of(character, i, gravity):
    """m/s, from the height if one is given."""
    height, speed = character.jump_height[i], character.jump_speed[i]
    if height == height:
        return math.sqrt(2.0 * gravity * height)
    return speed if speed == speed else JUMP_SPEED


@part
def takes_ladder(state, near, ladder, walker, at):
    """Whether it is in a ladder."""
    if len(ladder.present) > 0:
        for k in range(walker.near):
            j = near.row[k]
            if ladder.present[j] and overlap(state, walker.row, j, at)[0] > 0.0:
                return True
    return False


@part
def step_over(state, near, character, work, walker, at, wish, done, height):
    """(taken, place) of going over an edge: up, forward and down, if that leads farther than it has done, to a floor
    that is at most so high."""
    up, size = walker.up, length(wish)
    top = slide(state, near, character, work, walker, at, scale(up, height), False, True, -1)
    level, raised = across(wish, up), dot(sub(top, at), up)
    ahead = divided(level, length(level))
    over = slide(state, near, character, work, walker, top, scale(ahead, size), False, False, -1)
    if dot(sub(over, top), ahead) <= dot(done, ahead) + EXACT:
        return False, at
    j, gap, _, floor_height = floor_below(state, near, character, work, walker, over, raised)
    foot = dot(at, up) - walker.skin
    for k in range(len(up)):
        foot -= abs(item(up, k)) * item(walker.half_extents, k)
    if j < 0 or gap < -EXACT or not floor_height - foot <= height + walker.skin:
        return False, at
    return True, add_scaled(over, up, 0.0 - gap)


@part
def push(state, character, work, walker, j, out, wish, dt):
    """(pushes, force) with which it pushes row j in the next step, so that this gets no faster than it wants to be."""
    bodies, i, level = state.bodies, walker.row, across(out, walker.up)
    size, force = length(level), character.push_force[walker.row]
    if size < 0.5 or dot(wish, level) >= 0.0 or force == 0.0:
        return False, level
    ahead = divided(level, 0.0 - size)
    wanted = dot(wish, ahead)
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
def tell_hits(state, near, work, walker, floor, first, velocity, start, carried, stop, dt):
    """What it has run against on its own way, and which sensors it has come into."""
    me = state.bodies.entity[walker.row]
    for k in range(first, work.hits):
        j, speed = work.hit_row[k], 0.0 - dot(velocity, work.hit_out[k])
        known = j == floor or speed <= 0.0
        for m in range(first, k):
            known |= work.hit_row[m] == j
        if not known:
            tell(work, HIT, me, state.bodies.entity[j], work.hit_out[k], speed)
    for k in range(walker.near):
        j = near.row[k]
        if is_sensor(state, j):
            met = meets_on_way(state, near, walker, j, start, carried)
            if met or meets_on_way(state, near, walker, j, carried, stop):
                way = sub(stop, start)
                tell(work, HIT, me, state.bodies.entity[j], divided(way, 0.0 - length(way)), length(way) / dt)


# -- a step ----------------------------------------------------------------------------------------


@part
def move_one(state, near, character, ladder, work, i, dt):
    """Where character i will be, into ``work.place``, and all that it knows then."""
    bodies = state.bodies
    start = add(bodies.position[i], bodies.offset[i])
    up, skin = up_of(state, character, i), character.skin[i]
    extents = half_extents(state, bodies.shape[i], i)
    half = item(extents, 0)
    for k in range(len(extents)):
        half = min(half, item(extents, k))
    velocity = add(character.velocity[i], character.pushed[i])
    gravity = character.gravity[i]
    if gravity != gravity:
        gravity = length(state.gravity[0])
    wish, jump_speed = wish_of(character, i, up), jump_speed_of(character, i, gravity)
    max_fall, before = character.max_fall[i], character.state[i]
    standing, climbing = before == FLOOR, before == CLIMB
    # what carries it
    ride, floor = scale(start, 0.0), row_of_floor(state, character, i)
    if standing and (floor < 0 or not meets(state, i, floor) or is_sensor(state, floor)):
        standing = False
    put = differs(bodies.position[i], character.place[i])  # by the game
    if standing and not put:
        ride = ride_of(state, character, i, start, floor, up, dt)
    # what is near
    reach = (length(velocity) + length(wish) + abs(character.climb[i]) + jump_speed + gravity * dt) * dt + length(ride)
    reach += character.step_height[i] + character.snap[i] + 20.0 * skin + NEAR_BY
    low, high = start, start
    for k in range(len(start)):
        low = replace(low, k, item(start, k) - item(extents, k) - reach)
        high = replace(high, k, item(start, k) + item(extents, k) + reach)
    found = gather(state, near, i, low, high)
    work.hits, work.inside = 0, False
    # times
    character.since_floor[i] = 0.0 if standing else character.since_floor[i] + dt
    character.since_press[i] += dt
    character.since_wall[i] += dt
    character.since_drop[i] += dt
    if character.jump[i] and not character.held[i]:
        character.since_press[i] = 0.0
    character.held[i] = character.jump[i]
    rising = dot(velocity, up)
    if character.drop[i] and standing and character.since_drop[i] > DROPS_AGAIN and is_one_way(state, floor):
        character.since_drop[i], standing, rising = 0.0, False, 0.0
    leaves = standing and character.since_press[i] <= character.buffer[i]
    left = floor if leaves and dot(ride, ride) > 0.0 else -1  # it jumps as the step begins, and what moves stays behind
    dropping = character.since_drop[i] < DROPS_FOR
    limit = math.cos(character.max_slope[i])
    walker = Walker(i, start, extents, half, up, skin, limit, dropping, found)
    # ride, and out of what has moved into it
    at = start
    if dot(ride, ride) > 0.0 and not leaves:
        at = slide(state, near, character, work, walker, at, ride, False, True, floor)
    carried_hits, crusher = work.hits, -1
    disturbed = put or work.hits > 0 or state.statics_version != work.statics_version
    for k in range(found):  # beside what rests nothing can have moved into it
        disturbed |= state.dynamic <= near.row[k] < state.moving
    if disturbed:
        at, crusher = part_out(state, near, character, work, walker, at, rising, left)
    if crusher >= 0:
        into_static, _ = deepest(state, near, character, walker, at, state.moving, 1e-6)
        if into_static >= 0:
            at = start
    carried = at
    # ladders
    ladder_near = takes_ladder(state, near, ladder, walker, at)
    if ladder_near and character.climb[i] != 0.0 and not (standing and character.climb[i] < 0.0):
        climbing = True
    climbing = climbing and ladder_near
    # jumps
    level = across(velocity, up)
    kept, lift = scale(ride, 1.0 / dt), dot(ride, up) / dt
    if character.leave[i] == LEAVE_NOTHING:
        kept, lift = scale(ride, 0.0), 0.0
    kept = across(kept, up) if character.leave[i] == LEAVE_ALL else scale(ride, 0.0)
    if standing or climbing:
        character.air_jumped[i] = 0
    jumped = False
    if character.since_press[i] <= character.buffer[i]:
        if climbing or character.since_floor[i] <= character.coyote[i]:
            level = add(level, kept) if standing else level
            rising, jumped = jump_speed + max(lift, 0.0), True
        elif character.wall_jump[i] > 0.0 and character.since_wall[i] <= character.coyote[i]:
            level = scale(character.wall_normal[i], character.wall_jump[i])
            rising, jumped = character.wall_jump_up[i], True
            rising = rising if rising == rising else jump_speed
        elif character.air_jumped[i] < character.air_jumps[i] and character.since_press[i] == 0.0:
            character.air_jumped[i] += 1
            rising, jumped = jump_speed, True
        if jumped:
            character.since_press[i] = character.since_floor[i] = character.since_wall[i] = NEVER
            character.jumping[i], standing, climbing = True, False, False
    normal = character.floor_normal[i]
    if standing and dot(normal, up) == 0.0:  # wedged: it falls each step, and lands in it again
        standing = False
    if character.jumping[i] and not jumped:
        if rising <= 0.0:
            character.jumping[i] = False
        elif not character.jump[i]:
            rising *= character.jump_cut[i]
            character.jumping[i] = False
    # speed
    rate = (character.acceleration[i] if standing or climbing else character.air_acceleration[i]) * dt
    change, pushed = sub(wish, level), character.pushed[i]
    if dot(change, pushed) < 0.0:  # it does not brake what pushes it
        change = add_scaled(change, pushed, 0.0 - dot(change, pushed) / dot(pushed, pushed))
    size = length(change)
    level = add(level, change if size <= rate else scale(change, rate / size))
    # its own way
    state_now, ground, out, fell, tried = AIR, -1, up, rising, level
    if climbing:
        rising = character.climb[i]
        at = slide(state, near, character, work, walker, at, scale(add_scaled(level, up, rising), dt), False, False, -1)
        state_now, tried = CLIMB, add_scaled(level, up, rising)
    elif standing:
        way, work.blocked = scale(along_floor(level, normal, up), dt), -1
        at = slide(state, near, character, work, walker, at, way, True, False, -1)
        blocked, taken = work.blocked, False
        if blocked >= 0 and character.step_height[i] > 0.0 and not is_dynamic(state, blocked):
            hits = work.hits
            done, high = sub(at, carried), character.step_height[i]
            taken, to = step_over(state, near, character, work, walker, carried, way, done, high)
            if taken:
                at = to
            work.hits = hits
        gone = sub(at, carried)
        if not taken and work.hits > carried_hits and length(gone) < (1.0 - SLOWER) * length(way):
            ahead = across(gone, up)  # as fast as it got along the floor
            level = scale(ahead, length(gone) / (dt * max(length(ahead), EXACT)))
        j, gap, found_out, _ = floor_below(state, near, character, work, walker, at, character.snap[i])
        if j >= 0:
            at = lowered(state, near, character, work, walker, at, gap)
            state_now, ground, out = FLOOR, j, found_out
        else:
            velocity = along_floor(level, normal, up)
            level = add(across(velocity, up), kept)
            rising = dot(velocity, up) + max(lift, 0.0 - max_fall)
            character.since_floor[i] = 0.0
    if state_now == AIR and not standing:
        start_rising = rising
        rising = max(rising - gravity * dt, 0.0 - max_fall)
        slowest = character.wall_slide[i]
        if slowest == slowest and character.on_wall[i] and dot(wish, character.wall_normal[i]) < 0.0:
            rising = max(rising, 0.0 - slowest)
        begin, first, fell = at, work.hits, rising
        mean = 0.5 * (start_rising + rising)
        tried = add_scaled(level, up, mean)
        way = scale(add_scaled(level, up, mean), dt)
        at = slide(state, near, character, work, walker, at, way, False, False, left)
        velocity, steep = add_scaled(level, up, rising), False
        for k in range(first, work.hits):
            hit, rise = work.hit_out[k], dot(work.hit_out[k], up)
            steep |= rise > 1e-3 and length(across(hit, up)) > 1e-3
            if rise < limit or rising <= 0.0:
                velocity = add_scaled(velocity, hit, 0.0 - min(0.0, dot(velocity, hit)))
        level, rising = across(velocity, up), dot(velocity, up)
        if not jumped and (rising <= EXACT or work.hits > first):
            j, gap, found_out, _ = floor_below(state, near, character, work, walker, at, 2.0 * skin)
            stayed = length(sub(at, begin)) < 1e-3 * length(way) + 1e-6
            if j >= 0 and dot(velocity, found_out) <= gravity * dt + EXACT:  # no more than falls back in a step
                at = lowered(state, near, character, work, walker, at, gap)
                state_now, ground, out = FLOOR, j, found_out
            elif rising > EXACT:
                state_now = AIR
            elif stayed and work.hits > first + 1:  # wedged, as between two slopes that are both too steep
                state_now, ground, out = FLOOR, work.hit_row[work.hits - 1], scale(up, 0.0)
            elif steep:
                state_now = STEEP
    if work.inside or left >= 0:  # it was put into what rests, or came from behind a chain
        at, crusher = part_out(state, near, character, work, walker, at, rising, -1)
    # what it knows in the end
    if state_now == FLOOR:
        character.since_floor[i], rising = 0.0, 0.0
        character.jumping[i] = False
        stands_on(state, character, i, ground, out)
        if before != FLOOR and before != CLIMB:
            tell(work, LANDED, bodies.entity[i], bodies.entity[ground], out, max(0.0, 0.0 - fell))
    else:
        character.floor_entity[i], character.floor_row[i], character.floor_normal[i] = -1, -1, scale(up, 0.0)
    wall, ceiling, pushes_row, force = -1, False, -1, scale(up, 0.0)
    for k in range(work.hits):
        j, hit = work.hit_row[k], work.hit_out[k]
        side = across(hit, up)
        if length(side) > WALL:
            wall = j
            character.wall_normal[i] = divided(side, length(side))
        ceiling |= dot(hit, up) < CEILING
        pushes, given = push(state, character, work, walker, j, hit, wish, dt)
        if pushes:
            pushes_row, force = j, given
    character.push_row[i], character.push[i] = pushes_row, force
    character.push_entity[i] = bodies.entity[pushes_row] if pushes_row >= 0 else -1
    character.on_wall[i], character.on_ceiling[i] = wall >= 0, ceiling
    character.wall_entity[i] = bodies.entity[wall] if wall >= 0 else -1
    if wall >= 0 and state_now == AIR:
        character.since_wall[i] = 0.0
    by = bodies.entity[crusher] if crusher >= 0 else -1
    if by >= 0:
        level, rising = scale(level, 0.0), 0.0
        if character.crushed[i] < 0:
            tell(work, CRUSHED, bodies.entity[i], by, scale(up, 0.0), 0.0)
    character.crushed[i] = by
    tell_hits(state, near, work, walker, ground, carried_hits, tried, start, carried, at, dt)
    character.state[i], work.velocity[i] = state_now, add_scaled(level, up, rising)
    character.floor_velocity[i] = scale(ride, 1.0 / dt)
    work.place[i] = add(bodies.position[i], sub(at, start))
