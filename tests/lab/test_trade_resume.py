"""Results of `trade()` are kept: over interruptions, killed workers, and any number of workers."""

from __future__ import annotations

import os
import sqlite3
from contextlib import closing

import pytest
from helpers_trade_scenes import BALL, dies, scene_file

from carom.lab import Only, Trade, trade
from carom.lab.cases import case as cases
from carom.lab.jobs import runs as trade_runs
from carom.lab.jobs.runs import Store
from carom.lab.jobs.tasks import perform
from carom.lab.trading.records import STOPPED

pytestmark = [pytest.mark.slow, pytest.mark.early]  # many runs: half a minute or more together

needs_signals = pytest.mark.skipif(os.name == "nt", reason="there are no signals of this kind")
FEW = {
    "timing": False,
    "repeats": 2,
    "steps": (1 / 30, 1 / 60),
    "only": Only(("semi_implicit_euler", "velocity_verlet"), ("continuous",)),
}
RUNS = 2 * 2 * 2 + 3  # methods, steps, repeats; and three references


def measured(target, folder=None, workers=1, **options) -> Trade:
    with Store(folder and folder / "runs.sqlite") as store:
        return trade(target, workers=workers, store=store, **{**FEW, **options})


@pytest.fixture(autouse=True, scope="module")
def however_few():
    """Workers are used even for small amounts of work, and references are no better than they must be here."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(trade_runs, "FEW_SECONDS", 0)
        patch.setattr(cases, "FINER", 2)
        yield


@pytest.fixture
def performed(monkeypatch):
    """The keys of the tasks that ran, in this process."""
    ran: list[str] = []

    def counted(task):
        ran.append(task.key)
        return perform(task)

    monkeypatch.setattr(trade_runs, "perform", counted)
    return ran


@pytest.fixture(scope="module")
def ball(tmp_path_factory):
    return scene_file(tmp_path_factory.mktemp("scene"), BALL)


@pytest.fixture(scope="module")
def whole(ball) -> Trade:
    """Measured in one call, in one process, without a store."""
    return measured(ball)


def keys(folder) -> list[str]:
    """Of the runs that are kept, in the order in which they finished."""
    with closing(sqlite3.connect(folder / "runs.sqlite")) as file:
        return [key for (key,) in file.execute("select key from runs order by rowid")]


def test_nothing_is_performed_twice_when_it_goes_on(ball, whole, performed, tmp_path):
    assert measured(ball, tmp_path) == whole
    assert len(performed) == len(set(performed)) == RUNS
    assert keys(tmp_path) == performed
    performed.clear()
    assert measured(ball, tmp_path) == whole
    assert performed == []


def test_quick_runs_are_the_same_each_time_and_leave_out_what_is_clearly_worse():
    """Explicit Euler costs hardly less than velocity Verlet with the same step, and is more than four times worse."""
    plan = {"only": Only(("explicit_euler", "velocity_verlet"), ("continuous",)), "repeats": 4}

    def repeats(**options):
        (case,) = measured("spring", **plan, **options).cases
        return {(point.cell.integrator, round(1 / point.cell.dt)): point.repeats for point in case.points}

    cut = {("explicit_euler", 60): 1, ("explicit_euler", 30): 1}
    every = {(name, steps): 4 for name in ("explicit_euler", "velocity_verlet") for steps in (30, 60)}
    assert repeats(quick=True) == repeats(quick=True) == every | cut
    assert repeats() == every


def test_results_of_another_scene_time_or_step_are_not_taken(ball, performed, tmp_path):
    only = {"only": Only(("velocity_verlet",), ("continuous",)), "steps": (1 / 30,), "repeats": 1}
    measured(ball, tmp_path, **only)
    before = len(performed)
    measured(ball, tmp_path, **only)
    assert len(performed) == before
    for change in ({"seconds": 1.5}, {"steps": (1 / 20,)}, {"options": {"speed": 2.0}}, {"seed": 1}):
        before = len(performed)
        measured(ball, tmp_path, **{**only, **change})
        assert len(performed) == before + 4, change  # the point and three references


@needs_signals
def test_a_run_that_always_kills_its_worker_is_a_failed_run(ball, whole, tmp_path, monkeypatch):
    """Its process ended twice; the other runs are not affected."""
    measured(ball, tmp_path)
    with closing(sqlite3.connect(tmp_path / "runs.sqlite", isolation_level=None)) as file:
        file.execute("delete from runs where key = ?", keys(tmp_path)[-1:])  # only the last run is missing
    monkeypatch.setattr(trade_runs, "perform", dies)
    found = measured(ball, tmp_path, workers=2)
    [(point, before)] = [
        (one, other)
        for curve, old in zip(found.cases[0].curves, whole.cases[0].curves, strict=True)
        for one, other in zip(curve.points, old.points, strict=True)
        if one != other
    ]
    assert point.failures == {STOPPED: 1}
    assert before.failures == {}
