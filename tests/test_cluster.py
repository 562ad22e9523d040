"""Runs on the workers of a dask.distributed cluster: the same bits as here, and words where it cannot be."""

from __future__ import annotations

import json
import sqlite3
import sys
from contextlib import closing

import pytest
from click.testing import CliRunner
from helpers_trade_scenes import BALL, scene_file

from carom.lab.cli import cli
from carom.lab.commands.usage_errors import Problem
from carom.lab.jobs.result_store import Store

SHORT = (
    "--seconds", "0.5", "--dt", "1/60,1/120", "--repeats", "2", "--no-timing", "--thorough", "--collisions", "discrete",
    "--integrators", "velocity_verlet",
)  # fmt: skip


def carom_command(*arguments):
    return CliRunner().invoke(cli, arguments)


def kept(path):
    """Each run in that file, without what it took."""
    with closing(sqlite3.connect(path)) as file:
        found = dict(file.execute("select key, record from runs"))
    return {key: {**json.loads(record), "milliseconds": None} for key, record in found.items()}


def test_without_dask_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    result = carom_command("trade", "jump", "--cluster", "tcp://127.0.0.1:1")
    assert result.exit_code == 2
    assert "pip install 'carom[cluster]'" in result.stderr


@pytest.mark.slow
def test_two_workers_of_a_cluster_give_the_same_bits(tmp_path, monkeypatch):
    distributed = pytest.importorskip("distributed")
    from carom.lab.jobs import runs
    from carom.lab.jobs.cluster import Cluster

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(runs, "FEW_SECONDS", 0.0)
    scene_file(tmp_path, BALL)
    settings = {"dashboard_address": None, "threads_per_worker": 1, "processes": True}
    with distributed.LocalCluster(n_workers=2, **settings) as local:
        address = local.scheduler_address
        there = carom_command("trade", "mine.py", *SHORT, "--cluster", address, "--runs", "there.sqlite", "--json")
        with Cluster(address) as cluster:
            assert cluster.size == 2
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
    with pytest.raises(Problem, match=r"--cluster tcp://127.0.0.1:1"):
        cluster.Cluster("tcp://127.0.0.1:1")
    local = distributed.LocalCluster(1, threads_per_worker=2, processes=False, dashboard_address=None)
    with local, pytest.raises(Problem, match="has 2 threads"):
        cluster.Cluster(local.scheduler_address)
