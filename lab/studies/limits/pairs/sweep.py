"""The random sweep: all scenes of a seed, on all cores, and the record of what became of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass

from ....bench.results import machine
from ....jobs.workers import Lost, in_parallel
from ....plain import Plain
from ....reporting.progress import NO_PROGRESS, Progress
from .axes import PAIRS, ROUND, Draw
from .scenes import Outcome, played

SCENES, QUICK_SCENES = 10_000, 2 * ROUND
BATCH = len(PAIRS)  # scenes per task: each pair of axes once


@dataclass(frozen=True)
class Batch:
    """Scenes of one task."""

    seed: int
    numbers: tuple[int, ...]


@dataclass
class PairLimits(Plain):
    """A whole sweep, with the machine and versions it ran on; outcomes in the order of their numbers."""

    machine: dict[str, str]
    seed: int
    outcomes: list[Outcome]

    def draws(self) -> list[Draw]:
        """The scenes, in the order of the outcomes."""
        return [Draw.of(self.seed, outcome.number) for outcome in self.outcomes]


def pair_limits(
    scenes: int = SCENES, seed: int = 0, workers: int | None = None, progress: Progress = NO_PROGRESS
) -> PairLimits:
    """Play scenes 0 ... scenes - 1 of the seed; workers: processes, None for one a core.

    ValueError if there is no scene to play.
    """
    if isinstance(scenes, bool) or not isinstance(scenes, int) or scenes < 1:
        raise ValueError(f"pair_limits: scenes must be a whole number from 1, got {scenes!r}")
    progress.begin(scenes)
    progress.say("short scenes")
    batches = [Batch(seed, tuple(range(first, min(first + BATCH, scenes)))) for first in range(0, scenes, BATCH)]
    outcomes = _outcomes(batches, workers, progress)
    return PairLimits(machine(), seed, sorted(outcomes, key=lambda outcome: outcome.number))


def play_batch(batch: Batch) -> list[Outcome]:
    """Play all scenes of a batch."""
    return [played(Draw.of(batch.seed, number)) for number in batch.numbers]


def _outcomes(batches: Sequence[Batch], workers: int | None, progress: Progress) -> Iterable[Outcome]:
    """The outcomes as they arrive. A scene that ends its process is found by playing its batch one by one."""
    alone: list[Batch] = []
    with closing(in_parallel(play_batch, batches, workers)) as results:
        for batch, found in results:
            if not isinstance(found, Lost):
                progress.advance(len(batch.numbers))
                yield from found
            elif len(batch.numbers) == 1:
                progress.advance(1)
                yield Outcome(batch.numbers[0], refused=f"crash: {found.reason}", broken=0)
            else:
                alone += [Batch(batch.seed, (number,)) for number in batch.numbers]
    if alone:
        yield from _outcomes(alone, workers, progress)
