"""Stages of plugins as the program calls them."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from ...framework.jit.linking import CACHE_SIZE
from ...framework.plugins.registry import PluginStage
from ..codes import OK
from ..shapes.linking.source import source_module
from ..shapes.linking.user_functions import user_function


@lru_cache(maxsize=CACHE_SIZE)
def compiled_stage(stage: PluginStage) -> Any:
    """A function (state, dt) -> code of the plugin's function; it has its name."""
    source = f"def {stage.name}(state, dt):\n    function(state, dt)\n    return OK\n"
    return getattr(source_module(source, {"function": user_function(stage.function), "OK": OK}), stage.name)
