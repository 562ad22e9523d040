"""A small honest benchmark: the elastic gas, in nanoseconds per body per step, compile time apart.

Each run starts from another seed: timing one state again and again trains the processor's branch prediction
and flatters.
"""

from __future__ import annotations

import contextlib
import dataclasses
import gc
import statistics
import time
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from ..framework.compilation import log
from ..scenes import gas

WARM_UP_STEPS = 10
BODY_STEPS = 600_000  # per run: about as long for few bodies as for many


@dataclass(frozen=True)
class Timing:
    """Per body and step in nanoseconds: the median of the runs, the fastest and the slowest."""

    scene: str
    bodies: int
    steps: int
    nanoseconds: float
    fastest: float
    slowest: float
    compile_seconds: float

    @property
    def milliseconds(self) -> float:
        """The median run's time per step."""
        return self.nanoseconds * self.bodies * 1e-6

    def as_dict(self) -> dict[str, Any]:
        return {**dataclasses.asdict(self), "milliseconds": self.milliseconds}


def bench_gas(sizes: Iterable[int], repeats: int = 5) -> list[Timing]:
    """Time ``world.step()`` of the 2D gas per number of bodies; ``repeats`` runs each, other seeds."""
    return [_bench_one(n, repeats) for n in sizes]


def _bench_one(n: int, repeats: int) -> Timing:
    compiled = log.seconds
    steps = max(20, BODY_STEPS // n)
    nanoseconds = []
    for seed in range(repeats):
        with contextlib.closing(gas.gas2d(seed=seed, n=n)) as world:
            for _ in range(WARM_UP_STEPS):
                world.step()
            gc.collect()
            started = time.perf_counter()
            for _ in range(steps):
                world.step()
            nanoseconds.append((time.perf_counter() - started) / (steps * n) * 1e9)
    return Timing(
        "gas2d",
        n,
        steps,
        statistics.median(nanoseconds),
        min(nanoseconds),
        max(nanoseconds),
        log.seconds - compiled,
    )
