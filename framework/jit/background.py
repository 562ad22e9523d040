"""Compiling while the game runs: what later steps and queries may need and is not kept on disk yet.

A thread of its own takes one function after the other. The compiler works outside Python's lock for most of the time,
so frames go on beside it; what needs the compiler itself waits for the function that is compiling. Only the first start
on a machine has anything to do here.
"""

from __future__ import annotations

import logging
import threading
from collections import deque
from collections.abc import Iterable

from .lazy import JIT
from .linkable import Linkable
from .log import background, log

logger = logging.getLogger("carom")

_waiting: deque[Linkable] = deque()
_lock = threading.Lock()
_thread: threading.Thread | None = None


def link_in_background(functions: Iterable[Linkable]) -> None:
    """Compile these soon; not at all where ``log.background`` is off."""
    global _thread
    if not log.background or not JIT:
        return
    with _lock:
        _waiting.extend(function for function in functions if not function.ready)
        if _waiting and _thread is None:
            _thread = threading.Thread(target=_work, name="carom compiler")
            _thread.start()


def wait() -> None:
    """Until nothing is left to compile in the background."""
    thread = _thread
    if thread is not None:
        thread.join()


def _work() -> None:
    global _thread
    background.active = True
    while True:
        with _lock:
            if not _waiting or not threading.main_thread().is_alive():  # the program ends
                _thread = None
                return
            function = _waiting.popleft()
        try:
            function.link()
        except Exception as error:  # it raises again, with the notes it gets there, for whoever calls the function
            logger.debug("carom: %s does not compile: %s", function, error)
