"""Results of the geometry study, as plain records that convert to JSON and back."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

from ...measure.timing import Spread
from ...plain import Plain

DERIVED = ("false_positives", "share", "first_share")  # written to JSON besides the fields they follow from


@dataclass
class GeometryCost(Plain):
    """One kind of object, upright or turned, with one option; counts over all worlds.

    touching
        pairs of polygons that truly overlap
    tested
        pairs that the broad phase passes to the narrow phase
    first_hits
        of these, accepted by the first level
    hits
        pairs reported as contacts
    misses
        overlapping pairs that are not reported
    expected_share
        the share of false positives in closed form, None if there is none
    nanoseconds
        of the narrow phase, per pair tested
    finding
        nanoseconds of broad and narrow phase together, per object
    """

    thing: str
    turned: bool
    option: str
    objects: int
    touching: int
    tested: int
    first_hits: int
    hits: int
    misses: int
    expected_share: float | None
    nanoseconds: Spread
    finding: Spread

    @property
    def false_positives(self) -> int:
        """Reported contacts whose polygons do not overlap."""
        return self.hits - (self.touching - self.misses)

    @property
    def share(self) -> float:
        """False positives over hits; 0 without hits."""
        return self.false_positives / self.hits if self.hits else 0.0

    @property
    def first_share(self) -> float:
        """Pairs accepted by the first level that do not overlap, over all pairs it accepts."""
        return (self.first_hits - self.touching + self.misses) / self.first_hits if self.first_hits else 0.0

    def as_dict(self) -> dict[str, Any]:
        """For JSON, with the derived figures."""
        derived = {name: getattr(self, name) for name in DERIVED}
        return {**dataclasses.asdict(self), **derived}


@dataclass
class GeometryStudy(Plain):
    """All records, measured on one machine."""

    machine: dict[str, str]
    count: int
    worlds: int
    repeats: int
    room: float
    seed: int
    costs: list[GeometryCost]

    def cost(self, thing: str, turned: bool, option: str) -> GeometryCost:
        """One record; KeyError if there is none."""
        for cost in self.costs:
            if (cost.thing, cost.turned, cost.option) == (thing, turned, option):
                return cost
        raise KeyError(f"no {thing!r}, turned={turned}, with {option!r} in this study")

    @property
    def cases(self) -> list[tuple[str, bool]]:
        """Objects, upright and turned, in order."""
        return list(dict.fromkeys((cost.thing, cost.turned) for cost in self.costs))

    @property
    def options(self) -> list[str]:
        """The options tried, in order."""
        return list(dict.fromkeys(cost.option for cost in self.costs))

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {**dataclasses.asdict(self), "costs": [cost.as_dict() for cost in self.costs]}
