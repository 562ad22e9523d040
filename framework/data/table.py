"""The table of bodies: one row each, one array per field, rows in four blocks, [asleep, dynamic, kinematic, static],
in each by entity id.

The order of rows is a function of the ids and of what sleeps alone, so any history of creation and deletion that leads
to the same ids leads to the same rows, the same order of every sum, the same bits.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from .arrays.column import hold_arrays
from .arrays.pool import Held
from .columns import Column
from .component import Component, RowStore
from .row_moves import BLOCKS, NO_ROWS, MovedColumns, RowPlan, Rows
from .table_columns import TableColumns

KINDS = ("dynamic", "kinematic", "static")
DYNAMIC, KINEMATIC, STATIC = range(3)
KIND_OF_BLOCK = np.array((DYNAMIC, DYNAMIC, KINEMATIC, STATIC))
MANY = 200  # look-ups for which a table of all ids is worth its making
FEW = 4  # look-ups one by one take as long as one for all
HAS_OBJECTS = "has:objects"  # mask of the rows whose entity has a dict of components in esper


class Table(TableColumns):
    """Rows of all bodies of one world, and their columns. The first ``count`` rows are in use."""

    def __init__(self, dimensions: int) -> None:
        super().__init__(dimensions)
        self.clock: Any = None  # of the world
        self.version = 1  # changes whenever rows move
        self.turned: set[int] = set()  # kinematic bodies whose rotation was assigned, for what looks at that
        self.members_version = 0  # changes whenever a body gains or loses a component
        self.static_version = 0  # changes whenever a static body does
        self.blocks = (0,) * BLOCKS  # first row after those that sleep, the dynamic, kinematic and static bodies
        self.stops = self.blocks[1:]  # and without the first
        self.in_step = False
        self.generation = 0  # counts esper.clear_database(): after it, ids mean other entities
        self.frame = 0  # counts the calls of step() and advance()
        self.kind_changed = False
        self._types: dict[int, list[type[Component]]] = {}
        self._types_version: Any = None
        self._by_id, self._by_id_version = np.empty(0, np.int64), -1
        self._next_row = 0  # after the one that was looked up last
        # called with what code of the game writes to a row, before it is; None: its components are others
        self.on_written: Callable[[int, str, Any], None] | None = None
        self.before_rows_move: Callable[[], None] = lambda: None  # for what has noted rows, and reads them later
        self.on_rows_moved: Callable[[RowPlan], None] = lambda plan: None
        self.on_arrays_changed: Callable[[], None] = lambda: None  # called when a row has got another array
        self.on_changed_inside: Callable[[Any, int, int, np.ndarray], None] = lambda *_: None  # see changed_inside
        self.driven = False  # whether a body stops at the end of a step, see driven.py
        self.has_flown: Callable[[], bool] = lambda: False  # whether this step has moved the bodies already
        self.forces_are_summed: Callable[[], bool] = lambda: False  # whether ``force`` holds the sum of this step
        self.adding_forces = False  # force systems do at the moment
        self.frames_applied = False  # whether a force was applied from outside since the last window
        self._plan, self._columns, self._bound_columns = RowPlan(), MovedColumns(), -1
        self.add_array("entity", dtype=np.int64)
        self.add_array(HAS_OBJECTS, dtype=bool, fill=False)

    # -- rows -------------------------------------------------------------------------------------

    def find(self, entity: int) -> int:
        """The row of that entity; KeyError if it has none."""
        row = self.row_of(entity)
        if row < 0:
            raise KeyError(f"entity {entity!r} is no body of this world")
        return row

    def row_of(self, entity: int) -> int:
        """The row of that entity; -1 if it has none."""
        ids, start, row = self.arrays["entity"], 0, self._next_row
        if row < self.count and ids.item(row) == entity:  # most ask for one after the other
            self._next_row = row + 1
            return row
        if self._by_id_version == self.version:
            return self._by_id.item(entity) if 0 <= entity < len(self._by_id) else -1
        for stop in self.blocks:
            if start < stop and ids.item(stop - 1) >= entity:  # what has come last is in no block
                row = start + int(ids[start:stop].searchsorted(entity))
                if ids.item(row) == entity:
                    self._next_row = row + 1
                    return row
            start = stop
        return -1

    def types_in(self, row: int) -> list[type[Component]]:
        """The types of the components of a body: do not change it."""
        version = self.version, self.members_version, len(self.mask_names)
        if version != self._types_version:
            self._types_version, self._types = version, {}
        types = self._types.get(row)
        if types is None:
            names = self.mask_names.items()
            types = self._types[row] = [component for component, name in names if self.arrays[name].item(row)]
        return types

    def rows_of(self, entities: np.ndarray) -> np.ndarray:
        """The rows of entities, -1 for what has none, vectorised."""
        if len(entities) <= FEW:
            return np.array(list(map(self.row_of, entities.tolist())), np.int64)
        if len(entities) > MANY and self.count and int(self.arrays["entity"][: self.count].max()) < 8 * self.count:
            return self._rows_by_id(entities)
        rows = np.full(len(entities), -1, np.int64) if len(entities) else entities
        start = 0
        for stop in self.blocks if len(entities) else ():
            block = self.arrays["entity"][start:stop]
            if stop > start:
                place = np.minimum(block.searchsorted(entities), stop - start - 1)
                found = block[place] == entities
                rows[found] = place[found] + start
            start = stop
        return rows

    def _rows_by_id(self, entities: np.ndarray) -> np.ndarray:
        """The same with a table of all ids, which is made again when rows have moved."""
        if self._by_id_version != self.version:
            ids = self.column("entity")
            self._by_id = np.full(int(ids.max()) + 2, -1, np.int64)
            self._by_id[ids] = np.arange(self.count)
            self._by_id_version = self.version
        last = len(self._by_id) - 1  # of no entity
        return self._by_id[np.where((entities < 0) | (entities > last), last, entities)]

    def run_of(self, entities: np.ndarray) -> Any:
        """The rows of entities (n,) that all have one, ascending ids: a slice if they stand next to each other."""
        count, start = len(entities), self.find(int(entities[0]))
        stop = start + count
        if entities[-1] - entities[0] == count - 1 and not any(start < limit < stop for limit in self.blocks):
            rows = slice(start, stop)  # of one kind: if the last one is right, all are
            if self.arrays["entity"][rows][-1] == entities[-1]:
                return rows
        return self.rows_of(entities)

    def rebuild(self, removed: Rows, added: Rows, added_kinds: Rows) -> tuple[Rows, np.ndarray]:
        """Take rows out, put rows in, and bring bodies of another kind to their place.

        removed: rows that go. added: entity ids that come, with their kinds; their rows hold the defaults. Returns the
        ids that have got other rows than those of their neighbours, which are these and those of another kind, and
        their rows.
        """
        moved = self._changed_kinds(removed) if self.kind_changed else NO_ROWS
        blocks = [kind + 1 for kind in added_kinds] if isinstance(added_kinds, list) else added_kinds + 1
        return self._regroup(removed, added, blocks, moved, self.arrays["kind"][moved] + 1 if len(moved) else moved)

    def group_sleepers(self, asleep: np.ndarray) -> None:
        """Of the dynamic rows those of this mask sleep from now on, and no others."""
        rows = np.flatnonzero(asleep != (np.arange(len(asleep)) < self.blocks[0]))
        if len(rows):
            self._regroup(NO_ROWS, NO_ROWS, NO_ROWS, rows, np.where(asleep[rows], 0, 1))

    def _regroup(self, removed: Any, added: Any, blocks: Any, moved: Any, blocks_moved: Any) -> tuple[Rows, np.ndarray]:
        """As ``rebuild``, and the rows ``moved`` come into other blocks."""
        self.before_rows_move()
        values = {key: self.values(key, moved) for key in self.arrays} if len(moved) else {}
        if values:
            pairs = (removed, moved), (added, values["entity"]), (blocks, blocks_moved)
            removed, added, blocks = (np.concatenate((np.asarray(one, np.int64), other)) for one, other in pairs)
        if len(removed) > 1:
            removed = np.sort(removed)
        if len(added) > 1:
            added, blocks = np.asarray(added, np.int64), np.asarray(blocks, np.int64)
            keys = (blocks << 48) | added
            if (keys[1:] < keys[:-1]).any():
                order = np.argsort(keys, kind="stable")  # fast on what is partly in order
                added, blocks = added[order], blocks[order]
        moving = self.stops[1]
        if (len(added) and blocks[-1] == STATIC + 1) or (len(removed) and removed[-1] >= moving):
            self.static_version += 1
        self.reserve(self.count - len(removed) + len(added))
        if self._bound_columns != self.columns_version:
            self._bind_columns()
        plan = self._plan
        plan.begin(removed, added, blocks)
        self._columns.move(plan)
        rows = plan.fresh
        self.on_rows_moved(plan)
        plan.end()
        self.blocks = tuple(plan.record.stops.tolist())
        self.stops, self.count = self.blocks[1:], self.blocks[-1]
        self.kind_changed = False
        self.version += 1
        if values:
            places = self.rows_of(values["entity"])
            for key, column in values.items():
                self.arrays[key][places] = column
        return added, rows

    def _changed_kinds(self, removed: np.ndarray) -> np.ndarray:
        """The rows of bodies whose kind is another than that of their rows, but for those that go."""
        kinds = np.repeat(KIND_OF_BLOCK, np.diff((0, *self.blocks)))
        return np.setdiff1d(np.flatnonzero(self.column("kind") != kinds), removed)

    def _bind_columns(self) -> None:
        columns = list(self.arrays.values())
        defaults = [np.empty_like(column[:1]) for column in columns]
        for key, row in zip(self.arrays, defaults, strict=True):
            row[...] = self._fills[key]
        self._columns.bind(columns, defaults)
        self._plan.follow(self.arrays["entity"], self.arrays.get("kind"))
        self._bound_columns = self.columns_version

    def set_kinds(self, rows: np.ndarray, kinds: np.ndarray) -> None:
        """Bodies that are of another kind from now on; they move to their place at the next ``rebuild``."""
        self.arrays["kind"][rows] = kinds
        if not np.array_equal(np.searchsorted(self.stops, rows, side="right"), kinds):
            self.kind_changed = True

    def resize(self, blocks: tuple[int, ...]) -> None:
        """Rows for so many bodies, whatever they hold: all of them are about to be written."""
        self.reserve(blocks[-1])
        self.blocks, self.stops, self.count = blocks, blocks[1:], blocks[-1]
        self._plan.record.stops[:] = blocks
        self.version += 1

    def asleep(self, rows: slice) -> np.ndarray:
        """Mask of the dynamic bodies among these rows that sleep, a copy."""
        still = self.arrays.get("_sleep_state")
        if still is None:
            return np.zeros(rows.stop - rows.start, bool)
        return (still[rows] > 0) & (np.arange(rows.start, rows.stop) < self.stops[0])

    def take_out(self, component: type[Component], rows: np.ndarray) -> RowStore:
        """Copies of those rows of one component, for handles that outlive their rows."""
        columns = {column.key: column for column in component.columns.values()}
        made = {key: self.arrays[key][rows] for key in columns if key in self.arrays}
        constants = {key: (column, self._fills[key]) for key, column in columns.items() if key not in made}
        store = RowStore(made, self.dimensions, constants, len(rows))
        store.layer_names = self.layer_names
        hold_arrays(store, component._pooled)
        return store

    def numbers_in(self, pool: Any) -> list[np.ndarray]:
        """The numbers of that pool's arrays in its rows."""
        pooled = [column for component in self.component_types for column in component._pooled]
        return [self.column(column.key) for column in pooled if column.pool is pool]

    def held_arrays(self) -> Held:
        """Keeps all arrays that rows have now, as long as it lives."""
        pools = {column.pool for component in self.component_types for column in component._pooled}
        return Held({pool: np.concatenate(self.numbers_in(pool)) for pool in pools})

    # -- written through handles ------------------------------------------------------------------

    def is_frozen(self, key: str, row: int) -> bool:
        """Static rows are read in place and written by assignment only, so that no change goes unseen. A view of
        another row may be written to."""
        if row >= self.stops[1]:
            return True
        if key not in self.exposed:
            self.lend(key, False)
        return False

    def changed_inside(self, column: Any, row: int, before: int, inside: np.ndarray) -> None:
        """The array of a row is another one than that of number ``before``, but only inside of these boxes."""
        self.on_arrays_changed()
        self.on_changed_inside(column, row, before, inside)

    def written(self, column: Column, row: int) -> None:
        if row >= self.stops[1]:
            self.static_version += 1
        if column.on_write is not None:
            column.on_write(self, row)
