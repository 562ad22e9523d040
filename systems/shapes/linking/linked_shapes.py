"""The linked functions of a scene's shapes, and the tables and parameter records through which kernels find them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from ....framework.data.arrays.column import ArrayColumn
from ....framework.data.component import Component
from ....framework.jit.linking import CACHE_SIZE, Linked
from ....framework.jit.records.record import Record
from ....framework.plugins.registry import Pair, Registry, Shape
from .linked_pair import LinkedPair, convex_sides, linked_pair
from .linked_shape import LinkedShape, linked_shape
from .mixing import linked_rule
from .parameters import HEADER_FIELDS, bind, make_parameter_record, show_pool


def linked_shapes(registry: Registry, components: list[type[Component]], dimensions: int) -> LinkedShapes:
    """The functions for these shapes, cheapest first; the same ones for all worlds of this process."""
    shapes = tuple(registry.shapes[component] for component in components)
    pairs = {
        (i, j): registry.pair(components[i], components[j]) for i in range(len(shapes)) for j in range(i, len(shapes))
    }
    rules = tuple(registry.mixing_rules.values())
    return _made(shapes, tuple(pairs.items()), rules, dimensions)


class LinkedShapes:
    """What the record ``state.shapes`` gets for one list of shapes.

    shapes
        in the order of their numbers, cheapest first
    pairs
        linked pairs by (i, j), i <= j; None where no plugin has a pair. Their functions take the shapes as the plugin
        has registered them; where that is (j, i) the table ``flipped`` says so
    """

    def __init__(
        self, shapes: tuple[Shape, ...], pairs: tuple[tuple[tuple[int, int], Pair | None], ...],
        rules: tuple[Any, ...], dimensions: int,
    ) -> None:  # fmt: skip
        self.shapes, self.dimensions = shapes, dimensions
        self.functions: tuple[LinkedShape, ...] = tuple(linked_shape(shape, dimensions) for shape in shapes)
        self.pairs: dict[tuple[int, int], LinkedPair | None] = {}
        self.by_address: set[int] = set()  # shapes that some pair takes by the address of their support
        self._flipped = np.zeros(len(shapes) ** 2, bool)
        for (i, j), pair in pairs:
            if pair is None:
                self.pairs[i, j] = None
                continue
            flipped = pair.first is not shapes[i].component
            first, second = (j, i) if flipped else (i, j)
            self.pairs[i, j] = linked_pair(shapes[first], shapes[second], pair, dimensions)
            self._flipped[i * len(shapes) + j] = flipped
            sides = convex_sides(shapes[first], shapes[second], pair)
            self.by_address.update(number for number, side in zip((first, second), sides, strict=True) if side)
        self._rules = tuple(linked_rule(rule) for rule in rules)
        self._tables: dict[str, np.ndarray] = {}

    @cached_property
    def unhandled(self) -> tuple[tuple[int, int], ...]:
        """Pairs of numbers of shapes that no plugin has a pair for."""
        return tuple(numbers for numbers, pair in self.pairs.items() if pair is None)

    @cached_property
    def needs_axes(self) -> bool:
        """Whether functions of some shape see the bodies' axes."""
        return any(shape.rotates for shape in self.shapes)

    def fill(self, shapes: Record, sweeps: bool = False, moments: bool = False) -> None:
        """Write the tables of functions into a record of ``SHAPES``; compiles or loads what is new.

        sweeps, moments
            also those of sweeps, which only swept bodies and casts need, and of second moments, which only what spins
            needs; without it kernels see none
        """
        shapes.count = len(self.shapes)
        shapes.concave = np.array([not shape.convex for shape in self.shapes], bool)
        shapes.sharp = np.array([shape.sharp for shape in self.shapes], bool)
        for name in ("bounds", "half_thickness", "rotated", "material", "evaluate", "batch", "corner"):
            setattr(shapes, name, self._table(name))
        shapes.mixing, shapes.flipped = addresses(self._rules), self._flipped
        shapes.moments = self._table("moments") if moments else np.zeros(0, np.int64)
        shapes.sweep = self._table("sweep") if sweeps else np.zeros(len(self.shapes) ** 2, np.int64)

    def all_functions(self, sweeps: bool, moments: bool) -> Iterator[Linked]:
        """Everything that a step may call for these shapes; sweeps: where there are swept bodies; moments: where some
        stage asks for them."""
        touched = self.touched(moments)
        for number, function in enumerate(self.functions):
            yield from function.all_functions(number in self.by_address, number in touched)
            if moments and function.moments is not None:
                yield function.moments
        yield from self._rules
        for pair in self.pairs.values():
            if pair is not None:
                yield from pair.functions(sweeps)

    def touched(self, moments: bool) -> set[int]:
        """Shapes whose records have the addresses of support, rounding and edge: all that have one of these where
        moments are asked for, because what spins touches in several points."""
        return {number for number, shape in enumerate(self.shapes) if moments and (shape.support or shape.edge)}

    def _table(self, name: str) -> np.ndarray:
        """Addresses of a function, by shape, or for pairs at first * count + second; 0 where there is none."""
        if name not in self._tables:
            if name in ("bounds", "half_thickness", "rotated", "moments", "material"):
                functions = [getattr(function, name) for function in self.functions]
            else:
                functions = [getattr(self.pairs.get(pair), name, None) for pair in np.ndindex(2 * (len(self.shapes),))]
            self._tables[name] = addresses(functions)
        return self._tables[name]


