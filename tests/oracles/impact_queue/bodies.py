"""The oracle's bodies: their shapes, their motion within a step, and contact geometry of two bodies."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from carom.components import AABBCollider, Collider, RigidBody, SphereCollider, Transform
from carom.framework import Settings, World
from carom.lab.measure.body_shapes import Floats

FLAT = 0.005  # default slop, as a fraction of the smaller body's size
FAST = 0.2  # of the smaller body's size: pairs that travel farther in a step are swept
MIXED = {
    "max": max,
    "min": min,
    "average": lambda a, b: 0.5 * (a + b),
    "geometric_mean": lambda a, b: math.sqrt(a * b),
    "multiply": lambda a, b: a * b,
}


@dataclass(eq=False)
class Body:
    """One body. The second group of fields belongs to the current step."""

    entity: int
    rigid: RigidBody
    collider: Collider
    position: Floats
    velocity: Floats
    half: Floats  # half extents of a box, or of the box around the sphere

    seems_from: Floats = field(init=False)  # the present path extrapolated back to the start of the step
    first_velocity: Floats = field(init=False)  # velocity at the start of the step plus the impacts since
    path: tuple[Floats, Floats] = field(init=False)  # x(t) = seems_from + path[0] t + path[1] t^2
    gained: float = field(init=False, default=0.0)  # change of speed by forces in free flight
    impact_count: int = field(init=False, default=0)

    @property
    def is_sphere(self) -> bool:
        return isinstance(self.collider, SphereCollider)

    @property
    def inverse_mass(self) -> float:
        return 1.0 / self.rigid.mass if self.rigid.kind == "dynamic" else 0.0

    @property
    def size(self) -> float:
        return 2.0 * float(self.half.min())

    def at(self, t: float) -> Floats:
        """Its position ``t`` seconds into the step, on its present path."""
        return self.seems_from + self.path[0] * t + self.path[1] * t * t

    def velocity_at(self, t: float) -> Floats:
        """The derivative of :meth:`at`."""
        return self.path[0] + 2.0 * t * self.path[1]

    def fly(self, dt: float, gravity: Floats, method: str, curved: bool) -> None:
        """The free flight of one step; ``curved``: paths are parabolas."""
        self.seems_from, self.first_velocity, self.impact_count = self.position, self.velocity, 0
        before, c, nothing = self.velocity, float(self.rigid.linear_damping), np.zeros_like(self.position)
        if self.rigid.kind != "dynamic":
            self.path = before, nothing
            self.position = self.position + dt * before
            return
        constant = np.broadcast_to(np.asarray(self.rigid.constant_force, float), nothing.shape)
        acceleration = self.rigid.gravity_scale * gravity + constant / self.rigid.mass
        decay, gain, second = 1.0, dt, 0.5 * dt * dt
        if c:  # the velocity decays as e^(-c t) while the force acts
            decay, gain = math.exp(-c * dt), -math.expm1(-c * dt) / c
            second = (dt - gain) / c
        after = decay * before + gain * acceleration
        if method == "flight":  # half of the damping is applied before the flight and half after it
            half = math.exp(-0.5 * c * dt)
            self.path = half * before, 0.5 * acceleration
            travel = self.path[0] * dt + self.path[1] * dt * dt
            after = half * self.velocity_at(dt)
        elif method == "velocity_verlet":
            travel = gain * before + second * acceleration
            self.path = before, (travel - dt * before) / (dt * dt) if curved else nothing
        else:
            speed = before if method == "explicit_euler" else after
            travel, self.path = dt * speed, (speed, nothing)
        self.position, self.velocity = self.position + travel, after
        self.gained = float(np.linalg.norm(after - before))


@dataclass(eq=False)
class Pair:
    """Two bodies that may meet in this step; a has the smaller entity id."""

    a: Body
    b: Body
    impulse: float = 0.0  # N s, of this step
    normal: Floats | None = None
    crossed: bool = False  # met during the step without a collision response

    @property
    def bodies(self) -> tuple[Body, Body]:
        return self.a, self.b

    @property
    def pushes(self) -> bool:
        """True if both are solid, and at least one is movable."""
        return self.a.inverse_mass + self.b.inverse_mass > 0.0 and not (
            self.a.collider.sensor or self.b.collider.sensor
        )

    @property
    def key(self) -> tuple[int, int]:
        return self.a.entity, self.b.entity

    @property
    def mass(self) -> float:
        """1 / (1/m_a + 1/m_b)."""
        return 1.0 / (self.a.inverse_mass + self.b.inverse_mass)

    @property
    def size(self) -> float:
        return min(self.a.size, self.b.size)

    def slop(self, settings: Settings) -> float:
        """Allowed overlap, m."""
        return FLAT * self.size if settings.slop is None else settings.slop

    def edge(self, settings: Settings) -> float:
        """Height of edges that a sliding body passes over when swept."""
        gained = max(self.a.gained, self.b.gained)
        return min(self.slop(settings) + 2.0 * gained * settings.dt, FAST * self.size)

    def threshold(self, settings: Settings) -> float:
        """Approach speed, m/s, above which they bounce."""
        fixed = settings.restitution_threshold
        return 2.0 * max(self.a.gained, self.b.gained) if fixed is None else fixed

    def restitution(self, settings: Settings) -> float:
        return MIXED[settings.restitution_mixing](self.a.collider.restitution, self.b.collider.restitution)

    def friction(self, settings: Settings) -> float:
        """The mixed coefficient; None: use the other body's coefficient."""
        values = [body.collider.friction for body in self.bodies if body.collider.friction is not None]
        return MIXED[settings.friction_mixing](values[0], values[-1]) if values else 0.0

    def between(self, at_a: Floats, at_b: Floats) -> Floats:
        """From a's centre to b's, for these positions."""
        return at_b - at_a


