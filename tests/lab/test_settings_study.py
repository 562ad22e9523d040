"""The study of each field of Settings: it has every field, and its figures agree with theory."""

from __future__ import annotations

import math
import re
from functools import partial
from pathlib import Path

import pytest

from carom.framework import Settings
from carom.scenes import drops, jump, stack
from carom.systems.contacts.constants import OWN_SAG
from studies.runner import run
from studies.settings import fields as settings_fields
from studies.settings import scenes as settings_scenes
from studies.settings.fields import VARIED
from studies.settings.tables import default_of, report, times

pytestmark = [pytest.mark.slow, pytest.mark.early]  # many runs: half a minute or more together

PAGE = Path(__file__).parents[2] / "docs" / "tables" / "settings.md"
EVERY = {(varied.field, varied.scene): varied for varied in VARIED}


def errors(field, scene, *values):
    """The study's errors for these values, without timing."""
    varied = EVERY[field, scene]
    return [varied.measure(partial(varied.world, value), varied.seconds) for value in values or varied.values]


def works(field, scene):
    """The work of each value of a field, by value; counted, so reproducible."""
    varied = EVERY[field, scene]
    return {value: varied.work(value) for value in varied.values}


# -- what is varied ------------------------------------------------------------------------------


@pytest.mark.parametrize("varied", VARIED, ids=lambda varied: f"{varied.field} {varied.scene}")
def test_each_field_is_varied_alone(varied):
    assert varied.default in varied.values
    assert varied.default == getattr(Settings(), varied.field)
    assert len(set(varied.values)) == len(varied.values) > 1
    assert varied.field not in varied.others
    assert varied.errors
    for value in varied.values:
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


@pytest.mark.long
def test_the_integrators_on_an_orbit():
    names = ("explicit_euler", "semi_implicit_euler", "velocity_verlet", "rk4", "yoshida4")
    found = dict(zip(names, errors("integrator", "orbit"), strict=True))
    assert found["explicit_euler"]["growth"] > 50  # it gains energy at every step
    assert found["semi_implicit_euler"]["energy"] < 10
    assert found["velocity_verlet"]["energy"] < 0.1 * found["semi_implicit_euler"]["energy"]
    for name in ("rk4", "yoshida4"):
        assert found[name]["energy"] < 0.01 * found["velocity_verlet"]["energy"]
    assert found["rk4"]["growth"] < 0  # it loses
    assert abs(found["yoshida4"]["growth"]) < 0.01 * found["yoshida4"]["energy"]  # symplectic: it returns
    work = works("integrator", "orbit")
    assert work["semi_implicit_euler"] == work["explicit_euler"] < work["velocity_verlet"] < work["rk4"]
    assert work["rk4"] == work["yoshida4"]


def test_what_each_kind_of_collision_loses():
    assert [found["wrong"] for found in errors("collision", "shots")] == [7, 0, 0]
    discrete, continuous, exact = errors("collision", "fast gas")
    assert discrete["outside"] > 20
    assert discrete["missing"] > 50
    assert continuous["outside"] == exact["outside"] == exact["missing"] == 0
    assert abs(continuous["missing"]) < 4


@pytest.mark.parametrize(("scene", "share"), [
    ("2,000 boxes in circles", 1 - 2 / math.pi),  # areas of the offsets at which two hit: 4 of 2 pi
    ("2,000 boxes in spheres", 1 - 8 / (4 / 3 * math.pi * 3**1.5)),
])  # fmt: skip
def test_contacts_that_are_none(scene, share):
    precise, bounds = errors("geometry", scene)
    assert precise["false"] == 0
    assert bounds["false"] == pytest.approx(100 * share, abs=6)  # of some hundred contacts


def test_the_first_bounce_that_is_lost():
    """A ball that hits the floor at the threshold v would rise to e^2 v^2 / 2g; the last bounce was higher."""
    varied = EVERY["restitution_threshold", "drops"]
    for threshold in (None, 0.5, 1.0, 2.0):
        speed = 2 * drops.GRAVITY * varied.base.dt if threshold is None else threshold
        limit = 1000 * drops.RESTITUTION**2 * speed**2 / (2 * drops.GRAVITY)
        lost = errors(varied.field, varied.scene, threshold)[0]["lost"]
        assert drops.RESTITUTION**2 * limit < lost <= limit


def test_corners_below_the_slop_are_not_noticed():
    usual = 0.005  # of the size of 1 m
    for slop, found in zip((usual, 0.0, 0.001, 0.02, 0.1), errors("slop", "tiles"), strict=True):
        assert found["stuck"] == pytest.approx(0 if slop else 100, abs=1e-6)
        passed = max((step for step in settings_scenes.STEPS_UP if step < slop), default=0)
        assert found["passed"] == pytest.approx(1000 * passed)


# -- the tables ----------------------------------------------------------------------------------


def test_the_tables(monkeypatch):
    monkeypatch.setattr(settings_fields, "ENOUGH", 1e-4)
    keys = [("dt", "jump"), ("slop", "tiles"), ("sleeping", "pyramid of 210")]
    result = run([EVERY[key].axis() for key in keys], repeats=2)
    line = result.line("dt", "jump")
    assert times(line)[1 / 60].values == (1.0, 1.0)
    assert default_of(line).value == 1 / 60
    (table, meanings), remarks = report(result)
    assert table.headings == ("field", "scene", "value", "time", "work", "error")
    first, own = table.rows[:2]
    assert (first[:3], first[4:]) == (("dt", "jump", "1/30"), ("0.50", "4 px"))
    assert own == ("", "", "1/60 (default)", "1.00", "1.00", "2 px")
    assert len(table.rows) == sum(len(of.samples) for of in result.lines)
    assert [row[:2] for row in meanings.rows] == keys
    assert "repeats of one value lie at most" in remarks[0]


def test_the_page_has_all_fields():
    text = PAGE.read_text(encoding="utf-8")
    fields = re.search("<!-- studies settings -->(.*)<!-- end of studies settings -->", text, re.DOTALL)[1]
    for varied in VARIED:
        assert f"| {varied.field} | {varied.scene} | " in fields
