"""The impacts of a short run, with the places of the bodies in them: where their paths turn within a step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...components import Collider, SphereCollider
from ...framework import World


@dataclass(frozen=True)
class Blow:
    """One impact between the samples ``after - 1`` and ``after`` of the paths; ``point`` and ``normal`` (d,).

    ``centres``: where its spheres were, (d,) by entity. Where a box was, its point of contact does not tell.
    """

    after: int
    point: NDArray[np.float64]
    normal: NDArray[np.float64]
    centres: dict[int, NDArray[np.float64]]


def blows_of(world: World, after: int) -> list[Blow]:
    """Those of the world's last step, in order of time."""
    found = []
    for impact in world.contacts.impacts:
        point, normal = np.array(impact.point, float), np.array(impact.normal, float)
        centres = {}
        for entity, inwards in ((impact.entity_a, -normal), (impact.entity_b, normal)):
            radius = _radius_of(world, entity)
            if radius is not None:
                centres[int(entity)] = point + radius * inwards
        found.append(Blow(after, point, normal, centres))
    return found


def with_corners(entities: NDArray[np.int64], positions: NDArray[np.float64], blows: list[Blow]) -> NDArray[np.float64]:
    """``positions`` (samples, bodies, d) with a sample more for each blow: the struck are there, the others wait."""
    samples: list[NDArray[np.float64]] = []
    waiting = iter([*blows, None])
    blow = next(waiting)
    for number, sample in enumerate(positions):
        while blow is not None and blow.after == number:
            corner = samples[-1].copy()
            for entity, centre in blow.centres.items():
                corner[entities == entity] = centre
            samples.append(corner)
            blow = next(waiting)
        samples.append(sample)
    return np.array(samples)


def _radius_of(world: World, entity: int) -> float | None:
    """Of what is a sphere around its position and nothing else; None for anything else."""
    if not world.entity_exists(entity):
        return None
    colliders = [part for part in world.components_for_entity(entity) if isinstance(part, Collider)]
    if len(colliders) != 1 or not isinstance(colliders[0], SphereCollider) or np.any(colliders[0].offset):
        return None
    return float(colliders[0].radius)
