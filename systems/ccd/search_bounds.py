"""Which bodies are swept along their paths, and how far they may go before their neighbours are asked for again.

Whether a pair is swept: always if all is driven by events; else if it is fast, so that within the step it travels more
than a part of the smaller body's size. A slower one that overlaps anywhere on its way still does so at the end of it,
but for grazes: on a way s two spheres of diameter D that meet nowhere at the step's end overlap by s^2 / 8 D at most,
which for FAST is the slop.
"""

from __future__ import annotations

import math

from ...framework.compilation import inlined, kernel
from ...framework.vectors import add, add_scaled, item, length, replace, row, scale, store
from ..integration.trajectory import along, along_rate, bend_of, is_straight, relative_path, travel_of
from ..shapes.tolerances import reach, smaller
from .time_of_impact import APART

DISCRETE, CONTINUOUS, EVENT_DRIVEN = range(3)
MODES = {"discrete": DISCRETE, "continuous": CONTINUOUS, "event_driven": EVENT_DRIVEN}
FAST = 0.2  # of the smaller body's size
SPREAD = 2.0  # times the speed at which a body has its share of the energy: few are ever faster after a blow
CROWD = 0.5  # neighbours that the room of a body may hold, on average
ALL_PAIRS = 32  # bodies: so few may all be each other's neighbours
GIVE = 0.05  # of the size: that much farther than its room a body may go


@inlined
def is_swept(a, b, travel, size, sweep_of):
    """Whether a pair is swept that travels so far within the step; sweep_of: the mode, and who has ccd (n,)."""
    mode, ccd = sweep_of
    if mode == EVENT_DRIVEN:
        return True
    return (mode == CONTINUOUS or ccd[a] or ccd[b]) and travel > FAST * smaller(a, b, size)


@inlined
def roams(i, speed, span, size, sweep_of):
    """Whether a body has to stay where its neighbours are known: also one that only others are swept for."""
    return sweep_of[0] == EVENT_DRIVEN or speed * span > FAST * size[i]


@inlined
def leaves_at(i, now, dt, size, motion, sweep_of, roam_lower, roam_upper, like):
    """The time at which a body that goes on from here may leave its space; infinity: not in this step."""
    origin, path, second, third, degree = motion
    x1, x2, x3, span = row(path, i, like), like, like, dt - now
    if degree > 1:
        x2, x3 = row(second, i, like), row(third, i, like)
    at, v = along(now, row(origin, i, like), x1, x2, x3), along_rate(now, x1, x2, x3)
    bend = bend_of(add_scaled(x2, x3, 3.0 * now), x3, span)
    if not roams(i, length(v), span, size, sweep_of):
        return math.inf
    left = math.inf
    for k in range(len(like)):
        speed = item(v, k)
        room = (roam_upper[i, k] - item(at, k) if speed > 0.0 else item(at, k) - roam_lower[i, k]) - bend
        if not room >= abs(speed) * span:
            left = min(left, max(0.0, room / abs(speed)))
    return now + left


@inlined
def share_within(width, extents, like):
    """Of what is spread evenly over these extents, the share that a cube of this width holds."""
    share = 1.0
    for k in range(len(like)):
        if item(extents, k) > width:
            share *= width / item(extents, k)
    return share


@inlined
def width_that_holds(share, extents, like):
    """The width of a cube that holds that share; infinity for all. Axes along which it reaches from end to end hold no
    more if it grows: so bodies in a row count as in a row, however little they are off it."""
    filled, width = 0.0, math.inf
    for _ in range(len(like)):
        product, free, narrowest = 1.0, 0, math.inf
        for k in range(len(like)):
            extent = item(extents, k)
            if extent > filled:
                product, free, narrowest = product * extent, free + 1, min(narrowest, extent)
        if free == 0 or share >= 1.0:
            return math.inf
        width = (share * product) ** (1.0 / free)
        if width <= narrowest:
            return width
        filled = narrowest
    return width


@inlined
def _speed(i, now, motion, like):
    path, second, third, degree = motion[1], motion[2], motion[3], motion[4]
    v = row(path, i, like)
    if degree > 1:
        v = along_rate(now, v, row(second, i, like), row(third, i, like))
    return length(v)


