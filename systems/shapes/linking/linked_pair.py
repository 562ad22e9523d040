"""The linked functions of a pair of shapes, made around the functions that a plugin has registered for it.

All take the two shapes in the order in which the pair is registered; callers turn them round
(:mod:`carom.systems.shapes.dispatch`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property, lru_cache
from typing import Any

from ....framework.compilation import inlined
from ....framework.jit.linking import CACHE_SIZE, Linked
from ....framework.jit.records.record_type import record_at
from ....framework.jit.source import source_module
from ....framework.plugins.registry import Convex, Pair, Shape
from .batches import batch_by_address, checked, in_given_order, in_order_of_shapes, make_batch
from .convex_by_address import convex_at, rounding_argument, support_argument
from .parameters import array_of, parameter_schema, parameter_tuple, parameters_source
from .signatures import OUT_OF_TIME, linked_signature
from .user_functions import as_argument, is_long, user_function


@inlined
def as_address(address):
    """In place of the record of a shape that is taken by address."""
    return address


def make_evaluate(contact: Any, at_a: Any, at_b: Any) -> Any:
    def evaluate(state, pa, a, pb, b, d):
        state.row_a, state.row_b = a, b
        return checked(state, a, b, d, contact(at_a(pa), a, at_b(pb), b, d))

    return evaluate


def make_sweep(swept: Any, at_a: Any, at_b: Any) -> Any:
    def sweep(state, pa, a, pb, b, d, v):
        state.row_a, state.row_b = a, b
        hit, time = swept(at_a(pa), a, at_b(pb), b, d, v)
        if hit and not 0.0 <= time <= 1.0:
            state.unsound, state.unsound_a, state.unsound_b = OUT_OF_TIME, a, b
            return False, 0.0
        return hit, time

    return sweep


def make_corner(touches: Any, at_a: Any, at_b: Any) -> Any:
    def corner(state, pa, a, pb, b, d, slop):
        return touches(at_a(pa), a, at_b(pb), b, d, slop)

    return corner


class LinkedPair:
    """The linked functions of a pair, each compiled or loaded when its address is asked for.

    first, second
        the shapes; None: any convex shape, whose support is called by address
    """

    def __init__(self, first: Shape | None, second: Shape | None, pair: Pair, dimensions: int) -> None:
        self.first, self.second, self.pair, self.dimensions = first, second, pair, dimensions

    @cached_property
    def evaluate(self) -> Linked:
        return self._linked(make_evaluate(self._contact, *self._records))

    @cached_property
    def batch(self) -> Linked:
        if is_long(self.pair.function):
            return _batch_by_address(self.dimensions)
        order = in_given_order if self.first is self.second else in_order_of_shapes
        return self._linked(make_batch(self._contact, order, *self._records))

    @cached_property
    def sweep(self) -> Linked | None:
        if self.pair.sweep is None:
            return None
        return self._linked(make_sweep(self._registered("swept", self.pair.sweep, "d, v"), *self._records))

    @cached_property
    def corner(self) -> Linked | None:
        if self.pair.corner is None:
            return None
        return self._linked(make_corner(self._registered("touches", self.pair.corner, "d, slop"), *self._records))

    def functions(self, sweeps: bool) -> Iterator[Linked]:
        """Those that there are; sweeps: also that of swept bodies and casts."""
        yield from (self.evaluate, self.batch)
        yield from (linked for linked in (self.corner, self.sweep if sweeps else None) if linked is not None)

    def _linked(self, function: Any) -> Linked:
        what = f"plugin {self.pair.plugin}: pair {self.pair.names}, {self.dimensions}D,"
        return Linked(function, linked_signature(function.__name__, self.dimensions), what)

    @cached_property
    def _contact(self) -> Any:
        return self._registered("contact", self.pair.function, "d")

    @property
    def _records(self) -> tuple[Any, Any]:
        one, two = (
            as_address if shape is None else record_at(parameter_schema(shape), self.dimensions)
            for shape in (self.first, self.second)
        )
        return one, two

    def _registered(self, name: str, function: Any, values: str) -> Any:
        """name(record of a, a, record of b, b, values) that calls a registered function as the plugin wrote it."""
        scope: dict[str, Any] = {"function": user_function(function), "array_of": array_of, "convex_at": convex_at}
        arguments = []
        for shape, kind, record, row in ((self.first, "First", "pa", "a"), (self.second, "Second", "pb", "b")):
            if shape is None:
                arguments.append(f"convex_at({record}, {row})")
            else:
                scope[kind] = parameter_tuple(shape)
                arguments.append(parameters_source(shape, record, row, kind))
        arguments.append(values)
        for k, helper in enumerate(self._helpers()):
            scope[f"helper{k}"] = helper
            arguments.append(f"helper{k}")
        title = f'"""{self.pair.names}, {self.dimensions}D."""'
        call = f"    return function({', '.join(arguments)})"
        source = "\n".join([title, "", f"def {name}(pa, a, pb, b, {values}):", call, ""])
        return inlined(getattr(source_module(source, scope), name))

    def _helpers(self) -> list[Any]:
        """Supports, then roundings, of the shapes that are registered as Convex."""
        count = len(self.pair.helpers) // 2
        if None in (self.first, self.second):
            return [support_argument] * count + [rounding_argument] * count
        return [as_argument(user_function(helper)) for helper in self.pair.helpers]


@lru_cache(maxsize=CACHE_SIZE)
def linked_pair(first: Shape, second: Shape, pair: Pair, dimensions: int) -> LinkedPair:
    """The functions of two shapes in the order of the pair, the same ones for all worlds of this process.

    Long functions that take any convex shape are compiled once for all of these: a support called by address costs
    3 ns, compiling the function once more seconds.
    """
    by_address = convex_sides(first, second, pair)
    if not any(by_address):
        return LinkedPair(first, second, pair, dimensions)
    one, two = (None if convex else shape for convex, shape in zip(by_address, (first, second), strict=True))
    names = {"first": Convex if one is None else pair.first, "second": Convex if two is None else pair.second}
    return _shared_pair(one, two, replace(pair, **names, helpers=(None,) * len(pair.helpers)), dimensions)


_shared_pair = lru_cache(maxsize=CACHE_SIZE)(LinkedPair)


@lru_cache(maxsize=CACHE_SIZE)
def convex_sides(first: Shape, second: Shape, pair: Pair) -> tuple[bool, bool]:
    """Which of the two the pair takes by the addresses of support and rounding."""
    if not pair.helpers or not is_long(pair.function):
        return False, False
    if len(pair.helpers) == 4:
        return True, True
    if first is second:  # either may be the one that the function knows
        return False, False
    return pair.helpers[0] is first.support, pair.helpers[0] is second.support


@lru_cache(maxsize=CACHE_SIZE)
def _batch_by_address(dimensions: int) -> Linked:
    return Linked(batch_by_address, linked_signature("batch", dimensions))
