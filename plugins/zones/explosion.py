"""An explosion: an impulse on each body near a point."""

from __future__ import annotations

import math
import numbers
from typing import Any

import numpy as np

from ...components import Collider, RigidBody, SphereCollider
from ...components.part_of import PartOf
from ...components.spin import Spin
from ...framework import World
from ...framework.typing import Vector

BEHIND = 1e-9  # of the radius: what is nearer by less than that is at the same place


def explode(
    world: World, point: Vector, radius: float, impulse: float, *, shielded: bool = False, mask: int = -1
) -> list[int]:
    """Push all dynamic bodies with a collider away from ``point``, (d,) m, each where it is nearest; what has a Spin
    turns. Sensors are pushed too; those among the parts of a body do not count.

    radius
        m, above 0
    impulse
        N s at the point; it falls to 0 in proportion to the distance. Below 0 it pulls
    shielded
        whether what a ray from the point meets before that place stops it: colliders but sensors, and those that hold
        the point
    mask
        a bit for each layer that is pushed, or shields

    Returns the entities that got an impulse, by id. ValueError names the argument that is wrong.
    """
    for name, value, least in (("radius", radius, 0.0), ("impulse", impulse, -math.inf)):
        number = isinstance(value, numbers.Real) and not isinstance(value, (bool, np.bool_))
        if not number or not least < float(value) < math.inf:  # type: ignore[arg-type]
            raise ValueError(f"explode: {name} must be a finite number{' above 0' * (least == 0.0)}, got {value!r}")
    try:
        hits = world.shape_cast(SphereCollider(radius), point, np.zeros(np.shape(point)), mask)
    except (TypeError, ValueError) as error:
        raise ValueError(str(error).replace("shape_cast: position", "explode: point")) from None
    nearest: dict[int, tuple[float, Any]] = {}
    for hit in hits:
        body = _body_of(world, hit.entity)
        if body is None or (hit.entity != body and _is_sensor(world, hit.entity)):  # a zone that it carries
            continue
        ray = world.ray_cast(point, -hit.normal, radius, mask)
        found = next((each for each in ray if each.entity == hit.entity), None)
        if found is None or (shielded and _is_shielded(world, ray, found.distance - BEHIND * radius, body)):
            continue
        if body not in nearest or found.distance < nearest[body][0]:
            nearest[body] = found.distance, hit.normal
    for body, (distance, normal) in sorted(nearest.items()):
        push = -impulse * (1.0 - distance / radius) * normal
        spin = world.try_component(body, Spin)
        if spin is not None:
            spin.apply_impulse(push, at=np.asarray(point, float) - distance * normal)
        else:
            world.component_for_entity(body, RigidBody).apply_impulse(push)
    return sorted(nearest)


def _body_of(world: World, entity: int) -> int | None:
    """The dynamic body that an entity is, or is a part of."""
    part = world.try_component(entity, PartOf)
    body = entity if part is None or not part.holder else int(part.holder)
    rigid = world.try_component(body, RigidBody)
    return body if rigid is not None and rigid.kind == "dynamic" else None


def _is_sensor(world: World, entity: int) -> bool:
    return any(each.sensor for each in world.components_for_entity(entity) if isinstance(each, Collider))


def _is_shielded(world: World, ray: Any, distance: float, body: int) -> bool:
    """Whether another one is nearer than that."""
    before = (hit.entity for hit in ray if 0.0 < hit.distance < distance)
    return any(not _is_sensor(world, entity) and _body_of(world, entity) != body for entity in before)
