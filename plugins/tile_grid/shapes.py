"""How a shape meets one rectangle of tiles.

A core that is a box along the tiles, as that of a box, a sphere or an upright capsule, in closed form; any other by its
support.
"""

from __future__ import annotations

from ...framework.compilation import part
from ...framework.vectors import add_scaled, clamped, length
from ..standard_shapes import convex_convex, sharp
from .faces import plugin


@plugin.kernel
def tile_support(half, direction):
    """A corner of a rectangle."""
    return (half[0] if direction[0] >= 0.0 else -half[0], half[1] if direction[1] >= 0.0 else -half[1])


@part
def core_of(b, support):
    """Left, right, lower and upper end of a shape's core, relative to its centre, and whether it is all of that box: it
    is if the corners are in it."""
    left, right = support(b, (-1.0, 0.0))[0], support(b, (1.0, 0.0))[0]
    lower, upper = support(b, (0.0, -1.0))[1], support(b, (0.0, 1.0))[1]
    is_box = left == right or lower == upper
    if not is_box:
        is_box = support(b, (1.0, 1.0)) == (right, upper) and support(b, (-1.0, 1.0)) == (left, upper)
        is_box = is_box and support(b, (1.0, -1.0)) == (right, lower) and support(b, (-1.0, -1.0)) == (left, lower)
    return left, right, lower, upper, is_box


@plugin.kernel
def apart(low, high, half):
    """By how much the interval low..high is apart from -half..half (negative: overlap), and on which side."""
    above, below = low - half, -half - high
    return (above, 1.0) if above >= below else (below, -1.0)


@part
def meet_box(extent, core, radius, d):
    """A rectangle and a rounded box, from the gaps along both axes: (touches, depth, normal, point)."""
    left, right, lower, upper = d[0] + core[0], d[0] + core[1], d[1] + core[2], d[1] + core[3]
    (gap_x, side_x), (gap_y, side_y) = apart(left, right, extent[0]), apart(lower, upper, extent[1])
    middle = clamped((0.5 * (max(left, -extent[0]) + min(right, extent[0])),
                      0.5 * (max(lower, -extent[1]) + min(upper, extent[1]))), extent)  # fmt: skip
    if gap_x > 0.0 and gap_y > 0.0:
        distance = length((gap_x, gap_y))
        normal = (side_x * (gap_x / distance), side_y * (gap_y / distance))
        middle = (side_x * extent[0], side_y * extent[1])
    elif gap_x > gap_y:
        distance, normal, middle = gap_x, (side_x, 0.0), (side_x * extent[0], middle[1])
    else:
        distance, normal, middle = gap_y, (0.0, side_y), (middle[0], side_y * extent[1])
    depth = radius - distance
    return depth >= 0.0, depth, normal, add_scaled(middle, normal, -0.5 * depth)


@part
def meet_rectangle(extent, b, core, radius, d, support, rounding):
    """How a rectangle with these half extents and a shape meet, d from its centre to that of the shape; as a pair."""
    if core[4]:
        return meet_box(extent, core, radius, d)
    return convex_convex(extent, b, d, tile_support, support, sharp, rounding)
