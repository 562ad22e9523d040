"""A quantity that is increased and decreased until carom fails, and the kinds of worlds in which that is tried."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from carom.framework import Settings

MODES = ("discrete", "continuous", "event_driven")


class BrokenError(Exception):
    """Raised by a measurement whose result is unusable; the message says why.

    error: its size all the same, None if it has none.
    """

    def __init__(self, why: str, error: float | None = None) -> None:
        super().__init__(why)
        self.error = error


@dataclass(frozen=True)
class Method:
    """One kind of world: a name, and the settings that differ from the default."""

    name: str
    changes: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))

    def settings(self, **more: Any) -> Settings:
        """The settings of a world of this kind."""
        return Settings(**{**self.changes, **more})


@dataclass(frozen=True)
class Quantity:
    """What is varied, and the error that follows.

    unit
        of the values, in words
    norm
        the error, and what it is relative to
    values
        ascending; ``quick`` are fewer of them, ``long`` more
    home
        the value from which the search starts, where all works
    measure
        (method, value) -> error; raises BrokenError. Errors raised by carom count as broken too
    fine
        edges are found to this factor; None: the values are not refined
    whole
        True if values are whole numbers
    """

    name: str
    title: str
    unit: str
    norm: str
    values: tuple[float, ...]
    home: float
    methods: tuple[Method, ...]
    measure: Callable[[Method, float], float]
    fine: float | None = 1.1
    whole: bool = False
    quick: tuple[float, ...] = ()
    long: tuple[float, ...] = ()

    def chosen(self, quick: bool, long: bool) -> tuple[float, ...]:
        """The values to begin with."""
        if quick:
            return self.quick or self.values[:: max(1, len(self.values) // 6)]
        return tuple(sorted((*self.values, *self.long))) if long else self.values


def decades(first: int, last: int, per_decade: int = 1) -> tuple[float, ...]:
    """10^first ... 10^last, with ``per_decade`` values per decade."""
    count = (last - first) * per_decade
    return tuple(float(10.0 ** (first + k / per_decade)) for k in range(count + 1))


BY_MODE = tuple(Method(mode, MappingProxyType({"collision": mode})) for mode in MODES)


def by_integrator(names: Sequence[str]) -> tuple[Method, ...]:
    """One method per integrator, and one for the flight of event-driven worlds."""
    return (*(Method(name, MappingProxyType({"integrator": name})) for name in names), BY_MODE[2])
