"""The plugin, and the faces of a map that a collider has."""

from __future__ import annotations

from typing import Literal

from ...framework import Plugin

plugin = Plugin("tile_grid", version="1.0")

Faces = Literal["all", "floors", "walls", "one_way"]
FACES = ("all", "floors", "walls", "one_way")
ALL, FLOORS, WALLS, ONE_WAYS = range(4)
