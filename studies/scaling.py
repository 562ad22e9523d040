"""Growth of the time per body with the number of bodies, measured with the gas; what it takes to set up so many.

With perfect scaling the nanoseconds per body and step are constant; cache misses and deeper trees increase them.
"""

from __future__ import annotations

import contextlib
import tracemalloc
from collections.abc import Iterator
from functools import partial
from typing import Any

from carom.components import RigidBody, SphereCollider, Transform
from carom.framework import World
from carom.lab.measure.timing import timed
from carom.lab.reporting.text import TextTable, compact, span
from carom.plugins import Physics
from carom.scenes import gas

from .runner import Axis, Result, nanoseconds_per_step

SIZES = (1000, 3000, 10_000, 30_000, 100_000)
LARGEST = 1_000_000
BODY_STEPS = 1_500_000  # per repeat: about the same time at every size
FEWEST_STEPS, MOST_STEPS = 10, 1500
TARGET = (10_000, 100_000, 2.5)  # from, to, largest allowed growth of the time per body
BODIES, SCENE = "bodies", "gas2d"


def axes(quick: bool = False, long: bool = False) -> list[Axis]:
    """The number of bodies."""
    return [axis(SIZES[:3] if quick else (*SIZES, *[LARGEST] * long))]


def axis(sizes: tuple[int, ...], body_steps: int = BODY_STEPS) -> Axis:
    """Time per body and step, and what it takes to create them; with another seed in each repeat."""

    def measure(n: int, repeat: int) -> dict[str, float]:
        return {"ns": _time(n, repeat, body_steps), "set up": _set_up(n, repeat)}

    return Axis(BODIES, SCENE, sizes, measure, _memory)


def _time(n: int, seed: int, body_steps: int) -> float:
    """Nanoseconds per body and step."""
    steps = min(MOST_STEPS, max(FEWEST_STEPS, body_steps // n))
    return nanoseconds_per_step(partial(gas.gas2d, seed=seed, n=n), f"{SCENE} {n:,}", steps) / n


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

    return timed(create)[0] - timed(lambda: gas.initial_state(n, 2, seed))[0]


def _memory(n: int) -> dict[str, Any]:
    """Bytes per body."""
    gas.initial_state(n, 2)  # what it loads is not of the world
    tracemalloc.start()
    with _created(n, 0):
        held, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return {"memory": held / n}


def report(result: Result) -> tuple[list[TextTable], list[str]]:
    """The series as a table."""
    samples = result.line(BODIES, SCENE).samples
    ns = {sample.value: sample.figures["ns"] for sample in samples}
    cells = []
    for sample in samples:
        n, of = sample.value, ns[sample.value]
        cells.append((
            f"{n:,}", compact(of.median), span(of), compact(of.median * n * 1e-6),
            f"{of.median / ns[samples[0].value].median:.2f}", compact(sample.figures["set up"].median),
            f"{sample.facts['memory']:.0f}",
        ))  # fmt: skip
    title = f"{SCENE}: ns per body per step, medians of {result.repeats}"
    first, last, target = TARGET
    if first in ns and last in ns:
        grown = ns[last].median / ns[first].median
        title += f"; from {first:,} to {last:,} bodies times {grown:.2f}, target at most {target:g}"
    heads = ("bodies", "ns", "from .. to", "ms per step", "growth", "set up, s", "bytes a body")
    return [TextTable(title, heads, cells, words=0)], []
