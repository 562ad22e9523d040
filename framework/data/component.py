"""Components are handles: constructor values until a world adopts them, then a row of its table."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Callable, Iterable, Iterator, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, Self, dataclass_transform

import numpy as np

from ..names import did_you_mean, near_names, snake_case
from .arrays.column import ArrayColumn, array_column, hold_arrays
from .columns import LARGEST, REQUIRED, Column, special_column
from .columns import column as plain_column
from .layers import LayerNames, Unresolved, resolved, resolved_rows

NOTHING: Mapping[type[Any], Any] = MappingProxyType({})  # beside a component that is given alone


@dataclass_transform(field_specifiers=(plain_column, array_column, special_column), eq_default=False)
class Component:
    """Base of all components whose fields are columns.

    A subclass lists its fields with :func:`column`; they become constructor arguments in that order. The class is
    final, because esper looks components up by their exact type.
    """

    __slots__ = ("__weakref__", "_entity", "_row", "_saved", "_store", "_values", "_version")

    _values: dict[str, Any] | None  # that it holds itself; what is missing has its default
    _saved: dict[str, Any] | None  # what snapshots have of these, while none has been set since

    columns: ClassVar[dict[str, Column]] = {}
    prefix: ClassVar[str] = ""  # of the columns' names in a table
    makes_body: ClassVar[bool] = False  # an entity that has it together with a Transform is a body
    excludes: ClassVar[Mapping[type[Component], str]] = {}  # what no entity has together with it, and the cure
    needs: ClassVar[tuple[type[Component], ...]] = ()  # what an entity has to have as well
    # What an entity that has it gets too, if it has none: their types, and what of their values in d dimensions.
    brings: ClassVar[Mapping[type[Component], Callable[[int], dict[str, Any]]]] = {}
    plugin: ClassVar[str] = ""  # the plugin without which it does nothing
    plugin_class: ClassVar[str] = ""  # what games write for it, where that is not its name with a capital
    until_frame_ends: ClassVar[tuple[str, ...]] = ()  # columns of a push from outside, and of the frame that it is of
    _abstract: ClassVar[bool] = True
    _largest: ClassVar[float] = LARGEST  # magnitude of the numbers in its fields
    _shaped: ClassVar[tuple[Column, ...]] = ()  # columns whose shape depends on the world's dimensions
    _lends: ClassVar[bool] = False  # whether a game may write into its vectors, and nobody is told
    _held: ClassVar[tuple[str, ...]] = ()  # those whose default does not fit worlds of 2 and of 3 dimensions
    _arguments: ClassVar[dict[str, Column]] = {}  # of the constructor
    _positional: ClassVar[tuple[str, ...]] = ()  # those that need no name
    _required: ClassVar[tuple[str, ...]] = ()
    _defaults: ClassVar[dict[str, Any]] = {}  # what a component holds that has been given nothing
    _pooled: ClassVar[tuple[ArrayColumn, ...]] = ()  # columns whose values stand in a pool
    _layers: ClassVar[tuple[Column, ...]] = ()  # columns of layers, which may have names

    def __init_subclass__(cls, *, abstract: bool = False, flat: bool = False, **kwargs: Any) -> None:
        """``abstract`` bases may be derived from; ``flat`` columns carry no prefix in the table."""
        super().__init_subclass__(**kwargs)
        for base in cls.__mro__[1:]:
            if issubclass(base, Component) and not base._abstract:
                raise TypeError(f"{base.__name__} is final: esper finds components by their exact type, not by a base")
        cls._abstract = abstract
        cls.prefix = "" if flat else snake_case(cls.__name__) + "."
        own = {name: value for name, value in vars(cls).items() if isinstance(value, Column)}
        for name in own:
            if hasattr(Component, name):
                raise TypeError(f"{cls.__name__}: a column cannot be named {name!r}, every component has that already")
        _refuse_plain_values(cls)
        if abstract:
            cls.columns = {**cls.columns, **own}
            return
        # a concrete class gets its own copy of inherited columns: each has its own place in the table
        fields: dict[str, Column] = {}
        for name, inherited in {**own, **{n: c for n, c in cls.columns.items() if n not in own}}.items():
            field = inherited if name in own else _copy_of(inherited)
            object.__setattr__(field, "name", name)
            object.__setattr__(field, "owner", cls.__name__)
            object.__setattr__(field, "key", cls.prefix + name)
            setattr(cls, name, field)
            fields[name] = field
        for word in (word for field in fields.values() for word in field.also):
            if not hasattr(cls, word):
                setattr(cls, word, _OtherWord(word))
        cls.columns = fields
        if "__slots__" not in vars(cls) and cls.__setattr__ is object.__setattr__:
            cls.__setattr__ = _set_field  # type: ignore[method-assign]
        cls._shaped = tuple(field for field in fields.values() if field.item != "scalar")
        cls._lends = any(field.item_shape(3) for field in cls._shaped)
        cls._arguments = {name: field for name, field in fields.items() if field.constructor}
        cls._positional = tuple(name for name, field in cls._arguments.items() if not field.kw_only)
        cls._required = tuple(name for name, field in cls._arguments.items() if field.default is REQUIRED)
        cls._pooled = tuple(field for field in fields.values() if isinstance(field, ArrayColumn))
        cls._layers = tuple(field for field in fields.values() if field.layers)
        cls._defaults = {name: field.stored_default for name, field in fields.items()}  # ValueError for a wrong one
        cls._held = tuple(
            field.name for field in cls._shaped
            if isinstance(field.stored_default, np.ndarray)
            or (field.item == "rotation" and field.stored_default not in (0, REQUIRED))
        )  # fmt: skip

    if not TYPE_CHECKING:  # checkers of types would take any name

        def __getattr__(self, name: str) -> Any:
            """AttributeError; for what it does not have only."""
            near = ""
            if not name.startswith("_"):
                also = {word: known for known, field in self.columns.items() for word in field.also}
                near = did_you_mean(name, [word for word in dir(self) if word[0] != "_"], also)
            elif name in ("_store", "_version", "_entity"):
                near = f": {type(self).__name__}.__init__ must call super().__init__ first"
            raise AttributeError(f"{type(self).__name__} has no attribute {name!r}{near}")

    def __dir__(self) -> list[str]:
        return [name for name in super().__dir__() if not isinstance(vars(type(self)).get(name), _OtherWord)]

    def __init__(self, *args: Any, **values: Any) -> None:
        self._fill(self._named(args, values) if args else values)

    @classmethod
    def _named(cls, args: tuple[Any, ...], values: Mapping[str, Any]) -> dict[str, Any]:
        """All arguments by their names; TypeError if positional ones are too many, or also given by name."""
        names = cls._positional
        if len(args) > len(names):
            more = ", others by name" if len(names) < len(cls._arguments) else ""
            raise TypeError(f"{cls.__name__} takes {len(names)} values ({', '.join(names)}{more}), got {len(args)}")
        given = {}
        for k, value in enumerate(args):
            given[names[k]] = value
        if values:
            for name in given.keys() & values.keys():
                raise TypeError(f"{cls.__name__} got {name!r} twice")
            given.update(values)
        return given

    @classmethod
    def _unknown(cls, name: str) -> TypeError:
        also = {word: known for known, field in cls._arguments.items() for word in field.also}
        near = did_you_mean(name, cls._arguments, also)
        return TypeError(f"{cls.__name__} has no field {name!r}{near}; it has {', '.join(cls._arguments) or 'none'}")

    def _fill(self, given: Mapping[str, Any]) -> None:
        """Hold what is given, all else has its default; TypeError for a name that is no argument."""
        self._store = None
        self._entity = None
        self._row = -1
        self._version = -1
        self._saved = None
        arguments, stored = self._arguments, {}
        for name in self._held:
            stored[name] = copy.copy(self._defaults[name])
        for name, value in given.items():
            field = arguments.get(name)
            if field is None:
                raise self._unknown(name)
            stored[name] = field.checked(value)
        for name in self._required:
            if name not in given:
                raise TypeError(f"{type(self).__name__} needs a value for {name!r}")
        self._values = stored
        if self._pooled:
            hold_arrays(self, self._pooled)

    # -- being adopted and let go -----------------------------------------------------------------

    @property
    def entity(self) -> int | None:
        """The entity this handle belongs to, None before a world has adopted it."""
        return self._entity

    def _locate(self) -> int:
        """The row now, after the table's rows have moved."""
        self._row = self._store.find(self._entity)
        self._version = self._store.version
        return self._row

    def _bind(self, store: Any, entity: int | None, row: int = -1, version: int = -1) -> None:
        self._store = store
        self._entity = entity
        self._row = row
        self._version = version
        self._values = self._saved = None

    def _hold(self, values: Mapping[str, Any]) -> None:
        """Belong to no entity, and have these values, as they are read from a handle."""
        self._bind(None, None)
        self._values = {name: column.unshared(values[name]) for name, column in self.columns.items()}
        hold_arrays(self, self._pooled)

    def _as_saved(self) -> dict[str, Any] | None:
        """What :meth:`_to_save` or :meth:`_go_back` has left; None if a value may be another one since."""
        return self._saved

    def _to_save(self) -> dict[str, Any]:
        """A copy of its values, for :meth:`_go_back`, of this component or another one."""
        values = {name: v.copy() if isinstance(v, np.ndarray) else v for name, v in self._read().items()}
        self._saved = values if self._store is None and not self._lends else None
        return values

    def _go_back(self, values: dict[str, Any]) -> None:
        """Hold these values, which nobody else changes."""
        known = self._entity  # to a joint, for its messages
        self._hold(values)
        self._entity = known
        self._saved = None if self._lends else values

    def check_dimensions(self, dimensions: int, entity: int | None = None) -> None:
        """ValueError if a vector of this component does not fit a world of that many dimensions."""
        if self._store is not None and self._store.dimensions == dimensions:
            return
        for column in self._shaped:
            value = getattr(self, column.name) if self._store is not None else self._values.get(column.name)
            if value is None:  # its default fits any world
                continue
            vector = column.item == "vector"
            if type(value) is float:
                fits = vector or dimensions == 2 or value == 0.0  # a number stands for any vector
            else:
                fits = vector and type(value) is np.ndarray and len(value) == dimensions
            if not fits:
                column.check_dimensions(value, dimensions, entity)

    def check_in(self, contents: Any, entity: int | None, beside: Mapping[type[Any], Any] = NOTHING) -> None:
        """ValueError if it cannot be in a world with these contents, given to the entity with others ``beside`` it."""

    def fit(self, dimensions: int, entity: int | None = None) -> None:
        """Whole vectors, of that many dimensions, from now on; ValueError if one has others."""
        if self._version == -dimensions:  # it does, since a world has looked at it
            return
        self.check_dimensions(dimensions, entity)
        if self._store is None:
            self._version = -dimensions  # single numbers become whole vectors when they are read

    def bits_by_name(self, names: LayerNames | None, entity: int | None = None) -> dict[str, int]:
        """By field the bits of the layers that it has by name, in a world with these names; ValueError for others."""
        values, found = self._values or {}, {}
        for field in self._layers:
            if type(value := values.get(field.name)) is Unresolved:
                found[field.name] = field.checked(resolved(value, names, field.title(entity)), entity)
        return found

    def take_bits(self, bits: dict[str, int]) -> None:
        """Have bits of layers in place of names."""
        if bits and self._values is not None:
            self._values.update(bits)
            self._saved = None

    def copy(self) -> Self:
        """An unbound component with the same values, for another entity (prefabs)."""
        other = type(self).__new__(type(self))
        if hasattr(self, "__dict__"):
            vars(other).update(vars(self))  # what a class without __slots__ keeps besides its columns
        other._hold(self._read())
        return other

    def _read(self) -> dict[str, Any]:
        return {name: column.value_of(self) for name, column in self.columns.items()}

    def numbers_in(self, pool: Any) -> list[int]:
        """The numbers of arrays of ``pool`` that it holds itself."""
        values = self._values or {}
        return [values[column.name] for column in self._pooled if column.pool is pool and column.name in values]

    def __copy__(self) -> Self:
        return self.copy()

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        other = memo[id(self)] = self.copy()
        for name in getattr(other, "__dict__", {}).keys() - set(Component.__slots__):
            vars(other)[name] = copy.deepcopy(vars(self)[name], memo)
        return other

    def __reduce_ex__(self, protocol: Any) -> Any:
        """Pickled with its values, as a component that belongs to no entity."""
        return _unpickled, (type(self), self._read()), getattr(self, "__dict__", None)

    def _shown(self) -> Iterator[tuple[str, Any]]:
        """The arguments of its constructor as they are printed, layers by their names in its world."""
        names = getattr(self._store, "layer_names", None)
        for name, column in self.columns.items():
            if column.constructor:
                value = column.value_of(self)
                yield name, names.names(value) if column.layers and names is not None else value

    def __repr__(self) -> str:
        fields = ", ".join(f"{n}={v.tolist() if isinstance(v, np.ndarray) else v!r}" for n, v in self._shown())
        return f"{type(self).__name__}({fields})"

    @classmethod
    def many(cls, *args: Any, **values: Any) -> Many:
        """Values for many entities at once, for ``world.create_entities``: each one value for all, or one per row."""
        given = cls._named(args, values)
        for name in given:
            if name not in cls._arguments:
                raise cls._unknown(name)
        for name in cls._required:
            if name not in given:
                raise TypeError(f"{cls.__name__}.many needs a value for {name!r}")
        return Many(cls, given)


