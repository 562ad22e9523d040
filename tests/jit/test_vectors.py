"""Operations on each component of a vector: compiled they give the bits of the plain Python functions."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from carom.framework.compilation import kernel
from carom.framework.vectors import absolute, clamped

pytestmark = pytest.mark.plain

VALUES = (0.0, -0.0, 0.5, -0.5, 2.0, -2.0, 5e-324, math.inf, -math.inf)


@kernel
def both(a, limits):
    return absolute(a), clamped(a, limits)


@pytest.mark.parametrize("vectors", [VALUES, tuple(np.random.default_rng(1).normal(size=6))])
def test_absolute_and_clamped(vectors):
    for x, y in itertools.product(vectors, repeat=2):
        for a, limits in (((x, y), (abs(y), 1.0)), ((x, y, -x), (1.0, abs(x), 0.0))):
            expected = tuple(map(abs, a)), tuple(max(-h, min(h, v)) for v, h in zip(a, limits, strict=True))
            assert np.array(both(a, limits)).tobytes() == np.array(expected).tobytes()
            assert (absolute(a), clamped(a, limits)) == expected
