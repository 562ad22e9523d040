"""carom: a physics framework for games on the esper entity-component-system.

What a game needs has its name here: ``from carom import World, Physics, Transform, RigidBody, SphereCollider``. A name
loads its module when it is first used, so ``import carom`` loads nothing else. The parts, with all they hold:
:mod:`carom.framework`, :mod:`carom.components`, :mod:`carom.systems`, :mod:`carom.plugins`, :mod:`carom.drawing`,
:mod:`carom.maps`, :mod:`carom.view`, :mod:`carom.scenes` and :mod:`carom.lab` (command line and measuring).
"""

__version__ = "0.1.0"

# Module: its names that are names of carom too. A test writes __init__.pyi from it, for editors and type checkers.
_NAMES = {
    "framework": (
        "Bodies", "CaromError", "CastHit", "CastHits", "Column", "Component", "Contact", "Contacts", "ContactsBetween",
        "Convex", "FaultError", "ForceSystem", "Hits", "MissingComponentError", "NearestHit", "NearestHits",
        "Neighbours", "NoPhysicsError", "OverlapHit", "OverlapHits", "Phase", "PhysicsWarning", "Plan", "Plugin",
        "PluginError", "Rollback", "ScheduleError", "Settings", "Snapshot", "Stats", "StepError", "System",
        "UnhandledPairError", "Vector", "World", "array_column", "column", "use_kernels",
    ),
    "components": ("ALL_LAYERS", "AABBCollider", "Collider", "Prefab", "RigidBody", "SphereCollider", "Transform"),
    "systems": (
        "CUBIC", "LINE", "PARABOLA", "BroadPhase", "CandidateLimitError", "ContactEvents", "ForceAccumulation",
        "Integration", "Integrator", "NarrowPhase", "Response", "SpatialTree",
    ),
    "plugins": ("Physics",),
    "plugins.capsule": ("CapsuleCollider",),
    "plugins.character": ("Character", "Characters", "Ladder"),
    "plugins.convex_hull": ("ConvexHullCollider",),
    "plugins.convex_polygon": ("ConvexPolygonCollider",),
    "plugins.half_space": ("HalfSpaceCollider",),
    "plugins.joints": (
        "Ball", "Cone", "Distance", "Hinge", "JointState", "Joints", "Motor", "MousePull", "Slider", "Weld", "Wheel",
    ),
    "plugins.parts": ("PartOf", "Parts", "parts_from_outline"),
    "plugins.paths": ("Path", "Paths"),
    "plugins.rotation": ("BoxCollider", "Rotation", "Spin"),
    "plugins.springs": ("Spring", "Springs"),
    "plugins.terrain": (
        "ChainSegmentCollider", "TerrainTriangleCollider",
        "create_chain", "create_height_field", "create_triangle_mesh", "outline_of_image",
    ),
    "plugins.tile_grid": ("TileGridCollider", "TileMaterial", "TileShape", "cells_of_text", "map_of_text"),
    "plugins.timers": ("Timer", "Timers"),
    "plugins.zones": ("Field", "Water", "Wind", "Zones", "explode"),
}  # fmt: skip
_MODULES = {name: module for module, names in _NAMES.items() for name in names}
__all__ = sorted(_MODULES)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> object:
    if name not in _MODULES:
        raise AttributeError(f"module 'carom' has no attribute {name!r}")
    import importlib  # not before it is needed

    value = globals()[name] = getattr(importlib.import_module(f"carom.{_MODULES[name]}"), name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_MODULES})
