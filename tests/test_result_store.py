"""Stored results: however the process ends, each added record is there, once."""

from __future__ import annotations

import io
import json
import math
import os
import platform
import re
import subprocess
import sys

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rich.console import Console

from carom.lab.commands.usage_errors import Problem
from carom.lab.jobs.result_store import Store
from carom.lab.reporting.progress_bar import Bar

RECORDS = {
    "0.01/rk4": {"errors": {"energy": 1e-9}, "failure": None, "counts": {"steps": 100.0}},
    "0.1/rk4": {"errors": {}, "failure": "escaped", "detail": 'é, "quoted"\nand a second line'},
    "last \U0001f3b1": {"errors": {"energy": math.inf}, "low": -math.inf, "tiny": 5e-324, "third": 1 / 3},
}


@pytest.fixture
def path(tmp_path):
    return tmp_path / "results.jsonl"


@pytest.fixture
def kept(path):
    """A file with all records, closed."""
    with Store.open(path) as store:
        for key, record in RECORDS.items():
            store.add(key, record)
    return path


def content(store: Store) -> dict[str, dict | None]:
    return {key: store.get(key) for key in RECORDS if key in store}


# -- contents of the store --------------------------------------------------------------------------------------


def test_records_are_there_when_the_work_is_resumed(kept):
    before = kept.read_bytes()
    with Store.open(kept, resume=True) as store:
        assert len(store) == len(RECORDS)
        assert content(store) == RECORDS
        assert "another" not in store
        assert store.get("another") is None
        store.add("another", {"x": 1})
        assert store.get("another") == {"x": 1}
    assert kept.read_bytes() == before + b'{"key": "another", "x": 1}\n'


def test_each_line_is_one_record(kept):
    lines = [json.loads(line) for line in kept.read_text().splitlines()]
    assert lines == [{"key": key, **record} for key, record in RECORDS.items()]


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=8,
)


@given(key=st.text(), value=json_values)
@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_every_value_comes_back_as_it_was(path, key, value):
    with Store.open(path) as store:
        store.add(key, {"value": value})
        assert repr(store.get(key)) == repr({"value": value})  # repr, so that nan equals nan
    with Store.open(path, resume=True) as store:
        assert repr(store.get(key)) == repr({"value": value})


def test_a_record_looks_the_same_before_and_after(path):
    with Store.open(path) as store:
        store.add("a", {"pair": (1, 2), "by number": {1: math.nan}})
        here = store.get("a")
    with Store.open(path, resume=True) as store:
        assert repr(store.get("a")) == repr(here) == "{'pair': [1, 2], 'by number': {'1': nan}}"


@pytest.mark.parametrize(
    ("key", "record", "kind"),
    [
        ("0.1/rk4", {}, ValueError),
        ("new", {"key": 1}, ValueError),
        (1, {}, TypeError),
        ("new", {"x": {1, 2}}, TypeError),
    ],
)
def test_what_cannot_be_added_leaves_the_file_alone(kept, key, record, kind):
    before = kept.read_bytes()
    with Store.open(kept, resume=True) as store:
        with pytest.raises(kind):
            store.add(key, record)
        assert content(store) == RECORDS
    assert kept.read_bytes() == before


def test_nothing_is_added_to_a_closed_store(path):
    store = Store.open(path)
    store.close()
    store.close()
    with pytest.raises(ValueError, match="closed"):
        store.add("a", {})


def test_a_disk_that_refuses_leaves_no_half_line(kept, monkeypatch):
    def full(handle):
        raise OSError(28, "No space left on device")

    before = kept.read_bytes()
    with Store.open(kept, resume=True) as store:
        monkeypatch.setattr(os, "fsync", full)
        with pytest.raises(OSError, match="No space"):
            store.add("new", {"x": 1})
        assert "new" not in store
        assert kept.read_bytes() == before
        monkeypatch.undo()
        store.add("new", {"x": 2})
    with Store.open(kept, resume=True) as store:
        assert store.get("new") == {"x": 2}


# -- interruptions ----------------------------------------------------------------------------------------------


def test_cut_anywhere_the_file_loses_no_whole_line(kept):
    """A process killed while it wrote the last record, at each byte of it."""
    whole = kept.read_bytes()
    last = whole.rstrip(b"\n").rfind(b"\n") + 1
    *earlier, key = RECORDS
    for length in range(last, len(whole)):
        kept.write_bytes(whole[:length])
        with Store.open(kept, resume=True) as store:
            assert content(store) == {name: RECORDS[name] for name in earlier}
            assert kept.read_bytes() == whole[:last]
            store.add(key, RECORDS[key])
        assert kept.read_bytes() == whole


