"""Islands: bodies that contacts join. Each island is known by its first body."""

from __future__ import annotations

from ..framework.compilation import part


@part
def root_of(island, i):
    """The first body of the island of body i; chains that lead there get shorter."""
    while island[i] != i:
        island[i] = island[island[i]]
        i = island[i]
    return i


@part
def join_roots(island, i, k):
    """Bodies i and k are in one island, which the first of its bodies stands for."""
    one, other = root_of(island, i), root_of(island, k)
    island[max(one, other)] = min(one, other)
