"""What a world's pipeline measures while it runs; :mod:`profile_report` makes means of it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from .. import compilation
from ..errors import CaromError
from .profile_report import OUTSIDE, Stats, Totals, units_of

if TYPE_CHECKING:
    from .step import Pipeline


class Measurements:
    """Time by system, always; calls and time by kernel inside :meth:`profile`."""

    def __init__(self, pipeline: Pipeline) -> None:
        self.at: str | None = None  # the processor at work
        self._pipeline = pipeline
        self._sums = Totals()  # but for the counters, which others keep
        self.seconds = self._sums.seconds
        self._profiled = Totals()  # inside profiles that have ended
        self._profile_start: Totals | None = None

    def wait(self, seconds: float) -> None:
        """A system has waited for kernels to be compiled or loaded."""
        self._sums.waited += seconds

    def step_taken(self) -> None:
        self._sums.steps += 1
        physics = self._pipeline.world.physics
        if physics is not None:
            self._sums.counters["bodies"] = self._sums.counters.get("bodies", 0) + physics.table.stops[1]

    @contextmanager
    def profile(self) -> Iterator[None]:
        """Time each call of a kernel; CaromError if that is going on already, in this world or another."""
        if compilation.timing():
            raise CaromError("a profile is on already: kernels can be timed for one world at a time")
        self._profile_start = self.totals()
        compilation.time_calls(self._record)
        try:
            yield
        finally:
            compilation.time_calls(None)
            self._profiled = self.profiled()
            self._profile_start = None

    def _record(self, kernel: str, nanoseconds: int, compiled: bool) -> None:
        if compiled:
            return
        key, sums = (self.at or OUTSIDE, kernel), self._sums
        sums.calls[key] = sums.calls.get(key, 0) + 1
        sums.kernel_seconds[key] = sums.kernel_seconds.get(key, 0.0) + 1e-9 * nanoseconds

    def totals(self) -> Totals:
        """The sums so far."""
        physics = self._pipeline.world.physics
        counters = physics.counters() if physics is not None else {}
        return self._sums + Totals(counters={**counters, "dropped_steps": self._pipeline.clock.dropped_steps})

    def profiled(self) -> Totals:
        """The part of them that profiles have seen."""
        if self._profile_start is None:
            return self._profiled
        return self._profiled + (self.totals() - self._profile_start)

    def stats(self) -> Stats:
        """Means of it all."""
        units = {s.name: units_of(s.phase) for s in self._pipeline.lineup.systems}
        return Stats(self.totals(), self.profiled(), units)

    def reset(self) -> None:
        self._sums = Totals()
        self.seconds = self._sums.seconds
        self._profiled = Totals()
        if self._pipeline.world.physics is not None:
            self._pipeline.world.physics.reset_counters()
        if self._profile_start is not None:
            self._profile_start = self.totals()
