"""Compiled kernels: numba dispatchers that keep their machine code on disk, say when they compile, and can be timed.

The cache is ours (:mod:`jit.cache`). What compiling and loading costs a process stands in :data:`log`; a program
that shows it itself joins ``log.listeners``, for all others there is the logger ``carom``: a line of level WARNING when
the first kernel compiles, because seconds without a word look like a hang, one of level INFO for each, and one of level
DEBUG for each that is loaded.
"""

from __future__ import annotations

import functools
import time
from collections.abc import Callable
from typing import Any, TypeVar

from .errors import LibraryError
from .jit import libraries
from .jit.kinds import FLOAT, INT, Kind, Signature
from .jit.lazy import JIT, LazyIntrinsic, dispatchers
from .jit.linkable import Linkable
from .jit.log import CHECKED, log

Function = TypeVar("Function", bound=Callable[..., Any])

KINDS: dict[Any, Kind] = {"int": INT, "float": FLOAT}  # of arguments, by the words of annotations

# A wrapper for C callers costs compile time and serves none of our kernels. And who calls a part, inlined or not, must
# not decide how that is compiled, as it does where that is left to numba.
_OPTIONS = {
    "nopython": True, "boundscheck": None, "error_model": "numpy", "no_cfunc_wrapper": True, "forceinline": False,
    "_nrt": CHECKED,
}  # fmt: skip


def kernel(function: Function) -> Function:
    """Compile ``function`` on first call, per argument types, and keep the machine code on disk.

    One whose arguments are annotated as int or float, and its result as int, may come out of a library instead.

    IEEE semantics throughout (no fastmath: same input, same bits); division by zero gives inf or nan. The function
    cannot make arrays: without numba's reference counting, which costs more than the work itself where arrays are
    passed in tuples.
    """
    return _kept(Kernel, function)


def untimed_kernel(function: Function) -> Function:
    """Like :func:`kernel`, for what is called so often that :func:`time_calls` must add nothing to the call."""
    return _kept(Compiled, function)


def entry_point(kernel: Function) -> Function:
    """What to call in place of a kernel of :func:`untimed_kernel`, without a detour."""
    return getattr(kernel, "made", kernel)


def part(function: Function) -> Function:
    """For functions that only kernels call: nothing on disk of their own; called from Python they stay Python."""
    return _part(function)


def inlined(function: Function) -> Function:
    """Like :func:`part`, for small helpers that must disappear into the kernels which call them."""
    return _part(function, forceinline=True)


def pasted(function: Function) -> Function:
    """Like :func:`inlined`, but before types are known: branches on arguments that are constants at the call vanish."""
    return _part(function, inline="always")


def packed(function: Function) -> Function:
    """For kernels that get faster if one instruction works on two components of a vector (LLVM's SLP vectorizer; the
    same bits): the solver by 10 to 20 %. Others get slower: without it each kernel is as it was measured."""
    function.carom_packed = True  # type: ignore[attr-defined]
    return function


def allocating_part(function: Any) -> Any:
    """The same part with its options, but it may make arrays and raise exceptions with values."""
    return Part(function.py_func, {**function.targetoptions, "_nrt": True})


def linked_dispatcher(function: Any, what: str) -> Any:
    """For functions that are called through their address alone, see :mod:`~carom.framework.jit.linking`."""
    options = {**_OPTIONS, "no_cpython_wrapper": True}
    return _dispatcher(function, options, what, named=True)


def _dispatcher(function: Any, options: dict[str, Any], what: str, named: bool = False) -> Any:
    """What compiles it; LibraryError where there is no compiler."""
    try:
        return dispatchers.KeptDispatcher(dispatchers.named(function) if named else function, options)
    except ModuleNotFoundError as error:
        if error.name not in ("numba", "llvmlite"):
            raise
        raise libraries.missing(what) from error


def _kept(kind: type[Compiled], function: Any) -> Any:
    return kind(function, _OPTIONS) if JIT else function


def _part(function: Any, **options: Any) -> Any:
    options = {**_OPTIONS, "no_cpython_wrapper": True, **options}
    return Part(function, options) if JIT else function


class Compiled(LazyIntrinsic, Linkable):
    """A function for numba to compile; its dispatcher, :attr:`made`, is made when first called or needed by a kernel.
    If a library has it, that is what is called.

    targetoptions, py_func: numba's names, by which it recognises what it has to inline.
    """

    def __init__(self, function: Any, options: dict[str, Any]) -> None:
        functools.update_wrapper(self, function)
        self.plain = self.py_func = function
        self.targetoptions = options

    @functools.cached_property
    def signature(self) -> Signature | None:
        code, words = self.py_func.__code__, self.py_func.__annotations__
        arguments = [KINDS.get(words.get(name)) for name in code.co_varnames[: code.co_argcount]]
        known = [kind for kind in arguments if kind is not None]
        return INT(*known) if words.get("return") == "int" and len(known) == len(arguments) else None

    def _make(self) -> Any:
        found = self.holder
        if found is not None:
            return getattr(found.module, self.symbol)
        try:
            return self.compiled
        except LibraryError:
            if self.signature is not None:
                raise
            return libraries.CalledWithArrays(self.py_func)

    @functools.cached_property
    def compiled(self) -> Any:
        return self.__dict__.setdefault("compiled", self._new_dispatcher())  # one object, though two threads ask

    def _new_dispatcher(self) -> Any:
        return _dispatcher(self.py_func, self.targetoptions, f"kernel {self.py_func.__name__}")

    def link(self) -> None:
        if self.holder is None:
            self.compiled.address_for(self.symbol, self.signature)
        self.ready = True

    def __call__(self, *args: Any) -> Any:
        return self.made(*args)

    @property
    def carom_depends_on(self) -> Any:
        return repr(sorted(self.targetoptions.items())), self.py_func

    def _type(self) -> Any:
        return self.compiled._numba_type_  # for kernels that call it, though Python calls that of a library


class Kernel(Compiled):
    """One whose calls from Python can be timed."""

    def __call__(self, *args: Any) -> Any:
        if _timing is None:
            return self.made(*args)
        waited = log.waited
        started = time.perf_counter_ns()
        result = self.made(*args)
        elapsed = time.perf_counter_ns() - started
        if _timing is not None:
            _timing(self.py_func.__name__, elapsed, log.waited != waited)
        return result


class Part(Compiled):
    """A function that kernels call. Python runs it as written, so that it can be tried before anything compiles."""

    __call__ = LazyIntrinsic.__call__

    def _make(self) -> Any:
        return self.compiled

    def _new_dispatcher(self) -> Any:
        return dispatchers.PartDispatcher(self.py_func, self.targetoptions)


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