class Many:
    """One component type's values for many entities; made by ``Component.many``.

    like
        an unbound component whose values hold for all, but for the ``values`` that are given
    """

    def __init__(self, component: type[Component], values: dict[str, Any], like: Component | None = None) -> None:
        self.component = component
        self.values = values
        self.like = like

    def store(self, count: int, dimensions: int, names: LayerNames | None = None) -> RowStore:
        """Checked columns of ``count`` rows, or one value for all; ValueError names field and row."""
        arrays, constants = {}, {}
        like = {} if self.like is None else {**(self.like._values or {}), **self.like.bits_by_name(names)}
        for name, column in self.component.columns.items():
            if name not in self.values:
                constants[column.key] = column, column.of_all(like.get(name), dimensions)
                continue
            values = self.values[name]
            if column.layers:
                values = resolved_rows(values, names, column.title(None))
            array = column.checked_many(values, count, dimensions)
            if count > 1 and array.strides[0] == 0:  # one value for all
                constants[column.key] = column, array[0].copy() if array.ndim > 1 else array[0].item()
            else:
                arrays[column.key] = np.require(array, requirements=("C", "W"))
        store = RowStore(arrays, dimensions, constants, count)
        store.layer_names = names
        hold_arrays(store, self.component._pooled)
        return store

    def arrays(self, count: int, dimensions: int, names: LayerNames | None = None) -> dict[str, np.ndarray]:
        """The same, all of it as arrays (count, ...)."""
        store = self.store(count, dimensions, names)
        return {column.key: store.make(column.key) for column in self.component.columns.values()}


