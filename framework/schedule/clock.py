"""Fixed steps behind frames of any length."""

from __future__ import annotations

import math
import sys


class Clock:
    """Counts steps of ``dt`` seconds; time is computed from the count, so it gathers no rounding."""

    ROUNDING = 1e-9  # of a step: frames of dt must give one step each whatever their sum rounds to

    def __init__(self, dt: float) -> None:
        self.dt = dt
        self.step_count = 0
        self._base_time = 0.0
        self._base_count = 0
        self.gathered = 0.0
        self.dropped_steps = 0
        self.scale = 1.0  # seconds simulated per second of a frame

    @property
    def time(self) -> float:
        """Seconds simulated."""
        return self._base_time + (self.step_count - self._base_count) * self.dt

    @property
    def alpha(self) -> float:
        """The gathered time as a part of a step, 0 to 1."""
        return min(max(self.gathered / self.dt, 0.0), 1.0)

    def set_dt(self, dt: float) -> None:
        """Steps take ``dt`` seconds from now on; what has passed stays."""
        if dt != self.dt:  # else replacing other settings again and again would gather rounding after all
            self._base_time, self._base_count = self.time, self.step_count
            self.dt = dt

    def gather(self, seconds: float, limit: int) -> int:
        """Add a frame's ``seconds``, scaled, and take whole steps out of them; the surplus is dropped.

        limit
            steps of a frame at scale 1 and below: a frame that is too long loses the same part of itself at any other
        """
        limit = math.ceil(limit * max(1.0, self.scale))
        self.gathered += min(seconds * self.scale, sys.float_info.max)
        rest = math.fmod(self.gathered, self.dt)  # exact, however long the frame was
        steps = round(min((self.gathered - rest) / self.dt, sys.float_info.max))
        if rest > (1.0 - self.ROUNDING) * self.dt:
            steps, rest = steps + 1, 0.0
        self.gathered = rest
        self.dropped_steps += max(0, steps - limit)
        return min(steps, limit)

    def state(self) -> tuple[float, ...]:
        """What :meth:`restore` takes: seconds, counts and the scale."""
        counts = (self.step_count, self._base_time, self._base_count, self.gathered, self.dropped_steps)
        return (self.dt, *counts, self.scale)

    def restore(self, state: tuple[float, ...]) -> None:
        """Go back to what :meth:`state` returned."""
        dt, count, base_time, base_count, gathered, dropped, scale = state
        self.dt, self._base_time, self.gathered, self.scale = dt, base_time, gathered, scale
        self.step_count, self._base_count, self.dropped_steps = int(count), int(base_count), int(dropped)
