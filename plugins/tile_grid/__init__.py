"""A map of square tiles in 2D as one static collider; what slides along its tiles feels no seams between them.

Tiles have no sides of their own: a shape is tested against rectangles of tiles, as large as they come, so that where
two tiles meet there is nothing to be caught at. Of all rectangles near the shape the one it is deepest in gives the
contact.
"""

from ...framework import Convex
from .cells import cells_of_text
from .collider import TileGridCollider, plugin
from .contact import deepest_contact
from .sweep import first_touch

__all__ = ["TileGridCollider", "cells_of_text", "plugin"]


@plugin.pair(TileGridCollider, Convex)
def tile_grid_convex(a, b, d, support, rounding):
    """Kept out of the kernels that call it: it is long, and they are several."""
    return deepest_contact(a, b, d, support, rounding)


@plugin.sweep(TileGridCollider, Convex)
def tile_grid_convex_sweep(a, b, d, v, support, rounding):
    return first_touch(a, b, d, v, support, rounding)
