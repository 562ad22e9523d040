"""The cost of several settings of one world, measured side by side.

All worlds start alike and alternate in short blocks, with another one first each time, so that background load affects
all of them. The work of the blocks is counted too, which is independent of the machine.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial

from ....framework import World
from ...engines.cost import counts_of, work_of
from ...measure.timing import no_garbage_collection, timed

BLOCKS = 5  # of the timed span: the worlds alternate this many times
ENOUGH = 0.03  # s of processor time for the first world per repeat: shorter spans are repeated until then
WARM_UP = 2  # steps, not timed
ATTEMPTS = 5  # to time a span in which no kernel is compiled or loaded

Play = Callable[[World, float], float]


@dataclass(frozen=True)
class Cost:
    """Cost per simulated second: processor time in s, and the weighted counts of :mod:`carom.lab.engines.cost`."""

    seconds: float
    work: float


def steps(world: World, seconds: float) -> float:
    """Take the number of whole steps closest to ``seconds``; returns the seconds simulated."""
    count = max(1, round(seconds / world.settings.dt))
    for _ in range(count):
        world.step()
    return count * world.settings.dt


def costs(
    makes: Sequence[Callable[[], World]], seconds: float, repeats: int, play: Play = steps
) -> Iterator[list[Cost]]:
    """The cost of each world from its start, repeat by repeat.

    play: advances a world by that many seconds and returns the seconds actually simulated.
    """
    with no_garbage_collection():
        for repeat in range(repeats):
            yield _repeat(makes, seconds, repeat, play)


def _repeat(makes: Sequence[Callable[[], World]], seconds: float, first: int, play: Play) -> list[Cost]:
    """Means over as many spans as needed for ENOUGH."""
    spans: list[list[Cost]] = []
    while sum(span[0].seconds for span in spans) * seconds < ENOUGH:
        span, undisturbed = _span(makes, seconds, first + len(spans), play)
        for _ in range(ATTEMPTS - 1):
            if undisturbed:
                break
            span, undisturbed = _span(makes, seconds, first + len(spans), play)
        spans.append(span)
    return [
        Cost(sum(cost.seconds for cost in of) / len(of), of[0].work) for of in zip(*spans, strict=True)
    ]


def _span(
    makes: Sequence[Callable[[], World]], seconds: float, first: int, play: Play
) -> tuple[list[Cost], bool]:
    """All worlds once, alternating; False if a kernel was compiled or loaded meanwhile."""
    count = len(makes)
    spent, passed, undisturbed = [0.0] * count, [0.0] * count, True
    with ExitStack() as stack:
        worlds = [stack.enter_context(make()) for make in makes]
        for world in worlds:
            steps(world, WARM_UP * world.settings.dt)
        before = [_counts(world) for world in worlds]
        for block in range(BLOCKS):
            for turn in range(count):
                place = (first + block + turn) % count
                took, counts, there = timed(partial(play, worlds[place], seconds / BLOCKS))
                spent[place] += took
                passed[place] += there
                undisturbed &= counts
        done = [
            work_of({name: amount - earlier[name] for name, amount in _counts(world).items()})
            for world, earlier in zip(worlds, before, strict=True)
        ]
    return [Cost(s / p, w / p) for s, p, w in zip(spent, passed, done, strict=True)], undisturbed


def _counts(world: World) -> Mapping[str, float]:
    return counts_of(world)
