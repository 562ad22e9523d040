"""What joints measure: where b is against a, how fast that changes, and what they bear; of all joints at once."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any, NamedTuple

import numpy as np

from ...systems.joints.measuring import FOLDED, FULL_TURN
from ...systems.joints.records import CUSTOM, POINT, TURN
from .joint import WORLD, Joint
from .kinds import Cone, Distance, Hinge, Motor, Slider, Weld, Wheel


class Holds(NamedTuple):
    """Where joints of one kind hold their bodies, along the axes of these."""

    measure: Any  # (holds, moving a, moving b) -> ((n,) values, (n,) changes per second)
    joints: np.ndarray  # (n,) which of all joints
    a: np.ndarray  # (n,) entities
    b: np.ndarray
    at_a: np.ndarray  # (n, d)
    at_b: np.ndarray
    axis: np.ndarray  # of a
    axis_b: np.ndarray
    side_a: np.ndarray
    side_b: np.ndarray
    start: np.ndarray  # (n,)


class Moving(NamedTuple):
    """Where n bodies are, and how they move; the world stands at the origin."""

    position: np.ndarray  # (n, d)
    rotation: np.ndarray  # (n,) or (n, 4)
    velocity: np.ndarray  # (n, d)
    spin: np.ndarray  # (n,) or (n, 3)

    def turned(self, vectors: np.ndarray) -> np.ndarray:
        """Vectors along the axes of the bodies, in the world."""
        if self.rotation.ndim == 1:
            c, s = np.cos(self.rotation), np.sin(self.rotation)
            x, y = vectors.T
            return np.stack((c * x - s * y, s * x + c * y), axis=1)
        real, axis = self.rotation[:, :1], self.rotation[:, 1:]
        half = np.cross(axis, vectors)
        return vectors + 2.0 * (real * half + np.cross(axis, half))

    def speed_at(self, points: np.ndarray) -> np.ndarray:
        """The velocities of the bodies' points that are there."""
        arm = points - self.position
        if self.spin.ndim == 1:
            return self.velocity + self.spin[:, None] * np.stack((-arm[:, 1], arm[:, 0]), axis=1)
        return self.velocity + np.cross(self.spin, arm)

    def rate(self, along: np.ndarray, turn: np.ndarray) -> np.ndarray:
        """What the bodies move along some vectors and turn about others, per second."""
        return _dot(along, self.velocity) + (turn[:, 0] * self.spin if self.spin.ndim == 1 else _dot(turn, self.spin))


def moving(table: Any, entities: np.ndarray) -> Moving:
    """Of these bodies now."""
    rows, d = table.rows_of(entities), table.dimensions
    world, spin = rows < 0, table.arrays.get("spin.angular_velocity")
    still = np.zeros((len(rows), 3) if d == 3 else len(rows))
    position, rotation, velocity = (table.column(key)[rows] for key in ("position", "rotation", "linear_velocity"))
    spin = still if spin is None else spin[rows]
    for column in (position, rotation, velocity, spin):
        column[world] = 0.0
    if d == 3:
        rotation[world, 0] = 1.0
    return Moving(position, rotation, velocity, spin)


def _length(of: Holds, a: Moving, b: Moving) -> tuple[np.ndarray, np.ndarray]:
    point_a, point_b = a.position + a.turned(of.at_a), b.position + b.turned(of.at_b)
    way = point_b - point_a
    length = np.sqrt(_dot(way, way))
    stretching = _dot(way, b.speed_at(point_b) - a.speed_at(point_a))
    return length, stretching / np.where(length > 0.0, length, 1.0)


def _way(of: Holds, a: Moving, b: Moving) -> tuple[np.ndarray, np.ndarray]:
    point_a, point_b, axis = a.position + a.turned(of.at_a), b.position + b.turned(of.at_b), a.turned(of.axis)
    return _dot(axis, point_b - point_a), _dot(axis, b.speed_at(point_b) - a.speed_at(point_b))


def _angle(of: Holds, a: Moving, b: Moving) -> tuple[np.ndarray, np.ndarray]:
    if a.spin.ndim == 1:
        return b.rotation - a.rotation - of.start, b.spin - a.spin
    axis, side_a, side_b = a.turned(of.axis), a.turned(of.side_a), b.turned(of.side_b)
    return np.arctan2(_dot(axis, np.cross(side_a, side_b)), _dot(side_a, side_b)), _dot(axis, b.spin - a.spin)