@dataclass(frozen=True)
class Touch:
    """Depth of the overlap (negative: distance), and the unit normal from a to b."""

    depth: float
    normal: Floats


def touch(a: Body, b: Body, d: Floats) -> Touch:
    """Contact geometry of the two shapes; b's centre is at ``d`` from a's."""
    if a.is_sphere and b.is_sphere:
        distance = float(np.linalg.norm(d))
        return Touch(a.half[0] + b.half[0] - distance, d / distance if distance > 0.0 else _unit(d, 0, 1.0))
    if a.is_sphere:
        return _sphere_and_box(a, b, d)
    if b.is_sphere:
        seen = _sphere_and_box(b, a, -d)
        return Touch(seen.depth, -seen.normal)
    overlap = a.half + b.half - np.abs(d)  # along each axis; the smallest gives the normal
    axis = int(overlap.argmin())
    return Touch(float(overlap[axis]), _unit(d, axis, 1.0 if d[axis] >= 0.0 else -1.0))


def _sphere_and_box(sphere: Body, box: Body, d: Floats) -> Touch:
    nearest = np.clip(0.0, d - box.half, d + box.half)  # point of the box, relative to the sphere's centre
    distance, radius = float(np.linalg.norm(nearest)), float(sphere.half[0])
    if distance > 0.0:
        return Touch(radius - distance, nearest / distance)
    inside = box.half - np.abs(d)  # the centre is inside: the nearest face gives the normal
    axis = int(inside.argmin())
    return Touch(radius + float(inside[axis]), _unit(d, axis, 1.0 if d[axis] >= 0.0 else -1.0))


def _unit(like: Floats, axis: int, sign: float) -> Floats:
    vector = np.zeros_like(like)
    vector[axis] = sign
    return vector


def is_corner_touch(a: Body, b: Body, d: Floats, slop: float) -> bool:
    """True if two boxes overlap by less than ``slop`` along more than one axis: such touches of tiles are ignored."""
    if a.is_sphere or b.is_sphere:
        return False
    return int((a.half + b.half - np.abs(d) < slop).sum()) > 1


def bodies_of(world: World) -> list[Body]:
    """Copies of all bodies, by entity id; ValueError for what the oracle does not know."""
    return [_body(world, entity) for entity in sorted(np.asarray(world.bodies.entity).tolist())]


def _body(world: World, entity: int) -> Body:
    components = {type(component): component for component in world.components_for_entity(entity)}
    transform = components[Transform]
    collider = components.get(SphereCollider) or components.get(AABBCollider)
    if collider is None or np.any(collider.offset) or np.any(np.atleast_1d(transform.rotation)[-3:]):
        raise ValueError(f"entity {entity}: the oracle knows spheres and boxes without offset or rotation")

    def vector(value: object) -> Floats:
        return np.array(np.broadcast_to(np.asarray(value, float), world.bodies.position.shape[1:]))

    rigid = components.get(RigidBody, RigidBody(kind="static"))
    half = vector(collider.radius if isinstance(collider, SphereCollider) else collider.half_extents)
    velocity = vector(0.0 if rigid.kind == "static" else rigid.linear_velocity)
    return Body(entity, rigid, collider, vector(transform.position), velocity, half)
