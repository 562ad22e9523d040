"""The linked functions of one shape: bounds, parameters as rotated, and support and rounding for the generic pair."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from ....framework.compilation import kernel
from ....framework.data.arrays.column import ArrayColumn
from ....framework.jit.linking import CACHE_SIZE, Linked
from ....framework.jit.records.record import make_record
from ....framework.jit.records.record_type import record_at, rows_of
from ....framework.jit.records.schema import Schema, vectors
from ....framework.jit.source import source_module
from ....framework.plugins.registry import Shape
from ....framework.vectors import smallest
from ...records import STATE
from ..convex.edges import edge_towards
from .parameters import (
    array_of,
    bind,
    make_parameter_record,
    parameter_schema,
    parameter_tuple,
    parameters_source,
)
from .signatures import ALONE, NOT_FINITE, call_bounds, linked_signature
from .user_functions import user_function


class LinkedShape:
    """The linked functions of a shape; each compiles or loads when its address is asked for."""

    def __init__(self, shape: Shape, dimensions: int) -> None:
        self.shape, self.dimensions = shape, dimensions

    @cached_property
    def bounds(self) -> Linked:
        """Half extents; notes the row in the state, also if they are no numbers from 0."""
        wrong = " and ".join(f"half[{k}] >= 0.0" for k in range(self.dimensions))
        return self._linked(
            "bounds(state, p, i)",
            "state.row_a, state.row_b = i, ALONE",
            f"half = function({self._parameters('p')}, {self.dimensions})",
            f"if not ({wrong}):",
            "    state.unsound, state.unsound_a, state.unsound_b = NOT_FINITE, i, ALONE",
            "return half",
            function=self.shape.bounds,
        )

    @cached_property
    def half_thickness(self) -> Linked | None:
        """Its least half extent along its body's axes, from its own parameters; None if rotation changes nothing."""
        axes = str(tuple(tuple(float(j == k) for k in range(self.dimensions)) for j in range(self.dimensions)))
        own, turns = parameters_source(self.shape, "at(own)", "i", "Parameters", axes), self.shape.turned is not None
        return self._linked(
            "half_thickness(own, i)", f"return smallest(function({own}, {self.dimensions}))",
            function=self.shape.bounds if turns or self.shape.rotates else None,
        )  # fmt: skip

    @cached_property
    def rotated(self) -> Linked | None:
        """Writes the parameters of a row as rotated, copies them if no body is; None if rotation changes nothing."""
        names = [f"column_{name}" for name in self.shape.columns]
        arrays = [isinstance(self.shape.component.columns[name], ArrayColumn) for name in self.shape.columns]
        writes = [
            f"    at(p).{name}[i] = {f'at(own).{name}[i]' if array else f'new[{place}]'}"
            for place, (name, array) in enumerate(zip(names, arrays, strict=True))
        ]
        return self._linked(
            "rotated(state, own, p, i, is_rotated)",
            "if is_rotated:",
            f"    matrix = rows_of(at(own).matrices, i * {self.dimensions}, i * {self.dimensions} + {self.dimensions})",
            f"    new = function({self._parameters('own')}, matrix)",
            *writes,
            "else:",
            *(f"    at(p).{name}[i] = at(own).{name}[i]" for name in names),
            "return 0",
            function=self.shape.turned,
        )

    @cached_property
    def support(self) -> Linked | None:
        source = f"return function({self._parameters('p')}, direction)"
        return self._linked("support(p, i, direction)", source, function=self.shape.support)

    @cached_property
    def rounding(self) -> Linked | None:
        source = f"return function({self._parameters('p')})"
        return self._linked("rounding(p, i)", source, function=self.shape.rounding)

    @cached_property
    def edge(self) -> Linked | None:
        """In a plane both ends of an edge, by the support if the shape does not tell them; None in space, and of what
        has neither."""
        told, parameters = self.shape.edge or self.shape.support, self._parameters("p")
        call = f"function({parameters}, normal{'' if self.shape.support else ', point'})"
        if not self.shape.edge:
            call = f"edge_towards({parameters}, function, normal, tilt)"
        lines = f"one, two = {call}", "return one[0], one[1], two[0], two[1]"
        return self._linked(
            "edge(p, i, normal, point, tilt)", *lines, function=told if self.dimensions == 2 else None
        )

    @cached_property
    def moments(self) -> Linked | None:
        """Measure, centre and second moments."""
        source = f"return function({self._parameters('p')}, {self.dimensions})"
        return self._linked("moments(state, p, i)", source, function=self.shape.second_moments)

    @cached_property
    def material(self) -> Linked | None:
        """What it is made of where it is touched."""
        source = f"return function({self._parameters('p')}, point, normal)"
        return self._linked("material(p, i, point, normal)", source, function=self.shape.material)

    def all_functions(self, by_address: bool, touched: bool = False) -> Iterator[Linked]:
        """by_address: whether some pair takes the shape by the addresses of support and rounding; touched: whether what
        spins touches it in several points, found by that of its edge too."""
        found = [self.bounds, self.half_thickness, self.rotated, self.material]
        if self.shape.support is not None and (by_address or touched):
            found += [self.support, self.rounding]
        if touched:
            found.append(self.edge)
        yield from (linked for linked in found if linked is not None)

    def _parameters(self, address: str) -> str:
        return parameters_source(self.shape, f"at({address})", "i", "Parameters")

    def _linked(self, header: str, *lines: str, function: Any) -> Any:
        """A function around one of the shape; None if it has not that."""
        if function is None:
            return None
        scope = {
            "function": user_function(function), "Parameters": parameter_tuple(self.shape), "array_of": array_of,
            "at": record_at(parameter_schema(self.shape), self.dimensions), "rows_of": rows_of,
            "edge_towards": edge_towards, "smallest": smallest, "ALONE": ALONE, "NOT_FINITE": NOT_FINITE,
        }  # fmt: skip
        shape, name = self.shape, header.partition("(")[0]
        title = f'"""{shape.component.__name__}, {self.dimensions}D."""\n\n'
        made = source_module(title + "\n    ".join([f"def {header}:", *lines]) + "\n", scope)
        what = f"plugin {shape.plugin}: {name} of {shape.component.__name__}, {self.dimensions}D,"
        return Linked(getattr(made, name), linked_signature(name, self.dimensions), what)


