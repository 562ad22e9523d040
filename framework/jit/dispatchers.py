"""numba's dispatchers, with machine code kept on disk; this and what it imports load numba.

:mod:`~carom.framework.compilation` makes one when a kernel is first needed.
"""

from __future__ import annotations

import gc
import logging
import time
import types as python_types
from typing import Any, ClassVar

from numba.core import types
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import CPUDispatcher
from numba.core.types import unliteral

from .cache import KernelCache, machine_code
from .hash import deep_hash
from .kinds import Kind, RecordKind, Signature, TupleKind
from .log import in_background, log
from .pipeline import kernel_compiler, part_compiler
from .records.record_code import record_type

logger = logging.getLogger("carom")


# What has been compiled or loaded for functions of one signature, by their names in libraries: dispatcher, signature,
# compile result.
linked: dict[str, tuple[Any, Signature, Any]] = {}
called: list[KeptDispatcher] = []  # those whose calls from Python have made them

_NUMBERS = {"int64": types.int64, "float64": types.float64, "bool": types.boolean}


def numba_type(kind: Kind) -> Any:
    """numba's type of that kind."""
    if isinstance(kind, RecordKind):
        return record_type(kind.schema, kind.dimensions)
    if isinstance(kind, TupleKind):
        return types.Tuple([numba_type(part) for part in kind.kinds])
    return _NUMBERS[kind.name]


def numba_types(signature: Signature) -> tuple[Any, tuple[Any, ...]]:
    """(of the result, of the arguments)."""
    return numba_type(signature.result), tuple(map(numba_type, signature.arguments))


def named(function: Any) -> Any:
    """The function with a hash of all it depends on in its name.

    Machine code is found by symbol name, and numba's names tell apart only functions of one process: of two that one
    factory made in different processes, both loaded from the cache, one would run in place of the other.
    """
    copy = python_types.FunctionType(
        function.__code__, function.__globals__, function.__name__, function.__defaults__, function.__closure__
    )
    vars(copy).update(vars(function))
    copy.__qualname__ = f"{function.__name__}_{deep_hash(function)[:16]}"
    return copy


class CompilerLock:
    """A context manager around compiling and loading: notes the time, and keeps other threads out.

    own: seconds without those of waits inside it, once it is over.
    """

    _running: ClassVar[list[CompilerLock]] = []

    def __enter__(self) -> CompilerLock:
        asked = time.perf_counter()
        global_compiler_lock.acquire()
        self._asked = asked
        self.own = 0.0
        self._blocks = not in_background()  # else the game goes on meanwhile
        self._collecting = gc.isenabled()
        if self._collecting:
            gc.disable()  # the compiler makes millions of objects that live on; looking through them costs a twentieth
        self._running.append(self)
        self._started = time.perf_counter()
        return self

    def __exit__(self, *_: object) -> None:
        self._running.pop()
        if self._collecting:
            if self._blocks:
                gc.collect(0)  # once now, instead of at some moment soon, which would be taken for run time
            gc.enable()
        now = time.perf_counter()
        seconds = now - self._started
        self.own += seconds
        if self._running:
            self._running[-1].own -= seconds
        elif self._blocks:
            log.waited += now - self._asked  # for another thread's function, too
        global_compiler_lock.release()


class KeptDispatcher(CPUDispatcher):
    """numba's dispatcher, with machine code kept on disk, and the cost of compiling and loading noted."""

    def __init__(self, function: Any, targetoptions: dict[str, Any], pipeline_class: Any = kernel_compiler) -> None:
        super().__init__(function, targetoptions=targetoptions, pipeline_class=pipeline_class)
        self._cache = KernelCache(self)

    def compile(self, sig: Any) -> Any:
        with CompilerLock() as wait:
            known, loaded = len(self.overloads), self._cache_hits[sig]
            entry_point = super().compile(sig)
            was_loaded = self._cache_hits[sig] > loaded
            was_compiled = len(self.overloads) > known and not was_loaded
        if was_loaded:
            log.loaded += 1
            logger.debug("loaded %s for %s", self.py_func.__name__, sig)
        elif was_compiled:
            log.compiled.append((self.py_func.__name__, wait.own))
        return entry_point

    def _asked(self, signature: Signature) -> Any:
        """What numba is asked for: of what Python calls with anything only the arguments count."""
        result, arguments = numba_types(signature)
        return result(*arguments) if self.targetoptions.get("no_cpython_wrapper") else arguments

    @property
    def dependency_count(self) -> int:
        """Of how many functions it is made: the more, the longer it takes to compile."""
        return self._cache.dependency_count

    def is_kept(self, signature: Signature) -> bool:
        """Whether it is kept on disk for that signature, and has only to be loaded."""
        return self._cache.holds(self._asked(signature), self.targetctx)

    def address_for(self, symbol: str, signature: Signature) -> int:
        """Where the machine code of what it compiles for that signature stands."""
        self.compile(self._asked(signature))
        made = self.overloads[numba_types(signature)[1]]
        linked[symbol] = self, signature, made
        return machine_code(made).get_pointer_to_function(made.fndesc.llvm_func_name)

    def _compile_for_args(self, *args: Any, **kws: Any) -> Any:
        """What numba calls for arguments of new types: looks at them, then compiles."""
        called.append(self)
        with CompilerLock():
            return super()._compile_for_args(*args, **kws)

    def typeof_pyval(self, val: Any) -> Any:
        """Called once per new type of argument; the first time loads a good part of numba."""
        with CompilerLock():
            return super().typeof_pyval(val)


class PartDispatcher(CPUDispatcher):
    """A function that only kernels call."""

    def __init__(self, function: Any, targetoptions: dict[str, Any]) -> None:
        super().__init__(function, targetoptions=targetoptions, pipeline_class=part_compiler)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """What numba asks for at a call; constants are compiled for as any number of their type is."""
        return super().get_call_template([unliteral(kind) for kind in args], kws)
