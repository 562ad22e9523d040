"""Tasks on an executor: processes of this machine by default, and a process that dies affects only its own task."""

from __future__ import annotations

import logging
import multiprocessing
import os
import pickle
import signal
import sys
import threading
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

logger = logging.getLogger("carom")


@dataclass(frozen=True)
class Lost:
    """The result of a task that ended its worker process at both attempts."""

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


class Workers:
    """An executor for ``size`` tasks at a time (None: all cores), made when it is needed and kept until :meth:`end`.

    ValueError for fewer than one. ``alone``: that is this process. lost: what it raises for a task whose workers have
    died, after tries of its own
    """

    def __init__(
        self, size: int | None, executor: Callable[[int], Executor] | None = None, lost: Any = ()
    ) -> None:
        self.size = available_cores() if size is None else size
        if not isinstance(self.size, int) or isinstance(self.size, bool) or self.size < 1:
            raise ValueError(f"workers must be a whole number of at least 1, not {size!r}")
        self.alone = executor is None and self.size == 1
        self._make, self.lost = executor or process_pool, lost
        self._executor: Executor | None = None
        self._others: set[Any] = set()

    def submit(self, message: bytes) -> Future[Any]:
        """Hand a task to a worker."""
        if self._executor is None:
            self._others = set(multiprocessing.active_children())
            self._executor = self._make(self.size)
        with _interrupts_held_back(), _main_hidden():
            return self._executor.submit(run_message, message, os.getcwd())

    def end(self) -> None:
        """End the processes at once."""
        if self._executor is None:
            return
        self._executor.shutdown(wait=False)
        self._executor = None
        for child in set(multiprocessing.active_children()) - self._others:
            child.kill()
            child.join()


def in_parallel(
    function: Callable[[Task], Result], tasks: Iterable[Task], workers: int | Workers | None = None
) -> Generator[tuple[Task, Result | Lost], None, None]:
    """``(task, function(task))`` for each task, as they finish, from so many processes (None: all cores) or from
    Workers, which are kept for later calls if all went well.

    If a worker dies (killed, out of memory, a crash), the tasks that were running are tried once more, each in a
    process of its own; one that ends it again has :class:`Lost` as its result. No task is finished twice.

    The tasks run in this process instead, one after the other and in order, with one worker, inside a worker, and if
    ``function`` cannot be pickled (a lambda, a function inside another). So does a task that a worker cannot load:
    workers never run the script that was started, and its own functions and classes are unknown to them.

    An exception of ``function`` stops everything and is raised here. Closing the generator and Ctrl-C end the workers
    at once and silently; so does the death of this process. Problem if a cluster is gone. ValueError for fewer than one
    worker.
    """
    tasks = list(tasks)
    pool = workers if isinstance(workers, Workers) else Workers(workers)
    if pool.alone or not tasks or multiprocessing.parent_process() is not None or _pickled(function) is None:
        return ((task, function(task)) for task in tasks)
    return _shared_out(function, tasks, pool, pool is workers)


def _shared_out(
    function: Callable[[Task], Result], tasks: Sequence[Task], pool: Workers, kept: bool
) -> Generator[tuple[Task, Result | Lost], None, None]:
    waiting, suspects = deque(range(len(tasks))), list[int]()  # suspects were running when a worker died
    running: dict[Future[Any], int] = {}
    finished = False
    try:
        while waiting or running:
            try:
                while waiting and len(running) < pool.size and not suspects:
                    message = _pickled((function, tasks[waiting[0]]))
                    if message is None:
                        index = waiting.popleft()
                        yield tasks[index], function(tasks[index])
                        continue
                    running[pool.submit(message)] = waiting[0]
                    waiting.popleft()
            except BrokenExecutor:  # a worker has died meanwhile
                suspects += running.values()
            for future in wait(running, return_when=FIRST_COMPLETED).done if running else ():
                index = running[future]
                try:
                    result = _result(future, function, tasks[index], pool)
                except BrokenExecutor:
                    suspects.append(index)
                    continue
                del running[future]
                yield tasks[index], result
            if suspects:
                suspects = sorted({*suspects, *running.values()})
                running.clear()
                pool.end()
                for index in suspects:
                    yield tasks[index], _once_more(function, tasks[index])
                suspects = []
        finished = True
    finally:
        for future in running:
            future.cancel()
        if not (finished and kept):
            pool.end()


def _result(future: Future[Any], function: Callable[[Task], Result], task: Task, pool: Workers) -> Result | Lost:
    """What a worker has made of a task."""
    try:
        result = future.result()
    except CancelledError as error:
        raise Problem("the connection to the workers is lost") from error
    except pool.lost as error:
        return Lost(task, one_line(error))
    if isinstance(result, Unknown):
        logger.info("no worker can load a task, it runs here: %s", result.reason)
        return function(task)
    return result


def _once_more(function: Callable[[Task], Result], task: Task) -> Result | Lost:
    """The task in a process of its own."""
    pool = Workers(1)
    try:
        message = _pickled((function, task))
        assert message is not None
        return _result(pool.submit(message), function, task, pool)
    except BrokenExecutor:
        return Lost(task, "its process ended 2 times")
    finally:
        pool.end()


def _pickled(thing: Any) -> bytes | None:
    """The pickled object; None if it cannot be pickled."""
    try:
        return pickle.dumps(thing)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        logger.info("not shared out among the cores: %s", error)
        return None


def run_message(message: bytes, folder: str) -> Any:
    """In a worker: one task. folder: the one in which its files are found."""
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
