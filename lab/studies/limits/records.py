"""Records of a sweep to the limits: axes, the kinds of worlds tried on them, and their results.

The results are plain data that converts to JSON and back.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from ....framework import Settings
from ...plain import Plain

LEVELS = {"1 %": 0.01, "10 %": 0.1}
BREAKS = "breaks"
UP, DOWN = "up", "down"
MODES = ("discrete", "continuous", "event_driven")
FLYING = MODES[:2]  # collision modes in which the integrator matters


class BrokenError(Exception):
    """Raised by a measurement whose result is unusable; the message says why.

    error: its size all the same, None if it has none.
    """

    def __init__(self, why: str, error: float | None = None) -> None:
        super().__init__(why)
        self.error = error


@dataclass(frozen=True)
class Method:
    """One kind of world: a name, and the settings that differ from the default.

    modes
        collision modes for which its result holds
    """

    name: str
    modes: tuple[str, ...]
    changes: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))

    def settings(self, **more: Any) -> Settings:
        """The settings of a world of this kind."""
        return Settings(**{**self.changes, **more})


@dataclass(frozen=True)
class Axis:
    """One quantity that is increased and decreased until carom fails.

    unit
        of the values, in words
    norm
        the error, and what it is relative to
    values
        ascending; ``quick`` are fewer of them, ``long`` more
    home
        the value from which the sweep starts, where all works
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
        """The values of a sweep."""
        if quick:
            return self.quick or self.values[:: max(1, len(self.values) // 6)]
        return tuple(sorted((*self.values, *self.long))) if long else self.values


@dataclass
class Sample:
    """One world; error: None if it has none; broken: the way it broke, or empty."""

    value: float
    error: float | None
    broken: str = ""

    def beyond(self, level: str) -> bool:
        """True if it is past that level."""
        if level == BREAKS:
            return bool(self.broken)
        return self.error is None or self.error > LEVELS[level]


@dataclass
class Edge:
    """Where a level is first exceeded, going up or down from the axis's home.

    value
        the first found beyond the level; None if none of those tried is
    last
        its neighbour that is not beyond; if value is None, the last tried. None if even the home is beyond
    """

    way: str
    level: str
    value: float | None
    last: float | None
    why: str = ""


@dataclass
class Line(Plain):
    """One method on one axis; samples ascending."""

    method: str
    samples: list[Sample]
    edges: list[Edge]

    def edge(self, level: str, way: str = UP) -> Edge:
        """The edge of that level; KeyError if that direction was not swept."""
        for edge in self.edges:
            if (edge.level, edge.way) == (level, way):
                return edge
        raise KeyError(f"{self.method}: no edge {level!r} on the way {way}")


@dataclass
class AxisLimits(Plain):
    """One axis with all its methods; see Axis."""

    name: str
    title: str
    unit: str
    norm: str
    lines: list[Line]

    def line(self, method: str) -> Line:
        """The line of that method; KeyError if there is none."""
        for line in self.lines:
            if line.method == method:
                return line
        raise KeyError(f"axis {self.name}: no method {method!r}; it has {', '.join(x.method for x in self.lines)}")


@dataclass
class Limits(Plain):
    """A whole sweep, with the machine and versions it ran on."""

    machine: dict[str, str]
    axes: list[AxisLimits]

    def axis(self, name: str) -> AxisLimits:
        """That axis; KeyError if it was not swept."""
        for axis in self.axes:
            if axis.name == name:
                return axis
        raise KeyError(f"no axis {name!r} in this sweep; it has {', '.join(axis.name for axis in self.axes)}")


def decades(first: int, last: int, per_decade: int = 1) -> tuple[float, ...]:
    """10^first ... 10^last, with ``per_decade`` values per decade."""
    count = (last - first) * per_decade
    return tuple(float(10.0 ** (first + k / per_decade)) for k in range(count + 1))


def by_mode(**changes: Any) -> tuple[Method, ...]:
    """One method per collision mode."""
    return tuple(Method(mode, (mode,), MappingProxyType({"collision": mode, **changes})) for mode in MODES)


def by_integrator(names: Sequence[str]) -> tuple[Method, ...]:
    """One method per integrator, and one for the flight of event-driven worlds."""
    flying = [Method(name, FLYING, MappingProxyType({"integrator": name})) for name in names]
    return (*flying, Method("event_driven", MODES[2:], MappingProxyType({"collision": "event_driven"})))
