"""One triangle of a mesh: a collider that knows its neighbours, so that nothing catches at inner edges.

A triangle is solid behind its front, from which its corners run counter-clockwise. It has the contacts along its own
normal of what is above it and, at edges from which both faces fall away, those whose normals are between the two.
"""

from __future__ import annotations

import collections
import math
from collections.abc import Mapping
from typing import Any, ClassVar, Self

import numpy as np

from ...components import Collider, RigidBody
from ...framework import Component, column
from ...framework.compilation import part
from ...framework.typing import VectorField
from ...framework.vectors import absolute, add, add_scaled, cross, divided, dot, larger, length, negative, scale, sub
from ..standard_shapes import convex_convex, sharp
from .segment import BEHIND, BESIDE, NEAR, NONE, PART, STRAIGHT, TILT, WHOLE, plugin, register_pairs

# One edge: a point of it, the direction out of the triangle in its plane, that through the neighbour, whether the
# neighbour falls away, and how far the triangle counts beyond an edge from which it does not.
Edge = collections.namedtuple("Edge", "at outward through falls room")


@plugin.shape(cost=5)
class TerrainTriangleCollider(Collider):
    """A static triangle in a 3D world, solid behind its front.

    a, b, c
        (3,) m, the corners relative to the centre, counter-clockwise as seen from the front; ValueError if on a line
    beyond_ab, beyond_bc, beyond_ca
        (3,) m, the third corner of the triangle on the other side of an edge; where there is none, a, b or c
    thickness
        m, a body whose centre is so far behind the triangle is still pushed out to its front
    """

    __slots__ = ()

    dimensions: ClassVar[tuple[int, ...]] = (3,)
    excludes: ClassVar[Mapping[type[Component], str]] = {RigidBody: "terrain is static, leave it out"}
    a: VectorField = column(item="vector", unit="m")
    b: VectorField = column(item="vector", unit="m")
    c: VectorField = column(item="vector", unit="m")
    beyond_ab: VectorField = column(item="vector", unit="m")
    beyond_bc: VectorField = column(item="vector", unit="m")
    beyond_ca: VectorField = column(item="vector", unit="m")
    thickness: float = column(default=0.0, minimum=0.0, unit="m")

    def _fill(self, given: Mapping[str, Any]) -> None:
        super()._fill(given)
        a, b, c = (np.asarray(corner, float) for corner in (self.a, self.b, self.c))
        if not np.cross(b - a, c - a).any():
            raise ValueError(f"TerrainTriangleCollider: a, b and c must not be on a line, got {a}, {b} and {c}")

    @classmethod
    def sample(cls, **common: Any) -> Self:
        a, b, c = (-0.5, 0.0, -0.5), (0.0, 0.0, 0.5), (0.5, 0.0, -0.5)
        return cls(a, b, c, (-1.0, -0.5, 0.5), (1.0, -0.5, 0.5), (0.0, -0.5, -1.5), **common)

    @staticmethod
    def bounds(shape, dimensions):
        """At least a quarter as thick as long: tolerances follow the extent. With what is behind it, see thickness."""
        reach = larger(absolute(shape.a), larger(absolute(shape.b), absolute(shape.c)))
        least, front = 0.25 * max(reach[0], reach[1], reach[2]), cross(sub(shape.b, shape.a), sub(shape.c, shape.a))
        extents = scale(larger(reach, (least, least, least)), 1.0 + BESIDE)
        return add_scaled(extents, absolute(front), shape.thickness / length(front))

    @staticmethod
    def support(shape, direction):
        one, two, three = dot(shape.a, direction), dot(shape.b, direction), dot(shape.c, direction)
        if one >= two and one >= three:
            return shape.a
        return shape.b if two >= three else shape.c

    @staticmethod
    def outline(shape, dimensions):
        return (shape.a, shape.b, shape.c), ((0, 1, 2),)


triangle_support = plugin.kernel(TerrainTriangleCollider.support)


@part
def edge_of(start, end, beyond, normal, room):
    """The Edge from start to end."""
    along = sub(end, start)
    along = divided(along, length(along))
    outward, through = cross(along, normal), sub(beyond, start)
    through = add_scaled(through, along, -dot(through, along))
    far = length(through)
    if far == 0.0:  # as a vertical wall below
        return Edge(start, outward, negative(normal), True, 0.0)
    through = divided(through, far)
    falls = dot(through, normal) < -STRAIGHT
    return Edge(start, outward, through, falls, 0.0 if falls else room)


