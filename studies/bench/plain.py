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


class Shape(NamedTuple):
    """``corners (m, 2)`` about the body's position and along its axes: one of a disc, two of a capsule or a segment;
    ``rounding``: how far it goes beyond these; ``ghosts (2, 2)``: the neighbours of a segment of a chain, which is
    solid on its right."""

    corners: Floats
    rounding: float
    restitution: float
    friction: float
    layer: int
    mask: int
    group: int
    ghosts: Floats | None


class Body(NamedTuple):
    """``kind``: dynamic, kinematic or static; ``moment``: infinite for what does not turn."""

    entity: int
    kind: str
    position: tuple[float, float]
    velocity: tuple[float, float]
    angle: float
    spin: float
    mass: float
    moment: float
    shape: Shape | None


def _box(box: Any) -> tuple[Floats, float]:
    return CORNERS * box.half_extents, 0.0


def _capsule(capsule: Any) -> tuple[Floats, float]:
    return np.array([(0.0, -capsule.half_height), (0.0, capsule.half_height)]), capsule.radius


OUTLINES: Mapping[type, Callable[[Any], tuple[Floats, float]]] = {
    SphereCollider: lambda ball: (np.zeros((1, 2)), ball.radius),
    AABBCollider: _box,
    BoxCollider: _box,
    CapsuleCollider: _capsule,
    ConvexPolygonCollider: lambda polygon: (np.array(polygon.vertices), polygon.corner_radius),
    ChainSegmentCollider: lambda segment: (np.array([segment.start, segment.end]), 0.0),
}


def bodies_of(world: World) -> list[Body]:
    """All bodies of a world in a plane, ascending by entity; NotPlainError for what cannot be translated."""
    if world.dimensions != 2:
        raise NotPlainError(f"a world of {world.dimensions} dimensions, not 2")
    kinds = {
        entity: kind
        for kind in ("dynamic", "kinematic", "static")
        for entity in getattr(world.bodies, kind).entity.tolist()
    }
    bodies = [_body(world, entity, kinds[entity]) for entity in sorted(kinds)]
    given = {body.shape.friction for body in bodies if body.shape and not math.isnan(body.shape.friction)}
    if len(given) > 1 and any(body.shape and math.isnan(body.shape.friction) for body in bodies):
        raise NotPlainError("friction that is the partner's, of several")
    (partner,) = given if len(given) == 1 else (0.0,)
    return [
        body._replace(shape=body.shape._replace(friction=partner))
        if body.shape and math.isnan(body.shape.friction) else body
        for body in bodies
    ]  # fmt: skip


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
    at, shape = tuple(place.position.tolist()), _shape(colliders[0]) if colliders else None
    return Body(entity, kind, at, velocity, float(place.rotation), spin, mass, moment, shape)


def _shape(collider: Any) -> Shape:
    if type(collider) not in OUTLINES:
        raise NotPlainError(f"a {type(collider).__name__}")
    corners, rounding = OUTLINES[type(collider)](collider)
    ghosts = None
    if isinstance(collider, ChainSegmentCollider):
        way = collider.end - collider.start  # where the chain ends it goes straight on
        before, after = collider.before, collider.after
        ends = (before, collider.start) if (before != collider.start).any() else (collider.start - way, collider.start)
        beyond = after if (after != collider.end).any() else collider.end + way
        ghosts = np.array([ends[0], beyond])
    return Shape(
        corners + collider.offset, rounding, collider.restitution,
        math.nan if collider.friction is None else collider.friction,
        collider.layer, collider.mask, collider.group, ghosts,
    )  # fmt: skip


def joints_of(world: World) -> list[Any]:
    """The hinges and wheels of a world that has made no step yet; NotPlainError for others."""
    joints = [joint for kind in KINDS for _, joint in world.get_component(kind)]
    for joint in joints:
        if not isinstance(joint, Hinge | Wheel):
            raise NotPlainError(f"a {type(joint).__name__}")
        _refuse_others(joint, KNOWN | OF_WHEELS if isinstance(joint, Wheel) else KNOWN)
    return joints


def _refuse_others(component: Any, known: set[str]) -> None:
    for name, column in type(component).columns.items():
        if name in known or column.default is REQUIRED or not column.constructor:
            continue
        value = getattr(component, name)
        if value is not column.default and not np.array_equal(value, np.broadcast_to(column.default, np.shape(value))):
            raise NotPlainError(f"{type(component).__name__}.{name} is {value!r}")
