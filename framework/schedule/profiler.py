"""What a world measures while it runs; :mod:`profile_report` makes means of it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from .. import compilation
from ..errors import CaromError
from .profile_report import OUTSIDE, Stats, Totals, units_of


class Profiler:
    """Time by system, always; calls and time by stage and by kernel called from Python inside :meth:`profile`."""

    def __init__(self, pipeline: Any) -> None:
        self._pipeline = pipeline
        self.steps = 0
        self._sums = Totals()  # of what is Python
        self._before: dict[str, np.ndarray] = {}  # what the stages had taken when measuring began, by name
        self._profiled = Totals()  # inside profiles that have ended
        self._profile_start: tuple[Totals, dict[str, np.ndarray]] | None = None

    def add(self, system: str, seconds: float) -> None:
        """A Python system has run."""
        self._sums.seconds[system] = self._sums.seconds.get(system, 0.0) + max(seconds, 0.0)

    def wait(self, seconds: float) -> None:
        """Kernels were compiled or loaded in a step."""
        self._sums.waited += seconds

    @contextmanager
    def profile(self) -> Iterator[None]:
        """Count calls and time of stages and kernels; CaromError if that is going on already, in any world."""
        if compilation.timing():
            raise CaromError("a profile is on already: kernels can be timed for one world at a time")
        self._profile_start, program = self._now(), self._pipeline.physics.program
        compilation.time_calls(self._record)
        program.time_apart(True)
        try:
            yield
        finally:
            compilation.time_calls(None)
            program.time_apart(False)
            self._profiled = self.profiled()
            self._profile_start = None

    def _record(self, kernel: str, nanoseconds: int, compiled: bool) -> None:
        if compiled:
            return
        key, sums = (self._pipeline.at or OUTSIDE, kernel), self._sums
        sums.calls[key] = sums.calls.get(key, 0) + 1
        sums.kernel_seconds[key] = sums.kernel_seconds.get(key, 0.0) + 1e-9 * nanoseconds

    def _counts(self) -> dict[str, np.ndarray]:
        """Calls and ticks of all stages since the world began."""
        program = self._pipeline.physics.program
        return dict(zip((stage.name for stage in program.stages), program.counts().T, strict=True))

    def _stages(self, before: dict[str, np.ndarray]) -> Totals:
        """What all stages have taken since they had those counts. Ticks are made seconds only then: how long one is
        becomes known better with time."""
        physics, totals = self._pipeline.physics, Totals()
        program = physics.program
        taken = [count - before.get(name, 0) for name, count in self._counts().items()]
        counts = np.array(taken).reshape(-1, 3).T
        seconds = program.seconds_of(counts).tolist()
        for k, (stage, count) in enumerate(zip(program.stages, counts[0].astype(int).tolist(), strict=True)):
            if count:
                system = physics.system_of_stage(k)
                totals.calls[system, stage.name] = count
                totals.kernel_seconds[system, stage.name] = seconds[k]
                if system != OUTSIDE:
                    totals.seconds[system] = totals.seconds.get(system, 0.0) + seconds[k]
        return totals

    def _now(self) -> tuple[Totals, dict[str, np.ndarray]]:
        """The sums so far but for the stages, and the counts of these."""
        counters = self._pipeline.physics.counters()
        kept = Totals(self.steps, counters={**counters, "dropped_steps": self._pipeline.clock.dropped_steps})
        return self._sums + kept, self._counts()

    def totals(self) -> Totals:
        """The sums so far."""
        return self._now()[0] + self._stages(self._before)

    def profiled(self) -> Totals:
        """The part of them that profiles have seen."""
        if self._profile_start is None:
            return self._profiled
        sums, counts = self._profile_start
        return self._profiled + (self._now()[0] - sums) + self._stages(counts)

    def stats(self) -> Stats:
        """Means of it all."""
        units = {s.name: units_of(s.phase) for s in self._pipeline.order.systems}
        return Stats(self.totals(), self.profiled(), units)

    def reset(self) -> None:
        self.steps, self._sums, self._before = 0, Totals(), self._counts()
        self._profiled = Totals()
        self._pipeline.physics.reset_counters()
        if self._profile_start is not None:
            self._profile_start = self._now()
