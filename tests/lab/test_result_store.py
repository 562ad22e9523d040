"""Finished runs in a file: kept as they were, by any process, and shown as done."""

from __future__ import annotations

import io
import math
import re

import pytest
from helpers_processes import run_python
from rich.console import Console

from carom.lab.cli.usage_errors import Problem
from carom.lab.jobs.runs import Store
from carom.lab.reporting.progress import Progress

RECORDS = {
    "one": {"error": 0.1, "counts": {"steps": 60.0}},
    "two": {"error": math.inf, "cell": [1 / 3, "rk4", None, True]},
    "\u00e9\n": {},
}


@pytest.fixture
def path(tmp_path):
    return tmp_path / "new" / "runs.sqlite"


def test_records_come_back_as_they_were_in_later_calls_too(path):
    with Store(path) as store:
        assert len(store) == 0
        for key, record in RECORDS.items():
            store.add(key, record)
    with Store(path) as store:
        assert len(store) == len(RECORDS)
        assert {key: store.get(key) for key in RECORDS} == RECORDS
        assert "two" in store
        assert "three" not in store
        assert store.get("three") is None
        store.add("one", {"error": 0.2})
        assert store.get("one") == {"error": 0.2}
    assert Store().get("one") is None


def test_two_processes_may_use_one_file(path):
    with Store(path) as store:
        store.add("mine", {})
        code = f"""
from carom.lab.jobs.runs import Store
with Store({str(path)!r}) as store:
    print(len(store))
    store.add("theirs", {{"pi": 3.14}})
"""
        assert run_python(code).stdout.strip() == "1"
        assert store.get("theirs") == {"pi": 3.14}


def test_a_file_of_another_kind_is_left_alone(path):
    path.parent.mkdir()
    path.write_text("a novel\n" * 400)
    with pytest.raises(Problem, match=r"results cannot be kept in .*runs\.sqlite"):
        Store(path)
    assert path.read_text() == "a novel\n" * 400
    with pytest.raises(Problem, match="results cannot be kept"):
        Store(path / "below")


# -- the time left ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("done", "left"), [(0, "0:07:40"), (900, "0:00:10")])
def test_the_time_left_counts_what_was_resumed_as_done_and_not_as_fast(done, left):
    """After 80 of 1000 in 40 s; 900 resumed ones take no time and do not count for the rate."""
    now = 0.0
    shown = io.StringIO()
    console = Console(file=shown, force_terminal=True, width=80, get_time=lambda: now)
    with Progress(console) as bar:
        bar.begin(1000, done)
        for _ in range(4):
            now += 10
            bar.advance(20)
        assert bar.done == done + 80
        bar.say("runs")
    assert re.findall(r"\d:\d\d:\d\d", shown.getvalue())[-1] == left


def test_without_a_terminal_there_is_a_line_now_and_then(monkeypatch):
    now = 100.0
    monkeypatch.setattr("carom.lab.reporting.progress.time.monotonic", lambda: now)
    shown = io.StringIO()
    with Progress(Console(file=shown)) as bar:
        bar.begin(40)
        for _ in range(40):
            now += 1
            bar.say("runs")
            bar.advance(1)
    lines = shown.getvalue().splitlines()
    assert len(lines) == 8
    assert lines[-1] == "runs: 98 %"
