"""After an impact: when its bodies may leave their search bounds."""

from __future__ import annotations

from ...framework.compilation import part
from ..ccd.search_bounds import leaves_bounds_at


@part
def update_bounds_exit_time(state, i, dt):
    """The body goes on from here: note when it may leave its search bounds."""
    impacts = state.impacts
    state.bodies.last_impact[i] = impacts.now
    impacts.until = min(impacts.until, leaves_bounds_at(state, i, impacts.now, dt))
