"""Bodies of several parts: ``World(Physics(...), Parts())``, then entities with a ``PartOf(body, ...)``."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...components import Collider, RigidBody, Transform
from ...components.part_of import Changes, PartOf, rows_of_parts
from ...components.rigid_body import WEIGHTLESS
from ...components.spin import Spin, mass_of_shape, turning_velocity
from ...framework import Plugin, World
from ...systems.parts.rows import PARTS
from .outline import Outline as Outline
from .outline import Piece as Piece
from .outline import parts_from_outline
from .poses import Pose, turned_by

FIELDS = ("body", "position", "rotation", "mass")


class Place(NamedTuple):
    """Where a part belongs: the entity of its body, and its pose along the axes of that."""

    holder: int
    pose: Pose


class Parts(Plugin):
    """The parts of bodies of one world: entities with a :class:`PartOf` and a collider.

    When a body is deleted its parts are deleted too, and the event ``part_lost`` is sent with entity and component.
    """

    def __init__(self) -> None:
        super().__init__("parts", version="1.0", needs_physics=True)
        self.event("part_lost")
        self.component(PartOf)
        self.world: World | None = None

    def install(self, world: World) -> None:
        """Called by the world; ValueError if these parts are in another one that is not closed."""
        if self.world is not None and not self.world.closed:
            raise ValueError(f"these parts belong to world {self.world.name!r}: each world takes its own Parts()")
        super().install(world)
        self.world = world
        self._physics: Any = world.physics
        self._table: Any = self._physics.table
        self._record: Any = self._physics.record(PARTS)
        self._contents = world._contents()
        self._seen: Any = None  # what all of this depends on
        self._followed: Any = None  # of the parts when they were followed last: entities, fields, and what all share
        self._places: dict[int, Place] = {}
        self._added: dict[int, tuple[int, float]] = {}  # to which body, and how much of its mass
        self._weighed: dict[int, tuple[float, float]] = {}  # by body: its mass without parts, and with them
        self._generation, self._any_static = self._table.generation, False
        self._rows: Any = ()  # of the parts and of their bodies
        self._rows_version = -1
        self._looked_at: list[str] = []  # columns of their colliders
        self._physics.plugin_stages.adopters.append(self._follow)
        self._physics.plugin_stages.waiting.append(lambda: self._now() != self._seen)

    def of(self, body: int) -> list[int]:
        """The parts of a body, by their entities."""
        self._physics.synchronize()
        return self._table.column("entity")[rows_of_parts(self._table, body)].tolist()

    def centre(self, body: int) -> np.ndarray:
        """(d,) m: the centre of mass of a body with its parts, from its position, along its own axes. It should be 0,
        for a body turns about its position: see :meth:`balance`. KeyError if it is no body, ValueError of a part."""
        self._physics.synchronize()
        table, d = self._table, self._physics.dimensions
        row, parts = table.row_of(body), rows_of_parts(table, body)
        if row < 0:
            raise KeyError(f"parts: entity {body!r} is no body")
        if body in self._places:
            raise ValueError(f"parts: entity {body} is a part of entity {self._places[body].holder}: name that")
        masses, total, moment = table.column("part_of.added")[parts], 0.0, np.zeros(d)
        turns = table.column("part_of.turn")[parts]
        own = max(0.0, float(table.column("mass")[row]) - float(masses.sum()))
        for i, mass, turn in zip((row, *parts), (own, *masses), (0.0, *turns), strict=True):
            shape = mass_of_shape(table, i) if mass > 0.0 else None
            if shape is not None:
                moment += mass * Pose.of(0.0, turn, d).point(shape.centre)
            total += mass
        return moment / total

    def balance(self, body: int, *, moving: bool = False) -> None:
        """Move the position of a body to its centre of mass; its colliders and its parts stay where they are.

        moving
            whether it moves already, and all its points keep their velocity: that of the position changes if it spins;
            else the velocity that it was given is that of its centre
        """
        centre, entities = self.centre(body), self._contents.entities
        own, d = entities[body], self._physics.dimensions
        transform = own[Transform]
        way = Pose.of(0.0, transform.rotation, d).point(centre)
        transform.position = transform.position + way
        if moving and Spin in own and RigidBody in own:
            handle = own[RigidBody]
            handle.linear_velocity = handle.linear_velocity + turning_velocity(own[Spin].angular_velocity, way)
        for component, handle in own.items():
            if issubclass(component, Collider):
                handle.offset = handle.offset - centre
        for part in self.of(body):
            if entities[part][PartOf].body == body:
                entities[part][PartOf].position = entities[part][PartOf].position - centre
        self._follow(self.world)

    # -- snapshots --------------------------------------------------------------------------------

    def saved(self, world: Any) -> Any:
        """The parts that have been followed, and what they have added to their bodies."""
        holders, added = zip(*self._added.values(), strict=True) if self._added else ((), ())
        own, whole = zip(*self._weighed.values(), strict=True) if self._weighed else ((), ())
        return {
            "entity": list(self._added), "holder": list(holders), "added": list(added),
            "body": list(self._weighed), "own": list(own), "whole": list(whole),
        }  # fmt: skip

    def take_back(self, world: Any, saved: Any) -> None:
        """Go on from there."""
        added = zip(saved["holder"], saved["added"], strict=True)
        weighed = zip(saved["own"], saved["whole"], strict=True)
        self._added, self._places, self._seen = dict(zip(saved["entity"], added, strict=True)), {}, None
        self._weighed = dict(zip(saved["body"], weighed, strict=True))

    # -- what has changed -------------------------------------------------------------------------

    def _now(self) -> Any:
        """Another value whenever bodies have come or gone, or a field was set."""
        table = self._table
        inside = tuple(table.column(key).tobytes() for name in FIELDS if (key := f"part_of.{name}") in table.exposed)
        statics = table.static_version if self._any_static else 0
        rows = self._rows[0] if self._rows_version == table.version else ()
        derived = tuple(column.tobytes() for column in self._derived(rows)) if len(rows) else ()
        return self._contents.log.rounds, table.version, table.members_version, statics, Changes.count, inside, derived

    def _derived(self, rows: np.ndarray) -> list[np.ndarray]:
        """What parts have from their PartOf in the columns of other components, but for where they move; and which are
        sensors, as these add no mass."""
        arrays = self._table.arrays
        return [arrays[key].take(rows, axis=0) for key in ("mass", *self._looked_at) if key in arrays]

    def _look(self) -> tuple[Any, Any, Any]:
        """(the entities of the parts in order, their fields (n, k) as bits, what all depend on)."""
        table = self._table
        rows = np.flatnonzero(table.has_mask(PartOf)[: table.count])
        rows = rows[np.argsort(table.column("entity")[rows])]
        fields = [table.column(f"part_of.{name}")[rows] for name in (*FIELDS, "added", "holder")]
        of = table.rows_of(fields[0])
        kinds = [np.where(at < 0, -1, np.searchsorted(table.stops, at, side="right")) for at in (of, rows)]
        statics = table.static_version if self._any_static else 0
        bits = np.column_stack((*fields, *kinds, *self._derived(rows))).astype(float).view(np.int64)
        return table.column("entity")[rows], bits, (table.members_version, statics)

    def _find_changed(self) -> tuple[list[int], list[int], dict[int, int]]:
        """(parts to be followed, parts that are none any more, the body of each as it is given)."""
        ids, bits, shared = self._look()
        bodies = self._table.column("part_of.body")[self._table.rows_of(ids)]
        same = np.zeros(len(ids), bool)
        nothing = ids[:0], bits[:0], None
        before, known, then = (self._followed or nothing) if self._seen is not None else nothing
        if shared == then and len(before) and known.shape[1] == bits.shape[1]:
            at = np.minimum(before.searchsorted(ids), len(before) - 1)
            same = (before[at] == ids) & (known[at] == bits).all(axis=1) & ~np.isin(bodies, ids)
        gone = np.setdiff1d(np.fromiter(self._added, np.int64, len(self._added)), ids)
        return ids[~same].tolist(), gone.tolist(), dict(zip(ids.tolist(), bodies.tolist(), strict=True))

    def _follow(self, world: Any) -> None:
        """Which parts there are, where they belong, and what they add to their bodies."""
        if self._now() == self._seen:
            self._place_moved()
            return
        if self._generation != self._table.generation:  # ids mean other entities
            self._generation, self._seen = self._table.generation, None
            self._added, self._weighed, self._places = {}, {}, {}
        table = self._table
        if not (self._added or self._record.count or table.has_mask(PartOf)[: table.count].any()):
            self._seen, self._followed = self._now(), None  # no parts
            return
        changed, gone, body_of = self._find_changed()
        places = {entity: self._place(entity, body_of) for entity in changed}
        lost = [entity for entity, place in places.items() if self._table.row_of(place.holder) < 0]
        told = [(entity, self._contents.entities[entity][PartOf]) for entity in lost]
        for entity in lost:
            del places[entity]
        for entity, place in places.items():
            self._check(entity, place)
        if places or gone or lost:
            self._add_masses(places, [*gone, *lost])
        for entity, place in places.items():
            self._put(entity, place)
        if changed or gone or self._record.count != len(self._places):
            self._contents.delete(lost)
            self._physics.adoption.synchronize()
            self._write(places, [*gone, *lost])
        self._find_rows()
        self._place_moved()
        self._seen, self._followed = self._now(), self._look()
        for entity, part in told:
            world.events.dispatch("part_lost", entity, part)

    def _place(self, entity: int, body_of: dict[int, int]) -> Place:
        """The body at the end of the chain of parts, and the pose against it."""
        seen = [entity]
        pose = self._pose(entity)
        while body_of[seen[-1]] in body_of:
            body = body_of[seen[-1]]
            if body in seen:
                raise ValueError(f"entities {', '.join(map(str, sorted(seen)))} are parts of each other")
            seen.append(body)
            pose = self._pose(body).then(pose)
        return Place(body_of[seen[-1]], pose)

    def _pose(self, entity: int) -> Pose:
        """As the fields say; ValueError if the game has written into them what no field takes."""
        part, columns = self._contents.entities[entity][PartOf], PartOf.columns
        for name in FIELDS:
            columns[name].checked(getattr(part, name), entity)
        return Pose.of(part.position, part.rotation, self._physics.dimensions)

    def _check(self, entity: int, place: Place) -> None:
        """ValueError for a part that the body cannot have."""
        holder, pose = place
        own, body = self._contents.entities.types_of(entity), self._contents.entities.types_of(holder)
        if Spin in own:
            raise ValueError(f"entity {entity}: a part turns with its body, entity {holder}: give that a Spin")
        for collider, cure in Spin.excludes.items():
            if collider in own and Spin in body:
                raise ValueError(f"entity {entity}: {collider.__name__} is no part of a body that turns: {cure}")
        components = self._contents.entities[entity]
        new = not components[PartOf].holder and entity not in self._added  # the plugin has set that of others
        for component in own if new else ():
            if issubclass(component, Collider) and np.any(components[component].offset):
                raise ValueError(f"entity {entity}: {component.__name__}.offset: give PartOf.position instead")
        if new and self.world is not None:
            self._tell_of_place(entity, components[Transform], self._contents.entities[holder][Transform], pose)

    def _tell_of_place(self, entity: int, given: Transform, body: Transform, pose: Pose) -> None:
        """A Transform that the game has given to a part, elsewhere than it will be."""
        d = self._physics.dimensions
        there = Pose.of(body.position, body.rotation, d).point(pose.position)
        if np.any(given.position) and not any(np.allclose(given.position, p) for p in (body.position, there)):
            self.world.report_fault(
                f"entity {entity}: a part is where PartOf.position puts it on its body, its own Transform.position = "
                f"{given.position.tolist()} is ignored: leave the Transform out",
                kind="place of a part", entity=entity,
            )  # fmt: skip

    def _add_masses(self, places: dict[int, Place], gone: list[int]) -> None:
        """What these add to the masses of their bodies, and no more what others have added."""
        before, changed = self._masses(), set()
        for entity in gone:
            holder, mass = self._added.pop(entity, (0, 0.0))
            changed.add(holder)
            if entity in self._contents.entities and PartOf not in self._contents.entities[entity]:
                self._release(entity, holder, mass)
        for entity, (holder, _) in places.items():
            part, mass = self._contents.entities[entity][PartOf], self._contents.entities[entity][PartOf].mass
            if mass is None:
                mass = 0.0 if self._is_sensor(entity) else 1.0
            changed |= {holder, self._added.get(entity, (holder, 0.0))[0]}
            _set(part, "added", mass)
            _set(part, "holder", holder)
            self._added[entity] = holder, mass
        masses = self._masses()
        for body in changed:
            self._weigh(body, before.get(body, []), masses.get(body, []))

    def _masses(self) -> dict[int, list[float]]:
        """By body, what its parts add, in the order of these."""
        found: dict[int, list[float]] = {}
        for _, (holder, mass) in sorted(self._added.items()):
            found.setdefault(holder, []).append(mass)
        return found

    def _weigh(self, body: int, before: list[float], masses: list[float]) -> None:
        """A body becomes heavier or lighter, as long as something is left. Its own mass is kept, for the sum loses it
        beside a part that is heavy enough; a mass that the game has given since is of the whole."""
        own, whole = self._weighed.pop(body, (0.0, 0.0))
        handle = self._contents.entities[body].get(RigidBody) if self._table.row_of(body) >= 0 else None
        if handle is None:
            return
        if handle.mass != whole:
            own = handle.mass - sum(before)
        if masses != before and sum(masses, own) > 0.0:
            handle.mass = sum(masses, own)
        elif masses != before:
            own = handle.mass - sum(masses)
        if masses:
            self._weighed[body] = own, handle.mass

    def _is_sensor(self, entity: int) -> bool:
        own = self._contents.entities[entity]
        return any(issubclass(component, Collider) and handle.sensor for component, handle in own.items())

    def _release(self, entity: int, holder: int, mass: float) -> None:
        """What was a part is a body by itself, where it is, and as fast."""
        own, d, table = self._contents.entities[entity], self._physics.dimensions, self._table
        if Transform not in own or RigidBody not in own:
            return
        arm = np.zeros(d)
        for component, handle in own.items():
            if issubclass(component, Collider):
                arm = Pose.of(0.0, own[Transform].rotation, d).point(handle.offset)
                handle.offset = np.zeros(d)
        spin, row = table.arrays.get("spin.angular_velocity"), table.row_of(holder)
        w = np.reshape(spin[row], -1) if spin is not None and row >= 0 else np.zeros(1)
        turned = w[0] * np.array((-arm[1], arm[0])) if d == 2 else np.cross(w, arm) if len(w) == 3 else 0.0
        own[Transform].position = own[Transform].position + arm
        own[RigidBody].mass = mass if mass > 0.0 else 1.0
        own[RigidBody].linear_velocity = own[RigidBody].linear_velocity + turned

    def _put(self, entity: int, place: Place) -> None:
        """Write what a part has of its body, and the places of its colliders."""
        own, body = self._contents.entities[entity], self._contents.entities[place.holder]
        d, rigid, transform = self._physics.dimensions, body.get(RigidBody), body[Transform]
        _set(own[RigidBody], "kind", rigid.kind if rigid is not None else "static")
        _set(own[RigidBody], "mass", WEIGHTLESS)
        if rigid is not None:
            _set(own[RigidBody], "linear_velocity", rigid.linear_velocity)
        rotation = Pose.of(0.0, transform.rotation, d).rotation
        turned = turned_by(np.array([rotation]), np.reshape(place.pose.rotation, (1, -1)))  # others wake it
        _set(own[Transform], "position", transform.position)
        _set(own[Transform], "rotation", turned[0])
        if np.any(own[PartOf].turn != place.pose.rotation):  # to the bit: a field would make it a unit quaternion anew
            self._table.make("part_of.turn")[self._table.row_of(entity)] = place.pose.rotation
        for component, handle in own.items():
            if issubclass(component, Collider):
                _set(handle, "offset", place.pose.local(np.zeros(d)) * -1.0)

    def _place_moved(self) -> None:
        """Parts are where the game has put their bodies since the last step, and as fast."""
        arrays, record, count = self._table.arrays, self._record, self._record.count
        if not count:
            return
        rows, bodies = self._rows
        if (arrays["position"][rows] != arrays["position"][bodies]).any():
            arrays["position"][rows] = arrays["position"][bodies]
            arrays["previous_position"][rows] = arrays["previous_position"][bodies]
        if (arrays["linear_velocity"][rows] != arrays["linear_velocity"][bodies]).any():
            arrays["linear_velocity"][rows] = arrays["linear_velocity"][bodies]
        rotation = arrays.get("rotation")
        if rotation is not None:
            turned = turned_by(rotation[bodies], record.turn[:count])
            if (rotation[rows] != turned).any():
                rotation[rows] = turned
                if (before := arrays.get("previous_rotation")) is not None:
                    before[rows] = turned_by(before[bodies], record.turn[:count])

    def _write(self, places: dict[int, Place], gone: list[int]) -> None:
        """The record of the parts."""
        record, d = self._record, self._physics.dimensions
        for entity in gone:
            self._places.pop(entity, None)
        self._places = dict(sorted({**self._places, **places}.items()))
        count = record.count = len(self._places)
        record.reserve(max(count, 1), *record.columns())
        record.rows_version = -1
        record.entity[:count] = list(self._places)
        record.body[:count] = [place.holder for place in self._places.values()]
        record.mass[:count] = [self._added[entity][1] for entity in self._places]
        turns = np.reshape([place.pose.rotation for place in self._places.values()], (count, 1 if d == 2 else 4))
        record.turn[:count, : turns.shape[1]] = turns
        rows, table = self._table.rows_of(record.entity[:count]), self._table
        own, products = (table.column(f"part_of.{name}")[rows] for name in ("gyration", "gyration_products"))
        record.kept[:count, 2 if d == 2 else slice(3)] = own  # nan where it has not lost one
        record.kept[:count, 3:] = products if d == 3 else 0.0

    def _find_rows(self) -> None:
        """The rows of the parts and of their bodies."""
        record, count, table = self._record, self._record.count, self._table
        self._rows = table.rows_of(record.entity[:count]), table.rows_of(record.body[:count])
        self._rows_version = table.version
        colliders = [kind for kind in table.component_types if issubclass(kind, Collider)]
        own = [kind for kind in colliders if table.has_mask(kind)[self._rows[0]].any()]
        self._looked_at = [kind.columns[name].key for kind in own for name in ("offset", "sensor")]
        self._any_static = bool((self._rows[1] >= table.stops[1]).any())


def _set(handle: Any, name: str, value: Any) -> None:
    """Write a field if it has another value."""
    if np.any(getattr(handle, name) != value):
        setattr(handle, name, value)


__all__ = ["PartOf", "Parts", "parts_from_outline"]
