"""carom.lab: the ``carom`` command: running scenes, measuring them, drawing them.

The names below are imported when they are first used: the package itself is light.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .geometry_measure import geometry_study
    from .limits_sweep import limits
    from .suggest import step_limits, suggest_dt
    from .trade_records import Trade
    from .trading import Only, trade
    from .tune_check import check
    from .tuning import NothingMeetsError, Tuning, search, tune

_MODULES = {
    "NothingMeetsError": "tuning",
    "Only": "trading",
    "Trade": "trade_records",
    "Tuning": "tuning",
    "check": "tune_check",
    "geometry_study": "geometry_measure",
    "limits": "limits_sweep",
    "search": "tuning",
    "step_limits": "suggest",
    "suggest_dt": "suggest",
    "trade": "trading",
    "tune": "tuning",
}

__all__ = [
    "NothingMeetsError",
    "Only",
    "Trade",
    "Tuning",
    "check",
    "geometry_study",
    "limits",
    "search",
    "step_limits",
    "suggest_dt",
    "trade",
    "tune",
]


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f".{_MODULES[name]}", __name__), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
