"""The runner of the studies, its command, the pages it fills, and the studies that only measure: their figures may be
anything on a busy machine, so what is tested is their meaning."""

from __future__ import annotations

import os
import re
from dataclasses import replace

import pytest
from click.testing import CliRunner

from carom.lab.cli.usage_errors import Problem
from studies import features, joints, startup
from studies.__main__ import STUDIES, cli
from studies.accuracy import KNOWN
from studies.runner import Axis, run


@pytest.fixture
def studies(tmp_path, monkeypatch):
    """``python -m studies`` in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return lambda *arguments: CliRunner(env={"COLUMNS": "200"}).invoke(cli, arguments)


# -- the runner ----------------------------------------------------------------------------------


def test_each_value_is_measured_in_each_repeat_another_one_first():
    taken = []

    def measure(value, repeat):
        taken.append((repeat, value))
        return {"ns": 10.0 * value + repeat}

    (line,) = run([Axis("n", "here", (1, 2, 3), measure, lambda value: {"even": value % 2 == 0})], repeats=2).lines
    assert taken == [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (1, 1)]
    sample = line.sample(2)
    assert (sample.figures["ns"].values, sample.facts) == ((20.0, 21.0), {"even": True})
    with pytest.raises(KeyError, match="n, here: 4 was not measured"):
        line.sample(4)


# -- the command and its pages -------------------------------------------------------------------


@pytest.mark.slow
def test_a_study_prints_draws_and_fills_a_page(studies, tmp_path):
    page = tmp_path / "page.md"
    page.write_text("# Page\n\n<!-- studies limits -->\nold\n<!-- end of studies limits -->\nafter\n")
    done = studies("limits", "distance", "--quick", "--into", "page.md", "--out", "pictures")
    assert done.exit_code == 0, done.output
    assert done.stdout.startswith("distance from the origin")
    assert (tmp_path / "pictures" / "limits.png").read_bytes().startswith(b"\x89PNG")
    text = page.read_text()
    assert "| method | 1 % at | 10 % at | breaks at | worst | how |" in text
    assert "old" not in text
    assert text.startswith("# Page\n\n<!-- studies limits -->\n\n**distance from the origin")
    assert text.endswith("\n\n<!-- end of studies limits -->\nafter\n")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("limits", "sped"), "no axis 'sped'; did you mean 'speed'?"),
        (("settings", "substep"), "no axis 'substep'; did you mean 'substeps'"),
        (("startup", "nothing"), "no axis 'nothing'"),
        (("ladder", "--long"), "No such option"),
        (("scaling", "--repeats", "0"), "0 is not in the range x>=1"),
        (("limits", "--into", "nowhere.md"), "--into nowhere.md: No such file"),
        (("accuracy", "spring", "--into", "page.md"), "it has no line <!-- studies accuracy -->"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line_before_the_run(studies, tmp_path, arguments, words):
    (tmp_path / "page.md").write_text("nothing\n")
    done = studies(*arguments)
    assert done.exit_code == 2
    assert words in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


@pytest.mark.parametrize("name", STUDIES)
def test_the_axes_of_a_study_have_names_of_their_own(name):
    for quick in (False, True):
        axes = STUDIES[name].chosen((), quick)
        assert axes
        assert len({(axis.name, axis.of) for axis in axes}) == len(axes)


# -- scaling, ladder, startup --------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("rungs", [features.LADDER, features.SPINS], ids=["ladder", "spins"])
def test_features_are_measured_beside_the_same_scene_without(rungs, monkeypatch):
    monkeypatch.setattr(features, "STEPS", 2)
    result = run(features.axes(rungs, 30), repeats=2)
    (table,), _ = features.report(rungs, result)
    assert [row[:2] for row in table.rows] == [(feature, beside) for feature, (beside, _) in rungs.items()]
    (line,) = result.lines
    for feature, beside, ns, more, times, _ in table.rows:
        of = line.sample(feature).figures["ns"]
        assert float(ns.replace(",", "")) == pytest.approx(of.median, rel=0.01)
        if beside:
            other = line.sample(beside).figures["ns"]
            assert float(more) == pytest.approx(of.median - other.median, abs=0.06)
            pairs = [one / two for one, two in zip(of.values, other.values, strict=True)]
            assert float(times.replace(",", "")) == pytest.approx(sum(pairs) / 2, rel=0.01)


def test_a_feature_adds_what_it_says():
    def kernels(build):
        with build(30) as world:
            world.step()
            return {row.kernel for row in world.plan().kernels}

    for rungs, feature, more in (
        (features.LADDER, "velocity_verlet", {"verlet_drift"}), (features.LADDER, "two levels", {"evaluate_levels"}),
        (features.LADDER, "gravity", set()), (features.LADDER, "friction", set()),
        (features.SPINS, "stacks of boxes with a Spin", {"turn_bodies", "share_spins", "solve_turning_contacts",
                                                         "take_spins"}),
    ):  # fmt: skip
        beside, build = rungs[feature]
        added = kernels(build) - kernels(rungs[beside][1])
        assert added >= more if more else not added


@pytest.mark.slow
def test_what_substeps_and_shorter_steps_buy_joints():
    """A quarter of the gap for twice the rate, or nearly."""
    tables, _ = joints.report(run(joints.axes(quick=True), 1))
    for table, values in zip(tables, (("2", "4", "8"), ("60", "120", "240")), strict=True):
        assert tuple(row[0] for row in table.rows) == values
        gaps = [float(row[1]) for row in table.rows]
        assert 0.5 * gaps[0] > gaps[1] > 0.0
        assert 0.5 * gaps[1] > gaps[2] > 0.0
        assert float(table.rows[-1][2]) < 0.05


def test_startup_times_processes_with_caches_of_their_own(studies, monkeypatch):
    """The order matters: each repeat fills an empty cache, then uses it; with shipped kernels it is empty again."""
    started, shipped = [], []

    def start(scene, cache, portable):
        started.append((cache, portable != ""))
        found = {"imports": 0.25, "first": 0.125, "worst": 0.002, "compiled": 3, "peak": 130.0}
        return {"seconds": float(len(started)), **found}

    monkeypatch.setattr(startup, "_ship", lambda scene, folder: shipped.append(scene))
    monkeypatch.setattr(startup, "_start", start)
    done = studies("startup", "jump", "--repeats", "2")
    caches = [cache for cache, _ in started]
    assert shipped == ["jump"]
    assert [portable for _, portable in started] == [False, False, True] * 2
    assert [caches[0] == caches[1], len(set(caches))] == [True, 4]
    assert "jump shipped 3 4.50 3.00 .. 6.00 0.250 0.125 2.00 130" in re.sub(" +", " ", done.stdout)


@pytest.mark.slow
def test_a_process_is_timed_and_one_that_fails_is_no_measurement():
    found = startup._start("jump", os.environ["CAROM_CACHE_DIR"], "")
    assert 0 < found["imports"] < found["seconds"]
    assert 0 < found["worst"] < found["seconds"]
    assert found["compiled"] >= 0
    assert 50 < found["peak"] < 5000
    with pytest.raises(Problem, match="nothing"):
        startup._run("-c", "import nothing")


# -- accuracy ------------------------------------------------------------------------------------


@pytest.mark.slow
def test_accuracy_finds_the_orders_of_the_methods_and_fills_a_page(studies, tmp_path, monkeypatch):
    """Against a reference of its own: first order for both Euler methods, 2 for velocity Verlet, 4 for the others."""
    short = replace(KNOWN["spring"], steps=(1 / 60, 1 / 120, 1 / 240), seconds=0.9, repeats=1)
    monkeypatch.setitem(KNOWN, "spring", short)
    page = tmp_path / "page.md"
    page.write_text("<!-- studies accuracy -->\nold\n<!-- end of studies accuracy -->\n")
    done = studies("accuracy", "spring", "--into", "page.md", "--out", "pictures")
    assert done.exit_code == 0, done.output
    rows = [row.split(" | ") for row in page.read_text().splitlines() if row.startswith("| ")][2:]
    orders = {"explicit euler": 1, "semi implicit euler": 1, "velocity verlet": 2, "rk4": 4, "yoshida4": 4}
    assert [row[0].strip("| ") for row in rows] == list(orders)
    for row, order in zip(rows, orders.values(), strict=True):
        assert float(row[1]) == pytest.approx(order, abs=0.3)
    assert (tmp_path / "pictures" / "trade-spring-position.png").exists()
    assert "no axis 'sprin'; did you mean 'spring'" in studies("accuracy", "sprin").stderr
