"""carom.lab: the ``carom`` command, which runs, measures and draws scenes.

The names below are imported on first use, so importing the package itself is cheap.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .inputs import Inputs
    from .limits.step_length import step_limits, suggest_dt
    from .trading.trade import Trade, trade

_MODULES = {
    "Inputs": "inputs",
    "Trade": "trading.trade",
    "step_limits": "limits.step_length",
    "suggest_dt": "limits.step_length",
    "trade": "trading.trade",
}

__all__ = ["Inputs", "Trade", "step_limits", "suggest_dt", "trade"]


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f".{_MODULES[name]}", __name__), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