_made = lru_cache(maxsize=CACHE_SIZE)(LinkedShapes)


def addresses(functions: Any) -> np.ndarray:
    """Of linked functions; 0 where there is none."""
    return np.array([0 if function is None else function.address for function in functions], np.int64)


class ParameterRecords:
    """The parameter records of one world: of each shape as its component has it, and as it is in the world.

    Both are one record for shapes that rotation does not change, and while no body is rotated. moments: as in
    :meth:`LinkedShapes.touched`.
    """

    def __init__(self, linked: LinkedShapes, moments: bool = False) -> None:
        self._linked = linked
        self.own = [make_parameter_record(shape, linked.dimensions) for shape in linked.shapes]
        self.world = list(self.own)
        self._arrays = [
            (number, name, column)
            for number, shape in enumerate(linked.shapes) for name in shape.columns
            if isinstance(column := shape.component.columns[name], ArrayColumn)
        ]  # fmt: skip
        for number in linked.by_address:
            self.need_support(number)
        for number in linked.touched(moments):
            self.need_support(number)
            edge = linked.functions[number].edge
            self.own[number].edge = 0 if edge is None else edge.address

    def bind(
        self, number: int, columns: Mapping[str, np.ndarray], axes: np.ndarray,
        rotated: Mapping[str, np.ndarray] | None = None,
    ) -> None:  # fmt: skip
        """Give shape ``number`` its columns by name, to be called again whenever one of them is another array.

        axes
            (n, d, d) rotation matrices; any array of that many dimensions while nothing needs them
        rotated
            columns for the parameters as rotated, which :func:`dispatch.write_rotated` writes; None: as the own ones
        """
        shape = self._linked.shapes[number]
        bind(self.own[number], shape, columns, axes)
        if rotated is None or shape.turned is None:
            self.world[number] = self.own[number]
            return
        if self.world[number] is self.own[number]:
            self.world[number] = make_parameter_record(shape, self._linked.dimensions)
            for name in HEADER_FIELDS:
                setattr(self.world[number], name, getattr(self.own[number], name))
        bind(self.world[number], shape, rotated, axes)

    def follow_arrays(self) -> None:
        """Some rows have other arrays: their pools may have moved."""
        for number, name, column in self._arrays:
            show_pool(self.own[number], name, column)
            show_pool(self.world[number], name, column)

    def need_support(self, number: int) -> None:
        """Some pair takes this shape by the addresses of its support and rounding: put them into its records."""
        if not self.own[number].support and self._linked.shapes[number].support is not None:
            set_support(self.own[number], self._linked.functions[number])
            set_support(self.world[number], self._linked.functions[number])

    def fill(self, shapes: Record) -> None:
        """Write the addresses of the records into a record of ``SHAPES``, which must be done after each binding."""
        shapes.own_parameters = np.array([record.address for record in self.own], np.int64)
        shapes.parameters = np.array([record.address for record in self.world], np.int64)


def set_support(record: Record, functions: LinkedShape) -> None:
    """The addresses of support and rounding, for pairs that take the shape by them."""
    record.support = functions.support.address
    record.rounding = 0 if functions.rounding is None else functions.rounding.address
