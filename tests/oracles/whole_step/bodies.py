"""The oracle's bodies: their shapes, their motion within a step, and contact geometry of two bodies."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from carom.components import AABBCollider, Collider, RigidBody, SphereCollider, Transform
from carom.framework import Settings, World
from carom.lab.measure.body_shapes import Floats

from ..narrow_naive import rotation_matrix

FLAT = 0.005  # default slop, as a fraction of the smaller body's size
NEIGHBOURS = 0.1  # of the smallest half extent: enlargement of the boxes around the motion
FAST = 0.2  # of the smaller body's size: pairs that travel farther in a step are swept


@dataclass(eq=False)
class Body:
    """One body. The second group of fields belongs to the current step."""

    entity: int
    kind: str
    position: Floats
    velocity: Floats
    mass: float
    gravity_scale: float
    constant_force: Floats
    damping: float
    radius: float  # of a sphere; 0 for a box
    half: Floats  # half extents of a box, or of the box around the sphere
    is_sphere: bool
    offset: Floats
    restitution: float
    friction: float | None
    sensor: bool
    layer: int
    mask: int
    ccd: bool

    start: Floats = field(init=False)  # position at the start of the step
    seems_from: Floats = field(init=False)  # the present path extrapolated back to the start of the step
    first_velocity: Floats = field(init=False)  # velocity at the start of the step plus the impacts since
    path: tuple[Floats, Floats] = field(init=False)  # x(t) = seems_from + path[0] t + path[1] t^2
    gained: float = field(init=False, default=0.0)  # change of speed by forces in free flight
    resting_prediction: Floats | None = field(init=False, default=None)  # velocity change by contacts at rest
    impact_count: int = field(init=False, default=0)
    counted_impacts: int = field(init=False, default=0)  # impacts that count towards the cap
    last: float = field(init=False, default=-math.inf)  # time of the latest impact, if bodies are swept
    cluster: Cluster = field(init=False)  # the bodies it sticks to, and itself
    stopped: bool = field(init=False, default=False)  # beyond the cap: does not move until the step ends

    @property
    def inverse_mass(self) -> float:
        return 1.0 / self.mass if self.kind == "dynamic" else 0.0

    @property
    def size(self) -> float:
        return 2.0 * float(self.half.min())

    def at(self, t: float) -> Floats:
        """Its position ``t`` seconds into the step, on its present path."""
        return self.seems_from + self.path[0] * t + self.path[1] * t * t

    def velocity_at(self, t: float) -> Floats:
        """The derivative of :meth:`at`."""
        return self.path[0] + 2.0 * t * self.path[1]

    def begin(self) -> None:
        """Start a new step."""
        self.start = self.seems_from = self.position
        self.first_velocity = self.velocity
        self.resting_prediction, self.impact_count, self.counted_impacts = None, 0, 0
        self.last, self.cluster = -math.inf, Cluster([self], fixed=self.inverse_mass == 0.0)
        self.stopped = False

    def fly(self, dt: float, gravity: Floats, method: str, curved: bool) -> None:
        """The free flight of one step; ``curved``: paths are parabolas."""
        at_rest = np.zeros_like(self.position)
        if self.kind != "dynamic":
            self.path = self.velocity, at_rest
            self.position = self.position + dt * self.velocity
            return
        force = self.mass * self.gravity_scale * gravity + self.constant_force
        acceleration, c = force / self.mass, self.damping
        decay, gain, second = 1.0, dt, 0.5 * dt * dt
        if c:  # the velocity decays as e^(-c t) while the force acts
            decay, gain = math.exp(-c * dt), -math.expm1(-c * dt) / c
            second = (dt - gain) / c
        before, after = self.velocity, decay * self.velocity + gain * acceleration
        if method == "flight":  # half of the damping is applied before the flight and half after it
            half = math.exp(-0.5 * c * dt)
            self.path = half * before, 0.5 * acceleration
            travel = self.path[0] * dt + self.path[1] * dt * dt
            after = half * self.velocity_at(dt)
        elif method == "velocity_verlet":
            travel = gain * before + second * acceleration
            bend = (travel - dt * before) / (dt * dt) if curved else at_rest
            self.path = before, bend
        else:
            speed = before if method == "explicit_euler" else after
            travel, self.path = dt * speed, (speed, at_rest)
        self.position, self.velocity = self.position + travel, after
        self.gained = float(np.linalg.norm(after - before))


@dataclass(eq=False)
class Cluster:
    """Bodies that stick together until the step ends; ``fixed``: they also stick to an immovable body."""

    members: list[Body]
    fixed: bool

    def velocity_at(self, t: float) -> Floats:
        """That of its centre of mass; an immovable body is alone in its cluster."""
        masses = [body.mass if body.inverse_mass > 0.0 else 1.0 for body in self.members]
        momenta = [mass * body.velocity_at(t) for mass, body in zip(masses, self.members, strict=True)]
        return np.sum(momenta, axis=0) / sum(masses)

    @property
    def inverse_mass(self) -> float:
        return 0.0 if self.fixed else 1.0 / sum(body.mass for body in self.members)


@dataclass(eq=False)
class Pair:
    """Two bodies that may meet in this step; a has the smaller entity id."""

    a: Body
    b: Body
    pushes: bool = False  # both solid, at least one movable
    depth: float = 0.0  # of the overlap after free flight
    near: bool = False  # touches after free flight, or is within the margin
    has_contact: bool = False  # had an impact or is a contact at rest
    impulse: float = 0.0  # N s, of this step
    normal: Floats | None = None
    surely_near: bool = True  # a neighbour, however far bodies look for them
    crossed: bool = False  # met during the step without a collision response
    doubtful: bool = False  # whether they meet was decided by a number of the size of rounding

    @property
    def bodies(self) -> tuple[Body, Body]:
        return self.a, self.b

    @property
    def can_stick(self) -> bool:
        """False if both are in one cluster, or nothing of the two clusters can be moved."""
        one, two = self.a.cluster, self.b.cluster
        return one is not two and not (one.fixed and two.fixed)

    @property
    def key(self) -> tuple[int, int]:
        return self.a.entity, self.b.entity

    @property
    def mass(self) -> float:
        """1 / (1/m_a + 1/m_b)."""
        return 1.0 / (self.a.inverse_mass + self.b.inverse_mass)

    @property
    def size(self) -> float:
        """Size of the smaller body; if that is a point, of the other one."""
        small, large = sorted((self.a.size, self.b.size))
        return small or large

    @property
    def gained(self) -> float:
        return max(self.a.gained, self.b.gained)

    def slop(self, settings: Settings) -> float:
        """Allowed overlap, m."""
        return FLAT * self.size if settings.slop is None else settings.slop

    def margin(self, settings: Settings) -> float:
        """Distance within which they are contacts at rest: the slop plus twice the travel from rest in a step."""
        return self.slop(settings) + 2.0 * self.gained * settings.dt

    def edge(self, settings: Settings) -> float:
        """Height of edges that a sliding body passes over when swept."""
        return min(self.margin(settings), FAST * self.size)

    def threshold(self, settings: Settings) -> float:
        """Approach speed, m/s, above which they bounce."""
        fixed = settings.restitution_threshold
        return 2.0 * self.gained if fixed is None else fixed

    def restitution(self, settings: Settings) -> float:
        return mixed(settings.restitution_mixing, self.a.restitution, self.b.restitution)

    def friction(self, settings: Settings) -> float:
        """The mixed coefficient; None: use the other body's coefficient."""
        values = [body.friction for body in self.bodies if body.friction is not None]
        return mixed(settings.friction_mixing, values[0], values[-1]) if values else 0.0

    def between(self, at_a: Floats, at_b: Floats) -> Floats:
        """From the centre of a's shape to that of b's, for these body positions."""
        return (at_b + self.b.offset) - (at_a + self.a.offset)


