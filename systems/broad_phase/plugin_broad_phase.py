"""Broad phases of plugins: called with the boxes of a step, their answers checked."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...framework.errors import PluginError
from ...framework.plugins.registry import Registry


class PluginBroadPhase:
    """Calls the broad phase that the settings name, an instance for this world, and checks what it returns."""

    def __init__(self, registry: Registry) -> None:
        self._registry = registry
        self._made: dict[str, tuple[type[Any], Any]] = {}  # by name: the class as it was registered, and its instance

    def pairs(self, name: str, lower: np.ndarray, upper: np.ndarray, moving: int) -> tuple[np.ndarray, np.ndarray]:
        """Rows of overlapping boxes, (n, d) corners; PluginError if these are no pairs with one of the first rows."""
        registered, count = self._registry.broad_phases[name], len(lower)
        if name not in self._made or self._made[name][0] is not registered:
            self._made[name] = registered, registered()
        boxes = [lower.view(), upper.view()]
        for box in boxes:
            box.flags.writeable = False
        try:
            found = self._made[name][1].pairs(*boxes, moving)
        except Exception as error:
            error.add_note(f"broad phase {name!r}")
            raise
        try:
            first, second = (np.asarray(rows) for rows in found)
        except (TypeError, ValueError):
            raise PluginError(f"broad phase {name!r} must return two arrays of rows, got {found!r}") from None
        for rows in (first, second):
            if rows.ndim != 1 or len(rows) != len(first) or rows.dtype.kind not in "iu":
                raise PluginError(f"broad phase {name!r} must return two integer arrays of one length, got {found!r}")
        wrong = (np.minimum(first, second) < 0) | (np.maximum(first, second) >= count) | (first == second)
        wrong |= np.minimum(first, second) >= moving
        if wrong.any():
            at = int(np.argmax(wrong))
            raise PluginError(
                f"broad phase {name!r} returned rows {first[at]} and {second[at]}: a pair is of two of the {count} "
                f"rows, at least one of them among the {moving} that move"
            )
        return first.astype(np.int32), second.astype(np.int32)
