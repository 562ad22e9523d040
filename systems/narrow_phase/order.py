"""Pairs in canonical order, by the smaller entity id, then by the larger; and the columns of those that touch."""

from __future__ import annotations

from ...framework.compilation import kernel


@kernel
def sort_pairs(first, second, rank, starts, half_a, half_b, sorted_a, sorted_b):
    """Write the pairs (first, second) (m,) of rows in canonical order, the row of the smaller id first.

    rank (n,): the place of a row by its entity's id; starts (n + 1,), half_a, half_b (m,): room. Two stable counting
    sorts, by the larger id and by the smaller.
    """
    for i in range(len(starts)):
        starts[i] = 0
    for c in range(len(first)):
        starts[max(rank[first[c]], rank[second[c]]) + 1] += 1
    for i in range(1, len(starts)):
        starts[i] += starts[i - 1]
    for c in range(len(first)):
        a, b = first[c], second[c]
        if rank[a] > rank[b]:
            a, b = b, a
        k = starts[rank[b]]
        starts[rank[b]] += 1
        half_a[k], half_b[k] = a, b
    for i in range(len(starts)):
        starts[i] = 0
    for c in range(len(first)):
        starts[rank[half_a[c]] + 1] += 1
    for i in range(1, len(starts)):
        starts[i] += starts[i - 1]
    for c in range(len(first)):
        k = starts[rank[half_a[c]]]
        starts[rank[half_a[c]]] += 1
        sorted_a[k], sorted_b[k] = half_a[c], half_b[c]


@kernel
def collect_contacts(
    pairs, entity, pair_a, pair_b, pair_depth, pair_normal, pair_point, pair_impulse, now, entity_a, entity_b, point,
    normal, depth, impulse, step, enabled,
):  # fmt: skip
    """Copy what is known of some pairs (k,) into columns of their own; now: the number of the step."""
    for r in range(len(pairs)):
        c = pairs[r]
        entity_a[r], entity_b[r] = entity[pair_a[c]], entity[pair_b[c]]
        depth[r], impulse[r], step[r], enabled[r] = pair_depth[c], pair_impulse[c], now, True
        for axis in range(normal.shape[1]):
            normal[r, axis], point[r, axis] = pair_normal[c, axis], pair_point[c, axis]
