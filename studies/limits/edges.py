"""Follow a quantity outwards from a value where all works, and bisect where the error passes a level.

Each sample is a separate world, so no result depends on the others or on the machine's speed.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from carom.framework import CaromError
from carom.lab.cli.usage_errors import one_line

from ..runner import Axis, Sample
from .quantity import BrokenError, Method, Quantity

LEVELS = {"1 %": 0.01, "10 %": 0.1}
BREAKS = "breaks"
UP, DOWN = "up", "down"
BLOWN_UP = 1e6  # larger errors count as broken


@dataclass(frozen=True)
class Edge:
    """Where a level is first exceeded, going up or down from the quantity's home.

    value
        the first found beyond the level; None if none of those tried is
    last
        its neighbour that is not beyond; if value is None, the last tried. None if even the home is beyond
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
