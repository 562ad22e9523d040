"""Which bodies are swept along their paths, and how far they may go before their neighbours are searched again.

A pair is swept: always if the world is event-driven; else if it is fast, so that within the step it travels more
than a part of the smaller body's extent. A slower one that overlaps anywhere on its path still does so at the end of
it, but for grazes: on a path of length s two spheres of diameter D that do not meet at the step's end overlap by
s^2 / 8 D at most, which for FAST is the slop.
"""

from __future__ import annotations

import math

from ...framework.compilation import inlined, part
from ...framework.elementary import power
from ...framework.jit.records.record_type import zero_of
from ...framework.vectors import add, add_scaled, item, length, replace, sub
from ..codes import OK
from ..integration.trajectory import along, bend_of, centre_at, path_of, rate_along, relative_path, travel_of
from ..linking.parts import FIRST_TOUCH, call_first_touch
from ..parts.rows import owner_of
from ..shapes.dispatch import restitution_of
from ..shapes.tolerances import contact_margin, is_turning, smaller_extent, turning_travel, way_of_turning
from .time_of_impact import APART, bounds_stay_disjoint

DISCRETE, CONTINUOUS, EVENT_DRIVEN = range(3)
MODES = {"discrete": DISCRETE, "continuous": CONTINUOUS, "event_driven": EVENT_DRIVEN}
FAST = 0.2  # of the smaller body's extent
SPREAD = 2.0  # times the speed at which a body has its share of the energy: few are ever faster after an impact
CROWD = 0.25  # neighbours that the search bounds of a body may hold, on average
ALL_PAIRS = 32  # bodies: so few may all be each other's neighbours
MOST_SEARCHES = 64  # in a step, without those after impacts
GIVE = 0.05  # of the extent: that much farther than its search bounds a body may go


@inlined
def has_sweeps(state, i):
    """Whether row i is swept against all others: it or the body that it is a part of has ccd, or all are swept."""
    ccd = state.bodies.ccd
    return state.mode != DISCRETE or ccd[i] or ccd[owner_of(state, i)]


@inlined
def is_swept(state, a, b, travel):
    """Whether a pair is swept that travels so far within the step."""
    if state.mode == EVENT_DRIVEN:
        return True
    return (has_sweeps(state, a) or has_sweeps(state, b)) and travel > FAST * smaller_extent(state.bodies, a, b)


@part
def turns_far(state, a, b):
    """Whether a pair has to be looked at on its way: one of the two turns by more than a part of the smaller one. Where
    they may bounce, only if it turns by itself, past the middle of the other: impacts have the rest."""
    bodies = state.bodies
    extent, inverse_mass = bodies.min_extent, bodies.inverse_mass
    if len(bodies.axes) == 0:
        return False
    way_a, way_b = way_of_turning(bodies, a, bodies.turn[a]), way_of_turning(bodies, b, bodies.turn[b])
    if way_a + way_b <= FAST * smaller_extent(bodies, a, b):
        return False
    middle = 0.5 * (extent[a] + extent[b])
    if (way_a > middle and inverse_mass[a] == 0.0) or (way_b > middle and inverse_mass[b] == 0.0):
        return True
    return restitution_of(state, a, b) == 0.0


@part
def rest_edge(state, a, b, dt):
    """How far what slides or rests may have sunk in."""
    return min(contact_margin(state, dt, a, b), FAST * smaller_extent(state.bodies, a, b))


@inlined
def limits_of_sweep(state, a, b, travel, threshold, dt):
    """Limits of the search for the touch of a swept pair that travels so far in the step (see time_of_impact)."""
    stride = FAST * smaller_extent(state.bodies, a, b) / travel * dt if travel > 0.0 else dt
    return rest_edge(state, a, b, dt), stride, threshold, -math.inf


@inlined
def has_search_bounds(state, i, speed, span):
    """Whether a body has to stay where its neighbours are known: also one that only others are swept for."""
    return state.mode == EVENT_DRIVEN or speed * span > FAST * state.bodies.min_extent[i]


@part
def leaves_bounds_at(state, i, now, dt):
    """The time at which a body that goes on from here may leave its search bounds; infinity: not in this step."""
    bodies, path, span = state.bodies, path_of(state, i), dt - now
    at, v = along(path, now), rate_along(path, now)
    bend = bend_of(add_scaled(path[2], path[3], 3.0 * now), path[3], span)
    if not has_search_bounds(state, i, length(v), span):
        return math.inf
    left = math.inf
    lower, upper = bodies.search_lower[i], bodies.search_upper[i]
    for k in range(len(v)):
        speed = item(v, k)
        room = (item(upper, k) - item(at, k) if speed > 0.0 else item(at, k) - item(lower, k)) - bend
        if not room >= abs(speed) * span:
            left = min(left, max(0.0, room / abs(speed)))
    return now + left


@part
def share_within(width, extents):
    """Of what is spread evenly over these extents, the share that a cube of this width holds."""
    share = 1.0
    for k in range(len(extents)):
        if item(extents, k) > width:
            share *= width / item(extents, k)
    return share


