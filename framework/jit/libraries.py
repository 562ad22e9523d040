"""Libraries of compiled kernels: carom's own, which comes with its wheel, and those of games (``carom build``).

A library is an extension module of the stable interface: it serves every Python from 3.11 on and needs no compiler.
Kernels in it go by names of their structure (:mod:`names`); records that are laid out otherwise have other names. In a
checkout, and of a game while it is made, the code may have changed since: there each kernel is used only if the hash of
its code (:mod:`hash`) is the one that it was made from. All others compile.
"""

from __future__ import annotations

import functools
import importlib.machinery
import importlib.util
import json
import math
import os
import platform
import struct
import sys
import sysconfig
import weakref
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

try:
    from numpy._core._multiarray_umath import __cpu_features__
except ImportError:  # numpy 1
    from numpy.core._multiarray_umath import __cpu_features__

from ..errors import LibraryError
from .hash import PYTHON, deep_hash, writing_digest
from .kinds import INT, NONE, Kind, kind_of
from .log import CHECKED
from .names import symbol_of
from .raised import raise_error

NAME = "_kernels"  # by which their PyInit is called
OWN = f"carom.{NAME}"
OFF = "CAROM_LIBRARY"  # 0 in the environment: compile everything here; own: all that carom's own library lacks
AVX2 = "_avx2"  # behind the symbols of kernels for processors that have it
LAYOUT = "1"  # of what a library holds and how its functions are called


class Library:
    """A library that is loaded."""

    def __init__(self, module: ModuleType) -> None:
        self.module, self.path = module, str(module.__file__)
        self.addresses = _for_this_processor(module.addresses)
        self._known = {*module.addresses, *vars(module)}  # those that Python calls are functions of the module
        self.facts: dict[str, str] = module.facts
        if self.facts.get("layout") != LAYOUT:
            raise LibraryError(f"{self.path} was built by another version of carom: build it again")
        writing = self.facts.get("writing", ""), writing_digest()
        if self.is_compared and "" not in writing and len({*writing}) > 1:
            self._known.clear()  # each kernel would be compiled to other machine code now
        module.set_error_handler(raise_error)

    @property
    def is_compared(self) -> bool:
        """Whether it stands beside sources that may have changed: not in a wheel, which has both."""
        return self.facts["hashes"] != "{}"

    @functools.cached_property
    def _hashes(self) -> dict[str, str]:
        """Of the code that its kernels were made from, by symbol; none where they cannot be compared: byte code of
        another Python is other byte code."""
        return json.loads(self.facts["hashes"]) if self.facts["python"] == PYTHON else {}

    def holds(self, symbol: str, function: Any) -> bool:
        """Whether it has a function by that name, made from the code that this has now."""
        return symbol in self._known and self._hashes.get(symbol) in (None, short_hash(function))


_short_hashes: weakref.WeakKeyDictionary[Any, str] = weakref.WeakKeyDictionary()


def has_avx2() -> bool:
    """Whether this processor works on four numbers at once."""
    return __cpu_features__.get("AVX2", False)


def _for_this_processor(addresses: dict[str, int]) -> dict[str, int]:
    """Those of the kernels that it is best at; all have the same bits."""
    wide = {name.removesuffix(AVX2): address for name, address in addresses.items() if name.endswith(AVX2)}
    return addresses | wide if wide and has_avx2() else addresses


def short_hash(function: Any) -> str:
    """The hash of a kernel in a library."""
    if function not in _short_hashes:  # several functions may have one symbol: what was redefined, or reloaded
        _short_hashes[function] = deep_hash(function)[:16]
    return _short_hashes[function]


_added: dict[str, Library] = {}


@functools.cache
def _own() -> list[Library]:
    found = importlib.util.find_spec(OWN)
    if found is None or found.origin is None:
        return []
    module = _opened(found.origin)
    made_for = module.facts.get("layout"), module.facts.get("python")
    if module.facts.get("hashes") != "{}" and made_for != (LAYOUT, PYTHON):  # in a checkout, which has moved on
        return []
    if module.facts.get("features") and not has_avx2():  # or to another machine
        return []
    return [Library(module)]


def libraries() -> list[Library]:
    """All that are loaded, carom's own first."""
    if CHECKED or os.environ.get(OFF, "") == "0":  # none checks its indices
        return []
    return [*_own(), *_added.values()]


