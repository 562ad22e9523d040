"""Milliseconds by system and stage, of the last half second."""

from __future__ import annotations

import time

from ...framework import World
from ...framework.schedule.profile_report import Totals

EVERY = 0.5  # s
LEAST = 0.02  # of a step: stages below it are not listed


class Stages:
    """Differences of what a world counts of itself; nothing is set back."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._before: Totals | None = None
        self._since = 0.0
        self.rows: list[tuple[str, str]] = []  # name, ms per step

    def update(self) -> list[tuple[str, str]]:
        """The rows, made again twice a second."""
        now = time.monotonic()
        if self._before is not None and now - self._since < EVERY:
            return self.rows
        totals = self._world.stats().totals
        before = self._before
        if before is not None and totals.steps > before.steps:
            self.rows = rows_of(totals - before)
        self._before, self._since = totals, now
        return self.rows


def rows_of(spent: Totals) -> list[tuple[str, str]]:
    """The systems in their order, each with its stages that take the most."""
    each = 1e3 / spent.steps
    whole = sum(spent.seconds.values())
    rows = [("one step", f"{each * whole:.3f} ms")]
    for system, seconds in spent.seconds.items():
        rows.append((system, f"{each * seconds:.3f}"))
        stages = [(of, took) for (by, of), took in spent.kernel_seconds.items() if by == system]
        rows += [(f"    {name}", f"{each * took:.3f}") for name, took in stages if took > LEAST * whole]
    return rows
