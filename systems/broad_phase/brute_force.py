"""Every pair of boxes tested: what is quickest while few bodies move."""

from __future__ import annotations

from ...framework.compilation import inlined
from ...framework.vectors import at_most

BRUTE_FORCE_MAX = 80  # boxes; testing their 3,200 pairs takes 4 us, a grid of them 2; but its kernels are more to load


@inlined
def boxes_overlap(low, high, other_low, other_high):
    """Whether two closed boxes share a point; boxes with nan overlap nothing."""
    return at_most(low, other_high) & at_most(other_low, high)
