"""Zones that act on what is in them: ``World(Physics(), Zones())``, then sensors with a ``Wind(...)`` and the like."""

from __future__ import annotations

from ...framework import Plugin
from .components import Field, Water, Wind
from .explosion import explode
from .stages import acting

__all__ = ["Field", "Water", "Wind", "Zones", "explode"]


class Zones(Plugin):
    """Moves the bodies that are in a :class:`Wind`, a :class:`Water` or a :class:`Field`."""

    def __init__(self) -> None:
        super().__init__("zones", version="1.0", needs_physics=True)
        for component in (Wind, Water, Field):
            self.component(component)
        self.stages = dict(acting.stages)