@part
def width_that_holds(share, extents):
    """The width of a cube that holds that share; infinity for all.

    Axes along which it reaches from end to end hold no more if it grows: so bodies in a row count as in a row, however
    little they are off it.
    """
    filled, width = 0.0, math.inf
    for _ in range(len(extents)):
        product, free, narrowest = 1.0, 0, math.inf
        for k in range(len(extents)):
            extent = item(extents, k)
            if extent > filled:
                product, free, narrowest = product * extent, free + 1, min(narrowest, extent)
        if free == 0 or share >= 1.0:
            return math.inf
        width = share * product
        if free > 1:
            width = math.sqrt(width) if free == 2 else power(width, 1.0 / 3.0)
        if width <= narrowest:
            return width
        filled = narrowest
    return width


@part
def speed_at(state, i, now):
    """A body's speed on its path."""
    return length(rate_along(path_of(state, i), now))


@part
def measure_crowd(state, now):
    """(mean kinetic energy of the dynamic bodies with a shape, bodies with a shape, extents of their places); notes
    each one's speed in search_margin. Places are in ``search_lower``."""
    bodies = state.bodies
    margin, inverse_mass = bodies.search_margin, bodies.inverse_mass
    energy, weighed, shaped, far = 0.0, 0, 0, math.inf
    lowest, highest = zero_of(state), zero_of(state)
    for k in range(len(lowest)):
        lowest, highest = replace(lowest, k, far), replace(highest, k, -far)
    for i in range(state.first, state.moving):
        x, known = bodies.search_lower[i], bodies.shape[i] >= 0
        for k in range(len(x)):
            lowest = replace(lowest, k, min(item(lowest, k), item(x, k) if known else far))
            highest = replace(highest, k, max(item(highest, k), item(x, k) if known else -far))
        shaped += known
        margin[i] = speed_at(state, i, now)
        if inverse_mass[i] > 0.0 and known:
            energy += 0.5 * margin[i] * margin[i] / inverse_mass[i]
            weighed += 1
    extents = zero_of(state)
    for k in range(len(extents)):
        extents = replace(extents, k, max(0.0, item(highest, k) - item(lowest, k)))
    return energy / max(1, weighed), shaped, extents


@part
def find_margins(state, now, span):
    """How far from its foreseen motion each body may go, so that impacts seldom send it farther; but where all are
    fast, no farther than that its bounds hold CROWD bodies. Returns in what time bounds are then crossed, or infinity.

    now: seconds since the start of the step. A body that an impact gives its share of the energy has the speed
    sqrt(2 E / m) (equipartition); twice or thrice that is rare.
    """
    bodies = state.bodies
    margin, inverse_mass, shape = bodies.search_margin, bodies.inverse_mass, bodies.shape
    first, moving = state.first, state.moving
    energy, shaped, extents = measure_crowd(state, now)
    cell = width_that_holds(1.0 / max(1, shaped), extents)
    crowd, wide = 0.0, 0
    for i in range(first, moving):
        speed = max(margin[i], SPREAD * math.sqrt(2.0 * energy * inverse_mass[i]))
        margin[i] = 0.0
        if inverse_mass[i] > 0.0 and shape[i] >= 0 and has_search_bounds(state, i, speed, span):
            margin[i] = speed * span
            crowd += shaped * share_within(2.0 * margin[i], extents)
            wide += 2.0 * margin[i] > cell
        if state.path_degree > 1:
            margin[i] += 2.0 * bend_of(bodies.path_second[i], bodies.path_third[i], span)
    if shaped <= ALL_PAIRS or not crowd > CROWD * shaped:
        return math.inf
    largest = 0.5 * width_that_holds(CROWD / max(1, wide), extents)
    speeds, fast = 0.0, 0
    for i in range(first, moving):
        speed = speed_at(state, i, now)
        if shape[i] >= 0 and speed * span > largest:
            speeds += speed
            fast += 1
    crossing = largest * fast / speeds if fast > 0 else math.inf
    if crossing < (now + span) / MOST_SEARCHES:  # rather more neighbours than more searches
        largest *= (now + span) / (MOST_SEARCHES * crossing)
        crossing = (now + span) / MOST_SEARCHES
    for i in range(first, moving):
        margin[i] = min(margin[i], largest)
    return crossing


@part
def place_at(state, i, time, end):
    """Where a moving body is at that time; a slow one, whose path is short, at the ``end`` of the step."""
    path = path_of(state, i)
    slow = travel_of(path, end) <= FAST * state.bodies.min_extent[i]
    return along(path, end if slow else time)


def sweep_pairs(state, dt):
    """Add the pairs that touch on their way only to the contacts: those that are swept and not in touch at the end."""
    if not (state.sweeping and state.moved):
        return OK
    pairs, bodies, found = state.pairs, state.bodies, 0
    for c in range(pairs.count):
        a, b = pairs.a[c], pairs.b[c]
        if not pairs.near_contact[c]:
            path = relative_path(state, a, b)
            travel, turns = travel_of(path, dt) + turning_travel(state, dt, a, b), is_turning(state, dt, a, b)
            if not is_swept(state, a, b, travel) or (not turns and bounds_stay_disjoint(state, a, b, path, 0.0, dt)):
                continue
            address, limits = state.links[FIRST_TOUCH], limits_of_sweep(state, a, b, travel, 0.0, dt)
            touch, t, normal, point, at = call_first_touch(address, state, a, b, path, 0.0, dt, limits)
            if touch == APART:
                continue
            end = add(bodies.position[a], bodies.offset[a])
            pairs.normal[c], pairs.point[c] = normal, add(sub(centre_at(state, a, t), end), point)
            pairs.at[c], pairs.depth[c], pairs.near_contact[c] = at, 0.0, True
        pairs.hits[found] = c
        found += 1
    pairs.found = found
    return OK
