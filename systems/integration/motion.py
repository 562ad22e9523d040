"""Motion: the dynamic bodies' columns through one step, as integrators see them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...framework.jit.records.record import Record
from ...framework.schedule.stages import Program
from .turns import ROTATION_STAGES


@dataclass
class Motion:
    """Views of the dynamic rows; position and velocity hold the state that forces are evaluated at.

    position, velocity, force, start_position, start_velocity (n, d); inverse_mass, damping (n,).
    """

    position: np.ndarray
    velocity: np.ndarray
    force: np.ndarray
    inverse_mass: np.ndarray
    damping: np.ndarray
    start_position: np.ndarray
    start_velocity: np.ndarray
    evaluator: Callable[[float], None] | None  # None: no force depends on the state
    program: Program | None = None  # with the stages of the built-in integrators
    turn: Callable[[int, float], None] | None = None  # beside such a stage; None: torques hold throughout the step

    @property
    def arrays(self) -> tuple[np.ndarray, ...]:
        return self.position, self.velocity, self.force, self.inverse_mass, self.damping

    @property
    def force_changes(self) -> bool:
        """Whether some force depends on position, velocity or time; else the forces of the start hold throughout."""
        return self.evaluator is not None

    def evaluate(self, seconds: float) -> None:
        """Sum the forces again at the state in the columns, ``seconds`` into the step."""
        if self.evaluator is not None:
            self.evaluator(seconds)

    @property
    def state(self) -> Record:
        """The record that the stages work on."""
        assert self.program is not None
        return self.program.state

    def run(self, stage: str, h: float) -> None:
        """Run a stage of a built-in integrator over ``h`` seconds, and turn bodies beside it."""
        assert self.program is not None
        if self.turn is not None and stage in ROTATION_STAGES:
            self.turn(ROTATION_STAGES[stage], h)
        self.program.run_one(stage, h)
