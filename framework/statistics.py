"""What a world has measured of itself."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Stats:
    """Since the world began, or since ``world.reset_stats()``.

    steps
        fixed steps taken
    milliseconds
        mean per step, by system
    counters
        totals: candidates, contacts, impacts, capped_impacts, dropped_steps, ...
    """

    steps: int
    milliseconds: dict[str, float] = field(default_factory=dict)
    counters: dict[str, int] = field(default_factory=dict)

    @property
    def total(self) -> float:
        """Mean milliseconds per step in all systems."""
        return sum(self.milliseconds.values())
