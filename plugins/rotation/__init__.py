"""Bodies that spin: ``World(Physics(...), Rotation())``, then ``Spin(...)`` on them, and boxes that turn."""

from __future__ import annotations

from ...components.spin import Spin
from ...framework import Plugin
from .box import BoxCollider
from .box_pairs import boxes
from .stages import spinning


class Rotation(Plugin):
    """Rotational dynamics for the bodies that have a :class:`Spin`; all others are as without it."""

    def __init__(self) -> None:
        super().__init__("rotation", version="1.0")
        self.shapes, self.pairs, self.stages = dict(boxes.shapes), dict(boxes.pairs), dict(spinning.stages)


__all__ = ["BoxCollider", "Rotation", "Spin"]
