"""Rays and moving shapes: what they meet, nearest first."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ...data.component import Component, Many
from ...data.layers import LayerNames, resolved, resolved_rows
from ...plugins.registry import Registry
from ...typing import Entities, Excludes, Layers, Masks, Numbers, Vector, Vectors
from ..services import PhysicsServices
from . import arguments as check
from .hits import CastHit, CastHits


class CastVerbs:
    """``world.ray_cast`` and its kin, which look at the bodies where they stand now."""

    registry: Registry
    _layer_names: LayerNames | None
    _synchronized: Callable[[], PhysicsServices]  # up to date with what was created and deleted

    def ray_cast(
        self,
        origin: Vector,
        direction: Vector,
        max_distance: float = math.inf,
        mask: Layers = -1,
        *,
        exclude: int | Entities | None = None,
        only_nearest: bool = False,
    ) -> list[CastHit]:
        """All colliders on the ray, nearest first, ties by id; at most one with ``only_nearest``, which is quicker.

        The ray starts at ``origin`` and runs along ``direction`` (of any length but zero) for ``max_distance`` metres.
        A collider that holds the origin is hit at distance 0, with the normal of its nearest way out. ``mask``: a bit
        for each layer that is asked for; ``exclude``: an entity to leave out, such as the one that looks, or several.
        ValueError names the argument that is wrong.
        """
        services = self._synchronized()
        start = check.point(origin, "ray_cast: origin", services.dimensions)
        way = check.point(direction, "ray_cast: direction", services.dimensions)
        if not any(way):
            raise ValueError(f"ray_cast: direction must not be zero, got {direction!r}")
        limit = np.array((check.distance(max_distance, "ray_cast: max_distance", endless=True),))
        wanted = self._wanted_of_one("ray_cast", mask, exclude)
        hits = services.queries.rays(np.array((start,)), np.array((way,)), limit, wanted, only_nearest)
        return _listed(hits)

    def ray_casts(
        self,
        origins: Vectors,
        directions: Vectors | Vector,
        max_distances: Numbers = math.inf,
        masks: Masks = -1,
        *,
        excludes: Excludes = None,
    ) -> CastHits:
        """The nearest hit of each of m rays, as columns.

        origins (m, d); directions (m, d) or one for all; max_distances and masks: one for all or (m,); excludes: one
        for all, (m,), or several for each, (m, k), and nothing is excluded where that is -1. ValueError names the first
        row with a direction of zero.
        """
        services = self._synchronized()
        starts = check.points(origins, "ray_casts: origins", services.dimensions)
        ways = check.points(directions, "ray_casts: directions", services.dimensions, len(starts))
        zero = np.logical_and.reduce([column == 0.0 for column in ways.T])  # three times faster than any(axis=1)
        if zero.any():
            raise ValueError(f"ray_casts: directions must not be zero, as row {int(np.argmax(zero))} is")
        limits = check.distances(max_distances, "ray_casts: max_distances", len(starts), endless=True)
        wanted = self._wanted("ray_casts", len(starts), masks, excludes)
        return services.queries.rays(starts, ways, limits, wanted, True)

    def shape_cast(
        self,
        shape: Component,
        position: Vector,
        displacement: Vector,
        mask: Layers = -1,
        *,
        exclude: int | Entities | None = None,
        only_nearest: bool = False,
        against: bool = False,
    ) -> list[CastHit]:
        """All colliders that a shape meets on its way, nearest first, ties by id; one at most with ``only_nearest``.

        ``shape`` is any collider, used as a value: ``SphereCollider(0.5)``. It is moved in a straight line and not
        turned. It meets what a body with this collider would: its offset, layer, mask and group count. It starts at
        ``position``, where a Transform would be. What it touches there is hit at distance 0, with the normal along
        which the two part soonest; that also is the answer for a displacement of zero. ``mask``: of these, only what is
        in one of its layers. ``exclude`` as in :meth:`ray_cast`. ``against``: only what opposes the motion, with a
        normal against it: not what the shape leaves, slides along or grazes. ValueError names the argument that is
        wrong, TypeError a shape that is no collider of this world.
        """
        services = self._synchronized()
        columns, layers = self._asked(shape, "shape_cast", services.dimensions)
        start = check.point(position, "shape_cast: position", services.dimensions)
        way = check.point(displacement, "shape_cast: displacement", services.dimensions)
        wanted = check.met_by(layers, self._wanted_of_one("shape_cast", mask, exclude))
        opposing = check.flag(against, "shape_cast: against")
        hits = services.queries.shapes(
            type(shape), columns, np.array((start,)), np.array((way,)), wanted, only_nearest, opposing
        )
        return _listed(hits)

    def shape_casts(
        self,
        shapes: Component | Many,
        positions: Vectors,
        displacements: Vectors | Vector,
        masks: Masks = -1,
        *,
        excludes: Excludes = None,
        against: bool = False,
    ) -> CastHits:
        """The first hit of each of m moving shapes, as columns.

        shapes: one collider for all, or ``SphereCollider.many(radius=radii)``; positions (m, d); displacements (m, d)
        or one for all; masks: one for all or (m,); excludes: one for all, (m,), or several for each, (m, k); against as
        in :meth:`shape_cast`.
        """
        services = self._synchronized()
        starts = check.points(positions, "shape_casts: positions", services.dimensions)
        ways = check.points(displacements, "shape_casts: displacements", services.dimensions, len(starts))
        columns, layers = self._asked(shapes, "shape_casts", services.dimensions, len(starts))
        wanted = check.met_by(layers, self._wanted("shape_casts", len(starts), masks, excludes))
        component = shapes.component if isinstance(shapes, Many) else type(shapes)
        opposing = check.flag(against, "shape_casts: against")
        return services.queries.shapes(component, columns, starts, ways, wanted, True, opposing)

    def _asked(
        self, shape: Any, verb: str, dimensions: int, many: int | None = None
    ) -> tuple[dict[str, np.ndarray], tuple[Any, Any, Any]]:
        """The shape's own columns and its offset, a row for each query, and its layer, mask and group, or (m,) of each;
        TypeError if it is no collider of this world."""
        component = shape.component if isinstance(shape, Many) and many is not None else type(shape)
        registered = self.registry.shapes.get(component)
        if registered is None:
            known = ", ".join(sorted(known.__name__ for known in self.registry.shapes))
            raise TypeError(f"{verb}: shape must be a collider of this world ({known}), got {shape!r}")
        names = (*registered.columns, "offset")
        count = 1 if many is None else many
        if isinstance(shape, Many):
            arrays = shape.arrays(count, dimensions, self._layer_names)
            layer, mask, group = (arrays[component.columns[name].key] for name in ("layer", "mask", "group"))
            return {name: arrays[component.columns[name].key] for name in names}, (layer, mask, group)
        shape.check_dimensions(dimensions)
        made = {}
        for name in names:
            field = component.columns[name]
            value = np.asarray(field.unshared(getattr(shape, name)), field.dtype)
            made[name] = np.empty((count, *field.item_shape(dimensions)), field.dtype)
            made[name][:] = value
        names_of = self._layer_names
        layer, mask = (resolved(getattr(shape, each), names_of, f"{verb}: {each}") for each in ("layer", "mask"))
        return made, (layer, mask, shape.group)

    def _mask(self, value: Any, name: str) -> int:
        """Bits of layers, which may be given by name."""
        return check.mask(resolved(value, self._layer_names, name), name)

    def _wanted_of_one(self, verb: str, mask: Any, exclude: Any, one_way: Any = False) -> check.Wanted:
        return check.wanted_of_one(verb, resolved(mask, self._layer_names, f"{verb}: mask"), exclude, one_way)

    def _wanted(self, verb: str, count: int, masks: Any, excludes: Any = None, one_way: Any = False) -> check.Wanted:
        rows = resolved_rows(masks, self._layer_names, f"{verb}: masks")
        return check.wanted(verb, count, rows, excludes, one_way)


def _listed(hits: CastHits) -> list[CastHit]:
    """A hit for each row that has one, in order."""
    return [
        CastHit(entity, distance, fraction, point, normal)
        for entity, distance, fraction, point, normal in zip(
            hits.entity.tolist(), hits.distance.tolist(), hits.fraction.tolist(), hits.point, hits.normal, strict=True
        )
        if entity >= 0
    ]