class RowStore:
    """Values of handles that have no row in a table: created in bulk and not adopted yet, or removed already.

    constants: columns without an array of their ``count`` rows, and the value that all rows hold.
    """

    version = 0
    on_written = None
    layer_names: LayerNames | None = None  # of the world

    def __init__(
        self, arrays: dict[str, np.ndarray], dimensions: int, constants: dict[str, tuple[Column, Any]], count: int
    ) -> None:
        self.arrays = arrays
        self.dimensions = dimensions
        self.constants, self._count = constants, count

    def values(self, key: str, rows: Any) -> np.ndarray:
        """Those rows of a column, for reading."""
        array = self.arrays.get(key)
        if array is None:
            column, value = self.constants[key]
            array = np.broadcast_to(np.asarray(value, column.dtype), (self._count, *column.item_shape(self.dimensions)))
        return array[rows]

    def numbers_in(self, pool: Any) -> list[np.ndarray]:
        """The numbers of arrays in it; those of other pools do no harm."""
        whole = [array for array in self.arrays.values() if array.dtype == np.int64]
        return [*whole, *(value for column, value in self.constants.values() if isinstance(column, ArrayColumn))]

    def default_of(self, key: str) -> Any:
        """What all rows of a column without an array hold."""
        return self.constants[key][1]

    def make(self, key: str) -> np.ndarray:
        """The array of that column, for writing."""
        if key not in self.arrays:
            column, value = self.constants[key]
            self.arrays[key] = np.empty((self._count, *column.item_shape(self.dimensions)), column.dtype)
            self.arrays[key][...] = value
        return self.arrays[key]

    def find(self, entity: int) -> int:
        raise KeyError(entity)  # handles into a store never lose their row

    def is_frozen(self, key: str, row: int) -> bool:
        return False

    def written(self, column: Column, row: int) -> None:
        pass

    def changed_inside(self, column: Column, row: int, before: int, inside: np.ndarray) -> None:
        pass


