"""One runner for all studies: an axis is a quantity with values, and each value is measured in a world of its own."""

from __future__ import annotations

import contextlib
import statistics
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from carom.framework import World
from carom.lab import testing as kit
from carom.lab.cli.usage_errors import Problem
from carom.lab.jobs import Jobs
from carom.lab.measure.timing import faults_in_results, machine, no_garbage_collection, timed
from carom.lab.reporting.progress import NO_PROGRESS, Progress

WARM_UP_STEPS = 2
ATTEMPTS = 3  # to time steps in which no kernel is compiled or loaded


@dataclass(frozen=True)
class Spread:
    """Repeated measurements: the median, the least and the largest, and all values."""

    median: float
    low: float
    high: float
    values: tuple[float, ...]

    @classmethod
    def of(cls, values: Sequence[float]) -> Spread:
        """From at least one value."""
        return cls(statistics.median(values), min(values), max(values), tuple(values))


@dataclass
class Sample:
    """One value. ``figures``: with all repeats, by name; ``facts``: what was found once."""

    value: Any
    figures: dict[str, Spread]
    facts: dict[Any, Any]


@dataclass
class Line:
    """One axis, with its samples in the order of the values."""

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


@dataclass(frozen=True)
class Axis:
    """One quantity that is varied.

    of: the scene, or what else the values have in common
    values: of the quantity; each repeat begins with another one, so that none is always measured after the same one
    measure: (value, repeat) -> figures by name, which may differ between repeats, such as times; None: there are none
    facts: value -> what is the same in every repeat; found on all cores
    cost: s, about, of the facts of a value
    """

    name: str
    of: str
    values: tuple[Any, ...]
    measure: Callable[[Any, int], Mapping[str, float]] | None = None
    facts: Callable[[Any], dict[Any, Any]] | None = None
    cost: float = 1.0


@dataclass(frozen=True)
class Fact:
    """The facts of one value, as a job."""

    axis: Axis
    value: Any
    key: str = ""  # it is not kept

    @property
    def cost(self) -> float:
        return self.axis.cost

    @faults_in_results()
    def find(self) -> dict[Any, Any]:
        return {} if self.axis.facts is None else self.axis.facts(self.value)


def run(axes: Sequence[Axis], repeats: int = 1, progress: Progress = NO_PROGRESS) -> Result:
    """Measure these axes: the times one after the other, then the facts."""
    taken = [_measured(axis, repeats, progress) for axis in axes]
    facts = [Fact(axis, value) for axis in axes if axis.facts is not None for value in axis.values]
    found = iter(Jobs(None, progress=progress).all(Fact.find, facts, "facts"))
    lines = []
    for axis, figures in zip(axes, taken, strict=True):
        samples = [
            Sample(value, {name: Spread.of(all_of) for name, all_of in figures[value].items()},
                   {} if axis.facts is None else next(found))
            for value in axis.values
        ]  # fmt: skip
        lines.append(Line(axis.name, axis.of, samples))
    return Result(machine(), repeats, lines)


def _measured(axis: Axis, repeats: int, progress: Progress) -> dict[Any, dict[str, list[float]]]:
    """The figures by value and name, one for each repeat."""
    taken: dict[Any, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    if axis.measure is None:
        return taken
    progress.begin(repeats * len(axis.values))
    for repeat in range(repeats):
        first = repeat % len(axis.values)
        for value in (*axis.values[first:], *axis.values[:first]):
            progress.say(f"{axis.name} {value}, repeat {repeat + 1} of {repeats}")
            with no_garbage_collection():
                figures = axis.measure(value, repeat)
            for name, figure in figures.items():
                taken[value][name].append(figure)
            progress.advance(1)
    return taken


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
