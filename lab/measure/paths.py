"""The paths of the bodies in a run, for its pictures; of a short run with the corners at its impacts."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...components import Collider, SphereCollider
from ...framework import World
from .bodies import QUIET, Floats, dimensions_of

CANDIDATES = 12_000  # bodies that are recorded, to choose from


class PathImpact(NamedTuple):
    """One impact between the samples ``after - 1`` and ``after`` of the paths; ``point`` and ``normal`` (d,).

    ``centres``: positions of its spheres, (d,) by entity. The position of a box does not follow from the contact point.
    """

    after: int
    point: Floats
    normal: Floats
    centres: dict[int, Floats]


@dataclass(frozen=True)
class Traces:
    """Paths: ``positions`` (samples, bodies, d), NaN where no body was; ``entities`` (bodies,), ascending;
    ``rotations``: angles (samples, bodies) or quaternions (samples, bodies, 4).

    ``moved``: number of all bodies that moved, including these. ``impacts``: of all steps, if each is shown, else None.
    """

    entities: NDArray[np.int64]
    positions: NDArray[Any]
    rotations: NDArray[Any]
    moved: int = 0
    impacts: list[PathImpact] | None = None

    @property
    def corners(self) -> Floats:
        """The positions, with one more sample per impact, in which only its bodies have moved."""
        samples: list[Floats] = []
        waiting = list(self.impacts or [])
        for number, sample in enumerate(self.positions.astype(float)):
            while waiting and waiting[0].after == number:
                corner = samples[-1].copy()
                for entity, centre in waiting.pop(0).centres.items():
                    corner[self.entities == entity] = centre
                samples.append(corner)
            samples.append(sample)
        return np.array(samples)

    @QUIET
    def farthest(self, count: int) -> Traces:
        """The ``count`` bodies that travelled farthest; ``moved`` is the number of all that did."""
        ways = np.diff(self.corners if self.impacts else self.positions, axis=0)
        travelled = np.nan_to_num(np.linalg.norm(ways, axis=2)).sum(axis=0)
        moved = int((travelled > 0).sum())
        chosen = np.sort(np.argsort(-travelled, kind="stable")[: min(count, moved)])
        positions, rotations = self.positions[:, chosen], self.rotations[:, chosen]
        return replace(self, entities=self.entities[chosen], positions=positions, rotations=rotations, moved=moved)


class Recorder:
    """Records moving bodies, including those created during the run, up to CANDIDATES bodies."""

    def __init__(self, world: World, step_by_step: bool = False) -> None:
        self.world = world
        self.impacts: list[PathImpact] | None = [] if step_by_step else None
        self.entities: NDArray[np.int64] = np.empty(0, np.int64)  # in the order they appeared
        self.samples: list[NDArray[np.float32]] = []  # positions and rotations of the entities known at that time

    @QUIET
    def record(self) -> None:
        """Add a sample."""
        if self.impacts is not None and self.samples:
            self.impacts += _impacts(self.world, len(self.samples))
        bodies = self.world.bodies
        ids = np.asarray(bodies.entity)
        new = np.setdiff1d(ids[: bodies.kinematic.rows.stop], self.entities)
        room = CANDIDATES - len(self.entities)
        if len(new) > room:
            new = np.sort(np.random.default_rng(0).choice(new, room, replace=False))
        self.entities = np.concatenate([self.entities, new])
        now = np.column_stack([bodies.position, bodies.rotation])
        sample = np.full((len(self.entities), now.shape[1]), np.nan, np.float32)
        _, mine, rows = np.intersect1d(self.entities, ids, assume_unique=True, return_indices=True)
        sample[mine] = now[rows]
        self.samples.append(sample)

    def traces(self) -> Traces:
        """The recorded paths, NaN where a body did not exist."""
        places = np.full((len(self.samples), *self.samples[-1].shape), np.nan, np.float32)
        for number, sample in enumerate(self.samples):
            places[number, : len(sample)] = sample
        order = np.argsort(self.entities, kind="stable")
        places, d = places[:, order], dimensions_of(self.world)
        rotations = places[..., 2] if d == 2 else places[..., d:]
        return Traces(self.entities[order], places[..., :d], rotations, impacts=self.impacts)


def _impacts(world: World, after: int) -> list[PathImpact]:
    """The impacts of the world's last step, in order of time."""
    found = []
    for impact in world.contacts.impacts:
        point, normal = np.array(impact.point, float), np.array(impact.normal, float)
        ends = (impact.entity_a, -normal), (impact.entity_b, normal)
        centres = {int(entity): point + radius * way for entity, way in ends if (radius := _radius_of(world, entity))}
        found.append(PathImpact(after, point, normal, centres))
    return found


def _radius_of(world: World, entity: int) -> float:
    """The radius of an entity whose only collider is a centred sphere; else 0."""
    parts = world.components_for_entity(entity) if world.entity_exists(entity) else ()
    one, *others = [part for part in parts if isinstance(part, Collider)] or [None]
    return 0.0 if others or not isinstance(one, SphereCollider) or np.any(one.offset) else float(one.radius)
