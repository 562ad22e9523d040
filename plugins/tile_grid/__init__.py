"""A map of square tiles in 2D as one static collider; bodies slide along its tiles without catching on seams.

A shape is tested against maximal rectangles of tiles instead of single tiles, so that edges between two tiles do not
exist. The rectangle with the deepest overlap gives the contact.
"""

from ...framework import Convex
from .cells import cells_of_text, map_of_text
from .collider import TileGridCollider
from .contact import deepest_contact
from .faces import ONE_WAYS
from .faces import plugin as plugin
from .materials import TileMaterial, TileShape
from .shaped import is_shaped, shaped_contact, shaped_touch
from .sweep import first_touch

__all__ = ["TileGridCollider", "TileMaterial", "TileShape", "cells_of_text", "map_of_text"]


@plugin.pair(TileGridCollider, Convex)
def tile_grid_convex(a, b, d, support, rounding):
    """Not inlined: it is long and has several callers."""
    if a.faces == ONE_WAYS or is_shaped(a.packed):
        return shaped_contact(a, b, d, support, rounding)
    return deepest_contact(a, b, d, support, rounding)


@plugin.sweep(TileGridCollider, Convex)
def tile_grid_convex_sweep(a, b, d, v, support, rounding):
    if a.faces == ONE_WAYS or is_shaped(a.packed):
        return shaped_touch(a, b, d, v, support, rounding)
    return first_touch(a, b, d, v, support, rounding)
