"""Joints between bodies: ``World(Physics(...), Joints())``, then entities with a ``Hinge(...)`` and the like."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...components.part_of import Changes as PartChanges
from ...components.part_of import PartOf
from ...framework import NoPhysicsError, Plugin, PluginError, World
from ...framework.jit.lazy import errors
from ...framework.plugins.joints import Placed, numbers_of, rows_of
from ...systems.contacts.solving.joints.linked import linked_joint
from ...systems.contacts.solving.joints.records import DRIVE, GIVEN, HOLD, JOINTS, LIMIT, POINT, SERVO, SPRING, TURN
from ...systems.tracking import BEFORE_STEP
from .arms import arm_of, moment
from .joint import WORLD, Changes, Driven, Joint, Place, Row
from .kinds import KINDS, Ball, Cone, Distance, Hinge, Motor, MousePull, Slider, Weld, Wheel
from .measures import Holds, anchors, holds, measure, moving

# What rows are known by, and what they keep from step to step.
KEY = ("joint", "kind", "rule", "entity_a", "entity_b")
KEPT = ("load", "pull", "normal", "total", "thrust")
OF_PLUGINS = ("value", "along_a", "turn_a", "turn_b")  # and rows of plugins' joints besides


class JointState(NamedTuple):
    """What a joint has done in the last step, and where its bodies are now.

    impulse
        (d,) N s, on b
    torque
        N m s, on b, beside that of the impulse; in 3D (3,)
    value, speed
        rad of a Hinge, a Weld, a Motor or the twist of a Cone, m of a Slider, a Wheel or a Distance, what the first row
        of a plugin's joint has, and the change per second; else 0
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
        self._contents = world._contents()
        self._seen: Any = None  # what the rows depend on
        self._joints: dict[int, Joint] = {}  # by entity, which ascend
        self._spans: dict[int, tuple[int, int]] = {}  # their rows
        self._connected: dict[int, bool] = {}  # which of them may touch
        self._holds: list[Holds] | None = None  # what columns() measures, once they are asked for
        self._wanted: dict[str, Any] | None = None  # what rows are to begin with after going back
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

    @property
    def changes_energy(self) -> bool:
        """Whether any has a motor, a spring or a limit: energy comes and goes by intent."""
        return bool((self._record.rule[: self._record.count] != HOLD).any())

    def state(self, entity: int) -> JointState:
        """Of the joint of that entity; KeyError if it has none that a step has taken."""
        if entity not in self._joints:
            raise KeyError(f"entity {entity!r} has no joint that a step has taken")
        start, stop = self._spans[entity]
        impulses, torques = self._given(start, stop)
        torque = torques.sum(axis=0)
        value, speed = self._measure([entity], holds([self._joints[entity]]))
        flat = self._physics.dimensions == 2
        return JointState(impulses.sum(axis=0), float(torque[0]) if flat else torque, float(value[0]), float(speed[0]))

    def columns(self) -> dict[str, np.ndarray]:
        """Of all joints what :meth:`state` has: ``entity (n,)``, ``impulse (n, d)``, ``torque (n,)``, in 3D (n, 3),
        ``value (n,)`` and ``speed (n,)``."""
        columns = self._done()
        if self._holds is None:
            self._holds = holds(self._joints.values())
        value, speed = self._measure(list(self._joints), self._holds)
        return columns | {"value": value, "speed": speed}

    def anchors(self) -> tuple[np.ndarray, np.ndarray]:
        """(n, d) where the anchors of all joints are, on each a and on each b: to draw ropes and hinges."""
        return anchors(self._physics.table, self._joints.values())

    def _done(self) -> dict[str, np.ndarray]:
        """What the joints have done in the last step."""
        starts = [start for start, _ in self._spans.values()]
        impulses, torques = self._given(0, self._record.count)
        if starts:
            impulses, torques = np.add.reduceat(impulses, starts), np.add.reduceat(torques, starts)
        torque = torques[:, 0] if self._physics.dimensions == 2 else torques
        return {"entity": np.array(list(self._spans), np.int64), "impulse": impulses, "torque": torque}

    def _given(self, start: int, stop: int) -> tuple[np.ndarray, np.ndarray]:
        """The impulses and the torques of some rows, (k, d) each."""
        record, kind = self._record, self._record.kind[start:stop, None]
        along, given = record.total[start:stop, None] * record.normal[start:stop], kind == GIVEN
        impulse = np.where(kind == POINT, record.thrust[start:stop], np.where((kind < TURN) | given, along, 0.0))
        turned = np.where(given, record.total[start:stop, None] * record.turn_b[start:stop], along)
        return impulse, np.where(kind >= TURN, turned, 0.0)

    def _measure(self, entities: list[int], found: list[Holds]) -> tuple[np.ndarray, np.ndarray]:
        """The values of these joints and their changes per second; of those of plugins what their first rows say."""
        table, record = self._physics.table, self._record
        value, speed = measure(table, found, len(entities))
        own = [k for k, entity in enumerate(entities) if type(self._joints[entity]) in self._own]
        if own:
            rows = [self._spans[entities[k]][0] for k in own]
            value[own] = record.value[rows]
            speed[own] = moving(table, record.entity_a[rows]).rate(record.along_a[rows], record.turn_a[rows])
            speed[own] += moving(table, record.entity_b[rows]).rate(record.normal[rows], record.turn_b[rows])
        return value, speed

    # -- snapshots --------------------------------------------------------------------------------

    def saved(self, world: Any) -> Any:
        """What the rows have done in the last step, with the entities of the joints and of their bodies."""
        record, count = self._record, self._record.count
        own = OF_PLUGINS if (record.kind[:count] == GIVEN).any() else ()
        return self._wanted or {name: getattr(record, name)[:count].copy() for name in (*KEY, *KEPT, *own)}

    def take_back(self, world: Any, saved: Any) -> None:
        """Rows begin with that."""
        self._wanted = saved
        self._joints, self._spans, self._seen = {}, {}, None

    # -- before a step ----------------------------------------------------------------------------

    def _follow(self, world: World) -> None:
        """Which joints there are, and their fields, if anything has changed."""
        now = self._now()
        same = self._seen is not None and now[:2] == self._seen[:2]
        if same and now[2] != self._seen[2]:
            self._check_apart(self._joints)
        if now == self._seen or (same and self._update()):
            self._seen = now
            return
        found = self._present()
        lost = [entity for entity, joint in found.items() if self._is_lost(joint)]
        ended = [(entity, found.pop(entity)) for entity in lost]
        for entity, joint in found.items():
            joint.fit(self._physics.dimensions, entity)
            if not joint.attached:
                self._attach(entity, joint)
        self._check_apart(found)
        self._write(found)
        self._end(ended, "joint_lost")
        self._seen = self._now()

    def _present(self) -> dict[int, Joint]:
        """All joints of the world, in the order of their entities."""
        contents, found = self._contents, {}
        for kind in (*KINDS, *self._own):
            for entity in contents.members.get(kind, ()):
                found[entity] = contents.components_of(entity)[kind]
        return {entity: found[entity] for entity in sorted(found)}

    def _check_apart(self, joints: dict[int, Joint]) -> None:
        """ValueError for one whose bodies have become parts of one body."""
        for entity, joint in joints.items() if self._contents.members.get(PartOf) else ():
            joint.check_apart(self._contents, entity)

    def _now(self) -> tuple[int, int, int, int]:
        """Another value whenever entities or bodies have come or gone, or a field of joints or of parts was set."""
        return self._contents.log.rounds, self._physics.table.version, PartChanges.count, Changes.count

    def _is_lost(self, joint: Joint) -> bool:
        """Whether one of its bodies is gone; of a joint that has not taken hold yet: whether it was deleted since."""
        contents = self._contents
        return any(
            body != WORLD and self._row(body) < 0
            and (joint.attached or (body not in contents.entities and body < contents.counter.next))
            for body in (joint.a or WORLD, joint.b or WORLD)
        )  # fmt: skip

    @property
    def _own(self) -> dict[Any, Any]:
        """The joints of plugins."""
        return self.world.registry.joints if self.world is not None else {}

    def _row(self, entity: int) -> int:
        return int(self._physics.table.row_of(entity))

    def _attach(self, entity: int, joint: Joint) -> None:
        """Take hold of the bodies where they are."""
        try:
            joint.check_in(self._contents, entity)
            places = self._place(joint.a or WORLD), self._place(joint.b or WORLD)
            joint.attach(*places)
            if type(joint) in self._own:
                self._start(f"entity {entity}: {type(joint).__name__}", joint, places)
        except ValueError as error:
            raise ValueError(f"{error}: set its fields, or world.delete_entity({entity})") from None
        joint.keep(attached=True)

    def _start(self, name: str, joint: Joint, places: tuple[Place, ...]) -> None:
        """What the function of a plugin's joint says where this takes hold."""
        a, b = (Placed(tuple(place.position), tuple(map(tuple, place.axes.T))) for place in places)
        with np.errstate(all="ignore"):
            rows = rows_of(type(joint), joint, a, b)
        values = [row[0] or 0.0 for row in rows]
        if not np.isfinite([*values, *(x for row in rows for vector in row[1:] for x in vector)]).all():
            raise ValueError(f"{name}: where it takes hold its constraint returns what is not finite: {rows}")
        joint.keep(start=float(values[0]))
        parts = [row.part for row in joint.rows(self._physics.dimensions) if row.kind == GIVEN]
        if parts and not 0 <= min(parts) <= max(parts) < len(values):
            raise ValueError(f"{name}: its rows speak of part {max(parts)}, but its constraint returns {len(values)}")

    def _place(self, entity: int) -> Place:
        """Where a body is, or the world."""
        d, table = self._physics.dimensions, self._physics.table
        if entity == WORLD:
            return Place(np.zeros(d), np.eye(d), 0.0)
        row = self._row(entity)
        rotation = table.column("rotation")[row]
        angle = float(rotation) if d == 2 else 0.0
        c, s = np.cos(angle), np.sin(angle)
        axes = np.array(((c, -s), (s, c))) if d == 2 else _matrix(rotation)
        return Place(table.column("position")[row].copy(), axes, angle)

    def _update(self) -> bool:
        """Fields were set, and no more: the rows of these joints as they are now. False if they are other rows."""
        changed = [(entity, joint) for entity, joint in self._joints.items() if joint.changed]
        record, d = self._record, self._physics.dimensions
        rows = {}
        for entity, joint in changed:
            joint.fit(d, entity)
            rows[entity] = joint.rows(d) if joint.attached else []
            span = slice(*self._spans[entity])
            before = list(zip(record.kind[span].tolist(), record.rule[span].tolist(), strict=True))
            same = before == [(row.kind, row.rule) for row in rows[entity]]
            if not same or joint.collide_connected != self._connected[entity]:
                return False
        for entity, joint in changed:
            for j, row in enumerate(rows[entity], self._spans[entity][0]):
                self._put(j, joint, row)
        self._finish_changes(set())
        return True

    def _write(self, joints: dict[int, Joint]) -> None:
        """The rows of these joints, which begin with what they had."""
        record, d, wanted = self._record, self._physics.dimensions, _by_row(self.saved(self.world))
        rows = [(entity, row) for entity, joint in joints.items() for row in joint.rows(d)]
        other = ("apart_a", "apart_b", "numbers", "axes_a", "axes_b")
        record.reserve(max(len(rows), 1), *record.columns().keys() - other)
        own = [numbers_of(joints[entity], d) if row.kind == GIVEN else () for entity, row in rows]
        ends = np.cumsum([0, *map(len, own)])
        record.numbers_at[: len(rows)] = ends[:-1]
        if ends[-1]:
            record.reserve(d * len(rows), "axes_a", "axes_b")
            record.reserve(int(ends[-1]), "numbers")
        self._joints, self._spans, self._wanted = joints, {}, None
        for j, (entity, row) in enumerate(rows):
            record.joint[j] = entity
            for name in (*KEPT, *OF_PLUGINS):
                getattr(record, name)[j] = 0.0
            record.normal[j] = np.eye(d)[0]
            self._put(j, joints[entity], row)
            self._spans[entity] = self._spans.get(entity, (j, j))[0], j + 1
        record.count, record.active, record.rows_version = len(rows), 0, -1
        now = _by_row({name: getattr(record, name)[: len(rows)] for name in KEY})
        for j, key in enumerate(now):
            for name, value in zip((*KEPT, *OF_PLUGINS), wanted.get(key, ()), strict=False):
                getattr(record, name)[j] = value
        for name in BEFORE_STEP:
            getattr(record, f"old_{name}")[:] = getattr(record, name)
        self._connected = {entity: joint.collide_connected for entity, joint in joints.items()}
        self._keep_apart(joints)
        self._finish_changes({body for key in wanted.keys() ^ now.keys() for body in key[3:5]})

    def _put(self, j: int, joint: Joint, row: Row) -> None:
        """A row of a joint as it is now."""
        record = self._record
        record.kind[j], record.rule[j] = row.kind, row.rule
        record.entity_a[j], record.entity_b[j] = joint.a, joint.b
        record.anchor_a[j], record.anchor_b[j] = row.ends or (joint.at_a, joint.at_b)
        record.axis[j] = np.eye(self._physics.dimensions)[0] if row.axis is None else row.axis
        for name in ("low", "high", "target", "most", "frequency", "damping_ratio"):
            getattr(record, name)[j] = getattr(row, name)
        if row.kind == GIVEN:
            self._put_own(j, joint, row.part)

    def _put_own(self, j: int, joint: Joint, part: int) -> None:
        """What a row of a plugin's joint calls; a PluginError if its function cannot be compiled."""
        record, own, start = self._record, self._own[type(joint)], self._record.numbers_at[j]
        given = numbers_of(joint, self._physics.dimensions)
        record.part[j], record.numbers[start : start + len(given)] = part, given
        try:
            record.function[j] = linked_joint(own, self._physics.dimensions).address
        except errors.NumbaError as error:
            raise PluginError(
                f"plugin {own.plugin}: constraint of joint {type(joint).__name__} cannot be compiled; use numbers, "
                f"tuples, math, carom.framework.vectors, and helpers marked @plugin.kernel: {error}"
            ) from error

    def _finish_changes(self, bodies: set[int]) -> None:
        """These bodies have had other rows; they wake if they sleep, and so do those whose joints have changed."""
        self._holds = None
        self._breaking = any(joint.breaking_force is not None for joint in self._joints.values())
        for joint in self._joints.values():
            if joint.changed:
                bodies |= {joint.a, joint.b}
                joint.keep(changed=False)
        for body in sorted(bodies - {WORLD}):
            if self._row(body) >= 0:
                self._physics.wake(body)

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

    # -- after a step -----------------------------------------------------------------------------

    def _finish(self, world: World) -> None:
        """Joints that have borne too much are gone."""
        if not self._breaking:
            return
        columns, dt = self._done(), world.settings.dt
        force = np.linalg.norm(columns["impulse"], axis=1) / dt
        pairs = zip(self._joints.items(), force.tolist(), strict=True)
        broken = [(entity, joint) for (entity, joint), size in pairs if size > (joint.breaking_force or np.inf)]
        self._end(broken, "joint_broken")

    def _end(self, joints: list[tuple[int, Joint]], event: str) -> None:
        """Tell of these joints, and delete them: last, for if a handler raises the step is taken again."""
        if joints and self.world is not None:
            for entity, joint in joints:
                self.world.events.dispatch(event, entity, joint)
            self._contents.delete([entity for entity, _ in joints])


