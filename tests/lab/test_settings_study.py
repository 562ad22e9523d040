"""The study of each field of Settings: it has every field, and its figures agree with theory."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

from carom.framework import Settings
from carom.scenes import drops, jump, stack
from carom.systems.contacts.constants import OWN_SAG
from studies import settings as settings_study
from studies.runner import run
from studies.settings import VARIED, axes, report

pytestmark = [pytest.mark.slow, pytest.mark.early]  # many runs: half a minute or more together

PAGE = Path(__file__).parents[2] / "docs" / "tables" / "settings.md"
EVERY = {(varied.field, varied.scene): varied for varied in VARIED}


def errors(field, scene, *values):
    """The study's errors for these values, without timing."""
    varied = EVERY[field, scene]
    return [varied.facts(value) for value in values or varied.values]


# -- what is varied ------------------------------------------------------------------------------


@pytest.mark.parametrize("varied", VARIED, ids=lambda varied: f"{varied.field} {varied.scene}")
def test_each_field_is_varied_alone(varied):
    assert varied.default == getattr(Settings(), varied.field)
    assert {varied.default} < set(varied.values)
    for value in (varied.values[0], varied.values[-1]):
        with varied.world(value) as world:
            assert world.settings == varied.base.replace(**{varied.field: value})
            steps = varied.timed / world.settings.dt  # whole ones, so that the ratios are true
            assert steps == pytest.approx(round(steps), abs=1e-9)


# -- comparison with theory ----------------------------------------------------------------------


def test_the_first_order_of_the_default_in_the_apex():
    """Semi-implicit Euler leaves out v0 dt / 2 of the height."""
    for dt, found in zip((1 / 30, 1 / 60, 1 / 120, 1 / 240), errors("dt", "jump"), strict=True):
        assert found["apex"] == pytest.approx(jump.JUMP_SPEED * dt / 2, rel=1e-9)


@pytest.mark.parametrize("field", ["dt", "substeps"])
def test_a_tower_gives_way_with_the_square_of_the_substep(field):
    """load |a| / (m w^2), w = 2 pi substeps / 4 dt: largest between the lowest two, under nine boxes, m = 1/2; where
    one box would sink into its like by 0.2 % of its size under itself, contacts are hard."""
    varied = EVERY[field, "stack of 10"]
    for value, found in zip(varied.values, errors(field, "stack of 10"), strict=True):
        settings = varied.base.replace(**{field: value})
        w = math.pi / 2 * settings.substeps / settings.dt
        sag = stack.GRAVITY / (w * w)
        soft = 100 * (stack.BODIES - 1) * 2 * sag if 2 * sag <= OWN_SAG else 0.0
        assert found["overlap"] == pytest.approx(soft, rel=1e-3, abs=1e-4)  # %
        assert found["speed"] < 1.0  # mm/s


def test_what_each_kind_of_collision_loses():
    discrete, continuous, exact = errors("collision", "fast gas")
    assert discrete["outside"] > 20
    assert discrete["missing"] > 50
    assert continuous["outside"] == exact["outside"] == exact["missing"] == 0
    assert abs(continuous["missing"]) < 4


def test_the_first_bounce_that_is_lost():
    """A ball that hits the floor at the threshold v would rise to e^2 v^2 / 2g; the last bounce was higher."""
    varied = EVERY["restitution_threshold", "drops"]
    for threshold in (None, 0.5, 1.0, 2.0):
        speed = 2 * drops.GRAVITY * varied.base.dt if threshold is None else threshold
        limit = 1000 * drops.RESTITUTION**2 * speed**2 / (2 * drops.GRAVITY)
        lost = errors(varied.field, varied.scene, threshold)[0]["lost"]
        assert drops.RESTITUTION**2 * limit < lost <= limit


# -- the tables ----------------------------------------------------------------------------------


def test_the_table(monkeypatch):
    monkeypatch.setattr(settings_study, "ENOUGH", 1e-4)
    chosen = [axis for axis in axes() if (axis.name, axis.of) in (("dt", "jump"), ("sleeping", "pyramid of 210"))]
    (table,), remarks = report(run(chosen, repeats=2))
    assert table.headings == ("field", "scene", "value", "time", "error")
    first, own = table.rows[:2]
    assert (first[:3], first[4]) == (("dt", "jump", "1/30"), "4 px")
    assert own[2].startswith("1/60 (default, ")
    assert (own[:2], own[3:]) == (("", ""), ("1.00", "2 px"))
    assert [row[2].partition(" ")[0] for row in table.rows] == ["1/30", "1/60", "1/120", "1/240", "False", "True"]
    assert "medians of 2" in remarks[0]


def test_the_page_has_all_fields():
    text = PAGE.read_text(encoding="utf-8")
    fields = re.search("<!-- studies settings -->(.*)<!-- end of studies settings -->", text, re.DOTALL)[1]
    for varied in VARIED:
        assert f"| {varied.field} | {varied.scene} | " in fields
        assert f"| {varied.field} | {varied.scene} | " in text.replace(fields, "")  # what its errors are
