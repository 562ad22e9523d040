"""The Python side of sleeping: which bodies fall asleep and wake, in the few steps in which that changes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ...framework.data.arrays.column import ArrayColumn
from ...framework.data.table import Table
from ...framework.jit.records.record import Record
from ...framework.schedule.stages import Program
from ..broad_phase.active_rows import ALL
from ..record_buffers import Room
from ..records import SLEEP_COLUMNS, SLEEPING
from ..scene import Scene
from ..tracking import CONTACTS as CONTACT_NUMBERS
from ..tracking import WARM_START, put_rows_back, saved_rows
from .stages import AWAKE, DISTURBED, FALLING, STILL
from .stored import CONTACTS, IMPULSES, Stored
from .watching import Watching

PATH = ("origin", "path_velocity", "path_second", "path_third")


def add_columns(table: Table) -> None:
    """The columns that move with the rows; none of them has an array before something sleeps."""
    for name, column in SLEEP_COLUMNS.fields.items():
        table.add_array(f"_{name}", column.item, dtype=column.dtype, on_demand=True)


class Sleepers:
    """Which bodies sleep in one world.

    contacts, impulses
        of pairs of which both bodies are still
    links
        (k, 2) what cannot be moved, by entity id, and the island that rests on it
    sizes
        (k, 2) islands and how many bodies they have
    """

    def __init__(self, state: Record, table: Table, scene: Scene, program: Program, room: Room) -> None:
        self._state, self._table, self._scene, self._program = state, table, scene, program
        self._watching = Watching(state, table, scene)
        self.contacts = Stored(state.contacts, CONTACTS, room.reserve_contacts)
        self.impulses = Stored(state.warm_start, IMPULSES, room.reserve_warm_start)
        self._dt = 1.0  # s, of the step that the impulses are of
        self.links = self.sizes = np.empty((0, 2), np.int64)
        self._followed: Any = None  # the structure that all this is of
        self._seen = -1
        self.box_now: Callable[[], None] = lambda: None  # makes the boxes of all bodies where they are at this moment
        self._changes: list[list[float]] = []  # boxes in which shapes have changed: what sleeps near them wakes
        self._changes_taken: list[list[float]] = []  # those that this step has begun with
        self.on = False  # the settings say so, or those that sleep have to wake because they do not any more
        self._all_wake = False
        self.kept: Any = None  # before this step
        self._words = state.words
        self._due, self._asleep, self._fresh = (state.word_of(n) for n in ("due", "asleep", "fresh_statics"))

    # -- settings ---------------------------------------------------------------------------------

    def take_settings(self, sleeping: bool) -> None:
        """Other settings change how bodies fly and rest."""
        if sleeping or self._state.asleep or self._state.due:
            self._all_wake = True
        self._state.sleeping, self.on = sleeping, sleeping or self._all_wake
        if sleeping:
            for name in SLEEP_COLUMNS:
                self._table.make(f"_{name}")

    # -- a step -----------------------------------------------------------------------------------

    def begin_step(self) -> None:
        """The scene is up to date: follow bodies that have come or gone, and let those fall asleep that are due."""
        words, table = self._words, self._table
        if self._all_wake:
            self._wake_all()
            self._all_wake = False
        seen = table.version + table.members_version + table.static_version + table.columns_version  # these only grow
        if seen != self._seen:
            self._scene.reserve(*SLEEPING)
            self._watching.bind()
            structure = self._structure()
            if structure != self._followed:
                self._follow(structure)
            self._seen = seen
        self._changes_taken, self._changes = self._changes, []
        if words[self._due] or (words[self._asleep] and words[self._fresh]):
            self._fall_asleep(table.stops[1])
        if self._changes_taken and words[self._asleep]:
            self._disturb_near(np.array(self._changes_taken))

    def end_step(self) -> None:
        """Note what those stand on that fall asleep; nothing may change until the next step."""
        self.kept, self._changes_taken = None, []
        if self._state.due < 0:
            self._all_wake, self._state.due = True, 0
        elif self._words[self._due]:
            self._followed = self._structure()
            self._note_links()
        self.on = self._state.sleeping or self._all_wake

    def _structure(self) -> tuple[int, ...]:
        table = self._table
        return table.version, table.members_version, table.static_version, table.generation

    def _follow(self, structure: tuple[int, ...]) -> None:
        """Bodies have come, gone or changed: what was about to sleep does not; islands that miss something wake."""
        before, self._followed = self._followed, structure
        if self._state.due:
            self._keep()
            falling = np.flatnonzero(self._still() == FALLING)
            self._state.bodies.still[falling] = AWAKE
            self._state.bodies.rest_steps[falling] = 0
            self._state.due = 0
        if not self._state.asleep:
            return
        self._keep()
        table, links = self._table, self.links
        islands = [links[table.rows_of(links[:, 0]) < 0, 1]] if len(links) else []
        ids, sizes = np.unique(self._islands(), return_counts=True)
        now = dict(zip(ids.tolist(), sizes.tolist(), strict=True))
        islands.append(np.array([i for i, size in self.sizes.tolist() if now.get(i) != size], np.int64))
        if not self._state.collides or (before is not None and before[3] != structure[3]):  # ids mean other entities
            islands.append(ids)
        self._wake(np.concatenate(islands))

    def _fall_asleep(self, moving: int) -> None:
        """What is due is still from now on; so is all that cannot move."""
        self._keep()
        state, table, bodies = self._state, self._table, self._state.bodies
        self._program.run_one("take_checksums", 0.0)
        fixed = slice(moving, table.count)
        bodies.still[fixed] = STILL
        bodies.watched[fixed], bodies.rest_position[fixed] = bodies.checksums[fixed], bodies.position[fixed]
        state.due = state.fresh_statics = 0
        self._exchange()

    def _note_links(self) -> None:
        state, bodies = self._state, self._state.bodies
        pairs, dynamic = state.pairs, state.dynamic
        near = pairs.near_contact[: pairs.count] & pairs.is_solid[: pairs.count]
        a, b = pairs.a[: pairs.count][near], pairs.b[: pairs.count][near]
        fixed, body = np.maximum(a, b), np.minimum(a, b)
        some = (fixed >= dynamic) & (body < dynamic)
        fixed, body = fixed[some], body[some]
        due = bodies.still[body] == FALLING
        found = set(zip(bodies.entity[fixed[due]].tolist(), bodies.island[body[due]].tolist(), strict=True))
        found |= set(map(tuple, self.links.tolist()))
        self.links = np.array(sorted(found), np.int64).reshape(-1, 2)

    # -- waking -----------------------------------------------------------------------------------

    def wake(self, entity: int) -> None:
        """Its island is awake from the next step on; KeyError if it is no body."""
        self._table.find(entity)
        self.disturb(np.array([entity], np.int64))

    def disturb(self, entities: np.ndarray) -> None:
        """The islands of those that sleep are awake from the next step on."""
        still, rows = self._table.arrays.get("_still"), self._table.rows_of(entities)
        if still is not None:
            rows = rows[(rows >= 0) & (rows < self._table.stops[0])]
            still[rows[still[rows] > AWAKE]] = DISTURBED
            self._state.candidates.active_count = ALL  # within a step they look for others already

    def follow_change(self, column: ArrayColumn, row: int, before: int, inside: np.ndarray) -> None:
        """The shape of a row has changed inside of these boxes: that disturbs nothing farther away."""
        if not self.on:
            return
        table, watched = self._table, self._state.bodies.watched
        if row < table.stops[0]:
            self.disturb(table.column("entity")[row : row + 1])
        place = table.column("position")[row]
        self._changes += (inside + np.concatenate((place, place))).tolist()
        bits = self._watching.follow_change(column, row, before)
        if len(watched):
            watched[row] ^= bits

    def _disturb_near(self, changes: np.ndarray) -> None:
        """Wake what sleeps in these boxes or touches them."""
        state, bodies = self._state, self._state.bodies
        known_until = state.neighbours_known_until
        self.box_now()
        state.neighbours_known_until = known_until
        d, rows = state.dimensions, np.flatnonzero(bodies.still[: self._table.stops[0]] > AWAKE)
        lower, upper = bodies.lower[rows, None], bodies.upper[rows, None]
        near = ((lower <= changes[:, d:]) & (upper >= changes[:, :d])).all(axis=2).any(axis=1)
        if near.any():
            self._keep()
            self.disturb(bodies.entity[rows[near]])

    def wake_disturbed(self, dt: float) -> np.ndarray:
        """Those that are marked, and their islands; returns the rows of the dynamic ones."""
        self._keep()
        state, bodies = self._state, self._state.bodies
        rows = np.flatnonzero(self._still() == DISTURBED)
        state.disturbed = 0
        standing = self.links[np.isin(self.links[:, 0], bodies.entity[rows]), 1]
        bodies.still[rows], bodies.rest_steps[rows] = AWAKE, 0
        return self._wake(np.concatenate((bodies.island[rows], standing)), rows)

    def wake_touched(self, simulation: Any, dt: float) -> None:
        """An awake body has come near: the islands have the flight that they were spared, and their pairs."""
        rows = self.wake_disturbed(dt)
        if self._state.moved:
            self._fly(rows, dt)
        simulation.broad_phase.process(dt)
        simulation.narrow_phase.process(dt)

    def wake_candidates(self, dt: float) -> bool:
        """In the middle of a step candidates are others: wake what meets the box of an awake body. Whether any does."""
        state, still = self._state, self._state.bodies.still
        if not state.sleeping or not state.asleep:
            return False
        candidates = state.candidates
        rows = np.concatenate((candidates.first[: candidates.count], candidates.second[: candidates.count]))
        rows = rows[(rows < state.dynamic) & (still[rows] > AWAKE)]
        if not len(rows):
            return False
        still[rows] = DISTURBED
        self._fly(self.wake_disturbed(dt), dt)
        return True

    def _fly(self, rows: np.ndarray, dt: float) -> None:
        """The free flight of this step, which is that of all steps, and its path; the paths of others stay."""
        bodies, moving = self._state.bodies, self._state.moving
        kept = {name: column[:moving].copy() for name in PATH if len(column := getattr(bodies, name))}
        bodies.position[rows], bodies.linear_velocity[rows] = bodies.flown_position[rows], bodies.flown_velocity[rows]
        self._program.run_one("note_path", dt)
        others = np.ones(moving, bool)
        others[rows] = False
        for name, column in kept.items():
            getattr(bodies, name)[:moving][others] = column[others]

    def _wake_all(self) -> None:
        """All of them, without their flight."""
        self._keep()
        bodies = self._state.bodies
        if len(bodies.still):
            self._still()[:] = AWAKE
            bodies.rest_steps[: self._table.count] = 0
        self._state.due = self._state.fresh_statics = 0
        self.links = self.links[:0]
        self._exchange()

    def _wake(self, islands: np.ndarray, disturbed: Any = ()) -> np.ndarray:
        """These islands are awake; returns the rows of their bodies, and of dynamic ones that are ``disturbed``."""
        bodies, dynamic = self._state.bodies, self._table.stops[0]
        islands = np.unique(islands[islands != 0])
        asleep = bodies.still[:dynamic] > AWAKE
        rows = np.flatnonzero(asleep & np.isin(bodies.island[:dynamic], islands))
        bodies.still[rows], bodies.rest_steps[rows] = AWAKE, 0
        self.links = self.links[~np.isin(self.links[:, 1], islands)]
        self._exchange()
        alone = np.asarray(disturbed, np.int64)
        return np.union1d(rows, alone[alone < dynamic])

    # -- contacts and impulses --------------------------------------------------------------------

    def _exchange(self) -> None:
        """The pairs of which both are still are kept here, the others in the records; if nothing sleeps, nothing is."""
        state, memory, still = self._state, self._state.warm_start, self._still()
        state.candidates.active_count = ALL  # in this step more are awake than were noted
        state.asleep = int(np.count_nonzero(still[: self._table.stops[0]] > AWAKE))
        if not state.asleep:
            state.bodies.rest_steps[: len(still)][still == DISTURBED] = 0  # woken before it fell asleep
            still[:] = AWAKE
            state.fresh_statics = 0
        now = memory.now
        dt = float(memory.step[now])
        if not len(self.impulses):
            self._dt = dt
        elif not memory.counts[now]:
            memory.step[now] = self._dt
        elif dt != self._dt:
            self._scale(dt)
        self.impulses.exchange(self._both_still)
        memory.rows_version[now] = -1
        self.contacts.exchange(self._both_still)
        state.contacts.stored = int(np.count_nonzero(self.contacts.columns["enabled"]))
        ids, sizes = np.unique(self._islands(), return_counts=True)
        self.sizes = np.stack((ids, sizes), axis=1)

    def _scale(self, dt: float) -> None:
        """The impulses that belong to steps of that length."""
        columns, by = self.impulses.columns, dt / self._dt
        self._dt = dt
        self.impulses.columns = {**columns, **{name: columns[name] * by for name in ("impulse", "tangent", "push")}}

    def _both_still(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        still, table = self._still(), self._table
        if not len(still):
            return np.zeros(len(a), bool)
        one, other = table.rows_of(a), table.rows_of(b)
        return (one >= 0) & (other >= 0) & (still[one] > AWAKE) & (still[other] > AWAKE)

    def _still(self) -> np.ndarray:
        return self._state.bodies.still[: self._table.count]

    def _islands(self) -> np.ndarray:
        """The island of each sleeper."""
        bodies, dynamic = self._state.bodies, self._table.stops[0]
        return bodies.island[:dynamic][bodies.still[:dynamic] > AWAKE]

    # -- a step that fails, snapshots -------------------------------------------------------------

    def _keep(self) -> None:
        """What a failed step puts back, before the first change in it."""
        if self.kept is None:
            state, bodies, count = self._state, self._state.bodies, self._table.count
            names = [name for name in ("still", "rest_steps", "island") if len(getattr(bodies, name))]
            self.kept = (
                {name: getattr(bodies, name)[:count].copy() for name in names},
                self._saved_parts(), self._followed, self._all_wake,
                saved_rows(state.warm_start, WARM_START), saved_rows(state.contacts, CONTACT_NUMBERS),
            )  # fmt: skip

    def abandon_step(self) -> None:
        """Back to the start of the step; the records show the contacts and impulses of that time."""
        self._changes, self._changes_taken = self._changes_taken, []
        if self.kept is None:
            return
        (columns, parts, self._followed, all_wake, impulses, contacts), self.kept, self._seen = self.kept, None, -1
        self._all_wake = self.on = self._all_wake or all_wake
        self.on |= self._state.sleeping
        for name, column in columns.items():
            getattr(self._state.bodies, name)[: len(column)] = column
        self._take_parts(parts)
        put_rows_back(self._state.warm_start, impulses)
        put_rows_back(self._state.contacts, contacts)
        self._state.warm_start.rows_version[:] = -1

    def _saved_parts(self) -> dict[str, Any]:
        state = self._state
        return {
            "contacts": self.contacts.saved(), "impulses": self.impulses.saved(), "links": self.links,
            "sizes": self.sizes, "dt": self._dt,
            "numbers": [state.asleep, state.due, state.fresh_statics, state.contacts.stored],
        }  # fmt: skip

    def _take_parts(self, parts: Any) -> None:
        state = self._state
        self.contacts.take_back(parts["contacts"])
        self.impulses.take_back(parts["impulses"])
        self.links, self.sizes = (np.array(parts[name], np.int64).reshape(-1, 2) for name in ("links", "sizes"))
        self._dt = parts["dt"]
        state.asleep, state.due, state.fresh_statics, state.contacts.stored = parts["numbers"]

    def saved(self) -> dict[str, Any] | None:
        """For snapshots; also whether bodies have come or gone since the last step, and whether all wake."""
        if not self.on:
            return None
        followed = self._structure() == self._followed
        more = {"changes": list(self._changes)} if self._changes else {}
        return {**self._saved_parts(), "followed": followed, "all_wake": self._all_wake, **more}

    def take_back(self, saved: Any) -> None:
        """The table is what it was then; if this world does not sleep, all of them wake."""
        state = self._state
        self.kept, self._followed, self._seen = None, None, -1
        state.watched_version = -1  # statics may have changed between that time and the step after it
        self._changes = [] if saved is None else list(saved.get("changes", ()))
        if saved is None:
            self.contacts.clear()
            self.impulses.clear()
            self.links = self.sizes = np.empty((0, 2), np.int64)
            state.asleep = state.due = state.fresh_statics = state.contacts.stored = 0
            return
        self._take_parts(saved)
        self._all_wake = saved["all_wake"] or not state.sleeping
        self.on = state.sleeping or self._all_wake
        if saved["followed"]:
            self._followed = self._structure()
