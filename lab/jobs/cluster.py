"""Runs on other machines: the workers of a dask.distributed cluster, through its Executor of the standard library."""

from __future__ import annotations

import importlib
import importlib.metadata
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ..cli.usage_errors import Problem, one_line
from .workers import Workers

PATIENCE = 10.0  # s to wait for the scheduler
SAME = ("carom", "numpy", "numba")  # their versions decide on the last bit


@contextmanager
def cluster(address: str) -> Iterator[Workers]:
    """The workers at that address, as in "tcp://10.0.0.1:8786".

    Each must be a process of one thread (worlds share what a process has) with the same versions of carom, numpy and
    numba, and must see this folder under the same path. Problem for others, without dask.distributed, and where nothing
    answers. What a worker that dies was running is given to another, by dask.
    """
    try:
        distributed = importlib.import_module("distributed")
    except ImportError as error:
        raise Problem("--cluster needs dask.distributed: pip install 'carom[cluster]'") from error
    try:
        client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise Problem(f"--cluster {address}: {one_line(error)}") from error
    with client:
        workers = Workers(
            _size(client, address), lambda _: client.get_executor(pure=False), (distributed.KilledWorker,)
        )
        try:
            yield workers
        finally:
            workers.end()


def _size(client: Any, address: str) -> int:
    """The number of workers; Problem if there is none, or one that would give other results."""
    workers = client.scheduler_info(n_workers=-1)["workers"]
    if not workers:
        raise Problem(f"--cluster {address}: it has no workers")
    threads = max(worker["nthreads"] for worker in workers.values())
    if threads > 1:
        raise Problem(f"--cluster {address}: a worker has {threads} threads, start workers with --nthreads 1")
    folder = os.getcwd()
    here = facts(folder)
    for worker, there in client.run(facts, folder).items():
        for name, value in here.items():
            if there[name] != value:
                raise Problem(f"--cluster {address}: {name} is {there[name]} on {worker}, here {value}")
    return len(workers)


def facts(folder: str) -> dict[str, str]:
    """What must be the same here and on every worker."""
    versions = {name: importlib.metadata.version(name) for name in SAME}
    return {**versions, f"the folder {folder}": "there" if Path(folder).is_dir() else "missing"}
