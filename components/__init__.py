"""The built-in components: where a body is, how it moves, what it collides with."""

from .colliders import ALL_LAYERS, AABBCollider, Collider, SphereCollider
from .rigid_body import RigidBody
from .transform import Transform

__all__ = ["ALL_LAYERS", "AABBCollider", "Collider", "RigidBody", "SphereCollider", "Transform"]