def _twist(of: Holds, a: Moving, b: Moving) -> tuple[np.ndarray, np.ndarray]:
    """About the axes where the shortest way has brought b's to a's."""
    axis, side_a, side_b = a.turned(of.axis), a.turned(of.side_a), b.turned(of.side_b)
    between = axis + b.turned(of.axis_b)
    rate = between / np.maximum(FOLDED, _dot(between, axis))[:, None]
    side_b = side_b - _dot(axis, side_b)[:, None] * rate
    return np.arctan2(_dot(axis, np.cross(side_a, side_b)), _dot(side_a, side_b)), _dot(rate, b.spin - a.spin)


def _travel(of: Holds, a: Moving, b: Moving) -> tuple[np.ndarray, np.ndarray]:
    return _way(of._replace(axis=of.side_a), a, b)


MEASURES = {
    Distance: _length, Slider: _way, Wheel: _travel, Hinge: _angle, Weld: _angle, Motor: _angle, Cone: _twist,
}  # fmt: skip


def holds(joints: Collection[Joint], bodies: np.ndarray) -> list[Holds]:
    """Of these joints as they are now, which have hold of these ``bodies`` (n, 2)."""
    names, kinds = ("at_a", "at_b", "axis_a", "axis_b", "side_a", "side_b", "start"), {}
    for index, joint in enumerate(joints):
        function = MEASURES.get(type(joint))
        if function is not None:
            kinds.setdefault(function, []).append((index, *bodies[index], *(getattr(joint, name) for name in names)))
    return [Holds(function, *map(np.array, zip(*rows, strict=True))) for function, rows in kinds.items()]


def anchors(table: Any, bodies: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n, d) where points ``at`` (n, 2, d) along the axes of ``bodies`` (n, 2) are: those of a, and those of b."""
    ends = (moving(table, bodies[:, k]) for k in (0, 1))
    a, b = (body.position + body.turned(at[:, k]) for k, body in enumerate(ends))
    return a, b


def measure(table: Any, found: list[Holds], count: int, counted: Any) -> tuple[np.ndarray, np.ndarray]:
    """(count,) values, in m or rad, 0 of what has none, and their changes per second. counted: (count,) the angles
    in space that the steps have counted."""
    value, speed = np.zeros(count), np.zeros(count)
    for of in found:
        value[of.joints], speed[of.joints] = of.measure(of, moving(table, of.a), moving(table, of.b))
        if table.dimensions == 3 and of.measure in (_angle, _twist):
            value[of.joints] += FULL_TURN * np.round((counted[of.joints] - value[of.joints]) / FULL_TURN)
    return value, speed


def _dot(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    return (u * v).sum(axis=1)


def borne(record: Any, rows: Any, dimensions: int, dt: float) -> dict[str, np.ndarray]:
    """What the joints of these rows have done in the last step."""
    starts = np.flatnonzero(np.diff(record.joint[rows], prepend=WORLD))  # the first row of each
    impulses, torques = _given(record, rows)
    if len(starts):
        impulses, torques = np.add.reduceat(impulses, starts), np.add.reduceat(torques, starts)
    loads = []
    for done, most in ((impulses, record.breaking_force), (torques, record.breaking_torque)):
        force, most = np.linalg.norm(done, axis=1) / dt, most[rows][starts]
        loads.append(np.divide(force, most, out=np.zeros_like(force), where=most < np.inf))
    torque = torques[:, 0] if dimensions == 2 else torques
    return {"entity": record.joint[rows][starts], "impulse": impulses, "torque": torque, "load": np.maximum(*loads)}


def _given(record: Any, rows: Any) -> tuple[np.ndarray, np.ndarray]:
    """The impulses and the torques of some rows, (k, d) each."""
    kind, total = record.kind[rows, None], record.total[rows, None]
    along, given = total * record.normal[rows], kind == CUSTOM
    impulse = np.where(kind == POINT, record.thrust[rows], np.where((kind < TURN) | given, along, 0.0))
    turned = total * np.where(given, record.turn_b[rows], record.normal[rows])
    return impulse, np.where(kind >= TURN, turned, 0.0)
