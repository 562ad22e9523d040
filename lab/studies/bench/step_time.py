"""The time of a step, without those that wait for kernels."""

from __future__ import annotations

from ....framework import World
from ...cli.usage_errors import Problem
from ...measure.timing import no_garbage_collection, timed

WARM_UP_STEPS = 10


def nanoseconds_per_step(world: World, what: str, steps: int) -> float:
    """The mean over so many steps; what: names the world in the Problem if each try compiled kernels."""

    def take(count: int) -> None:
        for _ in range(count):
            world.step()

    take(WARM_UP_STEPS)
    for _ in range(2):  # kernels loaded during the first try are ready in the second
        with no_garbage_collection():
            seconds, counts, _ = timed(lambda: take(steps))
        if counts:
            return seconds / steps * 1e9
    raise Problem(f"{what}: kernels were compiled in all steps; run it once more")
