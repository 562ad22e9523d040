"""A world of carom translated to pymunk with the same bodies, as pymunk's manual recommends.

Static shapes are attached to the space's static body, bodies without a Spin have infinite moments of inertia, sleeping
is off.
"""

from __future__ import annotations

import importlib
import math
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

from ...components import AABBCollider, SphereCollider
from ...components.spin import Spin
from ...framework import World
from ...plugins.joints import KINDS, Hinge
from ...systems.shapes.rotation import axes_of
from ..cli.usage_errors import Problem
from ..measure.body_shapes import Floats
from ..measure.outlines import OUTLINES, SIGNS, outlines_of

INDEXES = ("tree", "hash")  # pymunk's two broad phases: a tree of bounding boxes, or a spatial hash
ITERATIONS = 10
ALL_LAYERS = 0xFFFFFFFF  # pymunk has 32
HASH_CELL = 2.0  # cell size over the largest moving body's size; measured: 1.5 times as fast as 1.0 (gas2d 10k)
HASH_CELLS_PER_BODY = 2  # measured: as fast as the 10 of pymunk's manual


class NotPlainError(ValueError):
    """A world has something that cannot be translated."""


class Bodies(NamedTuple):
    """One row per body, ascending by entity id.

    ``shaped (n,)`` false without a collider; ``corners``: of each collider (m, 2), about the body's position and along
    its axes, a disc has one; ``rounding (n,)``: how far it goes beyond these; ``restitution`` and ``friction (n,)``,
    NaN: the other body's; ``moment (n,)``: infinite for what does not spin; ``layer``, ``mask`` and ``group (n,)``.
    """

    corners: list[Floats]
    position: Floats
    velocity: Floats
    angle: Floats
    spin: Floats
    mass: Floats
    moment: Floats
    shaped: np.ndarray
    rounding: Floats
    restitution: Floats
    friction: Floats
    layer: np.ndarray
    mask: np.ndarray
    group: np.ndarray


def moving_and_fixed(world: World) -> tuple[Bodies, Bodies, Bodies]:
    """The dynamic, kinematic and static bodies of ``world`` in their present state; NotPlainError if not
    representable."""
    if world.dimensions != 2:
        raise NotPlainError(f"a world of {world.dimensions} dimensions, not 2")
    dynamic, kinematic, fixed = world.bodies.dynamic, world.bodies.kinematic, world.bodies.static
    _refuse("kinematic bodies without a Spin", ~kinematic.has(Spin))
    return _plain(world, dynamic), _plain(world, kinematic), _plain(world, fixed)


def _plain(world: World, bodies: Any) -> Bodies:
    count, angle, moves = len(bodies), np.array(bodies.rotation), np.isin(bodies.entity, world.bodies.dynamic.entity)
    friction, restitution, rounding = np.full(count, np.nan), np.zeros(count), np.zeros(count)
    corners, shaped = [np.zeros((1, 2))] * count, np.zeros(count, bool)
    layer, mask, group = np.ones(count, np.int64), np.ones(count, np.int64), np.zeros(count, np.int64)
    for collider in (SphereCollider, AABBCollider, *OUTLINES):
        has = np.asarray(bodies.has(collider), bool)
        if not has.any():
            continue
        columns = getattr(bodies, collider.prefix[:-1])
        _refuse("bodies with two colliders", shaped & has)
        _refuse("sensors", columns.sensor[has])
        for filters, values in ((layer, columns.layer), (mask, columns.mask), (group, columns.group)):
            filters[has] = values[has] & ALL_LAYERS
        _refuse("turned boxes", (collider is AABBCollider) * angle[has])
        shaped |= has
        friction[has], restitution[has] = columns.friction[has], columns.restitution[has]
        if collider in OUTLINES:
            found, rounding[has], *_ = outlines_of(world, collider, bodies.entity[has])
        elif collider is SphereCollider:
            found, rounding[has] = np.zeros((has.sum(), 1, 2)), columns.radius[has]
        else:
            found = SIGNS[2] * columns.half_extents[has][:, None]
        for k, own, offset in zip(np.flatnonzero(has).tolist(), found, columns.offset[has], strict=True):
            corners[k] = own + offset
            _refuse("offsets of moving bodies' colliders", offset * moves[k])
    _refuse("damping", bodies.linear_damping)
    _refuse("constant forces", bodies.constant_force)
    _refuse("a gravity scale", bodies.gravity_scale != 1)
    _refuse("limits of speed", ~np.isnan(bodies.max_linear_speed))
    spin, moment = _spins(world, bodies, moves)
    order = np.argsort(bodies.entity, kind="stable")
    position, velocity, mass = np.array(bodies.position), np.array(bodies.linear_velocity), np.array(bodies.mass)
    kept: tuple[Any, ...] = position, velocity, angle, spin, mass, moment, shaped, rounding, restitution, friction
    kept = *kept, layer, mask, group
    return Bodies([corners[k] for k in order], *(column[order] for column in kept))


