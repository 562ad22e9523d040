"""Every pair of boxes tested: what is quickest while few bodies move."""

from __future__ import annotations

from ...framework.compilation import inlined
from ...framework.vectors import item

BRUTE_FORCE_MAX = 80  # boxes; testing their 3,200 pairs takes 4 us, a grid of them 2; but its kernels are more to load


@inlined
def boxes_overlap(low, high, other_low, other_high):
    """Whether two closed boxes share a point; boxes with nan overlap nothing."""
    hit = True
    for q in range(len(low)):
        hit &= (item(low, q) <= item(other_high, q)) & (item(other_low, q) <= item(high, q))
    return hit
