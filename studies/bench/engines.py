"""The same bodies in carom, pymunk and Box2D, stepped and read in the same way."""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from carom.framework import World
from carom.lab.cli.usage_errors import Problem
from carom.plugins.joints import Wheel
from carom.plugins.terrain import ChainSegmentCollider

from .plain import Body, Floats, NotPlainError, bodies_of, ends_of, ghosts_of, joints_of, outline_of

CAROM, PYMUNK, BOX2D = "carom", "pymunk", "Box2D"
MODULES = {PYMUNK: "pymunk", BOX2D: "pyb2d3"}
SUBSTEPS = 4  # of Box2D: what its manual recommends
HASHED = 5000  # moving shapes from which pymunk's spatial hash is faster than its tree of boxes
CELL, CELLS = 2.0, 2  # of that hash: over the largest body's size; for each body
ARM = 10.0  # m above a wheel where its spring ends
ALL_LAYERS = 2**32 - 1  # that pymunk has


class State(NamedTuple):
    """Of the dynamic and kinematic bodies, ascending by entity: (n, 2) m and m/s, (n,) rad and rad/s."""

    position: Floats
    velocity: Floats
    angle: Floats
    spin: Floats


class Engine:
    """A running simulation; ``advance`` takes one step."""

    advance: Callable[[], Any]

    def step(self, count: int) -> None:
        """Take ``count`` steps."""
        advance = self.advance
        for _ in range(count):
            advance()

    def state(self) -> State:
        """Its present state, in copies."""
        raise NotImplementedError


def module_of(engine: str) -> Any:
    """The engine's Python module; Problem with the extra that brings it if it is missing."""
    try:
        return importlib.import_module(MODULES[engine])
    except ImportError as error:
        raise Problem(f"{MODULES[engine]} is missing; it comes with the extra: pip install 'carom[bench]'") from error


class Carom(Engine):
    """A world of carom."""

    def __init__(self, world: World) -> None:
        self.world, self.advance = world, world.step

    def state(self) -> State:
        bodies, rows = self.world.bodies, moving_rows(self.world)
        spins = bodies.spin.angular_velocity if hasattr(bodies, "spin") else np.zeros(len(bodies))
        return State(*(np.array(of)[rows] for of in (bodies.position, bodies.linear_velocity, bodies.rotation, spins)))


def moving_rows(world: World) -> Any:
    """The rows of the dynamic and kinematic bodies, ascending by entity."""
    return np.argsort(world.bodies.entity[: world.bodies.kinematic.rows.stop], kind="stable")


class Pymunk(Engine):
    """A pymunk space with the bodies of ``world`` in their present state, and pymunk's default settings.

    It multiplies the restitutions and the frictions of two bodies: each gets the root of carom's, so all moving bodies
    must have the same restitution.
    """

    def __init__(self, world: World) -> None:
        self.pymunk, bodies = module_of(PYMUNK), bodies_of(world)
        self.space: Any = self.pymunk.Space()
        self.space.gravity = tuple(map(float, world.gravity))
        self.advance = partial(self.space.step, world.settings.dt)
        shaped = [body for body in bodies if body.collider]
        largest = max((body.collider.restitution for body in shaped), default=0.0)
        moving = [body for body in shaped if body.kind == "dynamic"]
        if any(body.collider.restitution != largest for body in moving):
            raise NotPlainError("restitutions that differ")
        self.of_entity = {body.entity: self._made(body) for body in bodies}
        self.moving = [self.of_entity[body.entity] for body in bodies if body.kind != "static"]
        for body in shaped:
            shape, of = self._shape(body), body.collider
            shape.elasticity, shape.friction = math.sqrt(largest), math.sqrt(body.friction)
            shape.filter = self.pymunk.ShapeFilter(of.group, of.layer & ALL_LAYERS, of.mask & ALL_LAYERS)
            self.space.add(shape)
        for joint in joints_of(world):
            self._join(joint)
        if len(moving) >= HASHED:
            outlines = (outline_of(body.collider) for body in moving)
            size = 2.0 * max(rounding + np.abs(corners).max() for corners, rounding in outlines)
            self.space.use_spatial_hash(CELL * size, CELLS * len(bodies))

    def _made(self, body: Body) -> Any:
        inertia = (body.mass, body.moment) if body.kind == "dynamic" else (0.0, 0.0)
        made = self.pymunk.Body(*inertia, body_type=getattr(self.pymunk.Body, body.kind.upper()))
        made.position, made.angle = body.position, body.angle
        made.velocity, made.angular_velocity = body.velocity, body.spin
        self.space.add(made)
        return made

    def _shape(self, body: Body) -> Any:
        made, (corners, rounding) = self.of_entity[body.entity], outline_of(body.collider)
        points = list(map(tuple, corners.tolist()))
        if len(points) == 1:
            return self.pymunk.Circle(made, rounding, points[0])
        if len(points) > 2:
            return self.pymunk.Poly(made, points, radius=rounding)
        segment = self.pymunk.Segment(made, *points, rounding)
        if isinstance(body.collider, ChainSegmentCollider):
            segment.set_neighbors(*(tuple(at.tolist()) for at in ghosts_of(body.collider)))
        return segment

    def _join(self, joint: Any) -> None:
        a, b = (self.of_entity.get(body, self.space.static_body) for body in (joint.a, joint.b))
        pymunk, anchor, (low, high) = self.pymunk, np.asarray(joint.anchor), ends_of(joint)
        if isinstance(joint, Wheel):
            along = np.asarray(joint.direction) / np.linalg.norm(joint.direction)
            first, last, top = (a.world_to_local(tuple(anchor + at * along)) for at in (low, high, ARM))
            on_b, mass = b.world_to_local(tuple(anchor)), 1.0 / (1.0 / a.mass + 1.0 / b.mass)
            omega = 2.0 * math.pi * (joint.frequency or 0.0)
            spring = ARM - joint.rest, mass * omega**2, 2.0 * joint.damping_ratio * mass * omega
            made = [pymunk.GrooveJoint(a, b, first, last, on_b), pymunk.DampedSpring(a, b, top, on_b, *spring)]
        else:
            made, free = [pymunk.PivotJoint(a, b, tuple(anchor.tolist()))], b.angle - a.angle
            if math.isfinite(low) or math.isfinite(high):
                made.append(pymunk.RotaryLimitJoint(a, b, free + low, free + high))
        if joint.motor_speed is not None:
            made.append(pymunk.SimpleMotor(a, b, -joint.motor_speed))
            made[-1].max_force = math.inf if joint.max_torque is None else joint.max_torque
        for constraint in made:
            constraint.collide_bodies = joint.collide_connected
        self.space.add(*made)

    def state(self) -> State:
        rows = [(*body.position, *body.velocity, body.angle, body.angular_velocity) for body in self.moving]
        found = np.array(rows, float).reshape(-1, 6)
        return State(found[:, :2], found[:, 2:4], found[:, 4], found[:, 5])


