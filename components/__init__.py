"""The built-in components: a body's position, motion and collision shape."""

from .colliders import ALL_LAYERS, AABBCollider, Collider, SphereCollider
from .prefab import Prefab
from .rigid_body import RigidBody
from .transform import Transform

__all__ = ["ALL_LAYERS", "AABBCollider", "Collider", "Prefab", "RigidBody", "SphereCollider", "Transform"]
