"""Follow a quantity outwards from a value where all works, and bisect where the error passes a level.

Each sample is a separate world, so no result depends on the others or on the machine's speed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np

from carom.framework import CaromError, Settings
from carom.framework.settings import COLLISION_MODES
from carom.lab.cli.usage_errors import one_line

from ..runner import Axis, Sample

LEVELS = {"1 %": 0.01, "10 %": 0.1}
BREAKS = "breaks"
UP, DOWN = "up", "down"
BLOWN_UP = 1e6  # larger errors count as broken


@dataclass(frozen=True)
class Edge:
    """Where a level is first exceeded, going up or down from the quantity's home.

    value: the first found beyond the level; None if none of those tried is
    last: its neighbour that is not beyond; if value is None, the last tried. None if even the home is beyond
    """

    value: float | None
    last: float | None
    why: str = ""


def axis_of(quantity: Quantity, method: Method, values: Sequence[float]) -> Axis:
    """A quantity in one kind of world, for the runner."""
    facts, search = partial(measured, quantity, method), partial(explore, quantity, values)
    return Axis(quantity.name, method.name, facts=facts, explore=search)


def measured(quantity: Quantity, method: Method, value: float) -> dict[str, Any]:
    """The error of one sample, None if it has none, and how it broke, or ""; an error raised by carom breaks it."""
    try:
        with np.errstate(all="ignore"):
            error = quantity.measure(method, value)
    except BrokenError as broken:
        return {"error": broken.error, "broken": str(broken)}
    except (CaromError, ValueError, ArithmeticError, MemoryError) as error:
        return {"error": None, "broken": f"refused: {one_line(error.__cause__ or error)}"}
    if not error < BLOWN_UP:
        return {"error": None, "broken": "not finite" if not math.isfinite(error) else "blows up"}
    return {"error": float(error), "broken": ""}


def explore(quantity: Quantity, values: Sequence[float], samples: Mapping[float, Sample]) -> Iterator[float]:
    """Outwards until a sample has no error figure, then what narrows the edges down."""
    home = home_of(quantity, values)
    up, down = [v for v in values if v >= home], [v for v in reversed(values) if v <= home]
    for path in (up, down):
        for value in path:
            if value not in samples:
                yield value
            if samples[value].facts["error"] is None:
                break
    for way in (UP, DOWN):
        for level in (*LEVELS, BREAKS):
            while (middle := _between(quantity, edge(quantity, samples.values(), level, way))) is not None:
                yield middle


def edge(quantity: Quantity, samples: Iterable[Sample], level: str, way: str = UP) -> Edge:
    """Where the level is first exceeded, from the samples there are."""
    by_value = {sample.value: sample for sample in samples}
    home = home_of(quantity, by_value)
    last = None
    for value in sorted(by_value, reverse=way == DOWN):
        if value < home if way == UP else value > home:
            continue
        if _beyond(by_value[value], level):
            return Edge(value, last, by_value[value].facts["broken"])
        last = value
    return Edge(None, last)


def home_of(quantity: Quantity, values: Iterable[float]) -> float:
    """The value from which the others are looked at."""
    return min(values, key=lambda value: abs(math.log(value / quantity.home)))


def _beyond(sample: Sample, level: str) -> bool:
    if level == BREAKS:
        return bool(sample.facts["broken"])
    return sample.facts["error"] is None or sample.facts["error"] > LEVELS[level]


def _between(quantity: Quantity, found: Edge) -> float | None:
    """The value that halves the edge on a logarithmic scale; None if it is narrow enough."""
    bad, good, fine = found.value, found.last, quantity.fine
    if bad is None or good is None or fine is None or max(bad / good, good / bad) <= fine:
        return None
    middle = math.sqrt(bad * good)
    if not quantity.whole:
        return middle
    if abs(bad - good) <= 1:
        return None
    middle = float(round(middle))
    return middle if middle not in (bad, good) else float(round((bad + good) / 2))


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

    unit: of the values, in words
    norm: the error, and what it is relative to
    values: ascending; ``quick`` are fewer of them, ``long`` more
    home: the value from which the search starts, where all works
    measure: (method, value) -> error; raises BrokenError. Errors raised by carom count as broken too
    fine: edges are found to this factor; None: the values are not refined
    whole: True if values are whole numbers
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


BY_MODE = tuple(Method(mode, MappingProxyType({"collision": mode})) for mode in COLLISION_MODES)


def by_integrator(names: Sequence[str]) -> tuple[Method, ...]:
    """One method per integrator, and one for the flight of event-driven worlds."""
    return (*(Method(name, MappingProxyType({"integrator": name})) for name in names), BY_MODE[2])
