"""Rays and moving shapes: what they meet, nearest first."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ..data.component import Component, Many
from ..plugins.registry import Registry
from ..typing import Entities, Numbers, Vector, Vectors
from . import query_arguments as check
from .hits import CastHit, CastHits
from .services import PhysicsServices


class CastVerbs:
    """``world.ray_cast`` and its kin, which look at the bodies where they stand now."""

    registry: Registry
    _synchronized: Callable[[], PhysicsServices]  # up to date with what was created and deleted

    def ray_cast(
        self,
        origin: Vector,
        direction: Vector,
        max_distance: float = math.inf,
        mask: int = -1,
        *,
        exclude: int | None = None,
        only_nearest: bool = False,
    ) -> list[CastHit]:
        """All colliders on the ray, nearest first, ties by id; at most one with ``only_nearest``, which is quicker.

        The ray starts at ``origin`` and runs along ``direction`` (of any length but zero) for ``max_distance`` metres.
        A collider that holds the origin is hit at distance 0, with the normal of its nearest way out. ``mask``: a bit
        for each layer that is asked for; ``exclude``: an entity to leave out, such as the one that looks.
        ValueError names the argument that is wrong.
        """
        services = self._synchronized()
        start = check.point(origin, "ray_cast: origin", services.dimensions)
        way = check.point(direction, "ray_cast: direction", services.dimensions)
        if not any(way):
            raise ValueError(f"ray_cast: direction must not be zero, got {direction!r}")
        limit = np.array((check.distance(max_distance, "ray_cast: max_distance", endless=True),))
        bits = check.mask(mask, "ray_cast: mask")
        others = check.excluded(exclude, "ray_cast: exclude", 1)
        hits = services.queries.rays(np.array((start,)), np.array((way,)), limit, bits, others, only_nearest)
        return _listed(hits)

    def ray_casts(
        self,
        origins: Vectors,
        directions: Vectors | Vector,
        max_distances: Numbers = math.inf,
        mask: int = -1,
        *,
        exclude: int | Entities | None = None,
    ) -> CastHits:
        """The nearest hit of each of m rays, as columns.

        origins (m, d); directions (m, d) or one for all; max_distances and exclude: one for all or (m,), and nothing is
        excluded where that is -1. ValueError names the first row with a direction of zero.
        """
        services = self._synchronized()
        starts = check.points(origins, "ray_casts: origins", services.dimensions)
        ways = check.points(directions, "ray_casts: directions", services.dimensions, len(starts))
        zero = np.logical_and.reduce([column == 0.0 for column in ways.T])  # three times faster than any(axis=1)
        if zero.any():
            raise ValueError(f"ray_casts: directions must not be zero, as row {int(np.argmax(zero))} is")
        limits = check.distances(max_distances, "ray_casts: max_distances", len(starts), endless=True)
        bits = check.mask(mask, "ray_casts: mask")
        others = check.excluded(exclude, "ray_casts: exclude", len(starts))
        return services.queries.rays(starts, ways, limits, bits, others, True)

    def shape_cast(
        self,
        shape: Component,
        position: Vector,
        displacement: Vector,
        mask: int = -1,
        *,
        exclude: int | None = None,
        only_nearest: bool = False,
    ) -> list[CastHit]:
        """All colliders that a shape meets on its way, nearest first, ties by id; one at most with ``only_nearest``.

        ``shape`` is any collider, used as a value: ``SphereCollider(0.5)``. It is moved in a straight line and not
        turned, its offset counts, its layer, mask and group do not. It starts at ``position``, where a Transform would
        be. What it touches there is hit at distance 0, with the normal along which the two part soonest; that also is
        the answer for a displacement of zero. ``mask`` and ``exclude`` as in :meth:`ray_cast`.
        """
        services = self._synchronized()
        columns = self._values(shape, "shape_cast", services.dimensions)
        start = check.point(position, "shape_cast: position", services.dimensions)
        way = check.point(displacement, "shape_cast: displacement", services.dimensions)
        bits = check.mask(mask, "shape_cast: mask")
        others = check.excluded(exclude, "shape_cast: exclude", 1)
        hits = services.queries.shapes(
            type(shape), columns, np.array((start,)), np.array((way,)), bits, others, only_nearest
        )
        return _listed(hits)

    def shape_casts(
        self,
        shapes: Component | Many,
        positions: Vectors,
        displacements: Vectors | Vector,
        mask: int = -1,
        *,
        exclude: int | Entities | None = None,
    ) -> CastHits:
        """The first hit of each of m moving shapes, as columns.

        shapes: one collider for all, or ``SphereCollider.many(radius=radii)``; positions (m, d); displacements (m, d)
        or one for all; exclude: one for all or (m,).
        """
        services = self._synchronized()
        starts = check.points(positions, "shape_casts: positions", services.dimensions)
        ways = check.points(displacements, "shape_casts: displacements", services.dimensions, len(starts))
        columns = self._values(shapes, "shape_casts", services.dimensions, len(starts))
        bits = check.mask(mask, "shape_casts: mask")
        others = check.excluded(exclude, "shape_casts: exclude", len(starts))
        component = shapes.component if isinstance(shapes, Many) else type(shapes)
        return services.queries.shapes(component, columns, starts, ways, bits, others, True)

    def _values(self, shape: Any, verb: str, dimensions: int, many: int | None = None) -> dict[str, np.ndarray]:
        """The shape's own columns and its offset, a row for each cast; TypeError if it is no collider of this world."""
        component = shape.component if isinstance(shape, Many) and many is not None else type(shape)
        registered = self.registry.shapes.get(component)
        if registered is None:
            known = ", ".join(sorted(known.__name__ for known in self.registry.shapes))
            raise TypeError(f"{verb}: shape must be a collider of this world ({known}), got {shape!r}")
        names = (*registered.columns, "offset")
        count = 1 if many is None else many
        if isinstance(shape, Many):
            arrays = shape.arrays(count, dimensions)
            return {name: arrays[component.columns[name].key] for name in names}
        shape.check_dimensions(dimensions)
        made = {}
        for name in names:
            field = component.columns[name]
            value = np.asarray(field.unshared(getattr(shape, name)), field.dtype)
            made[name] = np.array(np.broadcast_to(value, (count, *field.item_shape(dimensions))), order="C")
        return made


def _listed(hits: CastHits) -> list[CastHit]:
    """A hit for each row that has one, in order."""
    return [
        CastHit(entity, distance, fraction, point, normal)
        for entity, distance, fraction, point, normal in zip(
            hits.entity.tolist(), hits.distance.tolist(), hits.fraction.tolist(), hits.point, hits.normal, strict=True
        )
        if entity >= 0
    ]
