"""A world of carom translated to pymunk with the same bodies, as pymunk's manual recommends.

Static shapes are attached to the space's static body, moments of inertia are infinite (no rotation), sleeping is off.
"""

from __future__ import annotations

import importlib
import math
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

from ...components import AABBCollider, SphereCollider
from ...framework import World
from ..cli.usage_errors import Problem
from ..measure.body_shapes import Floats

INDEXES = ("tree", "hash")  # pymunk's two broad phases: a tree of bounding boxes, or a spatial hash
ITERATIONS = 10
HASH_CELL = 2.0  # cell size over the largest moving body's size; measured: 1.5 times as fast as 1.0 (gas2d 10k)
HASH_CELLS_PER_BODY = 2  # measured: as fast as the 10 of pymunk's manual


class NotPlainError(ValueError):
    """A world has something that cannot be translated."""


class Bodies(NamedTuple):
    """One row per body, ascending by entity id.

    ``half (n, 2)`` half extents, the radius in both for a disc; ``round (n,)`` true for discs, ``shaped (n,)`` false
    without a collider; ``restitution`` and ``friction (n,)``, NaN: the other body's.
    """

    position: Floats
    velocity: Floats
    mass: Floats
    half: Floats
    round: np.ndarray
    shaped: np.ndarray
    restitution: Floats
    friction: Floats


def moving_and_fixed(world: World) -> tuple[Bodies, Bodies]:
    """The dynamic and the static bodies of ``world`` in their present state; NotPlainError if not representable."""
    if world.dimensions != 2:
        raise NotPlainError(f"a world of {world.dimensions} dimensions, not 2")
    _refuse("kinematic bodies", len(world.bodies.kinematic))
    dynamic = world.bodies.dynamic
    moving = _plain(dynamic)
    order = np.argsort(dynamic.entity, kind="stable")
    _refuse("offsets of moving bodies' colliders", moving.position != dynamic.position[order])
    return moving, _plain(world.bodies.static)


def _plain(bodies: Any) -> Bodies:
    count = len(bodies)
    position, half = np.array(bodies.position), np.zeros((count, 2))
    friction, restitution = np.full(count, np.nan), np.zeros(count)
    rounds, boxes = (np.asarray(bodies.has(collider), bool) for collider in (SphereCollider, AABBCollider))
    for has, name in ((rounds, "sphere_collider"), (boxes, "aabb_collider")):
        if not has.any():
            continue
        columns = getattr(bodies, name)
        half[has] = columns.radius[has, None] if has is rounds else columns.half_extents[has]
        friction[has], restitution[has] = columns.friction[has], columns.restitution[has]
        position[has] += columns.offset[has]
        _refuse("sensors", columns.sensor[has])
        _refuse("layers and masks", (columns.layer[has] != 1) | (columns.mask[has] & 1 == 0))
    _refuse("bodies with two colliders", rounds & boxes)
    _refuse("turned boxes", bodies.rotation[boxes])
    _refuse("damping", bodies.linear_damping)
    _refuse("constant forces", bodies.constant_force)
    _refuse("a gravity scale", bodies.gravity_scale != 1)
    _refuse("limits of speed", ~np.isnan(bodies.max_linear_speed))
    order, shaped = np.argsort(bodies.entity, kind="stable"), rounds | boxes
    velocity, mass = np.array(bodies.linear_velocity), np.array(bodies.mass)
    rows: tuple[Any, ...] = (position, velocity, mass, half, rounds, shaped, restitution, friction)
    return Bodies(*(column[order] for column in rows))


def _refuse(what: str, found: Any) -> None:
    if np.any(found):
        raise NotPlainError(what)


def pymunk_module() -> ModuleType:
    """The pymunk module; Problem with the name of the extra if it is missing."""
    try:
        return importlib.import_module("pymunk")
    except ImportError as error:
        raise Problem("pymunk is missing; it comes with the extra: pip install 'carom[bench]'") from error


