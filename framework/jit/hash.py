"""A hash of a function and of everything its machine code depends on, stable between processes of one Python.

numba's own cache looks at the file a function stands in and at its closure; it does not see that a function which it
calls, in another file, was edited. Here byte code, constants, options, captured values and, recursively, every
function called go into the hash; of modules and enumerations whatever the code names.
"""

from __future__ import annotations

import enum
import hashlib
import sys
import types
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from .lazy import LazyModule
from .names import structure_of

# Whose byte code it is: -O leaves out assertions, -OO docstrings, and numbers constants otherwise.
PYTHON = f"{sys.implementation.name} {sys.version_info.major}.{sys.version_info.minor}"
PYTHON += " optimised" * sys.flags.optimize


def writing_digest() -> str:
    """The hash of the modules that write code in LLVM's language; empty where their sources are not at hand."""
    files = Path(__file__).with_name("pipeline.py"), Path(__file__).parent / "records" / "record_code.py"
    if not all(file.exists() for file in files):
        return ""
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()


def is_packed(function: Any) -> bool:
    """Whether it is such a kernel."""
    return getattr(function, "carom_packed", False)


def deep_hash(function: Any) -> str:
    """The hash, as hexadecimal digits."""
    return hash_and_reach(function)[0]


def hash_and_reach(function: Any) -> tuple[str, int]:
    """The hash, and of how many functions the code is made: how long it takes to compile, roughly."""
    digest, seen = hashlib.sha256(), dict[int, int]()
    _feed(function, digest, seen)
    return digest.hexdigest(), len(seen)


def _feed(value: Any, digest: Any, seen: dict[int, int]) -> None:
    """Add ``value`` to ``digest``; functions are followed into what they call, each once."""
    if isinstance(value, LazyModule):
        return
    if hasattr(value, "carom_depends_on"):  # code written by hand, see vectors
        value = value.carom_depends_on
    elif hasattr(value, "py_func"):  # made by numba's own decorators
        digest.update(repr(sorted(value.targetoptions.items())).encode())
        value = value.py_func
    if isinstance(value, types.FunctionType):
        if id(value) in seen:
            digest.update(f"again {seen[id(value)]}".encode())  # which of them
            return
        seen[id(value)] = len(seen)
        _feed_code(value.__code__, digest)
        digest.update(b"packed" if is_packed(value) else b"")
        captured = [cell.cell_contents for cell in value.__closure__ or ()]
        for item in [*captured, *(value.__defaults__ or ())]:
            _feed(item, digest, seen)
        for name, item in _referenced_globals(value):
            digest.update(name.encode())
            _feed(item, digest, seen)
    elif isinstance(value, (tuple, list)):
        digest.update(f"{type(value).__name__}{len(value)}{getattr(value, '_fields', '')}".encode())
        for item in value:
            _feed(item, digest, seen)
    elif isinstance(value, type):
        digest.update(structure_of(value).encode())  # the same whether a game is run or loaded
        if issubclass(value, enum.Enum):
            digest.update(repr([(member.name, member.value) for member in value]).encode())
    elif isinstance(value, enum.Enum):
        digest.update(f"{type(value).__qualname__}.{value.name}={value.value!r}".encode())
    elif isinstance(value, np.ndarray):
        digest.update(repr((value.dtype.str, value.shape)).encode() + value.tobytes())
    elif isinstance(value, (types.BuiltinFunctionType, np.ufunc)) or type(value) is type(np.dot):
        digest.update(structure_of(value).encode())
    elif isinstance(value, types.ModuleType):
        digest.update(value.__name__.encode())
    else:
        digest.update(f"{type(value).__qualname__}{value!r}".encode() if _is_plain(value) else b"")
        digest.update(type(value).__qualname__.encode())


def _is_plain(value: Any) -> bool:
    """Values whose repr is the same in every process (no addresses)."""
    return isinstance(value, (bool, int, float, complex, str, bytes, type(None), np.generic, np.dtype))


def _feed_code(code: types.CodeType, digest: Any) -> None:
    digest.update(code.co_code)
    digest.update(repr((code.co_names, code.co_varnames, code.co_freevars)).encode())
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            _feed_code(constant, digest)
        else:
            plain = sorted(constant, key=repr) if isinstance(constant, frozenset) else constant
            digest.update(repr(plain).encode())


def _referenced_globals(function: types.FunctionType) -> Iterator[tuple[str, Any]]:
    """The globals the function names; through modules, the attributes that its code names too."""
    names = set(_all_names(function.__code__))
    for name in sorted(names & function.__globals__.keys()):
        yield from _reached(name, function.__globals__[name], names, set())


def _reached(path: str, value: Any, names: set[str], seen: set[str]) -> Iterator[tuple[str, Any]]:
    yield path, value
    if isinstance(value, types.ModuleType) and value.__name__ not in seen:
        seen.add(value.__name__)
        for name in sorted(names & vars(value).keys()):
            member = vars(value)[name]
            # Plain functions of a module cannot be called from compiled code: what numba has for them is its own.
            if not isinstance(member, types.FunctionType) or hasattr(member, "carom_depends_on"):
                yield from _reached(f"{path}.{name}", member, names, seen)


def _all_names(code: types.CodeType) -> list[str]:
    nested = [c for c in code.co_consts if isinstance(c, types.CodeType)]
    return [*code.co_names, *(name for inner in nested for name in _all_names(inner))]
