"""One segment of a chain: a collider that knows its neighbours, so that nothing catches where two segments meet.

A segment is solid on its right. It has the contacts whose normals are its own or, where it starts in a convex corner,
between that of the segment before it and its own. What is beyond its ends belongs to its neighbours.
"""

from __future__ import annotations

import collections
import math
from collections.abc import Mapping
from typing import Any, ClassVar, Self

import numpy as np

from ...components import Collider, RigidBody
from ...framework import Component, Convex, Plugin, column
from ...framework.compilation import part
from ...framework.typing import VectorField
from ...framework.vectors import add, add_scaled, divided, dot, length, negative, scale, sub
from ..standard_shapes import convex_convex, sharp

plugin = Plugin("terrain", version="1.0")

STRAIGHT = 1e-9  # sine: corners that are flatter are none
NEAR = 1e-9  # of the segment's length: so near its end is on it
BESIDE = 0.01  # of the length: what is nearer to the segment's own part is looked at as if it were there, as a search
# for the time of a touch takes smaller gaps for one
TILT = 0.02  # radians: a face that is tilted by less lies on the segment with its whole length
FLAT = 1.0 - 0.5 * TILT * TILT  # cosine of that
LEVEL = 1e-6  # slope of a face that lies on the segment, so that they touch in the middle of what they share
BEHIND = 0.01  # of the length, and the thickness: a body whose centre is farther behind the line has no contact
FOLDED = 0.05  # of the length: how far a segment reaches at least into what follows an inner corner
NONE, PART, WHOLE = range(3)
PIECES, TURNS = 16, 16  # corners of the other shape that are looked at

# The part of a shape that faces a line: its ends and its nearest point, each (along the line, height).
Face = collections.namedtuple("Face", "low nearest high")


@plugin.shape(cost=3)
class ChainSegmentCollider(Collider):
    """A segment of a static polyline in a 2D world, solid on the right of the way from start to end.

    start, end
        (2,) m, relative to the centre; not turned with the Transform; ValueError if they are equal
    before, after
        (2,) m, the polyline's points before start and after end; the same as these where it ends
    thickness
        m, a body whose centre is so far behind the line is still pushed out to its front; farther behind nothing is
    """

    __slots__ = ()

    dimensions: ClassVar[tuple[int, ...]] = (2,)
    excludes: ClassVar[Mapping[type[Component], str]] = {RigidBody: "terrain is static, leave it out"}
    start: VectorField = column(item="vector", unit="m")
    end: VectorField = column(item="vector", unit="m")
    before: VectorField = column(item="vector", unit="m")
    after: VectorField = column(item="vector", unit="m")
    thickness: float = column(default=0.0, minimum=0.0, unit="m")

    def _fill(self, given: Mapping[str, Any]) -> None:
        super()._fill(given)
        if np.array_equal(self.start, self.end):
            raise ValueError(f"ChainSegmentCollider: start and end must differ, both are {self.start!r}")

    @classmethod
    def sample(cls, **common: Any) -> Self:
        return cls((-0.5, 0.0), (0.5, 0.0), (-1.0, -0.5), (1.0, -0.5), **common)

    @staticmethod
    def bounds(shape, dimensions):
        """At least half as thick as long: tolerances follow the extent. With what is behind it, see thickness."""
        way = sub(shape.end, shape.start)
        x = max(abs(shape.start[0]), abs(shape.end[0]))
        y = max(abs(shape.start[1]), abs(shape.end[1]))
        behind = shape.thickness / length(way)
        behind_x, behind_y = behind * abs(way[1]), behind * abs(way[0])
        return (1.0 + BESIDE) * max(x, 0.5 * y) + behind_x, (1.0 + BESIDE) * max(y, 0.5 * x) + behind_y

    @staticmethod
    def support(shape, direction):
        return shape.start if dot(shape.start, direction) >= dot(shape.end, direction) else shape.end

    @staticmethod
    def outline(shape, dimensions):
        return (shape.start, shape.end), ()


segment_support = plugin.kernel(ChainSegmentCollider.support)


@plugin.kernel
def to_left(v):
    """Turned by a quarter."""
    return (-v[1], v[0])


@plugin.kernel
def to_right(v):
    return (v[1], -v[0])


@plugin.kernel
def cross(u, v):
    return u[0] * v[1] - u[1] * v[0]


@part
def corner_of(way, along, size, sign):
    """(normal on the other side of a corner, how far the segment counts beyond it if it is no outer one).

    What goes straight on or up is as far as the neighbour goes: a body keeps its contact while it moves over there.

    way: through the neighbour, in the direction of the segment; none where the chain ends, which is as a vertical wall
    below. sign: 1 at the end, -1 at the start.
    """
    length_of_way = length(way)
    if length_of_way == 0.0:
        return scale(along, sign), 0.0
    turn = sign * cross(along, way) / length_of_way
    if turn < -STRAIGHT:
        return to_left(divided(way, length_of_way)), 0.0
    return to_left(along), max(dot(way, along), FOLDED * size)


