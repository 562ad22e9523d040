"""Tasks performed in parallel processes, so that a process that dies affects only its own task.

Each worker has its own pipe and at most one task. When a pipe ends, it is certain which task was lost and that it gave
no result: an incomplete answer of a killed worker cannot be read as another task's.
"""

from __future__ import annotations

import logging
import multiprocessing
import multiprocessing.connection
import os
import pickle
import signal
import sys
import threading
import traceback
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from types import ModuleType
from typing import Any, TypeVar

from ...framework.compilation import log

Task = TypeVar("Task")
Result = TypeVar("Result")

TRIES = 2  # attempts at a task whose worker dies
STARTS = 10  # workers in a row that end before they are ready, before giving up

PATIENCE = 5.0  # s, to wait for a process to end after its pipe ended

READY, COMPILES, DONE, RAISED, UNKNOWN = "ready", "compiles", "done", "raised", "unknown"  # messages of a worker
DIED = "died"  # in place of a message

logger = logging.getLogger("carom")


@dataclass(frozen=True)
class Lost:
    """The result of a task that ended its worker process at every attempt."""

    task: Any
    reason: str


def available_cores() -> int:
    """How many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def in_parallel(
    function: Callable[[Task], Result], tasks: Iterable[Task], workers: int | None = None
) -> Generator[tuple[Task, Result | Lost], None, None]:
    """``(task, function(task))`` for each task, as they finish, from ``workers`` processes (None: all cores).

    A worker gets one task at a time. If it dies during the task (killed, out of memory, a crash), the task is tried
    once more in another worker; if that dies too, :class:`Lost` is its result. No other task is affected, and none is
    finished twice.

    The tasks run in this process instead, one after the other and in order, with ``workers=1``, inside a worker, and if
    ``function`` cannot be pickled (a lambda, a function inside another). A task that a worker cannot load also runs
    here, while the workers continue with the others: functions and classes of the script that was started
    (``__main__``) are unknown to workers, which never run that script. An INFO line of the logger ``carom`` gives the
    reason.

    An exception of ``function`` stops everything and is raised here, with the worker's traceback as a note. Closing the
    generator and Ctrl-C end the workers at once and silently; so does the death of this process. Prints of workers go
    to stderr, and the kernels they compile are reported to the listeners of this process.

    ValueError for fewer than one worker; ChildProcessError if processes cannot be started.
    """
    tasks = list(tasks)
    if workers is None:
        workers = available_cores()
    if not isinstance(workers, int) or isinstance(workers, bool) or workers < 1:
        raise ValueError(f"workers must be a whole number of at least 1, not {workers!r}")
    pickled = None
    if workers > 1 and not multiprocessing.current_process().daemon:  # a worker cannot have workers
        pickled = _pickled(function)
    if pickled is None or not tasks:
        return ((task, function(task)) for task in tasks)
    return _shared_out(function, pickled, tasks, min(workers, len(tasks)))


def _shared_out(
    function: Callable[[Task], Result], pickled: bytes, tasks: Sequence[Task], most: int
) -> Generator[tuple[Task, Result | Lost], None, None]:
    waiting = deque(range(len(tasks)))
    tries = [0] * len(tasks)
    here: deque[int] = deque()  # tasks that only this process can load
    workers: list[_Worker] = []  # all of them busy or starting
    failed_starts = 0

    def go_on(worker: _Worker) -> None:
        """Give it the next task that can be sent; end the worker if there is none."""
        while waiting:
            worker.task = waiting.popleft()
            message = _pickled(tasks[worker.task])
            if message is not None:
                tries[worker.task] += 1
                worker.send(message)
                return
            here.append(worker.task)
        workers.remove(worker)
        worker.end()

    try:
        while waiting or here or any(worker.task is not None for worker in workers):
            busy = sum(worker.task is not None for worker in workers)
            while len(workers) < min(most, busy + len(waiting)):
                workers.append(_Worker(pickled))
            has_time = not here
            if here:
                index = here.popleft()
                yield tasks[index], function(tasks[index])
            for worker in _heard(workers, wait=has_time):
                said, content = worker.answer()
                if said == COMPILES:
                    for listener in log.listeners:
                        listener(content)
                    continue
                index = worker.task
                if said == DIED:
                    workers.remove(worker)
                    if index is None:
                        failed_starts += 1
                        if failed_starts == STARTS:
                            raise ChildProcessError(f"worker processes end before they begin: {content}")
                    elif tries[index] < TRIES:
                        waiting.append(index)  # at the end: the cause may be lack of memory
                    else:
                        yield tasks[index], Lost(tasks[index], f"its process ended {TRIES} times: {content}")
                    continue
                if said == RAISED:
                    raise content
                failed_starts = 0
                go_on(worker)  # first, because the caller may take time over the result
                if said == DONE:
                    assert index is not None
                    yield tasks[index], content
                elif said == UNKNOWN:
                    assert index is not None
                    logger.info("no worker can load task %d, it runs here: %s", index, content)
                    here.append(index)
    finally:
        for worker in workers:
            worker.end()


def _heard(workers: Sequence[_Worker], wait: bool) -> list[_Worker]:
    """The workers that have sent a message or died; waits for one if ``wait``."""
    by_pipe: dict[Any, _Worker] = {worker.pipe: worker for worker in workers}
    return [by_pipe[pipe] for pipe in multiprocessing.connection.wait(list(by_pipe), None if wait else 0)]


def _pickled(thing: Any) -> bytes | None:
    """The pickled object; None if it cannot be pickled."""
    try:
        return pickle.dumps(thing)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        logger.info("not shared out among the cores: %s", error)
        return None


class _Worker:
    """A worker process, seen from its parent.

    task
        the index of the current task; None before the first
    """

    def __init__(self, pickled: bytes) -> None:
        self.task: int | None = None
        self.pipe, theirs = multiprocessing.Pipe()
        self._process = multiprocessing.get_context("spawn").Process(
            target=_serve, args=(theirs, pickled, bool(log.listeners)), daemon=True
        )
        with theirs, _interrupts_held_back(), _main_hidden():
            self._process.start()  # then close our copy of the child's end, so that the pipe ends with the process

    def send(self, message: bytes) -> None:
        with suppress(OSError):  # it has just died: the end of its pipe is handled later
            self.pipe.send_bytes(message)

    def answer(self) -> tuple[str, Any]:
        """The message that has begun to arrive; (DIED, how) if the process ended instead."""
        try:
            message = self.pipe.recv_bytes()
        except (EOFError, OSError):
            self._process.join(PATIENCE)
            self.end()
            code = self._process.exitcode
            if code is not None and code < 0:
                return DIED, f"signal {-code} ({signal.strsignal(-code)})"
            return DIED, f"exit code {code}"
        return pickle.loads(message)

    def end(self) -> None:
        """Kill the process at once."""
        self.pipe.close()
        self._process.kill()
        self._process.join()


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


def _serve(pipe: Connection, pickled: bytes, listened: bool) -> None:
    """The main loop of a worker: perform tasks until the pipe ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    os.dup2(2, 1)
    sys.stdout = sys.stderr
    if listened:
        log.listeners.append(lambda kernel: _say(pipe, COMPILES, kernel))
    function: Any = None
    with suppress(EOFError, OSError):
        _say(pipe, READY)
        while True:
            message = pipe.recv_bytes()
            try:
                if function is None:
                    function = pickle.loads(pickled)
                task = pickle.loads(message)
            except (Exception, SystemExit) as error:  # imports user modules, which may raise anything
                _say(pipe, UNKNOWN, f"{type(error).__name__}: {error}")
                continue
            pipe.send_bytes(_outcome(function, task))


def _say(pipe: Connection, what: str, content: Any = None) -> None:
    pipe.send_bytes(pickle.dumps((what, content)))


def _outcome(function: Callable[[Any], Any], task: Any) -> bytes:
    """The message after a task."""
    try:
        return pickle.dumps((DONE, function(task)))
    except (Exception, SystemExit) as error:  # passed on to the caller
        trace = "".join(traceback.format_exception(error)).rstrip()
        error.add_note(trace)
        try:
            message = pickle.dumps((RAISED, error))
            pickle.loads(message)  # can fail where dumps does not: if __init__ has required arguments
        except Exception:  # the error has contents that cannot be pickled
            stand_in = RuntimeError(f"{type(error).__name__}: {error}")
            stand_in.add_note(trace)
            message = pickle.dumps((RAISED, stand_in))
        return message


def _end_with_parent() -> None:
    """End this process with its parent: a killed parent does not end its workers."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
