"""Bodies and settings for section C of the accuracy list."""

from __future__ import annotations

import pytest
from worlds import ball, box

DT = 1 / 60
makers = pytest.mark.parametrize("maker", [ball, box])
