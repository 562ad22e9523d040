"""The stage that copies what stages of plugins write, before any of them runs."""

from __future__ import annotations

from ...framework.data.column_copies import copy_all
from ..codes import OK
from ..step_stages import KEEPS_WRITTEN


def keep_written(state, dt):
    """Copies of whole columns: a step that fails puts them back."""
    copy_all(state.plugin_stages[state.stage])
    state.kept |= KEEPS_WRITTEN
    return OK
