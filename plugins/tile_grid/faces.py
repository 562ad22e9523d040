"""The plugin, and the faces of a map that a collider has."""

from __future__ import annotations

from typing import Literal

from ...framework import Plugin

plugin = Plugin("tile_grid", version="1.0")

Faces = Literal["all", "floors", "walls"]
FACES = ("all", "floors", "walls")
ALL, FLOORS, WALLS = range(3)
