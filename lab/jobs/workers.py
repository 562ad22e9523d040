"""Work for all cores: tasks run in processes of their own, and one of them that dies costs no other task anything.

Each worker has a pipe of its own and at most one task, so when a pipe ends it is certain which task was lost and that
it gave no result: a half written answer of a killed worker can reach nobody else.
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

TRIES = 2  # of a task whose worker dies
STARTS = 10  # of workers in a row that end before they are ready, until no more are started

PATIENCE = 5.0  # s, for a process to end whose pipe has

READY, COMPILES, DONE, RAISED, UNKNOWN = "ready", "compiles", "done", "raised", "unknown"  # what a worker says
DIED = "died"  # what is said of it

logger = logging.getLogger("carom")


@dataclass(frozen=True)
class Lost:
    """What stands for the result of a task that ended its worker process each time it was tried."""

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

    A worker gets one task at a time. If it dies with it (killed, out of memory, a crash) the task is tried once more in
    another one; if that dies too, :class:`Lost` is its result. No other task is touched, and none is finished twice.

    The tasks run here instead, one after the other and in order, with ``workers=1``, inside a worker, and if
    ``function`` cannot be pickled (a lambda, a function inside another). A task that a worker cannot load runs here
    too, while the workers go on with the others: functions and classes of the script that was started (``__main__``)
    are not known to them, as workers never run that script. An INFO line of the logger ``carom`` says why.

    What ``function`` raises ends everything and is raised here, with the worker's traceback as a note. Closing the
    generator and Ctrl-C end the workers at once, without a word from them; so does the death of this process. What
    workers print goes to stderr, and kernels that they compile are told to the listeners of this process.

    ValueError for fewer than one worker; ChildProcessError if processes cannot be started here.
    """
    tasks = list(tasks)
    if workers is None:
        workers = available_cores()
    if not isinstance(workers, int) or isinstance(workers, bool) or workers < 1:
        raise ValueError(f"workers must be a whole number of at least 1, not {workers!r}")
    pickled = None
    if workers > 1 and not multiprocessing.current_process().daemon:  # a worker must not have workers
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
    workers: list[_Worker] = []  # all of them busy, or starting
    failed_starts = 0

    def go_on(worker: _Worker) -> None:
        """Give it the next task that can be sent; without one it ends."""
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
                        waiting.append(index)  # last: memory may be what was short
                    else:
                        yield tasks[index], Lost(tasks[index], f"its process ended {TRIES} times: {content}")
                    continue
                if said == RAISED:
                    raise content
                failed_starts = 0
                go_on(worker)  # before the caller gets its result and takes time over it
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
    """Those that have said something or died; waits for one if asked to."""
    by_pipe: dict[Any, _Worker] = {worker.pipe: worker for worker in workers}
    return [by_pipe[pipe] for pipe in multiprocessing.connection.wait(list(by_pipe), None if wait else 0)]


def _pickled(thing: Any) -> bytes | None:
    """None if it cannot be."""
    try:
        return pickle.dumps(thing)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        logger.info("not shared out among the cores: %s", error)
        return None


class _Worker:
    """A process, as seen from the one that started it.

    task
        the index of the one it works on; None until it has its first
    """

    def __init__(self, pickled: bytes) -> None:
        self.task: int | None = None
        self.pipe, theirs = multiprocessing.Pipe()
        self._process = multiprocessing.get_context("spawn").Process(
            target=_serve, args=(theirs, pickled, bool(log.listeners)), daemon=True
        )
        with theirs, _interrupts_held_back(), _main_hidden():
            self._process.start()  # and close our copy of its end: the pipe must end when the process does

    def send(self, message: bytes) -> None:
        with suppress(OSError):  # it has just died: that its pipe ends is heard next
            self.pipe.send_bytes(message)

    def answer(self) -> tuple[str, Any]:
        """What it says, once that has begun to arrive; (DIED, how) if it never will."""
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
        """At once."""
        self.pipe.close()
        self._process.kill()
        self._process.join()


@contextmanager
def _interrupts_held_back() -> Iterator[None]:
    """Ctrl-C reaches every process of a terminal: one that is just starting must not answer with a traceback.

    A blocked signal stays blocked in a process started meanwhile; here it comes through afterwards.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    from multiprocessing import resource_tracker

    resource_tracker.ensure_running()  # its start would lift the block
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _main_hidden() -> Iterator[None]:
    """A process started now does not run the user's script again, which may lack an ``if __name__ == "__main__"``."""
    main = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main


def _serve(pipe: Connection, pickled: bytes, listened: bool) -> None:
    """What a worker does: answers tasks until its pipe ends."""
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
            except (Exception, SystemExit) as error:  # this imports their modules: somebody else's code
                _say(pipe, UNKNOWN, f"{type(error).__name__}: {error}")
                continue
            pipe.send_bytes(_outcome(function, task))


def _say(pipe: Connection, what: str, content: Any = None) -> None:
    pipe.send_bytes(pickle.dumps((what, content)))


def _outcome(function: Callable[[Any], Any], task: Any) -> bytes:
    """What is said after a task."""
    try:
        return pickle.dumps((DONE, function(task)))
    except (Exception, SystemExit) as error:  # whatever it is, the caller gets it
        trace = "".join(traceback.format_exception(error)).rstrip()
        error.add_note(trace)
        try:
            message = pickle.dumps((RAISED, error))
            pickle.loads(message)  # which fails where dumps does not if __init__ wants arguments of its own
        except Exception:  # an error may hold anything
            stand_in = RuntimeError(f"{type(error).__name__}: {error}")
            stand_in.add_note(trace)
            message = pickle.dumps((RAISED, stand_in))
        return message


def _end_with_parent() -> None:
    """A parent that was killed ends no worker itself."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
