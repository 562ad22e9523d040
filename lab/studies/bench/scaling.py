"""Growth of the time per body with the number of bodies, measured with the gas.

With perfect scaling the nanoseconds per body and step are constant; cache misses and deeper trees increase them.
"""

from __future__ import annotations

import contextlib
from dataclasses import dataclass

from ....scenes import gas
from ...bench.report import digits, span
from ...bench.results import machine
from ...measure.timing import Spread
from ...plain import Plain
from ...reporting.progress import NO_PROGRESS, Progress
from ...reporting.text_tables import TextTable
from .step_time import nanoseconds_per_step

SIZES = (1000, 3000, 10_000, 30_000, 100_000)
LARGEST = 1_000_000
BODY_STEPS = 1_500_000  # per repeat: about the same time at every size
FEWEST_STEPS, MOST_STEPS = 10, 1500
TARGET = (10_000, 100_000, 2.5)  # from, to, largest allowed growth of the time per body


@dataclass
class Point(Plain):
    """One size: nanoseconds per body per step, and the ratio to the first size."""

    bodies: int
    steps: int
    nanoseconds: Spread
    growth: float


@dataclass
class Scaling(Plain):
    """The whole series."""

    scene: str
    machine: dict[str, str]
    repeats: int
    points: list[Point]

    def grown(self, first: int, last: int) -> float | None:
        """The time per body at ``last`` over that at ``first``; None if either was not measured."""
        by_size = {point.bodies: point.nanoseconds.median for point in self.points}
        return by_size[last] / by_size[first] if first in by_size and last in by_size else None


def scaling(
    sizes: tuple[int, ...] = SIZES, repeats: int = 3, progress: Progress = NO_PROGRESS, body_steps: int = BODY_STEPS
) -> Scaling:
    """Time the gas at each size, all sizes once per repeat, with another seed in each repeat."""
    sizes = tuple(sorted(set(sizes)))
    found: dict[int, list[float]] = {n: [] for n in sizes}
    progress.begin(sum(_steps(n, body_steps) * n for n in sizes) * repeats)
    for repeat in range(repeats):
        for n in sizes:
            progress.say(f"gas2d {n:,}, repeat {repeat + 1} of {repeats}")
            found[n].append(_time(n, repeat, _steps(n, body_steps)))
            progress.advance(_steps(n, body_steps) * n)
    spreads = {n: Spread.of(values) for n, values in found.items()}
    first = spreads[sizes[0]].median
    points = [Point(n, _steps(n, body_steps), spread, spread.median / first) for n, spread in spreads.items()]
    return Scaling("gas2d", machine(), repeats, points)


def _steps(n: int, body_steps: int) -> int:
    return min(MOST_STEPS, max(FEWEST_STEPS, body_steps // n))


def _time(n: int, seed: int, steps: int) -> float:
    """Nanoseconds per body and step."""
    with contextlib.closing(gas.gas2d(seed=seed, n=n)) as world:
        return nanoseconds_per_step(world, f"gas2d {n:,}", steps) / n


def table(result: Scaling) -> TextTable:
    """The series as a table."""
    cells = []
    for point in result.points:
        ns = point.nanoseconds
        per_step = digits(ns.median * point.bodies * 1e-6)
        cells.append((f"{point.bodies:,}", digits(ns.median), span(ns), per_step, f"{point.growth:.2f}"))
    title = f"{result.scene}: ns per body per step, medians of {result.repeats}"
    first, last, target = TARGET
    grown = result.grown(first, last)
    if grown is not None:
        title += f"; from {first:,} to {last:,} bodies times {grown:.2f}, target at most {target:g}"
    return TextTable(title, ("bodies", "ns", "from .. to", "ms per step", "growth"), cells, words=0)
