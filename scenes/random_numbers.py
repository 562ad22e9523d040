"""The random numbers of the benchmark scenes: a small generator that any language can reproduce to the bit.

x <- (1664525 x + 1013904223) mod 2^32, u = (x >> 8) / 2^24 (the constants of Numerical Recipes' "ranqd1").
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FIRST_SEED = 12345
MULTIPLIER = 1664525
INCREMENT = 1013904223
MASK = 2**32 - 1


def uniform(count: int, seed: int = 0) -> NDArray[np.float64]:
    """The first ``count`` draws u in [0, 1); seed 0 is the published sequence, which starts from x = 12345.

    Each pass doubles the number of draws: m steps of the generator are again one step x -> a x + c, with other
    constants.
    """
    x = np.empty(count, np.uint64)
    filled, multiplier, increment = 0, MULTIPLIER, INCREMENT
    if count:
        x[0] = (MULTIPLIER * ((FIRST_SEED + seed) & MASK) + INCREMENT) & MASK
        filled = 1
    while filled < count:  # (multiplier, increment) advance by `filled` draws
        more = min(filled, count - filled)
        jumped = x[:more] * np.uint64(multiplier) + np.uint64(increment)  # at most 2^64 - 2^32: no overflow
        x[filled : filled + more] = jumped & np.uint64(MASK)
        increment = (multiplier * increment + increment) & MASK
        multiplier = (multiplier * multiplier) & MASK
        filled += more
    return (x >> np.uint64(8)) / 2.0**24