linked_shape = lru_cache(maxsize=CACHE_SIZE)(LinkedShape)  # the same ones for all worlds of this process


# -- boxes around shapes that are in no world yet ---------------------------------------------------

_HALF_EXTENTS = Schema("HalfExtents", half=vectors())


@lru_cache(maxsize=2)
def half_extents_kernel(dimensions: int) -> Any:
    """What :func:`half_extents_of` calls beside the shape's bounds, where an entity gets several colliders."""
    state_at, result_at = record_at(STATE, dimensions), record_at(_HALF_EXTENTS, dimensions)

    @kernel
    def half_extents(state_address: int, address: int, parameters: int, result_address: int) -> int:
        state, result = state_at(state_address), result_at(result_address)
        for i in range(len(result.half)):
            result.half[i] = call_bounds(address, state, parameters, i)
        return 0

    return half_extents


@lru_cache(maxsize=2)
def _scratch_state(dimensions: int) -> Any:
    return make_record(STATE, dimensions)


def half_extents_of(shape: Shape, columns: Mapping[str, np.ndarray], axes: np.ndarray) -> np.ndarray:
    """(n, d) half extents of n shapes of one kind; ``axes`` (n, d, d) their rotation matrices."""
    count, dimensions = axes.shape[:2]
    parameters, result = make_parameter_record(shape, dimensions), make_record(_HALF_EXTENTS, dimensions)
    bind(parameters, shape, columns, axes)
    result.half = np.empty((count, dimensions))
    state = _scratch_state(dimensions)
    address = linked_shape(shape, dimensions).bounds.address
    half_extents_kernel(dimensions)(state.address, address, parameters.address, result.address)
    return result.half
