"""The bodies and joints of a world of carom, as other engines take them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from carom.components import AABBCollider, Collider, RigidBody, SphereCollider, Transform
from carom.framework import World
from carom.framework.data.columns import REQUIRED
from carom.plugins.capsule import CapsuleCollider
from carom.plugins.convex_polygon import ConvexPolygonCollider
from carom.plugins.joints import KINDS, Hinge, Wheel
from carom.plugins.rotation import BoxCollider, Spin
from carom.plugins.terrain import ChainSegmentCollider

Floats = NDArray[np.float64]
CORNERS = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
KNOWN = {  # fields that every engine has; what else differs from its default cannot be translated
    "rotation", "mass", "linear_velocity", "kind", "angular_velocity", "inertia", "offset", "restitution", "friction",
    "layer", "mask", "group", "lower", "upper", "motor_speed", "max_torque", "collide_connected",
}  # fmt: skip
OF_WHEELS = {"frequency", "damping_ratio", "rest"}


class NotPlainError(ValueError):
    """A world has something that another engine has not."""


class Body(NamedTuple):
    """``kind``: dynamic, kinematic or static; ``moment``: infinite for what does not turn; ``collider``: the component,
    or None; ``friction``: of the collider, the partner's where it has none of its own."""

    entity: int
    kind: str
    position: tuple[float, float]
    velocity: tuple[float, float]
    angle: float
    spin: float
    mass: float
    moment: float
    collider: Any
    friction: float


OUTLINES: Mapping[type, Callable[[Any], tuple[Any, float]]] = {
    SphereCollider: lambda ball: (np.zeros((1, 2)), ball.radius),
    AABBCollider: lambda box: (CORNERS * box.half_extents, 0.0),
    BoxCollider: lambda box: (CORNERS * box.half_extents, 0.0),
    CapsuleCollider: lambda capsule: (capsule.half_height * np.array([(0.0, -1.0), (0.0, 1.0)]), capsule.radius),
    ConvexPolygonCollider: lambda polygon: (np.array(polygon.vertices), polygon.corner_radius),
    ChainSegmentCollider: lambda segment: (np.array([segment.start, segment.end]), 0.0),
}


def outline_of(collider: Any) -> tuple[Floats, float]:
    """(m, 2) corners about the body's position and along its axes, one of a disc, two of a capsule or a segment; and
    how far the shape goes beyond these."""
    corners, rounding = OUTLINES[type(collider)](collider)
    return corners + collider.offset, rounding


def ghosts_of(segment: ChainSegmentCollider) -> tuple[Floats, Floats]:
    """The corners before and after a segment of a chain, which is solid on its right; where it ends it goes straight
    on."""
    start, end, before, after = (np.asarray(at) for at in (segment.start, segment.end, segment.before, segment.after))
    return before if (before != start).any() else 2 * start - end, after if (after != end).any() else 2 * end - start


def bodies_of(world: World) -> list[Body]:
    """All bodies of a world in a plane, ascending by entity; NotPlainError for what cannot be translated."""
    if world.dimensions != 2:
        raise NotPlainError(f"a world of {world.dimensions} dimensions, not 2")
    if (world.settings.restitution_mixing, world.settings.friction_mixing) != ("max", "geometric_mean"):
        raise NotPlainError("rules of mixing that are not the default ones")
    kinds = {
        entity: kind
        for kind in ("dynamic", "kinematic", "static")
        for entity in getattr(world.bodies, kind).entity.tolist()
    }
    bodies = [_body(world, entity, kinds[entity]) for entity in sorted(kinds)]
    given = {body.friction for body in bodies if body.collider and not math.isnan(body.friction)}
    if len(given) > 1 and any(math.isnan(body.friction) for body in bodies):
        raise NotPlainError("friction that is the partner's, of several")
    partner = max(given, default=0.0)
    return [body._replace(friction=partner) if math.isnan(body.friction) else body for body in bodies]


def _body(world: World, entity: int, kind: str) -> Body:
    found = {type(one): one for one in world.components_for_entity(entity)}
    for one in found.values():
        _refuse_others(one, KNOWN)
    colliders = [one for one in found.values() if isinstance(one, Collider)]
    if len(colliders) > 1:
        raise NotPlainError(f"entity {entity}: two colliders")
    place, motion, turning = (found.get(each) for each in (Transform, RigidBody, Spin))
    assert isinstance(place, Transform)
    if colliders and isinstance(colliders[0], AABBCollider) and place.rotation:
        raise NotPlainError(f"entity {entity}: an AABBCollider with a rotation")
    velocity, mass, spin, moment = (0.0, 0.0), math.inf, 0.0, math.inf
    if motion is not None:
        velocity, mass = tuple(motion.linear_velocity.tolist()), motion.mass if kind == "dynamic" else math.inf
    if turning is not None:
        spin, moment = turning.angular_velocity, turning.moments if kind == "dynamic" else math.inf
    collider = colliders[0] if colliders else None
    if collider is not None and type(collider) not in OUTLINES:
        raise NotPlainError(f"a {type(collider).__name__}")
    friction = 0.0 if collider is None else math.nan if collider.friction is None else collider.friction
    at = tuple(place.position.tolist())
    return Body(entity, kind, at, velocity, float(place.rotation), spin, mass, moment, collider, friction)


def joints_of(world: World) -> list[Any]:
    """The hinges and wheels of a world that has made no step yet; NotPlainError for others."""
    joints = [joint for kind in KINDS for _, joint in world.get_component(kind)]
    for joint in joints:
        if not isinstance(joint, Hinge | Wheel):
            raise NotPlainError(f"a {type(joint).__name__}")
        _refuse_others(joint, KNOWN | OF_WHEELS if isinstance(joint, Wheel) else KNOWN)
    return joints


def ends_of(joint: Any) -> tuple[float, float]:
    """The limits of a joint, infinite where it has none."""
    return -math.inf if joint.lower is None else joint.lower, math.inf if joint.upper is None else joint.upper


def _refuse_others(component: Any, known: set[str]) -> None:
    for name, column in type(component).columns.items():
        if name in known or column.default is REQUIRED or not column.constructor:
            continue
        value = getattr(component, name)
        if value is not column.default and not np.array_equal(value, np.broadcast_to(column.default, np.shape(value))):
            raise NotPlainError(f"{type(component).__name__}.{name} is {value!r}")
