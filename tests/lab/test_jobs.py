"""Runs on all cores: their results, the store, workers that die, Ctrl-C, and what happens without joblib."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

import pytest
from click.testing import CliRunner
from helpers_trade_scenes import BALL, scene_file

from carom.lab import jobs
from carom.lab.cli.main import cli
from carom.lab.cli.usage_errors import Problem
from carom.lab.jobs import Jobs

needs_signals = pytest.mark.skipif(os.name == "nt", reason="there are no signals of this kind")
SHORT = ("--dt", "1/60", "--repeats", "2", "--no-timing", "--collisions", "discrete", "--seconds", "0.2")
NOTED = '    print("said")\n    open(Path(__file__).with_name("ran"), "a").write(".")\n    world = World'
COUNTING = BALL.replace("    world = World", NOTED, 1)
DEADLY = BALL.replace("    world = World", "    import multiprocessing, os, signal\n"
                      "    if multiprocessing.parent_process() is not None:\n"
                      "        os.kill(os.getpid(), signal.SIGKILL)\n    world = World", 1)  # fmt: skip
DEADLINE = 120.0  # s, for a loaded machine; reached only by failing tests


class Task(NamedTuple):
    number: int
    key: str = ""
    cost: float = 1.0


def double(task: Task) -> tuple[int, int]:
    return 2 * task.number, os.getpid()


def fails(task: Task) -> None:
    raise ValueError(f"number {task.number}")


@pytest.fixture
def at_once(monkeypatch):
    """Workers are used even for little work."""
    pytest.importorskip("joblib")
    monkeypatch.setattr(jobs, "FEW_SECONDS", 0.0)


@pytest.fixture
def carom(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return lambda *words: CliRunner(env={"COLUMNS": "200"}).invoke(cli, words)


@pytest.mark.slow
def test_results_come_in_order_from_other_processes(at_once):
    tasks = [Task(number) for number in (3, 1, 2, 4)]
    found = Jobs(2).all(double, tasks, "doubling")
    assert [value for value, _ in found] == [6, 2, 4, 8]
    assert os.getpid() not in {pid for _, pid in found}
    assert Jobs(1).all(double, tasks, "doubling") == [(2 * task.number, os.getpid()) for task in tasks]
    with pytest.raises(ValueError, match="number"):
        Jobs(2).all(fails, tasks, "failing")


@pytest.mark.parametrize("workers", [0, -1, 1.5, True, "2"])
def test_a_number_of_workers_that_is_none(workers):
    with pytest.raises(ValueError, match="workers must be a whole number"):
        Jobs(workers)


def test_what_is_kept_is_not_performed_again(tmp_path):
    pytest.importorskip("joblib")
    ran = []

    def noted(task):
        ran.append(task.key)
        return task.number

    tasks = [Task(1, "a"), Task(2, "b"), Task(3, "a"), Task(4)]  # the key counts; the last one cannot be kept
    assert Jobs(1, tmp_path).all(noted, tasks, "first") == [1, 2, 1, 4]
    assert Jobs(1, tmp_path).all(noted, tasks, "again") == [1, 2, 1, 4]
    assert ran == ["a", "b", "", ""]


@pytest.mark.slow
def test_a_changed_file_or_question_is_measured_anew(carom, tmp_path):
    pytest.importorskip("joblib")
    scene_file(tmp_path, COUNTING)
    counts = []

    def builds(*words):
        before = (tmp_path / "ran").stat().st_size if counts else 0
        assert carom("trade", "mine.py", *SHORT, *words).exit_code == 0
        counts.append((tmp_path / "ran").stat().st_size - before)
        return counts[-1]

    first, again = builds(), builds()
    assert first > again  # what looks at the file builds it, too
    assert builds("--seed", "1") == builds("--option", "speed=2") == first
    scene_file(tmp_path, COUNTING + "# changed\n")
    assert builds() == first


@pytest.mark.slow
def test_without_joblib_one_process_does_it_and_says_so_once(carom, tmp_path, monkeypatch):
    with_it = carom("trade", "jump", *SHORT, "--json")
    monkeypatch.setattr(jobs, "joblib", None)
    without = carom("trade", "jump", *SHORT, "--json")
    assert without.exit_code == 0, without.output
    assert without.stderr.count("joblib is missing: one process") == 1
    assert without.stdout == with_it.stdout
    refused = carom("trade", "jump", "--cluster", "tcp://127.0.0.1:1")
    assert refused.exit_code == 2
    assert "joblib is missing" in refused.stderr


@pytest.mark.slow
@needs_signals
def test_a_worker_that_dies_ends_the_command_with_one_line(carom, tmp_path, at_once):
    scene_file(tmp_path, DEADLY)
    done = carom("trade", "mine.py", *SHORT)
    assert done.exit_code == 2
    assert done.stderr.splitlines()[-1].startswith("carom: a process ended before its run did, killed or out of memory")
    assert done.stdout == ""


ENDED = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored where the tests run in the background of a shell
from carom.lab import jobs
jobs.FEW_SECONDS = 0.0
from carom.__main__ import main
main()
"""


