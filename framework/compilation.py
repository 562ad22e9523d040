"""Compiled kernels: numba dispatchers that keep their machine code on disk, say when they compile, and can be timed.

The cache is ours (:mod:`jit.cache`). What compiling and loading costs a process stands in :data:`log`; a program
that shows it itself joins ``log.listeners``, for all others there is the logger ``carom``: a line of level WARNING when
the first kernel compiles, because seconds without a word look like a hang, one of level INFO for each, and one of level
DEBUG for each that is loaded.
"""

from __future__ import annotations

import gc
import logging
import os
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, ClassVar, TypeVar

from numba import config
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import CPUDispatcher
from numba.core.types import unliteral

from .jit.cache import CACHE_FOLDER_VARIABLE, KernelCache, cache_folder
from .jit.hash import deep_hash as deep_hash
from .jit.pipeline import kernel_compiler, part_compiler

Function = TypeVar("Function", bound=Callable[..., Any])

logger = logging.getLogger("carom")


@dataclass
class CompilationLog:
    """What compiling has cost this process so far; the lab reports it apart from run time."""

    compiled: list[tuple[str, float]] = field(default_factory=list)  # (kernel, seconds)
    loaded: int = 0
    waited: float = 0.0  # s, for kernels to be compiled or loaded
    listeners: list[Callable[[str], None]] = field(default_factory=list)  # told the kernel that begins to compile
    announced: bool = False

    @property
    def seconds(self) -> float:
        """Spent compiling."""
        return sum(seconds for _, seconds in self.compiled)


log = CompilationLog()

CHECKED = os.environ.get("CAROM_CHECK", "") not in ("", "0")  # a build that checks every index into a record

# A wrapper for C callers costs compile time and serves none of our kernels.
_OPTIONS = {"nopython": True, "boundscheck": None, "error_model": "numpy", "no_cfunc_wrapper": True}


def kernel(function: Function) -> Function:
    """Compile ``function`` on first call, per argument types, and keep the machine code on disk.

    IEEE semantics throughout (no fastmath: same input, same bits); division by zero gives inf or nan. The function
    cannot make arrays: without numba's reference counting, which costs more than the work itself where arrays are
    passed in tuples. Use :func:`allocating_kernel` for those that must.
    """
    return _kept(Kernel, function, _nrt=CHECKED)


def untimed_kernel(function: Function) -> Function:
    """Like :func:`kernel`, for what is called so often that :func:`time_calls` must add nothing to the call."""
    return _kept(KeptDispatcher, function, _nrt=CHECKED)


def allocating_kernel(function: Function) -> Function:
    """Like :func:`kernel`, for functions that make arrays; keep hot loops out of them."""
    return _kept(Kernel, function)


def part(function: Function) -> Function:
    """For functions that only kernels call: nothing on disk of their own; called from Python they stay Python."""
    return _part(function)


def inlined(function: Function) -> Function:
    """Like :func:`part`, for small helpers that must disappear into the kernels which call them."""
    return _part(function, forceinline=True)


def pasted(function: Function) -> Function:
    """Like :func:`inlined`, but before types are known: branches on arguments that are constants at the call vanish."""
    return _part(function, inline="always")


def allocating_part(function: Any) -> Any:
    """The same part with its options, but it may make arrays and raise exceptions with values."""
    return Part(function.py_func, targetoptions={**function.targetoptions, "_nrt": True}, pipeline_class=part_compiler)


def linked_dispatcher(function: Any, allocates: bool) -> Any:
    """For functions that are called through their address alone, see :mod:`~carom.framework.jit.linking`."""
    plain = getattr(function, "py_func", function)
    return _kept(KeptDispatcher, plain, no_cpython_wrapper=True, _nrt=allocates or CHECKED)


def _kept(kind: type[KeptDispatcher], function: Any, **options: Any) -> Any:
    if config.DISABLE_JIT:  # type: ignore[attr-defined]
        return function
    return kind(function, targetoptions={**_OPTIONS, **options}, pipeline_class=kernel_compiler)


def _part(function: Any, **options: Any) -> Any:
    if config.DISABLE_JIT:  # type: ignore[attr-defined]
        return function
    options = {**_OPTIONS, "no_cpython_wrapper": True, "_nrt": CHECKED, **options}
    return Part(function, targetoptions=options, pipeline_class=part_compiler)


