"""Columns: what a component stores, one array per field, and the checks a value passes before it gets in."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..units import warn_of_degrees
from .layers import Unresolved, is_named, resolved, unresolved

LARGEST = float(np.finfo(float).max)
SMALLEST_WITH_INVERSE = 1 / LARGEST  # 5.6e-309, a denormal
LONGEST = 200  # characters of a value in a message
# Of an array as one value, by item: how many numbers it may have, and what a message says.
LENGTHS: dict[str, tuple[tuple[int, ...], str]] = {
    "scalar": ((), "one number"), "vector": ((2, 3), "2 or 3 numbers"), "angular": ((3,), "a number or 3 numbers"),
    "rotation": ((4,), "an angle or 4 numbers (w, x, y, z)"),
}  # fmt: skip
REQUIRED: Any = type("Required", (), {"__repr__": lambda self: "<required>"})()


def or_no_rows(given: Any, *shape: int) -> Any:
    """What is given; an empty list as no rows of that shape, which numpy cannot know."""
    empty = not given if isinstance(given, (list, tuple)) else getattr(given, "shape", None) == (0,)
    return np.empty((0, *shape), np.int64) if empty else given


@dataclass(frozen=True, eq=False)
class Column:
    """One field of a component type; as a class attribute, the access to that field of a handle.

    ``item`` is ``"scalar"``, ``"vector"`` (d floats in a d-dimensional world), ``"rotation"`` (an angle in 2D, a unit
    quaternion w, x, y, z in 3D) or ``"angular"`` (a number in 2D, a vector of 3 in 3D).
    """

    default: Any = REQUIRED
    item: str = "scalar"
    dtype: Any = float
    positive: bool = False
    minimum: float | None = None
    nonzero: str = ""  # why 0 is refused
    cure: str = ""  # what is said of several numbers in place of one
    layers: bool = False  # bits of layers, also by their names in a world
    largest: float = LARGEST  # magnitude
    optional: bool = False  # None is allowed and stored as nan
    choices: tuple[str, ...] = ()  # stored as the index into it
    constructor: bool = True  # whether it is an argument of the constructor
    kw_only: bool = False  # and whether only by name
    also: tuple[str, ...] = ()  # what others call it; only for messages about a wrong name
    on_write: Callable[[Any, int], None] | None = None  # called with (table, row) after a handle has written
    unit: str = ""
    on_demand: bool = False  # no memory in a table while all rows hold the default and nothing can write in place
    name: str = ""
    owner: str = ""
    key: str = ""

    def __set_name__(self, owner: type, name: str) -> None:
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "owner", owner.__name__)
        object.__setattr__(self, "largest", min(self.largest, getattr(owner, "_largest", LARGEST)))

    def item_shape(self, dimensions: int) -> tuple[int, ...]:
        """Shape of one row's value in a world of that many dimensions."""
        if self.item == "vector":
            return (dimensions,)
        if self.item == "rotation":
            return () if dimensions == 2 else (4,)
        return (3,) if self.item == "angular" and dimensions == 3 else ()

    def empty_value(self, dimensions: int) -> Any:
        """What rows hold whose entity lacks the component, and what an omitted scalar expands to."""
        if self.item == "rotation" and dimensions == 3:
            return np.array([1.0, 0.0, 0.0, 0.0])
        return 0 if self.default is REQUIRED else self.stored_default

    @cached_property
    def stored_default(self) -> Any:
        """The default as it is stored; a single number stands for all of a vector's."""
        return REQUIRED if self.default is REQUIRED else self.checked(self.default)

    def whole(self, value: Any, dimensions: int) -> np.ndarray:
        """The array, (d,), (3,) or (4,), that a single number, ``value``, stands for (rotation 0: no rotation)."""
        array = np.empty(self.item_shape(dimensions), self.dtype)
        array[...] = self.empty_value(3) if self.item == "rotation" and dimensions == 3 else value
        return array

    def of_all(self, stored: Any, dimensions: int) -> Any:
        """What many rows hold: the value that one component has ``stored``, or the default in place of None.

        ValueError for a vector of other dimensions.
        """
        if stored is None:
            return self.empty_value(dimensions)
        self.check_dimensions(stored, dimensions)
        if isinstance(stored, np.ndarray):
            return stored.copy()
        return self.whole(stored, dimensions) if self.item_shape(dimensions) else stored

    def bounds(self) -> tuple[float, float] | None:
        """From where to where numbers may be; None: any that the type holds."""
        return self.limits if self.dtype is float else None

    @cached_property
    def limits(self) -> tuple[float, float]:
        """The smallest and the largest number that pass the checks, in its unit."""
        smallest = SMALLEST_WITH_INVERSE if self.positive else -self.largest
        return smallest if self.minimum is None else max(smallest, self.minimum), self.largest

    # -- checks -----------------------------------------------------------------------------------

    def checked(self, value: Any, entity: int | None = None) -> Any:
        """``value`` as it is stored; ValueError (or TypeError) names entity, field and value if it cannot be."""
        if self.item == "rotation" and isinstance(value, (int, float)):
            warn_of_degrees(f"{self.owner}.{self.name}", (value,))
        if type(value) is float and self.dtype is float:
            low, high = self.limits
            if low <= value <= high:
                return value
        if self.choices:
            if not isinstance(value, str) or value not in self.choices:
                raise self._error(value, f"must be one of {', '.join(self.choices)}", entity)
            return self.choices.index(value)
        if value is None and self.optional:
            return math.nan
        if self.dtype is bool:
            if not isinstance(value, (bool, np.bool_)):
                raise self._error(value, "must be True or False", entity)
            return bool(value)
        usual = self._usual(value)
        if usual is not None:
            return usual
        if self.layers and is_named(value):
            named = unresolved(value)
            return named if type(named) is Unresolved else self.checked(named, entity)
        array = self._as_numbers(value, entity)
        if array.ndim > (0 if self.item == "scalar" else 1):
            kind = "number or vector" if self.item == "angular" else self.item
            raise self._error(value, f"must be one {kind}{self.cure}", entity)
        lengths, wanted = LENGTHS[self.item]
        if array.ndim == 1 and len(array) not in lengths:
            raise self._error(value, f"must be {wanted}", entity)
        self.check_numbers(array, value, entity)
        if self.item == "rotation" and array.ndim == 1:
            array = array / _lengths(array)
        return array if array.ndim else array.item()

    def _usual(self, value: Any) -> Any:
        """The most frequent values checked without numpy, which takes ten times as long; None: look closely."""
        kind, (low, high) = type(value), self.limits
        if kind is int:
            if self.dtype is np.int64:
                fits = low <= value <= high and -(2**63) < value < 2**63
                return value if fits and (value or not self.nonzero) else None
            if low <= value <= high:
                return float(value)
        elif self.item == "vector" and (kind is tuple or kind is list) and len(value) in (2, 3):
            for number in value:
                if type(number) not in (float, int) or not low <= number <= high:
                    return None
            return np.array(value, float)
        return None

    def checked_many(self, values: Any, count: int, dimensions: int) -> np.ndarray:
        """An array (count, ...), from one of ``values`` for all or one per row; ValueError names field and row."""
        shape = self.item_shape(dimensions)
        if self.choices:
            return self._full(self._choices_of(values), count, shape)
        absent, given, some = None, values, np.full(shape, self.minimum or 1.0).tolist()  # what passes the checks
        if self.optional and values is None:
            absent, values = True, some
        elif self.optional and (isinstance(values, (list, tuple)) or getattr(values, "dtype", "") == "O"):
            absent = np.array([value is None for value in values])
            values = [some if value is None else value for value in values] if absent.any() else values
        array = self._as_numbers(values if count else or_no_rows(values, *shape), None, given)
        if array.ndim == 0 and self.item == "rotation" and dimensions == 3 and array == 0:
            array = self.empty_value(3)
        full = self._full(array, count, shape)
        if self.item == "rotation" and dimensions == 2:
            warn_of_degrees(f"{self.owner}.{self.name}", full[:1].tolist())
        if array.ndim <= len(shape):
            self.check_numbers(array, array.tolist(), None)
        else:
            self.check_numbers(full, None, None)
        if np.any(absent):
            full = np.where(np.reshape(absent, (-1, *(1,) * len(shape))), math.nan, full)
        if self.item == "rotation" and shape:
            full = full / _lengths(full)
        return full

    def _full(self, array: np.ndarray, count: int, shape: tuple[int, ...]) -> np.ndarray:
        """One value for all or one per row, as a row for each."""
        if array.shape == (count, *shape):
            return array
        try:
            return np.broadcast_to(array, (count, *shape))
        except ValueError:
            raise self._error(
                f"an array of shape {array.shape}", f"must be one value or one per row, shape {(count, *shape)}", None
            ) from None

    def _choices_of(self, values: Any) -> np.ndarray:
        """Indices of one choice or of one per row."""
        if isinstance(values, str) or np.ndim(values) == 0:
            return np.array(self.checked(values), self.dtype)
        known = {choice: index for index, choice in enumerate(self.choices)}
        for row, value in enumerate(values):
            if not isinstance(value, str) or value not in known:
                raise self._error(value, f"must be one of {', '.join(self.choices)} (row {row})", None)
        return np.array([known[value] for value in values], self.dtype)

    def check_dimensions(self, value: Any, dimensions: int, entity: int | None = None) -> None:
        """ValueError if ``value`` is a vector of other dimensions than the world; a number stands for all of them."""
        whole = isinstance(value, np.ndarray)
        if self.item == "vector" and whole and len(value) != dimensions:
            raise self._error(value, f"must have {dimensions} components in this {dimensions}D world", entity)
        if self.item == "angular":
            if dimensions == 2 and whole:
                raise self._error(value, "must be one number in this 2D world", entity)
            if dimensions == 3 and not whole and value != 0 and value == value:
                raise self._error(value, "must be 3 numbers in this 3D world", entity)
        if self.item == "rotation":
            if dimensions == 2 and whole:
                raise self._error(value, "must be an angle in this 2D world", entity)
            if dimensions == 3 and not whole and value != 0:
                raise self._error(value, "must be a quaternion (w, x, y, z) in this 3D world", entity)

    def check_numbers(self, array: np.ndarray, shown: Any, entity: int | None) -> None:
        """ValueError if ``array`` is not finite or exceeds the field's bounds; ``shown`` is what the message quotes
        (None: the first bad row)."""
        low, high = self.limits
        usual = self.item != "rotation" and array.size and low <= array.min() and array.max() <= high  # none is nan
        if usual and (not self.nonzero or np.all(array)):
            return
        each_axis = "" if self.item == "scalar" else " along each axis"
        for bad, rule in (
            (~np.isfinite(array), "must be finite"),
            (array <= 0 if self.positive else None, "must be positive"),
            (array < SMALLEST_WITH_INVERSE if self.positive else None, "must not be so small that 1 / value overflows"),
            (array < self.minimum if self.minimum is not None else None, f"must be at least {self.minimum}"),
            (array == 0 if self.nonzero else None, f"must not be 0: {self.nonzero}"),
            (abs(array) > self.largest, f"must be at most {self.largest:g}" + each_axis),
        ):
            if bad is not None and np.any(bad):
                if shown is None:
                    where = int(np.argwhere(bad)[0][0])
                    raise self._error(array[where].tolist(), f"{rule} (row {where})", entity)
                raise self._error(shown, rule, entity)
        if self.item == "rotation" and array.ndim and array.shape[-1] == 4 and not np.all(np.any(array, axis=-1)):
            where = "" if shown is not None else f" (row {int(np.argmin(np.any(array, axis=-1)))})"
            raise self._error([0.0] * 4 if shown is None else shown, f"must not be the zero quaternion{where}", entity)

    def _as_numbers(self, value: Any, entity: int | None, shown: Any = None) -> np.ndarray:
        try:
            array = np.asarray(value)
            if array.size and array.dtype.kind not in {"b": "b", "i": "iu", "f": "iuf"}[np.dtype(self.dtype).kind]:
                raise ValueError  # also True for a number: nearly always an argument in the wrong place
            if self.dtype is not bool and _holds_bool(value):
                raise ValueError
            if self.dtype is np.int64 and array.size and array.max() > np.iinfo(np.int64).max:
                raise ValueError
            return array.astype(self.dtype)
        except (ValueError, TypeError, OverflowError):
            wanted = {"i": "an integer", "b": "True or False"}.get(np.dtype(self.dtype).kind, "a number")
            rule = f"must be {wanted}" if self.item == "scalar" else "must be numbers"
            if type(value) is int and wanted == "an integer":
                rule = "must be from -2**63 to 2**63 - 1"
            if hasattr(value, "entity"):  # of a component
                rule, shown = f"{rule}: give its entity, which create_entity returns", f"a {type(value).__name__}"
            raise self._error(value if shown is None else shown, rule, entity) from None

    def _error(self, value: Any, rule: str, entity: int | None) -> ValueError:
        shown = value.tolist() if isinstance(value, np.ndarray) else value
        text = shown if isinstance(shown, str) and shown.startswith(("a ", "an array")) else repr(shown)
        text = text if len(text) <= LONGEST else f"{text[:LONGEST]} ..."
        return ValueError(f"{self.title(entity)} {rule}, got {text}")

    # -- descriptor -------------------------------------------------------------------------------

    def __get__(self, handle: Any, owner: type | None = None) -> Any:
        if handle is None:
            return self
        store = handle._store
        if store is None:
            value = handle._values.get(self.name)
            if value is None:
                value = self.stored_default
            if type(value) is float and handle._version < -1 and self.item_shape(-handle._version):
                value = handle._values[self.name] = self.whole(value, -handle._version)
            return value.given if type(value) is Unresolved else self.shown(value)
        row = handle._row if handle._version == store.version else handle._locate()
        array = store.arrays.get(self.key)
        if array is None:
            if self.item == "scalar" or not self.item_shape(store.dimensions):
                return self.shown(store.default_of(self.key))
            array = store.make(self.key)  # a view may be written to
        if array.ndim == 1:
            return self.shown(array.item(row))
        view = array[row]
        if self.optional and math.isnan(view[0]):
            return None
        if store.is_frozen(self.key, row):
            view.flags.writeable = False
        return view

    def __set__(self, handle: Any, value: Any) -> None:
        value = self.checked(value, handle._entity)
        store = handle._store
        if store is None:
            if handle._version < -1:  # it is given to a world
                self.check_dimensions(value, -handle._version, handle._entity)
            handle._values[self.name] = value
            handle._saved = None
            return
        self.check_dimensions(value, store.dimensions, handle._entity)
        if type(value) is Unresolved:
            value = resolved(value, store.layer_names, self.title(handle._entity))
        row = handle._row if handle._version == store.version else handle._locate()
        if store.on_written is not None:
            store.on_written(row, self.key, value)
        array = store.arrays.get(self.key)
        (store.make(self.key) if array is None else array)[row] = value
        store.written(self, row)

    def title(self, entity: int | None) -> str:
        """What messages call the field."""
        return f"{'' if entity is None else f'entity {entity}: '}{self.owner}.{self.name}"

    def value_of(self, handle: Any) -> Any:
        """The value of a ``handle`` for reading only: a column on demand stays without memory."""
        store = handle._store
        if store is None or self.key in store.arrays:
            return self.__get__(handle)
        shape, default = self.item_shape(store.dimensions), store.default_of(self.key)
        return np.full(shape, default, self.dtype) if shape else self.shown(default)

    def unshared(self, value: Any) -> Any:
        """A value read from a handle, as an unbound handle stores it."""
        return value.copy() if isinstance(value, np.ndarray) else self.checked(value)

    def hashable(self, values: np.ndarray) -> np.ndarray:
        """Stored ``values`` (n, ...) as a hash may take them: the same in every process."""
        return values

    def shown(self, value: Any) -> Any:
        """The stored value as users see it."""
        if self.choices:
            return self.choices[int(value)]
        if not self.optional:
            return value
        if type(value) is float:  # usual: a number that need not be given
            return None if value != value else value
        return None if np.isscalar(value) and math.isnan(value) else value


