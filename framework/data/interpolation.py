"""Where bodies are drawn: between the start and the end of the last step."""

from __future__ import annotations

from typing import Any

import numpy as np

STARTS = {"position": "previous_position", "rotation": "previous_rotation"}  # columns, and those of the step's start


def interpolated(table: Any, name: str, rows: Any) -> np.ndarray:
    """A column at the fraction ``alpha`` between both, a copy; what has no start, or no clock, is as it is."""
    now, before = table.column(name)[rows], table.arrays.get(STARTS[name])
    if before is None or table.clock is None:
        return np.array(now)
    start, alpha = before[: table.count][rows], table.clock.alpha
    if name == "rotation" and table.dimensions == 3:
        return _turned(start, now, alpha)
    return start + alpha * (now - start)


def restart(table: Any, rows: Any, names: Any = STARTS) -> None:
    """Nothing has led these rows to where they are."""
    for name in names:
        if STARTS[name] in table.arrays:
            table.arrays[STARTS[name]][rows] = table.column(name)[rows]


def _turned(start: np.ndarray, end: np.ndarray, alpha: float) -> np.ndarray:
    """Unit quaternions (..., 4) on the shortest way at a constant rate."""
    end = np.where(np.sum(start * end, axis=-1, keepdims=True) < 0.0, -end, end)
    apart, along = (np.linalg.norm(each, axis=-1, keepdims=True) for each in (end - start, end + start))
    angle = 2.0 / np.pi * np.arctan2(apart, along)  # as np.sinc takes it
    mixed = (1.0 - alpha) * np.sinc((1.0 - alpha) * angle) * start + alpha * np.sinc(alpha * angle) * end
    return mixed / np.linalg.norm(mixed, axis=-1, keepdims=True)
