"""Runs on the workers of a dask.distributed cluster: the same bits as here, and words where it cannot be."""

from __future__ import annotations

import json
import os
import signal
import sqlite3
import subprocess
import sys
from contextlib import closing

import pytest
from click.testing import CliRunner
from helpers_trade_scenes import BALL, scene_file
from helpers_workers import DEADLINE, Task, alive, marks, perform, until

from carom.lab.cli.main import cli
from carom.lab.cli.usage_errors import Problem
from carom.lab.jobs.runs import Store
from carom.lab.jobs.workers import in_parallel

SHORT = (
    "--seconds", "0.5", "--dt", "1/60,1/120", "--repeats", "2", "--no-timing", "--thorough", "--collisions", "discrete",
    "--integrators", "velocity_verlet",
)  # fmt: skip
PROCESSES = {"dashboard_address": None, "threads_per_worker": 1, "processes": True}


def carom_command(*arguments):
    return CliRunner().invoke(cli, arguments)


def kept(path):
    """Each run in that file, without what it took."""
    with closing(sqlite3.connect(path)) as file:
        found = dict(file.execute("select key, record from runs"))
    return {key: {**json.loads(record), "milliseconds": None} for key, record in found.items()}


def number_kept(path):
    """How many runs are in that file, which may not be there yet."""
    with Store(path) as store:
        return len(store)


def test_without_dask_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    result = carom_command("trade", "jump", "--cluster", "tcp://127.0.0.1:1")
    assert result.exit_code == 2
    assert "pip install 'carom[cluster]'" in result.stderr


@pytest.mark.slow
def test_two_workers_of_a_cluster_give_the_same_bits(tmp_path, monkeypatch):
    distributed = pytest.importorskip("distributed")
    from carom.lab.jobs import runs
    from carom.lab.jobs.cluster import cluster

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(runs, "FEW_SECONDS", 0.0)
    scene_file(tmp_path, BALL)
    with distributed.LocalCluster(n_workers=2, **PROCESSES) as local:
        address = local.scheduler_address
        there = carom_command("trade", "mine.py", *SHORT, "--cluster", address, "--runs", "there.sqlite", "--json")
        with cluster(address) as workers:
            assert workers.size == 2
    here = carom_command("trade", "mine.py", *SHORT, "--workers", "1", "--runs", "here.sqlite", "--json")
    assert (there.exit_code, here.exit_code) == (0, 0), there.stderr
    assert kept("there.sqlite") == kept("here.sqlite")
    found, right = (json.loads(result.stdout)["cases"] for result in (there, here))
    assert found == right
    with Store("there.sqlite") as store:
        assert len(store) >= 2


@pytest.mark.slow
def test_a_cluster_that_would_give_other_results_is_refused(monkeypatch):
    distributed = pytest.importorskip("distributed")
    from carom.lab.jobs import cluster

    monkeypatch.setattr(cluster, "PATIENCE", 1.0)
    with pytest.raises(Problem, match=r"--cluster tcp://127.0.0.1:1"), cluster.cluster("tcp://127.0.0.1:1"):
        pass
    local = distributed.LocalCluster(1, threads_per_worker=2, processes=False, dashboard_address=None)
    with local, pytest.raises(Problem, match="has 2 threads"), cluster.cluster(local.scheduler_address):
        pass


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="there are no signals of this kind")
def test_a_worker_that_dies_costs_its_run_a_retry(tmp_path):
    distributed = pytest.importorskip("distributed")
    from carom.lab.jobs.cluster import cluster

    what = ("square", "killed_once", "square", "square")
    tasks = [Task(name, str(tmp_path), number) for number, name in enumerate(what)]
    with distributed.LocalCluster(n_workers=2, **PROCESSES) as local, cluster(local.scheduler_address) as workers:
        results = list(in_parallel(perform, tasks, workers))
    assert sorted(number for _, number in results) == [0, 1, 4, 9]
    assert marks(tmp_path) == ["0", "1", "1 again", "2", "3"]


ENDED = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored where the tests run in the background of a shell
from carom.__main__ import main
main()
"""


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="there are no signals of this kind")
def test_ctrl_c_ends_at_once_with_what_is_known(tmp_path, monkeypatch):
    """The command prints what it knows after the first runs; nothing goes on running."""
    distributed = pytest.importorskip("distributed")
    monkeypatch.chdir(tmp_path)
    scene_file(tmp_path, BALL)
    with distributed.LocalCluster(n_workers=2, **PROCESSES) as local:
        address = local.scheduler_address
        words = ["trade", "mine.py", "--thorough", "--seconds", "3", "--no-timing", "--cluster", address]
        process = subprocess.Popen(
            [sys.executable, "-c", ENDED, *words, "--collisions", "discrete"],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
        )  # fmt: skip
        until(lambda: number_kept(tmp_path / "out" / "runs.sqlite") > 0)
        os.killpg(process.pid, signal.SIGINT)
        out, err = process.communicate(timeout=DEADLINE)
        assert process.returncode == 130, err
        assert "use Settings(" not in out
        assert "the same command goes on" in err
        until(lambda: not alive(-process.pid))
        with distributed.Client(address, set_as_default=False) as client:
            until(lambda: not any(client.processing().values()))
