"""Tasks on an executor: processes of this machine by default, and a process that dies affects only its own task."""

from __future__ import annotations

import logging
import math
import multiprocessing
import os
import pickle
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.synchronize import Semaphore
from types import ModuleType
from typing import Any, TypeVar

from ...framework.compilation import log
from ..cli.usage_errors import Problem, one_line

Task = TypeVar("Task")
Result = TypeVar("Result")

TRIES = 2  # attempts at a task whose worker dies
GRACE = 2.0  # s that tasks have to end by themselves when time is up

logger = logging.getLogger("carom")


@dataclass(frozen=True)
class Lost:
    """The result of a task that ended its worker process at every attempt."""

    task: Any
    reason: str


@dataclass(frozen=True)
class Unknown:
    """The answer of a worker that cannot load a task."""

    reason: str


def available_cores() -> int:
    """How many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def process_pool(workers: int) -> Executor:
    """Processes that import what they need, say nothing on stdout and end with this one. Of all that compile only the
    first says so."""
    context = multiprocessing.get_context("spawn")
    announcing = context.Semaphore(0 if log.announced else 1)
    return ProcessPoolExecutor(workers, mp_context=context, initializer=_begin, initargs=(announcing,))


class Pool:
    """An executor that is made when it is needed, and kept until it is ended.

    executor
        makes one for a number of workers
    """

    def __init__(self, executor: Callable[[int], Executor] = process_pool) -> None:
        self._make = executor
        self._executor: Executor | None = None
        self.lost: tuple[type[Exception], ...] = ()  # raised for a task whose workers have died, after all tries
        self._others: set[Any] = set()

    def submit(self, workers: int, message: bytes) -> Future[Any]:
        """Hand a task to a worker."""
        if self._executor is None:
            self._others = set(multiprocessing.active_children())
            self._executor = self._make(workers)
        with _interrupts_held_back(), _main_hidden():
            return self._executor.submit(run_message, message)

    def end(self) -> None:
        """Kill the processes at once."""
        if self._executor is None:
            return
        self._executor.shutdown(wait=False, cancel_futures=True)
        self._executor = None
        for child in set(multiprocessing.active_children()) - self._others:
            child.kill()
            child.join()


def in_parallel(
    function: Callable[[Task], Result], tasks: Iterable[Task], workers: int | None = None, pool: Pool | None = None,
    until: float = math.inf,
) -> Generator[tuple[Task, Result | Lost], None, None]:  # fmt: skip
    """``(task, function(task))`` for each task, as they finish, from ``workers`` processes (None: all cores).

    If a worker dies (killed, out of memory, a crash), the tasks that were running are tried once more, one at a time;
    one that ends its worker again has :class:`Lost` as its result. No task is finished twice.

    The tasks run in this process instead, one after the other and in order, with ``workers=1``, inside a worker, and if
    ``function`` cannot be pickled (a lambda, a function inside another). So does a task that a worker cannot load:
    workers never run the script that was started, and its own functions and classes are unknown to them.

    An exception of ``function`` stops everything and is raised here. Closing the generator and Ctrl-C end the workers
    at once and silently; so does the death of this process. pool: kept for later calls if all went well; None: one for
    this call.

    until: on ``time.monotonic``; TimeoutError if tasks in other processes have not ended GRACE s later. Problem if a
    cluster is gone. ValueError for fewer than one worker.
    """
    tasks = list(tasks)
    if workers is None:
        workers = available_cores()
    if not isinstance(workers, int) or isinstance(workers, bool) or workers < 1:
        raise ValueError(f"workers must be a whole number of at least 1, not {workers!r}")
    alone = workers == 1 or multiprocessing.parent_process() is not None
    if alone or not tasks or _pickled(function) is None:
        return ((task, function(task)) for task in tasks)
    return _shared_out(function, tasks, workers, Pool() if pool is None else pool, pool is not None, until)


def _shared_out(
    function: Callable[[Task], Result], tasks: Sequence[Task], most: int, pool: Pool, kept: bool, until: float
) -> Generator[tuple[Task, Result | Lost], None, None]:
    waiting, suspects = deque(range(len(tasks))), deque[int]()  # suspects were running when a worker died
    tries = [0] * len(tasks)
    running: dict[Future[Any], int] = {}
    finished = False
    try:
        while waiting or suspects or running:
            broken = False
            on_trial = any(tries[index] for index in running.values())
            room = 0 if on_trial else most - len(running)
            if suspects:
                room = 0 if running else 1
            while room > 0 and (suspects or waiting):
                index = (suspects or waiting).popleft()
                message = _pickled((function, tasks[index]))
                if message is None:
                    yield tasks[index], function(tasks[index])
                    continue
                try:
                    running[pool.submit(most, message)] = index
                except BrokenExecutor:  # a worker has died meanwhile: the tasks that were running will tell
                    waiting.appendleft(index)
                    broken = True
                    break
                room -= 1
            patience = None if until == math.inf else max(until + GRACE - time.monotonic(), 0.0)
            done, _ = wait(running, patience, FIRST_COMPLETED)
            if running and not done:
                raise TimeoutError
            for future in done:
                index = running.pop(future)
                try:
                    result = future.result()
                except BrokenExecutor:
                    broken = True
                    tries[index] += 1
                    if tries[index] < TRIES:
                        suspects.append(index)
                    else:
                        yield tasks[index], Lost(tasks[index], f"its process ended {TRIES} times")
                    continue
                except CancelledError as error:
                    raise Problem("the connection to the workers is lost") from error
                except pool.lost as error:
                    yield tasks[index], Lost(tasks[index], one_line(error))
                    continue
                if isinstance(result, Unknown):
                    logger.info("no worker can load task %d, it runs here: %s", index, result.reason)
                    result = function(tasks[index])
                yield tasks[index], result
            if broken:
                for index in running.values():
                    tries[index] += 1
                    suspects.append(index)
                running.clear()
                pool.end()
        finished = True
    finally:
        if not (finished and kept):
            pool.end()


def _pickled(thing: Any) -> bytes | None:
    """The pickled object; None if it cannot be pickled."""
    try:
        return pickle.dumps(thing)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        logger.info("not shared out among the cores: %s", error)
        return None


def run_message(message: bytes, folder: str | None = None) -> Any:
    """In a worker: one task. folder: the one in which its files are found."""
    if folder is not None:
        os.chdir(folder)
    try:
        function, task = pickle.loads(message)
    except (Exception, SystemExit) as error:  # imports user modules, which may raise anything
        return Unknown(f"{type(error).__name__}: {error}")
    return function(task)


def _begin(announcing: Semaphore) -> None:
    """In a worker, before its first task."""
    log.announced = not announcing.acquire(block=False)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    os.dup2(2, 1)
    sys.stdout = sys.stderr


def _end_with_parent() -> None:
    """End this process with its parent: a killed parent does not end its workers."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


@contextmanager
def _interrupts_held_back() -> Iterator[None]:
    """Ctrl-C reaches every process of a terminal; a process that is starting must not print a traceback.

    A blocked signal stays blocked in processes started meanwhile; this process receives it afterwards. Python notices
    it nevertheless if a thread of some library takes it, so it gets another handler meanwhile.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    from multiprocessing import resource_tracker

    resource_tracker.ensure_running()  # starting it later would unblock the signal
    noted: list[int] = []
    in_main = threading.current_thread() is threading.main_thread()  # only there Python handles signals
    handler = signal.signal(signal.SIGINT, lambda number, _: noted.append(number)) if in_main else None
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        if in_main:
            signal.signal(signal.SIGINT, handler)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        if noted:
            signal.raise_signal(signal.SIGINT)


@contextmanager
def _main_hidden() -> Iterator[None]:
    """Start processes without running the user's script again, which may lack ``if __name__ == "__main__"``."""
    main = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main
