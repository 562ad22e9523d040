"""The Python side of sleeping: which bodies fall asleep and wake, in the few steps in which that changes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ...framework.data.arrays.column import ArrayColumn
from ...framework.data.table import Table
from ...framework.jit.records.record import Record
from ...framework.schedule.stages import Program
from ..contacts.solving.records import WARM_START_ROWS
from ..double_buffers import CONTACT_NUMBERS as CONTACT_NUMBERS
from ..double_buffers import WARM_START_NUMBERS, put_rows_back, saved_rows
from ..records import CONTACT_ROWS, SLEEP_COLUMNS, SLEEPING
from ..scene import ZERO_WHERE_STATIC, Scene
from .exposed_columns import ExposedColumns
from .stages import ASLEEP, AWAKE, FALLING_ASLEEP, WAKING
from .stored import CONTACT_COLUMNS, IMPULSE_COLUMNS, Stored, links_with_falling

PUSH_COLUMNS = ("applied_force", "applied_frame", "step_force")
PATH_COLUMNS = ("origin", "path_velocity", "path_second", "path_third")


class Sleepers:
    """Which bodies sleep in one world.

    contacts, impulses
        of pairs of which both bodies are still
    links
        (k, 2) what cannot be moved, by entity id, and the island that rests on it
    sizes
        (k, 2) islands and how many bodies they have
    """

    def __init__(
        self, state: Record, table: Table, scene: Scene, program: Program, box_now: Callable[[], None]
    ) -> None:
        self._state, self._table, self._scene, self._program = state, table, scene, program
        self._exposed = ExposedColumns(table, scene)
        self._disturbed = False  # some are marked, or may be
        self._pushed = False
        self._still_count = -1  # with what cannot move, when the contacts were kept
        self._placed: Any = None  # rows and arrays in which sleepers are as what does not move
        self.contacts = Stored(state.contacts, CONTACT_COLUMNS, CONTACT_ROWS)
        self.impulses = Stored(state.warm_start, IMPULSE_COLUMNS, WARM_START_ROWS)
        self._dt = 1.0  # s, of the step that the impulses are of
        self.links = self.sizes = np.empty((0, 2), np.int64)
        self.followed: Any = None  # the structure that all this is of,
        self.before: Any = None  # and what it was of before this step
        self._seen = -1
        self._box_now = box_now  # makes the boxes of all bodies where they are at this moment
        self._changes: list[list[float]] = []  # boxes in which shapes have changed: what sleeps near them wakes
        self._changes_taken: list[list[float]] = []  # those that this step has begun with
        self.on = False  # the settings say so, or those that sleep have to wake because they do not any more
        self._all_wake = False
        self.kept: Any = None  # before this step
        self._words = state.words
        self._due, self._asleep, self._fresh = (state.word_of(n) for n in ("due", "asleep", "fresh_statics"))
        self._pushing = state.word_of("pushed")

    # -- settings ---------------------------------------------------------------------------------

    def take_settings(self, sleeping: bool) -> None:
        """Other settings change how bodies fly and rest."""
        if sleeping or self._state.asleep or self._state.due:
            self._all_wake = True
        self._state.sleeping, self.on = sleeping, sleeping or self._all_wake
        self._table.on_written = self._mark_row if self.on else None
        if sleeping:
            for name in SLEEP_COLUMNS:
                self._table.make(f"_{name}")

    # -- a step -----------------------------------------------------------------------------------

    def begin_step(self) -> None:
        """The scene is up to date: follow bodies that have come or gone, and let those fall asleep that are due."""
        words, state, table = self._words, self._state, self._table
        if self._all_wake:
            self._wake_all()
            self._all_wake = False
        fresh, seen = False, self._versions()
        if seen != self._seen:
            self._scene.reserve(*SLEEPING)
            structure = self._structure()
            if structure != self.followed:
                self._follow(structure)
            self._seen = seen
            fresh = bool(words[self._asleep]) and (self._still()[table.stops[1] :] == AWAKE).any()
        self._changes_taken, self._changes = self._changes, []
        if words[self._due] or (words[self._asleep] and words[self._fresh]):
            self._fall_asleep(table.stops[1])
        if words[self._asleep]:
            self._mark(self._exposed.changed())
            if self._changes_taken:
                self._disturb_near(np.array(self._changes_taken))
        quiet = not self._disturbed and not fresh and state.asleep == table.blocks[0]
        state.pushes = self._pushed or words[self._pushing] or not table.exposed.keys().isdisjoint(PUSH_COLUMNS)
        self._disturbed = self._pushed = False
        self._leave_out(table.blocks[0] if quiet else 0)

    def end_step(self) -> None:
        """Note what those stand on that fall asleep; what sleeps stands in rows of its own."""
        state, table = self._state, self._table
        self.kept, self._changes_taken = None, []
        if state.due < 0:
            self._all_wake, state.due = True, 0
        elif self._words[self._due]:
            self.followed = self._structure()
            self.links = links_with_falling(state, self.links)
        if state.due or (state.first == 0 and (state.asleep or table.blocks[0])):
            table.group_sleepers(self._still()[: table.stops[0]] == ASLEEP)
            self.followed = self._structure()
            self._exposed.take(np.flatnonzero(self._still() > AWAKE))
        self.on = state.sleeping or self._all_wake
        table.on_written = self._mark_row if self.on else None

    def _leave_out(self, rows: int) -> None:
        """That many rows take no part in the step; they are to others as what does not move."""
        state, bodies = self._state, self._state.bodies
        placed = rows, self._scene.version
        if placed == self._placed:
            return
        self._placed = placed
        state.support_version = state.impacts.swept_version = -1
        if rows != state.first:
            state.first = rows
            state.statics_version += 1
            state.motion_version += 1
        for name in ZERO_WHERE_STATIC if rows else ():
            getattr(bodies, name)[:rows] = 0
        if rows:
            bodies.force_speed_change[:rows] = np.linalg.norm(bodies.flown_velocity[:rows], axis=1)

    def _rejoin_step(self) -> None:
        """Within a step: all take part in what is left of it."""
        state, bodies, rows = self._state, self._state.bodies, self._state.first
        if not rows:
            return
        self._leave_out(0)
        state.force_first, state.all_still = 0, False
        bodies.trapped_impacts[:rows], bodies.last_impact[:rows] = 0, -1.0

    def look(self) -> None:
        """Code of the game has run within the step, before the flight."""
        self._mark(self._exposed.changed())
        if self._state.first and (self._still() == WAKING).any():
            self._rejoin_step()

    def _versions(self) -> int:
        """Another number whenever rows, their components, static bodies or arrays may be others."""
        table = self._table
        return table.version + table.members_version + table.static_version + table.columns_version  # these only grow

    def _structure(self) -> tuple[int, ...]:
        table = self._table
        return table.version, table.members_version, table.static_version, table.generation

    def _follow(self, structure: tuple[int, ...]) -> None:
        """Bodies have come, gone or changed: what was about to sleep does not; islands that miss something wake."""
        before, self.followed = self.followed, structure
        if self._state.due:
            self._keep()
            falling = np.flatnonzero(self._still() == FALLING_ASLEEP)
            self._state.bodies.sleep_state[falling] = AWAKE
            self._state.bodies.rest_steps[falling] = 0
            self._state.due = 0
        if not self._state.asleep:
            return
        self._keep()
        table, links = self._table, self.links
        islands = [links[table.rows_of(links[:, 0]) < 0, 1]]
        now = self._islands()
        if len(now) != self._state.asleep:  # some have gone: of which islands?
            known, sizes = self.sizes.T
            islands.append(known[np.bincount(known.searchsorted(now), minlength=len(known))[: len(known)] != sizes])
        if not self._state.collides or (before is not None and before[3] != structure[3]):  # ids mean other entities
            islands.append(now)
        if any(map(len, islands)) or np.count_nonzero(self._still() > AWAKE) != self._still_count:
            self._wake(np.concatenate(islands))

    def _fall_asleep(self, moving: int) -> None:
        """What is due is still from now on; so is all that cannot move."""
        self._keep()
        state, table, bodies = self._state, self._table, self._state.bodies
        bodies.sleep_state[moving : table.count] = ASLEEP
        state.due = state.fresh_statics = 0
        self._exchange()

    # -- waking -----------------------------------------------------------------------------------

    def wake(self, entity: int) -> None:
        """Its island is awake from the next step on; KeyError if it is no body."""
        self._table.find(entity)
        self.disturb(np.array([entity], np.int64))

    def disturb(self, entities: np.ndarray) -> None:
        """The islands of those that sleep are awake from the next step on."""
        rows = self._table.rows_of(entities)
        self._mark(rows[(rows >= 0) & (rows < self._table.stops[0])])

    def _mark(self, rows: np.ndarray) -> None:
        """What is still in these rows is disturbed."""
        still = self._table.arrays.get("_sleep_state")
        if still is None or not len(rows) or not len(rows := rows[still[rows] > AWAKE]):
            return
        still[rows] = WAKING
        self._disturbed = True
        if self._table.in_step and self._state.moved:  # they look for others already
            self._rejoin_step()

    def _mark_row(self, row: int, key: str, value: Any) -> None:
        """Code of the game writes to that row. A push that is the same in each step wakes nothing, nor does a value
        that it has."""
        if key in PUSH_COLUMNS:
            self._pushed = True
            return
        still = self._table.arrays.get("_sleep_state")
        if still is not None and still.item(row) > AWAKE and (key == "" or self._table.is_other(key, row, value)):
            still[row], self._disturbed = WAKING, True

    def watch(self, key: str) -> None:
        """Code of the game may write that column in place from now on."""
        self._exposed.add(key)

    def follow_change(self, column: ArrayColumn, row: int, before: int, inside: np.ndarray) -> None:
        """The shape of a row has changed inside of these boxes: that disturbs nothing farther away."""
        if not self.on:
            return
        table = self._table
        if row < table.stops[0]:
            self.disturb(table.column("entity")[row : row + 1])
        place = table.column("position")[row]
        self._changes += (inside + np.concatenate((place, place))).tolist()
        self._exposed.replace(column.key, row)

    def _disturb_near(self, changes: np.ndarray) -> None:
        """Wake what sleeps in these boxes or touches them."""
        state, bodies = self._state, self._state.bodies
        known_until = state.neighbours_known_until
        self._box_now()
        state.neighbours_known_until = known_until
        d, rows = state.dimensions, np.flatnonzero(bodies.sleep_state[: self._table.stops[0]] > AWAKE)
        lower, upper = bodies.lower[rows, None], bodies.upper[rows, None]
        near = ((lower <= changes[:, d:]) & (upper >= changes[:, :d])).all(axis=2).any(axis=1)
        if near.any():
            self._keep()
            self.disturb(bodies.entity[rows[near]])

    def wake_disturbed(self) -> np.ndarray:
        """Those that are marked, and their islands; returns the rows of the dynamic ones."""
        self._keep()
        bodies = self._state.bodies
        rows = np.flatnonzero(self._still() == WAKING)
        standing = self.links[np.isin(self.links[:, 0], bodies.entity[rows]), 1]
        bodies.sleep_state[rows], bodies.rest_steps[rows] = AWAKE, 0
        return self._wake(np.concatenate((bodies.island[rows], standing)), rows)

    def wake_touched(self, simulation: Any, dt: float) -> None:
        """An awake body has come near: the islands have the flight that they were spared, and their pairs."""
        self._rejoin_step()
        rows = self.wake_disturbed()
        if self._state.moved:
            self._apply_flight(rows, dt)
        simulation.broad_phase.process(dt)
        simulation.narrow_phase.process(dt)

    def wake_candidates(self, dt: float) -> bool:
        """In the middle of a step candidates are others: wake what meets the box of an awake body. Whether any does."""
        state, still = self._state, self._state.bodies.sleep_state
        if not state.sleeping or not state.asleep:
            return False
        candidates = state.candidates
        rows = np.concatenate((candidates.first[: candidates.count], candidates.second[: candidates.count]))
        rows = rows[(rows < state.dynamic) & (still[rows] > AWAKE)]
        if not len(rows):
            return False
        still[rows] = WAKING
        joins = state.first > 0
        self._rejoin_step()
        self._apply_flight(self.wake_disturbed(), dt)
        if joins:
            self._program.run_one("box_rest_of_step", dt)
        return True

    def _apply_flight(self, rows: np.ndarray, dt: float) -> None:
        """The free flight of this step, which is that of all steps, and its path; the paths of others stay."""
        bodies, moving = self._state.bodies, self._state.moving
        kept = {name: column[:moving].copy() for name in PATH_COLUMNS if len(column := getattr(bodies, name))}
        bodies.position[rows], bodies.linear_velocity[rows] = bodies.flown_position[rows], bodies.flown_velocity[rows]
        if self._state.flies:
            bodies.flight_velocity[rows], bodies.acceleration[rows] = 0.0, 0.5 * bodies.flown_velocity[rows] / dt
        self._program.run_one("note_path", dt)
        others = np.ones(moving, bool)
        others[rows] = False
        for name, column in kept.items():
            getattr(bodies, name)[:moving][others] = column[others]

    def _wake_all(self) -> None:
        """All of them, without their flight."""
        self._keep()
        bodies = self._state.bodies
        if len(bodies.sleep_state):
            self._still()[:] = AWAKE
            bodies.rest_steps[: self._table.count] = 0
        self._state.due = self._state.fresh_statics = 0
        self.links = self.links[:0]
        self._exchange()

    def _wake(self, islands: np.ndarray, disturbed: Any = ()) -> np.ndarray:
        """These islands are awake; returns the rows of their bodies, and of dynamic ones that are ``disturbed``."""
        bodies, dynamic = self._state.bodies, self._table.stops[0]
        islands = np.unique(islands[islands != 0])
        asleep = bodies.sleep_state[:dynamic] > AWAKE
        rows = np.flatnonzero(asleep & np.isin(bodies.island[:dynamic], islands))
        bodies.sleep_state[rows], bodies.rest_steps[rows] = AWAKE, 0
        self.links = self.links[~np.isin(self.links[:, 1], islands)]
        self._exchange()
        alone = np.asarray(disturbed, np.int64)
        return np.union1d(rows, alone[alone < dynamic])

    # -- contacts and impulses --------------------------------------------------------------------

    def _exchange(self) -> None:
        """The pairs of which both are still are kept here, the others in the records; if nothing sleeps, nothing is."""
        state, memory, still = self._state, self._state.warm_start, self._still()
        state.asleep = int(np.count_nonzero(still[: self._table.stops[0]] > AWAKE))
        if not state.asleep:
            state.bodies.rest_steps[: len(still)][still == WAKING] = 0  # woken before it fell asleep
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
        self._still_count = np.count_nonzero(still > AWAKE)
        ids, sizes = np.unique(self._islands(), return_counts=True)
        self.sizes = np.stack((ids, sizes), axis=1)

    def _scale(self, dt: float) -> None:
        """The impulses that belong to steps of that length."""
        columns, by = self.impulses.columns, dt / self._dt
        self._dt = dt
        self.impulses.columns = {**columns, **{name: columns[name] * by for name in ("impulse", "tangent", "total")}}

    def _both_still(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        still, table = self._still(), self._table
        if not len(still):
            return np.zeros(len(a), bool)
        one, other = table.rows_of(a), table.rows_of(b)
        return (one >= 0) & (other >= 0) & (still[one] > AWAKE) & (still[other] > AWAKE)

    def _still(self) -> np.ndarray:
        return self._state.bodies.sleep_state[: self._table.count]

    def _islands(self) -> np.ndarray:
        """The island of each sleeper."""
        bodies, dynamic = self._state.bodies, self._table.stops[0]
        return bodies.island[:dynamic][bodies.sleep_state[:dynamic] > AWAKE]

    # -- a step that fails, snapshots -------------------------------------------------------------

    def _keep(self) -> None:
        """What a failed step puts back, before the first change in it."""
        if self.kept is None:
            state, bodies, count = self._state, self._state.bodies, self._table.count
            names = [name for name in ("sleep_state", "rest_steps", "island") if len(getattr(bodies, name))]
            self.kept = (
                {name: getattr(bodies, name)[:count].copy() for name in names},
                self._saved_parts(), self._all_wake,
                saved_rows(state.warm_start, WARM_START_NUMBERS), saved_rows(state.contacts, CONTACT_NUMBERS),
            )  # fmt: skip

    def abandon_step(self) -> None:
        """Back to the start of the step; the records show the contacts and impulses of that time."""
        self._changes, self._changes_taken = self._changes_taken, []
        state, bodies, left_out = self._state, self._state.bodies, slice(0, self._state.kept_first)
        self._disturbed = True
        if state.first < state.kept_first and not state.others_write:  # woken within the step
            bodies.position[left_out] = bodies.previous_position[left_out] = bodies.rest_position[left_out]
            bodies.linear_velocity[left_out] = 0.0
        # Static bodies are to be read again, but none has gone; who had when the step began is followed once more.
        self.followed = self._structure() if self.before == self.followed else self.before
        if self.kept is None:
            return
        (columns, parts, all_wake, impulses, contacts), self.kept, self._seen = self.kept, None, -1
        self._all_wake = self.on = self._all_wake or all_wake
        self.on |= state.sleeping
        for name, column in columns.items():
            getattr(bodies, name)[: len(column)] = column
        self._take_parts(parts)
        put_rows_back(state.warm_start, WARM_START_ROWS, impulses)
        put_rows_back(state.contacts, CONTACT_ROWS, contacts)
        state.warm_start.rows_version[:] = -1

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

    def notice_written(self) -> None:
        """What code of the game has written into since the last step wakes."""
        if self.on:
            self._mark(self._exposed.changed())

    def saved(self) -> dict[str, Any] | None:
        """For snapshots; also whether bodies have come or gone since the last step, and whether all wake."""
        if not self.on:
            return None
        self.notice_written()
        followed = self._structure() == self.followed
        more = {"changes": list(self._changes)} if self._changes else {}
        seen = self._versions() == self._seen
        return {**self._saved_parts(), "followed": followed, "seen": seen, "all_wake": self._all_wake, **more}

    def take_back(self, saved: Any) -> None:
        """The table is what it was then; if this world does not sleep, all of them wake."""
        state = self._state
        self.kept, self.followed, self._seen = None, None, -1
        self._leave_out(0)
        self._placed, self._disturbed, self._pushed = None, bool((self._still() == WAKING).any()), True
        self._exposed.take(np.flatnonzero(self._still() > AWAKE))
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
            self.followed = self._structure()
        if saved["seen"]:
            self._scene.reserve(*SLEEPING)
            self._seen = self._versions()
