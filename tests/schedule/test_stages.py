"""The list of stages: what the page says of it, the records that stages work on, and the builds that run them."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest
from helpers_processes import run_python

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import World
from carom.framework.jit.records.record import make_record
from carom.framework.schedule.stages import Program, Stage
from carom.plugins import Physics
from carom.systems import ContactEvents
from carom.systems.records import STATE
from carom.systems.stage_list import CLOSING, check_stages
from studies.page import between_marks
from studies.stages import table

ROOT = Path(__file__).resolve().parents[2]


def test_the_page_shows_the_stages_that_run():
    """``studies stages --into docs/architecture.md`` writes what the page has to hold."""
    _, written, _ = between_marks(ROOT / "docs" / "architecture.md", "studies stages")
    assert written.strip() == table().markdown()


def test_the_checked_build_names_the_column_and_the_index():
    source = """
from carom.framework.compilation import kernel
from carom.framework.jit.records.record import make_record
from carom.framework.jit.records.record_type import record_at
from carom.framework.jit.records.schema import Schema, floats

SCHEMA = Schema("Shelf", weight=floats())
shelf_at = record_at(SCHEMA, 2)

@kernel
def weight_of(address, i):
    return shelf_at(address).weight[i]

shelf = make_record(SCHEMA, 2)
shelf.reserve(3, "weight")
for i in (3, -1):
    try:
        weight_of(shelf.address, i)
    except IndexError as error:
        print(error)
"""
    result = run_python(source, CAROM_CHECK="1")
    said = result.stdout.splitlines()
    assert len(said) == 2, result.stderr
    assert "Shelf.weight" in said[0]
    assert "3, 3" in said[0]
    assert "-1, 3" in said[1]


def falling(*systems):
    world = World(Physics(dimensions=2, gravity=(0.0, -9.81)))
    world.create_entity(Transform((0.0, 0.0)), AABBCollider((5.0, 0.5)))
    world.create_entity(Transform((0.0, 1.5)), RigidBody(), SphereCollider(0.5))
    for system in systems:
        world.add_system(system)
    return world


def test_without_its_system_the_events_end_and_the_rest_goes_on():
    world, usual = falling(), falling()
    world.remove_system(next(s for s in world.systems if isinstance(s, ContactEvents)))
    for _ in range(60):
        world.step()
        usual.step()
        assert not len(world.contacts.begin)
    assert (world.bodies.position == usual.bodies.position).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"needed": "dynamic bodys"}, "needed must be one of .*, got 'dynamic bodys'"),
        ({"writes": ("fast_cout",)}, "no record in systems/records.py has 'fast_cout'"),
        ({"writes": ("mass",)}, "writes mass, which a failed step does not put back"),
    ],
    ids=["a condition that nothing has", "a column that nothing has", "a column that would not be undone"],
)
def test_a_stage_that_the_step_cannot_keep_its_promises_for_is_refused(change, message):
    with pytest.raises(ValueError, match=f"stage close_step.*{message}"):
        check_stages((dataclasses.replace(CLOSING[-1], **change),))


def half_done(state, dt):
    if dt > 1.0:
        return 0


def of_another_code(state, dt):
    return 77


def test_a_stage_returns_a_code_that_is_known():
    with pytest.raises(ValueError, match="stage half_done must return a code on every path: 0, or"):
        Stage(half_done, "nothing")
    program = Program(make_record(STATE, 2), (Stage(of_another_code, "nothing"),), {3: lambda dt: None}, 32)
    with pytest.raises(ValueError, match=r"stage of_another_code returned 77, .*: these are 3, and 0 for"):
        program.run_one("of_another_code", 0.0)
