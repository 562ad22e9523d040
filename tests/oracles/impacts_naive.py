"""A step of balls and boxes in free flight, by definition: each pair is watched on its path, and what meets bounces.

The gap of a pair closes no faster than the two move, so as long as it takes them to cover it nothing happens; no
equation is solved. Impacts are Newton's, with Coulomb's friction, one at a time.
"""

from __future__ import annotations

import itertools

import numpy as np

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform

from .narrow_naive import box_box, sphere_box, sphere_sphere

CLOSE, SLOW = 1e-13, 1e-6  # a gap that counts as none, of the places; an approach, of the speeds


class UnsureError(Exception):
    """Two boxes that meet at a corner, a pair so slow that only the end of its step counts, or too many impacts."""


class Body:
    def __init__(self, world, entity):
        at = lambda component: world.component_for_entity(entity, component)  # noqa: E731
        self.entity, self.x = entity, np.array(at(Transform).position)
        self.ball = world.has_component(entity, SphereCollider)
        self.collider = at(SphereCollider if self.ball else AABBCollider)
        self.size = self.collider.radius if self.ball else np.array(self.collider.half_extents)
        body = at(RigidBody) if world.has_component(entity, RigidBody) else RigidBody(kind="static")
        self.kind, movable = body.kind, body.kind == "dynamic"
        self.lightness = 1.0 / body.mass if movable else 0.0
        self.v = np.zeros_like(self.x) + (body.linear_velocity if body.kind != "static" else 0.0)
        force = np.asarray(body.constant_force) * self.lightness
        self.a = (body.gravity_scale * np.array(world.gravity) + force) * movable
        self.time = 0.0

    def at(self, t):
        """Place and velocity."""
        t = t - self.time
        return self.x + self.v * t + 0.5 * self.a * t * t, self.v + self.a * t

    def kick(self, t, change):
        self.x, self.v = self.at(t)
        self.v, self.time = self.v + change, t


class Pair:
    def __init__(self, a, b):
        self.a, self.b, self.met = a, b, False
        self.passive = a.lightness + b.lightness == 0.0 or a.collider.sensor or b.collider.sensor

    def look(self, t):
        """(gap, normal, velocity of b seen from a)."""
        (x, v), (y, w) = self.a.at(t), self.b.at(t)
        if self.a.ball and self.b.ball:
            depth, normal, _ = sphere_sphere(x, self.a.size, y, self.b.size)
        elif self.a.ball:
            depth, normal, _ = sphere_box(x, self.a.size, y, self.b.size)
        elif self.b.ball:
            depth, normal, _ = sphere_box(y, self.b.size, x, self.a.size)
            normal = None if normal is None else -normal
        else:
            depth, normal, _ = box_box(x, self.a.size, y, self.b.size)
        return -depth, normal, w - v

    def first_touch(self, t, dt):
        """When they next meet: (time, normal, approach), or None."""
        bend = np.linalg.norm(self.b.a - self.a.a)
        while t <= dt:
            gap, normal, w = self.look(t)
            fastest = np.linalg.norm(w) + bend * dt
            close = CLOSE * (1.0 + max(np.abs(self.a.at(t)[0]).max(), np.abs(self.b.at(t)[0]).max()))
            nears = normal is not None and w @ normal < -SLOW * fastest
            if gap <= close and (nears or self.passive):
                return t, normal, w
            t += max(gap / fastest, (1e-12 if nears else 1e-4) * dt) if fastest else np.inf
        return None

    def check_sure(self, t, w, dt, every):
        sizes = [np.min(one.size) for one in (self.a, self.b)]
        if not every and np.linalg.norm(w) * dt < 0.5 * min(sizes):
            raise UnsureError
        if not (self.passive or self.a.ball or self.b.ball):
            overlaps = self.a.size + self.b.size - np.abs(self.b.at(t)[0] - self.a.at(t)[0])
            if np.sort(overlaps)[1] < 0.05 * min(sizes):
                raise UnsureError

    def bounce(self, t, normal, w):
        """(impulse along the normal), and both go on with new velocities."""
        a, b = self.a.collider, self.b.collider
        closing, slide = -w @ normal, w - (w @ normal) * normal
        speed, fast = (1.0 + max(a.restitution, b.restitution)) * closing, np.linalg.norm(slide)
        rough = [one.friction for one in (a, b) if one.friction is not None] or [0.0]
        mass, mu = 1.0 / (self.a.lightness + self.b.lightness), np.sqrt(rough[0] * rough[-1])
        change = speed * normal - (min(1.0, mu * speed / fast) * slide if fast else 0.0)
        self.a.kick(t, -self.a.lightness * mass * change)
        self.b.kick(t, self.b.lightness * mass * change)
        return mass * speed


def step(world, most):
    """({entity: (place, velocity)}, [(time, a, b, normal, impulse)], pairs of sensors met) at the end of a step."""
    dt, every = world.settings.dt, world.settings.collision == "event_driven"
    bodies = [Body(world, entity) for entity in sorted(world.bodies.entity.tolist())]
    pairs = [Pair(a, b) for a, b in itertools.combinations(bodies, 2) if {a.kind, b.kind} != {"static"}]
    next_touch, impacts = {pair: pair.first_touch(0.0, dt) for pair in pairs}, []
    while True:
        coming = [(touch[0], pair) for pair, touch in next_touch.items() if touch is not None]
        if not coming:
            break
        if len(impacts) >= most:
            raise UnsureError
        t, pair = min(coming, key=lambda one: one[0])
        _, normal, w = next_touch.pop(pair)
        pair.check_sure(t, w, dt, every)
        if pair.passive:
            pair.met = True
            continue
        impacts.append((t, pair.a.entity, pair.b.entity, normal, pair.bounce(t, normal, w)))
        for other in pairs:
            if not other.met and {other.a, other.b} & {body for body in (pair.a, pair.b) if body.lightness}:
                next_touch[other] = other.first_touch(t, dt)
    ends = {body.entity: body.at(dt) for body in bodies}
    return ends, impacts, {(pair.a.entity, pair.b.entity) for pair in pairs if pair.met}