class _OtherWord:
    """A word that other engines have for a field; it can neither be read nor set, and the error names the field."""

    def __init__(self, word: str) -> None:
        self._word = word

    def __get__(self, component: Component | None, owner: type[Component]) -> Any:
        raise AttributeError(f"{owner.__name__} has no attribute {self._word!r}")  # Component.__getattr__ says more

    def __set__(self, component: Component, value: Any) -> None:
        getattr(component, self._word)


def listed(taker: str, given: Any) -> tuple[Any, ...]:
    """What is given to one that takes several types; TypeError for a single one, and for what is no list."""
    if isinstance(given, type) or not isinstance(given, Iterable):
        name = getattr(given, "__name__", None)
        meant = f"{name} (did you mean [{name}]?)" if name else repr(given)
        raise TypeError(f"{taker} takes a list of types, got {meant}")
    return tuple(given)


def checked_types(taker: str, given: Iterable[Any]) -> tuple[type[Component], ...]:
    """What is given to one that takes component types; TypeError for anything else."""
    types = listed(taker, given)
    for component in types:
        if not (isinstance(component, type) and issubclass(component, Component)):
            raise TypeError(f"{taker} takes component types, got {component!r}")
    return types


def _unpickled(component: type[Component], values: dict[str, Any]) -> Component:
    handle = component.__new__(component)
    handle._hold(values)
    return handle


