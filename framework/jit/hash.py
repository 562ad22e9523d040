"""A hash of a function and of everything its machine code depends on, stable between processes.

numba's own cache looks at the file a function stands in and at its closure; it does not see that a function which it
calls, in another file, was edited. Here byte code, constants, options, captured values and, recursively, every
function called go into the hash.
"""

from __future__ import annotations

import hashlib
import types
from typing import Any

import numba
import numpy as np
from numba.core.dispatcher import Dispatcher


def deep_hash(function: Any) -> str:
    """The hash, as hexadecimal digits; numba's and numpy's versions are part of it."""
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
