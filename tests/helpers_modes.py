"""Worlds with impacts at their true time: the modes, bullets, and recorded impacts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from worlds import make_world

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import World

MODES = ("continuous", "event_driven")
SWEPT = (*MODES, "ccd")  # the last: a discrete world whose bullets have ccd

each_mode = pytest.mark.parametrize("mode", MODES)
each_sweep = pytest.mark.parametrize("mode", SWEPT)


def mode_world(mode: str, d: int = 2, gravity: Any = 0.0, **settings: Any) -> World:
    return make_world(d, gravity, collision="discrete" if mode == "ccd" else mode, **settings)


def along(d: int, *values: float) -> tuple[float, ...]:
    """The first d of the values, zeros where they end."""
    return (*values, *(0.0,) * d)[:d]


def turn(d: int, angle: float) -> Any:
    """A rotation in the plane of x and y."""
    return angle if d == 2 else (math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2))


def bullet(
    world: World, place: Any, velocity: Any, *, radius: float = 0.1, half: Any = None, mass: float = 1.0,
    collider: Any = None, kind: Any = "dynamic", **material: Any,
) -> int:  # fmt: skip
    """A body with ``ccd``: a ball, a box if ``half`` is given, or what ``collider`` is. Numbers: the first axis."""
    d = world.dimensions or 2
    place, velocity = (tuple(v) if np.ndim(v) else along(d, v) for v in (place, velocity))
    if collider is None and half is None:
        collider = SphereCollider(radius, **material)
    elif collider is None:
        collider = AABBCollider(tuple(half) if np.ndim(half) else (half,) * d, **material)
    return world.create_entity(Transform(place), RigidBody(mass, velocity, kind=kind, ccd=True), collider)


@dataclass
class Impacts:
    """Impacts in the order of ``contacts.impacts``; times from the start of the world."""

    time: np.ndarray
    entity_a: np.ndarray
    entity_b: np.ndarray
    point: np.ndarray
    normal: np.ndarray
    impulse: np.ndarray

    def __len__(self) -> int:
        return len(self.time)


def strikes(world: World, steps: int) -> Impacts:
    """Run that many steps; returns all impacts of them."""
    d, dt = world.dimensions or 2, world.settings.dt
    parts: list[tuple[np.ndarray, ...]] = [
        (np.empty(0), np.empty(0, int), np.empty(0, int), np.empty((0, d)), np.empty((0, d)), np.empty(0))
    ]
    for _ in range(steps):
        world.step()
        rows = world.contacts.impacts
        if len(rows):
            time = rows.step * dt + rows.time_of_impact
            columns = (time, rows.entity_a, rows.entity_b, rows.point, rows.normal, rows.normal_impulse)
            parts.append(tuple(np.array(column) for column in columns))
    return Impacts(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def rows_of(world: World, entities: Any) -> list[int]:
    return [world.bodies.row_of(entity) for entity in entities]


def positions(world: World, entities: Any) -> np.ndarray:
    """(n, d), a copy."""
    return world.bodies.position[rows_of(world, entities)].copy()


def velocities(world: World, entities: Any) -> np.ndarray:
    """(n, d), a copy."""
    return world.bodies.linear_velocity[rows_of(world, entities)].copy()
