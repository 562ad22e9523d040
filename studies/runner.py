"""One runner for all studies: an axis is a quantity with values, and each value is measured in a world of its own."""

from __future__ import annotations

import contextlib
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from carom.framework import World
from carom.lab import testing as kit
from carom.lab.cli.usage_errors import Problem
from carom.lab.measure.machine import machine
from carom.lab.measure.timing import Spread, no_garbage_collection, timed
from carom.lab.reporting.progress import NO_PROGRESS, Progress

WARM_UP_STEPS = 2
ATTEMPTS = 3  # to time steps in which no kernel is compiled or loaded


@dataclass
class Sample:
    """One value. ``figures``: with all repeats, by name; ``facts``: what was found once."""

    value: Any
    figures: dict[str, Spread]
    facts: dict[str, Any]


@dataclass
class Line:
    """One axis in one scene, or by one method; the samples in the order of the values."""

    axis: str
    of: str
    samples: list[Sample]

    def sample(self, value: Any) -> Sample:
        """The sample of that value; KeyError if it was not measured."""
        for sample in self.samples:
            if sample.value == value and type(sample.value) is type(value):
                return sample
        raise KeyError(f"{self.axis}, {self.of}: {value!r} was not measured")


@dataclass
class Result:
    """All axes of a study, with the machine and the versions that they were measured on."""

    machine: dict[str, str]
    repeats: int
    lines: list[Line]

    def line(self, axis: str, of: str) -> Line:
        """That axis there; KeyError if it was not measured."""
        for line in self.lines:
            if (line.axis, line.of) == (axis, of):
                return line
        raise KeyError(f"{axis}, {of} was not measured")


@dataclass(frozen=True)
class Axis:
    """One quantity that is varied.

    of: the scene or the method
    values: measured in each repeat
    measure: (value, repeat) -> figures by name, which may differ between repeats; None: there are no repeats
    facts: value -> what is the same in every repeat
    rotate: True: each repeat begins with another value, so that none is always measured after the same one
    explore: the samples so far, by value -> values to sample; the runner adds each sample before it asks for the next
    value. None: ``values``
    """

    name: str
    of: str
    values: tuple[Any, ...] = ()
    measure: Callable[[Any, int], Mapping[str, float]] | None = None
    facts: Callable[[Any], dict[str, Any]] | None = None
    rotate: bool = True
    explore: Callable[[Mapping[Any, Sample]], Iterator[Any]] | None = None


def run(axes: Sequence[Axis], repeats: int = 1, progress: Progress = NO_PROGRESS) -> Result:
    """Measure these axes, one after the other."""
    progress.begin(sum(_amount(axis, repeats) for axis in axes))
    return Result(machine(), repeats, [_line(axis, repeats, progress) for axis in axes])


def _amount(axis: Axis, repeats: int) -> int:
    return 1 + (repeats * len(axis.values) if axis.measure is not None else 0)


def _line(axis: Axis, repeats: int, progress: Progress) -> Line:
    taken: dict[Any, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    if axis.measure is not None:
        for repeat in range(repeats):
            first = repeat % len(axis.values) if axis.rotate else 0
            for value in (*axis.values[first:], *axis.values[:first]):
                progress.say(f"{axis.name} {value}: {axis.of}, repeat {repeat + 1} of {repeats}")
                with no_garbage_collection():
                    figures = axis.measure(value, repeat)
                for name, figure in figures.items():
                    taken[value][name].append(figure)
                progress.advance(1)
    samples: dict[Any, Sample] = {}
    for value in axis.values if axis.explore is None else axis.explore(samples):
        progress.say(f"{axis.name} {value}: {axis.of}")
        figures = {name: Spread.of(found) for name, found in taken[value].items()}
        samples[value] = Sample(value, figures, {} if axis.facts is None else axis.facts(value))
    progress.advance(1)
    return Line(axis.name, axis.of, list(samples.values()))


def nanoseconds_per_step(make: Callable[[], World], what: str, steps: int, enough: float = 0.0) -> float:
    """The mean over the first so many steps of new worlds, until they have taken ``enough`` s; what: names the world in
    the Problem if each try compiled kernels."""
    spent, taken, tries = 0.0, 0, 0
    while tries < ATTEMPTS:
        with contextlib.closing(make()) as world:
            kit.run(world, WARM_UP_STEPS)
            seconds, counts, _ = timed(partial(kit.run, world, steps))
        if counts:
            spent, taken = spent + seconds, taken + steps
            if spent >= enough:
                return spent / taken * 1e9
        else:  # kernels loaded meanwhile are ready next time
            tries += 1
    raise Problem(f"{what}: kernels were compiled in all steps; run it once more")


def ratios(one: Spread, other: Spread) -> Spread:
    """How many times as large one is, within each repeat."""
    return Spread.of([a / b for a, b in zip(one.values, other.values, strict=True)])
