"""Operations on vectors: compiled code gives what the plain functions do, also of nan, -0.0 and infinity."""

from __future__ import annotations

import itertools
import math

import pytest

from carom.framework.compilation import kernel
from carom.framework.vectors import at_most, filled, larger, largest, shifted, smaller, smallest

VALUES = (0.0, -0.0, 1.5, math.inf, -math.inf, math.nan)


@kernel
def compared(a, b, s):
    return smaller(a, b), larger(a, b), smallest(a), largest(a), at_most(a, b), shifted(a, s), filled(a, s)


@pytest.mark.parametrize("dimensions", [2, 3])
def test_what_compares_components_gives_the_same_bits_as_plain_python(dimensions):
    for some in itertools.product(VALUES, repeat=4):
        a, b = (*some[:2], 2.0)[:dimensions], (*some[2:], -2.0)[:dimensions]
        assert repr(compared(a, b, some[0])) == repr(compared.py_func(a, b, some[0])), (a, b)
