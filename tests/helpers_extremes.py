"""What section C of the accuracy list is tried on."""

from __future__ import annotations

import pytest
from worlds import ball, box

DT = 1 / 60
both_dimensions = pytest.mark.parametrize("d", [2, 3])
makers = pytest.mark.parametrize("maker", [ball, box])
