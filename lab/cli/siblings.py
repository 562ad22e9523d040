"""Modules beside a file of the user: there while its code runs, gone when other files are loaded."""

from __future__ import annotations

import sys
import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

_all: weakref.WeakSet[Siblings] = weakref.WeakSet()


def module_of(thing: type) -> ModuleType | None:
    """The module of a class, which may lie beside a file of the user."""
    name = thing.__module__
    found = (sys.modules.get(name), *(siblings._modules.get(name) for siblings in _all))
    return next((module for module in found if vars(module or thing).get(thing.__name__) is thing), None)


class Siblings:
    """The modules that a file imports from its own folder.

    Two files from different folders may both ``import params``: each gets its own.
    """

    def __init__(self, file: Path) -> None:
        self.folder = file.resolve().parent
        self._modules: dict[str, ModuleType] = {}
        self._depth = 0
        _all.add(self)

    @property
    def files(self) -> set[Path]:
        """Where those that have been imported come from."""
        return {Path(file) for module in self._modules.values() if (file := getattr(module, "__file__", None))}

    @contextmanager
    def at_hand(self) -> Iterator[None]:
        """Imports find the file's siblings; afterwards ``sys.path`` and ``sys.modules`` are as they were before."""
        if self._depth:
            yield
            return
        self._depth += 1
        path = str(self.folder)
        before = {name: module for name, module in sys.modules.items() if name in self._modules}
        known = set(sys.modules) - before.keys()
        sys.modules.update(self._modules)
        sys.path.insert(0, path)
        try:
            yield
        finally:
            self._depth -= 1
            if path in sys.path:
                sys.path.remove(path)
            for name in [name for name in sys.modules if name not in known and self._is_sibling(name)]:
                self._modules[name] = sys.modules.pop(name)
            sys.modules.update(before)

    def _is_sibling(self, name: str) -> bool:
        """Whether a module, or the package it belongs to, lies in the folder itself."""
        top = sys.modules.get(name.partition(".")[0])
        file = getattr(top, "__file__", None)
        if file is not None:
            place = Path(file)
            return self.folder == (place.parent.parent if place.stem == "__init__" else place.parent)
        return any(Path(folder).parent == self.folder for folder in getattr(top, "__path__", ()))
