from .components import *
from .framework import *
from .plugins import *
from .plugins.capsule import CapsuleCollider as CapsuleCollider
from .plugins.convex_hull import ConvexHullCollider as ConvexHullCollider
from .plugins.convex_polygon import ConvexPolygonCollider as ConvexPolygonCollider
from .plugins.half_space import HalfSpaceCollider as HalfSpaceCollider
from .plugins.one_way_segment import OneWaySegmentCollider as OneWaySegmentCollider
from .plugins.springs import Spring as Spring
from .plugins.springs import Springs as Springs
from .plugins.terrain import ChainSegmentCollider as ChainSegmentCollider
from .plugins.terrain import TerrainTriangleCollider as TerrainTriangleCollider
from .plugins.terrain import create_chain as create_chain
from .plugins.terrain import create_height_field as create_height_field
from .plugins.terrain import create_triangle_mesh as create_triangle_mesh
from .plugins.tile_grid import TileGridCollider as TileGridCollider
from .plugins.tile_grid import cells_of_text as cells_of_text
from .systems import *

__version__: str
