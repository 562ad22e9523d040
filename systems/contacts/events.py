"""RESPONSE: which contacts began, stayed and ended; and calling the handlers of these events."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from ...framework.data.esper_bridge import Membership
from ...framework.data.table import Table
from ...framework.jit.records.record import Record
from ...framework.schedule.clock import Clock
from ...framework.schedule.phases import Phase
from ...framework.schedule.stages import Check, Program, PythonPart, Stage
from ...framework.world.contacts import ContactRows, Contacts
from ...framework.world.events import CONTACT_EVENTS
from ...framework.world.world import World
from ..records import COLLIDERS
from ..sleeping.sleepers import Sleepers
from ..sleeping.stored import merged
from ..stage_system import StagedSystem
from .solving.records import OVERLOADED, RESTRAINED, SQUEEZED, TORN_OPEN
from .stages import ROOM_FOR_FOUND, compare_contacts

Columns = dict[str, np.ndarray]
TOLD = ("entity_a", "entity_b", "point", "normal", "depth", "impulse")  # of contacts
SIDEWAYS = 0.1  # of a slide: along axes on which it goes less no side is looked at
MEETING = ("layer", "mask", "group")  # of colliders: whom they meet


class RecordedContacts:
    """The contacts in a world's records, as columns."""

    def __init__(
        self, program: Program, sleepers: Sleepers, clock: Clock, table: Table, refresh: Callable[[], None]
    ) -> None:
        self._state = state = program.state
        self._table, self._refresh = table, refresh  # makes what the records know of the bodies that of the table
        self._program, self._sleepers, self._clock = program, sleepers, clock
        self._touching, self._impacts = state.contacts, state.impacts
        self.record: Callable[[str, Columns], None] = lambda history, columns: None
        self.stored = sleepers.contacts  # those of what sleeps, which the records do not hold
        self._asleep: Any = None, None, None, None  # (columns, those of what sleeps, mask of these in them, enabled)

    @property
    def version(self) -> int:
        """Changes whenever :meth:`columns` has others to give."""
        return self._state.contacts_version

    @property
    def stay_step(self) -> int:
        """The number of the step that :meth:`stay_columns` are of."""
        return int(self._touching.steps[self._touching.now])

    def columns(self) -> Columns:
        """After NARROW what overlaps where free flight leads, or is near; after RESPONSE what touches."""
        state = self._state
        if state.found_current:
            columns = self._found()
        else:
            contacts, now = self._touching, self._touching.now
            count = int(contacts.counts[now])
            columns = {**self._rows(now, slice(count)), "enabled": contacts.enabled[now, :count].copy()}
        if len(self.stored):
            columns, lively = merged(columns, self._stored_rows())
            self._asleep = columns, self.stored.columns, ~lively, self.stored.columns["enabled"]
        return columns

    def lively(self, columns: Columns) -> np.ndarray:
        """``enabled`` of those rows of these columns that take part in the step.

        Of what sleeps a contact that has been disabled wakes the two, and holds for one more step: a system that
        looks at velocities sees none of sleepers. The records hold the others.
        """
        enabled, stored = columns["enabled"], self.stored.columns
        if not len(self.stored):
            return enabled
        if self._asleep[0] is not columns or self._asleep[1] is not stored:  # of another time: after a failed step
            known = dict(zip(_pairs(stored), stored["enabled"].tolist(), strict=True))
            found = [known.get(pair) for pair in _pairs(columns)]
            mask = np.array([one is not None for one in found], bool)
            self._asleep = columns, stored, mask, np.array([one for one in found if one is not None], bool)
        _, _, asleep, before = self._asleep
        changed = np.flatnonzero(asleep)[enabled[asleep] != before]
        if len(changed):
            self._sleepers.disturb(np.concatenate((columns["entity_a"][changed], columns["entity_b"][changed])))
        return enabled[~asleep]

    def stay_columns(self) -> Columns:
        """The contacts that touched in the step before, too."""
        now = self._touching.now
        columns = self._rows(now, self._touching.stayed[now, : self._touching.stays[now]])
        if len(self.stored):
            stored = self._stored_rows()
            enabled = stored.pop("enabled")
            columns, _ = merged(columns, {name: column[enabled] for name, column in stored.items()})
        return columns

    def _stored_rows(self) -> Columns:
        """Copies of the contacts of what sleeps; they last."""
        columns = {name: column.copy() for name, column in self.stored.columns.items() if name != "rested"}
        columns["normal_impulse"] = columns.pop("impulse")
        return {**columns, "step": _repeated(self._state.step_number, len(self.stored))}

    def began(self) -> Columns:
        """The contacts that are new in this step."""
        contacts = self._touching
        return self._rows(contacts.now, contacts.began[: contacts.begins])

    def ended(self) -> Columns:
        """The contacts of the step before that are no more; point and normal are the last known."""
        contacts, count = self._touching, self._touching.ends
        columns = self._rows(1 - contacts.now, contacts.ended[:count])
        return {**columns, "step": _repeated(self._state.step_number, count), "normal_impulse": np.zeros(count)}

    def impacts(self) -> Columns:
        """The impacts of the step, in the order of their times."""
        state, columns, pairs = self._state, self._impacts.columns(), self._state.pairs.columns()
        count, entity = state.impacts.logged, state.bodies.entity
        pair = columns["log_pair"][:count]
        return {
            "entity_a": entity[pairs["a"][pair]],
            "entity_b": entity[pairs["b"][pair]],
            "point": columns["log_point"][:count].copy(),
            "normal": columns["log_normal"][:count].copy(),
            "depth": np.zeros(count),
            "normal_impulse": columns["log_impulse"][:count].copy(),
            "step": _repeated(state.step_number, count),
            "time_of_impact": columns["log_time"][:count].copy(),
        }

    def record_waiting(self) -> None:
        """Add what has begun, ended and bounced in the last step to the histories, unless that is done."""
        if self._impacts.logged and not self._state.impacts_recorded:
            self._state.impacts_recorded = True
            self.record("impacts", self.impacts())
        if self._state.event_count:
            self._state.event_count = 0
            if self._touching.begins:
                self.record("begin", self.began())
            if self._touching.ends:
                self.record("end", self.ended())

    def points(self, columns: Columns) -> Columns:
        """The same contacts, a row for each of their points, with its place in the columns; those of a pair of which
        the solver knows none are as they are, and where entity_a is no more."""
        self._refresh()
        state, memory, now = self._state, self._state.warm_start, self._state.warm_start.now
        count = int(memory.counts[now]) if state.spinning else 0
        entity_a, entity_b = memory.entity_a[now, :count], memory.entity_b[now, :count]
        place = {pair: row for row, pair in enumerate(_pairs(columns))}
        found = zip(entity_a.tolist(), entity_b.tolist(), strict=True)
        rows = np.array([place.get(pair, -1) for pair in found], np.int64)
        first, second = self._table.rows_of(entity_a), self._table.rows_of(entity_b)
        known, alone = (rows >= 0) & (first >= 0), np.ones(len(columns["entity_a"]), bool)
        alone[rows[known]] = False
        first, second = first[known], np.where(second < 0, first, second)[known]
        rows, impulse = rows[known], memory.total[now, :count][known]
        point = led_to_end(state.bodies, first, second, memory.place[now, :count][known], columns["normal"][rows])
        # What impacts have given, which have no points here, is that of the nearest one to the contact's.
        rest = columns["normal_impulse"] - np.bincount(rows, impulse, len(alone))
        order = np.lexsort((np.linalg.norm(point - columns["point"][rows], axis=1), rows))
        pairs, nearest = np.unique(rows[order], return_index=True)
        impulse[order[nearest]] += np.maximum(rest[pairs], 0.0)
        row = np.concatenate((rows, np.flatnonzero(alone)))
        sort = np.argsort(row, kind="stable")
        return {
            **{name: columns[name][row[sort]] for name in ("entity_a", "entity_b", "normal", "depth", "step")},
            "point": np.concatenate((point, columns["point"][alone]))[sort],
            "normal_impulse": np.concatenate((impulse, columns["normal_impulse"][alone]))[sort],
            "contact": row[sort],
        }

    def _rows(self, slot: int, rows: Any) -> Columns:
        """Copies of some contacts."""
        columns = self._touching.columns()
        found = {name: columns[name][slot][rows].copy() for name in TOLD}
        found["normal_impulse"] = found.pop("impulse")
        return {**found, "step": _repeated(columns["steps"][slot], len(found["depth"]))}

    def _found(self) -> Columns:
        self._program.run_one("finish_found", self._clock.dt)
        state, pairs, bodies = self._state, self._state.pairs, self._state.bodies
        hits, entity = pairs.hits[: pairs.found], bodies.entity
        a = pairs.a[hits]
        return {
            "entity_a": entity[a],
            "entity_b": entity[pairs.b[hits]],
            "point": bodies.position[a] + bodies.offset[a] + pairs.point[hits],
            "normal": pairs.normal[hits],
            "depth": pairs.depth[hits],
            "normal_impulse": np.zeros(len(hits)),
            "step": _repeated(state.step_number, len(hits)),
            "enabled": ~pairs.disabled[hits],
        }


