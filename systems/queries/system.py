"""The queries of a world: what touches a shape, what a ray or a moving shape meets, what is nearest, what is near."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

from ...components import AABBCollider, SphereCollider
from ...framework.data.table import Table
from ...framework.jit.linking import Linked
from ...framework.jit.records.record import Record
from ...framework.plugins.registry import Registry
from ...framework.world.queries.arguments import Wanted
from ...framework.world.queries.hits import CastHits, Hits, NearestHits, Neighbours, OverlapHits
from ..broad_phase.search import CandidateSearch
from ..broad_phase.tree.tree import SpatialTree
from ..scene import Scene
from ..shapes.attribution import ErrorAttribution
from .batch import CollectedHits, QueryBatch, QueryShape, joined, slices_of, some_rows
from .kernels import query_kernels
from .overlap import ALL_LAYERS

Point = tuple[float, ...]

NEAREST_COLUMNS = ("entity", "row", "distance", "point", "normal")  # as the fields of NearestHits
NEVER: Any = object()  # in place of a version


class Queries:
    """Answers to queries, from the grids of the step, or trees that the first query after a change builds.

    state
        the record; queries read count, bodies (entity, position, offset, shape, collider_slot), colliders (layer, mask,
        group) and shapes.parameters
    table
        tells the rows of entities
    registry
        the pairs of query shapes and bodies
    candidate_search
        has the grids and trees of the broad phase
    refresh
        between two steps: brings shapes, rows and columns up to date; called by every query
    """

    def __init__(
        self, state: Record, table: Table, registry: Registry, scene: Scene, candidate_search: CandidateSearch,
        refresh: Callable[[], None],
    ) -> None:  # fmt: skip
        self._state, self._table, self._registry, self._scene = state, table, registry, scene
        self._search, self._refresh, self._dimensions = candidate_search, refresh, state.dimensions
        self._kernels = query_kernels(state.dimensions)
        self._attribute_errors = ErrorAttribution(registry, state, scene.shapes)
        self._shapes: dict[tuple[type[Any], bool], QueryShape] = {}  # and whether its parameters are the batch's own
        self._linked_version: Any = NEVER
        self._version: Any = NEVER
        self._trees = 0, 0  # addresses of their records
        self._points_version: Any = NEVER

    @cached_property
    def _batch(self) -> QueryBatch:
        return QueryBatch(self._dimensions)

    @cached_property
    def _points(self) -> SpatialTree:
        return SpatialTree(self._dimensions)

    def forget(self) -> None:
        """Let the next query make the indexes again; code of the game may have written to what sleeps, too."""
        self._version = self._points_version = NEVER
        self._state.statics_version += int(self._state.first > 0)

    # -- what touches a shape ---------------------------------------------------------------------

    def sphere(self, centre: Point, radius: float, mask: int, one_way: bool = False) -> list[int]:
        if self._query_shape(SphereCollider, 1) is None:
            return []
        queries = self._batch.record
        centres, halves = queries.centre, queries.half
        for k, value in enumerate(centre):
            centres[0, k], halves[0, k] = value, radius
        self._batch.radius[0] = radius
        return self._overlaps_of_one(SphereCollider, mask, one_way)

    def box(self, lower: Point, upper: Point, mask: int, one_way: bool = False) -> list[int]:
        if self._query_shape(AABBCollider, 1) is None:
            return []
        queries = self._batch.record
        centres, halves = queries.centre, queries.half
        for k, (low, high) in enumerate(zip(lower, upper, strict=True)):
            centres[0, k], halves[0, k] = (low + high) / 2, (high - low) / 2
        return self._overlaps_of_one(AABBCollider, mask, one_way)

    def spheres(self, centres: np.ndarray, radii: np.ndarray, wanted: Wanted) -> Hits:
        return self._overlaps(SphereCollider, centres, radii[:, None], wanted)

    def boxes(self, lower: np.ndarray, upper: np.ndarray, wanted: Wanted) -> Hits:
        return self._overlaps(AABBCollider, (lower + upper) / 2, (upper - lower) / 2, wanted)

    def overlaps(
        self, component: type[Any], columns: dict[str, np.ndarray], positions: np.ndarray, wanted: Wanted
    ) -> OverlapHits:
        """What touches colliders, and how deep; the hits of each deepest first."""
        shape, count = self._query_shape(component, len(positions), own=False), len(positions)
        collected = CollectedHits(self._batch, count, NEAREST_COLUMNS)
        for some in slices_of(count) if shape is not None else ():
            excluded = self._ask(shape, columns, some, positions, wanted)
            self._collect(collected, self._kernels.overlaps, component, some.stop - some.start, excluded)
        entities, rows, distances, points, normals = collected.columns()
        query = np.repeat(np.arange(count), np.diff(collected.offsets))
        order = np.lexsort((entities, distances, query))
        depths = np.maximum(-distances, 0.0)
        return OverlapHits(collected.offsets, *(column[order] for column in (entities, rows, depths, points, normals)))

    def _overlaps_of_one(self, component: type[Any], mask: int, one_way: bool) -> list[int]:
        """Ids of the hits of the query in row 0."""
        queries = self._batch.record
        queries.mask[0], queries.one_way = mask, one_way
        self._run(self._kernels.overlaps, component, 0, 1)
        return queries.entity[: queries.end[0]].tolist()

    def _overlaps(self, component: type[Any], centres: np.ndarray, halves: np.ndarray, wanted: Wanted) -> Hits:
        shape, count = self._query_shape(component, len(centres)), len(centres)
        queries, collected = self._batch.record, CollectedHits(self._batch, count)
        for some in slices_of(count) if shape is not None else ():
            count = some.stop - some.start
            queries.centre[:count], queries.half[:count] = centres[some], halves[some]
            self._batch.radius[:count] = halves[some, 0]
            excluded = self._batch.ask(count, some, wanted)
            self._collect(collected, self._kernels.overlaps, component, count, excluded)
        return Hits(collected.offsets, *collected.columns())

    # -- what is near -----------------------------------------------------------------------------

    def nearest(self, points: np.ndarray, limits: np.ndarray, wanted: Wanted) -> NearestHits:
        if self._query_shape(SphereCollider, len(points)) is None:
            return NearestHits(*_nothing(len(points), self._dimensions))
        queries, pieces = self._batch.record, []
        for some in slices_of(len(points)):
            count = some.stop - some.start
            queries.centre[:count], queries.limit[:count] = points[some], limits[some]
            self._batch.radius[:count] = 0.0
            excluded = self._batch.ask(count, some, wanted)
            self._run(self._kernels.nearest, SphereCollider, 0, count, excluded)
            pieces.append(self._batch.copied(slice(count), *NEAREST_COLUMNS))
        return NearestHits(*joined(pieces))

    def neighbours(self, radius: float, mask: int, askers: np.ndarray | None) -> Neighbours:
        self._refresh()
        state, entity = self._state, self._state.bodies.entity
        if askers is None:
            rows = np.argsort(entity[: state.count], kind="stable")
        else:
            rows = self._table.rows_of(askers)
            if (rows < 0).any():
                raise KeyError(f"neighbours: entity {int(askers[rows < 0][0])} is no body")
        collected = CollectedHits(self._batch, len(rows))
        if mask == ALL_LAYERS or self._scene.linked is not None:
            self._reserve(len(rows))
            queries, trees = self._batch.record, (self._points_tree(),) * 2
            queries.radius = radius
            for some in slices_of(len(rows)):
                count = some.stop - some.start
                queries.body[:count], queries.mask[:count] = rows[some], mask
                self._collect(collected, self._kernels.neighbours, None, count, trees=trees)
        return Neighbours(entity[rows], rows, collected.offsets, *collected.columns())

    def _points_tree(self) -> int:
        """Address of a tree of the bodies' positions, boxes without size."""
        if self._scene.seen_version != self._points_version:
            position = self._state.bodies.position
            self._points.build(position, position, 0, self._state.count)
            self._points_version = self._scene.seen_version
        return self._points.record.address

    # -- what is met on the way -------------------------------------------------------------------

    def rays(
        self, origins: np.ndarray, directions: np.ndarray, limits: np.ndarray, wanted: Wanted, only_nearest: bool
    ) -> CastHits:
        """What rays meet: the nearest, a row for each ray; or everything on one ray, in order."""
        if self._query_shape(SphereCollider, len(origins), sweeps=True) is None:
            return _no_cast_hits(len(origins), self._dimensions, only_nearest)
        queries, pieces = self._batch.record, []
        for some in slices_of(len(origins)):
            count = some.stop - some.start
            queries.centre[:count], queries.direction[:count] = origins[some], directions[some]
            queries.limit[:count], self._batch.radius[:count] = limits[some], 0.0
            excluded = self._batch.ask(count, some, wanted)
            pieces.append(self._cast(SphereCollider, count, excluded, only_nearest, True))
        return CastHits(*joined(pieces))

    def shapes(
        self, component: type[Any], columns: dict[str, np.ndarray], positions: np.ndarray, displacements: np.ndarray,
        wanted: Wanted, only_nearest: bool, against: bool,
    ) -> CastHits:  # fmt: skip
        """What moving shapes meet: the nearest, a row for each shape; or everything that one shape meets, in order."""
        shape = self._query_shape(component, len(positions), own=False, sweeps=True)
        if shape is None:
            return _no_cast_hits(len(positions), self._dimensions, only_nearest)
        queries, pieces = self._batch.record, []
        for some in slices_of(len(positions)):
            excluded, count = self._ask(shape, columns, some, positions, wanted), some.stop - some.start
            queries.direction[:count] = displacements[some]
            pieces.append(self._cast(component, count, excluded, only_nearest, False, against))
        return CastHits(*joined(pieces))

    def _ask(
        self, shape: QueryShape, columns: dict[str, np.ndarray], some: slice, positions: np.ndarray, wanted: Wanted
    ) -> int:
        """Write those queries of a collider to the first rows; returns how many entities each leaves out."""
        queries, count = self._batch.record, some.stop - some.start
        shape.bind({name: column[some] for name, column in columns.items()}, count)
        queries.centre[:count] = positions[some] + columns["offset"][some]
        queries.layer[:count], queries.group[:count] = some_rows(wanted.layers, some), some_rows(wanted.groups, some)
        return self._batch.ask(count, some, wanted)

    def _cast(
        self, component: type[Any], count: int, excluded: int, only_nearest: bool, is_ray: bool, against: bool = False
    ) -> tuple[np.ndarray, ...]:
        """Columns of what the queries in the first rows meet."""
        queries = self._batch.record
        queries.only_nearest, queries.is_ray, queries.against = only_nearest, is_ray, against
        found = self._run(self._kernels.hits, component, 0, count, excluded)
        which: Any = slice(count if only_nearest else found)
        if not only_nearest and found > 1:
            which = np.lexsort((queries.entity[:found], queries.distance[:found]))
        return self._batch.copied(which, *NEAREST_COLUMNS, "fraction")

    # -- what the kernels need --------------------------------------------------------------------

    def _collect(
        self, collected: CollectedHits, function: Linked, component: type[Any] | None, count: int, excluded: int = 0,
        trees: tuple[int, int] | None = None,
    ) -> None:  # fmt: skip
        """Take the hits of the queries in the first rows, by as many calls as the room for hits makes necessary."""
        first = 0
        while first < count:
            stop = self._run(function, component, first, count, excluded, trees)
            collected.take(first, stop)
            first = stop

    def _run(
        self, function: Linked, component: type[Any] | None, first: int, stop: int, excluded: int = 0,
        trees: tuple[int, int] | None = None,
    ) -> int:  # fmt: skip
        """Call a function for the queries first..stop-1; errors name the plugin, the pair and the entity."""
        moving, static = trees or self._trees
        try:
            result = self._kernels.run(
                function.address, self._state.address, self._batch.record.address, moving, static, excluded, first, stop
            )
        except Exception as error:
            self._attribute_errors.describe(error, component)
            raise
        if self._state.unsound:
            self._attribute_errors.check(component)
        return result

    def _query_shape(
        self, component: type[Any], count: int, own: bool = True, sweeps: bool = False
    ) -> QueryShape | None:
        """The shape for so many queries, with everything up to date; None if nothing has a collider.

        own
            its parameters are columns of the batch, else those of the caller
        sweeps
            it is going to move
        """
        scene = self._scene
        self._refresh()
        if scene.seen_version != self._version:
            self._renew()
        if scene.linked is None or scene.parameters is None:
            return None
        if count > self._batch.queries or self._state.count > self._batch.results:
            self._reserve(count)
        shape = self._shapes.get((component, own))
        if shape is None:
            with self._attribute_errors(query=component):
                shape = QueryShape(self._registry, scene.linked, scene.parameters, component)
            shape.record.is_collider = not own
            self._shapes[component, own] = shape
            if own:
                self._bind(shape)
        if sweeps and not shape.has_sweeps:
            with self._attribute_errors(query=component):
                shape.need_sweeps()
        self._batch.record.query = shape.record
        return shape

    def _renew(self) -> None:
        """Make the indexes again, and forget the query shapes if the shapes of the scene are others."""
        scene = self._scene
        if scene.linked is not None:
            version = scene.linked, scene.parameters, self._registry.version
            if version != self._linked_version:
                self._shapes, self._linked_version = {}, version
            scene.refresh_rotation()
            moving, static = self._search.index_now()
            self._trees = moving.record.address, static.record.address
        self._version = scene.seen_version

    def _reserve(self, count: int) -> None:
        """Make room for so many queries, and for hits with all bodies."""
        if self._batch.reserve(count, self._state.count):
            for (_, own), shape in self._shapes.items():
                if own:
                    self._bind(shape)

    def _bind(self, shape: QueryShape) -> None:
        columns = {"radius": self._batch.radius, "half_extents": self._batch.half_extents}
        shape.bind(columns, self._batch.queries)


def _nothing(count: int, dimensions: int) -> tuple[np.ndarray, ...]:
    """Columns of nearest surfaces where there is nothing."""
    nothing = np.full((count, dimensions), np.nan)
    return np.full(count, -1), np.full(count, -1), np.full(count, np.inf), nothing, nothing.copy()


def _no_cast_hits(count: int, dimensions: int, only_nearest: bool) -> CastHits:
    missed = count if only_nearest else 0
    return CastHits(*_nothing(missed, dimensions), np.ones(missed))
