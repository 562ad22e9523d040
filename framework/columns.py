"""Columns: what a component stores, one array per field, and the checks a value passes before it gets in."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

SMALLEST_WITH_INVERSE = 1 / np.finfo(float).max  # 5.6e-309, a denormal
REQUIRED: Any = type("Required", (), {"__repr__": lambda self: "<required>"})()


@dataclass(frozen=True, eq=False)
class Column:
    """One field of a component type; as a class attribute, the access to that field of a handle.

    ``item`` is ``"scalar"``, ``"vector"`` (d floats in a d-dimensional world) or ``"rotation"`` (an angle in 2D, a unit
    quaternion w, x, y, z in 3D).
    """

    default: Any = REQUIRED
    item: str = "scalar"
    dtype: Any = float
    positive: bool = False
    minimum: float | None = None
    optional: bool = False  # None is allowed and stored as nan
    choices: tuple[str, ...] = ()  # stored as the index into it
    constructor: bool = True  # whether it is an argument of the constructor
    on_write: Callable[[Any, int], None] | None = None  # called with (table, row) after a handle has written
    name: str = ""
    owner: str = ""
    key: str = ""

    def __set_name__(self, owner: type, name: str) -> None:
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "owner", owner.__name__)

    def item_shape(self, dimensions: int) -> tuple[int, ...]:
        """Shape of one row's value in a world of that many dimensions."""
        if self.item == "vector":
            return (dimensions,)
        if self.item == "rotation":
            return () if dimensions == 2 else (4,)
        return ()

    def empty_value(self, dimensions: int) -> Any:
        """What rows hold whose entity lacks the component, and what an omitted scalar expands to."""
        if self.item == "rotation" and dimensions == 3:
            return np.array([1.0, 0.0, 0.0, 0.0])
        if self.default is REQUIRED:
            return 0
        return self.checked(self.default)

    # -- checks ---------------------------------------------------------------------------------------------------

    def checked(self, value: Any, entity: int | None = None) -> Any:
        """``value`` as it is stored; ValueError (or TypeError) names entity, field and value if it cannot be."""
        if self.choices:
            if value not in self.choices:
                raise self._error(value, f"must be one of {', '.join(self.choices)}", entity)
            return self.choices.index(value)
        if value is None and self.optional:
            return math.nan
        if self.dtype is bool:
            if not isinstance(value, (bool, np.bool_)):
                raise self._error(value, "must be True or False", entity)
            return bool(value)
        if self.item == "scalar" and self.dtype is float and type(value) is float and not (self.positive or self.minimum is not None):
            if not math.isfinite(value):
                raise self._error(value, "must be finite", entity)
            return value
        array = self._as_numbers(value, entity)
        if array.ndim > (0 if self.item == "scalar" else 1):
            raise self._error(value, f"must be one {self.item}", entity)
        if array.ndim == 1 and len(array) not in ((2, 3) if self.item == "vector" else (4,)):
            wanted = "2 or 3 numbers" if self.item == "vector" else "an angle or 4 numbers (w, x, y, z)"
            raise self._error(value, f"must be {wanted}", entity)
        self.check_numbers(array, value, entity)
        if self.item == "rotation" and array.ndim == 1:
            array = array / math.sqrt(float(array @ array))
        return array if array.ndim else array.item()

    def checked_many(self, values: Any, count: int, dimensions: int) -> np.ndarray:
        """An array for ``count`` rows, from one value for all or one per row."""
        shape = self.item_shape(dimensions)
        if self.choices:
            if isinstance(values, str):
                values = [values]
            values = [self.checked(value) for value in values]
        elif self.optional:
            values = math.nan if values is None else [math.nan if v is None else v for v in np.atleast_1d(values)]
        array = self._as_numbers(values, None)
        if array.ndim == 0 and self.item == "rotation" and dimensions == 3 and array == 0:
            array = self.empty_value(3)
        try:
            if array.ndim == 1 and not shape and len(array) == 1:
                array = array[0]
            full = np.broadcast_to(array, (count, *shape))
        except ValueError:
            raise self._error(
                f"an array of shape {array.shape}", f"must be one value or one per row, shape {(count, *shape)}", None
            ) from None
        self.check_numbers(full, None, None)
        if self.item == "rotation" and shape:
            full = full / np.linalg.norm(full, axis=1, keepdims=True)
        return full

    def check_dimensions(self, value: Any, dimensions: int, entity: int | None = None) -> None:
        """A vector must have the world's number of components; a single number stands for all of them."""
        if self.item == "vector" and np.ndim(value) == 1 and len(value) != dimensions:
            raise self._error(value, f"must have {dimensions} components in this {dimensions}D world", entity)
        if self.item == "rotation":
            if dimensions == 2 and np.ndim(value) == 1:
                raise self._error(value, "must be an angle in this 2D world", entity)
            if dimensions == 3 and np.ndim(value) == 0 and value != 0:
                raise self._error(value, "must be a quaternion (w, x, y, z) in this 3D world", entity)

    def check_numbers(self, array: np.ndarray, shown: Any, entity: int | None) -> None:
        """Finite and within the field's bounds; ``shown`` is what the message quotes (None: the first bad row)."""
        for bad, rule in (
            (~np.isfinite(array) if not self.optional else np.isinf(array), "must be finite"),
            (array <= 0 if self.positive else None, "must be positive"),
            (array < SMALLEST_WITH_INVERSE if self.positive else None, "must not be so small that 1 / value overflows"),
            (array < self.minimum if self.minimum is not None else None, f"must be at least {self.minimum}"),
        ):
            if bad is not None and np.any(bad):
                if shown is None:
                    where = int(np.argwhere(bad)[0][0])
                    raise self._error(array[where].tolist(), f"{rule} (row {where})", entity)
                raise self._error(shown, rule, entity)
        if self.item == "rotation" and array.ndim and array.shape[-1] == 4 and not np.all(np.any(array, axis=-1)):
            raise self._error(array.tolist() if shown is None else shown, "must not be the zero quaternion", entity)

    def _as_numbers(self, value: Any, entity: int | None) -> np.ndarray:
        try:
            if isinstance(value, str):
                raise ValueError
            array = np.asarray(value)
            if array.dtype.kind not in "biuf":
                raise ValueError
            if np.dtype(self.dtype).kind in "iu" and array.dtype.kind == "f":
                raise ValueError
            return array.astype(self.dtype)
        except (ValueError, TypeError, OverflowError):
            wanted = {"i": "an integer", "u": "an integer", "b": "True or False"}.get(np.dtype(self.dtype).kind, "a number")
            raise self._error(value, f"must be {wanted}" if self.item == "scalar" else "must be numbers", entity) from None

    def _error(self, value: Any, rule: str, entity: int | None) -> ValueError:
        prefix = "" if entity is None else f"entity {entity}: "
        shown = value.tolist() if isinstance(value, np.ndarray) else value
        text = shown if isinstance(shown, str) and shown.startswith("an array") else repr(shown)
        return ValueError(f"{prefix}{self.owner}.{self.name} {rule}, got {text}")

    # -- descriptor -----------------------------------------------------------------------------------------------

    def __get__(self, handle: Any, owner: type | None = None) -> Any:
        if handle is None:
            return self
        store = handle._store
        if store is None:
            return self.shown(handle._values[self.name])
        row = handle._row if handle._version == store.version else handle._locate()
        array = store.arrays[self.key]
        if array.ndim == 1:
            return self.shown(array.item(row))
        view = array[row]
        if store.is_frozen(row):
            view.flags.writeable = False
        return view

    def __set__(self, handle: Any, value: Any) -> None:
        value = self.checked(value, handle._entity)
        store = handle._store
        if store is None:
            handle._values[self.name] = value
            return
        self.check_dimensions(value, store.dimensions, handle._entity)
        row = handle._row if handle._version == store.version else handle._locate()
        store.arrays[self.key][row] = value
        store.written(self, row)

    def shown(self, value: Any) -> Any:
        """The stored value as users see it."""
        if self.choices:
            return self.choices[int(value)]
        if self.optional and math.isnan(value):
            return None
        return value


def column(
    default: Any = REQUIRED,
    *,
    item: str = "scalar",
    dtype: Any = float,
    positive: bool = False,
    minimum: float | None = None,
    optional: bool = False,
    choices: tuple[str, ...] = (),
) -> Any:
    """A field of a component: one number per entity (or one vector: ``item="vector"``), stored as a column.

    default
        value of entities that do not give one; without it the constructor demands one
    item
        ``"scalar"``, ``"vector"`` (d numbers; one number stands for all) or ``"rotation"``
    dtype
        ``float``, ``int`` or ``bool``
    positive, minimum, optional, choices
        checks: above zero; not below; None allowed; one of these strings
    """
    if item not in ("scalar", "vector", "rotation"):
        raise ValueError(f"column item must be scalar, vector or rotation, got {item!r}")
    if choices:
        dtype = np.int8
    elif dtype is int:
        dtype = np.int64
    elif dtype not in (float, bool, np.int64):
        raise ValueError(f"column dtype must be float, int or bool, got {dtype!r}")
    return Column(
        default=default, item=item, dtype=dtype, positive=positive, minimum=minimum, optional=optional, choices=choices
    )
