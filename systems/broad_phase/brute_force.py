"""Every pair of boxes tested: what is quickest while few bodies move."""

from __future__ import annotations

from ...framework.compilation import inlined
from ...framework.vectors import item

BRUTE_FORCE_MAX = 192  # boxes; testing their 18,000 pairs takes little longer than building a tree of them


@inlined
def boxes_overlap(low, high, other_low, other_high):
    """Whether two closed boxes share a point; boxes with nan overlap nothing."""
    hit = True
    for q in range(len(low)):
        hit &= (item(low, q) <= item(other_high, q)) & (item(other_low, q) <= item(high, q))
    return hit
