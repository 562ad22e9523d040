"""The table of bodies: one row each, one array per field, rows in four blocks, [asleep, dynamic, kinematic, static],
in each by entity id.

The order of rows is a function of the ids and of what sleeps alone, so any history of creation and deletion that leads
to the same ids leads to the same rows, the same order of every sum, the same bits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from .arrays.column import hold_arrays
from .arrays.pool import Held
from .columns import Column
from .component import Component, RowStore
from .row_moves import BLOCKS, NO_ROWS, MovedColumns, RowPlan, Rows

KINDS = ("dynamic", "kinematic", "static")
DYNAMIC, KINEMATIC, STATIC = range(3)
KIND_OF_BLOCK = np.array((DYNAMIC, DYNAMIC, KINEMATIC, STATIC))
MANY = 200  # look-ups for which a table of all ids is worth its making
FEW = 4  # look-ups one by one take as long as one for all
HAS_OBJECTS = "has:objects"  # mask of the rows whose entity has a dict of components in esper
# Attributes of Bodies:
RESERVED = ("asleep", "column_names", "dynamic", "has", "kinematic", "row_of", "rows", "rows_of", "static")


class Table:
    """Columns of all bodies of one world. Arrays have room for ``capacity`` rows; the first ``count`` are in use.

    A column on demand has an array only once it has been asked for with :meth:`make`: to write, or because a view
    of it is given away. Until then all rows hold its default. It never goes back.
    """

    def __init__(self, dimensions: int) -> None:
        self.dimensions = dimensions
        self.clock: Any = None  # of the world
        self.count = 0
        self.capacity = 64
        self.version = 1  # changes whenever rows move
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
        self.arrays: dict[str, np.ndarray] = {}  # those there are
        self.on_demand: dict[str, Column] = {}  # all of these, whether they have an array or not
        self.columns_version = 0  # changes whenever a column gets another array
        self.on_make: Callable[[], None] = lambda: None  # called when one has got its array
        self.lent: dict[str, bool] = {}  # columns that code of the game may write in place; whether static rows, too
        self.on_lend: Callable[[str], None] = lambda key: None  # called with one more
        self.on_written: Callable[[str, int], None] | None = None  # called with what code of the game has written
        self.read_only = {"entity", "kind"}  # columns
        self.writable_while: dict[str, Callable[[], bool]] = {}  # columns in which a value counts only at times
        self.on_rows_moved: Callable[[RowPlan], None] = lambda plan: None
        self.on_arrays_changed: Callable[[], None] = lambda: None  # called when a row has got another array
        self.on_changed_inside: Callable[[Any, int, int, np.ndarray], None] = lambda *_: None  # see changed_inside
        self.forces_are_summed: Callable[[], bool] = lambda: False  # whether ``force`` holds the sum of this step
        self.frames_applied = False  # whether a force was applied from outside since the last window
        self.stacks: dict[str, np.ndarray] = {}  # (types, capacity, ...): the same field of several component types
        self.component_types: list[type[Component]] = []
        self.mask_names: dict[type[Component], str] = {}  # of those that have columns
        self.kind_carrier: type[Component] | None = None  # the component type with the field ``kind``
        self._fills: dict[str, Any] = {}  # what rows of a column hold that have no value of their own
        self._default_bits: dict[str, bytes] = {}
        self._plan, self._columns, self._bound_columns = RowPlan(), MovedColumns(), -1
        self._stack_rows: dict[str, tuple[str, int]] = {}  # column key -> (stack, slot)
        self._stacked_types: dict[str, list[type[Component]]] = {}
        self.add_array("entity", dtype=np.int64)
        self.add_array(HAS_OBJECTS, dtype=bool, fill=False)

    # -- columns ----------------------------------------------------------------------------------

    def add_array(self, key: str, item: str = "scalar", dtype: Any = float, fill: Any = 0, **options: Any) -> None:
        """A column that belongs to no component."""
        self._add(key, Column(item=item, dtype=dtype, **options), fill)

    def _add(self, key: str, column: Column, fill: Any) -> None:
        self._fills[key] = fill
        if column.on_demand:
            self.on_demand[key] = column
        else:
            self.arrays[key] = self._filled(column, fill)
            self.columns_version += 1

    def _filled(self, column: Column, fill: Any) -> np.ndarray:
        array = np.empty((self.capacity, *column.item_shape(self.dimensions)), column.dtype)
        array[...] = fill
        return array

    def add_component_type(self, component: type[Component]) -> None:
        """Columns for that type, and a mask ``has:<prefix>`` of the rows whose entity has it."""
        if component in self.component_types:
            return
        stack = getattr(component, "stack", None)
        slot = len(self._stacked_types.setdefault(stack, [])) if stack else 0
        for name, column in component.columns.items():
            if stack and name in component.stacked_columns:  # type: ignore[attr-defined]
                self._add_to_stack(f"{stack}.{name}", slot, column)
            else:
                self._add(column.key, column, column.empty_value(self.dimensions))
        if stack:
            self._stacked_types[stack].append(component)
        if "kind" in component.columns and not component.prefix:
            self.kind_carrier = component
        hold_arrays(self, component._pooled)
        self.read_only.update(column.key for column in component._pooled)
        self.mask_names[component] = self.mask_name(component)
        self.add_array(self.mask_name(component), dtype=bool, fill=False)
        self.component_types.append(component)

    def check_component_type(self, component: type[Component]) -> None:
        """ValueError if its columns would go by the name of others."""
        if component in self.mask_names:
            return
        for other in self.component_types:
            if self.mask_name(other) == self.mask_name(component):
                raise ValueError(f"two component types are named {component.__name__}: {other!r} and {component!r}")
        taken = self.column_keys() & {column.key for column in component.columns.values()}
        name = component.prefix.rstrip(".")
        if taken or self.has_column(name) or name in RESERVED:
            clash = ", ".join(sorted(taken)) or name
            raise ValueError(f"component {component.__name__}: bodies have {clash} already; give it another name")

    @staticmethod
    def mask_name(component: type[Component]) -> str:
        """The key of the mask of the rows whose entity has that component."""
        return f"has:{component.prefix or component.__name__}"

    def slot_of(self, component: type[Component]) -> int:
        """The component type's place in its stack."""
        return self._stacked_types[component.stack].index(component)  # type: ignore[attr-defined]

    def stacked_types(self, stack: str) -> list[type[Component]]:
        return self._stacked_types.get(stack, [])

    def has_mask(self, component: type[Component]) -> np.ndarray:
        """Full-capacity mask of the rows whose entity has that component."""
        return self.arrays[self.mask_names[component]]

    def _add_to_stack(self, stack: str, slot: int, column: Column) -> None:
        """The field of one more type. The whole stack has an array or none."""
        self._fills[column.key] = column.empty_value(self.dimensions)
        self._stack_rows[column.key] = (stack, slot)
        if column.on_demand:
            self.on_demand[column.key] = column
        if stack in self.stacks or not column.on_demand:
            self._make_stack(stack, column)

    def _make_stack(self, stack: str, column: Column) -> None:
        """An array for the field of all types, ``column`` of one of them; what there is stays."""
        keys = [key for key, (name, _) in self._stack_rows.items() if name == stack]  # in order of their slots
        made = [self.arrays.get(key) for key in keys]
        fills = [self._fills[key] for key in keys]
        stacked = [self._filled(column, fill) if own is None else own for own, fill in zip(made, fills, strict=True)]
        self.stacks[stack] = np.stack(stacked)
        self._point_into_stacks()

    def _point_into_stacks(self) -> None:
        for key, (stack, slot) in self._stack_rows.items():
            if stack in self.stacks:
                self.arrays[key] = self.stacks[stack][slot]
        self.columns_version += 1

    def column_keys(self) -> set[str]:
        """The names of all columns."""
        return self.arrays.keys() | self.on_demand.keys()

    def has_column(self, key: str) -> bool:
        return key in self.arrays or key in self.on_demand

    def column(self, key: str) -> np.ndarray:
        """The rows in use of that column, for reading."""
        array = self.arrays.get(key)
        return self._defaults(key, (self.count,)) if array is None else array[: self.count]

    def stack(self, name: str) -> np.ndarray:
        """(types, capacity, ...): the same field of several component types, for reading."""
        stack = self.stacks.get(name)
        if stack is None:
            keys = [key for key, (other, _) in self._stack_rows.items() if other == name]
            stack = self._defaults(keys[0], (len(keys), self.capacity))
        return stack

    def _defaults(self, key: str, rows: tuple[int, ...]) -> np.ndarray:
        """What rows of a column on demand hold that has no array."""
        column = self.on_demand[key]
        default = np.asarray(self._fills[key], column.dtype)
        return np.broadcast_to(default, (*rows, *column.item_shape(self.dimensions)))

    def default_of(self, key: str) -> Any:
        """What rows of that column hold that have no value of their own."""
        return self._fills[key]

    def values(self, key: str, rows: np.ndarray) -> np.ndarray:
        """A copy of those rows of a column."""
        return self.column(key)[rows]

    def make(self, key: str) -> np.ndarray:
        """The array of that column, for writing; one on demand has it from now on."""
        array = self.arrays.get(key)
        if array is None:
            column = self.on_demand[key]
            if key in self._stack_rows:
                self._make_stack(self._stack_rows[key][0], column)
            else:
                self.arrays[key] = self._filled(column, self._fills[key])
            array = self.arrays[key]
            self.columns_version += 1
            self.on_make()
        return array

    def is_writable(self, key: str) -> bool:
        """Whether code of the game may write into that column at this moment."""
        return key not in self.read_only and (key not in self.writable_while or self.writable_while[key]())

    def lend(self, key: str, statics: bool) -> None:
        """A writable view of that column is given away. Other columns change by writes of handles alone, and so do, but
        for ``statics``, static rows: with a new ``static_version``."""
        if key not in self.lent or statics > self.lent[key]:
            self.lent[key] = statics
            self.on_lend(key)

    def write(self, key: str, rows: Any, values: np.ndarray) -> None:
        """Values for those rows, a slice or indices; defaults need no array."""
        if key in self.arrays or not self._are_defaults(key, values):
            self.make(key)[rows] = values

    def _are_defaults(self, key: str, values: np.ndarray) -> bool:
        """Whether all of them have the bits of the default of a column on demand."""
        if values[:1].tobytes() != self._defaults(key, (len(values[:1]),)).tobytes():  # 0.0 is not -0.0
            return False
        return values.tobytes() == self._defaults(key, (len(values),)).tobytes()

    def write_one(self, key: str, row: Any, value: Any) -> None:
        """One value for a row, or for each of a slice or of indices; ``value`` as a handle keeps it: a single number
        may stand for a whole vector.
        """
        array = self.arrays.get(key)
        if array is None:
            if self._is_default(key, value):
                return
            array = self.make(key)
        fill = self._fills[key]
        array[row] = fill if type(fill) is np.ndarray and type(value) is float else value  # 3D: no rotation

    def _is_default(self, key: str, value: Any) -> bool:
        """Whether that value has the bits of the default of a column on demand."""
        fill = self._fills[key]
        if type(value) is np.ndarray:
            if key not in self._default_bits:
                self._default_bits[key] = self.on_demand[key].whole(fill, self.dimensions).tobytes()
            return value.tobytes() == self._default_bits[key]
        if type(value) is float and type(fill) is float:
            return value is fill or value.hex() == fill.hex()  # 0.0 is not -0.0
        return type(fill) is np.ndarray or value == fill

    def unmade(self) -> list[str]:
        """Columns on demand that have no array."""
        return [key for key in self.on_demand if key not in self.arrays]

    def reset(self, keys: Iterable[str]) -> None:
        """Default in all rows of these columns on demand."""
        for key in keys:
            if key in self.arrays:
                self.arrays[key][...] = self._fills[key]

    def asleep(self, rows: slice) -> np.ndarray:
        """Mask of the dynamic bodies among these rows that sleep, a copy."""
        still = self.arrays.get("_still")
        if still is None:
            return np.zeros(rows.stop - rows.start, bool)
        return (still[rows] > 0) & (np.arange(rows.start, rows.stop) < self.stops[0])

    # -- rows -------------------------------------------------------------------------------------

    def find(self, entity: int) -> int:
        """The row of that entity; KeyError if it has none."""
        row = self.row_of(entity)
        if row < 0:
            raise KeyError(entity)
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

    def settle(self, asleep: np.ndarray) -> None:
        """Of the dynamic rows those of this mask sleep from now on, and no others."""
        rows = np.flatnonzero(asleep != (np.arange(len(asleep)) < self.blocks[0]))
        if len(rows):
            self._regroup(NO_ROWS, NO_ROWS, NO_ROWS, rows, np.where(asleep[rows], 0, 1))

    def _regroup(self, removed: Any, added: Any, blocks: Any, moved: Any, blocks_moved: Any) -> tuple[Rows, np.ndarray]:
        """As ``rebuild``, and the rows ``moved`` come into other blocks."""
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

    def reserve(self, count: int) -> None:
        """Make room for that many rows; capacity doubles, views taken before keep the old arrays."""
        if count <= self.capacity:
            return
        self.capacity = max(count, 2 * self.capacity)
        for key, array in self.arrays.items():
            if key not in self._stack_rows:
                self.arrays[key] = self._grown(array, 0, self._fills[key])
        for stack, array in self.stacks.items():
            self.stacks[stack] = self._grown(array, 1, 0)
        self._point_into_stacks()

    def _grown(self, array: np.ndarray, axis: int, fill: Any) -> np.ndarray:
        shape = list(array.shape)
        shape[axis] = self.capacity
        fresh, before = np.zeros(shape, array.dtype), (slice(None),) * axis
        fresh[(*before, slice(self.count))] = array[(*before, slice(self.count))]
        if any(np.asarray(fill, array.dtype).tobytes()):  # else it takes no memory before it is used
            fresh[(*before, slice(self.count, None))] = fill
        return fresh

    def take_out(self, component: type[Component], rows: np.ndarray) -> RowStore:
        """Copies of those rows of one component, for handles that outlive their rows."""
        columns = {column.key: column for column in component.columns.values()}
        made = {key: self.arrays[key][rows] for key in columns if key in self.arrays}
        constants = {key: (column, self._fills[key]) for key, column in columns.items() if key not in made}
        store = RowStore(made, self.dimensions, constants, len(rows))
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
        if key not in self.lent:
            self.lend(key, False)
        return False

    def changed_inside(self, column: Any, row: int, before: int, inside: np.ndarray) -> None:
        """The array of a row is another one than that of number ``before``, but only inside of these boxes."""
        self.on_arrays_changed()
        self.on_changed_inside(column, row, before, inside)

    def written(self, column: Column, row: int) -> None:
        if row >= self.stops[1]:
            self.static_version += 1
        if self.on_written is not None:
            self.on_written(column.key, row)
        if column.on_write is not None:
            column.on_write(self, row)
