"""The shape that a query asks with against the shapes of a scene.

Its parameters stand in a record of the same kind as those of bodies, so the same linked functions serve. Answers are
seen from the query: the normal leads away from its shape, the point is relative to its centre.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache
from typing import Any

import numpy as np

from ...framework.compilation import inlined
from ...framework.data.component import Component
from ...framework.jit.linking import CACHE_SIZE, Linked
from ...framework.jit.records.record import Record
from ...framework.jit.records.schema import Schema, flag, flags, integer, ints
from ...framework.plugins.registry import Registry, Shape
from ...framework.vectors import add, negative
from .linking.linked_pair import LinkedPair, convex_sides, linked_pair
from .linking.linked_shape import linked_shape
from .linking.linked_shapes import LinkedShapes, ParameterRecords, addresses, set_support
from .linking.signatures import call_bounds, call_evaluate, call_sweep

QUERY = Schema(
    "Query",
    parameters=integer(),  # address of the parameter record of the query's shape, one row per query
    bounds=integer(),
    is_collider=flag(),  # it meets what a body with this collider meets: its layer and group count
    # by number of the body's shape
    evaluate=ints(),  # 0: no plugin has the pair
    sweep=ints(),  # 0: no closed form
    flipped=flags(),  # the functions take the body first
)


@inlined
def evaluate_against(state, query, q, shape, i, d):
    """(hit, depth, normal, point) of query q and row i, d from the query's centre to the body's."""
    address, body = query.evaluate[shape], state.shapes.parameters[shape]
    if address == 0:
        return False, -math.inf, d, d
    if not query.flipped[shape]:
        return call_evaluate(address, state, query.parameters, q, body, i, d)
    hit, depth, normal, point = call_evaluate(address, state, body, i, query.parameters, q, negative(d))
    return hit, depth, negative(normal), add(point, d)


@inlined
def sweep_against(state, query, q, shape, i, d, way):
    """(known, hit, time) of query q moving by ``way`` towards row i: whether the pair has a sweep, and its answer."""
    address, body = query.sweep[shape], state.shapes.parameters[shape]
    if address == 0:
        return False, False, 0.0
    if query.flipped[shape]:
        hit, time = call_sweep(address, state, body, i, query.parameters, q, negative(d), way)
    else:
        hit, time = call_sweep(address, state, query.parameters, q, body, i, d, negative(way))
    return True, hit, time


@inlined
def query_half_extents(state, query, q):
    """Half extents of the box around query q's shape."""
    return call_bounds(query.bounds, state, query.parameters, q)


def linked_query(registry: Registry, linked: LinkedShapes, component: type[Component]) -> LinkedQuery:
    """The functions to ask with ``component`` for the shapes of a scene; ValueError if it is no registered shape."""
    if component not in registry.shapes:
        raise ValueError(f"no plugin has registered {component.__name__} as a shape, which this query needs")
    asking = registry.shapes[component]
    pairs = tuple(registry.pair(component, shape.component) for shape in linked.shapes)
    return _made_query(asking, linked, pairs)


class LinkedQuery:
    """What a record of ``QUERY`` gets for one asking shape and the shapes of a scene."""

    def __init__(self, asking: Shape, linked: LinkedShapes, pairs: tuple[Any, ...]) -> None:
        self.shape, self._linked = asking, linked
        self.flipped = [pair is not None and pair.first is not asking.component for pair in pairs]
        self._functions = linked_shape(asking, linked.dimensions)
        self.pairs: list[LinkedPair | None] = []
        self._supported: set[int | None] = set()  # shapes that some pair takes by address; None: the asking one
        for number, (pair, shape) in enumerate(zip(pairs, linked.shapes, strict=True)):
            if pair is None:
                self.pairs.append(None)
                continue
            sides = ((asking, None), (shape, number))
            (first, one), (second, two) = reversed(sides) if self.flipped[number] else sides
            self.pairs.append(linked_pair(first, second, pair, linked.dimensions))
            by_address = convex_sides(first, second, pair)
            self._supported.update(side for side, taken in zip((one, two), by_address, strict=True) if taken)

    def all_functions(self) -> Iterator[Linked]:
        """Everything that queries with this shape may call, casts included."""
        yield from self._functions.all_functions(by_address=None in self._supported)
        for number in self._supported - {None}:
            yield from linked_shape(self._linked.shapes[number], self._linked.dimensions).all_functions(by_address=True)
        for pair in self.pairs:
            if pair is not None:
                yield pair.evaluate
                if pair.sweep is not None:
                    yield pair.sweep

    def fill(self, query: Record, parameters: Record, bodies: ParameterRecords, sweeps: bool = False) -> None:
        """Write the functions into a record of ``QUERY``.

        parameters
            the queries' own: ``make_parameter_record(shape, d)``, bound to columns with one row per query
        bodies
            those of the scene
        sweeps
            also those of sweeps
        """
        query.parameters, query.bounds = parameters.address, self._functions.bounds.address
        query.evaluate, query.flipped = self._addresses("evaluate"), np.array(self.flipped, bool)
        query.sweep = self._addresses("sweep") if sweeps else np.zeros(len(self.pairs), np.int64)
        for number in self._supported:
            if number is None:
                set_support(parameters, self._functions)
            else:
                bodies.need_support(number)

    def _addresses(self, name: str) -> np.ndarray:
        return addresses(getattr(pair, name, None) for pair in self.pairs)


_made_query = lru_cache(maxsize=CACHE_SIZE)(LinkedQuery)
