"""A segment against a box along the world's axes, for capsules.

d leads from the segment's middle to the box's centre; u is the unit vector along the segment, half its half length, box
the half extents.
"""

from __future__ import annotations

import math

from ..framework.compilation import inlined, part
from ..framework.vectors import absolute, add_scaled, clamped, divided, dot, item, replace, scale, sub

PARALLEL = 1e-12  # sine of the angle below which a segment and an edge have no plane in common
SHALLOW = 1e-3  # sine of an angle with a face below which a gap is perpendicular enough as it is
TILT = 1e-6  # radians; a segment so close to parallel to a face or an edge touches along its length, not at a point


@part
def box_overlap(d, u, half, box):
    """(least overlap, its unit normal, vector that decides on the normal's sign if d does not).

    The overlap is negative if they are apart. Tests the normals of the faces of the sum of both: those of the box, and
    those of the segment with each edge.
    """
    zero, k = scale(u, 0.0), 0
    overlaps = sub(add_scaled(box, absolute(u), half), absolute(d))
    for i in range(1, len(d)):
        k = i if item(overlaps, i) < item(overlaps, k) else k
    depth, normal, axis = item(overlaps, k), replace(zero, k, 1.0), scale(u, item(u, k))
    for i in range(2 * len(d) - 3):  # the planes of two axes, i and j
        j = (i + 1) % len(d)
        side = replace(replace(zero, i, item(u, j)), j, -item(u, i))
        size = math.sqrt(dot(side, side))
        if size > PARALLEL:
            side = divided(side, size)
            overlap = dot(box, absolute(side)) - abs(dot(side, d))
            if overlap < depth:
                depth, normal, axis = overlap, side, u
    return depth, normal, axis


@inlined
def way_to_box(t, d, u, box):
    """The vector to a box from the point at t of a segment."""
    centre = add_scaled(d, u, -t)
    return sub(centre, clamped(centre, box))


@part
def box_gap(d, u, half, box):
    """The shortest vector from a segment to a box.

    The square of the distance is convex along the segment. Its slope changes linearly between the planes of the faces:
    finds the two next to its zero.
    """
    low, high = -half, half
    rate, end_rate = dot(way_to_box(low, d, u, box), u), dot(way_to_box(high, d, u, box), u)  # towards the box
    if rate <= 0.0 or end_rate >= 0.0:
        return way_to_box(low if rate <= 0.0 else high, d, u, box)
    for turn in range(2 * len(d)):
        k = turn // 2
        t = item(d, k) + (item(box, k) if turn % 2 == 0 else -item(box, k))
        t = t / item(u, k) if item(u, k) != 0.0 else high
        if low < t < high:
            here = dot(way_to_box(t, d, u, box), u)
            if here > 0.0:
                low, rate = t, here
            else:
                high, end_rate = t, here
    way = way_to_box(low + (high - low) * (rate / (rate - end_rate)), d, u, box)
    beside = u  # without the axes along which the segment passes the box
    for k in range(len(d)):
        beside = replace(beside, k, item(u, k) if item(way, k) != 0.0 else 0.0)
    # Make it exactly perpendicular: rounding matters if the gap is small.
    return add_scaled(way, beside, -dot(way, u) / max(dot(beside, beside), SHALLOW * SHALLOW))


@part
def place_along(normal, d, u, half, box):
    """Where on a segment the contact with a box is, for the normal.

    An end, what lies nearest to an edge or a corner, or the middle of what the segment shares with a face or an edge.
    """
    low, high, square, along = -half, half, 0.0, 0.0
    for k in range(len(d)):
        x = item(u, k)
        if abs(item(normal, k)) > TILT:
            square += x * x
            along += x * (item(d, k) - math.copysign(item(box, k), item(normal, k)))
        elif abs(x) > PARALLEL:
            first, last = item(d, k) / x - item(box, k) / abs(x), item(d, k) / x + item(box, k) / abs(x)
            low, high = max(low, first), min(high, last)
    rise = dot(normal, u)
    if abs(rise) > TILT:
        return math.copysign(half, rise)
    t = along / square if square > TILT * TILT else 0.5 * (low + high)
    return max(-half, min(half, t))
