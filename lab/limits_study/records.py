"""What a sweep to the limits consists of: axes, the kinds of worlds tried on them, what each showed.

The results are plain data that goes through JSON and back.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Self

from ...framework import Settings

LEVELS = {"1 %": 0.01, "10 %": 0.1}
BREAKS = "breaks"
UP, DOWN = "up", "down"
MODES = ("discrete", "continuous", "event_driven")
FLYING = MODES[:2]  # in which the integrator counts


class BrokenError(Exception):
    """Raised by a measurement: what was measured is no longer what it should be, and in which way.

    error: how large the error is all the same, None if there is none to tell.
    """

    def __init__(self, why: str, error: float | None = None) -> None:
        super().__init__(why)
        self.error = error


@dataclass(frozen=True)
class Method:
    """One kind of world that is tried: a name, and how its settings differ from the default.

    modes
        kinds of collision for which its result holds
    """

    name: str
    modes: tuple[str, ...]
    changes: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))

    def settings(self, **more: Any) -> Settings:
        """The settings of a world of this kind."""
        return Settings(**{**self.changes, **more})


@dataclass(frozen=True)
class Axis:
    """One thing that is made larger and smaller until it fails.

    unit
        of the values, in words
    norm
        what the error is, and of what it is a share
    values
        ascending; ``quick`` are fewer of them, ``long`` more
    home
        where all is well: from there it is gone outwards
    measure
        (method, value) -> error; raises BrokenError. Errors of carom count as broken too
    fine
        edges are known to this factor; None: the values are not refined
    whole
        whether values are whole numbers
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
    """One world; error None if there is none to tell; broken: in what way, or empty."""

    value: float
    error: float | None
    broken: str = ""

    def beyond(self, level: str) -> bool:
        """Whether it is past that level."""
        if level == BREAKS:
            return bool(self.broken)
        return self.error is None or self.error > LEVELS[level]


@dataclass
class Edge:
    """Where a level is passed, on the way up or down from the axis's home.

    value
        the first found beyond it; None if none of those tried is
    last
        the one next to it that is not beyond; if value is None, the last tried. None if even the home is beyond
    """

    way: str
    level: str
    value: float | None
    last: float | None
    why: str = ""


@dataclass
class Line:
    """One method on one axis; samples ascending."""

    method: str
    samples: list[Sample]
    edges: list[Edge]

    def edge(self, level: str, way: str = UP) -> Edge:
        """The edge of that level; KeyError if nobody went that way."""
        for edge in self.edges:
            if (edge.level, edge.way) == (level, way):
                return edge
        raise KeyError(f"{self.method}: no edge {level!r} on the way {way}")

    @classmethod
    def from_dict(cls, plain: dict[str, Any]) -> Self:
        """From what ``dataclasses.asdict`` and JSON made of one."""
        samples = [Sample(**sample) for sample in plain["samples"]]
        return cls(plain["method"], samples, [Edge(**edge) for edge in plain["edges"]])


@dataclass
class AxisLimits:
    """One axis with all its methods; see Axis."""

    name: str
    title: str
    unit: str
    norm: str
    lines: list[Line]

    def line(self, method: str) -> Line:
        """That method's; KeyError if there is none."""
        for line in self.lines:
            if line.method == method:
                return line
        raise KeyError(f"axis {self.name}: no method {method!r}; it has {', '.join(x.method for x in self.lines)}")

    @classmethod
    def from_dict(cls, plain: dict[str, Any]) -> Self:
        """From what ``dataclasses.asdict`` and JSON made of one."""
        return cls(**{**plain, "lines": [Line.from_dict(line) for line in plain["lines"]]})


@dataclass
class Limits:
    """A whole sweep, and on which machine and versions it ran."""

    machine: dict[str, str]
    axes: list[AxisLimits]

    def axis(self, name: str) -> AxisLimits:
        """That axis; KeyError if it was not swept."""
        for axis in self.axes:
            if axis.name == name:
                return axis
        raise KeyError(f"no axis {name!r} in this sweep; it has {', '.join(axis.name for axis in self.axes)}")

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return dataclasses.asdict(self)

    @classmethod
    def from_dict(cls, plain: dict[str, Any]) -> Self:
        """The opposite of :meth:`as_dict`, also after JSON."""
        return cls(plain["machine"], [AxisLimits.from_dict(axis) for axis in plain["axes"]])


def decades(first: int, last: int, per_decade: int = 1) -> tuple[float, ...]:
    """10^first ... 10^last, so many per decade."""
    count = (last - first) * per_decade
    return tuple(float(10.0 ** (first + k / per_decade)) for k in range(count + 1))


def by_mode(**changes: Any) -> tuple[Method, ...]:
    """One method for each kind of collision."""
    return tuple(Method(mode, (mode,), MappingProxyType({"collision": mode, **changes})) for mode in MODES)


def by_integrator(names: Sequence[str]) -> tuple[Method, ...]:
    """One method for each integrator, and one for the flight of worlds that events drive."""
    flying = [Method(name, FLYING, MappingProxyType({"integrator": name})) for name in names]
    return (*flying, Method("event_driven", MODES[2:], MappingProxyType({"collision": "event_driven"})))