def _copy_of(column: Column) -> Column:
    return dataclasses.replace(column)


def _refuse_plain_values(cls: type[Component]) -> None:
    """TypeError if a class has values that look like fields of its entities and are none."""
    annotations = {name: str(of) for name, of in vars(cls).get("__annotations__", {}).items()}
    values = {name: value for name, value in vars(cls).items() if not hasattr(type(value), "__get__")}
    if "__init__" not in vars(cls) and not vars(cls).get("__slots__"):  # which may set what is annotated
        values = {**dict.fromkeys(annotations, ...), **values}
    for name, value in values.items():
        constant = name.isupper() or "ClassVar" in annotations.get(name, "") or isinstance(value, type)
        known = any(hasattr(base, name) for base in cls.__mro__[1:])
        if not (name.startswith("_") or constant or known or isinstance(vars(cls).get(name), Column)):
            given, default = ("", "") if value is ... else (f" = {value!r}", repr(value))
            raise TypeError(
                f"{cls.__name__}.{name}{given} is no column: write {name} = column({default}), or annotate it as "
                f"ClassVar if it is the same for all"
            )


def _set_field(component: Component, name: str, value: Any) -> None:
    """A class of one's own may keep more than columns; but what is nearly a column's name is a slip of the pen."""
    if not hasattr(type(component), name) and name not in vars(component):
        near = near_names(name, component.columns, cutoff=0.75)
        if near:
            raise AttributeError(f"{type(component).__name__} has no field {name!r}: did you mean {near[0]!r}?")
    object.__setattr__(component, name, value)
