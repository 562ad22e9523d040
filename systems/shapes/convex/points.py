"""The points at which two convex shapes touch: where their faces lie on each other, from their supports.

The ends of a face are the supports a little to either side of the normal.
"""

from __future__ import annotations

from ....framework.compilation import part
from ....framework.vectors import add, add_scaled, dot, item, negative, replace, scale
from ..linking.convex_by_address import convex_at, rounding_by_address, support_by_address

MOST_POINTS = 4
SHORT = 1e-9  # of the distances of the ends: faces that share no more touch at a point


@part
def contact_points(state, sides, plane, within, places, gaps):
    """How many points the shapes of two bodies have; their places, relative to the centre of the first shape and in the
    middle between the surfaces, and the gaps there.

    sides: the rows; plane: (from centre to centre, normal, depth, point) of the pair; within: (the largest gap of a
    point, the largest angle, rad, between the normal of a face and that of the contact).
    """
    a, b = sides
    d, normal, depth, point = plane
    margin, tilt = within
    parameters, shape = state.shapes.parameters, state.bodies.shape
    one, other = convex_at(parameters[shape[a]], a), convex_at(parameters[shape[b]], b)
    places[0], gaps[0] = point, -depth
    if one[0] == 0 or other[0] == 0 or len(d) > 2:
        return 1
    along = replace(replace(normal, 0, -item(normal, 1)), 1, item(normal, 0))
    back, apart = negative(normal), -depth
    a_high = support_by_address(one, add_scaled(normal, along, tilt))
    a_low = support_by_address(one, add_scaled(normal, along, -tilt))
    b_high = add(d, support_by_address(other, add_scaled(back, along, tilt)))
    b_low = add(d, support_by_address(other, add_scaled(back, along, -tilt)))
    high, low = min(dot(a_high, along), dot(b_high, along)), max(dot(a_low, along), dot(b_low, along))
    if not high - low > SHORT * (abs(high) + abs(low)):
        return 1
    count = 0
    for e in range(2):
        at = high if e == 0 else low
        share_a = (at - dot(a_low, along)) / (dot(a_high, along) - dot(a_low, along))
        share_b = (at - dot(b_low, along)) / (dot(b_high, along) - dot(b_low, along))
        level_a = dot(a_low, normal) * (1.0 - share_a) + dot(a_high, normal) * share_a + rounding_by_address(one)
        level_b = dot(b_low, normal) * (1.0 - share_b) + dot(b_high, normal) * share_b - rounding_by_address(other)
        apart = level_b - level_a
        if apart <= margin:
            places[count], gaps[count] = add_scaled(scale(normal, 0.5 * (level_a + level_b)), along, at), apart
            count += 1
    return max(count, 1)
