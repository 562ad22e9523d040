"""Compiled kernels: numba dispatchers with a disk cache of our own.

numba's own cache has three properties a framework cannot live with: it does not notice an edit in a function that
lives in another file, it misses for functions made by factories (closures over other kernels), and the import of a
module fails where it finds no folder to write to. The cache here stores one file per kernel and signature, named by a
hash of everything the machine code depends on: byte code, constants, options, captured values and, recursively, every
function called.
"""

from __future__ import annotations

import contextlib
import getpass
import hashlib
import operator
import os
import pickle
import tempfile
import time
import types
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import numba
import numpy as np
from numba.core import compiler
from numba.core.caching import _Cache
from numba.core.dispatcher import Dispatcher
from numba.core.serialize import dumps

Function = TypeVar("Function", bound=Callable[..., Any])

machine_code = operator.attrgetter("library")  # of numba's compile result

CACHE_FOLDER_VARIABLE = "CAROM_CACHE_DIR"


@dataclass
class CompilationLog:
    """What compiling has cost this process so far; the lab reports it apart from run time."""

    compiled: list[tuple[str, float]] = field(default_factory=list)  # (kernel, seconds)
    loaded: int = 0
    listeners: list[Callable[[str], None]] = field(default_factory=list)

    @property
    def seconds(self) -> float:
        return sum(seconds for _, seconds in self.compiled)


log = CompilationLog()


# A wrapper for C callers costs compile time and serves none of our kernels.
_OPTIONS = {"error_model": "numpy", "no_cfunc_wrapper": True}


def kernel(function: Function) -> Function:
    """Compile ``function`` on first call, per argument types, and keep the machine code on disk.

    IEEE semantics throughout (no fastmath: same input, same bits); division by zero gives inf or nan. The function
    cannot make arrays: without numba's reference counting, which costs more than the work itself where arrays are
    passed in tuples. Use :func:`allocating_kernel` for those that must.
    """
    return _cached(numba.njit(**_OPTIONS, _nrt=False)(function))


def allocating_kernel(function: Function) -> Function:
    """Like :func:`kernel`, for functions that make arrays; keep hot loops out of them."""
    return _cached(numba.njit(**_OPTIONS)(function))


def part(function: Function) -> Function:
    """For functions that only kernels call: no entry from Python, nothing on disk of their own."""
    return numba.njit(**_OPTIONS, no_cpython_wrapper=True, _nrt=False)(function)  # type: ignore[return-value]


def inlined(function: Function) -> Function:
    """Like :func:`part`, for small helpers that must disappear into the kernels which call them."""
    options = {**_OPTIONS, "no_cpython_wrapper": True, "forceinline": True, "_nrt": False}
    return numba.njit(**options)(function)  # type: ignore[return-value]


def _cached(dispatcher: Any) -> Any:
    if isinstance(dispatcher, Dispatcher):  # a plain function when NUMBA_DISABLE_JIT is set
        dispatcher._cache = KernelCache(dispatcher)  # type: ignore[attr-defined]
    return dispatcher


def cache_folder() -> Path | None:
    """The first folder that can be written: the environment's choice, the user's cache, a temporary one; else None."""
    chosen = os.environ.get(CACHE_FOLDER_VARIABLE)
    candidates = [Path(chosen)] if chosen else []
    base = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA")
    with contextlib.suppress(RuntimeError):  # no home folder
        candidates.append((Path(base) if base else Path.home() / ".cache") / "carom")
    with contextlib.suppress(OSError, KeyError, ImportError):  # no user name
        candidates.append(Path(tempfile.gettempdir()) / f"carom-{getpass.getuser()}")
    for folder in candidates:
        if _usable(folder):
            return folder
    return None


def _usable(folder: Path) -> bool:
    """Whether ``folder`` exists or can be made, is writable and is ours: machine code is loaded from it."""
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        owner = getattr(os, "getuid", None)
        return os.access(folder, os.W_OK) and (owner is None or folder.stat().st_uid == owner())
    except OSError:
        return False


