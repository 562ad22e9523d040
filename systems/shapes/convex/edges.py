"""The edge of a convex shape in a plane that looks a way, found by its support: of shapes that do not tell it."""

from __future__ import annotations

from ....framework.compilation import inlined
from ....framework.vectors import add_scaled, dot, sub

SAME_POINT = 1e-12  # of the coordinates: corners that are no farther apart are one
FLAT_FACE = 1e-6  # of its size: how far a face may be from flat; what is shared and narrower is a point
FINER = 0.25  # of the tilt: where several faces are within it the next look is so much narrower, until one lies flat
FACE_LOOKS = 6  # at most


@inlined
def edge_towards(shape, support, normal, tilt):
    """Both ends of the core's edge in the direction of a normal; twice the same point if there is a corner."""
    along = (-normal[1], normal[0])
    one = normal
    for _ in range(FACE_LOOKS):
        one = support(shape, add_scaled(normal, along, -tilt))
        two = support(shape, add_scaled(normal, along, tilt))
        way = sub(two, one)
        square = dot(way, way)
        if square <= SAME_POINT * SAME_POINT * dot(one, one):
            break
        outward = (way[1], -way[0])
        if dot(outward, sub(support(shape, outward), one)) <= FLAT_FACE * square:
            return one, two
        tilt *= FINER
    return one, one
