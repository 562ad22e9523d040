"""Libraries of compiled kernels: carom's own, which comes with its wheel, and those of games (``carom build``).

A library is an extension module of the stable interface: it serves every Python from 3.11 on and needs no compiler.
Kernels in it go by names of their structure (:mod:`names`); records that are laid out otherwise have other names. In a
checkout, and of a game while it is made, the code may have changed since: there each kernel is used only if the hash of
its code (:mod:`hash`) is the one that it was made from. All others compile.
"""

from __future__ import annotations

import functools
import importlib
import importlib.machinery
import importlib.util
import json
import logging
import os
import platform
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from ..errors import LibraryError
from .hash import PYTHON, deep_hash
from .raised import raise_error

if TYPE_CHECKING:
    from .linkable import Linkable

NAME = "_kernels"  # by which their PyInit is called
OWN = f"carom.{NAME}"
OFF = "CAROM_LIBRARY"  # 0 in the environment: compile everything here
LAYOUT = "1"  # of what a library holds and how its functions are called

logger = logging.getLogger("carom")


class Library:
    """A library that is loaded."""

    def __init__(self, module: ModuleType) -> None:
        self.module, self.path = module, str(module.__file__)
        self.addresses: dict[str, int] = module.addresses
        self._known = {*module.addresses, *vars(module)}  # those that Python calls are functions of the module
        self.facts: dict[str, str] = module.facts
        if self.facts.get("layout") != LAYOUT:
            raise LibraryError(f"{self.path} was built by another version of carom: build it again")
        module.set_error_handler(raise_error)

    @functools.cached_property
    def hashes(self) -> dict[str, str] | None:
        """The hashes that its kernels were made from; None where they cannot be compared: carom's own of a wheel, which
        holds the sources that it was made from, and those that were made by another Python."""
        if self.facts.get("python") != PYTHON:
            return None
        return json.loads(self.facts["hashes"]) or None

    def holds(self, function: Linkable) -> bool:
        """Whether it has that function, made from the code that it has now."""
        symbol = function.symbol
        if symbol not in self._known:
            return False
        hashes = self.hashes
        return hashes is None or hashes[symbol] == short_hash(function.py_func)


def short_hash(function: Any) -> str:
    """The hash of a kernel in a library."""
    return deep_hash(function)[:16]


_added: dict[str, Library] = {}


@functools.cache
def _own() -> list[Library]:
    try:
        module = importlib.import_module(OWN)
    except ModuleNotFoundError:
        return []
    return [Library(module)]


def libraries() -> list[Library]:
    """All that are loaded, carom's own first."""
    if os.environ.get(OFF, "") == "0":
        return []
    return [*_own(), *_added.values()]


def use_kernels(folder: str | os.PathLike[str]) -> None:
    """Take kernels from that folder, too: what ``carom build`` has made for a game or a plugin, a file per platform.

    LibraryError if there is none for this platform, or one by another version of carom.
    """
    path = Path(folder).absolute()
    file, files = str(path / file_name(platform_name())), sorted(path.glob(file_name("*")))
    if not os.path.isfile(file):
        there = ", ".join(each.name for each in files) or "nothing"
        raise LibraryError(
            f"{path} has no kernels for {platform_name()}, {os.path.basename(file)}, only {there}: "
            f"carom build --platform {platform_name()} makes them"
        )
    if file not in _added:
        _added[file] = Library(_opened(file))


def platform_name() -> str:
    """What libraries call this kind of machine: linux-x86_64, linux-aarch64, macos-arm64, win-amd64, wasm32."""
    if sys.platform == "emscripten":
        return "wasm32"
    system = {"darwin": "macos", "win32": "win"}.get(sys.platform, sys.platform)
    return f"{system}-{platform.machine().lower()}"


def file_name(system: str) -> str:
    """Of a library for that platform; * for all."""
    return f"{NAME}.{system}{'.pyd' if system.startswith('win') else '' if system == '*' else '.abi3.so'}"


def _opened(file: str) -> ModuleType:
    loader = importlib.machinery.ExtensionFileLoader(NAME, file)
    specification = importlib.util.spec_from_file_location(NAME, file, loader=loader)
    assert specification is not None
    try:
        module = importlib.util.module_from_spec(specification)
        loader.exec_module(module)
    except ImportError as error:
        raise LibraryError(f"{file} cannot be loaded, it is damaged or for another platform: {error}") from error
    return module


def _holder(function: Linkable) -> Library | None:
    if function.signature is None:
        return None
    return next((library for library in libraries() if library.holds(function)), None)


def holds(function: Linkable) -> bool:
    """Whether some library has it."""
    return _holder(function) is not None


def address_of(function: Linkable) -> int:
    """Its address; 0 if no library has it."""
    library = _holder(function)
    return library.addresses[function.symbol] if library is not None else 0


def entry(function: Linkable) -> Callable[..., int] | None:
    """What Python calls; None if no library has it."""
    library = _holder(function)
    return getattr(library.module, function.symbol) if library is not None else None
