"""Picking a body with the mouse, and dragging it."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...components import RigidBody, Transform
from ...components.part_of import PartOf
from ...framework import World
from ...plugins.joints import Joints, MousePull

NEAR = 6.0  # pixels: what is so near is picked where nothing is under the mouse
PULL = 1000.0  # N per kg: the most that a pull exerts
APPROACH = 10.0  # 1/s: without joints a body comes to the mouse at this rate


class Hand:
    """What is picked in a ``world``, and what holds it."""

    def __init__(self, world: World) -> None:
        self.world = world
        self.holding = False
        self.at: Any = None  # (d,) m, where it was taken: so far away it is dragged
        self._picked: int | None = None
        self._pull: int | None = None  # the entity of the MousePull
        self._pulls: set[int] = set()  # all there have been: a restore may bring one back
        self._grip = np.zeros(world.dimensions or 2)  # m, from the body to where it was taken

    @property
    def picked(self) -> int | None:
        """The entity; None if none is, or if it is gone."""
        if self._picked is not None and not self.world.entity_exists(self._picked):
            self._picked = None
        return self._picked

    @picked.setter
    def picked(self, entity: int | None) -> None:
        self.release()
        self._picked = entity

    def pick(self, camera: Any, pixels: Any) -> Any:
        """Pick what is under a pixel (2,); the place, (d,) m, where it is touched, None if nothing is there."""
        self.picked, place = (self._in_plane if self.world.dimensions == 2 else self._in_space)(camera, pixels)
        return None if self.picked is None else place

    def _in_plane(self, camera: Any, pixels: Any) -> tuple[int | None, Any]:
        world, place = self.world, camera.to_world(pixels)
        near = NEAR / camera.scale
        found = world.query_point(place, one_way=True) or world.query_sphere(place, near, one_way=True)
        bodies = world.bodies
        if not found and len(bodies):  # what has no collider
            away = np.linalg.norm(bodies.position - place, axis=1)
            nearest = int(np.argmin(np.where(np.isfinite(away), away, np.inf)))
            found = [int(bodies.entity[nearest])] if away[nearest] < 2 * near else []
        return (min(found, key=self._order) if found else None), place

    def _in_space(self, camera: Any, pixels: Any) -> tuple[int | None, Any]:
        """The first on the ray that moves, before walls that may be glass."""
        hits = self.world.ray_cast(*camera.ray(pixels))
        hit = min(hits, key=lambda hit: (*self._order(hit.entity)[:2], hit.distance), default=None)
        return (None, None) if hit is None else (hit.entity, hit.point)

    def _order(self, entity: int) -> tuple[bool, int, int]:
        """Solid ones first, then those that move; of equal ones the last."""
        colliders = [c for c in self.world.components_for_entity(entity) if hasattr(c, "sensor")]
        kind = int(self.world.bodies.kind[self.world.bodies.row_of(entity)])
        return bool(colliders) and all(c.sensor for c in colliders), kind, -entity

    def _whole(self) -> int | None:
        """The body that is picked, or that what is picked is a part of."""
        entity = self.picked
        part = None if entity is None else self.world.try_component(entity, PartOf)
        return entity if part is None else part.holder or part.body

    def take(self, place: Any, paused: bool) -> None:
        """Hold the picked body at a place (d,) m, if it can be moved."""
        entity = self._whole()
        transform = None if entity is None else self.world.try_component(entity, Transform)
        if entity is None or transform is None:
            return
        body = self.world.try_component(entity, RigidBody)
        pulled = not paused and body is not None and body.kind == "dynamic"
        if not pulled and not paused:
            return
        self.holding, self._grip, self.at = True, np.asarray(place) - transform.position, place
        if pulled and body is not None and any(isinstance(plugin, Joints) for plugin in self.world.plugins):
            self._pull = self.world.create_entity(
                MousePull(entity, grip=place, target=place, max_force=PULL * float(body.mass))
            )
            self._pulls.add(self._pull)

    def drag(self, place: Any, paused: bool) -> None:
        """Bring what is held nearer to a place (d,) m; once in a frame. While time stands it is there at once."""
        entity = self._whole()
        if not self.holding or entity is None:
            self.release()
            return
        pull = None if self._pull is None else self.world.try_component(self._pull, MousePull)
        if pull is not None:
            pull.target = place
            return
        transform = self.world.try_component(entity, Transform)
        body = self.world.try_component(entity, RigidBody)
        if transform is None:
            self.release()
        elif paused:
            transform.position = place - self._grip
        elif body is not None and body.kind == "dynamic":
            body.linear_velocity = APPROACH * (place - self._grip - transform.position)

    def release(self) -> None:
        """Let go, and delete the pulls that a restore has brought back."""
        self.holding, self._pull = False, None
        for entity in list(self._pulls):
            if not self.world.entity_exists(entity):
                continue
            if self.world.has_component(entity, MousePull):
                self.world.delete_entity(entity)
            else:  # another entity has this number by now
                self._pulls.discard(entity)
