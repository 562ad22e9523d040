"""Growth of the time per body with the number of bodies, measured with the gas; what it takes to set up so many.

With perfect scaling the nanoseconds per body and step are constant; cache misses and deeper trees increase them.
"""

from __future__ import annotations

import contextlib
import tracemalloc
from collections.abc import Iterator
from dataclasses import dataclass

from ....components import RigidBody, SphereCollider, Transform
from ....framework import World
from ....plugins import Physics
from ....scenes import gas
from ...bench.report import digits, span
from ...bench.results import machine
from ...measure.timing import Spread, no_garbage_collection, timed
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
    """One size: nanoseconds per body per step, and the ratio to the first size.

    set_up
        s, to create the bodies from arrays and to take the first step
    memory
        bytes per body, after that step
    """

    bodies: int
    steps: int
    nanoseconds: Spread
    growth: float
    set_up: Spread
    memory: float


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
    set_up: dict[int, list[float]] = {n: [] for n in sizes}
    progress.begin(sum(_steps(n, body_steps) * n for n in sizes) * repeats)
    for repeat in range(repeats):
        for n in sizes:
            progress.say(f"gas2d {n:,}, repeat {repeat + 1} of {repeats}")
            found[n].append(_time(n, repeat, _steps(n, body_steps)))
            set_up[n].append(_set_up(n, repeat))
            progress.advance(_steps(n, body_steps) * n)
    spreads = {n: Spread.of(values) for n, values in found.items()}
    first = spreads[sizes[0]].median
    points = [
        Point(n, _steps(n, body_steps), spread, spread.median / first, Spread.of(set_up[n]), _memory(n))
        for n, spread in spreads.items()
    ]
    return Scaling("gas2d", machine(), repeats, points)


def _steps(n: int, body_steps: int) -> int:
    return min(MOST_STEPS, max(FEWEST_STEPS, body_steps // n))


def _time(n: int, seed: int, steps: int) -> float:
    """Nanoseconds per body and step."""
    with contextlib.closing(gas.gas2d(seed=seed, n=n)) as world:
        return nanoseconds_per_step(world, f"gas2d {n:,}", steps) / n


@contextlib.contextmanager
def _created(n: int, seed: int) -> Iterator[World]:
    """A world with the discs of the gas, that has taken one step."""
    positions, velocities = gas.initial_state(n, 2, seed)
    with contextlib.closing(World(Physics(dimensions=2, gravity=(0.0, 0.0)))) as world:
        world.create_entities(
            n,
            Transform.many(positions),
            RigidBody.many(linear_velocity=velocities, mass=gas.BODY_VOLUME[2]),
            SphereCollider.many(radius=gas.RADIUS, restitution=1.0),
        )
        world.step()
        yield world


def _set_up(n: int, seed: int) -> float:
    """Seconds."""

    def create() -> None:
        with _created(n, seed):
            pass

    with no_garbage_collection():
        return timed(create)[0] - timed(lambda: gas.initial_state(n, 2, seed))[0]


def _memory(n: int) -> float:
    """Bytes per body."""
    gas.initial_state(n, 2)  # what it loads is not of the world
    tracemalloc.start()
    with _created(n, 0):
        held, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return held / n


def table(result: Scaling) -> TextTable:
    """The series as a table."""
    cells = []
    for point in result.points:
        ns = point.nanoseconds
        per_step = digits(ns.median * point.bodies * 1e-6)
        setting_up = digits(point.set_up.median), f"{point.memory:.0f}"
        cells.append((f"{point.bodies:,}", digits(ns.median), span(ns), per_step, f"{point.growth:.2f}", *setting_up))
    title = f"{result.scene}: ns per body per step, medians of {result.repeats}"
    first, last, target = TARGET
    grown = result.grown(first, last)
    if grown is not None:
        title += f"; from {first:,} to {last:,} bodies times {grown:.2f}, target at most {target:g}"
    heads = ("bodies", "ns", "from .. to", "ms per step", "growth", "set up, s", "bytes a body")
    return TextTable(title, heads, cells, words=0)