@part
def part_above(b, at, normal, edge, nearest, known, support):
    """(kind, height, lowest point; how far it is beyond the edge) of what of a shape's face is on the inner side of an
    edge.

    at: from the edge's point to the shape's centre; nearest: the point of the whole face, from there as the lowest one;
    known: (kind, height, lowest point) of what is on the inner side of other edges.
    """
    kind, height, lowest = known
    out = dot(edge.outward, add(at, nearest))
    if out <= edge.room:
        return kind, height, lowest, 0.0
    inner = support(b, negative(add_scaled(normal, edge.outward, TILT)))
    inward = dot(edge.outward, add(at, inner))
    if inward > edge.room:
        return NONE, height, lowest, inward
    ends = add_scaled(inner, sub(nearest, inner), (edge.room - inward) / (out - inward))
    level = dot(normal, add(at, ends))
    return (PART, level, ends, 0.0) if kind == WHOLE or level > height else (PART, height, lowest, 0.0)


@part
def all_inside(one, two, three, spot, near):
    """Whether a point is on the inner side of three edges."""
    out = max(dot(one.outward, sub(spot, one.at)), dot(two.outward, sub(spot, two.at)))
    return max(out, dot(three.outward, sub(spot, three.at))) <= near


@part
def is_between(normal, spot, edge, near):
    """Whether a normal at a spot of the triangle is none of the neighbour's at an edge that the spot is on."""
    if dot(edge.outward, sub(spot, edge.at)) < -near or dot(normal, edge.outward) <= NEAR:
        return True
    return edge.falls and dot(normal, edge.through) <= NEAR


@plugin.kernel
def beyond_edge(normal, direction, edge):
    """The normal of the neighbour that falls away, if a direction leans towards it; else that of the triangle."""
    if not edge.falls or dot(direction, edge.outward) <= NEAR:
        return normal
    out, down = dot(edge.through, edge.outward), dot(edge.through, normal)
    return add_scaled(scale(edge.outward, -down), normal, out)


@part
def is_behind(b, normal, at, most, support):
    """Whether a shape at ``at`` from a face is behind that by more than that: both its centre and its middle, as the
    centre of a hull may be anywhere."""
    centre = dot(normal, at)
    if centre >= -most:
        return False
    return centre + 0.5 * dot(normal, add(support(b, normal), support(b, negative(normal)))) < -most


@part
def contact_of_triangle(a, b, d, support, rounding):
    """(whether the shape is over the triangle's own part; depth, normal, point)."""
    normal, round_b = cross(sub(a.b, a.a), sub(a.c, a.a)), rounding(b)
    size = math.sqrt(length(normal))
    normal = divided(normal, length(normal))
    zone = BESIDE * size
    nearest = support(b, negative(normal))
    level = dot(normal, add(sub(d, a.a), nearest))
    point = add(d, nearest)
    gap = level - round_b
    if gap > size:  # the plane parts them
        return False, zone - gap, normal, point
    one = edge_of(a.a, a.b, a.beyond_ab, normal, 5.0 * zone)
    two = edge_of(a.b, a.c, a.beyond_bc, normal, 5.0 * zone)
    three = edge_of(a.c, a.a, a.beyond_ca, normal, 5.0 * zone)
    _, depth, straight, place = convex_convex(a, b, d, triangle_support, support, sharp, rounding)
    spot, near, between = add_scaled(place, straight, 0.5 * depth), NEAR * size, dot(straight, normal) > -NEAR
    kind, height, lowest, far, side, outer = WHOLE, level, nearest, 0.0, normal, normal
    for k in range(3):
        edge = one if k == 0 else two if k == 1 else three
        between = between and is_between(straight, spot, edge, near)
        known = kind, height, lowest
        kind_now, height, lowest, beyond = part_above(b, sub(d, edge.at), normal, edge, nearest, known, support)
        kind = NONE if kind == NONE else kind_now
        leaning = beyond_edge(normal, straight, edge)
        outer = outer if leaning == normal else leaning
        if beyond > far:
            far, side = beyond, edge.outward
    # The plane may have what is not above the triangle itself; but it tells where what is lowest is over that: the way
    # out to a side leads into a neighbour.
    wrong = -depth - (height - round_b) > (0.1 * zone if depth < 0.0 else zone)
    over = all_inside(one, two, three, add(d, nearest), near)
    if between and (kind != WHOLE or wrong):
        if is_behind(b, straight, sub(d, place), BEHIND * size + a.thickness, support):
            return False, -math.inf, normal, point
        return True, depth, straight, place
    if kind == NONE or (wrong and not over):
        if depth > 0.0 and outer != normal and dot(outer, sub(d, place)) > 0.0:
            return True, depth, outer, place
        if gap > 2.0 * zone:
            return False, zone - gap, normal, point
        if -depth > zone or (depth <= 0.0 and far < zone):
            return False, min(depth, -0.1 * zone), straight, point
        return False, -max(far, zone), side if far > 0.0 else straight, point
    if is_behind(b, normal, sub(d, a.a), BEHIND * size + a.thickness, support):
        return False, -math.inf, normal, point
    depth, point = round_b - height, add(d, lowest)
    return True, depth, normal, add_scaled(point, normal, -dot(normal, sub(point, a.a)) - 0.5 * depth)


register_pairs(TerrainTriangleCollider, contact_of_triangle)
