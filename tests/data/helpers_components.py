"""User components: one with a single column, and one with every option of columns."""

from __future__ import annotations

import math

from carom.framework import Component, column

NAN, INF = math.nan, math.inf


class Charge(Component):
    value = column(default=0.0)


class Everything(Component):
    """Every option that a column has."""

    plain = column()
    count = column(3, dtype=int)
    on = column(False, dtype=bool)
    size = column(1.0, positive=True)
    level = column(0.0, minimum=-2.0)
    limit = column(None, optional=True, minimum=0.0)
    mode = column("idle", choices=("idle", "busy", "gone"))
    push = column(0.0, item="vector")
    facing = column(0.0, item="rotation")
