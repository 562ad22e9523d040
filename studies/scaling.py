"""Growth of the time per body with the number of bodies, measured with the gas; what it takes to set up so many.

With perfect scaling the nanoseconds per body and step are constant; cache misses and deeper trees increase them.
"""

from __future__ import annotations

import tracemalloc
from functools import partial

from carom.framework import World
from carom.lab.measure.timing import timed
from carom.lab.reporting.text import TextTable, compact, span
from carom.scenes import gas

from .runner import Axis, Result, nanoseconds_per_step

SIZES = (1000, 3000, 10_000, 30_000, 100_000, 1_000_000)  # the last one needs a gigabyte
BODY_STEPS, FEWEST_STEPS, MOST_STEPS = 1_500_000, 10, 1500  # per repeat: about the same time at every size


def _created(n: int, seed: int) -> World:
    """The gas after one step."""
    world = gas.gas2d(seed=seed, n=n)
    world.step()
    return world


def _time(n: int, seed: int) -> dict[str, float]:
    """Nanoseconds per body and step; seconds of creating the world with its first step. With another seed each."""
    steps = min(MOST_STEPS, max(FEWEST_STEPS, BODY_STEPS // n))
    ns = nanoseconds_per_step(partial(gas.gas2d, seed=seed, n=n), f"gas2d {n:,}", steps) / n
    drawn = timed(partial(gas.initial_state, n, 2, seed))[0]
    seconds, _, world = timed(partial(_created, n, seed))
    world.close()
    return {"ns": ns, "set up": seconds - drawn}


def _facts(n: int) -> dict[str, float]:
    """Bytes per body."""
    gas.initial_state(n, 2)  # what it loads is not of the world
    tracemalloc.start()
    with _created(n, 0):
        held, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return {"memory": held / n}


def axes(quick: bool = False) -> list[Axis]:
    """The number of bodies."""
    return [Axis("bodies", "gas2d", SIZES[:3] if quick else SIZES, _time, _facts)]


def report(result: Result) -> tuple[list[TextTable], list[str]]:
    """The series as a table."""
    (line,) = result.lines
    least = line.samples[0].figures["ns"].median
    cells = [
        (
            f"{sample.value:,}", compact(ns.median), span(ns), compact(ns.median * sample.value * 1e-6),
            f"{ns.median / least:.2f}", compact(sample.figures["set up"].median), f"{sample.facts['memory']:.0f}",
        )
        for sample in line.samples if (ns := sample.figures["ns"])
    ]  # fmt: skip
    heads = ("bodies", "ns", "from .. to", "ms per step", "growth", "set up, s", "bytes a body")
    return [TextTable(f"{line.of}: ns per body per step, medians of {result.repeats}", heads, cells, words=0)], []