def _spins(world: World, bodies: Any, moves: np.ndarray) -> tuple[Floats, Floats]:
    """Angular velocities (n,), and moments of inertia (n,), which are infinite for what does not spin."""
    spin, moment, has = np.zeros(len(bodies)), np.full(len(bodies), np.inf), bodies.has(Spin)
    if has.any():
        columns = bodies.spin
        spin[has] = columns.angular_velocity[has]
        _refuse("damping of spins", columns.angular_damping[has])
        _refuse("constant torques", columns.constant_torque[has])
        _refuse("limits of spins", ~np.isnan(columns.max_angular_speed[has]))
        for k in np.flatnonzero(has & moves).tolist():
            moment[k] = world.component_for_entity(int(bodies.entity[k]), Spin).moments
    return spin, moment


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
        moving, turning, fixed = moving_and_fixed(world)
        restitution, *frictions = _materials(world, moving, turning, fixed)
        self.space: Any = pymunk.Space()
        self.space.iterations = ITERATIONS
        self.space.gravity = tuple(map(float, world.gravity))
        self.dt = world.settings.dt
        self.bodies = [pymunk.Body(*map(float, row)) for row in zip(moving.mass, moving.moment, strict=True)]
        self.kinematic = [pymunk.Body(body_type=pymunk.Body.KINEMATIC) for _ in turning.mass]
        for rows, bodies in ((moving, self.bodies), (turning, self.kinematic)):
            for k, body in enumerate(bodies):
                body.position, body.angle = tuple(map(float, rows.position[k])), float(rows.angle[k])
                body.velocity, body.angular_velocity = tuple(map(float, rows.velocity[k])), float(rows.spin[k])
                self.space.add(body)
        static = [self.space.static_body] * len(fixed.mass)
        placed = fixed._replace(corners=_in_world(fixed))
        groups = zip((moving, turning, placed), (self.bodies, self.kinematic, static), frictions, strict=True)
        for rows, bodies, friction in groups:
            for k in np.flatnonzero(rows.shaped).tolist():
                shape = _shape(pymunk, bodies[k], rows.corners[k].tolist(), float(rows.rounding[k]))
                shape.elasticity, shape.friction = restitution, float(friction[k])
                shape.filter = pymunk.ShapeFilter(int(rows.group[k]), int(rows.layer[k]), int(rows.mask[k]))
                self.space.add(shape)
        self._join(pymunk, world)
        if index == "hash":
            reach = np.array([np.abs(corners).max() for corners in moving.corners]) + moving.rounding
            size = HASH_CELL * 2 * float(reach.max())
            self.space.use_spatial_hash(size, HASH_CELLS_PER_BODY * (len(moving.mass) + len(fixed.mass)))

    def _join(self, pymunk: ModuleType, world: World) -> None:
        """The hinges, with their limits and motors, of a world that has made no step yet."""
        _refuse("joints that are no hinges", [world.get_component(kind) for kind in KINDS if kind is not Hinge])
        of_entity = dict(zip(np.sort(world.bodies.dynamic.entity).tolist(), self.bodies, strict=True))
        for _, joint in world.get_component(Hinge):
            a, b = (of_entity.get(body, self.space.static_body) for body in (joint.a, joint.b))
            made, free = [pymunk.PivotJoint(a, b, tuple(map(float, joint.anchor)))], b.angle - a.angle
            _refuse("springs of hinges", joint.frequency is not None)
            if joint.lower is not None or joint.upper is not None:
                low, high = (-math.inf if joint.lower is None else joint.lower), joint.upper
                made.append(pymunk.RotaryLimitJoint(a, b, free + low, free + (math.inf if high is None else high)))
            if joint.motor_speed is not None:
                made.append(pymunk.SimpleMotor(a, b, -joint.motor_speed))
                made[-1].max_force = math.inf if joint.max_torque is None else joint.max_torque
            for constraint in made:
                constraint.collide_bodies = joint.collide_connected
            self.space.add(*made)

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

    def turns(self) -> tuple[Floats, Floats]:
        """Angles and angular velocities, (n,) each, likewise; then those of the kinematic bodies."""
        both = np.array([(body.angle, body.angular_velocity) for body in (*self.bodies, *self.kinematic)], float)
        return both.reshape(-1, 2)[:, 0], both.reshape(-1, 2)[:, 1]

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


def _in_world(rows: Bodies) -> list[Floats]:
    """The corners where the bodies have them."""
    axes = axes_of(rows.angle, 2)
    return [place + corners @ turn.T for place, corners, turn in zip(rows.position, rows.corners, axes, strict=True)]


def _shape(pymunk: ModuleType, body: Any, corners: list[tuple[float, float]], rounding: float) -> Any:
    if len(corners) == 1:
        return pymunk.Circle(body, rounding, corners[0])
    if len(corners) == 2:
        return pymunk.Segment(body, *corners, rounding)
    return pymunk.Poly(body, corners, radius=rounding)


def _materials(world: World, moving: Bodies, *others: Bodies) -> tuple[Any, ...]:
    """One restitution for all shapes and the friction of each, of the moving and of the other bodies, chosen so that
    pymunk's products match carom's rules."""
    shaped, values = moving.restitution[moving.shaped], moving.friction[moving.shaped]
    largest = float(shaped.max(initial=0.0))
    if (shaped != largest).any() or any((rows.restitution[rows.shaped] > largest).any() for rows in others):
        raise NotPlainError("restitutions that differ")
    if world.settings.restitution_mixing != "max" or world.settings.friction_mixing != "geometric_mean":
        raise NotPlainError("other rules of mixing than the default ones")
    theirs = np.concatenate([rows.friction[rows.shaped] for rows in others])
    if np.isnan(values).any() and not (np.isnan(values).all() and np.isnan(theirs).all()):
        raise NotPlainError("friction that is the partner's")
    partner = float(np.nanmax(values)) if np.isfinite(values).any() else 0.0
    if len(np.unique(values[~np.isnan(values)])) > 1 and np.isnan(theirs).any():
        raise NotPlainError("friction that is the partner's")
    own = np.sqrt(np.where(np.isnan(moving.friction), 0.0, moving.friction))
    return largest**0.5, own, *(np.sqrt(np.where(np.isnan(rows.friction), partner, rows.friction)) for rows in others)
