"""What has changed in esper since the table last followed it, sorted by what has to be done."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..component import Component
from ..handles import Contained
from ..table import HAS_OBJECTS, Table
from .change_log import Arrival


@dataclass(eq=False)
class Archetype:
    """What is known of all entities with the same types of components.

    columns
        those types that have columns
    partner
        one of them that makes a body together with the anchor; None: no body
    anchored
        whether the anchor is among them
    stacked
        whether several are in a stack, so that they have to go together
    known
        the table has columns for all of them, and nothing is wrong with the types
    """

    columns: tuple[type[Component], ...]
    partner: type[Component] | None
    anchored: bool
    stacked: bool
    known: bool = False

    def __post_init__(self) -> None:
        self.masks = (HAS_OBJECTS, *map(Table.mask_name, self.columns))


class Changes:
    """What has to be done so that the table knows what esper has.

    come, left
        ids that become bodies, with their components, by archetype; rows of those that cease to be
    fresh, missing
        handles to adopt and rows that lose a component, by type, of bodies that stay; the former with their entities
    given, several
        all handles to adopt, with types and entities; the components of entities that have several of one stack
    archetypes
        those of bodies that come or change which were not known before, and an entity of each
    detached
        handles of entities that cease to be bodies and keep them
    arrivals
        with the ids of those of them that are to become bodies
    """

    def __init__(self) -> None:
        self.come: dict[Archetype, tuple[list[int], list[Contained]]] = {}
        self.left: list[int] = []
        self.fresh: dict[type[Component], list[tuple[int, Any]]] = {}
        self.missing: dict[type[Component], list[int]] = {}
        self.given: list[tuple[type[Component], int, Any]] = []
        self.several: dict[int, Contained] = {}
        self.archetypes: list[tuple[Archetype, int]] = []
        self.detached: list[Component] = []
        self.arrivals: list[tuple[Arrival, np.ndarray]] = []

    def types(self) -> Iterator[type[Component]]:
        """All that a body may have for the first time."""
        for archetype, _ in self.archetypes:
            yield from archetype.columns
        for arrival, _ in self.arrivals:
            yield from arrival.stores
