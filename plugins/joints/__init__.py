"""Joints between bodies: ``World(Physics(...), Joints())``, then entities with a ``Hinge(...)`` and the like."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...framework import NoPhysicsError, Plugin, World
from ...systems.contacts.solving.joints import POINT, TURN
from ...systems.contacts.solving.records import JOINTS
from .joint import WORLD, Changes, Joint, Place
from .kinds import KINDS, Ball, Cone, Distance, Hinge, Motor, MousePull, Slider, Weld

# What a row keeps from step to step.
KEPT = ("load", "pull", "normal", "total", "thrust")


class JointState(NamedTuple):
    """What a joint has done in the last step, and where its bodies are now.

    impulse
        (d,) N s, on b
    torque
        N m s, on b, beside that of the impulse; in 3D (3,)
    value, speed
        rad of a Hinge, a Weld, a Motor or the twist of a Cone, m of a Slider or a Distance, and the change per second;
        else 0
    """

    impulse: np.ndarray
    torque: float | np.ndarray
    value: float
    speed: float


class Joints(Plugin):
    """The joints of one world: entities with one of the components of this module.

    A joint begins to act with the step after it was created. When one of its bodies is deleted it is deleted too, and
    the event ``joint_lost`` is sent with its entity and component; ``joint_broken`` likewise when it breaks.
    """

    def __init__(self) -> None:
        super().__init__("joints", version="1.0")
        self.components = KINDS
        self.world: World | None = None

    def install(self, world: World) -> None:
        if world.physics is None:
            raise NoPhysicsError("joints need physics before them: World(Physics(...), Joints())")
        if self.world is not None and not self.world.closed:
            raise ValueError(f"these joints belong to world {self.world.name!r}: each world takes its own Joints()")
        self.world, physics = world, world.physics
        self._physics: Any = physics
        self._record: Any = physics.record(JOINTS)
        self._log = world._contents().log
        self._seen: Any = None  # what the rows depend on
        self._joints: dict[int, Joint] = {}  # by entity, which ascend
        self._spans: dict[int, tuple[int, int]] = {}  # their rows
        self._wanted: dict[tuple[int, int], tuple[Any, ...]] = {}  # what rows are to begin with
        self._breaking = False
        world.events.define("joint_lost", "joint_broken")
        self._physics.extensions.followers.append(self._follow)
        self._physics.extensions.finishers.append(self._finish)
        self._physics.extensions.waiting.append(lambda: self._breaking or self._now() != self._seen)
        super().install(world)

    def __len__(self) -> int:
        return len(self._joints)

    def of(self, body: int) -> list[int]:
        """The joints at a body, by their entities."""
        return [entity for entity, joint in self._joints.items() if body in (joint.a, joint.b)]

    def state(self, entity: int) -> JointState:
        """Of the joint of that entity; KeyError if it has none that a step has taken."""
        record, physics, (start, stop) = self._record, self._physics, self._spans[entity]
        joint = self._joints[entity]
        impulse, torque, value, speed = np.zeros(physics.dimensions), np.zeros(physics.dimensions), 0.0, 0.0
        for j in range(start, stop):
            kind = record.kind[j]
            if kind == POINT:
                impulse += record.thrust[j]
            elif kind >= TURN:
                torque += record.total[j] * record.normal[j]
            else:
                impulse += record.total[j] * record.normal[j]
        a, b = (self._moving(entity) for entity in (joint.a, joint.b))
        point_a, point_b = a[0].point(joint.at_a), b[0].point(joint.at_b)
        speed_a, speed_b = _speed_at(a, point_a), _speed_at(b, point_b)
        if isinstance(joint, Distance):
            value = float(np.linalg.norm(point_b - point_a))
            speed = float((speed_b - speed_a) @ (point_b - point_a) / value) if value > 0.0 else 0.0
        elif isinstance(joint, Slider):
            along = a[0].axes @ joint.axis_a
            value = float(along @ (point_b - point_a))
            speed = float(along @ (speed_b - _speed_at(a, point_b)))
        elif isinstance(joint, (Hinge, Weld, Motor, Cone)):
            value, speed = _turned(joint, a, b)
        return JointState(impulse, float(torque[0]) if physics.dimensions == 2 else torque, value, speed)

    # -- snapshots --------------------------------------------------------------------------------

    def saved(self, world: Any) -> Any:
        """What the rows have done in the last step, with the entities of the joints."""
        record, count = self._record, self._record.count
        entity = np.repeat(list(self._spans), [stop - start for start, stop in self._spans.values()]).astype(np.int64)
        return {"entity": entity[:count], **{name: getattr(record, name)[:count].copy() for name in KEPT}}

    def take_back(self, world: Any, saved: Any) -> None:
        """Rows begin with that."""
        self._wanted = {}
        entities = np.asarray(saved["entity"])
        for k, entity in enumerate(entities.tolist()):
            first = int(np.searchsorted(entities, entity))
            self._wanted[entity, k - first] = tuple(np.asarray(saved[name])[k] for name in KEPT)
        self._joints, self._spans, self._seen = {}, {}, None

    # -- before a step ----------------------------------------------------------------------------

    def _follow(self, world: World) -> None:
        """Which joints there are, and their fields, if anything has changed."""
        contents = world._contents()
        if self._now() == self._seen:
            return
        found: dict[int, Joint] = {}
        for kind in KINDS:
            for entity in contents.members.get(kind, ()):
                found[entity] = contents.components_of(entity)[kind]
        found = {entity: found[entity] for entity in sorted(found)}
        lost = [entity for entity, joint in found.items() if joint.attached and not self._has_bodies(joint)]
        for entity, joint in found.items():
            if not joint.attached:
                self._attach(entity, joint)
        ended = [(entity, found.pop(entity)) for entity in lost]
        self._write(found)
        self._end(ended, "joint_lost")
        self._seen = self._now()

    def _now(self) -> tuple[int, int, int]:
        """Another value whenever entities or bodies have come or gone, or a field was set."""
        return self._log.rounds, self._physics.table.version, Changes.count

    def _has_bodies(self, joint: Joint) -> bool:
        return all(entity == WORLD or self._row(entity) >= 0 for entity in (joint.a, joint.b))

    def _row(self, entity: int) -> int:
        return int(self._physics.table.rows_of(np.array([entity], np.int64))[0])

    def _attach(self, entity: int, joint: Joint) -> None:
        """Take hold of the bodies where they are; ValueError for what no world can have."""
        name, physics = f"entity {entity}: {type(joint).__name__}", self._physics
        for body in (joint.a, joint.b):
            if body != WORLD and self._row(body) < 0:
                raise ValueError(f"{name} joins entity {body}, which is no body of world {physics._world.name!r}")
        if physics.dimensions not in joint.dimensions:
            raise ValueError(f"{name} is no joint of worlds of {physics.dimensions} dimensions")
        for field in (field for field in joint.columns.values() if field.item == "vector"):
            field.check_dimensions(joint._values.get(field.name, 0.0), physics.dimensions, entity)
        moving = physics.table.stops[0]
        if not any(body != WORLD and self._row(body) < moving for body in (joint.a, joint.b)):
            raise ValueError(f"{name} joins no dynamic body")
        joint.attach(*(self._moving(body)[0] for body in (joint.a, joint.b)))
        joint.keep(attached=True)

    def _moving(self, entity: int) -> tuple[Place, Any, Any]:
        """(place, velocity, angular velocity) of a body or of the world."""
        d, table = self._physics.dimensions, self._physics.table
        if entity == WORLD:
            return Place(np.zeros(d), np.eye(d), 0.0), np.zeros(d), 0.0 if d == 2 else np.zeros(3)
        row, spin = self._row(entity), table.arrays.get("spin.angular_velocity")
        rotation = table.column("rotation")[row]
        angle = float(rotation) if d == 2 else 0.0
        c, s = np.cos(angle), np.sin(angle)
        axes = np.array(((c, -s), (s, c))) if d == 2 else _matrix(rotation)
        place = Place(table.column("position")[row].copy(), axes, angle)
        w = np.zeros(1 if d == 2 else 3) if spin is None else np.reshape(spin[row], -1)
        return place, table.column("linear_velocity")[row].copy(), float(w[0]) if d == 2 else w

    def _write(self, joints: dict[int, Joint]) -> None:
        """The rows of these joints, which begin with what they had."""
        record, d = self._record, self._physics.dimensions
        wanted = self._wanted or self._kept()
        rows = [(entity, k, row) for entity, joint in joints.items() for k, row in enumerate(joint.rows(d))]
        record.reserve(max(len(rows), 1), *(name for name in record.columns() if not name.startswith("apart_")))
        zero = np.zeros(d)
        for j, (entity, k, row) in enumerate(rows):
            joint = joints[entity]
            record.joint[j], record.kind[j], record.rule[j] = entity, row.kind, row.rule
            record.entity_a[j], record.entity_b[j] = joint.a, joint.b
            record.anchor_a[j], record.anchor_b[j] = row.ends or (joint.at_a, joint.at_b)
            record.axis[j] = (1.0, *zero[1:]) if row.axis is None else row.axis
            for name in ("low", "high", "target", "most", "frequency", "damping_ratio"):
                getattr(record, name)[j] = getattr(row, name)
            load, pull, normal, total, thrust = wanted.get((entity, k), (0.0, zero, (1.0, *zero[1:]), 0.0, zero))
            record.load[j], record.pull[j], record.normal[j] = load, pull, normal
            record.total[j], record.thrust[j] = total, thrust
        record.old_load[:], record.old_pull[:] = record.load, record.pull
        before, self._joints, self._wanted = self._joints, joints, {}
        counts = (
            np.bincount([list(joints).index(entity) for entity, _, _ in rows], minlength=len(joints)) if rows else []
        )
        stops = np.cumsum(counts).astype(int).tolist() if rows else []
        self._spans = {entity: (stop - int(n), stop) for entity, stop, n in zip(joints, stops, counts, strict=True)}
        record.count, record.active, record.rows_version = len(rows), 0, -1
        self._breaking = any(joint.breaking_force is not None for joint in joints.values())
        self._keep_apart(joints)
        changed = {entity for entity in {*before, *joints} if before.get(entity) is not joints.get(entity)}
        self._wake([before.get(entity) or joints[entity] for entity in changed])

    def _kept(self) -> dict[tuple[int, int], tuple[Any, ...]]:
        """What the rows have had, by joint and place in it."""
        record, kept = self._record, {}
        for entity, (start, stop) in self._spans.items():
            for j in range(start, stop):
                kept[entity, j - start] = tuple(np.copy(getattr(record, name)[j]) for name in KEPT)
        return kept

    def _keep_apart(self, joints: dict[int, Joint]) -> None:
        pairs = sorted({
            (min(joint.a, joint.b), max(joint.a, joint.b)) for joint in joints.values()
            if not joint.collide_connected and WORLD not in (joint.a, joint.b)
        })  # fmt: skip
        record = self._record
        record.reserve(len(pairs), "apart_a", "apart_b")
        record.apart = len(pairs)
        if pairs:
            record.apart_a[: len(pairs)], record.apart_b[: len(pairs)] = np.array(pairs, np.int64).T

    def _wake(self, joints: list[Joint]) -> None:
        """What sleeps on bodies whose joints have changed wakes."""
        bodies = {body for joint in joints for body in (joint.a, joint.b) if body != WORLD and self._row(body) >= 0}
        for body in sorted(bodies):
            self._physics.wake(body)

    # -- after a step -----------------------------------------------------------------------------

    def _finish(self, world: World) -> None:
        """Joints that have borne too much are gone."""
        if not self._breaking:
            return
        dt, broken = world.settings.dt, []
        for entity, joint in self._joints.items():
            most = joint.breaking_force
            if most is not None and np.linalg.norm(self.state(entity).impulse) > most * dt:
                broken.append((entity, joint))
        self._end(broken, "joint_broken")

    def _end(self, joints: list[tuple[int, Joint]], event: str) -> None:
        """Delete these joints, and tell."""
        if joints and self.world is not None:
            self.world._contents().delete([entity for entity, _ in joints])
            for entity, joint in joints:
                self.world.events.dispatch(event, entity, joint)


def _turned(joint: Joint, a: tuple[Place, Any, Any], b: tuple[Place, Any, Any]) -> tuple[float, float]:
    """(angle of b against a about the axis of a joint, its change per second)."""
    if len(a[0].position) == 2:
        return b[0].angle - a[0].angle - joint.start, b[2] - a[2]
    axis, side_a, side_b = a[0].axes @ joint.axis_a, a[0].axes @ joint.side_a, b[0].axes @ joint.side_b
    angle = np.arctan2(axis @ np.cross(side_a, side_b), side_a @ side_b)
    return float(angle), float(axis @ (b[2] - a[2]))


def _speed_at(moving: tuple[Place, Any, Any], point: Any) -> Any:
    """The velocity of a body's point."""
    place, velocity, spin = moving
    arm = point - place.position
    return velocity + (np.cross(spin, arm) if len(arm) == 3 else spin * np.array((-arm[1], arm[0])))


def _matrix(q: Any) -> np.ndarray:
    """The rotation matrix of a quaternion."""
    w, x, y, z = np.asarray(q) / np.linalg.norm(q)
    return np.array((
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    ))  # fmt: skip


__all__ = [
    "KINDS", "Ball", "Cone", "Distance", "Hinge", "Joint", "JointState", "Joints", "Motor", "MousePull", "Slider",
    "Weld",
]  # fmt: skip
