"""The impacts of a short run, with the positions of the bodies in them: the corners of their paths within a step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...components import Collider, SphereCollider
from ...framework import World


@dataclass(frozen=True)
class PathImpact:
    """One impact between the samples ``after - 1`` and ``after`` of the paths; ``point`` and ``normal`` (d,).

    ``centres``: positions of its spheres, (d,) by entity. The position of a box does not follow from the contact point.
    """

    after: int
    point: NDArray[np.float64]
    normal: NDArray[np.float64]
    centres: dict[int, NDArray[np.float64]]


def path_impacts(world: World, after: int) -> list[PathImpact]:
    """The impacts of the world's last step, in order of time."""
    found = []
    for impact in world.contacts.impacts:
        point, normal = np.array(impact.point, float), np.array(impact.normal, float)
        centres = {}
        for entity, inwards in ((impact.entity_a, -normal), (impact.entity_b, normal)):
            radius = _radius_of(world, entity)
            if radius is not None:
                centres[int(entity)] = point + radius * inwards
        found.append(PathImpact(after, point, normal, centres))
    return found


def with_corners(
    entities: NDArray[np.int64], positions: NDArray[np.float64], impacts: list[PathImpact]
) -> NDArray[np.float64]:
    """``positions`` (samples, bodies, d) with one more sample per impact, in which only its bodies have moved."""
    samples: list[NDArray[np.float64]] = []
    waiting = iter([*impacts, None])
    impact = next(waiting)
    for number, sample in enumerate(positions):
        while impact is not None and impact.after == number:
            corner = samples[-1].copy()
            for entity, centre in impact.centres.items():
                corner[entities == entity] = centre
            samples.append(corner)
            impact = next(waiting)
        samples.append(sample)
    return np.array(samples)


def _radius_of(world: World, entity: int) -> float | None:
    """The radius of an entity whose only collider is a centred sphere; else None."""
    if not world.entity_exists(entity):
        return None
    colliders = [part for part in world.components_for_entity(entity) if isinstance(part, Collider)]
    if len(colliders) != 1 or not isinstance(colliders[0], SphereCollider) or np.any(colliders[0].offset):
        return None
    return float(colliders[0].radius)
