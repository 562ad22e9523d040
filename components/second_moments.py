"""The second moments of shapes, as their functions tell them: of equal shapes once."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from ..framework.jit.linking import CACHE_SIZE

ROOM = 1024  # shapes of one type that are remembered, besides those that are asked for at once


class SecondMoments:
    """Of one type of collider, in that many dimensions: they depend on its own columns alone."""

    def __init__(self, component: Any, dimensions: int) -> None:
        columns = component.columns.items()
        self._component, self._dimensions = component, dimensions
        self._keys = [column.key for name, column in columns if name not in component.stacked_columns]
        self._known: dict[bytes, int] = {}  # rows of what has been found, by the values of the columns
        self._found = np.empty((0, 1 + dimensions + dimensions * (dimensions + 1) // 2))

    def of(self, store: Any, rows: np.ndarray) -> np.ndarray:
        """(n, 6 or 10) of these rows, which have the collider."""
        columns = [store.values(key, rows).reshape(len(rows), -1).astype(float) for key in self._keys]
        values = np.concatenate((np.zeros((len(rows), 1)), *columns), axis=1)
        keys = values.view(f"V{8 * values.shape[1]}").ravel().tolist()
        if len(self._known) > ROOM + len(keys):
            self._known, self._found = {}, self._found[:0]
        missing = set(keys) - self._known.keys()
        if missing:
            of_key = dict(zip(keys, rows.tolist(), strict=True))
            self._find(store, {key: row for key, row in of_key.items() if key in missing})
        return self._found[np.fromiter(map(self._known.__getitem__, keys), np.int64, len(keys))]

    def _find(self, store: Any, missing: dict[bytes, int]) -> None:
        """Ask the shape's function, once for each of these rows."""
        entity, shape = store.column("entity"), object.__new__(self._component)
        fresh = []
        for row in missing.values():
            shape._bind(store, int(entity[row]))
            fresh.append(self._component.second_moments(shape, self._dimensions))
        self._found = np.concatenate((self._found, np.array(fresh, float)))
        self._known.update(zip(missing, range(len(self._known), len(self._found)), strict=True))


moments_of = lru_cache(maxsize=CACHE_SIZE)(SecondMoments)  # the same ones for all worlds of this process
