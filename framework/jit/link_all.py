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
            if shared:
                _compile_together(missing, helpers)
            else:
                _compile(zip(range(len(missing), 0, -1), missing, strict=True))
        finally:
            log.left = 0
        for function in functions:
            function.link()


def _compile(functions: Iterable[tuple[int, Linkable]]) -> None:
    """Each with how many are left to compile, itself included."""
    for log.left, function in functions:
        function.link()


def _compile_together(functions: Sequence[Linkable], helpers: int) -> None:
    """This process and others each take a share, its longest first, and then what the others have not begun, its
    shortest first.

    Functions that follow each other, such as those of 2D, are made of much the same, which each process compiles once:
    of another share it takes what asks for the least of that anew.
    """
    import multiprocessing  # half as long to import as numpy

    size = -(-len(functions) // (helpers + 1))
    shares = [range(len(functions))[start : start + size] for start in range(0, len(functions), size)]
    functions = [
        function for share in shares
        for function in sorted((functions[k] for k in share), key=lambda each: -each.dependency_count)
    ]  # fmt: skip
    context: Any = multiprocessing.get_context("fork")
    begun, compiled = context.Array("b", len(functions)), context.SimpleQueue()
    started = [
        context.Process(target=_help, args=(functions, begun, share, compiled), daemon=True) for share in shares[1:]
    ]
    for process in started:
        process.start()
    try:
        _compile(_taken(functions, begun, shares[0]))
        for process in started:  # each has one function left
            log.left = sum(other.is_alive() for other in started)
            process.join()
    finally:
        for process in started:
            process.kill()
        while not compiled.empty():
            log.compiled.append(compiled.get())
            log.loaded -= 1  # this process loads what the other one has compiled


def _taken(functions: Sequence[Linkable], begun: Any, share: range) -> Iterator[tuple[int, Linkable]]:
    """What no process has begun: of the share, then of all from the last one on."""
    for number in (*share, *reversed(range(len(functions)))):
        with begun.get_lock():
            left = begun[:].count(0)
            mine, begun[number] = not begun[number], 1
        if mine:
            yield left, functions[number]


def _help(functions: Sequence[Linkable], begun: Any, share: range, compiled: Any) -> None:
    """What another process does; a function that cannot be compiled raises in the first process when that links it."""
    import signal

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches both; the first process ends this one
    log.listeners, log.announced, log.processes = [], True, 1
    for _, function in _taken(functions, begun, share):
        known = len(log.compiled)
        with contextlib.suppress(Exception):
            function.link()
        for item in log.compiled[known:]:
            compiled.put(item)