def motions_come_near(a: Body, b: Body) -> bool:
    """True if the boxes around the motions of the two within the step overlap."""
    boxes = []
    for body in (a, b):
        ends = np.array([body.start, body.position]) + body.offset
        reach = body.half + NEIGHBOURS * body.half.min()
        boxes.append((ends.min(axis=0) - reach, ends.max(axis=0) + reach))
    (low_a, high_a), (low_b, high_b) = boxes
    return bool((low_a <= high_b).all() and (low_b <= high_a).all())


def mixed(rule: str, one: float, other: float) -> float:
    """The contact's coefficient from those of its two bodies."""
    if rule == "max":
        return max(one, other)
    if rule == "min":
        return min(one, other)
    if rule == "average":
        return 0.5 * (one + other)
    return math.sqrt(one * other) if rule == "geometric_mean" else one * other


# -- shapes ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Touch:
    """Depth of the overlap (negative: distance), the unit normal from a to b, and the contact point relative to a's
    centre."""

    depth: float
    normal: Floats
    point: Floats


def touch(a: Body, b: Body, d: Floats) -> Touch:
    """Contact geometry of the two shapes; b's centre is at ``d`` from a's."""
    if a.is_sphere and b.is_sphere:
        distance = float(np.linalg.norm(d))
        depth = a.radius + b.radius - distance
        normal = d / distance if distance > 0.0 else _unit(d, 0, 1.0)
        return Touch(depth, normal, (a.radius - 0.5 * depth) * normal)
    if a.is_sphere:
        return _sphere_and_box(a, b, d)
    if b.is_sphere:
        seen = _sphere_and_box(b, a, -d)
        return Touch(seen.depth, -seen.normal, seen.point + d)
    overlap = a.half + b.half - np.abs(d)  # along each axis; the smallest gives the normal
    axis = int(overlap.argmin())
    shared = np.maximum(-a.half, d - b.half) + np.minimum(a.half, d + b.half)
    return Touch(float(overlap[axis]), _unit(d, axis, 1.0 if d[axis] >= 0.0 else -1.0), 0.5 * shared)


