"""Helpers for the functions of joints, see docs/write-a-joint.md."""

from __future__ import annotations

from ...framework.compilation import inlined
from ...framework.vectors import add_scaled, item, scale
from ...systems.integration.turning import twist as moment


@inlined
def arm_of(body, local):
    """The vector from the position of a body to a point that is ``local`` along its axes."""
    arm = scale(body.axes[0], item(local, 0))
    for k in range(1, len(local)):
        arm = add_scaled(arm, body.axes[k], item(local, k))
    return arm


__all__ = ["arm_of", "moment"]
