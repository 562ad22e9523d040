"""The random numbers of scenes, by their definition."""

from __future__ import annotations

from collections.abc import Iterator


def published_numbers(seed: int = 0) -> Iterator[float]:
    """The published sequence, one number after the other."""
    x = 12345 + seed
    while True:
        x = (1664525 * x + 1013904223) % 2**32
        yield (x >> 8) / 2**24
