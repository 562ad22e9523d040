"""Components and systems that are not carom's, and a check of esper's contexts."""

from __future__ import annotations

import esper
import pytest

from carom.framework import System


class Name:
    def __init__(self, text=""):
        self.text = text


@pytest.fixture(autouse=True)
def esper_is_left_as_it_was():
    before = set(esper.list_worlds())
    yield
    assert esper.current_world == "default"
    for name in set(esper.list_worlds()) - before:
        esper.delete_world(name)
    assert not list(esper.get_entities()), "the default context was touched"


class Counter(System):
    count = 0

    def process(self, dt):
        self.count += 1