@part
def face_of(b, at, normal, support):
    """The Face of a shape at ``at`` from a corner towards the line through it that has this normal."""
    along, down = to_right(normal), negative(normal)
    low = add(at, support(b, add_scaled(down, along, -TILT)))
    nearest = add(at, support(b, down))
    high = add(at, support(b, add_scaled(down, along, TILT)))
    return Face(
        (dot(along, low), dot(normal, low)), (dot(along, nearest), dot(normal, nearest)),
        (dot(along, high), dot(normal, high)),
    )  # fmt: skip


@plugin.kernel
def height_between(one, two, x):
    """Height at x of the line through two points, x being between them."""
    return one[1] + (two[1] - one[1]) * (x - one[0]) / (two[0] - one[0])


@part
def above(face, first, last):
    """(NONE, PART or WHOLE of a Face is above the line from first to last; least height there; middle of what is
    lowest). WHOLE: its nearest point is."""
    low, nearest, high = face.low, face.nearest, face.high
    if low[0] > last or high[0] < first:
        return NONE, 0.0, 0.0
    if abs(high[1] - low[1]) <= LEVEL * (high[0] - low[0]):
        return WHOLE, nearest[1], 0.5 * (max(low[0], first) + min(high[0], last))
    if nearest[0] > last:
        return PART, height_between(low, nearest, last) if low[0] < nearest[0] else nearest[1], last
    if nearest[0] < first:
        return PART, height_between(nearest, high, first) if nearest[0] < high[0] else nearest[1], first
    return WHOLE, nearest[1], nearest[0]


@part
def next_turn(b, begin, end, base, support):
    """(another corner, normal along which both are equally near) of a shape: the next after ``base``, the nearest along
    normal ``begin``, on the way to normal ``end``; the same if it is the nearest there too."""
    other, turn, between = support(b, negative(end)), end, add(begin, end)
    for _ in range(TURNS):
        way = sub(other, base)
        if way[0] == 0.0 and way[1] == 0.0:
            break
        turn = to_left(divided(way, length(way)))
        turn = turn if dot(turn, between) >= 0.0 else negative(turn)
        further = support(b, negative(turn))
        if not dot(turn, sub(further, base)) < -STRAIGHT * length(way):
            break
        other = further
    return other, turn


@part
def round_corner(b, at, normals, least, support):
    """The greatest gap of a shape and the corner of a line along a normal between two, if it exceeds ``least``, and
    that normal; else (least, the first).

    at: from the corner to the shape's centre. The normals run clockwise, by less than half a turn.
    """
    one, two = normals
    most, best, base, begin = least, one, support(b, negative(one)), one
    for _ in range(PIECES):
        other, turn = next_turn(b, one, two, base, support)
        ends, place = other[0] == base[0] and other[1] == base[1], add(at, base)
        if not ends and cross(one, turn) < 0.0 and cross(turn, two) < 0.0 and dot(turn, place) > most:
            most, best = dot(turn, place), turn
        if ends:
            turn = two
        if cross(begin, place) < 0.0 and cross(place, turn) < 0.0 and dot(place, add(begin, turn)) > 0.0:
            size = length(place)
            if size > most:
                most, best = size, divided(place, size)
        if ends:
            break
        base, begin = other, turn
    return most, best


@part
def best_at_corner(b, at, one, two, support):
    """(whether there is one; gap; normal): the greatest gap of a shape and a corner along a normal between two that is
    greater than along these."""
    least = max(dot(one, add(at, support(b, negative(one)))), dot(two, add(at, support(b, negative(two)))))
    if dot(one, two) > -0.5:
        gap, normal = round_corner(b, at, (one, two), least, support)
        return gap > least, gap, normal
    between = sub(to_right(one), to_right(two))
    between = divided(between, length(between))
    middle = max(least, dot(between, add(at, support(b, negative(between)))))
    gap, normal = round_corner(b, at, (one, between), middle, support)
    further, other = round_corner(b, at, (between, two), gap, support)
    if further > gap:
        return True, further, other
    return gap > least, gap, normal if gap > middle else between


@plugin.kernel
def miss(normal, gap, frame, place):
    """No contact of the segment's own, and none before the two have come nearer by ``gap`` along the normal.

    frame: (start, direction of the segment); place: what of the shape may touch first, along it and above it.
    """
    start, along = frame
    return False, -gap, normal, add_scaled(add_scaled(start, along, place[0]), to_left(along), place[1])


@part
def with_corner(b, at, corner, face, known, support):
    """What is known of a contact, after a look at an outer corner: (kind, height, normal, whether it is the corner).

    corner: (outer normal, normal, whether it is the segment's own, whether it is at the end); the contact is at the
    corner if the shape is farther along a normal in between than along that of the segment, unless a FLAT face lies on
    it; and none of this segment if that is the outer one, or if the corner belongs to the next segment.
    """
    outer, normal, owned, at_end = corner
    kind, height, _, _ = known
    one, two = (normal, outer) if at_end else (outer, normal)
    rounds, gap, between = best_at_corner(b, at, one, two, support)
    if not rounds:
        beside = face_of(b, at, outer, support)
        gap, between = beside.nearest[1], outer
        if not gap > face.nearest[1]:
            return known
        lies, clipped, _ = above(beside, 0.0, 0.0)
        if lies != NONE and owned and (kind != PART or clipped < height):  # the shape's face lies on the corner
            return PART, clipped, outer, True
    if rounds and kind == PART and dot(between, normal) > FLAT:
        return known
    if rounds and owned:
        return PART, gap, between, True
    if kind == NONE or gap > height + STRAIGHT * (abs(at[0]) + abs(at[1])):
        return NONE, gap, between, False
    return known