class Wait:
    """A context manager around compiling and loading: notes the time, and keeps other threads out.

    own: seconds without those of waits inside it, once it is over.
    """

    _running: ClassVar[list[Wait]] = []

    def __enter__(self) -> Wait:
        global_compiler_lock.acquire()
        self.own = 0.0
        self._collecting = gc.isenabled()
        gc.disable()  # the compiler makes millions of objects that live on; looking through them takes a twentieth
        self._running.append(self)
        self._started = time.perf_counter()
        return self

    def __exit__(self, *_: object) -> None:
        self._running.pop()
        if self._collecting:
            gc.collect(0)  # once now, instead of at some moment soon, which would be taken for run time
            gc.enable()
        seconds = time.perf_counter() - self._started
        self.own += seconds
        if self._running:
            self._running[-1].own -= seconds
        else:
            log.waited += seconds
        global_compiler_lock.release()


class KeptDispatcher(CPUDispatcher):
    """numba's dispatcher, with machine code kept on disk, and the cost of compiling and loading noted."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._cache = KernelCache(self, _announce)

    def compile(self, sig: Any) -> Any:
        with Wait() as wait:
            known, loaded = len(self.overloads), self._cache_hits[sig]
            entry_point = super().compile(sig)
            was_loaded = self._cache_hits[sig] > loaded
            was_compiled = len(self.overloads) > known and not was_loaded
        if was_loaded:
            log.loaded += 1
            logger.debug("loaded %s for %s", self.py_func.__name__, sig)
        elif was_compiled:
            log.compiled.append((self.py_func.__qualname__, wait.own))
        return entry_point

    def is_kept(self, sig: Any) -> bool:
        """Whether it is kept on disk for that signature, and has only to be loaded."""
        return self._cache.holds(sig, self.targetctx)

    def _compile_for_args(self, *args: Any, **kws: Any) -> Any:
        """What numba calls for arguments of new types: looks at them, then compiles."""
        with Wait():
            return super()._compile_for_args(*args, **kws)

    def typeof_pyval(self, val: Any) -> Any:
        """Called once per new type of argument; the first time loads a good part of numba."""
        with Wait():
            return super().typeof_pyval(val)


class Kernel(KeptDispatcher):
    """One whose calls from Python can be timed."""

    def __call__(self, *args: Any) -> Any:
        if _timing is None:
            return super().__call__(*args)
        waited = log.waited
        started = time.perf_counter_ns()
        result = super().__call__(*args)
        elapsed = time.perf_counter_ns() - started
        if _timing is not None:
            _timing(self.py_func.__name__, elapsed, log.waited != waited)
        return result


class Part(CPUDispatcher):
    """A function that kernels call. Python runs it as written, so that it can be tried before anything compiles."""

    def __call__(self, *args: Any) -> Any:
        return self.py_func(*args)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """What numba asks for at a call; constants are compiled for as any number of their type is."""
        return super().get_call_template([unliteral(kind) for kind in args], kws)


_timing: Callable[[str, int, bool], None] | None = None


def time_calls(record: Callable[[str, int, bool], None] | None) -> None:
    """From now on call ``record(kernel, nanoseconds, compiled)`` after each call of a kernel; None: no more.

    compiled: whether that call had to compile or load it first. A call that is timed costs about 0.3 microseconds more.
    """
    global _timing
    _timing = record


def timing() -> bool:
    """Whether calls are timed at the moment."""
    return _timing is not None


def _announce(dispatcher: Any) -> None:
    """Say that a kernel is about to compile."""
    for listener in log.listeners:
        listener(dispatcher.py_func.__qualname__)
    if not log.announced and not log.listeners:
        log.announced = True
        folder = cache_folder()
        if folder is not None:
            logger.warning(
                "carom: compiling kernels that are not in %s yet; this takes some seconds, once: later runs load them "
                "(carom warm-up compiles ahead)", folder
            )  # fmt: skip
        else:
            logger.warning(
                "carom: compiling kernels, which takes some seconds in every run: there is no folder that can be "
                "written to keep them (%s names one)", CACHE_FOLDER_VARIABLE
            )  # fmt: skip
    logger.info("compiling %s (%d so far, %.1f s)", dispatcher.py_func.__name__, len(log.compiled), log.seconds)
