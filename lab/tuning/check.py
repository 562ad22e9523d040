"""Check of tuned settings on scenes that were not used in the search."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ...framework import Settings
from ..cases.case import Case, case_of
from ..jobs.result_store import Store
from ..jobs.runs import Runs, points_of
from ..jobs.workers import Pool
from ..reporting.progress import NO_PROGRESS, Progress
from ..trading.records import Cell, Point, Reference
from .search import Tuning, enough_repeats, exact_enough

TOLERATED = 2.0  # times the promised error: beyond it a warning is shown


@dataclass
class Check:
    """The result of tuned settings on another scene.

    promise
        the promised error; ``scale``: what it is relative to, in the scene's units; refused: why nothing was measured,
        else ""
    """

    scene: str
    norm: str
    promise: float
    scale: float = 1.0
    seconds: float = 0.0
    repeated: str = ""
    reference: Reference = dataclasses.field(default_factory=lambda: Reference(""))
    point: Point | None = None
    refused: str = ""

    @property
    def error(self) -> float:
        """The worst of all repeats, relative to the scale; inf if one failed or nothing was measured."""
        if self.point is None or self.point.failed:
            return math.inf
        return self.point.errors[self.norm].high

    @property
    def times(self) -> float:
        """The error over the promise."""
        return self.error / self.promise

    @property
    def tolerated(self) -> bool:
        """True if the error is at most twice the promise."""
        return self.times <= TOLERATED


def check(
    tuning: Tuning,
    target: Any,
    *,
    absolute: bool = False,
    seconds: float | None = None,
    repeats: int | None = None,
    options: Mapping[str, Any] | None = None,
    seed: int = 0,
    workers: int | Pool | None = None,
    store: Store | None = None,
    progress: Progress = NO_PROGRESS,
) -> Check:
    """Measure the settings that ``tuning`` chose on a scene that they were not tuned on, by the same norm.

    target, options, seed, workers, store: as of :func:`carom.lab.trade`. seconds, repeats: as of the search if None.
    absolute: the promise is in the scene's units, else relative to the new scene's scale. All fields of the chosen
    settings are used, whatever the scene recommends. NothingMeetsError if the search found none; Problem for a scene
    that cannot be measured in this way.
    """
    settings = tuning.settings
    runs = Runs(workers, store, progress)
    case = case_of(
        target, norms=(tuning.norm,), seconds=tuning.seconds if seconds is None else seconds,
        repeats=tuning.repeats if repeats is None else repeats, options=options, seed=seed, each=runs.each,
    )  # fmt: skip
    case = case.replace(survey=dataclasses.replace(case.survey, settings=settings))
    promise = tuning.target * tuning.scale if absolute else tuning.target
    case, reference = exact_enough(case, tuning.norm, promise, absolute, runs)
    scale = case.scale(tuning.norm)
    promise = promise / scale if absolute else promise
    case = enough_repeats(case, tuning.norm, reference.spread.get(tuning.norm, 0.0), promise)
    return Check(
        case.subject.name, tuning.norm, promise, scale, case.seconds, case.repeated, reference,
        measured_with(case, settings, runs),
    )  # fmt: skip


def measured_with(case: Case, settings: Settings, runs: Runs) -> Point:
    """The point of these settings over all repeats of a case; fields that no cell has keep the scene's values."""
    cell = Cell.of(settings)
    (point,) = points_of(case, [cell], runs, f"{case.subject.name}: {case.repeats_text}")
    return point
