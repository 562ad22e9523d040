"""Filters of plugins: which of the candidate pairs may meet."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...framework.errors import PluginError


def filtered(
    filters: list[tuple[str, Any]], bodies: Any, first: np.ndarray, second: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Those pairs of rows that every filter (plugin, function) lets through; PluginError if one does not say which."""
    for plugin, function in filters:
        if not len(first):
            break
        name = f"plugin {plugin}: pair filter {function.__name__}"
        try:
            may_meet = function(bodies, first, second)
        except Exception as error:
            error.add_note(name)
            raise
        if not isinstance(may_meet, np.ndarray) or may_meet.dtype != bool or may_meet.shape != first.shape:
            got = f"{may_meet.dtype} {may_meet.shape}" if isinstance(may_meet, np.ndarray) else repr(may_meet)
            raise PluginError(f"{name} must return an array of {len(first)} bool, one for each pair, got {got}")
        first, second = first[may_meet], second[may_meet]
    return first, second
