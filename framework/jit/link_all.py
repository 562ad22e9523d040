"""Linking many functions, on several processors where the process allows it.

Another process compiles what this one has not begun yet, and keeps it on disk; this one loads it from there. The other
one is a fork, so it knows every function that this one knows, also those of a file that is no module. Programs with
windows, sound and threads of their own must not fork: only ``carom`` commands set ``log.processes``.
"""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from ..compilation import log
from .lazy import JIT, dispatchers
from .linkable import Linkable

CAN_FORK = sys.platform.startswith("linux")  # elsewhere system libraries do not survive it


def link_all(functions: Iterable[Linkable]) -> None:
    """Compile or load all of them; ``log.left`` tells listeners how many are left to compile."""
    if not JIT:
        return
    functions = [function for function in functions if not function.ready]
    for function in functions:
        if function.holder is not None:
            function.link()
    functions = [function for function in functions if not function.ready]
    if not functions:
        return
    functions[0].compiled  # noqa: B018 - LibraryError where there is no compiler
    from .cache import cache_folder  # loads numba

    with dispatchers.CompilerLock():
        missing = list(dict.fromkeys(function for function in functions if not function.is_cached))
        helpers = min(log.processes, len(missing) // 2) - 1
        shared = helpers > 0 and CAN_FORK and cache_folder() is not None
        try:
            (_compile_together(missing, helpers) if shared else _compile(missing, range(len(missing))))
        finally:
            log.left = 0
        for function in functions:
            function.link()


def _compile(functions: Sequence[Linkable], numbers: Iterable[int]) -> None:
    for number in numbers:
        log.left = len(functions) - number
        functions[number].link()


def _compile_together(functions: Sequence[Linkable], helpers: int) -> None:
    """This process and others each take the next function until none is left; those that take longest come first."""
    functions = sorted(functions, key=lambda function: -function.dependency_count)
    import multiprocessing  # half as long to import as numpy

    context: Any = multiprocessing.get_context("fork")
    following, compiled = context.Value("i", 0), context.SimpleQueue()
    started = [
        context.Process(target=_help, args=(functions, following, compiled), daemon=True) for _ in range(helpers)
    ]
    for process in started:
        process.start()
    try:
        _compile(functions, _taken(following, len(functions)))
        for process in started:  # each has one function left
            log.left = sum(other.is_alive() for other in started)
            process.join()
    finally:
        for process in started:
            process.kill()
        while not compiled.empty():
            log.compiled.append(compiled.get())
            log.loaded -= 1  # this process loads what the other one has compiled


def _taken(following: Any, count: int) -> Iterator[int]:
    while True:
        with following.get_lock():
            number = following.value
            following.value += 1
        if number >= count:
            return
        yield number


def _help(functions: Sequence[Linkable], following: Any, compiled: Any) -> None:
    """What another process does; a function that cannot be compiled raises in the first process when that links it."""
    import signal

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches both; the first process ends this one
    log.listeners, log.announced, log.processes = [], True, 1
    for number in _taken(following, len(functions)):
        known = len(log.compiled)
        with contextlib.suppress(Exception):
            functions[number].link()
        for item in log.compiled[known:]:
            compiled.put(item)
