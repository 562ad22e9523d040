"""Generated source: modules that numba's cache finds by name and tracebacks can show."""

from __future__ import annotations

import hashlib
import linecache
import sys
import types
from typing import Any


def source_module(source: str, scope: dict[str, Any]) -> types.ModuleType:
    """A module of that source over the names in ``scope``; its name tells both."""
    from ....framework.jit.hash import deep_hash  # loads numba

    parts = [source, *(f"{name} {deep_hash(value)}" for name, value in sorted(scope.items()))]
    name = f"carom_shapes_{hashlib.sha256(' '.join(parts).encode()).hexdigest()[:24]}"
    module = types.ModuleType(name)
    vars(module).update(scope)
    filename = f"<{name}>"
    linecache.cache[filename] = (len(source), None, source.splitlines(keepends=True), filename)
    exec(compile(source, filename, "exec"), vars(module))
    sys.modules[name] = module
    return module
