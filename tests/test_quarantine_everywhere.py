"""Every value that cannot be, in every column of every body of small worlds; checked indices: test_checked_build."""

from __future__ import annotations

import pytest

from .helpers_poison import complaints, scenes

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(("name", "build"), list(scenes()), ids=[name for name, _ in scenes()])
def test_every_value_in_every_column_of_every_body(name, build):
    """nan, inf, -inf and -1: others stay finite, and as if it was deleted if a fault names the body."""
    assert list(complaints(build)) == []
