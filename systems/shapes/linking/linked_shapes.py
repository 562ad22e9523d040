"""The linked functions of a scene's shapes, and the tables and parameter records through which kernels find them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from ....framework.data.arrays.column import ArrayColumn
from ....framework.data.component import Component
from ....framework.jit.linking import KEPT, Linked
from ....framework.jit.records.record import Record
from ....framework.plugins.registry import Pair, Registry, Shape
from .linked_pair import LinkedPair, convex_sides, linked_pair
from .linked_shape import LinkedShape, linked_shape
from .mixing import linked_rule
from .parameters import bind, make_parameter_record


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
        self, shapes: tuple[Shape, ...], pairs: Mapping[tuple[int, int], Pair | None], rules: tuple[Any, ...],
        dimensions: int,
    ) -> None:  # fmt: skip
        self.shapes, self.dimensions = shapes, dimensions
        self.functions: tuple[LinkedShape, ...] = tuple(linked_shape(shape, dimensions) for shape in shapes)
        self.pairs: dict[tuple[int, int], LinkedPair | None] = {}
        self.supported: set[int] = set()  # shapes that some pair takes by the address of their support
        self._flipped = np.zeros(len(shapes) ** 2, bool)
        for (i, j), pair in pairs.items():
            if pair is None:
                self.pairs[i, j] = None
                continue
            flipped = pair.first is not shapes[i].component
            first, second = (j, i) if flipped else (i, j)
            self.pairs[i, j] = linked_pair(shapes[first], shapes[second], pair, dimensions)
            self._flipped[i * len(shapes) + j] = flipped
            sides = convex_sides(shapes[first], shapes[second], pair)
            self.supported.update(number for number, side in zip((first, second), sides, strict=True) if side)
        self._rules = tuple(linked_rule(rule) for rule in rules)

    @cached_property
    def unhandled(self) -> tuple[tuple[int, int], ...]:
        """Pairs of numbers of shapes that no plugin has a pair for."""
        return tuple(numbers for numbers, pair in self.pairs.items() if pair is None)

    @property
    def has_concave(self) -> bool:
        """Whether some shape is not convex."""
        return not all(shape.convex for shape in self.shapes)

    @cached_property
    def needs_axes(self) -> bool:
        """Whether functions of some shape see the bodies' axes."""
        return any(shape.rotates for shape in self.shapes)

    @cached_property
    def has_array_columns(self) -> bool:
        """Whether some shape has parameters in a pool of arrays, which may move when bodies come."""
        columns = (shape.component.columns[name] for shape in self.shapes for name in shape.columns)
        return any(isinstance(column, ArrayColumn) for column in columns)

    @property
    def rotation_changes(self) -> bool:
        """Whether rotation changes the parameters of some shape."""
        return any(shape.turned is not None for shape in self.shapes)

    def fill(self, shapes: Record, sweeps: bool = False) -> None:
        """Write the tables of functions into a record of ``SHAPES``; compiles or loads what is new.

        sweeps
            also those of sweeps, which only swept bodies and casts need; without it kernels see none
        """
        shapes.count = len(self.shapes)
        shapes.concave = np.array([not shape.convex for shape in self.shapes], bool)
        shapes.sharp = np.array([shape.sharp for shape in self.shapes], bool)
        shapes.bounds, shapes.rotated, shapes.mixing = self._bounds, self._rotated, self._mixing
        shapes.evaluate, shapes.batch, shapes.corner = self._evaluate, self._batch, self._corner
        shapes.flipped = self._flipped
        shapes.sweep = self._sweep if sweeps else np.zeros(len(self.shapes) ** 2, np.int64)

    def all_functions(self, sweeps: bool) -> Iterator[Linked]:
        """Everything that a step may call for these shapes; sweeps: where there are swept bodies."""
        for number, function in enumerate(self.functions):
            yield from function.all_functions(by_address=number in self.supported)
        yield from self._rules
        for pair in self.pairs.values():
            if pair is not None:
                yield from pair.functions(sweeps)

    @cached_property
    def _bounds(self) -> np.ndarray:
        return _addresses(function.bounds for function in self.functions)

    @cached_property
    def _rotated(self) -> np.ndarray:
        return _addresses(function.rotated for function in self.functions)

    @cached_property
    def _mixing(self) -> np.ndarray:
        return _addresses(self._rules)

    @cached_property
    def _evaluate(self) -> np.ndarray:
        return self._of_pairs("evaluate")

    @cached_property
    def _batch(self) -> np.ndarray:
        return self._of_pairs("batch")

    @cached_property
    def _corner(self) -> np.ndarray:
        return self._of_pairs("corner")

    @cached_property
    def _sweep(self) -> np.ndarray:
        return self._of_pairs("sweep")

    def _of_pairs(self, name: str) -> np.ndarray:
        """Addresses at first * count + second; 0 where there is no such function."""
        count = len(self.shapes)
        table = np.zeros(count * count, np.int64)
        for (i, j), pair in self.pairs.items():
            linked = None if pair is None else getattr(pair, name)
            table[i * count + j] = 0 if linked is None else linked.address
        return table


@lru_cache(maxsize=KEPT)
def _made(shapes: tuple[Shape, ...], pairs: tuple[Any, ...], rules: tuple[Any, ...], dimensions: int) -> LinkedShapes:
    return LinkedShapes(shapes, dict(pairs), rules, dimensions)


def _addresses(functions: Any) -> np.ndarray:
    return np.array([0 if function is None else function.address for function in functions], np.int64)


class ParameterRecords:
    """The parameter records of one world: of each shape as its component has it, and as it is in the world.

    Both are one record for shapes that rotation does not change, and while no body is rotated.
    """

    def __init__(self, linked: LinkedShapes) -> None:
        self._linked = linked
        self.own = [make_parameter_record(shape, linked.dimensions) for shape in linked.shapes]
        self.world = list(self.own)
        for number in linked.supported:
            self.need_support(number)

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
            self.world[number].support, self.world[number].rounding = (
                self.own[number].support,
                self.own[number].rounding,
            )
        bind(self.world[number], shape, rotated, axes)

    def need_support(self, number: int) -> None:
        """Some pair takes this shape by the addresses of its support and rounding: put them into its records."""
        if not self.own[number].support:
            set_support(self.own[number], self._linked.functions[number])
            set_support(self.world[number], self._linked.functions[number])

    def fill(self, shapes: Record) -> None:
        """Write the addresses of the records into a record of ``SHAPES``, which must be done after each binding."""
        shapes.own_parameters = np.array([record.address for record in self.own], np.int64)
        shapes.parameters = np.array([record.address for record in self.world], np.int64)


def set_support(record: Record, functions: LinkedShape) -> None:
    """The addresses of support and rounding, for pairs that take the shape by them."""
    record.support, record.rounding = functions.support.address, functions.rounding.address
