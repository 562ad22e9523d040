"""carom.lab: the ``carom`` command: running scenes, measuring them, drawing them.

The names below are imported when they are first used: the package itself is light.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .trade_records import Trade
    from .trading import Only, trade

_MODULES = {
    "Only": "trading",
    "Trade": "trade_records",
    "trade": "trading",
}

__all__ = ["Only", "Trade", "trade"]


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f".{_MODULES[name]}", __name__), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
