"""Both ways in which a step is taken: `from helpers_steps import both_ways` runs every test of a module with each."""

from __future__ import annotations

import pytest

from carom.framework.schedule import step


@pytest.fixture(autouse=True, params=["flat", "with all its parts"])
def both_ways(request, monkeypatch):
    if request.param != "flat":
        monkeypatch.setattr(step, "make_quiet_step", lambda *_: None)
