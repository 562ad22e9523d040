"""A world for maps."""

import pytest
from helpers_maps import quiet_world_for_maps


@pytest.fixture
def world():
    with quiet_world_for_maps() as made:
        yield made
