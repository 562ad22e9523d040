"""What a world has measured of itself: time by system and, while a profile is on, by kernel."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, TypeVar

from .phases import Phase

# What the work of a phase grows with. The counters of the same names count it; each system's time is divided by them.
UNITS = {
    Phase.NARROW: ("bodies", "candidates"),
    Phase.RESPONSE: ("bodies", "pairs", "contacts"),
}
OTHER_UNITS = ("bodies",)
SINGULAR = {"bodies": "body", "candidates": "candidate", "pairs": "pair", "contacts": "contact"}
Key = TypeVar("Key")

OUTSIDE = ""  # the system of kernels that no system has called: at the ends of a step, and queries between two


@dataclass
class Totals:
    """Sums since the measuring began."""

    steps: int = 0
    seconds: dict[str, float] = field(default_factory=dict)  # by system, waiting for kernels left out
    counters: dict[str, int] = field(default_factory=dict)
    calls: dict[tuple[str, str], int] = field(default_factory=dict)  # of kernels, by system and kernel
    kernel_seconds: dict[tuple[str, str], float] = field(default_factory=dict)
    waited: float = 0.0  # s, for kernels to be compiled or loaded

    def __add__(self, other: Totals) -> Totals:
        return self._combined(other, 1)

    def __sub__(self, other: Totals) -> Totals:
        return self._combined(other, -1)

    def _combined(self, other: Totals, sign: int) -> Totals:
        return Totals(
            self.steps + sign * other.steps,
            _combined(self.seconds, other.seconds, sign),
            _combined(self.counters, other.counters, sign),
            _combined(self.calls, other.calls, sign),
            _combined(self.kernel_seconds, other.kernel_seconds, sign),
            self.waited + sign * other.waited,
        )


@dataclass(frozen=True)
class KernelStats:
    """One kernel in one system (``""``: called by no system, as at the ends of a step and in queries).

    calls, milliseconds
        mean per step, compiling and loading left out
    nanoseconds
        mean per body, candidate, pair, contact, as fits the system
    """

    system: str
    kernel: str
    calls: float
    milliseconds: float
    nanoseconds: dict[str, float]


@dataclass(frozen=True)
class Stats:
    """Since the world began, or since ``world.reset_stats()``: means of the sums in ``totals``.

    ``profiled`` has the part of them that was measured inside ``with world.profile():``; ``units`` names, by system in
    their order, the counters that its time is divided by. Compiling and loading kernels is in no time but
    ``compile_seconds``.
    """

    totals: Totals
    profiled: Totals = field(default_factory=Totals, repr=False)
    units: dict[str, tuple[str, ...]] = field(default_factory=dict, repr=False)

    @property
    def steps(self) -> int:
        """Fixed steps taken."""
        return self.totals.steps

    @property
    def milliseconds(self) -> dict[str, float]:
        """Mean ms per step, by system."""
        return {name: 1e3 * seconds / max(self.steps, 1) for name, seconds in self._seconds().items()}

    @property
    def total(self) -> float:
        """Mean ms per step in all systems."""
        return sum(self.milliseconds.values())

    @property
    def nanoseconds(self) -> dict[str, dict[str, float]]:
        """By system: its time in ns per body that moves, and per candidate or pair and contact, as fits its phase."""
        counters = self.counters
        return {name: _shared(s, counters, self.units.get(name, OTHER_UNITS)) for name, s in self._seconds().items()}

    @property
    def kernels(self) -> tuple[KernelStats, ...]:
        """A :class:`KernelStats` for each kernel called inside ``with world.profile():``, means over its steps."""
        order = {name: place for place, name in enumerate(self._seconds())}
        keys = sorted(self.profiled.calls, key=lambda key: order.get(key[0], len(order)))
        return tuple(self._kernel(*key) for key in keys)

    @property
    def counters(self) -> dict[str, int]:
        """Totals: bodies (moving ones, summed over the steps), candidates, pairs, contacts, impacts, ..."""
        return self.totals.counters

    @property
    def compile_seconds(self) -> float:
        """Seconds that the systems waited for kernels to be compiled or loaded."""
        return self.totals.waited

    def _seconds(self) -> dict[str, float]:
        """By system, in their order."""
        return {name: self.totals.seconds.get(name, 0.0) for name in {**self.units, **self.totals.seconds}}

    def _kernel(self, system: str, kernel: str) -> KernelStats:
        steps, seconds = max(self.profiled.steps, 1), self.profiled.kernel_seconds[system, kernel]
        units = self.units.get(system, () if system == OUTSIDE else OTHER_UNITS)
        per = _shared(seconds, self.profiled.counters, units)
        return KernelStats(system, kernel, self.profiled.calls[system, kernel] / steps, 1e3 * seconds / steps, per)

    def __str__(self) -> str:
        rows = [["system", "ms per step", *(f"ns per {name}" for name in SINGULAR.values())]]
        kernels, nanoseconds = self.kernels, self.nanoseconds
        for name, milliseconds in self.milliseconds.items():
            rows.append([name, f"{milliseconds:.4f}", *_cells(nanoseconds[name])])
            rows += [_row(row) for row in kernels if row.system == name]
        others = [_row(row) for row in kernels if row.system not in nanoseconds]
        rows += [["no system", "", *_cells({})], *others] if others else []
        rows.append([f"all, {self.steps} steps", f"{self.total:.4f}", *_cells({})])
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        lines = []
        for first, *others in rows:
            cells = (cell.rjust(width) for cell, width in zip(others, widths[1:], strict=True))
            lines.append("  ".join((first.ljust(widths[0]), *cells)).rstrip())
        return "\n".join(lines)


def units_of(phase: Phase) -> tuple[str, ...]:
    """The counters that the time of a system of that phase is divided by."""
    return UNITS.get(phase, OTHER_UNITS)


def _shared(seconds: float, counters: dict[str, int], units: Iterable[str]) -> dict[str, float]:
    """Nanoseconds per unit, of those units there were any."""
    return {SINGULAR[unit]: 1e9 * seconds / counters[unit] for unit in units if counters.get(unit)}


def _combined(mine: dict[Key, Any], others: dict[Key, Any], sign: int) -> dict[Key, Any]:
    return {key: mine.get(key, 0) + sign * others.get(key, 0) for key in {**mine, **others}}


def _row(row: KernelStats) -> list[str]:
    return [f"  {row.kernel}", f"{row.milliseconds:.4f}", *_cells(row.nanoseconds)]


def _cells(nanoseconds: dict[str, float]) -> list[str]:
    return [f"{nanoseconds[name]:.1f}" if name in nanoseconds else "" for name in SINGULAR.values()]
