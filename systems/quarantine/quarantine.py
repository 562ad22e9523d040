"""Bodies with values that cannot be: named once in ``world.faults`` and taken out, so that all others go on without
them.

The stages ``check_columns`` and ``check_flight`` find that something is wrong. What and where is found here, with
numpy, which takes longer and is seldom needed. A body that is out has no shape, stands still and has no say in what all
bodies share. Each step looks at it again, so that it takes part as soon as its values are mended.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...components import RigidBody, Transform
from ...components.rigid_body import FASTEST
from ...components.spin import Spin
from ...framework.data.columns import Column
from ...framework.data.table import Table
from ...framework.jit.records.record import Record, make_record
from ..integration.stages import UNMOVED
from ..records import ALL_ROWS, CHECKED, DYNAMIC_ROWS, STATIC_ROWS
from ..scene import Scene

LEAST_TURN, LARGEST_TURN = 1e-150, 1e150  # of a quaternion's numbers, whose squares are summed


@dataclass
class Checked:
    """A column that the step reads, and the record in which the stages find it.

    array
        all rows of the table, in use or not
    """

    column: Column
    array: np.ndarray
    record: Record

    def bad(self, rows: slice) -> np.ndarray:
        """Mask of those of these rows whose value cannot be."""
        record = self.record
        values = self.array[rows].reshape(-1, record.width)
        good = (values >= record.low) & (values <= record.high)
        if record.optional:
            good |= np.isnan(values)
        good = good.all(axis=1) & ~(np.abs(values).sum(axis=1) < record.least)
        return ~good & record.owned[rows]


class Quarantine:
    """Which bodies are out in one world, and why.

    told
        by entity, the field that was named in a fault; until the body takes part again
    """

    def __init__(self, state: Record, table: Table, scene: Scene, report_fault: Callable[..., None]) -> None:
        self._state, self._table, self._scene, self.report_fault = state, table, scene, report_fault
        self.told: dict[int, str] = {}
        self._far: set[int] = set()  # those that a fault has called too far from the origin
        self._checked: list[Checked] = []
        self._bound: Any = None  # what the list was made for
        self._generation = table.generation

    # -- snapshots --------------------------------------------------------------------------------

    def saved(self) -> dict[str, Any]:
        told, exposed = ([list(pair) for pair in known.items()] for known in (self.told, self._table.exposed))
        return {"told": told, "far": sorted(self._far), "exposed": exposed}

    def take_back(self, saved: dict[str, Any]) -> bool:
        """True if some body may have been out, or is: the scene has to be made again."""
        out = len(self._state.bodies.quarantined) > 0 or bool(self.told or saved["told"])
        self.told = dict(saved["told"])
        self._far, self._generation = set(saved["far"]), self._table.generation
        self._state.quarantining = bool(self.told)
        for key, statics in saved.get("exposed", [(key, True) for key in self._table.arrays]):
            self._table.lend(key, statics)  # they may hold what no step has looked at
        return out

    # -- what is looked at ------------------------------------------------------------------------

    def bind(self) -> None:
        """Rows have moved, or columns are others than before."""
        bound = self._table.columns_version, self._scene.linked, self._scene.spins()
        if bound != self._bound:
            self._checked = list(self._find_columns())
            self._bound = bound
            self.follow_exposed()
        if self._generation != self._table.generation:  # ids mean other entities
            self._generation = self._table.generation
            self.told.clear()
            self._far.clear()
        if self.told or self._state.bodies.quarantined.any():
            told = np.isin(self._table.column("entity"), list(self.told))  # also those that no column shows
            self._scene.exclude(self._find_bad() | told)

    def follow_exposed(self) -> None:
        """The stages look at the columns that code of the game can write in place; vectors also before a body has the
        component that they are of."""
        exposed, addresses = self._table.exposed, []
        for checked in self._checked:
            key = checked.column.key
            if key in exposed or checked.array.ndim > 1:
                checked.record.statics = exposed.get(key, False)
                addresses.append(checked.record.address)
        self._state.checked = np.array(addresses, np.int64)

    def _find_columns(self) -> Iterator[Checked]:
        """All that a step reads and the game may write, but for what moves: ``check_flight`` sees to that."""
        for column in RigidBody.columns.values():
            if column.name != "linear_velocity":
                yield from self._check(column, RigidBody, DYNAMIC_ROWS)
        if self._scene.spins():
            for column in Spin.columns.values():
                yield from self._check(column, Spin, ALL_ROWS)
        yield from self._check(Transform.columns["position"], Transform, STATIC_ROWS)
        if self._scene.linked is not None:
            yield from self._check(Transform.columns["rotation"], Transform, ALL_ROWS)
            for shape in self._scene.linked.shapes:
                for column in shape.component.columns.values():
                    yield from self._check(column, shape.component, ALL_ROWS)
        for component in self._table.component_types:  # of carom's plugins, which read them; no colliders
            if component.plugin and component is not Spin:
                for column in component.columns.values():
                    yield from self._check(column, component, ALL_ROWS)

    def _check(self, column: Column, component: Any, rows: int) -> Iterator[Checked]:
        array, bounds = self._table.arrays.get(column.key), column.bounds()
        if array is None or bounds is None:
            return
        record = make_record(CHECKED, 2)
        record.values, record.width, record.owned = array.reshape(-1), array[:1].size, self._table.has_mask(component)
        (record.low, record.high), record.optional, record.rows = bounds, column.optional, rows
        if column.item == "rotation" and array.ndim > 1:
            record.low, record.high, record.least = -LARGEST_TURN, LARGEST_TURN, LEAST_TURN
        yield Checked(column, array, record)

    def _rows(self, checked: Checked) -> slice:
        """The rows that a step reads of that column."""
        dynamic, moving, count = self._table.stops
        return (slice(0, dynamic), slice(moving, count), slice(0, count))[checked.record.rows]

    # -- what the stages ask for ------------------------------------------------------------------

    def check_columns(self, dt: float) -> None:
        """At the start of a step: take out bodies with values that cannot be, and take in again what is mended."""
        self._scene.exclude(self._find_bad())
        self._state.quarantining = bool(self.told)

    def check_flight(self, dt: float) -> None:
        """After the flight of all bodies: those that are nowhere, or too fast, are put back and taken out as well."""
        state, table, bodies = self._state, self._table, self._state.bodies
        moving, arrays = table.stops[1], table.arrays
        position, velocity = arrays["position"][:moving], arrays["linear_velocity"][:moving]
        out = self._find_bad() if state.others_write else self.excluded_now()
        failed = ~(np.isfinite(position).all(axis=1) & (np.abs(velocity) <= FASTEST).all(axis=1))
        for row in np.flatnonzero(failed & ~out[:moving]).tolist():
            self._tell_of_flight(row)
        out[:moving] |= failed
        gone = np.flatnonzero(out[:moving])
        position[gone], velocity[gone] = bodies.previous_position[gone], bodies.start_velocity[gone]
        self._tell_of_distance(np.flatnonzero(~out[:moving]), dt)
        self._scene.exclude(out)
        if out.any():
            state.warm_start.rows_version[:] = -1  # contacts at rest with these bodies count as those with none
        still = set(arrays["entity"][: table.count][out].tolist())
        self.told = {entity: field for entity, field in self.told.items() if entity in still}
        state.quarantining = bool(self.told)

    def report(self, row: int, field: str, value: Any, prefix: str = "") -> None:
        """A fault that names the body, unless that has been said."""
        entity = int(self._table.arrays["entity"][row])
        if entity in self.told:
            return
        self.told[entity] = field
        self._state.quarantining = True
        self.report_fault(
            f"{prefix}entity {entity}: {field} is {value}; until it is mended the body takes no part in the simulation",
            kind="quarantine", entity=entity,
        )  # fmt: skip

    def excluded_now(self) -> np.ndarray:
        """(count,) mask of the bodies that are out."""
        quarantined, count = self._state.bodies.quarantined, self._table.count
        return quarantined[:count].copy() if len(quarantined) else np.zeros(count, bool)

    def _find_bad(self) -> np.ndarray:
        """(count,) mask of the bodies with a value that cannot be; each is named."""
        found = np.zeros(self._table.count, bool)
        for checked in self._checked:
            rows = self._rows(checked)
            for k in np.flatnonzero(checked.bad(rows)).tolist():
                row = rows.start + k
                found[row] = True
                self.report(row, checked.column.key, checked.array[row].tolist())
        return found

    def _tell_of_flight(self, row: int) -> None:
        """Name what made a flight end nowhere: the first value that is wrong, else where it led to."""
        bodies, arrays = self._state.bodies, self._table.arrays
        start = {"position": bodies.previous_position[row], "linear_velocity": bodies.start_velocity[row]}
        if row < self._table.stops[0] and len(bodies.force):
            start["force"] = bodies.force[row]
        for field, value in start.items():
            if not (np.abs(value) <= (FASTEST if field == "linear_velocity" else np.finfo(float).max)).all():
                self.report(row, field, value.tolist())
                return
        finite = {field: np.isfinite(arrays[field][row]).all() for field in ("position", "linear_velocity")}
        field = "position" if finite["linear_velocity"] and not finite["position"] else "linear_velocity"
        self.report(row, field, arrays[field][row].tolist())

    def _tell_of_distance(self, rows: np.ndarray, dt: float) -> None:
        """Name bodies that have not moved along an axis because numbers are too far apart where they are."""
        bodies, arrays = self._state.bodies, self._table.arrays
        extent = np.maximum(1.0, bodies.min_extent[rows])[:, None] if len(bodies.min_extent) else 1.0
        position, velocity = arrays["position"][rows], arrays["linear_velocity"][rows]
        stuck = (position == bodies.previous_position[rows]) & (np.abs(velocity) * dt > UNMOVED * extent)
        for k in np.flatnonzero(stuck.any(axis=1)).tolist():
            entity = int(arrays["entity"][rows[k]])
            if entity not in self._far:
                self._far.add(entity)
                apart = float(np.spacing(np.abs(position[k][stuck[k]]).max()))
                self.report_fault(
                    f"entity {entity}: too far from the origin to move: at {position[k].tolist()} numbers are "
                    f"{apart:.3g} m apart; bring the scene nearer to the origin, or take longer steps",
                    kind="far", entity=entity,
                )  # fmt: skip
