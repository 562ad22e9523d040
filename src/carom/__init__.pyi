from .components import *
from .framework import *
from .plugins import *
from .plugins.capsule import CapsuleCollider as CapsuleCollider
from .plugins.character import Character as Character
from .plugins.character import Characters as Characters
from .plugins.character import Ladder as Ladder
from .plugins.convex_hull import ConvexHullCollider as ConvexHullCollider
from .plugins.convex_polygon import ConvexPolygonCollider as ConvexPolygonCollider
from .plugins.half_space import HalfSpaceCollider as HalfSpaceCollider
from .plugins.joints import Ball as Ball
from .plugins.joints import Cone as Cone
from .plugins.joints import Distance as Distance
from .plugins.joints import Hinge as Hinge
from .plugins.joints import Joints as Joints
from .plugins.joints import JointState as JointState
from .plugins.joints import Motor as Motor
from .plugins.joints import MousePull as MousePull
from .plugins.joints import Slider as Slider
from .plugins.joints import Weld as Weld
from .plugins.joints import Wheel as Wheel
from .plugins.parts import PartOf as PartOf
from .plugins.parts import Parts as Parts
from .plugins.parts import parts_from_outline as parts_from_outline
from .plugins.paths import Path as Path
from .plugins.paths import Paths as Paths
from .plugins.rotation import BoxCollider as BoxCollider
from .plugins.rotation import Rotation as Rotation
from .plugins.rotation import Spin as Spin
from .plugins.springs import Spring as Spring
from .plugins.springs import Springs as Springs
from .plugins.terrain import ChainSegmentCollider as ChainSegmentCollider
from .plugins.terrain import TerrainTriangleCollider as TerrainTriangleCollider
from .plugins.terrain import create_chain as create_chain
from .plugins.terrain import create_height_field as create_height_field
from .plugins.terrain import create_triangle_mesh as create_triangle_mesh
from .plugins.terrain import outline_of_image as outline_of_image
from .plugins.tile_grid import TileGridCollider as TileGridCollider
from .plugins.tile_grid import TileMaterial as TileMaterial
from .plugins.tile_grid import TileShape as TileShape
from .plugins.tile_grid import cells_of_text as cells_of_text
from .plugins.tile_grid import map_of_text as map_of_text
from .plugins.timers import Timer as Timer
from .plugins.timers import Timers as Timers
from .plugins.zones import Field as Field
from .plugins.zones import Water as Water
from .plugins.zones import Wind as Wind
from .plugins.zones import Zones as Zones
from .plugins.zones import explode as explode
from .systems import *

__version__: str
