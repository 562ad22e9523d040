"""The bodies of a 2D world as plain arrays, the common input of both engines and of the quality measure."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from ...components import AABBCollider, SphereCollider
from ...framework import World
from ..measure.body_shapes import Floats


class NotPlainError(ValueError):
    """A world has something that plain arrays cannot represent."""


@dataclass(frozen=True)
class BodyArrays:
    """One row per body, ascending by entity id.

    ``position (n, 2)``, ``velocity (n, 2)``, ``mass (n,)``, ``half (n, 2)`` half extents (the radius in both for a
    disc),
    ``round (n,)`` true for discs, ``shaped (n,)`` false without a collider, ``restitution (n,)`` and ``friction (n,)``,
    NaN: use the other body's coefficient.
    """

    position: Floats
    velocity: Floats
    mass: Floats
    half: Floats
    round: np.ndarray
    shaped: np.ndarray
    restitution: Floats
    friction: Floats

    def __len__(self) -> int:
        return len(self.position)

    def where(self, chosen: np.ndarray) -> BodyArrays:
        """The rows where ``chosen`` is true."""
        return BodyArrays(*(getattr(self, field.name)[chosen] for field in fields(self)))


def moving_and_fixed(world: World) -> tuple[BodyArrays, BodyArrays]:
    """The dynamic and the static bodies of ``world`` in their present state; NotPlainError if not representable."""
    if world.dimensions != 2:
        raise NotPlainError(f"a world of {world.dimensions} dimensions, not 2")
    if len(world.bodies.kinematic):
        raise NotPlainError("kinematic bodies")
    dynamic = world.bodies.dynamic
    moving = _arrays(dynamic)
    _refuse("offsets of moving bodies' colliders", moving.position != dynamic.position[_by_id(dynamic)])
    return moving, _arrays(world.bodies.static)


def _arrays(bodies: Any) -> BodyArrays:
    count = len(bodies)
    position, mass = np.array(bodies.position), np.array(bodies.mass)
    half, friction, restitution = np.zeros((count, 2)), np.full(count, np.nan), np.zeros(count)
    masks = {collider: np.asarray(bodies.has(collider), bool) for collider in (SphereCollider, AABBCollider)}
    for collider, has in masks.items():
        if not has.any():
            continue
        columns = bodies.sphere_collider if collider is SphereCollider else bodies.aabb_collider
        half[has] = columns.radius[has, None] if collider is SphereCollider else columns.half_extents[has]
        friction[has], restitution[has] = columns.friction[has], columns.restitution[has]
        position[has] += columns.offset[has]
        _refuse("sensors", columns.sensor[has])
        _refuse("layers and masks", (columns.layer[has] != 1) | (columns.mask[has] & 1 == 0))
    _refuse("bodies with two colliders", np.all(list(masks.values()), axis=0))
    if masks[AABBCollider].any():
        _refuse("turned boxes", bodies.rotation[masks[AABBCollider]])
    _refuse("damping", bodies.linear_damping)
    _refuse("constant forces", bodies.constant_force)
    _refuse("a gravity scale", bodies.gravity_scale != 1)
    _refuse("limits of speed", ~np.isnan(bodies.max_linear_speed))
    rounds, boxes = masks.values()
    velocity = np.array(bodies.linear_velocity)
    arrays = BodyArrays(position, velocity, mass, half, rounds, rounds | boxes, restitution, friction)
    return arrays.where(_by_id(bodies))


def _by_id(bodies: Any) -> np.ndarray:
    return np.argsort(bodies.entity, kind="stable")


def _refuse(what: str, found: Any) -> None:
    if np.any(found):
        raise NotPlainError(what)
