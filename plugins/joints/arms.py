"""Helpers for the functions of joints, see docs/write-a-joint.md."""

from __future__ import annotations

from ...systems.integration.turning import twist as moment
from ..corners import in_world as arm_of  # the vector from a body's position to a point ``local`` along its axes

__all__ = ["arm_of", "moment"]
