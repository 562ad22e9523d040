"""Numbers that look like those of another unit: told once for each field, for they may be meant."""

from __future__ import annotations

import math
from collections.abc import Iterable

from .errors import warn

DEGREES = 30.0  # whole numbers from here on are seldom meant as radians: five turns and more
LONG = 16.0, 480.0  # s: between these, a whole number may be meant per second, and 1,000 over one as milliseconds
WHOLE = 1e-3
_told: set[str] = set()


def warn_of_degrees(name: str, angles: Iterable[float | None]) -> None:
    """A PhysicsWarning if angles, in radians, look like degrees; ``name``: of the field."""
    for angle in angles:
        if angle is not None and math.isfinite(angle) and abs(angle) >= DEGREES and angle == round(angle):
            turns = abs(angle) / (2.0 * math.pi)
            _warn(name, f"{name} = {angle:g} is in radians, {turns:.1f} turns: degrees are math.radians({angle:g})")
            return


def warn_of_rate(name: str, seconds: float) -> None:
    """A PhysicsWarning if the seconds of a step look like steps per second, or like milliseconds."""
    whole = seconds == round(seconds) or abs(1000.0 / seconds - round(1000.0 / seconds)) < WHOLE
    if LONG[0] <= seconds <= LONG[1] and whole:
        cures = f"{seconds:.6g} steps a second are 1 / {seconds:.6g}, {seconds:.6g} ms are {seconds / 1000:.6g}"
        _warn(name, f"{name} = {seconds:g} is in seconds: {cures}")


def _warn(name: str, text: str) -> None:
    if name in _told:
        return
    _told.add(name)
    warn(text)
