"""The longest step at which nothing would be noticed in the outcome of a scene, and what gives way beyond it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from ...framework import World
from ..cases.case import QUICK, case_of
from ..cli.usage_errors import Problem
from ..jobs.runs import Runs
from ..measure.effects import SHARE, in_words, names_told, noticed
from ..plain import Plain, jsonable
from ..reporting.text import counted, metres, number
from ..trading.records import CaseTrade, Cell, Point, known_well
from ..trading.report import failures
from ..trading.trade import measured

STEPS = (8, 4, 2, 1, 1 / 2, 1 / 4, 1 / 8)  # of the scene's own, as long as they are steps of a game
LONGEST = 1 / 10  # s


@dataclass
class StepOutcome(Plain):
    """What runs with several steps have shown.

    longest
        s, of those steps from which on all shorter ones change nothing that would be noticed; 0 if there is none, inf
        if nothing was measured
    shortest
        s, of those tried; size: of a body, m
    way
        m, how far a body may be from where it should; None: a share of the size
    link
        what gives way at the next longer step, ``beyond`` s; "" if none was tried
    refused
        why nothing was measured, else ""
    compared
        the names of what a game compares
    known
        from how many runs, and what to think of them
    """

    longest: float = math.inf
    shortest: float = math.inf
    size: float = 1.0
    way: float | None = None
    link: str = ""
    beyond: float = math.inf
    refused: str = ""
    compared: tuple[str, ...] = ()
    known: str = ""

    def as_dict(self) -> dict[str, object]:
        """For JSON, which has no infinity."""
        return jsonable(super().as_dict())

    def sentences(self) -> list[str]:
        """For a person."""
        if self.refused:
            return [f"Outcome: not measured: {self.refused}"]
        lines = []
        if self.longest:
            moved = f"the step moves no body by more than {self._way()}, and nothing else is noticed"
            kept = f"nothing would be noticed in {', '.join(self.compared)}" if self.compared else moved
            lines.append(f"Outcome: up to {number(self.longest)} s {kept}.")
        if self.link:
            lines.append(f"Weakest link: at {number(self.beyond)} s {self.link}.")
        return [*lines, f"Known {self.known}."]

    def _way(self) -> str:
        if self.way is not None:
            return metres(self.way)
        return f"{metres(SHARE * self.size)}, 1 % of the smallest one's size"


def outcome_of_steps(
    build: Callable[..., World], seed: int, seconds: float, runs: Runs, thorough: bool = False, way: float | None = None
) -> StepOutcome:
    """Run the scene with its own settings and several steps; way: see :class:`StepOutcome`."""
    if not seconds:
        return StepOutcome(refused="it was not run")
    try:
        case = case_of(build, seconds=seconds, seed=seed, each=runs.each)
        own = case.survey.settings
        longest = min(LONGEST, seconds / 3)
        steps = tuple(own.dt * factor for factor in STEPS if factor <= 1 or own.dt * factor <= longest)
        case = case.replace(steps=steps, given=("steps",))
        return _outcome(measured(case, None if thorough else QUICK, [Cell.of(own).method], None, False, runs), way)
    except Problem as problem:
        return StepOutcome(refused=problem.message)


def _outcome(case: CaseTrade, way: float | None) -> StepOutcome:
    points = known_well(case.points)
    points.sort(key=lambda point: point.cell.dt)
    size = next((point.effects["size"] for point in points if point.effects), 1.0)
    found = StepOutcome(0.0, points[0].cell.dt, size, way, compared=names_told(points[0].effects))
    runs = sum(point.repeats for point in points)
    found.known = f"from {counted(runs, 'run')} of {number(case.seconds)} s with {counted(len(points), 'step')}"
    for point in points:
        if point.failed or noticed(point.effects, way):
            found.link, found.beyond = _link(point, way), point.cell.dt
            break
        found.longest = point.cell.dt
    return found


def _link(point: Point, way: float | None) -> str:
    """What would be noticed, the bodies and their places first."""
    return "; ".join([failures(point)] * point.failed + in_words(point.effects, noticed(point.effects, way)))
