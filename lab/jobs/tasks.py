"""One run as a worker performs it: input is a case, a cell and a repeat; output is what the run showed."""

from __future__ import annotations

import dataclasses
import hashlib
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...framework import World
from ..cases.case import Case
from ..commands.usage_errors import Problem
from ..engines.adapters import CaromEngine, Engine, engine_for
from ..engines.body_arrays import NotPlainError
from ..measure.norms import NORMS, errors_of, failure_of
from ..measure.observation import Seen, observe
from ..measure.survey import NUDGE, nudge
from ..measure.told_in_results import faults_in_results
from ..trading.records import CHAOTIC, PYMUNK, RESTING, STOPPED, Cell, Outcome

FIRST_REFERENCE_SEED = 1000  # own references of chaotic scenes use other seeds than the runs compared with them


@dataclass(frozen=True)
class Task:
    """One run. reference: it is one of the case's own references, whose full observation is kept."""

    case: Case
    cell: Cell
    repeat: int
    reference: bool = False

    @property
    def key(self) -> str:
        """Identifies the run, in this process and later ones."""
        case = self.case
        facts = (
            case.subject.mark, case.seconds, case.kind, repr(case.survey.settings), self.reference, self.cell.key,
            self.repeat,
        )  # fmt: skip
        if not self.reference:
            facts = (*facts, case.repeats, case.form, tuple(cell.key for cell in case.reference_cells))
        return hashlib.sha256(repr(facts).encode()).hexdigest()[:24]

    @property
    def cost(self) -> float:
        """Steps, for the progress bar."""
        return self.case.seconds / self.cell.dt


@faults_in_results()
def perform(task: Task) -> dict[str, Any]:
    """Perform the run and return its observation as plain data. A run stopped by an error is a result too."""
    case, cell = task.case, task.cell
    try:
        seen = _run(task)
    except Problem as problem:
        if task.reference or cell.engine == PYMUNK:
            raise
        return dataclasses.asdict(Outcome(cell, task.repeat, {}, STOPPED, {}, case.seconds, problem.message))
    if task.reference:
        return seen.as_dict()
    assert case.reference is not None
    failure = failure_of(seen, None if case.kind == CHAOTIC else case.reference)
    errors = {} if failure else errors_of(seen, case.reference, NORMS)
    return dataclasses.asdict(Outcome(cell, task.repeat, errors, failure, seen.counts, seen.simulated))


def _run(task: Task) -> Seen:
    engine = engine_of(task.case, task.cell, task.repeat + FIRST_REFERENCE_SEED * task.reference)
    try:
        with task.case.subject.attribute_errors():
            case = task.case
            phase = case.phase(task.repeat)
            whole, walled = case.kind == RESTING, case.survey.walled
            return observe(engine, case.seconds, task.cell.dt, phase, whole, walled)
    finally:
        engine.close()


def world_of(case: Case, cell: Cell, repeat: int) -> World:
    """The world of that repeat at its start."""
    seed = case.subject.seed + (repeat if case.kind == CHAOTIC else 0)
    world = case.subject.world(cell.settings(case.survey.settings), seed)
    if case.kind == CHAOTIC and not case.survey.seeded:
        nudge(world, 1e3 * NUDGE * CaromEngine(world).size, repeat)
    return world


def engine_of(case: Case, cell: Cell, repeat: int) -> Engine:
    """An engine at the start of that repeat; Problem if pymunk cannot represent the scene."""
    if cell.engine == PYMUNK:
        cell_of_carom = dataclasses.replace(cell, integrator=case.survey.settings.integrator)
        world = world_of(case, cell_of_carom, repeat)
    else:
        world = world_of(case, cell, repeat)
    try:
        return engine_for(world, cell.engine, cell.substeps)
    except NotPlainError as error:
        world.close()
        raise Problem(f"{case.subject.name} cannot be given to pymunk: {error}") from error


def mean_of(seens: list[Seen]) -> Seen:
    """The averaged statistics of several runs; all other fields are those of the first."""
    signed = [name for name, norm in NORMS.items() if norm.signed]
    means = {name: float(np.mean([getattr(seen, name) for seen in seens])) for name in signed}
    return dataclasses.replace(seens[0], **means)