def _sphere_and_box(sphere: Body, box: Body, d: Floats) -> Touch:
    nearest = np.clip(0.0, d - box.half, d + box.half)  # point of the box, relative to the sphere's centre
    distance = float(np.linalg.norm(nearest))
    if distance > 0.0:
        return Touch(sphere.radius - distance, nearest / distance, nearest)
    inside = box.half - np.abs(d)  # the centre is inside: the nearest face gives the normal
    axis = int(inside.argmin())
    normal = _unit(d, axis, 1.0 if d[axis] >= 0.0 else -1.0)
    return Touch(sphere.radius + float(inside[axis]), normal, -float(inside[axis]) * normal)


def _unit(like: Floats, axis: int, sign: float) -> Floats:
    vector = np.zeros_like(like)
    vector[axis] = sign
    return vector


def is_corner_touch(a: Body, b: Body, d: Floats, slop: float) -> bool:
    """True if two boxes overlap by less than ``slop`` along more than one axis: such touches of tiles are ignored."""
    if a.is_sphere or b.is_sphere:
        return False
    return int((a.half + b.half - np.abs(d) < slop).sum()) > 1


# -- reading a world --------------------------------------------------------------------------------


def bodies_of(world: World) -> list[Body]:
    """Copies of all bodies with a collider, by entity id; ValueError for unsupported features."""
    return [_body(world, entity) for entity in sorted(np.asarray(world.bodies.entity).tolist())]


def _body(world: World, entity: int) -> Body:
    dimensions = world.bodies.position.shape[1]
    components = {type(component): component for component in world.components_for_entity(entity)}
    transform = components[Transform]
    colliders = [c for c in components.values() if isinstance(c, Collider)]
    if len(colliders) != 1:
        raise ValueError(f"entity {entity}: the oracle takes one collider on each body, got {len(colliders)}")
    collider = colliders[0]
    rigid = components.get(RigidBody, RigidBody(kind="static"))
    if rigid.max_linear_speed is not None:
        raise ValueError(f"entity {entity}: the oracle knows no max_linear_speed, got {rigid.max_linear_speed}")

    def vector(value: object) -> Floats:
        return np.array(np.broadcast_to(np.asarray(value, float), (dimensions,)))

    turned = rotation_matrix(transform.rotation, dimensions)
    if isinstance(collider, SphereCollider):
        radius, half = float(collider.radius), vector(collider.radius)
    elif isinstance(collider, AABBCollider):
        radius, half = 0.0, np.abs(turned) @ vector(collider.half_extents)
    else:
        raise ValueError(f"entity {entity}: the oracle knows spheres and boxes, got {type(collider).__name__}")
    velocity = vector(0.0 if rigid.kind == "static" else rigid.linear_velocity)
    return Body(
        entity, rigid.kind, vector(transform.position), velocity, float(rigid.mass), float(rigid.gravity_scale),
        vector(rigid.constant_force), float(rigid.linear_damping), radius, half, isinstance(collider, SphereCollider),
        turned @ vector(collider.offset), float(collider.restitution), collider.friction, bool(collider.sensor),
        int(collider.layer), int(collider.mask), bool(rigid.ccd),
    )  # fmt: skip