class Box2D(Engine):
    """A world of Box2D with the bodies of ``world`` in their present state, without sleeping; else its defaults."""

    def __init__(self, world: World) -> None:
        self.b2, gravity, dt = module_of(BOX2D), tuple(map(float, world.gravity)), world.settings.dt
        least = 2.0 * math.hypot(*gravity) * dt  # carom's own default
        self.space: Any = self.b2.World(gravity=gravity, restitution_threshold=least)
        self.space.sleeping_enabled = False
        self.advance = partial(self.space.step, dt, SUBSTEPS)
        self.moving, self.of_entity = self.b2.Bodies(), {}
        for body in bodies_of(world):
            self.of_entity[body.entity] = made = self._made(body)
            if body.kind != "static":
                self.moving.append(made.id)
        self.ground = self.space.create_static_body()
        for joint in joints_of(world):
            self._join(joint)

    def _made(self, body: Body) -> Any:
        create = getattr(self.space, f"create_{body.kind}_body")
        motion = {} if body.kind == "static" else {"linear_velocity": body.velocity, "angular_velocity": body.spin}
        rotation = self.b2.Rot()
        rotation.c, rotation.s = math.cos(body.angle), math.sin(body.angle)  # its make_rot is right to 0.002 only
        made = create(position=body.position, rotation=rotation, **motion)
        if body.collider:
            self._add(made, body)
        if body.kind == "dynamic":
            data = self.b2.MassData()
            data.mass, data.center = body.mass, (0.0, 0.0)
            data.rotational_inertia = 0.0 if math.isinf(body.moment) else body.moment  # 0: it does not turn
            made.mass_data = data
        return made

    def _add(self, made: Any, body: Body) -> None:
        b2, of, (corners, rounding) = self.b2, body.collider, outline_of(body.collider)
        bits = b2.make_filter(category_bits=of.layer, mask_bits=of.mask % 2**64, group_index=-abs(of.group))
        material, points = b2.surface_material(friction=body.friction, restitution=of.restitution), corners.tolist()
        if isinstance(of, ChainSegmentCollider):  # there it is solid on the left
            before, after = (at.tolist() for at in ghosts_of(of))
            made.create_chain(b2.chain_def([after, *points[::-1], before], material=material, filter=bits))
            return
        points = list(map(tuple, points))
        if len(points) == 1:
            outline = b2.circle(points[0], rounding)
        elif len(points) == 2:
            outline = b2.capsule(*points, rounding)
        else:
            outline = b2.polygon(points, radius=rounding)
        made.create_shape(b2.shape_def(material=material, filter=bits), outline)

    def _join(self, joint: Any) -> None:
        a, b = (self.of_entity.get(body, self.ground) for body in (joint.a, joint.b))
        anchor, on_a = tuple(map(float, joint.anchor)), np.asarray(joint.anchor, float)
        low, high = ends_of(joint)
        limited = math.isfinite(low) or math.isfinite(high)
        how: dict[str, Any] = {"collide_connected": joint.collide_connected, "enable_limit": limited}
        if joint.motor_speed is not None:
            torque = math.inf if joint.max_torque is None else joint.max_torque
            how |= {"enable_motor": True, "motor_speed": joint.motor_speed, "max_motor_torque": torque}
        if isinstance(joint, Wheel):
            along = np.asarray(joint.direction) / np.linalg.norm(joint.direction)
            on_a = on_a + joint.rest * along  # where its spring rests
            how |= {"lower_translation": low - joint.rest, "upper_translation": high - joint.rest}
            how |= {"hertz": joint.frequency, "damping_ratio": joint.damping_ratio}
            how["local_axis_a"] = a.local_vector(tuple(along.tolist()))
        elif limited:
            how |= {"lower_angle": low, "upper_angle": high, "reference_angle": b.angle - a.angle}
        create = self.space.create_wheel_joint if isinstance(joint, Wheel) else self.space.create_revolute_joint
        create(a, b, local_anchor_a=a.local_point(tuple(on_a.tolist())), local_anchor_b=b.local_point(anchor), **how)

    def state(self) -> State:
        cosine, sine = self.moving.get_rotations().T.astype(float)
        moving, angle = self.moving, np.arctan2(sine, cosine)
        found = moving.get_positions(), moving.get_linear_velocities(), angle, moving.get_angular_velocities()
        return State(*(of.astype(float) for of in found))


PEERS: Mapping[str, Callable[[World], Engine]] = {PYMUNK: Pymunk, BOX2D: Box2D}
