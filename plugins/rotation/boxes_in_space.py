"""How two boxes meet in space, from their faces and edges: the axes that may separate them (S. Gottschalk, M. C. Lin
and D. Manocha, "OBBTree", 1996). The widest gap of these is their distance where what is nearest lies above it.
"""

from __future__ import annotations

import math

from ...framework.jit.stack_arrays import stack_array
from ...framework.vectors import absolute, add, add_scaled, cross, dot, item, negative, replace, row, scale, store, sub
from ...systems.shapes.convex.pair import SUPPORT_TILT
from ...systems.shapes.convex.points import POINT_ROOM, clip
from ..corners import along_axes, in_world
from .box import boxes

ALONGSIDE = 1e-6  # sine: edges nearer to parallel part where faces do
EDGE_ROUNDING = 1e-10  # of the extents: by less edges part two boxes no more than faces


@boxes.kernel
def widest_gap(half, other, at, turn):
    """(gap, axis of the first box, axis of the second) where two boxes are farthest apart, or overlap least: across an
    edge of both, or above a face of one, the axis of the other being -1. at: from the first one's centre to the
    second's, along the first one's axes; turn: rows, the second one's axes along each of these."""
    gap, one, two, reach = -math.inf, -1, -1, scale(at, 0.0)
    for i in range(3):
        along = absolute(row(turn, i, at))
        apart = abs(item(at, i)) - item(half, i) - dot(along, other)
        reach = add_scaled(reach, along, item(half, i))
        if apart > gap:
            gap, one = apart, i
    for j in range(3):
        way = item(at, 0) * turn[0, j] + item(at, 1) * turn[1, j] + item(at, 2) * turn[2, j]
        apart = abs(way) - item(other, j) - item(reach, j)
        if apart > gap:
            gap, one, two = apart, -1, j
    least = EDGE_ROUNDING * (item(half, 0) + item(half, 1) + item(half, 2))
    for i in range(3):
        p, q = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            m, n, x, y = (j + 1) % 3, (j + 2) % 3, turn[p, j], turn[q, j]
            sine = math.sqrt(x * x + y * y)
            apart = abs(item(at, q) * x - item(at, p) * y) - item(half, p) * abs(y) - item(half, q) * abs(x)
            apart -= item(other, m) * abs(turn[i, n]) + item(other, n) * abs(turn[i, m])
            if sine > ALONGSIDE and apart > (gap + least) * sine:
                gap, one, two = apart / sine, i, j
    return gap, one, two


@boxes.kernel
def above_face(box, other, d, k, gap):
    """(whether the corner, edge or face of the other box that is nearest to the face along axis k is above it, outward
    normal, point from the centre of the box): in the middle of what they share, and of the gap."""
    foot = along_axes(box, d)
    out, i, j = 1.0 if item(foot, k) >= 0.0 else -1.0, (k + 1) % 3, (k + 2) % 3
    normal, reach, ways, free = scale(box.axes[k], out), scale(d, 0.0), stack_array(3, (0.0, 0.0, 0.0)), 0
    for axis in range(3):
        half = item(other.half_extents, axis)
        way = along_axes(box, scale(other.axes[axis], half))
        rise = out * item(way, k)
        if abs(rise) > SUPPORT_TILT * half:
            foot = add_scaled(foot, way, -math.copysign(1.0, rise))
        elif half > 0.0:
            store(ways, free, way)
            free, reach = free + 1, add(reach, absolute(way))
    foot = replace(foot, k, out * (item(box.half_extents, k) + 0.5 * gap))
    beyond = sub(add(absolute(foot), reach), box.half_extents)
    if item(beyond, i) <= 0.0 and item(beyond, j) <= 0.0:
        return True, normal, in_world(box, foot)
    if item(beyond, i) > 2.0 * item(reach, i) or item(beyond, j) > 2.0 * item(reach, j):
        return False, normal, foot
    corners, rim, count = stack_array(POINT_ROOM, (0.0, 0.0, 0.0)), stack_array(4, (0.0, 0.0, 0.0)), 2 * free
    for corner in range(4):
        x, y = 1.0 if corner in (1, 2) else -1.0, 1.0 if corner > 1 else -1.0
        store(rim, corner, (x * item(box.half_extents, i), y * item(box.half_extents, j), 0.0))
        at = add_scaled(foot, row(ways, 0, foot), x)
        if free > 1:
            at = add_scaled(at, row(ways, 1, foot), y)
        store(corners, corner, (item(at, i), item(at, j), 0.0))
    count = clip(corners, count, rim, 4)
    if count == 0:
        return False, normal, foot
    low = high = row(corners, 0, foot)
    for corner in range(1, count):
        x, y, _ = row(corners, corner, foot)
        low, high = (min(low[0], x), min(low[1], y), 0.0), (max(high[0], x), max(high[1], y), 0.0)
    foot = replace(replace(foot, i, 0.5 * (low[0] + high[0])), j, 0.5 * (low[1] + high[1]))
    return True, normal, in_world(box, foot)


@boxes.kernel
def across_edges(a, b, d, i, j, gap):
    """(whether two edges, along axis i of a and j of b, pass each other within their lengths, normal, point from a's
    centre): in the middle of the gap."""
    u, v = a.axes[i], b.axes[j]
    across = cross(u, v)
    square = dot(across, across)
    normal = scale(across, math.copysign(1.0 / math.sqrt(square), dot(across, d)))
    on_a, on_b = scale(d, 0.0), d
    for k in range(3):
        if k != i:
            on_a = add_scaled(on_a, a.axes[k], math.copysign(item(a.half_extents, k), dot(normal, a.axes[k])))
        if k != j:
            on_b = add_scaled(on_b, b.axes[k], -math.copysign(item(b.half_extents, k), dot(normal, b.axes[k])))
    way = sub(on_b, on_a)
    along_u, along_v = dot(cross(way, v), across) / square, dot(cross(way, u), across) / square
    within = abs(along_u) <= item(a.half_extents, i) and abs(along_v) <= item(b.half_extents, j)
    return within, normal, add_scaled(add_scaled(on_a, u, along_u), normal, 0.5 * gap)


@boxes.kernel
def boxes_in_space(a, b, d):
    """(found, gap, normal, point): not found where an end of an edge, or a corner beside a face, is nearest."""
    turn = stack_array(3, (0.0, 0.0, 0.0))
    for k in range(3):
        store(turn, k, along_axes(b, a.axes[k]))
    gap, one, two = widest_gap(a.half_extents, b.half_extents, along_axes(a, d), turn)
    if two < 0:
        found, normal, point = above_face(a, b, d, one, gap)
    elif one < 0:
        found, normal, point = above_face(b, a, negative(d), two, gap)
        normal, point = negative(normal), add(d, point)
    else:
        found, normal, point = across_edges(a, b, d, one, two, gap)
    return found, gap, normal, point
