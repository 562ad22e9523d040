"""What the study of levels has found, as plain records that go through JSON and back."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, Self

from ..measure.timing import Spread

DERIVED = ("false_positives", "share", "first_share")  # in JSON beside what they follow from


@dataclass
class GeometryCost:
    """One kind of object, upright or turned, with one option; counts over all worlds.

    touching
        pairs of polygons that truly overlap
    tested
        pairs that the broad phase gives to the narrow phase
    first_hits
        of these, let pass by the first level
    hits
        pairs reported as contacts
    misses
        pairs that overlap and are not reported
    expected_share
        the share of false positives by closed form, None where there is none
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
        """Contacts that are reported and are none."""
        return self.hits - (self.touching - self.misses)

    @property
    def share(self) -> float:
        """Of false positives among the hits; 0 without hits."""
        return self.false_positives / self.hits if self.hits else 0.0

    @property
    def first_share(self) -> float:
        """What the first level lets pass and does not overlap, as a share of what it lets pass."""
        return (self.first_hits - self.touching + self.misses) / self.first_hits if self.first_hits else 0.0

    def as_dict(self) -> dict[str, Any]:
        """For JSON; what follows from the rest is there too."""
        derived = {name: getattr(self, name) for name in DERIVED}
        return {**dataclasses.asdict(self), **derived}

    @classmethod
    def from_dict(cls, plain: dict[str, Any]) -> Self:
        """The opposite of :meth:`as_dict`, also after JSON."""
        given = {name: value for name, value in plain.items() if name not in DERIVED}
        spreads = {name: Spread.from_dict(plain[name]) for name in ("nanoseconds", "finding")}
        return cls(**{**given, **spreads})


@dataclass
class GeometryStudy:
    """All of them, on one machine."""

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
        """Those that were tried, in order."""
        return list(dict.fromkeys(cost.option for cost in self.costs))

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {**dataclasses.asdict(self), "costs": [cost.as_dict() for cost in self.costs]}

    @classmethod
    def from_dict(cls, plain: dict[str, Any]) -> Self:
        """The opposite of :meth:`as_dict`, also after JSON."""
        return cls(**{**plain, "costs": [GeometryCost.from_dict(cost) for cost in plain["costs"]]})
