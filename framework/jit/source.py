"""Generated source: modules that numba's cache finds by name and tracebacks can show."""

from __future__ import annotations

import hashlib
import linecache
import sys
import types
from typing import Any

from .names import structure_of

MODULES = 4096  # that a process remembers for tracebacks, the youngest

_made: dict[str, None] = {}


def source_module(source: str, scope: dict[str, Any]) -> types.ModuleType:
    """A module of that source over the names in ``scope``; its name tells both."""
    parts = [source, *(f"{name} {structure_of(value)}" for name, value in sorted(scope.items()))]
    name = f"carom_shapes_{hashlib.sha256(' '.join(parts).encode()).hexdigest()[:24]}"
    module = types.ModuleType(name)
    vars(module).update(scope)
    filename = f"<{name}>"
    linecache.cache[filename] = (len(source), None, source.splitlines(keepends=True), filename)
    exec(compile(source, filename, "exec"), vars(module))
    sys.modules[name] = module
    _made[name] = _made.pop(name, None)  # now the last
    if len(_made) > MODULES:
        oldest = next(iter(_made))
        for place, key in ((_made, oldest), (sys.modules, oldest), (linecache.cache, f"<{oldest}>")):
            place.pop(key, None)
    return module
