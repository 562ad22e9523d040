"""Terrain: ground of many pieces that bodies roll and slide over without catching where the pieces meet."""

from .chain import create_chain
from .image import outline_of_image
from .mesh import create_height_field, create_triangle_mesh
from .segment import ChainSegmentCollider
from .segment import plugin as plugin
from .triangle import TerrainTriangleCollider

__all__ = [
    "ChainSegmentCollider",
    "TerrainTriangleCollider",
    "create_chain",
    "create_height_field",
    "create_triangle_mesh",
    "outline_of_image",
]