def _by_row(columns: dict[str, Any]) -> dict[tuple[int, ...], tuple[Any, ...]]:
    """What rows keep, by what they are known by and how many such rows are before them, in their order."""
    rows: dict[tuple[int, ...], tuple[Any, ...]] = {}
    seen: dict[tuple[int, ...], int] = {}
    kept = [np.asarray(columns[name]) for name in (*KEPT, *OF_PLUGINS) if name in columns]
    for j, key in enumerate(zip(*(np.asarray(columns[name]).tolist() for name in KEY), strict=True)):
        seen[key] = seen.get(key, -1) + 1
        rows[*key, seen[key]] = tuple(column[j] for column in kept)
    return rows


def _matrix(q: Any) -> np.ndarray:
    """The rotation matrix of a quaternion."""
    w, x, y, z = np.asarray(q) / np.linalg.norm(q)
    return np.array((
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    ))  # fmt: skip


__all__ = [
    "DRIVE", "GIVEN", "HOLD", "KINDS", "LIMIT", "SERVO", "SPRING", "Ball", "Cone", "Distance", "Driven", "Hinge",
    "Joint", "JointState", "Joints", "Motor", "MousePull", "Row", "Slider", "Weld", "Wheel", "arm_of",
    "moment",
]  # fmt: skip
