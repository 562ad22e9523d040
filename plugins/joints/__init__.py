"""Joints between bodies: ``World(Physics(...), Joints())``, then entities with a ``Hinge(...)`` and the like."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from ...components import RigidBody
from ...components.part_of import Changes as PartChanges
from ...components.part_of import PartOf
from ...components.spin import Spin
from ...framework import Plugin, World
from ...systems.double_buffers import BEFORE_STEP
from ...systems.joints.own import Placed, rows_of
from ...systems.joints.records import CUSTOM, FREE, HOLD, JOINTS, TURN
from ...systems.joints.records import DRIVE as DRIVE  # for those who write a joint
from ...systems.joints.records import LIMIT as LIMIT
from ...systems.joints.records import SERVO as SERVO
from ...systems.joints.records import SPRING as SPRING
from ...systems.shapes.quaternions import axes_of
from .arms import arm_of as arm_of
from .arms import moment as moment
from .joint import WORLD, Joint, Place
from .joint import Driven as Driven
from .joint import Row as Row
from .kinds import KINDS as KINDS
from .kinds import Ball, Cone, Distance, Hinge, Motor, MousePull, Slider, Weld, Wheel
from .measures import Holds, anchors, borne, holds, measure, moving
from .rows import KEPT, KEY, OF_PLUGINS, JointRows, by_row

BREAKING = "breaking_force", "breaking_torque"


class JointState(NamedTuple):
    """What a joint has done in the last step, and where its bodies are now.

    impulse
        (d,) N s, on b
    torque
        N m s, on b, beside that of the impulse; in 3D (3,)
    value, speed
        rad of a Hinge, a Weld, a Motor or the twist of a Cone, m of a Slider, a Wheel or a Distance, what the first row
        of a plugin's joint has, and the change per second; else 0
    load
        of what it bears: the mean force through breaking_force, or the mean torque through breaking_torque, whichever
        is more. Above 1 it breaks; 0 if it cannot
    """

    impulse: np.ndarray
    torque: float | np.ndarray
    value: float
    speed: float
    load: float


class Joints(Plugin):
    """The joints of one world: entities with one of the components of this module.

    A joint begins to act with the step after it was created. When one of its bodies is deleted it is deleted too, and
    the event ``joint_lost`` is sent with its entity and component; ``joint_broken`` likewise when it breaks.
    """

    def __init__(self) -> None:
        super().__init__("joints", version="1.0", needs_physics=True)
        self.event("joint_lost", "joint_broken")
        self.components = KINDS
        self.world: World | None = None

    def install(self, world: World) -> None:
        """Called by the world; ValueError if these joints are in another one that is not closed."""
        if self.world is not None and not self.world.closed:
            raise ValueError(f"these joints belong to world {self.world.name!r}: each world takes its own Joints()")
        super().install(world)
        self.world = world
        self._physics: Any = world.physics
        self._record: Any = self._physics.record(JOINTS)
        self._contents = world._contents()
        self._rows = JointRows(self._record, self._physics.dimensions, world.registry)
        self._joints: dict[int, Joint] = {}  # those that have rows, by entity, which ascend
        self._holds: list[Holds] | None = None  # what columns() measures, once they are asked for
        self._anchors: np.ndarray | None = None  # (n, 2, d) along the axes of both bodies, the same of anchors()
        # Entities that came, went or changed, and joints of which a field was set, since the last step.
        self._touched: set[int] = set()
        self._set: set[int] = set()
        self._released: set[int] = set()  # bodies that were held otherwise before the world went back
        # By joint and field, vectors that the game may write into.
        self._given_away: dict[int, dict[str, tuple[np.ndarray, bytes]]] = {}
        self._table_version = -1  # at which all bodies of joints were there
        self._parts_changes = PartChanges.count
        self._breaking = False
        self._contents.log.followers.append(self._touched)
        self._physics.plugin_stages.followers.append(self._follow)
        self._physics.plugin_stages.finishers.append(self._finish)
        self._physics.plugin_stages.waiting.append(self._waits)

    def __len__(self) -> int:
        return len(self._present())

    def of(self, body: int) -> list[int]:
        """The joints at a body, by their entities."""
        return [entity for entity, joint in self._present().items() if body in (joint.a, joint.b)]

    @property
    def changes_energy(self) -> bool:
        """Whether any has a motor, a spring or a limit: energy comes and goes by intent."""
        return not np.isin(self._record.rule[: self._record.count], (HOLD, FREE)).all()

    def state(self, entity: int) -> JointState:
        """Of the joint of that entity; KeyError if it has none that a step has taken."""
        joint = self._present().get(entity)
        if joint is None:
            raise KeyError(f"entity {entity!r} has no joint that a step has taken")
        present = {entity: joint}
        columns = self._columns(present, holds([joint], self._held(present)), self._rows.span(entity))
        values = (columns[name][0] for name in JointState._fields)
        return JointState(*(value if value.ndim else float(value) for value in values))

    def columns(self) -> dict[str, np.ndarray]:
        """Of all joints what :meth:`state` has: ``entity (n,)``, ``impulse (n, d)``, ``torque (n,)``, in 3D (n, 3),
        ``value (n,)``, ``speed (n,)`` and ``load (n,)``."""
        present = self._present()
        if present is not self._joints:
            found = holds(present.values(), self._held(present))
        else:
            found = self._holds = holds(present.values(), self._held(present)) if self._holds is None else self._holds
        return self._columns(present, found, slice(0, self._record.count))

    @property
    def entities(self) -> np.ndarray:
        """(n,) of all joints, ascending: the order of :meth:`columns` and :meth:`anchors`."""
        return np.array(list(self._present()), np.int64)

    def anchors(self) -> tuple[np.ndarray, np.ndarray]:
        """(n, d) m, where the anchors of all joints are, on each a and on each b: to draw ropes and hinges."""
        present = self._present()
        if present is self._joints and self._anchors is not None:
            at = self._anchors
        else:
            ends = [(joint.at_a, joint.at_b) for joint in present.values()]
            at = np.array(ends).reshape(-1, 2, self._physics.dimensions)
        self._anchors = at if present is self._joints else None
        return anchors(self._physics.table, self._held(present), at)

    def _held(self, joints: Any) -> np.ndarray:
        """(n, 2) the bodies that these joints have hold of, until the next step also where a or b was set."""
        record = self._record
        first = np.searchsorted(record.joint[: record.count], list(joints))
        return np.stack((record.entity_a[first], record.entity_b[first]), axis=1)

    def _present(self) -> dict[int, Joint]:
        """The joints that have rows, but for those that are gone since the last step."""
        log, dead = self._contents.log, self._contents.dead
        if not (self._touched or log.touched or dead):
            return self._joints
        gone = [e for e in {*self._touched, *log.touched, *dead}.intersection(self._joints)
                if e in dead or self._joint_of(e) is not self._joints[e]]  # fmt: skip
        return {e: joint for e, joint in self._joints.items() if e not in gone} if gone else self._joints

    def _columns(self, joints: dict[int, Joint], found: Any, rows: slice) -> dict[str, np.ndarray]:
        """What :meth:`columns` has, of some of the joints in their order, whose rows are among these."""
        bears = self._bears(rows)
        own = np.searchsorted(bears["entity"], list(joints))
        value, speed = self._measure(joints, found)
        return {name: column[own] for name, column in bears.items()} | {"value": value, "speed": speed}

    def _bears(self, rows: Any) -> dict[str, np.ndarray]:
        """What the joints of these rows have done in the last step."""
        dt = self.world.settings.dt if self.world else 1.0
        return borne(self._record, rows, self._physics.dimensions, dt)

    def _measure(self, joints: dict[int, Joint], found: list[Holds]) -> tuple[np.ndarray, np.ndarray]:
        """The values of these joints and their changes per second; of those of plugins what their first rows say."""
        table, record = self._physics.table, self._record
        first = np.searchsorted(record.joint[: record.count], list(joints))
        value, speed = measure(table, found, len(joints), record.value[first])
        own = [k for k, joint in enumerate(joints.values()) if type(joint) in self._own]
        if own:
            rows = first[own]
            value[own] = record.value[rows]
            speed[own] = moving(table, record.entity_a[rows]).rate(record.along_a[rows], record.turn_a[rows])
            speed[own] += moving(table, record.entity_b[rows]).rate(record.normal[rows], record.turn_b[rows])
        return value, speed

    # -- snapshots --------------------------------------------------------------------------------

    def saved(self, world: Any) -> Any:
        """What the rows have done in the last step, with the entities of the joints and of their bodies."""
        record, count = self._record, self._record.count
        own = OF_PLUGINS if (record.kind[:count] == CUSTOM).any() else ()
        rows = {name: getattr(record, name)[:count].copy() for name in (*KEY, *KEPT, *own)}
        return rows | {"released": sorted(self._released)}

    def take_back(self, world: Any, saved: Any) -> None:
        """The rows are those of the joints that there are now, with that; what no step has taken waits for the next."""
        contents, dimensions = self._contents, self._physics.dimensions
        found = {e: contents.entities[e][c] for c in (*KINDS, *self._own) for e in contents.members.get(c, ())}
        as_they_were = {e for e, joint in self._joints.items() if found.get(e) is joint and joint._taken is self}
        as_they_were -= self._set
        others = {entity: joint for entity, joint in found.items() if entity not in as_they_were}
        for entity in self._joints.keys() - as_they_were:
            self._joints[entity]._taken = None
        self._holds, self._anchors, self._table_version = None, None, -1
        self._given_away = {entity: own for entity, own in self._given_away.items() if entity in as_they_were}
        self._touched.clear()
        self._set.clear()
        attached = (entity for entity, joint in others.items() if joint.attached)
        kept = {*saved["joint"].tolist(), *as_they_were, *attached}
        self._drop({entity for entity in self._joints if entity not in found or entity not in kept})
        for entity, joint in sorted(others.items()):
            joint._contents = contents
            as_saved = joint._saved
            if joint.attached:
                joint.fit(dimensions, entity)
                self._take(entity, joint)
            elif entity in kept:  # it takes hold anew with the next step
                joint.fit(dimensions, entity)
                self._rows.lay(joint, [key[1:5] for key in by_row(saved) if key[0] == entity])
                self._joints[entity], joint._taken = joint, self
            joint._saved = as_saved  # nobody else has looked at its vectors
            if joint.changed:
                self._touched.add(entity)
                self._set.add(entity)
        self._joints = dict(sorted(self._joints.items()))
        self._released = {*saved.get("released", ()), *self._rows.put_back(saved)}
        record = self._record
        for name in BEFORE_STEP:
            getattr(record, f"old_{name}")[:] = getattr(record, name)

    # -- before a step ----------------------------------------------------------------------------

    def _waits(self) -> bool:
        """Whether there is something to do before or after this step."""
        changed = self._touched or self._set or self._released or self._parts_changes != PartChanges.count
        return bool(changed or self._given_away or self._breaking)

    def _follow(self, world: World) -> None:
        """Which joints there are, and their fields, as far as anything has changed."""
        given = [(entity, name, *one) for entity, own in self._given_away.items() for name, one in own.items()]
        for entity, name, array, known in given:
            if array.tobytes() != known:
                now = array.copy()
                array[:] = np.frombuffer(known)
                setattr(self._joints[entity], name, now)  # as if it had been set
        table, touched = self._physics.table, self._touched
        if self._contents.members.get(PartOf) and (
            self._parts_changes != PartChanges.count
            or any(PartOf in self._contents.entities.types_of(entity) for entity in touched)
        ):
            for entity, joint in self._present().items():
                joint.check_apart(self._contents, entity)
                if entity in self._joints:  # what is a part of another body by now
                    self._rows.keep_apart(joint, joint.whole_ends(self._contents))
        self._parts_changes = PartChanges.count
        if not (touched or self._set or self._released or self._table_version != table.version):
            return
        come: dict[int, Joint] = {}
        gone, lost = set(), self._lost() if self._table_version != table.version else {}
        for entity in sorted(touched | self._set):
            joint, before = self._joint_of(entity), self._joints.get(entity)
            if before is not None and before is not joint:
                gone.add(entity)
            if joint is None or entity in lost:
                continue
            if before is not joint and self._is_lost(joint):
                lost[entity] = joint
            elif before is not joint or entity in self._set:
                come[entity] = joint
        fresh = self._prepare(come)
        held = self._released | {body for joint in lost.values() for body in (joint.a, joint.b)} | self._drop(gone)
        for entity, joint in come.items():
            held |= self._take(entity, joint, entity in fresh)
            joint.keep(changed=False)
        if self._physics.sleepers.on:
            self._physics.sleepers.disturb(np.array(sorted(held - {WORLD}), np.int64))
        self._end(list(lost.items()), "joint_lost")  # whose rows take no part, and go with the next step
        for seen in (touched, self._set, self._released):
            seen.clear()
        self._table_version = table.version

    def _prepare(self, joints: dict[int, Joint]) -> set[int]:
        """These joints have hold of their bodies; ValueError, before any row is another one, if one cannot. Returns
        those that have just taken hold."""
        fresh = {entity for entity, joint in joints.items() if not joint.attached}
        for entity, joint in joints.items():
            joint._taken = None  # until it has rows: what looks at its vectors here does not write into them
            joint.fit(self._physics.dimensions, entity)
            if entity in fresh:
                self._attach(entity, joint)
                self._holds = None
            elif entity not in self._joints:
                joint.check_apart(self._contents, entity)
        return fresh

    def _take(self, entity: int, joint: Joint, fresh: bool = False) -> set[int]:
        """Rows for a joint that has hold of its bodies, since now if it is fresh; these, and those it has held."""
        joint._taken = self._anchors = None
        rows = joint.rows(self._physics.dimensions)
        bodies, other = self._rows.put(joint, rows, fresh)
        self._rows.keep_apart(joint, joint.whole_ends(self._contents))
        joint._taken = self
        self._breaking = self._breaking or not (joint.breaking_force is joint.breaking_torque is None)
        if entity not in self._joints:
            own = {name: value.copy() for name, value in joint._values.items() if isinstance(value, np.ndarray)}
            joint._values.update(own)  # only vectors that are asked for from now on are watched
            last = next(reversed(self._joints), 0)
            self._joints[entity], self._holds = joint, None
            if entity < last:
                self._joints = dict(sorted(self._joints.items()))
        if other and any(TURN <= row.kind < CUSTOM and row.rule not in (HOLD, FREE) for row in rows):
            self._tell_if_nothing_turns(joint)
        return bodies

    def _tell_if_nothing_turns(self, joint: Joint) -> None:
        entities, name = self._contents.entities, type(joint).__name__
        ends = [body for body in joint.whole_ends(self._contents) if body != WORLD]
        if any(Spin in entities.types_of(e) and entities.handle(e, RigidBody).kind == "dynamic" for e in ends):
            return
        ends = ", ".join(f"entity {e}" for e in ends)
        self.world.report_fault(
            f"entity {joint.entity}: this {name} turns nothing, for it joins bodies without Spin: {ends}",
            kind="a joint turns nothing", entity=joint.entity,
        )  # fmt: skip

    def _drop(self, entities: set[int]) -> set[int]:
        """These joints have no rows any more; the bodies that they have held."""
        if not entities:
            return set()
        self._rows.remove(sorted(entities))
        joints = [self._joints.pop(entity) for entity in sorted(entities)]
        for joint in joints:
            joint._taken = None
        self._given_away = {entity: own for entity, own in self._given_away.items() if entity not in entities}
        self._holds = self._anchors = None
        return {body for joint in joints for body in (joint.a, joint.b)}

    def _joint_of(self, entity: int) -> Joint | None:
        """The joint that an entity has."""
        types = self._contents.entities.types_of(entity)
        kind = next((kind for kind in types if isinstance(kind, type) and issubclass(kind, Joint)), None)
        return None if kind is None else self._contents.components_of(entity)[kind]

    def note(self, joint: Joint, names: Mapping[str, Any]) -> None:
        """The fields ``names`` of a joint were set: its rows follow at once, unless a step runs or bodies have to wake.
        Vectors that the game has got show it."""
        if joint.attached and type(joint) in KINDS and not (self._physics.table.in_step or self._physics.sleepers.on):
            self._take(joint.entity, joint)
            joint.keep(changed=False)
        else:
            self._set.add(joint.entity)
            self._anchors = None
        given = self._given_away.get(joint.entity, {})
        for name in given.keys() & names.keys():
            array, _ = given[name]
            array[:] = getattr(joint, name)
            joint.keep(**{name: array})
            given[name] = array, array.tobytes()

    def watch(self, joint: Joint, name: str, array: np.ndarray) -> None:
        """The game has got ``array``, the vector ``name`` of a joint, and may write into it."""
        self._given_away.setdefault(joint.entity, {}).setdefault(name, (array, array.tobytes()))

    def is_written(self, entity: int | None) -> bool:
        """Whether the game has written into a vector of that joint since the last step."""
        return any(array.tobytes() != known for array, known in self._given_away.get(entity, {}).values())

    def _lost(self) -> dict[int, Joint]:
        """The joints with rows of which a body is gone."""
        record, table, lost = self._record, self._physics.table, np.zeros(self._record.count, bool)
        for bodies in (record.entity_a[: record.count], record.entity_b[: record.count]):
            lost |= (bodies != WORLD) & (table.rows_of(bodies) < 0)
        there = ((entity, self._joint_of(entity)) for entity in np.unique(record.joint[: record.count][lost]).tolist())
        return {entity: joint for entity, joint in there if joint is not None}

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
        parts = [row.part for row in joint.rows(self._physics.dimensions) if row.kind == CUSTOM]
        if parts and not 0 <= min(parts) <= max(parts) < len(values):
            raise ValueError(f"{name}: its rows speak of part {max(parts)}, but its constraint returns {len(values)}")

    def _place(self, entity: int) -> Place:
        """Where a body is, or the world."""
        d, table = self._physics.dimensions, self._physics.table
        if entity == WORLD:
            return Place(np.zeros(d), np.eye(d), 0.0)
        row = self._row(entity)
        rotation, place = table.column("rotation")[row : row + 1], table.column("position")[row].copy()
        return Place(place, axes_of(rotation, d)[0], float(rotation[0]) if d == 2 else 0.0)

    # -- after a step -----------------------------------------------------------------------------

    def _finish(self, world: World) -> None:
        """Joints that have borne too much are gone."""
        if not self._breaking:
            return
        limits = np.minimum(*(getattr(self._record, name)[: self._record.count] for name in BREAKING))
        rows = np.flatnonzero(limits < np.inf)
        self._breaking = len(rows) > 0
        bears, present = self._bears(rows), self._present()
        broken = bears["entity"][bears["load"] > 1.0].tolist()
        self._end([(entity, present[entity]) for entity in broken if entity in present], "joint_broken")

    def _end(self, joints: list[tuple[int, Joint]], event: str) -> None:
        """Tell of these joints, and delete them: last, for if a handler raises the step is taken again."""
        if joints and self.world is not None:
            for entity, joint in joints:
                self.world.events.dispatch(event, entity, joint)
            self._contents.delete([entity for entity, _ in joints])


__all__ = [
    "Ball", "Cone", "Distance", "Hinge", "JointState", "Joints", "Motor", "MousePull", "Slider", "Weld", "Wheel",
]  # fmt: skip
