"""What a physics plugin provides to a world: the framework knows only this interface, never the implementation."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from .adoption import Adoption
from .bodies import Bodies
from .contacts import Contacts
from .hits import Hits
from .table import Table


class PhysicsServices(ABC):
    """The state and the questions behind ``world.bodies``, ``world.contacts``, energies and queries."""

    dimensions: int
    table: Table
    adoption: Adoption
    bodies: Bodies
    contacts: Contacts
    gravity: np.ndarray

    @abstractmethod
    def set_gravity(self, gravity: Any) -> None: ...

    @abstractmethod
    def begin_step(self) -> None:
        """The table is in step with esper; refresh what depends on its structure."""

    @abstractmethod
    def abandon_step(self) -> None:
        """The step failed and the columns are back at its start."""

    @abstractmethod
    def end_step(self) -> None: ...

    @abstractmethod
    def report_faults(self, prefix: str) -> None:
        """Add what is wrong with the bodies' state to the world's faults."""

    @abstractmethod
    def end_window(self) -> None:
        """The last step of a ``step()`` or ``advance()`` is over: forces applied from outside have done their work."""

    @abstractmethod
    def check_settings(self, settings: Any) -> None:
        """ValueError if the settings name something that no plugin has."""

    @abstractmethod
    def kinetic_energy(self) -> float: ...

    @abstractmethod
    def potential_energy(self) -> float: ...

    @abstractmethod
    def momentum(self) -> np.ndarray: ...

    @abstractmethod
    def counters(self) -> dict[str, int]: ...

    @abstractmethod
    def query_sphere(self, centre: tuple[float, ...], radius: float, mask: int) -> list[int]: ...

    @abstractmethod
    def query_box(self, lower: tuple[float, ...], upper: tuple[float, ...], mask: int) -> list[int]: ...

    @abstractmethod
    def query_boxes(self, lower: np.ndarray, upper: np.ndarray, mask: int) -> Hits: ...

    @abstractmethod
    def query_spheres(self, centres: np.ndarray, radii: np.ndarray, mask: int) -> Hits: ...

    @abstractmethod
    def refresh_queries(self) -> None:
        """The next query looks at the bodies anew."""

    @abstractmethod
    def prepare(self, components: tuple[type[Any], ...]) -> None:
        """Compile what bodies of these component types need; of those there are, if none are given."""

    @abstractmethod
    def reset_counters(self) -> None: ...

    @abstractmethod
    def tracking_state(self) -> Any:
        """Which pairs touched at the end of the last step: a copy."""

    @abstractmethod
    def restore_tracking(self, state: Any) -> None: ...
