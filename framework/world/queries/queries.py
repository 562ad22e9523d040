"""Queries: what a world has where."""

from __future__ import annotations

import math

import numpy as np

from ...data.component import Component, Many
from ...typing import Entities, Excludes, Layers, Masks, Numbers, Vector, Vectors
from . import arguments as check
from .casts import CastVerbs
from .hits import Hits, NearestHit, NearestHits, Neighbours, OverlapHit, OverlapHits


class QueryVerbs(CastVerbs):
    """``world.query_...``: arguments checked, answers from the plugin that provides physics; mixed into World.

    All of them find static bodies and sensors too; ``mask`` has a bit for each layer that is asked for. What touches a
    point, a box or a sphere leaves out colliders that are solid from one side only, unless ``one_way`` is True.
    """

    def query_point(self, point: Vector, mask: Layers = -1, *, one_way: bool = False) -> list[int]:
        """Entities whose collider contains the ``point``, (d,) m, by id.

        one_way: also what is solid from one side only.
        """
        services = self._synchronized()
        centre = check.point(point, "query_point: point", services.dimensions)
        return services.queries.sphere(centre, 0.0, self._mask(mask, "query_point: mask"), one_way)

    def query_aabb(self, lower: Vector, upper: Vector, mask: Layers = -1, *, one_way: bool = False) -> list[int]:
        """Entities whose collider touches the box from ``lower`` to ``upper``, (d,) m, by id.

        one_way: also what is solid from one side only. ValueError if a lower bound exceeds the upper one.
        """
        services = self._synchronized()
        low = check.point(lower, "query_aabb: lower", services.dimensions)
        high = check.point(upper, "query_aabb: upper", services.dimensions)
        if any(a > b for a, b in zip(low, high, strict=True)):
            raise ValueError(f"query_aabb: lower {list(low)} exceeds upper {list(high)}")
        return services.queries.box(low, high, self._mask(mask, "query_aabb: mask"), one_way)

    def query_sphere(self, centre: Vector, radius: float, mask: Layers = -1, *, one_way: bool = False) -> list[int]:
        """Entities whose collider touches the sphere of ``radius`` m around ``centre``, (d,) m, by id.

        one_way: also what is solid from one side only.
        """
        services = self._synchronized()
        place = check.point(centre, "query_sphere: centre", services.dimensions)
        size = check.distance(radius, "query_sphere: radius")
        return services.queries.sphere(place, size, self._mask(mask, "query_sphere: mask"), one_way)

    def query_spheres(self, centres: Vectors, radii: Numbers, masks: Masks = -1, *, one_way: bool = False) -> Hits:
        """For each of m spheres (centres (m, d); radii, masks: one or (m,)) the ids of what it touches, ascending.

        one_way: also what is solid from one side only.
        """
        services = self._synchronized()
        places = check.points(centres, "query_spheres: centres", services.dimensions)
        sizes = check.distances(radii, "query_spheres: radii", len(places))
        wanted = self._wanted("query_spheres", len(places), masks, one_way=one_way)
        return services.queries.spheres(places, sizes, wanted)

    def query_aabbs(self, lower: Vectors, upper: Vectors, masks: Masks = -1, *, one_way: bool = False) -> Hits:
        """For each of m boxes (``lower`` and ``upper`` (m, d)) the ids of the entities it touches, ascending.

        masks: one for all or (m,); one_way: also what is solid from one side only. ValueError names the first row in
        which a lower bound exceeds the upper one.
        """
        services = self._synchronized()
        low = check.points(lower, "query_aabbs: lower", services.dimensions)
        high = check.points(upper, "query_aabbs: upper", services.dimensions, len(low))
        if (low > high).any():
            row = int(np.argmax((low > high).any(axis=1)))
            raise ValueError(f"query_aabbs: lower {low[row].tolist()} exceeds upper {high[row].tolist()} in row {row}")
        return services.queries.boxes(low, high, self._wanted("query_aabbs", len(low), masks, one_way=one_way))

    def overlaps(
        self, shape: Component, position: Vector, mask: Layers = -1, *, exclude: int | Entities | None = None,
        one_way: bool = False,
    ) -> list[OverlapHit]:  # fmt: skip
        """All that a collider touches at a place, the deepest first, ties by id: how deep, where, and the way out.

        ``shape``, ``mask`` and ``exclude`` as in :meth:`shape_cast`; ``position``, (d,) m, is where a Transform would
        be; one_way: also what is solid from one side only. ValueError names the argument that is wrong, TypeError a
        shape that is no collider of this world.
        """
        services = self._synchronized()
        columns, layers = self._asked(shape, "overlaps", services.dimensions)
        place = check.point(position, "overlaps: position", services.dimensions)
        wanted = check.met_by(layers, self._wanted_of_one("overlaps", mask, exclude, one_way))
        hits = services.queries.overlaps(type(shape), columns, np.array((place,)), wanted)
        found = zip(hits.entities.tolist(), hits.depths.tolist(), hits.points, hits.normals, strict=True)
        return [OverlapHit(*hit) for hit in found]

    def shape_overlaps(
        self,
        shapes: Component | Many,
        positions: Vectors,
        masks: Masks = -1,
        *,
        excludes: Excludes = None,
        one_way: bool = False,
    ) -> OverlapHits:
        """:meth:`overlaps` of m colliders, as columns.

        shapes: one collider for all, or ``SphereCollider.many(radius=radii)``; positions (m, d); masks: one for all or
        (m,); excludes: one for all, (m,), or several for each, (m, k); one_way: as of :meth:`overlaps`.
        """
        services = self._synchronized()
        places = check.points(positions, "shape_overlaps: positions", services.dimensions)
        columns, layers = self._asked(shapes, "shape_overlaps", services.dimensions, len(places))
        wanted = check.met_by(layers, self._wanted("shape_overlaps", len(places), masks, excludes, one_way))
        component = shapes.component if isinstance(shapes, Many) else type(shapes)
        return services.queries.overlaps(component, columns, places, wanted)

    def query_nearest(
        self, point: Vector, mask: Layers = -1, *, max_distance: float = math.inf, exclude: int | Entities | None = None
    ) -> NearestHit | None:
        """The collider whose surface is nearest to ``point``, at most ``max_distance`` m away; None if there is none.

        Inside a collider the distance is negative, and the deepest is the nearest. Ties go to the smaller id.
        ``exclude``: an entity to leave out, or several.
        """
        services = self._synchronized()
        place = check.point(point, "query_nearest: point", services.dimensions)
        limit = check.distance(max_distance, "query_nearest: max_distance", endless=True)
        wanted = self._wanted_of_one("query_nearest", mask, exclude)
        hits = services.queries.nearest(np.array((place,)), np.array((limit,)), wanted)
        if hits.row[0] < 0:
            return None
        return NearestHit(int(hits.entity[0]), float(hits.distance[0]), hits.point[0], hits.normal[0])

    def query_nearests(
        self,
        points: Vectors,
        masks: Masks = -1,
        *,
        max_distances: Numbers = math.inf,
        excludes: Excludes = None,
    ) -> NearestHits:
        """:meth:`query_nearest` for m points (m, d), as columns.

        max_distances, masks, excludes: one for all or (m,); excludes: also several for each, (m, k).
        """
        services = self._synchronized()
        places = check.points(points, "query_nearests: points", services.dimensions)
        limits = check.distances(max_distances, "query_nearests: max_distances", len(places), endless=True)
        return services.queries.nearest(places, limits, self._wanted("query_nearests", len(places), masks, excludes))

    def neighbours(self, radius: float, mask: Layers = -1, *, of: Entities | None = None) -> Neighbours:
        """For every body the others whose position is within ``radius`` m of its own, by id.

        Distances are between the positions of the Transforms, so it needs no collider, and whoever is a neighbour has
        its asker as a neighbour too. ``mask`` chooses layers; bodies without a collider are in none and found only with
        the mask -1. ``of``: the ids of those whose neighbours are wanted, each once, in this order; all bodies by
        default, ascending. KeyError if one of them is no body, ValueError if they are no list of ids.
        """
        services = self._synchronized()
        size = check.distance(radius, "neighbours: radius")
        askers = None
        if of is not None:
            askers = np.asarray(of)
            if askers.ndim != 1 or (askers.size and askers.dtype.kind not in "iu"):
                raise ValueError(f"neighbours: of must be entities, a list of their ids, got {of!r}")
            askers = askers.astype(np.int64)
        return services.queries.neighbours(size, self._mask(mask, "neighbours: mask"), askers)

    def refresh_queries(self) -> None:
        """Make the next query see positions that were written since the last step."""
        self._synchronized().queries.forget()