def test_resuming_before_the_first_result(path):
    for before in (None, b"", b'{"ke'):
        if before is not None:
            path.write_bytes(before)
        with Store.open(path, resume=True) as store:
            assert len(store) == 0
        assert path.read_bytes() == b""


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (b"{'key': 1}\n", "line 2: not a record"),
        (b"\n", "line 2: not a record"),
        (b'{"key": "a", "x": \n', "line 2: not a record"),
        (b'{"x": 1}\n', "line 2: not a record of a run: it has no key"),
        (b'["key"]\n', "line 2: not a record"),
        (b"\xff\n", "line 2: not a record"),
        (b'{"key": "0.01/rk4"}\n', "line 2: a second record of '0.01/rk4'"),
    ],
)
def test_a_line_that_no_store_has_written_is_an_error(kept, line, words):
    first, *others = kept.read_bytes().splitlines(keepends=True)
    spoilt = first + line + b"".join(others)
    kept.write_bytes(spoilt)
    with pytest.raises(Problem, match=words) as problem:
        Store.open(kept, resume=True)
    assert str(kept) in problem.value.message
    assert kept.read_bytes() == spoilt
    assert [p.name for p in kept.parent.iterdir()] == [kept.name]  # no lock is left


def test_a_file_of_another_kind_is_not_cut(path):
    path.write_text("dear diary")
    with pytest.raises(Problem, match="line 1: not a record"):
        Store.open(path, resume=True)
    assert path.read_text() == "dear diary"


def test_without_resume_the_results_of_before_are_put_aside(kept):
    aside = kept.with_name("results.jsonl.before")
    before = kept.read_bytes()
    aside.write_text("older")
    for _ in range(2):  # the second time there is nothing to keep
        with Store.open(kept) as store:
            assert len(store) == 0
        assert kept.read_bytes() == b""
        assert aside.read_bytes() == before


@pytest.mark.parametrize("resume", [False, True])
@pytest.mark.parametrize("where", ["", "missing/results.jsonl"])
def test_a_place_where_no_file_can_be(tmp_path, where, resume):
    with pytest.raises(Problem, match="results cannot be kept in"):
        Store.open(tmp_path / where, resume)
    assert list(tmp_path.iterdir()) == []


# -- one process at a time --------------------------------------------------------------------------------------


def test_a_file_in_use_is_refused(path):
    lock = path.with_name("results.jsonl.lock")
    with Store.open(path) as store:
        store.add("a", {})
        for resume in (False, True):
            with pytest.raises(Problem, match=rf"being written by process {os.getpid()} .* delete") as problem:
                Store.open(path, resume)
            assert str(path) in problem.value.message
            assert str(lock) in problem.value.message
        assert lock.exists()
        store.add("b", {})
    assert not lock.exists()
    with Store.open(path, resume=True) as store:
        assert len(store) == 2


def test_what_a_killed_process_added_is_there_and_its_lock_is_taken_over(path):
    """It is killed within add, while a record is being written: after ten whole ones."""
    script = (
        "import os, sys; from carom.lab.jobs.result_store import Store\n"
        "store = Store.open(sys.argv[1])\n"
        "for number in range(10): store.add(str(number), {'square': number**2})\n"
        "os.fsync = lambda handle: os._exit(9)\n"
        "store.add('10', {'square': 100})\n"
    )
    assert subprocess.run([sys.executable, "-c", script, str(path)], check=False).returncode == 9
    lock = path.with_name("results.jsonl.lock")
    assert lock.exists()
    with Store.open(path, resume=True) as store:
        assert [store.get(str(number)) for number in range(11)] == [{"square": number**2} for number in range(11)]
        assert lock.read_text().split()[0] == str(os.getpid())
    assert not lock.exists()


@pytest.mark.parametrize(
    "owner", ["1 another-machine", "", "nonsense", f"0 {platform.node()}", f"-1 {platform.node()}"]
)
def test_a_lock_that_may_not_be_abandoned_is_kept(path, owner):
    lock = path.with_name("results.jsonl.lock")
    lock.write_text(owner)
    with pytest.raises(Problem, match="being written by"):
        Store.open(path)
    assert lock.read_text() == owner


def test_of_two_that_take_an_abandoned_lock_one_gets_it(path, monkeypatch):
    """The second one has removed the lock that the first had just made, and made its own."""
    lock = path.with_name("results.jsonl.lock")
    lock.write_text(f"{2**22 + 1} {platform.node()}\n")  # above Linux's largest process id
    monkeypatch.setattr("carom.lab.jobs.result_store.time.sleep", lambda _: lock.write_text("1 faster\n"))
    with pytest.raises(Problem, match="process 1 on faster"):
        Store.open(path)
    assert lock.read_text() == "1 faster\n"


# -- the time left ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("done", "left"), [(0, "0:07:40"), (900, "0:00:10")])
def test_the_time_left_counts_what_was_resumed_as_done_and_not_as_fast(done, left):
    """After 80 of 1000 in 40 s; 900 resumed ones take no time and do not count for the rate."""
    now = 0.0
    shown = io.StringIO()
    console = Console(file=shown, force_terminal=True, width=80, get_time=lambda: now)
    with Bar(console) as bar:
        bar.begin(1000, done)
        for _ in range(4):
            now += 10
            bar.advance(20)
        assert bar.done == done + 80
        bar.say("runs")
    assert re.findall(r"\d:\d\d:\d\d", shown.getvalue())[-1] == left
