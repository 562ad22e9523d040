"""``world.bodies``: the table's columns by name, all rows or one kind's."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..names import did_you_mean
from ..typing import BodiesColumn, Integers
from .columns import Column, or_no_rows
from .component import Component
from .driven import drive
from .interpolation import interpolated
from .layers import resolved_rows
from .pushes import push, velocities
from .table import DYNAMIC, KINDS, KINEMATIC, STATIC, Table


def _points(name: str, points: Any, count: int, dimensions: int) -> np.ndarray:
    return Column(item="vector", owner="bodies", name=name).checked_many(points, count, dimensions)


class Bodies:
    """Columns as zero-copy views: ``bodies.position``, and ``bodies.charge.value`` of a component of one's own.

    ``dynamic``, ``kinematic`` and ``static`` are the same for the bodies of one kind. Views hold until the next
    structural change. Columns of static bodies are read-only, and of all ``entity``, ``kind``, numbers of arrays, and
    ``force`` and ``torque`` where they would be lost. Assigning writes into the column: ``bodies.linear_velocity = 0``.
    """

    __slots__ = ("_kind", "_table")

    if TYPE_CHECKING:  # the columns that every world with physics has
        entity: Integers
        kind: NDArray[np.int8]
        position: BodiesColumn
        previous_position: BodiesColumn
        linear_velocity: BodiesColumn
        rotation: BodiesColumn
        previous_rotation: BodiesColumn
        mass: BodiesColumn
        inverse_mass: BodiesColumn
        force: BodiesColumn
        torque: BodiesColumn
        constant_force: BodiesColumn
        gravity_scale: BodiesColumn
        linear_damping: BodiesColumn
        max_linear_speed: BodiesColumn

    def __init__(self, table: Table, kind: int | None = None) -> None:
        self._table = table
        self._kind = kind

    @property
    def rows(self) -> slice:
        """The rows these bodies take in the table."""
        if self._kind is None:
            return slice(0, self._table.count)
        stops = (0, *self._table.stops)
        return slice(stops[self._kind], stops[self._kind + 1])

    @property
    def dynamic(self) -> Bodies:
        """The same columns of the dynamic bodies."""
        return Bodies(self._table, DYNAMIC)

    @property
    def kinematic(self) -> Bodies:
        """The same columns of the kinematic bodies."""
        return Bodies(self._table, KINEMATIC)

    @property
    def static(self) -> Bodies:
        """The same columns of the static bodies, read-only."""
        return Bodies(self._table, STATIC)

    def has(self, component: type[Component]) -> np.ndarray:
        """Mask (n,) of the bodies whose entity has that component."""
        if component not in self._table.component_types:
            return np.zeros(len(self), bool)
        return self._table.has_mask(component)[self.rows]

    @property
    def asleep(self) -> np.ndarray:
        """Mask (n,) of the bodies that sleep, a copy: see ``Settings.sleeping``."""
        return self._table.asleep(self.rows)

    @property
    def interpolated_position(self) -> np.ndarray:
        """(n, d) m between the last two steps, by ``world.alpha``: where to draw the bodies. A copy."""
        return interpolated(self._table, "position", self.rows)

    @property
    def interpolated_rotation(self) -> np.ndarray:
        """The same of rotations, by slerp (Shoemake, 1985): (n,) rad in 2D, (n, 4) in 3D. Only what turns by its Spin
        is between two steps."""
        return interpolated(self._table, "rotation", self.rows)

    def move_to(self, positions: Any, rotations: Any = None) -> None:
        """As :meth:`RigidBody.move_to`, for all: ``bodies.kinematic.move_to(positions, rotations)``.

        positions
            (n, d) m; where a row is nan the body goes on as it does
        rotations
            None, or (n,) rad, in 3D (n, 4), of bodies with a Spin alone

        ValueError, and nothing has changed, if these are not kinematic bodies, or for a row that cannot be.
        """
        table, n, d = self._table, len(self), self._table.dimensions
        if self._kind != KINEMATIC:
            raise ValueError("move_to moves kinematic bodies: bodies.kinematic.move_to(positions)")
        places = np.array(or_no_rows(positions, d), float)
        if places.shape != (n, d):
            raise ValueError(f"move_to takes positions of shape {(n, d)}, got shape {places.shape}")
        chosen = np.flatnonzero(~np.isnan(places).all(axis=1))
        wrong = ~np.isfinite(places[chosen]).all(axis=1)
        if wrong.any():
            row = chosen[wrong][0]
            raise ValueError(f"move_to: a position must be finite, got {places[row].tolist()} (row {row})")
        turns = None
        if rotations is not None:
            turns = Column(item="rotation", owner="bodies", name="move_to").checked_many(rotations, n, d)[chosen]
        drive(table, chosen + self.rows.start, places[chosen], turns, "move_to")

    def apply_force(self, entities: Any, forces: Any, at: Any = None) -> None:
        """As :meth:`RigidBody.apply_force` of each, and with ``at`` as :meth:`Spin.apply_force`, in one call.

        entities
            (n,) ids; one that comes several times gets the sum
        forces
            (n, d) N, or (d,) for all
        at
            None, or (n, d) m, points of the world, or (d,) for all: the bodies turn, too

        KeyError for what is no body, ValueError for wrong shapes or numbers, or for one without a Spin that is to turn;
        nothing is applied then.
        """
        table, rows, d = self._table, self.rows_of(entities), self._table.dimensions
        pushes = Column(item="vector", owner="bodies", name="apply_force").checked_many(forces, len(rows), d)
        points = None if at is None else _points("apply_force at", at, len(rows), d)
        push(table, rows, pushes, points)

    def velocity_at(self, entities: Any, points: Any) -> np.ndarray:
        """(n, d) m/s: as :meth:`Spin.velocity_at` of each; of one without a Spin the velocity of its position.

        entities
            (n,) ids
        points
            (n, d) m of the world, or (d,) for all

        KeyError for what is no body, ValueError for wrong shapes or numbers.
        """
        rows = self.rows_of(entities)
        return velocities(self._table, rows, _points("velocity_at", points, len(rows), self._table.dimensions))

    def row_of(self, entity: int) -> int:
        """The row of that entity among all bodies; KeyError if it is no body."""
        return self._table.find(entity)

    def rows_of(self, entities: Any) -> np.ndarray:
        """(n,) the rows of these entities (n,) among all bodies; KeyError names the first that is no body."""
        ids = np.asarray(entities)
        if ids.ndim != 1 or (ids.size and ids.dtype.kind not in "iu"):
            raise TypeError(f"rows_of takes the ids of entities, got {entities!r}")
        rows = self._table.rows_of(ids.astype(np.int64))
        if rows.min(initial=0) < 0:
            raise KeyError(f"entity {ids.item(int(rows.argmin()))} is no body of this world")
        return rows

    def __len__(self) -> int:
        rows = self.rows
        return rows.stop - rows.start

    def __getattr__(self, name: str) -> Any:
        if self._table.has_column(name):
            view = self._table.make(name)[self.rows]
            if self._kind == STATIC or not self._table.is_writable(name):
                view.flags.writeable = False
            else:
                self._table.lend(name, self._kind is None)
            return view
        prefix = name + "."
        if not name.startswith("_") and any(component.prefix == prefix for component in self._table.component_types):
            return Fields(self, prefix)
        raise _no_column(name, self.column_names())

    def __setattr__(self, name: str, value: Any) -> None:
        if name in Bodies.__slots__:
            object.__setattr__(self, name, value)
        else:  # also what ``bodies.force += f`` ends with
            _write(getattr(self, name), _bits(self._table, name, value), name)

    def column_names(self) -> list[str]:
        """The names of all columns there are, sorted."""
        return sorted(key for key in self._table.column_keys() if not key.startswith(("has:", "_")))

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *{key.split(".")[0] for key in self.column_names()}]

    def __repr__(self) -> str:
        table, names = self._table, ", ".join(self.column_names())
        kind = "" if self._kind is None else KINDS[self._kind] + " "
        counts = f": {counts_by_kind(table)}" if self._kind is None else ""
        time = f"; {table.clock.time:.6g} s" if table.clock is not None else ""
        return f"<{len(self)} {kind}bodies in {table.dimensions}D{counts}{time}; columns {names}>"


def counts_by_kind(table: Table) -> str:
    """As in ``3 dynamic, 0 kinematic, 1 static``."""
    numbers = np.diff((0, *table.stops)).tolist()
    return ", ".join(f"{number} {kind}" for number, kind in zip(numbers, KINDS, strict=True))


class Fields:
    """The columns of one component type, as ``bodies.charge`` gives them."""

    __slots__ = ("_bodies", "_prefix")

    def __init__(self, bodies: Any, prefix: str) -> None:
        object.__setattr__(self, "_bodies", bodies)
        object.__setattr__(self, "_prefix", prefix)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._bodies, self._prefix + name)

    def __setattr__(self, name: str, value: Any) -> None:
        key = self._prefix + name
        _write(getattr(self, name), _bits(self._bodies._table, key, value), key)


class SelectedBodies:
    """Some dynamic bodies' columns, as copies; ``force`` and ``torque`` are written back by :meth:`scatter`.

    What a force system sees when only some of the bodies have what it requires. The other columns are read-only: what
    is written into a copy would be lost.
    """

    def __init__(self, table: Table, rows: np.ndarray) -> None:
        self._table = table
        self._rows = rows
        self._force = table.values("force", rows)
        self._torque: np.ndarray | None = None  # until it is asked for

    def __len__(self) -> int:
        return len(self._rows)

    @property
    def force(self) -> np.ndarray:
        """(n, d) N; what is assigned is written into it."""
        return self._force

    @force.setter
    def force(self, force: Any) -> None:
        _write(self._force, force, "force")

    @property
    def torque(self) -> np.ndarray:
        """N m: (n,) in 2D, (n, 3) in 3D; what is assigned is written into it."""
        if self._torque is None:
            self._torque = self._table.values("torque", self._rows)
        return self._torque

    @torque.setter
    def torque(self, torque: Any) -> None:
        _write(self.torque, torque, "torque")

    def __getattr__(self, name: str) -> Any:
        if self._table.has_column(name):
            copy = self._table.values(name, self._rows)
            copy.flags.writeable = False
            return copy
        prefix = name + "."
        if not name.startswith("_") and any(component.prefix == prefix for component in self._table.component_types):
            return Fields(self, prefix)
        raise _no_column(name, Bodies(self._table).column_names())

    def scatter(self) -> None:
        self._table.make("force")[self._rows] = self._force
        if self._torque is not None:
            self._table.make("torque")[self._rows] = self._torque


def _no_column(name: str, known: list[str]) -> AttributeError:
    return AttributeError(
        f"bodies have no column {name!r}{did_you_mean(name, known)}; they have {', '.join(known)}; those of a "
        f"component that no body has had yet are there after world.register(...) with its class"
    )


def _bits(table: Table, key: str, value: Any) -> Any:
    """Bits for layers that are given by name."""
    column = table.on_demand.get(key)
    return value if column is None or not column.layers else resolved_rows(value, table.layer_names, f"bodies.{key}")


def _write(view: Any, value: Any, name: str) -> None:
    if not isinstance(view, np.ndarray):
        raise AttributeError(f"bodies.{name} is no column that could be assigned")
    if view is not value:
        try:
            view[...] = value
        except ValueError as error:
            if np.shape(value) == view.shape or not view.flags.writeable:
                raise
            raise ValueError(f"bodies.{name} has shape {view.shape}, got shape {np.shape(value)}") from error