@pytest.mark.slow
@needs_signals
def test_ctrl_c_ends_all_processes_and_says_what_is_kept(tmp_path):
    pytest.importorskip("joblib")
    scene_file(tmp_path, COUNTING.replace("seconds = 1.7", "seconds = 5000"))
    words = ["trade", "mine.py", "--no-timing", "--workers", "2"]
    process = subprocess.Popen(
        [sys.executable, "-c", ENDED, *words], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
    )  # fmt: skip
    end = time.monotonic() + DEADLINE
    while not (Path(tmp_path / "ran").exists() and (tmp_path / "ran").stat().st_size > 3):
        assert time.monotonic() < end
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=DEADLINE)
    assert process.returncode == 130, err
    assert out == ""
    assert err.splitlines()[-1] == "carom: stopped; finished runs are kept in out/runs, the same command goes on"
    while time.monotonic() < end:
        try:
            os.killpg(process.pid, 0)
        except ProcessLookupError:
            return
        time.sleep(0.05)
    raise AssertionError("a process of its group is left")


@pytest.mark.slow
def test_a_cluster_gives_the_same_bits_and_one_that_would_not_is_refused(carom, tmp_path, monkeypatch):
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr(jobs, "PATIENCE", 1.0)
    scene_file(tmp_path, BALL)
    here = carom("trade", "mine.py", *SHORT, "--json", "--runs", "here")
    with distributed.LocalCluster(2, threads_per_worker=1, dashboard_address=None) as local:
        address = local.scheduler_address
        there = carom("trade", "mine.py", *SHORT, "--json", "--runs", "there", "--cluster", address)
        assert there.exit_code == 0, there.stderr
        assert there.stdout.partition('"scenes"')[2] == here.stdout.partition('"scenes"')[2] != ""
        assert len(list(Path("there").rglob("output.pkl"))) == len(list(Path("here").rglob("output.pkl"))) > 4
        monkeypatch.setattr(jobs, "SAME", ("carom", "click"))
        with pytest.raises(Problem, match="here"):
            Jobs(cluster=address)
    with pytest.raises(Problem, match=r"--cluster tcp://127.0.0.1:1: "):
        Jobs(cluster="tcp://127.0.0.1:1")
    local = distributed.LocalCluster(1, threads_per_worker=2, processes=False, dashboard_address=None)
    with local, pytest.raises(Problem, match="start workers with --nthreads 1"):
        Jobs(cluster=local.scheduler_address)


def test_without_dask_it_says_what_to_install(carom, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    result = carom("trade", "jump", "--cluster", "tcp://127.0.0.1:1")
    assert result.exit_code == 2
    assert "pip install 'carom[cluster]'" in result.stderr
