"""What section C of the accuracy list is tried on."""

from __future__ import annotations

import pytest
from worlds import ball, box

DT = 1 / 60
makers = pytest.mark.parametrize("maker", [ball, box])