@kernel
def find_rooms(now, span, moving, shape, size, inverse_mass, before, motion, sweep_of, room, like):
    """How far from its foreseen motion each body may go, so that blows seldom send it farther; but where all are fast,
    no farther than that a room holds CROWD bodies. Returns in what time rooms are crossed then, else infinity.

    now: seconds since the start of the step; shape (n,): -1 for none; before (n, d): where they are then. A body that
    a blow gives its share of the energy has the speed sqrt(2 E / m) (equipartition); twice or thrice that is rare.
    """
    second, third, degree = motion[2], motion[3], motion[4]
    energy, weighed, shaped = 0.0, 0, 0
    lowest, highest = scale(like, 0.0), scale(like, 0.0)
    for k in range(len(like)):
        lowest, highest = replace(lowest, k, math.inf), replace(highest, k, -math.inf)
    for i in range(moving):
        x, known = row(before, i, like), shape[i] >= 0
        for k in range(len(like)):
            lowest = replace(lowest, k, min(item(lowest, k), item(x, k) if known else math.inf))
            highest = replace(highest, k, max(item(highest, k), item(x, k) if known else -math.inf))
        shaped += known
        room[i] = _speed(i, now, motion, like)
        if inverse_mass[i] > 0.0 and known:
            energy += 0.5 * room[i] * room[i] / inverse_mass[i]
            weighed += 1
    energy = energy / max(1, weighed)
    extents = like
    for k in range(len(like)):
        extents = replace(extents, k, max(0.0, item(highest, k) - item(lowest, k)))
    cell = width_that_holds(1.0 / max(1, shaped), extents, like)
    crowd, wide = 0.0, 0
    for i in range(moving):
        speed = max(room[i], SPREAD * math.sqrt(2.0 * energy * inverse_mass[i]))
        room[i] = 0.0
        if inverse_mass[i] > 0.0 and shape[i] >= 0 and roams(i, speed, span, size, sweep_of):
            room[i] = speed * span
            crowd += shaped * share_within(2.0 * room[i], extents, like)
            wide += 2.0 * room[i] > cell
        if degree > 1:
            room[i] += 2.0 * bend_of(row(second, i, like), row(third, i, like), span)
    if shaped <= ALL_PAIRS or not crowd > CROWD * shaped:
        return math.inf
    largest = 0.5 * width_that_holds(CROWD / max(1, wide), extents, like)
    speeds, fast = 0.0, 0
    for i in range(moving):
        room[i] = min(room[i], largest)
        speed = _speed(i, now, motion, like)
        if shape[i] >= 0 and speed * span > largest:
            speeds += speed
            fast += 1
    return SPREAD * largest * fast / speeds if fast > 0 else math.inf


@kernel
def places_at(time, end, moving, size, motion, places, like):
    """Where the moving bodies are then on their paths; slow ones, whose ways are short, at the ``end`` of the step."""
    origin, path, second, third, degree = motion
    for i in range(moving):
        x1, x2, x3 = row(path, i, like), like, like
        if degree > 1:
            x2, x3 = row(second, i, like), row(third, i, like)
        slow = travel_of(x1, x2, x3, end) <= FAST * size[i]
        store(places, i, along(end if slow else time, row(origin, i, like), x1, x2, x3))


@kernel
def widen(moving, before, after, room, size, lower, upper, roam_lower, roam_upper, frame, like):
    """Let the boxes of moving bodies hold their rooms, and note where their centres may be; frame: see uniform_grid."""
    d = len(like)
    for i in range(moving):
        for k in range(d):
            lower[i, k] -= room[i]
            upper[i, k] += room[i]
            give = room[i] + GIVE * size[i]
            roam_lower[i, k] = min(before[i, k], after[i, k]) - give
            roam_upper[i, k] = max(before[i, k], after[i, k]) + give
            if lower[i, k] < frame[k]:
                frame[k] = lower[i, k]
            if upper[i, k] > frame[3 + k]:
                frame[3 + k] = upper[i, k]
            if upper[i, k] - lower[i, k] > frame[6]:
                frame[6] = upper[i, k] - lower[i, k]


def make_sweep_kernel(first_touch):
    """The kernel that looks for touches on the way, over the shapes of a scene."""

    @kernel
    def find_swept(
        dt, pair_a, pair_b, pairs, involved, entity, share, size, shape_of, offset, shapes, motion, fixed_slop,
        sweep_of, pair_depth, pair_normal, pair_point, hits, hit_a, hit_b, like,
    ):  # fmt: skip
        """The contacts: pairs that touch at the end or nearly do, which are ``involved`` (m,), and those that are swept
        and touch on their way; returns how many. Their indices and entities go to hits, hit_a, hit_b."""
        found = 0
        for c in range(pairs):
            a, b = pair_a[c], pair_b[c]
            if not involved[c]:
                x0, x1, x2, x3 = relative_path(a, b, motion, offset, like)
                travel = travel_of(x1, x2, x3, dt)
                if not is_swept(a, b, travel, size, sweep_of):
                    continue
                straight = is_straight(a, b, x2, x3, dt, motion, like)
                touch, t, normal, point, _ = first_touch(
                    shape_of[a], a, shape_of[b], b, x0, x1, x2, x3, straight, 0.0, dt,
                    min(reach(dt, a, b, share, size, fixed_slop), FAST * smaller(a, b, size)),
                    FAST * smaller(a, b, size) / travel * dt, 0.0, shapes, like,
                )  # fmt: skip
                if touch == APART:
                    continue
                origin, path, second, third, degree = motion
                centre = add(add_scaled(row(origin, a, like), row(path, a, like), t), row(offset, a, like))
                if degree > 1:
                    centre = add_scaled(centre, add_scaled(row(second, a, like), row(third, a, like), t), t * t)
                store(pair_normal, c, normal)
                store(pair_point, c, add(centre, point))
                pair_depth[c] = 0.0
            hits[found], hit_a[found], hit_b[found] = c, entity[a], entity[b]
            found += 1
        return found

    return find_swept