def use_kernels(folder: str | os.PathLike[str]) -> None:
    """Take kernels from that folder, too: what ``carom build`` has made for a game or a plugin, a file per platform.

    LibraryError if there is none for this platform, or one by another version of carom.
    """
    if os.environ.get(OFF, "") in ("0", "own"):  # as when it is built
        return
    path = Path(folder).absolute()
    file, files = str(path / file_name(platform_name())), sorted(path.glob(file_name("*")))
    if not os.path.isfile(file):
        there = ", ".join(each.name for each in files) or "nothing"
        raise LibraryError(
            f"{path} has no kernels for {platform_name()}, {os.path.basename(file)}, only {there}: "
            f"carom build --platform {platform_name()} makes them"
        )
    if file not in _added:
        library, version = Library(_opened(file)), sys.modules[OWN.partition(".")[0]].__version__
        if library.facts["carom"] != version:  # kernels work on records and stages of that version
            raise LibraryError(f"{file} was built by carom {library.facts['carom']}, this is {version}: build it again")
        _added[file] = library


def platform_name() -> str:
    """What libraries call this kind of machine: linux-x86_64, linux-aarch64, macos-arm64, win-amd64, wasm32."""
    if sys.platform == "emscripten":
        return "wasm32"
    return f"macos-{platform.machine()}" if sys.platform == "darwin" else sysconfig.get_platform()


def file_name(system: str) -> str:
    """Of a library for that platform; * for all."""
    return f"{NAME}.{system}{'.pyd' if system.startswith('win') else '' if system == '*' else '.abi3.so'}"


def _opened(file: str) -> ModuleType:
    """The library as a module; LibraryError if it cannot be loaded."""
    if not _is_whole(file):
        raise LibraryError(f"{file} is not whole, a part of the library is missing: copy or build it again")
    loader = importlib.machinery.ExtensionFileLoader(NAME, file)
    specification = importlib.util.spec_from_file_location(NAME, file, loader=loader)
    assert specification is not None
    try:
        module = importlib.util.module_from_spec(specification)
        loader.exec_module(module)
    except ImportError as error:
        raise LibraryError(f"{file} cannot be loaded, it is damaged or for another platform: {error}") from error
    return module


def _is_whole(file: str) -> bool:
    """Of ELF files: whether all is there that the loader of Linux maps without asking. The table at the end tells."""
    with open(file, "rb") as opened:
        head, size = opened.read(64), os.fstat(opened.fileno()).st_size
    if head[:4] != b"\x7fELF":
        return True
    if len(head) < 64:
        return False
    (start,), sizes = struct.unpack_from("<Q", head, 40), struct.unpack_from("<HH", head, 58)
    return start + math.prod(sizes) <= size


def holder(symbol: str, function: Any) -> Library | None:
    """The library that has that function; None if there is none."""
    return next((library for library in libraries() if library.holds(symbol, function)), None)


class CalledWithArrays:
    """A kernel that Python calls with arrays, out of libraries: a function of each for every kind of arguments."""

    def __init__(self, function: Any) -> None:
        self._function = function
        self._found: dict[tuple[Kind | None, ...], Callable[..., int | None]] = {}

    def __call__(self, *arguments: Any) -> int | None:
        kinds = tuple(map(kind_of, arguments))
        if kinds not in self._found:
            self._found[kinds] = self._find(kinds)
        flat: list[Any] = []
        for value in arguments:
            flat += flattened(value) if isinstance(value, np.ndarray) else (value,)
        return self._found[kinds](*flat)

    def _find(self, kinds: tuple[Kind | None, ...]) -> Callable[..., int | None]:
        known = [kind for kind in kinds if kind is not None]
        for library in libraries() if len(known) == len(kinds) else ():
            for result in (NONE, INT):
                symbol = symbol_of(self._function, result(*known))
                if library.holds(symbol, self._function):
                    return getattr(library.module, symbol)
        raise missing(f"kernel {self._function.__name__} for ({', '.join(map(str, kinds))})")


def flattened(array: np.ndarray) -> tuple[int, ...]:
    """What machine code gets for an array: owners of its memory, for which kernels do not ask, numbers of items and of
    bytes of each, address, lengths, strides."""
    return 0, 0, array.size, array.itemsize, array.ctypes.data, *array.shape, *array.strides


def missing(what: str) -> LibraryError:
    """The error of what nothing here can compile."""
    known = ", ".join(each.path for each in libraries()) or "none is loaded"
    on_page = sys.platform == "emscripten"
    cure = "build the page" if on_page else "pip install numba, or build the game"
    if getattr(sys, "frozen", False) and not _own():
        cure = f"pack {OWN} as well (PyInstaller: --hidden-import {OWN}), or build the game"
    return LibraryError(
        f"{what} is in no library of kernels ({known}) or was edited since, and numba, which would compile it, is not "
        f"installed: {cure} anew with all that it uses (carom build)"
    )