def _holds_bool(value: Any) -> bool:
    """Whether a sequence mixes True or False among its numbers: numpy would make them 1 and 0."""
    return isinstance(value, (list, tuple)) and any(isinstance(v, (bool, np.bool_)) for v in value)


def _lengths(array: np.ndarray) -> np.ndarray:
    """Of the last axis, kept; scaled first, because the square of a large or small number is inf or 0."""
    scale = np.abs(array).max(axis=-1, keepdims=True)
    return scale * np.sqrt(((array / scale) ** 2).sum(axis=-1, keepdims=True))


def column(
    default: Any = REQUIRED,
    *,
    item: str = "scalar",
    dtype: Any = float,
    positive: bool = False,
    minimum: float | None = None,
    optional: bool = False,
    choices: tuple[str, ...] = (),
    kw_only: bool = False,
    init: bool = True,
    unit: str = "",
) -> Any:
    """A field of a component: one number per entity (or one vector: ``item="vector"``), stored as a column.

    default
        value of entities that do not give one; without it the constructor demands one
    item
        ``"scalar"``, ``"vector"`` (d numbers; one number stands for all), ``"rotation"`` or ``"angular"`` (a number in
        2D, 3 in 3D)
    dtype
        ``float``, ``int`` or ``bool``
    positive, minimum, optional, choices
        checks: above zero; not below; None allowed; one of these strings
    kw_only, init
        whether the constructor takes it by name only, and whether it takes it at all
    unit
        "m", "N s"; "1" of a ratio: printed by ``world.plan()``

    Raises ValueError for an ``item`` or a ``dtype`` that there is not.
    """
    if item not in LENGTHS:
        raise ValueError(f"column item must be {', '.join(list(LENGTHS)[:-1])} or rotation, got {item!r}")
    if choices:
        dtype = np.int8
    elif dtype is int:
        dtype = np.int64
    elif dtype not in (float, bool, np.int64):
        raise ValueError(f"column dtype must be float, int or bool, got {dtype!r}")
    return Column(
        default=default, item=item, dtype=dtype, positive=positive, minimum=minimum, optional=optional, choices=choices,
        kw_only=kw_only, constructor=init, unit=unit,
    )  # fmt: skip


def special_column(
    default: Any = REQUIRED,
    *,
    kw_only: bool = False,
    on_demand: bool = False,
    on_write: Callable[[Any, int], None] | None = None,
    largest: float = LARGEST,
    nonzero: str = "",
    cure: str = "",
    layers: bool = False,
    also: tuple[str, ...] = (),
    **options: Any,
) -> Any:
    """A column with what only the built-in components use, see :class:`Column`."""
    return replace(
        column(default, kw_only=kw_only, **options),
        on_demand=on_demand, on_write=on_write, largest=largest, nonzero=nonzero,
        cure=cure, layers=layers, also=also,
    )  # fmt: skip
