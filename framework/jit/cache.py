"""The disk cache of compiled kernels: one file per kernel, signature and processor.

numba's own cache has three properties a framework cannot live with: it does not notice an edit in a function that
lives in another file, it misses for functions made by factories (closures over other kernels), and the import of a
module fails where it finds no folder to write to. Here a file is named by a hash of everything the machine code depends
on (:mod:`hash`), and ends with a checksum of what it holds: whatever happened to it, a damaged file is compiled
anew. Files are written whole or not at all, so any number of processes share a folder.
"""

from __future__ import annotations

import contextlib
import functools
import getpass
import hashlib
import logging
import operator
import os
import pickle
import stat
import tempfile
from pathlib import Path
from typing import Any

import llvmlite.binding
import numba
import numpy as np
from numba.core import compiler, config
from numba.core.caching import _Cache
from numba.core.runtime import _nrt_python
from numba.core.serialize import dumps

from .hash import PYTHON, hash_and_reach, writing_digest
from .log import in_background, log

CACHE_FOLDER_VARIABLE = "CAROM_CACHE_DIR"
KERNELS, UNFINISHED = "*.kernel", "*.unfinished"

logger = logging.getLogger("carom")
machine_code = operator.attrgetter("library")  # of numba's compile result
_checksum = hashlib.sha256
_reported: set[Path] = set()  # folders that could not be used or written, told once


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


def cache_contents() -> tuple[int, int]:
    """How many kernels the cache folder holds, and their bytes; (0, 0) without a folder."""
    sizes = []
    for path in _files(KERNELS):
        with contextlib.suppress(FileNotFoundError):  # another process empties the folder
            sizes.append(path.stat().st_size)
    return len(sizes), sum(sizes)


def clear_cache() -> tuple[int, int]:
    """Delete all kernels from the cache folder, those of older versions too; how many there were, and their bytes."""
    contents = cache_contents()
    for path in [*_files(KERNELS), *_files(UNFINISHED)]:
        path.unlink(missing_ok=True)
    return contents


def _files(pattern: str) -> list[Path]:
    folder = cache_folder()
    return list(folder.glob(pattern)) if folder is not None else []


def _usable(folder: Path) -> bool:
    """Whether ``folder`` exists or can be made, is writable, and only for us: machine code is loaded from it."""
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        found = folder.stat()
    except OSError as error:
        _report(folder, error.strerror or str(error), wanted=os.environ.get(CACHE_FOLDER_VARIABLE) == str(folder))
        return False
    if os.name == "posix":
        if found.st_uid != os.getuid():
            _report(folder, "it belongs to another user, who could put other code there")
            return False
        if stat.S_IMODE(found.st_mode) & (stat.S_IWGRP | stat.S_IWOTH):
            _report(folder, f"others may write to it and could put other code there (chmod go-w {folder} mends that)")
            return False
    return os.access(folder, os.W_OK)


def _report(folder: Path, reason: str, wanted: bool = True) -> None:
    """Say once that a folder is not used; of those that no setting names only at level DEBUG."""
    if folder not in _reported:
        _reported.add(folder)
        level = logging.WARNING if wanted else logging.DEBUG
        logger.log(level, "carom: compiled kernels are not kept in %s: %s", folder, reason)


def _read(path: Path) -> Any:
    """What a file holds; None if there is none. A damaged or unreadable one is a miss, too: it will be replaced."""
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        return None
    except OSError as error:
        logger.debug("carom: %s cannot be read: %s", path, error.strerror or error)
        return None
    size = _checksum().digest_size
    if _checksum(data[:-size]).digest() != data[-size:]:
        logger.info("carom: %s is damaged, the kernel is compiled anew", path)
        return None
    try:
        return pickle.loads(data)
    except (EOFError, pickle.UnpicklingError, AttributeError, ImportError, TypeError, ValueError) as error:
        logger.info("carom: %s is of no use here, the kernel is compiled anew: %s", path, error)
        return None


@functools.cache
def _name_runtime() -> None:
    """Name numba's runtime to the linker, as numba does before it first compiles: errors of plugins' stages call it."""
    for name, address in _nrt_python.c_helpers.items():
        llvmlite.binding.add_symbol(name if name.startswith("_") else f"NRT_{name}", address)


def _loaded(context: Any, library: Any, description: Any, *rest: Any) -> Any:
    """A kernel from its file, without what only the compiler needs: numba's own functions, which the first kernel that
    has to compile loads, and its code in LLVM's language, which is read when another kernel has it compiled in."""
    _name_runtime()
    name, kind, (code, inlinable) = library
    nothing = llvmlite.binding.parse_assembly("").as_bitcode()
    symbols = "llvm_func_name", "llvm_cpython_wrapper_name", "llvm_cfunc_wrapper_name"
    context.codegen()._engine._defined_symbols.update(getattr(description, symbol) for symbol in symbols)
    result = compiler.CompileResult._rebuild(context, (name, kind, (code, nothing)), description, *rest)
    machine_code(result)._get_module_for_linking = functools.cache(lambda: llvmlite.binding.parse_bitcode(inlinable))
    return result


