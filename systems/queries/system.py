"""Questions about where things are: what touches a shape, what a ray or a moving shape meets, what is nearest."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...components import AABBCollider, SphereCollider
from ...framework.compilation import kernel
from ...framework.vectors import divided, length, row, store
from ...framework.world.hits import CastHits, Hits, NearestHits, Neighbours
from ...framework.world.services import QueryServices
from ..broad_phase.tree.build import MAX_LEVELS
from ..shapes.dispatch import parameter_columns
from .casts import ENDLESS
from .dispatch import QueryKernels, query_kernels
from .neighbours import NeighbourSearch

if TYPE_CHECKING:
    from ..state import PhysicsState

Point = tuple[float, ...]

SMALLEST = float(np.finfo(float).tiny)


@kernel
def unit_vectors(vectors, lengths, units, like):
    """Lengths and directions of vectors (m, d); zero stays zero."""
    for i in range(len(vectors)):
        vector = row(vectors, i, like)
        lengths[i] = length(vector)
        store(units, i, divided(vector, lengths[i]) if lengths[i] > 0.0 else vector)


class Queries(QueryServices):
    """Answers from the broad phase's boxes, made anew when the bodies have moved since the last question."""

    def __init__(self, state: PhysicsState) -> None:
        self._state = state
        self._stamp: Any = None
        self._moves = 0  # times that something has moved besides what the state counts
        self._asked: dict[type[Any], QueryKernels] = {}  # kernels by the shape that asks
        self._asked_of: Any = None  # the code of the shapes that they ask for
        self._neighbours = NeighbourSearch(state)
        self._walk = np.empty((2, MAX_LEVELS + 2))

    def forget(self) -> None:
        """The next question looks at the bodies anew."""
        self._moves += 1

    # -- what touches a shape ---------------------------------------------------------------------

    def spheres(self, centres: np.ndarray, radii: np.ndarray, mask: int) -> Hits:
        half = np.repeat(radii[:, None], centres.shape[1], axis=1)
        return self._many(SphereCollider, (radii,), centres, half, mask)

    def boxes(self, lower: np.ndarray, upper: np.ndarray, mask: int) -> Hits:
        half = (upper - lower) / 2
        return self._many(AABBCollider, (half,), (lower + upper) / 2, half, mask)

    def sphere(self, centre: Point, radius: float, mask: int) -> list[int]:
        return self._one(SphereCollider, (np.array((radius,)),), centre, (radius,) * len(centre), mask)

    def box(self, lower: Point, upper: Point, mask: int) -> list[int]:
        centre = tuple((low + high) / 2 for low, high in zip(lower, upper, strict=True))
        half = tuple((high - low) / 2 for low, high in zip(lower, upper, strict=True))
        return self._one(AABBCollider, (np.array((half,)),), centre, half, mask)

    def _one(self, component: Any, query: Any, centre: Point, half: Point, mask: int) -> list[int]:
        kernels = self._kernels(component)
        if kernels is None:
            return []
        lower = tuple(c - s for c, s in zip(centre, half, strict=True))
        upper = tuple(c + s for c, s in zip(centre, half, strict=True))
        moving, fixed = (boxes.query_one(lower, upper) for boxes in self._state.broad_phase.partitions)
        ends = np.array((0, len(moving))), np.array((0, len(fixed)))
        hits = self._touching(kernels, ends[0], moving, ends[1], fixed, query, np.array((centre,)), mask)
        return hits.entities.tolist()

    def _many(self, component: Any, query: Any, centres: np.ndarray, half: np.ndarray, mask: int) -> Hits:
        kernels = self._kernels(component)
        if kernels is None:
            nobody = np.empty(0, np.int64)
            return Hits(np.zeros(len(centres) + 1, np.int64), nobody, nobody)
        lower, upper = centres - half, centres + half
        moving, fixed = (boxes.query(lower, upper) for boxes in self._state.broad_phase.partitions)
        return self._touching(kernels, *moving, *fixed, query, centres, mask)

    def _touching(
        self, kernels: QueryKernels, offsets: Any, rows: Any, other_offsets: Any, other_rows: Any, query: Any,
        centres: Any, mask: int,
    ) -> Hits:  # fmt: skip
        found = np.empty(len(rows) + len(other_rows), np.int64)
        bounds = np.zeros(len(offsets), np.int64)
        count = kernels.touching(
            offsets, rows, other_offsets, other_rows, query, centres, mask, *self._columns(), found, bounds,
            self._state.like,
        )  # fmt: skip
        return Hits(bounds, self._state.table.arrays["entity"][found[:count]], found[:count])

    # -- what is near -----------------------------------------------------------------------------

    def nearest(self, points: np.ndarray, limits: np.ndarray, mask: int, excluded: np.ndarray) -> NearestHits:
        rows, distances, normals, surface = _unanswered(np.minimum(limits, ENDLESS), points.shape[1])
        kernels = self._kernels(SphereCollider)
        if kernels is not None:
            for boxes in self._state.broad_phase.partitions:
                if boxes.count:
                    kernels.nearest(
                        (np.zeros(len(points)),), points, mask, excluded, *boxes.layout, *self._columns(), rows,
                        distances, normals, surface, self._state.like,
                    )  # fmt: skip
        distances[rows < 0] = np.inf
        return NearestHits(self._entities(rows), rows, distances, surface, normals)

    def neighbours(self, radius: float, mask: int, askers: np.ndarray | None) -> Neighbours:
        self._state.refresh_structure()
        return self._neighbours.find(radius, mask, askers, self._current())

    # -- what is met on the way -------------------------------------------------------------------

    def rays(
        self, origins: np.ndarray, directions: np.ndarray, limits: np.ndarray, mask: int, excluded: np.ndarray,
        only_nearest: bool,
    ) -> CastHits:  # fmt: skip
        lengths, units = np.empty(len(origins)), np.empty_like(directions)
        unit_vectors(directions, lengths, units, self._state.like)
        query = (np.zeros(len(origins)),)
        hits = self._cast(SphereCollider, query, origins, units, limits, mask, excluded, only_nearest)
        way = np.where(hits.found, hits.distance, np.nan)[:, None] * units  # one ray if it is not the nearest only
        hits.point[...] = origins + way  # more exact than the middle of a contact
        return hits

    def shapes(
        self, component: type[Any], columns: dict[str, np.ndarray], positions: np.ndarray, displacements: np.ndarray,
        mask: int, excluded: np.ndarray, only_nearest: bool,
    ) -> CastHits:  # fmt: skip
        lengths, units = np.empty(len(positions)), np.empty_like(displacements)
        unit_vectors(displacements, lengths, units, self._state.like)
        shape = self._state.world.registry.shapes[component]
        unturned = np.broadcast_to(np.eye(self._state.dimensions), (len(positions), *self._state.axes.shape[1:])).copy()
        query = parameter_columns(shape, columns, unturned)
        starts = positions + columns["offset"]
        return self._cast(component, query, starts, units, lengths, mask, excluded, only_nearest)

    def _cast(
        self, component: type[Any], query: Any, starts: np.ndarray, units: np.ndarray, limits: np.ndarray, mask: int,
        excluded: np.ndarray, only_nearest: bool,
    ) -> CastHits:  # fmt: skip
        kernels = self._kernels(component)
        partitions = [boxes for boxes in self._state.broad_phase.partitions if boxes.count]
        limits = np.minimum(limits, ENDLESS)
        if only_nearest:
            rows, distances, normals, points = _unanswered(limits, starts.shape[1])
        else:
            room = 1 + sum(boxes.count for boxes in partitions)
            rows, distances = np.empty(room, np.int64), np.empty(room)
            normals, points = np.empty((room, starts.shape[1])), np.empty((room, starts.shape[1]))
            distances[-1] = limits[0]
        count = 0
        for boxes in partitions if kernels is not None else ():
            count = kernels.cast(
                query, starts, units, mask, excluded, only_nearest, *boxes.layout, self._walk, *self._columns(),
                count, rows, distances, normals, points, self._state.like,
            )  # fmt: skip
        if only_nearest:
            entity = self._entities(rows)
        else:
            entity = self._entities(rows[:count])
            order = np.lexsort((entity, distances[:count]))
            entity, rows, distances = entity[order], rows[order], distances[order]
            normals, points = normals[order], points[order]
        missed = rows < 0
        whole = np.maximum(limits, SMALLEST)  # at a length of zero the distance is zero too
        fractions = np.where(limits < ENDLESS, distances / whole, 0.0)
        fractions[missed], distances[missed] = 1.0, np.inf
        return CastHits(entity, rows, distances, points, normals, fractions)

    # -- what the kernels get ---------------------------------------------------------------------

    def _current(self) -> Any:
        """Changes whenever bodies may have moved."""
        return self._state.motion_stamp, self._moves, self._state.structures, self._state.table.static_version

    def _kernels(self, component: Any) -> QueryKernels | None:
        """The kernels that ask with that shape, with the boxes made ready for them; None if nothing has a collider."""
        state = self._state
        state.refresh_structure()
        if state.code is None:
            return None
        stamp = self._current()
        if stamp != self._stamp:
            state.refresh_rotation()
            state.broad_phase.trees_now()
            self._stamp = stamp
        if self._asked_of != (state.code, state.world.registry.version):
            self._asked_of, self._asked = (state.code, state.world.registry.version), {}
        if component not in self._asked:
            self._asked[component] = query_kernels(
                state.world.registry, state.code.shapes, component, state.dimensions
            )
        return self._asked[component]

    def _columns(self) -> tuple[Any, ...]:
        """Those of the bodies: entity, position, offset, shape, the collider that has the layers, layers, shapes."""
        arrays, scratch = self._state.table.arrays, self._state.scratch
        layers = self._state.table.stacks["collider.layer"]
        return (
            arrays["entity"], arrays["position"], scratch["offset"], scratch["shape"], scratch["material"], layers,
            self._state.world_shapes,
        )  # fmt: skip

    def _entities(self, rows: np.ndarray) -> np.ndarray:
        """The ids of rows, -1 where there is none."""
        return np.where(rows < 0, -1, self._state.table.arrays["entity"][rows])


def _unanswered(limits: np.ndarray, dimensions: int) -> tuple[np.ndarray, ...]:
    """Rows, distances, normals and points before anything is found."""
    nothing = np.full((len(limits), dimensions), np.nan)
    return np.full(len(limits), -1), limits.copy(), nothing, nothing.copy()