def register_pairs(collider, contact):
    """The pairs of a piece of terrain, solid on one side.

    ``contact(a, b, d, support, rounding)``: whether a convex shape is over the piece's own part, else its neighbours
    have the contact if there is one; depth, normal, point.
    """

    def is_beside(a, b, d, slop, support, rounding):
        return not contact(a, b, d, support, rounding)[0]

    @plugin.pair(collider, Convex, corner=is_beside)
    def piece_convex(a, b, d, support, rounding):
        owns, depth, normal, point = contact(a, b, d, support, rounding)
        return owns and depth >= 0.0, depth, normal, point

    @plugin.pair(collider, collider)
    def two_pieces(a, b, d):
        """Never a contact: neither moves."""
        return False, -math.inf, d, d


@part
def contact_of_segment(a, b, d, support, rounding):
    """(whether the shape is over the segment's own part; depth, normal, point)."""
    way, round_b = sub(a.end, a.start), rounding(b)
    size = length(way)
    along = divided(way, size)
    normal, zone, at_start, at_end = to_left(along), BESIDE * size, sub(d, a.start), sub(d, a.end)
    face, frame = face_of(b, at_start, normal, support), (a.start, along)
    way_before, way_after = sub(a.start, a.before), sub(a.after, a.end)
    outer_start, room_start = corner_of(way_before, along, size, -1.0)
    outer_end, room_end = corner_of(way_after, along, size, 1.0)
    rounded_start, rounded_end = cross(outer_start, normal) < 0.0, cross(normal, outer_end) < 0.0
    ends = rounded_end and way_after[0] == 0.0 and way_after[1] == 0.0
    if dot(outer_start, outer_end if ends else normal) >= -STRAIGHT:  # else neither side tells
        ahead, beyond = -face.high[0], face.low[0] - size
        if rounded_start:
            wall = -face_of(b, at_start, outer_start, support).high[0]
            is_wall = dot(way_before, way_before) > 0.0 or dot(along, at_start) < 0.0
            ahead = wall if is_wall else min(ahead, wall)
        if ends:
            wall = face_of(b, at_end, outer_end, support).low[0]
            beyond = wall if dot(along, at_end) > 0.0 else min(beyond, wall)
        ahead, beyond = ahead - room_start, beyond - room_end
        if ahead > zone or beyond > zone:
            gap = face.nearest[1] - round_b
            if gap > 2.0 * zone:
                return miss(normal, gap - zone, frame, face.nearest)
            if ahead > beyond:
                return miss(to_left(outer_start), ahead, frame, face.high)
            return miss(to_right(outer_end if ends else normal), beyond, frame, face.low)
    kind, height, x = above(face, -max(room_start, NEAR * size), size + max(room_end, NEAR * size))
    if kind == NONE:
        height = face.nearest[1]
    known, point, centre = (kind, height, normal, False), add_scaled(a.start, along, x), dot(normal, at_start)
    near = height < round_b + NEAR * size
    if near and x > size and not rounded_end:  # over what goes up from there, not behind it
        centre = min(centre, cross(way_after, at_end) / length(way_after))
    elif near and x < 0.0 and not rounded_start:
        centre = min(centre, cross(way_before, at_start) / length(way_before))
    if rounded_start:
        known = with_corner(b, at_start, (outer_start, normal, True, False), face, known, support)
        if known[3]:
            point, centre = a.start, dot(known[2], at_start)
    if rounded_end:
        before = known
        known = with_corner(b, at_end, (outer_end, normal, ends, True), face, before, support)
        if before[3] and known[1] <= before[1]:  # the other corner parts them more
            known = before
        elif known[3]:
            point, centre = a.end, dot(known[2], at_end)
    kind, height, best, _ = known
    if kind == NONE:
        gap = height - round_b
        if gap < zone:
            _, depth, straight, _ = convex_convex(a, b, d, segment_support, support, sharp, rounding)
            if -depth > zone:
                return miss(straight, -depth, frame, face.nearest)
        return miss(best, max(gap, NEAR * size), frame, face.nearest)
    if centre < -BEHIND * size - a.thickness:
        return miss(best, math.inf, frame, face.nearest)
    depth = round_b - height
    if kind == PART and depth < -size:  # what is beside it may come over it before that
        _, depth, best, point = convex_convex(a, b, d, segment_support, support, sharp, rounding)
        return True, depth, best, point
    return True, depth, best, add_scaled(point, best, -0.5 * depth)


register_pairs(ChainSegmentCollider, contact_of_segment)
