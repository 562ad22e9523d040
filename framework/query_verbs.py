"""Questions to a world about where things are."""

from __future__ import annotations

import math
import numbers
from typing import Any

import numpy as np

from .hits import Hits
from .services import PhysicsServices


class QueryVerbs:
    """``world.query_...``: arguments checked, answers from the plugin that provides physics; mixed into World."""

    def _synchronized(self) -> PhysicsServices:
        """The physics, up to date with what was created and deleted."""
        raise NotImplementedError

    def query_point(self, point: Any, mask: int = -1) -> list[int]:
        """Entities whose collider contains the point, by id."""
        services = self._synchronized()
        return services.query_sphere(_point(point, "query_point: point", services.dimensions), 0.0, mask)

    def query_aabb(self, lower: Any, upper: Any, mask: int = -1) -> list[int]:
        """Entities whose collider touches the box, by id."""
        services = self._synchronized()
        low = _point(lower, "query_aabb: lower", services.dimensions)
        high = _point(upper, "query_aabb: upper", services.dimensions)
        if any(a > b for a, b in zip(low, high, strict=True)):
            raise ValueError(f"query_aabb: lower {list(low)} exceeds upper {list(high)}")
        return services.query_box(low, high, mask)

    def query_sphere(self, centre: Any, radius: float, mask: int = -1) -> list[int]:
        """Entities whose collider touches the sphere, by id."""
        services = self._synchronized()
        point = _point(centre, "query_sphere: centre", services.dimensions)
        if not isinstance(radius, numbers.Real) or not math.isfinite(radius) or radius < 0:
            raise ValueError(f"query_sphere: radius must be finite and not negative, got {radius!r}")
        return services.query_sphere(point, float(radius), mask)

    def query_spheres(self, centres: Any, radii: Any, mask: int = -1) -> Hits:
        """For each of m spheres (centres (m, d), radii one or (m,)) the ids of the entities it touches, ascending."""
        services = self._synchronized()
        centres = np.ascontiguousarray(centres, float)
        if centres.ndim != 2 or centres.shape[1] != services.dimensions:
            raise ValueError(f"query_spheres: centres must have shape (m, {services.dimensions}), got {centres.shape}")
        radii = np.ascontiguousarray(np.broadcast_to(np.asarray(radii, float), len(centres)))
        if not np.isfinite(centres).all() or not np.isfinite(radii).all() or (radii < 0).any():
            raise ValueError("query_spheres: centres and radii must be finite, radii not negative")
        return services.query_spheres(centres, radii, mask)

    def query_aabbs(self, lower: Any, upper: Any, mask: int = -1) -> Hits:
        """For each of m boxes (corners (m, d)) the ids of the entities it touches, ascending."""
        services = self._synchronized()
        low, high = np.ascontiguousarray(lower, float), np.ascontiguousarray(upper, float)
        if low.ndim != 2 or low.shape[1] != services.dimensions or low.shape != high.shape:
            raise ValueError(
                f"query_aabbs: corners must have shape (m, {services.dimensions}), got {low.shape} and {high.shape}"
            )
        if not np.isfinite(low).all() or not np.isfinite(high).all() or (low > high).any():
            raise ValueError("query_aabbs: corners must be finite, lower not above upper")
        return services.query_boxes(low, high, mask)

    def refresh_queries(self) -> None:
        """Make the next query see positions that were written since the last step."""
        self._synchronized().refresh_queries()


def _point(value: Any, name: str, dimensions: int) -> tuple[float, ...]:
    """The point as plain floats: for one point quicker than an array."""
    try:
        point = tuple(map(float, value))
    except (TypeError, ValueError):
        point = ()
    if len(point) != dimensions or not all(map(math.isfinite, point)):
        raise ValueError(f"{name} must be {dimensions} finite numbers, got {value!r}")
    return point