class PymunkSpace:
    """A pymunk space with the bodies of ``world`` in their present state; ``index`` is one of INDEXES.

    NotPlainError for worlds that cannot be translated. pymunk multiplies the restitutions of two bodies and carom takes
    the larger one, so all moving bodies must have the same restitution.
    """

    def __init__(self, world: World, index: str = "tree") -> None:
        pymunk = pymunk_module()
        moving, fixed = moving_and_fixed(world)
        restitution, friction, fixed_friction = _materials(world, moving, fixed)
        self.space: Any = pymunk.Space()
        self.space.iterations = ITERATIONS
        self.space.gravity = tuple(map(float, world.gravity))
        self.dt = world.settings.dt
        self.bodies: list[Any] = []
        for k in range(len(moving.mass)):
            body = pymunk.Body(float(moving.mass[k]), float("inf"))
            body.position = tuple(map(float, moving.position[k]))
            body.velocity = tuple(map(float, moving.velocity[k]))
            self.bodies.append(body)
            self.space.add(body)
            if moving.shaped[k]:
                self._add_shape(pymunk, body, moving, k, (0.0, 0.0), restitution, float(friction[k]))
        for k in np.flatnonzero(fixed.shaped).tolist():
            place = tuple(map(float, fixed.position[k]))
            self._add_shape(pymunk, self.space.static_body, fixed, k, place, restitution, float(fixed_friction[k]))
        if index == "hash":
            size = HASH_CELL * 2 * float(moving.half.max())
            self.space.use_spatial_hash(size, HASH_CELLS_PER_BODY * (len(moving.mass) + len(fixed.mass)))

    def _add_shape(
        self, pymunk: ModuleType, body: Any, rows: Bodies, k: int, offset: tuple[float, ...], e: float, f: float
    ) -> None:
        if rows.round[k]:
            shape = pymunk.Circle(body, float(rows.half[k, 0]), offset)
        else:
            (x, y), (w, h) = offset, map(float, rows.half[k])
            shape = pymunk.Poly(body, [(x - w, y - h), (x + w, y - h), (x + w, y + h), (x - w, y + h)])
        shape.elasticity, shape.friction = e, f
        self.space.add(shape)

    def step(self, count: int) -> None:
        """Take ``count`` steps."""
        step, dt = self.space.step, self.dt
        for _ in range(count):
            step(dt)

    def state(self) -> tuple[Floats, Floats]:
        """Positions and velocities, (n, 2) each, in the order of the world's entity ids."""
        both = [(*body.position, *body.velocity) for body in self.bodies]
        state = np.array(both, float).reshape(-1, 4)
        return state[:, :2], state[:, 2:]

    def settings(self) -> dict[str, Any]:
        """The settings of the space."""
        names = ("iterations", "collision_slop", "collision_bias", "damping", "threads")
        sleeping = math.isfinite(self.space.sleep_time_threshold)
        return {**{name: getattr(self.space, name) for name in names}, "sleeping": sleeping}

    # -- queries, one by one as pymunk takes them ------------------------------------------------------

    def boxes(self, lower: Floats, upper: Floats) -> int:
        """The number of bounding boxes overlapped, summed over all boxes; corners (m, 2)."""
        pymunk = pymunk_module()
        everything, query, box = pymunk.ShapeFilter(), self.space.bb_query, pymunk.BB
        corners = np.concatenate([lower, upper], axis=1).tolist()
        return sum([len(query(box(*four), everything)) for four in corners])

    def spheres(self, centres: Floats, radius: float) -> int:
        """The number of shapes overlapped, summed over all discs; centres (m, 2)."""
        everything, query = pymunk_module().ShapeFilter(), self.space.point_query
        return sum([len(query((x, y), radius, everything)) for x, y in centres.tolist()])

    def nearest(self, points: Floats, reach: float) -> Floats:
        """The distance of the nearest shape to each point (m, 2); negative inside, inf beyond ``reach``."""
        everything, query = pymunk_module().ShapeFilter(), self.space.point_query_nearest
        hits = [query((x, y), reach, everything) for x, y in points.tolist()]
        return np.array([math.inf if hit is None else hit.distance for hit in hits])

    def rays(self, starts: Floats, ends: Floats) -> Floats:
        """The fraction of each ray at its first hit; 1 without a hit."""
        everything, query = pymunk_module().ShapeFilter(), self.space.segment_query_first
        ways = np.concatenate([starts, ends], axis=1).tolist()
        hits = [query((a, b), (c, d), 0.0, everything) for a, b, c, d in ways]
        return np.array([1.0 if hit is None else hit.alpha for hit in hits])


def _materials(world: World, moving: Bodies, fixed: Bodies) -> tuple[float, Floats, Floats]:
    """One restitution for all shapes and the friction of each, chosen so that pymunk's products match carom's rules."""
    shaped, fixed_shaped = moving.restitution[moving.shaped], fixed.restitution[fixed.shaped]
    largest = float(shaped.max(initial=0.0))
    if (shaped != largest).any() or (fixed_shaped > largest).any():
        raise NotPlainError("restitutions that differ")
    if world.settings.restitution_mixing != "max" or world.settings.friction_mixing != "geometric_mean":
        raise NotPlainError("other rules of mixing than the default ones")
    own, others = moving.friction, fixed.friction
    values = own[moving.shaped]
    if np.isnan(values).any() and not (np.isnan(values).all() and np.isnan(others).all()):
        raise NotPlainError("friction that is the partner's")
    partner = float(np.nanmax(values)) if np.isfinite(values).any() else 0.0
    if len(np.unique(values[~np.isnan(values)])) > 1 and np.isnan(others[fixed.shaped]).any():
        raise NotPlainError("friction that is the partner's")
    own, others = np.where(np.isnan(own), 0.0, own), np.where(np.isnan(others), partner, others)
    return largest**0.5, np.sqrt(own), np.sqrt(others)
