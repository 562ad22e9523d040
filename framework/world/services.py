"""What a world asks of the plugin that provides physics; the systems are above the framework, so it knows only this."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from ..data.adoption import Adoption
from ..data.bodies import Bodies
from ..data.table import Table
from ..jit.records.record import Record
from ..jit.records.schema import Schema
from ..schedule.stages import Program
from .contacts import Contacts
from .hits import CastHits, Hits, NearestHits, Neighbours


class QueryServices(Protocol):
    """Answers to the queries of ``world``, which has checked the arguments: arrays are contiguous, of right shape."""

    def sphere(self, centre: tuple[float, ...], radius: float, mask: int) -> list[int]: ...
    def box(self, lower: tuple[float, ...], upper: tuple[float, ...], mask: int) -> list[int]: ...
    def spheres(self, centres: np.ndarray, radii: np.ndarray, mask: int) -> Hits: ...
    def boxes(self, lower: np.ndarray, upper: np.ndarray, mask: int) -> Hits: ...
    def nearest(self, points: np.ndarray, limits: np.ndarray, mask: int, excluded: np.ndarray) -> NearestHits: ...
    def neighbours(self, radius: float, mask: int, askers: np.ndarray | None) -> Neighbours: ...
    def rays(
        self, origins: np.ndarray, directions: np.ndarray, limits: np.ndarray, mask: int, excluded: np.ndarray,
        only_nearest: bool,
    ) -> CastHits: ...  # fmt: skip
    def shapes(
        self, component: type[Any], columns: dict[str, np.ndarray], positions: np.ndarray, displacements: np.ndarray,
        mask: int, excluded: np.ndarray, only_nearest: bool,
    ) -> CastHits: ...  # fmt: skip
    def forget(self) -> None: ...


class PhysicsServices(Protocol):
    """The state behind ``world.bodies``, ``world.contacts``, energies and queries, and the stages of a step.

    What a step asks for besides is in :class:`~carom.framework.schedule.no_physics.NoPhysics`.
    """

    dimensions: int
    table: Table
    adoption: Adoption
    bodies: Bodies
    contacts: Contacts
    gravity: np.ndarray
    program: Program

    @property
    def queries(self) -> QueryServices: ...
    def set_gravity(self, gravity: Any) -> None: ...
    def taken_out(self) -> np.ndarray: ...
    def report_faults(self, prefix: str) -> None: ...
    def wake(self, entity: int) -> None: ...

    def notice_written(self) -> None: ...
    def record(self, schema: Schema) -> Record: ...
    def kinetic_energy(self) -> float: ...
    def potential_energy(self) -> float: ...
    def momentum(self) -> np.ndarray: ...
    def prepare(self, components: tuple[type[Any], ...]) -> None: ...
    def saved(self) -> dict[str, Any]: ...
    def take_back(self, saved: dict[str, Any], moved: bool) -> None: ...