class KernelCache(_Cache):
    """numba's cache interface over one file per (deep hash, signature, processor)."""

    def __init__(self, dispatcher: Any) -> None:
        self._dispatcher = dispatcher
        self._enabled = True
        self._started: dict[Any, float] = {}
        self._hash: str | None = None

    @property
    def cache_path(self) -> str:
        return str(cache_folder() or "")

    def enable(self) -> None:
        self._enabled = True

    def disable(self) -> None:
        self._enabled = False

    def flush(self) -> None:
        folder = cache_folder()
        for path in folder.glob(f"{self._stem()}-*") if folder else ():
            path.unlink(missing_ok=True)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        target_context.refresh()
        path = self._path(sig, target_context.codegen())
        if self._enabled and path is not None and path.exists():
            # A damaged or half-readable file is a miss: the kernel is compiled again and the file replaced.
            with contextlib.suppress(OSError, EOFError, pickle.UnpicklingError, AttributeError, ImportError):
                payload = pickle.loads(path.read_bytes())
                result = compiler.CompileResult._rebuild(target_context, *payload)
                log.loaded += 1
                return result
        self._started[sig] = time.perf_counter()
        for listener in log.listeners:
            listener(self._dispatcher.py_func.__qualname__)
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        started = self._started.pop(sig, None)
        if started is not None:
            name = self._dispatcher.py_func.__qualname__
            log.compiled.append((name, time.perf_counter() - started))
        path = self._path(sig, data.codegen)
        if not self._enabled or path is None or machine_code(data).has_dynamic_globals or data.lifted:
            return
        with contextlib.suppress(OSError):  # a full or vanished disk costs speed, never the run
            handle, temporary = tempfile.mkstemp(dir=path.parent)
            with os.fdopen(handle, "wb") as file:
                file.write(dumps(data._reduce()))
            os.replace(temporary, path)

    def _stem(self) -> str:
        if self._hash is None:
            self._hash = deep_hash(self._dispatcher)
        return f"{self._dispatcher.py_func.__name__}-{self._hash[:32]}"

    def _path(self, sig: Any, codegen: Any) -> Path | None:
        folder = cache_folder()
        if folder is None:
            return None
        key = hashlib.sha256(repr((sig, codegen.magic_tuple())).encode()).hexdigest()
        return folder / f"{self._stem()}-{key[:24]}.kernel"


def deep_hash(function: Any) -> str:
    """A hash of ``function`` and of everything its machine code depends on, stable between processes."""
    digest = hashlib.sha256(repr((numba.__version__, np.__version__)).encode())
    _feed(function, digest, set())
    return digest.hexdigest()


def _feed(value: Any, digest: Any, seen: set[int]) -> None:
    """Add ``value`` to ``digest``; functions are followed into what they call, each once."""
    if isinstance(value, Dispatcher):
        digest.update(repr(sorted(value.targetoptions.items())).encode())
        value = value.py_func
    if hasattr(value, "carom_depends_on"):  # code written by hand, see vectors
        value = value.carom_depends_on
    if isinstance(value, types.FunctionType):
        if id(value) in seen:
            digest.update(b"again")
            return
        seen.add(id(value))
        _feed_code(value.__code__, digest)
        captured = [cell.cell_contents for cell in value.__closure__ or ()]
        for item in [*captured, *(value.__defaults__ or ())]:
            _feed(item, digest, seen)
        for name, item in _referenced_globals(value):
            digest.update(name.encode())
            _feed(item, digest, seen)
    elif isinstance(value, (tuple, list)):
        digest.update(f"{type(value).__name__}{len(value)}".encode())
        for item in value:
            _feed(item, digest, seen)
    elif isinstance(value, type):
        digest.update(f"{value.__module__}.{value.__qualname__}{getattr(value, '_fields', '')}".encode())
    elif isinstance(value, np.ndarray):
        digest.update(repr((value.dtype.str, value.shape)).encode() + value.tobytes())
    elif isinstance(value, types.ModuleType):
        digest.update(value.__name__.encode())
    else:
        digest.update(f"{type(value).__qualname__}{value!r}".encode() if _is_plain(value) else b"")
        digest.update(type(value).__qualname__.encode())


def _is_plain(value: Any) -> bool:
    """Values whose repr is the same in every process (no addresses)."""
    return isinstance(value, (bool, int, float, complex, str, bytes, type(None), np.generic))


def _feed_code(code: types.CodeType, digest: Any) -> None:
    digest.update(code.co_code)
    digest.update(repr((code.co_names, code.co_varnames, code.co_freevars)).encode())
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            _feed_code(constant, digest)
        else:
            digest.update(repr(constant).encode())


def _referenced_globals(function: types.FunctionType) -> list[tuple[str, Any]]:
    """The globals the function names; through a module, the attributes that its code names too."""
    names = set(_all_names(function.__code__))
    found: list[tuple[str, Any]] = []
    for name in sorted(names & function.__globals__.keys()):
        item = function.__globals__[name]
        found.append((name, item))
        if isinstance(item, types.ModuleType):
            attributes = sorted(names & vars(item).keys())
            members = ((attribute, getattr(item, attribute)) for attribute in attributes)
            found += [(f"{name}.{a}", m) for a, m in members if isinstance(m, (Dispatcher, int, float, tuple))]
    return found


def _all_names(code: types.CodeType) -> list[str]:
    nested = [c for c in code.co_consts if isinstance(c, types.CodeType)]
    return [*code.co_names, *(name for inner in nested for name in _all_names(inner))]
