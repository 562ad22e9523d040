"""Answers to many queries at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import overload

import numpy as np


class Hits(Sequence[np.ndarray]):
    """``hits[i]`` are the ids that query i found, ascending; as columns: ``entities[offsets[i]:offsets[i + 1]]``."""

    def __init__(self, offsets: np.ndarray, entities: np.ndarray) -> None:
        self.offsets = offsets
        self.entities = entities

    def __len__(self) -> int:
        return len(self.offsets) - 1

    @overload
    def __getitem__(self, index: int) -> np.ndarray: ...
    @overload
    def __getitem__(self, index: slice) -> list[np.ndarray]: ...
    def __getitem__(self, index: int | slice) -> np.ndarray | list[np.ndarray]:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        if not -len(self) <= index < len(self):
            raise IndexError(f"query {index} of {len(self)}")
        index %= len(self)
        return self.entities[self.offsets[index] : self.offsets[index + 1]]

    def __iter__(self) -> Iterator[np.ndarray]:
        return (self[i] for i in range(len(self)))

    @property
    def counts(self) -> np.ndarray:
        """(m,) how many each query found."""
        return np.diff(self.offsets)
