"""What may not grow: constants of contacts, fields of the solver's records, byte code that a world links.

Each is what it was when it was last lowered: lower the bound with the figure.
"""

from __future__ import annotations

import sys
from typing import Any, cast

import pytest

from carom import scenes
from carom.framework.jit import hash as code_hash
from carom.systems.contacts import constants
from carom.systems.contacts.solving.records import SOLVER, WARM_START
from carom.systems.joints.records import JOINTS
from carom.systems.linking import preparation, steps

CONSTANTS, FIELDS = 33, 211
FIRST_STEP, LATER = 128, 270  # KB of byte code that asteroids links, and with what it may need later


class Linked(BaseException):
    """What a world links is known."""


def test_contacts_have_no_more_constants():
    assert sum(name.isupper() for name in vars(constants)) <= CONSTANTS


def test_the_solver_has_no_more_fields():
    assert sum(len(schema.fields) for schema in (SOLVER, JOINTS, WARM_START)) <= FIELDS


@pytest.mark.skipif(sys.version_info[:2] != (3, 11), reason="the byte code of another Python")
def test_asteroids_links_no_more_byte_code(monkeypatch):
    codes = {}
    monkeypatch.setattr(code_hash, "_feed_code", lambda code, digest: codes.setdefault(code, len(code.co_code)))

    def only_look(functions):
        for function in functions:
            code_hash.hash_and_reach(getattr(function, "function", None) or function.py_func)
        raise Linked

    monkeypatch.setattr(steps, "link_all", only_look)
    with scenes.get("asteroids").build() as world:
        with pytest.raises(Linked):
            world.step()
        first_step, physics = sum(codes.values()), cast(Any, world.physics)
        kind = preparation.kind_of_world(physics.scene, physics.integration, physics.program)
        with pytest.raises(Linked):
            only_look(preparation.needed_functions(*kind))
    assert 50_000 < first_step <= 1000 * FIRST_STEP
    assert first_step < sum(codes.values()) <= 1000 * LATER
