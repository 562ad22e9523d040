"""One run as a worker performs it: input is a case, a cell and a repeat; output is what the run showed."""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...framework import World
from ..cases.case import Case
from ..cli.usage_errors import Problem
from ..engines.adapters import CaromEngine, Engine, engine_for
from ..engines.pymunk_space import NotPlainError
from ..measure.norms import FAR
from ..measure.observation import Seen, observe
from ..measure.survey import nudge
from ..measure.timing import faults_in_results, timed
from ..trading.records import CHAOTIC, PYMUNK, RESTING, STOPPED, Cell

BRIEF, AWHILE, PASSES = 0.1, 0.2, (2, 12)  # s; passes of a run that is timed, at least and at most
BLOCK = 20  # steps
FIRST_REFERENCE_SEED = 1000  # own references of chaotic scenes use other seeds than the runs compared with them


@dataclass(frozen=True)
class Task:
    """One run.

    reference: it is one of the case's own references; sampled: inputs act in whole steps, as in the game; bare: it is
    timed without observation too.
    """

    case: Case
    cell: Cell
    repeat: int
    reference: bool = False
    sampled: bool = False
    bare: bool = False

    @property
    def key(self) -> str:
        """Identifies the run, in this process and later ones."""
        case = self.case
        facts = (
            case.subject.mark, case.seconds, case.kind, repr(case.survey.settings), case.survey.walled, self.reference,
            self.cell.key, self.repeat, self.sampled, case.survey.inputs,
        )  # fmt: skip
        return hashlib.sha256(repr(facts).encode()).hexdigest()[:24]

    @property
    def steps(self) -> float:
        """For the progress bar."""
        return self.case.seconds / self.cell.dt


@faults_in_results()
def perform(task: Task) -> dict[str, Any]:
    """Perform the run and return its observation as plain data. A run stopped by an error is a result too."""
    try:
        cost = bare_cost(task) if task.bare and task.cell.engine != PYMUNK else None
        found = _observed(task).as_dict()
        return found if cost is None else {**found, "milliseconds": cost}
    except Problem as problem:
        if task.reference or task.cell.engine == PYMUNK:
            raise
        return stopped(task, problem.message).as_dict()


def stopped(task: Task, why: str) -> Seen:
    """The observation of a run that an error ended."""
    return Seen(np.zeros((0, 2)), failure=STOPPED, detail=why, seconds=task.case.seconds)


def bare_cost(task: Task) -> float | None:
    """Milliseconds per simulated second without observation, which takes longer than a cheap step: the least of some
    passes. None for a run that takes longer than AWHILE: there the observed run tells enough."""
    passes: list[float] = []
    whole, loaded = 0.0, task.case.subject.loaded
    while len(passes) < PASSES[0] or (whole < BRIEF and len(passes) < PASSES[1]):
        with loaded.attribute_errors(), contextlib.closing(world_of(task.case, task.cell, 0)) as world:
            spent = simulated = 0.0
            world.step()  # the first one prepares what all others use
            left = max(int(task.case.seconds / task.cell.dt) - 1, 1)
            while left:
                count = min(BLOCK, left)
                left -= count
                seconds, valid, _ = timed(lambda world=world, count=count: [world.step() for _ in range(count)])
                whole += seconds
                if valid:
                    spent, simulated = spent + seconds, simulated + count * task.cell.dt
                if whole > AWHILE:
                    return min(passes, default=None)
        if simulated:
            passes.append(1e3 * spent / simulated)
        else:
            break  # each of its blocks waited for kernels
    return min(passes, default=None)


def _observed(task: Task) -> Seen:
    engine = engine_of(task.case, task.cell, task.repeat + FIRST_REFERENCE_SEED * task.reference)
    try:
        with task.case.subject.loaded.attribute_errors():
            case = task.case
            phase = case.phase(task.repeat)
            whole, walled = case.kind == RESTING, case.survey.walled
            far = math.inf if case.kind == CHAOTIC else FAR * case.survey.trial.reach or math.inf
            inputs, values = () if task.sampled else case.survey.inputs, case.subject.loaded.values_of
            return observe(engine, case.seconds, task.cell.dt, phase, whole, walled, far, inputs, values)
    finally:
        engine.close()


def world_of(case: Case, cell: Cell, repeat: int) -> World:
    """The world of that repeat at its start."""
    seed = case.subject.seed + (repeat if case.kind == CHAOTIC else 0)
    world = case.subject.world(cell.settings(case.survey.settings), seed)
    if case.kind == CHAOTIC and not case.survey.seeded:
        nudge(world, case.survey.nudge * CaromEngine(world).size, repeat)
    return world


def engine_of(case: Case, cell: Cell, repeat: int) -> Engine:
    """An engine at the start of that repeat; Problem if pymunk cannot represent the scene."""
    if cell.engine == PYMUNK:
        if case.subject.names or "order" in case.norms:
            raise Problem(f"{case.subject.name} cannot be given to pymunk, which runs no systems and tells no order")
        cell_of_carom = dataclasses.replace(cell, integrator=case.survey.settings.integrator)
        world = world_of(case, cell_of_carom, repeat)
    else:
        world = world_of(case, cell, repeat)
    try:
        return engine_for(world, cell.engine, cell.substeps)
    except NotPlainError as error:
        world.close()
        raise Problem(f"{case.subject.name} cannot be given to pymunk: {error}") from error
