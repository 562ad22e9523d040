"""The columns of a table: one array per field of each component type, the same field of several types in a stack."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from .arrays.column import hold_arrays
from .columns import Column
from .component import Component
from .layers import LayerNames

# Attributes of Bodies:
RESERVED = (
    "apply_force", "asleep", "column_names", "dynamic", "has", "interpolated_position", "interpolated_rotation",
    "kinematic", "move_to", "row_of", "rows", "rows_of", "static", "velocity_at",
)  # fmt: skip


class TableColumns:
    """Arrays have room for ``capacity`` rows; the first ``count`` are in use.

    A column on demand has an array only once it has been asked for with :meth:`make`: to write, or because a view
    of it is given away. Until then all rows hold its default. It never goes back.
    """

    def __init__(self, dimensions: int) -> None:
        self.dimensions = dimensions
        self.layer_names: LayerNames | None = None
        self.count = 0
        self.capacity = 64
        self.arrays: dict[str, np.ndarray] = {}  # those there are
        self.on_demand: dict[str, Column] = {}  # all of these, whether they have an array or not
        self.columns_version = 0  # changes whenever a column gets another array
        self.on_make: Callable[[], None] = lambda: None  # called when one has got its array
        self.exposed: dict[str, bool] = {}  # columns that code of the game may write in place; whether static rows, too
        self.on_expose: Callable[[str], None] = lambda key: None  # called with one more
        self.read_only = {"entity", "kind"}  # columns
        self.writable_while: dict[str, Callable[[], bool]] = {}  # columns in which a value counts only at times
        self.stacks: dict[str, np.ndarray] = {}  # (types, capacity, ...): the same field of several component types
        self.component_types: list[type[Component]] = []
        self.mask_names: dict[type[Component], str] = {}  # of those that have columns
        self.kind_carrier: type[Component] | None = None  # the component type with the field ``kind``
        self._fills: dict[str, Any] = {}  # what rows of a column hold that have no value of their own
        self._default_bits: dict[str, bytes] = {}
        self._stack_rows: dict[str, tuple[str, int]] = {}  # column key -> (stack, slot)
        self._stacked_types: dict[str, list[type[Component]]] = {}

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

    def check_component_types(self, components: Iterable[type[Component]]) -> None:
        """ValueError if columns of one would go by the name of others, in the table or among these."""
        known, keys = [*self.component_types], set[str]()
        for component in dict.fromkeys(components):
            if component in self.mask_names:
                continue
            for other in known:
                if self.mask_name(other) == self.mask_name(component):
                    raise ValueError(f"two component types are named {component.__name__}: {other!r} and {component!r}")
            keys = keys or self.column_keys()
            own, name = {column.key for column in component.columns.values()}, component.prefix.rstrip(".")
            if keys & own or self.has_column(name) or name in RESERVED:
                clash = ", ".join(sorted(keys & own)) or name
                raise ValueError(f"component {component.__name__}: bodies have {clash} already; give it another name")
            known.append(component)
            keys |= own

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
        if key not in self.exposed or statics > self.exposed[key]:
            self.exposed[key] = statics
            self.on_expose(key)

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

    def is_other(self, key: str, row: int, value: Any) -> bool:
        """Whether a value, as a handle writes it, is not the one that the row has; NaN is like NaN."""
        now = self.column(key)[row]
        return not np.all((now == value) | ((now != now) & (value != value)))

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
