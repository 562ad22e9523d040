"""Runs on other machines: the workers of a dask.distributed cluster, through its Executor of the standard library."""

from __future__ import annotations

import importlib
import importlib.metadata
import os
from concurrent.futures import Future
from pathlib import Path
from typing import Any, Self

from ..cli.usage_errors import Problem, one_line
from .workers import Pool, run_message

PATIENCE = 10.0  # s to wait for the scheduler
SAME = ("carom", "numpy", "numba")  # their versions decide on the last bit


class Cluster(Pool):
    """A pool of the workers at that address, as in "tcp://10.0.0.1:8786". A context manager.

    Each worker must be a process of one thread (worlds share what a process has) with the same versions of carom, numpy
    and numba, and must see this folder under the same path. Problem for others, without dask.distributed, and where
    nothing answers. What a worker that dies was running is given to another, by dask.
    """

    def __init__(self, address: str) -> None:
        super().__init__()
        try:
            distributed = importlib.import_module("distributed")
        except ImportError as error:
            raise Problem("--cluster needs dask.distributed: pip install 'carom[cluster]'") from error
        try:
            self._client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
        except (OSError, ValueError) as error:
            raise Problem(f"--cluster {address}: {one_line(error)}") from error
        self.lost = (distributed.KilledWorker,)
        self.folder = os.getcwd()
        try:
            self.size = self._checked(address)
        except BaseException:
            self.close()
            raise

    def _checked(self, address: str) -> int:
        """The number of workers; Problem if there is none, or one that would give other results."""
        workers = self._client.scheduler_info(n_workers=-1)["workers"]
        if not workers:
            raise Problem(f"--cluster {address}: it has no workers")
        threads = max(worker["nthreads"] for worker in workers.values())
        if threads > 1:
            raise Problem(f"--cluster {address}: a worker has {threads} threads, start workers with --nthreads 1")
        here = facts(self.folder)
        for worker, there in self._client.run(facts, self.folder).items():
            for name, value in here.items():
                if there[name] != value:
                    raise Problem(f"--cluster {address}: {name} is {there[name]} on {worker}, here {value}")
        return len(workers)

    def submit(self, workers: int, message: bytes) -> Future[Any]:
        """Hand a task to a worker."""
        del workers
        executor = self._executor = self._executor or self._client.get_executor(pure=False)
        return executor.submit(run_message, message, self.folder)

    def end(self) -> None:
        """Cancel what is waiting; the workers stay."""
        if self._executor is not None:
            self._executor.shutdown(wait=False)
            self._executor = None

    def close(self) -> None:
        """End the connection."""
        self.end()
        self._client.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def facts(folder: str) -> dict[str, str]:
    """What must be the same here and on every worker."""
    versions = {name: importlib.metadata.version(name) for name in SAME}
    return {**versions, f"the folder {folder}": "there" if Path(folder).is_dir() else "missing"}
