"""What a physics plugin provides to a world: the framework knows only this interface, never the implementation."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import Any

import numpy as np

from ..data.adoption import Adoption
from ..data.bodies import Bodies
from ..data.table import Table
from ..schedule.plan import PlannedColumn, PlannedKernel
from ..schedule.stages import Program
from .contacts import Contacts
from .hits import CastHits, Hits, NearestHits, Neighbours


class QueryServices(ABC):
    """Answers to the queries of ``world``, which has checked the arguments: arrays are contiguous, of right shape."""

    @abstractmethod
    def sphere(self, centre: tuple[float, ...], radius: float, mask: int) -> list[int]:
        """What touches one sphere, by id."""

    @abstractmethod
    def box(self, lower: tuple[float, ...], upper: tuple[float, ...], mask: int) -> list[int]:
        """What touches one box, by id."""

    @abstractmethod
    def spheres(self, centres: np.ndarray, radii: np.ndarray, mask: int) -> Hits:
        """What touches each sphere."""

    @abstractmethod
    def boxes(self, lower: np.ndarray, upper: np.ndarray, mask: int) -> Hits:
        """What touches each box."""

    @abstractmethod
    def nearest(self, points: np.ndarray, limits: np.ndarray, mask: int, excluded: np.ndarray) -> NearestHits:
        """The surface nearest to each point."""

    @abstractmethod
    def neighbours(self, radius: float, mask: int, askers: np.ndarray | None) -> Neighbours:
        """Which bodies are within the radius of each asker; of all bodies if None."""

    @abstractmethod
    def rays(
        self, origins: np.ndarray, directions: np.ndarray, limits: np.ndarray, mask: int, excluded: np.ndarray,
        only_nearest: bool,
    ) -> CastHits:  # fmt: skip
        """What rays meet: the nearest, a row for each ray; or everything on one ray, in order."""

    @abstractmethod
    def shapes(
        self, component: type[Any], columns: dict[str, np.ndarray], positions: np.ndarray, displacements: np.ndarray,
        mask: int, excluded: np.ndarray, only_nearest: bool,
    ) -> CastHits:  # fmt: skip
        """What moving shapes meet: the nearest, a row for each shape; or everything that one shape meets, in order."""

    @abstractmethod
    def forget(self) -> None:
        """The next query builds its trees again."""


class PhysicsServices(ABC):
    """The state behind ``world.bodies``, ``world.contacts``, energies and queries, and the stages of a step.

    program
        the stages of all built-in systems
    parts_version
        changes whenever a system consists of other parts
    """

    dimensions: int
    table: Table
    adoption: Adoption
    bodies: Bodies
    contacts: Contacts
    gravity: np.ndarray
    queries: QueryServices
    program: Program
    parts_version: int

    @abstractmethod
    def set_gravity(self, gravity: Any) -> None: ...

    @abstractmethod
    def check_settings(self, settings: Any) -> None:
        """ValueError if the settings name something that no plugin has."""

    @abstractmethod
    def take_settings(self, settings: Any) -> None:
        """Follow these settings from the next step on."""

    # -- a step -----------------------------------------------------------------------------------

    @abstractmethod
    def begin_step(self, others_write: bool) -> None:
        """The table is in step with esper; refresh what depends on its structure and keep what a failed step puts back.

        others_write: whether code that is not carom's runs in the step, and may write any column.
        """

    @abstractmethod
    def opening(self) -> list[Any]:
        """The parts of a step before all systems."""

    @abstractmethod
    def closing(self) -> list[Any]:
        """The parts of a step after all systems."""

    @abstractmethod
    def abandon_step(self) -> None:
        """The step failed: put everything back to its start."""

    @abstractmethod
    def end_step(self) -> None: ...

    @abstractmethod
    def end_window(self) -> None:
        """The last step of a ``step()`` or ``advance()`` is over: forces applied from outside have done their work."""

    @abstractmethod
    def report_faults(self, prefix: str) -> None:
        """Add what is wrong with the bodies' state to the world's faults."""

    @abstractmethod
    def taken_out(self) -> np.ndarray:
        """(n,) mask of the bodies that took no part in the last step, because some value of them cannot be."""

    @abstractmethod
    def wake(self, entity: int) -> None:
        """The bodies that sleep with this one are awake from the next step on; KeyError if it is no body."""

    # -- looking inside ---------------------------------------------------------------------------

    @abstractmethod
    def system_of_stage(self, stage: int) -> str:
        """The name of the system that a stage belongs to; "" for those that open and close a step."""

    @abstractmethod
    def look_ahead(self, others_write: bool) -> None:
        """Before a plan is made, between two steps."""

    @abstractmethod
    def planned_kernels(self) -> Iterable[PlannedKernel]:
        """Those that no system calls, at the start and the end of a step."""

    @abstractmethod
    def planned_columns(self) -> Iterable[PlannedColumn]:
        """The arrays there are."""

    @abstractmethod
    def kinetic_energy(self) -> float: ...

    @abstractmethod
    def potential_energy(self) -> float: ...

    @abstractmethod
    def momentum(self) -> np.ndarray: ...

    @abstractmethod
    def counters(self) -> dict[str, int]: ...

    @abstractmethod
    def reset_counters(self) -> None: ...

    @abstractmethod
    def prepare(self, components: tuple[type[Any], ...]) -> None:
        """Compile what bodies of these component types need; of those there are, if none are given."""

    # -- snapshots --------------------------------------------------------------------------------

    @abstractmethod
    def saved(self) -> dict[str, Any]:
        """What goes on from step to step beside the table, the contacts that users see, and the clock: a copy.

        Arrays, numbers, texts, and lists and dicts (by text) of these.
        """

    @abstractmethod
    def take_back(self, saved: dict[str, Any], moved: bool) -> None:
        """Go on from that; the table is what it was then. moved: it has had other rows, or other components."""