def announcement() -> str:
    """What is said once of a process that compiles: where the kernels are kept."""
    log.announced = True
    folder = cache_folder()
    if folder is not None:
        return (
            f"carom: compiling kernels that are not in {folder} yet; for all that a world needs this takes about 20 s, "
            "later runs load them (carom warm-up compiles ahead)"
        )
    return (
        "carom: compiling kernels, which takes about 20 s in every run: there is no folder that can be written to "
        f"keep them ({CACHE_FOLDER_VARIABLE} names one)"
    )


def announce(dispatcher: Any) -> None:
    """Say that a kernel is about to compile; only INFO where no step waits for it, see background."""
    for listener in log.listeners:
        listener(dispatcher.py_func.__name__)
    if not log.announced and not log.listeners and not in_background():
        logger.warning(announcement())
    logger.info("compiling %s (%d so far, %.1f s)", dispatcher.py_func.__name__, len(log.compiled), log.seconds)


class KernelCache(_Cache):
    """numba's cache interface over those files."""

    def __init__(self, dispatcher: Any) -> None:
        self._dispatcher = dispatcher
        self._enabled = True
        self._hash_and_reach: tuple[str, int] | None = None

    @property
    def cache_path(self) -> str:
        return str(cache_folder() or "")

    def enable(self) -> None:
        self._enabled = True

    def disable(self) -> None:
        self._enabled = False

    def flush(self) -> None:
        for path in _files(f"{self._stem()}-*"):
            path.unlink(missing_ok=True)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        path = self._path(sig, target_context.codegen())
        found = _read(path) if self._enabled and path is not None else None
        if found is not None:
            return _loaded(target_context, *found)
        announce(self._dispatcher)
        return None

    def holds(self, sig: Any, target_context: Any) -> bool:
        """Whether there is a file for that signature, so that most likely nothing has to compile."""
        path = self._path(sig, target_context.codegen())
        return self._enabled and path is not None and path.exists()

    def save_overload(self, sig: Any, data: Any) -> None:
        path = self._path(sig, data.codegen)
        if not self._enabled or path is None or machine_code(data).has_dynamic_globals or data.lifted:
            return
        content = dumps(data._reduce())
        temporary = None
        try:
            handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=UNFINISHED[1:])
            with os.fdopen(handle, "wb") as file:
                file.write(content + _checksum(content).digest())
            os.replace(temporary, path)
        except OSError as error:  # a full or vanished disk costs speed, never the run
            if temporary is not None:
                with contextlib.suppress(OSError):
                    os.unlink(temporary)
            if path.parent not in _reported:
                _reported.add(path.parent)
                logger.warning(
                    "carom: kernels cannot be kept in %s, the next run compiles again: %s",
                    path.parent, error.strerror or error,
                )  # fmt: skip

    @property
    def dependency_count(self) -> int:
        """Of how many functions the kernel is made."""
        return self._hashed()[1]

    def _hashed(self) -> tuple[str, int]:
        if self._hash_and_reach is None:
            found, reach = hash_and_reach(self._dispatcher)
            self._hash_and_reach = hashlib.sha256((found + toolchain()).encode()).hexdigest(), reach
        return self._hash_and_reach

    def _stem(self) -> str:
        return f"{self._dispatcher.py_func.__name__}-{self._hashed()[0][:32]}"

    def _path(self, sig: Any, codegen: Any) -> Path | None:
        folder = cache_folder()
        return folder / self._name(sig, codegen.magic_tuple()) if folder is not None else None

    def _name(self, sig: Any, target: Any) -> str:
        """The file's name, for a kind of processor: (platform, name, features)."""
        key = hashlib.sha256(f"{type_names(sig)} {target!r}".encode()).hexdigest()
        return f"{self._stem()}-{key[:24]}.kernel"


# What numba makes other code for: its switches, by their names in the environment less NUMBA_.
SWITCHES = (
    "BOUNDSCHECK", "DEBUGINFO_DEFAULT", "OPT", "LOOP_VECTORIZE", "SLP_VECTORIZE", "ENABLE_AVX",
)  # fmt: skip


@functools.cache
def toolchain() -> str:
    """All that machine code depends on beside the kernel: versions, switches, and how carom has numba write code."""
    switches = [(name, getattr(config, name, None)) for name in SWITCHES]
    versions = PYTHON, numba.__version__, llvmlite.__version__, np.__version__
    return hashlib.sha256(repr((versions, switches, writing_digest())).encode()).hexdigest()


def type_names(kind: Any) -> str:
    """A numba type or signature in words; numba's own leave out the fields of named tuples, and which comes first."""
    fields = f" {kind.fields}" if hasattr(kind, "fields") else ""
    inner = getattr(kind, "args", None) or getattr(kind, "types", None) or ()
    if isinstance(kind, (tuple, list)):
        inner = kind
    return f"{kind}{fields}({', '.join(type_names(part) for part in inner)})" if inner else f"{kind}{fields}"
