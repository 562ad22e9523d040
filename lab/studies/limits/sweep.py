"""Sweep one quantity at a time until carom fails, and report where.

Each axis is followed outwards from a value where all works. Where the error exceeds 1 % or 10 %, or something breaks,
the edge is bisected. Each sample is a separate world, so no result depends on the others or on the machine's speed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np

from ....framework import CaromError
from ...bench.results import machine
from ...cli.usage_errors import did_you_mean, one_line
from ...reporting.progress import NO_PROGRESS, Progress
from . import axes_contacts as limits_axes_contacts
from . import axes_motion as limits_axes
from .records import BREAKS, DOWN, LEVELS, MODES, UP, Axis, AxisLimits, BrokenError, Edge, Limits, Line, Method, Sample

AXES: tuple[Axis, ...] = (*limits_axes.AXES, *limits_axes_contacts.AXES)
BLOWN_UP = 1e6  # larger errors count as broken


def limits(
    axes: Iterable[str] | None = None,
    modes: Iterable[str] | None = None,
    progress: Progress = NO_PROGRESS,
    *,
    quick: bool = False,
    long: bool = False,
) -> Limits:
    """Sweep the axes and collision modes named, or all: "discrete", "continuous", "event_driven".

    quick: fewer values. long: also those that take minutes. ValueError for an unknown name.
    """
    if quick and long:
        raise ValueError("limits: quick and long exclude each other")
    wanted = _chosen("axis", axes, [axis.name for axis in AXES])
    kinds = _chosen("kind of collision", modes, MODES)
    swept = [(axis, _methods(axis, kinds)) for axis in AXES if axis.name in wanted]
    progress.begin(sum(len(methods) for _, methods in swept))
    results = []
    for axis, methods in swept:
        lines = []
        for method in methods:
            progress.say(f"{axis.title}: {method.name}")
            lines.append(sweep(axis, method, axis.chosen(quick, long)))
            progress.advance(1)
        results.append(AxisLimits(axis.name, axis.title, axis.unit, axis.norm, lines))
    return Limits(machine(), results)


def sweep(axis: Axis, method: Method, values: Sequence[float]) -> Line:
    """One method on one axis: the samples of ``values`` and those needed to find the edges."""
    samples: dict[float, Sample] = {}

    def sample(value: float) -> Sample:
        if value not in samples:
            samples[value] = measured(axis, method, value)
        return samples[value]

    edges = []
    home = min(values, key=lambda value: abs(math.log(value / axis.home)))
    for way in (UP, DOWN):
        path = [v for v in values if v >= home] if way == UP else [v for v in reversed(values) if v <= home]
        if way == DOWN and len(path) < 2:
            continue
        tried = list(_outwards(path, sample))
        for level in (*LEVELS, BREAKS):
            edges.append(_edge(axis, way, level, tried, sample))
    return Line(method.name, [samples[value] for value in sorted(samples)], edges)


def measured(axis: Axis, method: Method, value: float) -> Sample:
    """One sample; an error raised by carom is recorded in it."""
    try:
        with np.errstate(all="ignore"):
            error = axis.measure(method, value)
    except BrokenError as broken:
        return Sample(value, broken.error, str(broken))
    except (CaromError, ValueError, ArithmeticError, MemoryError) as error:
        return Sample(value, None, f"refused: {one_line(error.__cause__ or error)}")
    if not error < BLOWN_UP:
        return Sample(value, None, "not finite" if not math.isfinite(error) else "blows up")
    return Sample(value, float(error))


def _outwards(path: list[float], sample: Callable[[float], Sample]) -> Iterator[Sample]:
    """Samples along the path until one has no error figure."""
    for value in path:
        found = sample(value)
        yield found
        if found.error is None:
            return


def _edge(axis: Axis, way: str, level: str, tried: list[Sample], sample: Callable[[float], Sample]) -> Edge:
    """Where the level is first exceeded between two samples, bisected on a logarithmic scale."""
    first = next((place for place, found in enumerate(tried) if found.beyond(level)), None)
    if first is None:
        return Edge(way, level, None, tried[-1].value)
    bad = tried[first]
    if first == 0:
        return Edge(way, level, bad.value, None, bad.broken)
    good = tried[first - 1]
    while axis.fine is not None and max(bad.value / good.value, good.value / bad.value) > axis.fine:
        middle = math.sqrt(bad.value * good.value)
        if axis.whole:
            middle = float(round(middle))
            if middle in (bad.value, good.value):
                if abs(bad.value - good.value) <= 1:
                    break
                middle = float(round((bad.value + good.value) / 2))
        found = sample(middle)
        good, bad = (good, found) if found.beyond(level) else (found, bad)
    return Edge(way, level, bad.value, good.value, bad.broken)


def _chosen(what: str, asked: Iterable[str] | None, known: Sequence[str]) -> list[str]:
    if asked is None:
        return list(known)
    names = list(asked)
    for name in names:
        if name not in known:
            raise ValueError(f"limits: no {what} {name!r}{did_you_mean(name, known)}")
    return names


def _methods(axis: Axis, kinds: Sequence[str]) -> list[Method]:
    return [method for method in axis.methods if set(method.modes) & set(kinds)]