def _pairs(columns: Columns) -> Iterator[tuple[int, int]]:
    return zip(columns["entity_a"].tolist(), columns["entity_b"].tolist(), strict=True)


def led_to_end(bodies: Record, a: np.ndarray, b: np.ndarray, place: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """(n, d) m, points of contacts where the step ends. bodies: of the records; a, b: (n,) rows of the two; place:
    (n, d) from the centre of a's shape, as the two stand to each other where the step starts; normal: (n, d).

    A point is a corner of one of the two, which slides on the other: it goes with the one whose side is nearer. Along
    the normal it stays in the middle of the gap.
    """
    start, end, offset, half = bodies.previous_position, bodies.position, bodies.offset, bodies.half_extents
    way_a, way_b, point = end[a] - start[a], end[b] - start[b], place + start[a] + offset[a]
    nearing = np.sum((way_b - way_a) * normal, axis=1)[:, None] * normal
    slide = np.abs(way_b - way_a - nearing)
    sideways = slide > SIDEWAYS * np.linalg.norm(slide, axis=1)[:, None]
    side_a, side_b = (
        np.where(sideways, half[i] - np.abs(point - start[i] - offset[i]), np.inf).min(axis=1) for i in (a, b)
    )
    return point + np.where((side_a <= side_b)[:, None], way_a + 0.5 * nearing, way_b - 0.5 * nearing)


def _repeated(number: int, count: int) -> np.ndarray:
    column = np.empty(count, np.int64)
    column[:] = number
    return column


def disabled_pairs(state: Record, contacts: Contacts) -> np.ndarray:
    """The pairs found by the narrow phase whose contact a system has disabled; noted in the state too."""
    pairs, enabled = state.pairs, contacts.enabled_now()
    if not state.found_current or enabled is None or enabled.all():
        return np.empty(0, np.int64)
    disabled = pairs.hits[: pairs.found][~enabled]
    pairs.disabled[disabled] = True
    pairs.disabled_count = int(pairs.disabled[: pairs.count].sum())
    return disabled


class ContactEvents(StagedSystem):
    """Compares the pairs that touch with those of the step before; an end is always delivered.

    In a step without the built-in response these are the pairs that the narrow phase has found.

    Reads the contacts; writes ``contacts.begin``, ``stay``, ``end``; calls the handlers of contact_begin,
    contact_stay, contact_end and impact, in canonical order.
    """

    phase = Phase.RESPONSE
    STAGES = (
        Stage(
            compare_contacts, "contacts of this step and the last", ("contacts",), ("contacts",), "contacts",
            "bodies touch, or did", ROOM_FOR_FOUND,
        ),
    )  # fmt: skip

    def __init__(
        self, program: Program, source: RecordedContacts, contacts: Contacts,
        membership: Callable[[], Membership], world: World,
    ) -> None:  # fmt: skip
        super().__init__(program)
        self._state, self._source, self._contacts = program.state, source, contacts
        self._impacts = program.state.impacts
        self._membership, self._world = membership, world
        source.record = contacts.record

    def _parts(self) -> list[Any]:
        state = self._state
        if not state.others_write:  # nor has any event a handler
            return [self.segment()]
        report = Check(state.words, state.word_of("event_count"), PythonPart(self.name, self._report))
        return [PythonPart(self.name, self._take_disabled), self.segment(), report]

    def _take_disabled(self, dt: float) -> None:
        """Contacts that a system has disabled after RESPONSE count as not touching."""
        if self._state.found_current:  # no response has run
            disabled_pairs(self._state, self._contacts)
            return
        enabled, contacts = self._contacts.enabled_now(), self._state.contacts
        if enabled is not None:
            contacts.enabled[contacts.now, : len(enabled)] = enabled

    def _may_meet_any(self, row: int) -> bool:
        """Whether layers, groups and joints let a body meet any other one."""
        state, bodies, joints, there = self._state, self._state.bodies, self._state.solver.joints, self._state.count
        near, slot, rows = bodies.shape[:there] >= 0, bodies.collider_slot[:there], np.arange(there)
        kept = {name: getattr(state.colliders, name) for name in MEETING}
        if any(map(len, kept.values())):
            layers, masks, groups = (
                column[slot, rows] if len(column) else np.full(there, COLLIDERS.fields[name].default)
                for name, column in kept.items()
            )
            near &= (layers & masks[row] != 0) & (masks & layers[row] != 0) & ((groups != groups[row]) | (groups == 0))
        owner = bodies.owner[:there] if state.has_parts else rows
        a, b, own = joints.apart_a[: joints.apart], joints.apart_b[: joints.apart], bodies.entity[owner[row]]
        apart = np.concatenate((b[a == own], a[b == own]))
        if not state.has_parts and np.count_nonzero(near) > len(apart) + 1:
            return True  # most worlds, and this is asked in each step
        return not np.isin(bodies.entity[owner[near & (owner != owner[row])]], apart).all()

    def report_faults(self, dt: float) -> None:
        """Note what has gone wrong in the step of ``dt``, s."""
        state, impacts, solver = self._state, self._impacts, self._state.solver
        entity, faults, faulty = state.bodies.entity, solver.faults, solver.faulty
        if state.too_fast_for_discrete and self._may_meet_any(state.too_fast_row):
            fast = int(entity[state.too_fast_row])
            self.world.report_fault(
                f"entity {fast}: so fast that discrete collisions may miss what it passes: set its ccd, or "
                f"Settings.collision = 'continuous', or use smaller steps",
                kind="too fast", entity=fast,
            )  # fmt: skip
        if state.turns_too_far:
            turned = int(entity[state.turns_too_far - 1])
            self.world.report_fault(
                f"entity {turned}: turns so far in a step that it may pass others unseen: turn it slower, or use "
                f"smaller steps",
                kind="turns too far", entity=turned,
            )  # fmt: skip
        if faults[SQUEEZED]:
            self.world.report_fault(
                f"no room for {faults[SQUEEZED]} squeezed bodies, the first is entity "
                f"{entity[faulty[SQUEEZED]]}: stop earlier what squeezes them, or use masses that differ less",
                kind="squeezed",
            )
        if faults[OVERLOADED]:
            self.world.report_fault(
                f"{faults[OVERLOADED]} bodies are too heavy for what they lie on, the "
                f"first is entity {entity[faulty[OVERLOADED]]}: their contacts take them as lighter; use masses "
                f"that differ less, or smaller steps",
                kind="overloaded",
            )
        if faults[RESTRAINED]:
            self.world.report_fault(
                f"contacts of {faults[RESTRAINED]} islands would have given them much "
                f"energy, and were held back, the first with entity {entity[faulty[RESTRAINED]]}: use smaller "
                f"steps, more substeps, or masses that differ less",
                kind="restrained",
            )
        if faults[TORN_OPEN]:
            torn = int(faulty[TORN_OPEN])
            self.world.report_fault(
                f"{faults[TORN_OPEN]} joints are torn open by more than a tenth of the size of a body, the first is "
                f"entity {torn}: use more substeps, smaller steps, or less force and speed",
                kind="torn", entity=torn,
            )  # fmt: skip
        if impacts.halted:
            self.world.report_fault(
                f"too many impacts for a step: {impacts.halted} bodies stood still for "
                f"the rest of it, the first is entity {entity[impacts.halted_row]}: use smaller steps",
                kind="halted",
            )
        if impacts.capped:
            self.world.report_fault(
                f"{impacts.capped} impacts beyond {self._world.settings.max_impacts_per_step} "
                f"of a body in one step, the first of entity {entity[impacts.capped_row]}: raise "
                f"Settings.max_impacts_per_step or restitution_threshold, or use smaller steps; the rest was solved as "
                f"contact at rest",
                kind="impacts",
            )

    def _report(self, dt: float) -> None:
        """Note it and call the handlers."""
        self.report_faults(dt)
        source, events = self._source, self.world.events
        source.record_waiting()
        begin = source.began() if events.wanted("contact_begin") else None
        end = source.ended() if events.wanted("contact_end") else None
        stay = source.stay_columns() if events.wanted("contact_stay") else None
        impacts = source.impacts() if events.wanted("impact") else None
        for columns, event in zip((begin, stay, end, impacts), CONTACT_EVENTS, strict=True):
            if columns is not None and len(columns["entity_a"]) and events.wanted(event):
                events.dispatch_many(event, ContactRows(columns, self._membership))

    def reason(self) -> str:
        if not self._state.collides:
            return "no colliders: nothing to do"
        wanted = [event for event in CONTACT_EVENTS if self.world.events.wanted(event)]
        return f"handlers of {', '.join(wanted)}" if wanted else "begin, stay, end; no event has a handler"
