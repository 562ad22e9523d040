"""The cost of a run, in counts that are the same on every machine, and as one number.

The number is a weighted sum. Its weights are nanoseconds, measured once on one machine and fixed since (``carom bench``
and ``carom run --profile`` measure them on another). So it ranks settings identically on every machine, unlike a clock.
With few bodies the cost per step dominates, with many the cost per body.
"""

from __future__ import annotations

from collections.abc import Mapping

from ...framework import World

# ns each. A step runs Python code between kernels; an evaluation of forces calls each force system once.
WEIGHTS: Mapping[str, float] = {
    "steps": 50_000.0,
    "force_evaluations": 10_000.0,
    "body_steps": 10.0,
    "candidates": 5.0,
    "pairs": 10.0,
    "impacts": 1_000.0,
    "rounds": 50_000.0,
    "solver_loops": 4.0,
}


def counts_of(world: World) -> dict[str, float]:
    """The counts of a world since its creation, with the same substeps throughout.

    steps, force_evaluations (sums over all bodies), body_steps, candidates of the broad phase, pairs tested, impacts,
    rounds: how often candidates were searched again within a step.
    """
    counters = world.stats().counters
    return {
        "steps": float(world.step_count),
        "force_evaluations": float(counters.get("force_evaluations", 0)),
        "body_steps": float(counters.get("bodies", 0)),
        "candidates": float(counters.get("candidates", 0)),
        "pairs": float(counters.get("pairs", 0)),
        "impacts": float(counters.get("impacts", 0)),
        "rounds": float(counters.get("rounds", 0)),
        "solver_loops": float(counters.get("resting_contacts", 0) * world.settings.substeps),
    }


def work_of(counts: Mapping[str, float]) -> float:
    """The weighted sum of counts; per simulated second if the counts are."""
    return sum(WEIGHTS[name] * count for name, count in counts.items() if name in WEIGHTS)
