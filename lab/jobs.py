"""Runs on all cores, kept as they finish: joblib's processes and store; without joblib one process that keeps nothing.

Several machines: joblib's backend for a dask.distributed cluster.
"""

from __future__ import annotations

import importlib
import importlib.metadata
import weakref
from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import click

from ..framework.compilation import log
from .cli.usage_errors import Problem, one_line
from .reporting.progress import NO_PROGRESS, Progress

try:
    joblib: Any = importlib.import_module("joblib")
except ImportError:
    joblib = None

FEW_SECONDS = 15.0  # of work: other processes, which have to load all kernels, would save less than they cost
PATIENCE = 10.0  # s to wait for the scheduler of a cluster
SAME = ("carom", "numpy", "numba")  # their versions decide on the last bit
MISSING = "joblib is missing: one process, and no run is kept for later; pip install 'carom[lab]'"


class Jobs:
    """Performs tasks with so many processes (None: one a core), or on the workers of the cluster at that address; their
    results are kept in the folder (None: nowhere). ValueError for fewer than one; Problem for a cluster that cannot be
    used."""

    def __init__(
        self, workers: int | None = None, folder: Path | None = None, progress: Progress = NO_PROGRESS,
        cluster: str = "",
    ) -> None:  # fmt: skip
        if workers is not None and (not isinstance(workers, int) or isinstance(workers, bool) or workers < 1):
            raise ValueError(f"workers must be a whole number of at least 1, not {workers!r}")
        self.workers, self.progress = workers, progress
        self._client = _client(cluster) if cluster else None
        if self._client is not None:
            weakref.finalize(self, self._client.close)
        self._kept: Any = None
        if folder is not None and joblib is not None:
            self._kept = joblib.Memory(folder, verbose=0).cache(_result, ignore=["function", "task"])
        elif folder is not None:
            click.echo(f"carom: {MISSING}", err=True)

    def all(self, function: Callable[[Any], Any], tasks: Sequence[Any], what: str) -> list[Any]:
        """The function's result for each task, in order; those that are kept are not performed again.

        task.key: identifies its result; "" if it cannot be kept. task.cost: about how long it takes, s. An exception of
        the function ends all and is raised here. Problem for a worker that dies: what has finished is kept.
        """
        calls = [(self._kept if self._kept and task.key else _result, task.key, function, task) for task in tasks]
        new = [call for call in calls if call[0] is _result or not call[0].check_call_in_cache(*call[1:])]
        left = sum(task.cost for *_, task in new)
        self.progress.begin(left)
        self.progress.say(what)
        alone = joblib is None or self.workers == 1 or left < FEW_SECONDS
        found = []
        try:
            for result, task in zip(self._results(calls, alone and self._client is None), tasks, strict=True):
                found.append(result)
                self.progress.advance(min(task.cost, left - self.progress.done))
        except Exception as error:
            if not isinstance(error, BrokenExecutor) and type(error).__name__ != "KilledWorker":  # the latter: dask's
                raise
            why = one_line(error).partition(". ")[0]
            raise Problem(f"a process ended before its run did, killed or out of memory: {why}") from error
        return found

    def _results(self, calls: Sequence[tuple[Any, ...]], alone: bool) -> Any:
        if alone:
            return (call(*given) for call, *given in calls)
        there = nullcontext() if self._client is None else joblib.parallel_config(backend="dask", client=self._client)
        with there:
            parallel = joblib.Parallel(n_jobs=self.workers or -1, return_as="generator", batch_size=1)
            return parallel(joblib.delayed(_elsewhere)(*call) for call in calls)


def _result(key: str, function: Callable[[Any], Any], task: Any) -> Any:
    """What the store keeps by the key."""
    del key
    return function(task)


def _elsewhere(call: Any, *given: Any) -> Any:
    """In a worker, which does not announce that it compiles, as the first process has."""
    log.announced = True
    return call(*given)


def _client(address: str) -> Any:
    """A client of the scheduler there; Problem for one that cannot be reached, has no workers, or such that would give
    other results or have several threads: worlds share what a process has."""
    if joblib is None:
        raise Problem(f"--cluster: {MISSING}")
    try:
        client = importlib.import_module("distributed").Client(address, timeout=PATIENCE, set_as_default=False)
        threads = [worker["nthreads"] for worker in client.scheduler_info(n_workers=-1)["workers"].values()]
        if max(threads, default=0) != 1:
            raise ValueError(f"start workers with --nthreads 1; it has {threads or 'none'}")
        here = _versions()
        for worker, there in client.run(_versions).items():
            if there != here:
                raise ValueError(f"{worker} has {there}, here {here}")
        return client
    except ImportError as error:
        raise Problem("--cluster needs dask.distributed: pip install 'carom[cluster]'") from error
    except (OSError, ValueError) as error:
        raise Problem(f"--cluster {address}: {one_line(error)}") from error


def _versions() -> dict[str, str]:
    return {name: importlib.metadata.version(name) for name in SAME}
