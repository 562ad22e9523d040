"""The scene of one world as the stages see it: which shapes there are, and every column where the records find it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..components import AABBCollider, Collider, RigidBody, Transform
from ..components.spin import Spin
from ..framework.data.driven import STOPS
from ..framework.data.row_moves import MovedColumns, RowPlan
from ..framework.data.table import FEW, Table
from ..framework.jit.records.record import Record
from ..framework.plugins.registry import Shape
from ..framework.world.world import World
from .records import (
    BODY_COLUMNS,
    COLLIDERS,
    COLLISIONS,
    DAMPING_COLUMNS,
    HELD_COLUMNS,
    HIDDEN_COLUMNS,
    SLEEP_COLUMNS,
    START_COLUMNS,
    TABLE_COLUMNS,
    UNDO_COLUMNS,
)
from .shapes.geometry_levels import arrange, in_order
from .shapes.linking.linked_shapes import LinkedShapes, ParameterRecords, linked_shapes
from .shapes.quaternions import axes_of

# What is kept of bodies from step to step, and moves with their rows: static bodies are not boxed again for others. The
# shape comes first: it tells which bodies have arrived.
KEPT_COLUMNS = ("shape", "collider_slot", "offset", "half_extents", "min_extent", "reach", "lower", "upper", "origin")
ENABLED = f"{Collider.stack}.enabled"
ARRIVED = np.array([-2], np.int8)  # in place of the shape of a body that has come since the last refresh
# Static bodies do not move: what stands in their rows of these stays 0.
ZERO_WHERE_STATIC = (
    "start_velocity", "path_velocity", "path_second", "path_third", "force_speed_change", "impact_count",
    "counted_impacts",
)  # fmt: skip


class Scene:
    """What follows from the bodies, their colliders and the plugins; refreshed when these change.

    linked
        the functions of the shapes that are present, cheapest first; None without colliders
    version
        grows whenever anything was made again
    """

    def __init__(self, state: Record, table: Table, world: World) -> None:
        self.state, self.table, self.registry, self._world = state, table, world.registry, world
        self.prepared: set[type[Any]] = set()  # colliders whose functions are kept ready
        self.read_by_plugins: set[str] = set()  # columns that stages of plugins read
        self.moments_asked = False  # whether one of them reads the shapes: second moments, supports
        self.sweeps_asked = False  # and whether one casts them
        self.version = 0
        self.linked: LinkedShapes | None = None
        self.parameters: ParameterRecords | None = None
        self.levels = self.own_levels = np.empty((1, 0), np.int8)
        self._colliders: list[type[Any]] = []  # that are present, cheapest first
        self._masks: list[np.ndarray] = []  # of the linked shapes: which bodies have them
        self._excluded = np.empty(0, np.int64)  # rows that are taken out
        self._off = np.empty((0, 0), bool)  # (rows, colliders): which of those that bodies have are not enabled
        self._off_known = True  # whether all that follows from that is up to date
        self._enabled, self._enabled_version = np.empty((0, 0), bool), -1  # then, and the scene's version
        self.stretches = np.zeros(0, bool)  # bodies whose box is stretched by rotation inside of a cheaper level
        self.rotated = False
        self.structure = self.static_version = -1  # of the table and the registry, when they were followed last
        self.rotated_columns: dict[str, np.ndarray] = {}
        self._axes = np.empty((0, state.dimensions, state.dimensions))
        self._moved = MovedColumns()  # those that move with the rows
        self._keeps = False  # whether they do
        self._zero: list[np.ndarray] = []  # those of ZERO_WHERE_STATIC that there are
        self._zero_version = -1
        self._zero_rows = 0, 0  # the rows of static bodies, when these columns were made 0 in them
        self._columns_made = 0  # changes whenever one of them may be another array
        self._kept_version: Any = None
        self._columns_version = self._shapes_version = -1  # of the table, when its columns were bound
        self._built_for: Any = None  # what the scene was made for, beside the rows
        self._several = False  # bodies have several colliders
        self._arrived, self._arrived_in = np.empty(0, np.int64), -1  # rows, and the table's version that they are of
        table.on_rows_moved = self._move_rows

    @property
    def seen_version(self) -> tuple[int, int, int]:
        """Another one whenever shapes, rows, or where the bodies are may have changed."""
        return self.version, self.table.static_version, self.state.motion_version

    # -- structure --------------------------------------------------------------------------------

    def shapes(self) -> Sequence[Shape]:
        """The shapes that are present, by number."""
        return self.linked.shapes if self.linked is not None else ()

    def refresh(self) -> bool:
        """Follow which bodies and colliders there are; True if that has changed."""
        table = self.table
        key = table.version + table.members_version + self.registry.version  # all of them only grow
        if key == self.structure:
            return False
        self.structure = key
        self.version += 1
        self._count_rows()
        built_for = (table.members_version, self.registry.version, table.capacity, self._present_colliders())
        if built_for != self._built_for or not self._place_arrivals():
            self._built_for = None  # until it is done
            self._build(in_order(self.registry, built_for[-1]))
            self._built_for = built_for
        return True

    def _count_rows(self) -> None:
        """What the records know of the table's rows."""
        state, table = self.state, self.table
        count, moving = table.count, table.stops[1]
        if self._zero_version != self._columns_made:
            self._zero = [column for name in ZERO_WHERE_STATIC if len(column := getattr(state.bodies, name))]
            self._zero_version, self._zero_rows = self._columns_made, (0, 0)
        if moving < count:
            table.arrays["linear_velocity"][moving:count] = 0.0
            start, stop = self._zero_rows if self._zero_rows[0] < self._zero_rows[1] else (count, count)
            for low, high in ((moving, min(count, start)), (max(moving, stop), count)):
                if low < high:
                    for column in self._zero:
                        column[low:high] = 0
        self._zero_rows = moving, count
        if self._columns_version != table.columns_version:
            self.bind_columns()
        state.count, state.version = count, table.version
        sleepers, state.dynamic, state.moving, _ = table.blocks
        if state.first > 0:
            state.statics_version += int(state.sleepers != sleepers)  # other rows sleep
            state.first = min(state.first, sleepers)
        state.sleepers = sleepers

    def _build(self, present: list[type[Any]]) -> None:
        """Make everything that depends on which colliders there are."""
        table, bodies, count, moving = self.table, self.state.bodies, self.table.count, self.table.stops[1]
        self.state.slot_count = len(table.stacked_types(Collider.stack))
        self.reserve(*START_COLUMNS, *UNDO_COLUMNS, *(name for name in BODY_COLUMNS if len(getattr(bodies, name))))
        if present:
            self.reserve(*COLLISIONS)
            if len(bodies.static_position) < count - moving:
                bodies.reserve((count - moving) * 3 // 2, "static_position")
        present = self._place_levels(present)
        self.state.collides = bool((self.levels[0, :moving] >= 0).any())
        self.linked = linked_shapes(self.registry, present, self.state.dimensions) if present else None
        self.parameters = ParameterRecords(self.linked, self.moments_asked) if self.linked else None
        self._bind_shapes()
        self.state.rotation_stale = True
        self.state.statics_version += 1
        self.state.warm_start.rows_version[:] = -1  # what has lost its shape bears nothing

    # -- bodies that come and go ------------------------------------------------------------------

    def _move_rows(self, plan: RowPlan) -> None:
        """The table's rows move, and those of the columns that are kept go along; if they cannot, all is made again."""
        table = self.table
        if self._kept_version != (self._columns_made, table.capacity):
            self._bind_kept()
        if self._keeps:
            self._moved.move(plan)
            followed = self.structure == table.version + table.members_version + self.registry.version
            self._arrived = plan.fresh
            self._arrived_in = table.version + 1 if followed else -1  # all that have come since the last refresh
        else:
            self._built_for = None

    def _bind_kept(self) -> None:
        """Other columns are kept than before."""
        bodies, capacity = self.state.bodies, self.table.capacity
        kept = [*(getattr(bodies, name) for name in KEPT_COLUMNS), *self.rotated_columns.values()]
        kept = [column for column in kept if len(column)]  # without colliders there is the first alone
        if len(self._axes) == capacity:  # else they are made again, see refresh_rotation
            kept += [self._axes, bodies.axes_rotation.reshape(capacity, -1)]
        fresh: list[np.ndarray | None] = [ARRIVED, *[None] * (len(kept) - 1)]
        if self._off.size:
            kept, fresh = [*kept, self._off], [*fresh, np.zeros_like(self._off[:1])]
        if self.own_levels is not self.levels:
            kept, fresh = [*kept, self.own_levels[-1]], [*fresh, None]
        self._keeps = bool(kept) and not self._several and all(len(column) == capacity for column in kept)
        if self._keeps:
            self._moved.bind(kept, fresh)
        self._kept_version = self._columns_made, capacity

    def _place_arrivals(self) -> bool:
        """Find the shapes of the bodies that have come since the last time; False if all has to be made again."""
        state, table, count, moving = self.state, self.table, self.table.count, self.table.stops[1]
        bodies, linked = state.bodies, self.linked
        if len(self._excluded) or (linked and count - moving > len(bodies.static_position)):
            return False
        if linked and self._shapes_version != table.columns_version:
            self._bind_shapes()
        else:
            self.follow_arrays()
        shapes, slots, collides = bodies.shape[:count], state.shapes.slots, False
        arrived = self._arrived if self._arrived_in == table.version else (shapes == ARRIVED).nonzero()[0]
        if len(arrived) <= FEW:
            for row in arrived.tolist():
                own = [index for index, mask in enumerate(self._masks) if mask.item(row)]
                if len(own) > 1:
                    return False
                shapes[row] = shape = own[0] if own else -1
                if linked:
                    bodies.collider_slot[row] = slots[shape]
                collides = collides or (shape >= 0 and row < moving)
        else:
            shapes[arrived] = -1
            for index, mask in enumerate(self._masks):
                rows = arrived[mask[arrived]]
                if np.count_nonzero(shapes[rows] >= 0):
                    return False
                shapes[rows] = index
            if linked:
                bodies.collider_slot[arrived] = slots[shapes[arrived]]
        if self.own_levels is not self.levels:
            self.own_levels[-1, arrived] = shapes[arrived]  # those that are not enabled are found afterwards
        state.collides = collides or bool(moving and shapes[:moving].max() >= 0)
        spins = self.spins()  # then each step sees which axes are old
        if linked and (self.rotated != spins or (linked.needs_axes and not spins)):
            state.rotation_stale = True
        return True

    def forget(self) -> None:
        """Make everything again at the next refresh."""
        self.structure, self._built_for = -1, None

    def _present_colliders(self) -> list[type[Any]]:
        table, count = self.table, self.table.count
        known = table.stacked_types(Collider.stack)
        return [c for c in known if c in self.prepared or np.count_nonzero(table.has_mask(c)[:count])]

    def bind_columns(self) -> None:
        """The table's arrays, which are others after it has grown, and more when a column on demand is made."""
        bodies, colliders, table = self.state.bodies, self.state.colliders, self.table
        self._columns_version = table.columns_version
        for name in TABLE_COLUMNS:
            if name in table.arrays:
                setattr(bodies, name, table.arrays[name])
        bodies.total_damping = bodies.linear_damping
        for name in HIDDEN_COLUMNS:
            if f"_{name}" in table.arrays:
                setattr(bodies, name, table.arrays[f"_{name}"])
        for name in ("rotation", "previous_rotation"):
            if name in table.arrays:
                setattr(bodies, name, table.arrays[name].reshape(-1))
        for name in COLLIDERS.fields:
            stack = table.stacks.get(f"{Collider.stack}.{name}")
            if stack is not None:
                setattr(colliders, name, stack)

    def make(self, *names: str) -> None:
        """Columns on demand that a stage asks for, of the table or of the records alone."""
        for name in names:
            shown = f"_{name}" if name in HIDDEN_COLUMNS else name
            if shown in self.table.on_demand:
                self.table.make(shown)
            else:
                self.reserve(name)

    def reserve(self, *names: str) -> None:
        """Room for every row that the table can hold in these columns of the bodies."""
        bodies, capacity = self.state.bodies, self.table.capacity
        for name in names:
            if len(getattr(bodies, name)) != capacity:
                self._columns_made += 1
                setattr(bodies, name, bodies.schema.fields[name].full(capacity, self.state.dimensions))

    def _place_levels(self, present: list[type[Any]]) -> list[type[Any]]:
        """Which shapes each body has, cheapest first; returns the shapes that are tested."""
        table, state, count = self.table, self.state, self.table.count
        self._colliders = present
        has, off = self._owned(slice(0, count)), self._off_now()
        own, some_off = arrange(has), bool(off.any())
        levels = self._arranged(has & ~off.T, len(own)) if some_off else own
        self._several = len(levels) > 1
        slots = np.array([table.slot_of(component) for component in present], np.int64)
        if present:
            state.bodies.collider_slot[:count] = slots[levels[-1]]
        if self._world.settings.geometry == "bounds" and len(levels) > 1:  # shapes that are never tested cost nothing
            own, levels = own[:1], levels[:1]
            tested = np.union1d(own, levels)
            used = [index for index, c in enumerate(present) if c in self.prepared or index in tested]
            levels = np.where(levels < 0, -1, np.searchsorted(used, levels)).astype(np.int8)
            own = np.where(own < 0, -1, np.searchsorted(used, own)).astype(np.int8) if some_off else levels
            present, slots = [present[index] for index in used], slots[used]
        state.shapes.slots = slots
        self._set_levels(levels, own, self.table.capacity if present else 0)
        if off.size:
            self._off[: len(off)], self._off_known = off, self._off_known and not some_off
        if len(levels) > 1:
            self.stretches = self._stretches(levels)
        return present

    def _owned(self, rows: Any) -> np.ndarray:
        """(colliders, n): which of the colliders that are present these rows have."""
        masks = [self.table.has_mask(component)[rows] for component in self._colliders]
        return np.array(masks, bool).reshape(len(masks), len(self.table.arrays["entity"][rows]))

    def _off_now(self) -> np.ndarray:
        """(n, colliders): which of these the rows have, and are not enabled; none if all colliders ever were."""
        enabled, count = self.table.stacks.get(ENABLED), self.table.count
        if enabled is None:
            return np.zeros((0, 0), bool)
        slots = np.array([self.table.slot_of(component) for component in self._colliders], np.int64)
        return (self._owned(slice(0, count)) & ~enabled[slots, :count]).T

    @staticmethod
    def _arranged(has: np.ndarray, count: int) -> np.ndarray:
        """As :func:`arrange`, that many levels."""
        levels = arrange(has)
        return levels[np.minimum(np.arange(count), len(levels) - 1)]

    def _stretches(self, levels: np.ndarray) -> np.ndarray:
        """Mask of the bodies that have a box inside of a cheaper level."""
        boxes = self._colliders.index(AABBCollider) if AABBCollider in self._colliders else len(self._colliders)
        return (levels[1:] == boxes).any(axis=0) & (levels[0] != boxes)

    def _set_levels(self, levels: np.ndarray, own: np.ndarray, rows: int) -> None:
        """The last level decides; it is also known as the body's shape. own: the same of all colliders, enabled or not.

        rows: that many have places of their shapes, none while there is no shape, present or prepared.
        """
        state, bodies, capacity = self.state, self.state.bodies, self.table.capacity
        several = len(levels) > 1
        self._columns_made += 1
        self.levels = self.own_levels = bodies.own_levels = np.full((len(levels), capacity), -1, np.int8)
        self.levels[:, : levels.shape[1]] = levels
        self._excluded = np.empty(0, np.int64)
        self._off = np.zeros((capacity if ENABLED in self.table.stacks else 0, len(self._colliders)), bool)
        if own is not levels:
            self._part_levels()
            self.own_levels[:, : own.shape[1]] = own
        offsets = np.zeros((len(levels), rows, state.dimensions))
        bodies.levels, bodies.level_offsets = self.levels, offsets
        bodies.shape, bodies.offset = self.levels[-1], offsets[-1]
        bodies.level_not_enclosing = np.zeros(capacity if several else 0, bool)
        self.stretches = np.zeros(levels.shape[1] if several else 0, bool)
        state.several_levels, state.level_count = several, len(levels)

    def _part_levels(self) -> None:
        """Something is not enabled: the shapes that bodies have are others than those that are tested."""
        self.own_levels = self.state.bodies.own_levels = self.levels.copy()
        self._columns_made += 1

    def _place(self, rows: np.ndarray) -> None:
        """Find the shapes of these rows again: of what is taken out none, of others the colliders that are enabled."""
        has = self._owned(rows) & ~np.isin(rows, self._excluded)
        for levels in (self.own_levels, self.levels):  # the same if all are enabled
            if levels is self.levels and self._off.size:
                has &= ~self._off[rows].T
            levels[:, rows] = self._arranged(has, len(levels))
        if self.state.several_levels:
            self.stretches[rows] = self._stretches(self.levels[:, rows])

    def exclude(self, out: np.ndarray) -> None:
        """Bodies (count,) that take no part: they have no shape as long as that is so, and no say in what all share."""
        count, moving, bodies = self.table.count, self.table.stops[1], self.state.bodies
        if not len(bodies.quarantined):
            self.reserve("quarantined")
        self.state.statics_version += int((bodies.quarantined[moving:count] != out[moving:]).any())
        bodies.quarantined[:count] = out
        rows, self._excluded = self._excluded, np.flatnonzero(out)
        self._place(np.union1d(rows, self._excluded))

    def follow_enabled(self) -> bool:
        """Colliders that are not enabled have no shape among those that are tested; False if all has to be made again
        for that."""
        enabled = self.table.stacks[ENABLED][:, : self.table.count]
        if self._off_known and self._enabled_version == self.version and np.array_equal(enabled, self._enabled):
            return True  # usual
        self._enabled = enabled.copy()
        state, bodies, moving, off = self.state, self.state.bodies, self.table.stops[1], self._off_now()
        if off.size and not self._off.size:
            self._off = np.zeros((self.table.capacity, len(self._colliders)), bool)
            self._columns_made += 1
        rows = (off != self._off[: len(off)]).any(axis=1).nonzero()[0]
        if self._off_known and not len(rows):
            self._enabled_version = self.version
            return True
        if len(rows) and self._several and self._world.settings.geometry == "bounds":
            self._off_known = False
            return False  # other shapes may have to be tested
        self._off[rows], self._off_known = off[rows], True
        if len(rows):
            if self.own_levels is self.levels:
                self._part_levels()
            self._place(rows)
            shapes = self.levels[-1, rows]
            bodies.collider_slot[rows[shapes >= 0]] = state.shapes.slots[shapes[shapes >= 0]]
            state.statics_version += int(rows[0] < state.first or rows[-1] >= moving)
        state.rotation_stale |= state.several_levels
        state.warm_start.rows_version[:] = -1  # what has lost its shape bears nothing
        state.collides = bool((self.levels[0, :moving] >= 0).any())
        if not state.collides:
            state.warm_start.counts[:] = 0
        self.version += 1
        self._enabled_version = self.version
        return True

    def forget_enabled(self) -> None:
        """The records are those of another time: see once more to what follows from colliders that are not enabled."""
        self._off_known = False

    def _bind_shapes(self) -> None:
        """The parameter columns of each shape: as the components have them, and as they are in the world."""
        shapes = () if self.linked is None else self.linked.shapes
        self._masks = [self.table.has_mask(shape.component) for shape in shapes]
        if self.linked is None or self.parameters is None:
            self.state.shapes.count = 0
            return
        for number, shape in enumerate(self.linked.shapes):
            keys = {name: shape.component.columns[name].key for name in shape.columns}
            columns = {name: self.table.make(key) for name, key in keys.items()}
            rotated = None
            if self.rotated and shape.turned is not None:
                rotated = {name: self._rotated_column(key, columns[name]) for name, key in keys.items()}
            self.parameters.bind(number, columns, self._axes, rotated)
        self.parameters.fill(self.state.shapes)
        self._shapes_version = self.table.columns_version

    def follow_arrays(self) -> None:
        """Some rows have other arrays, perhaps in the middle of a step."""
        if self.parameters is not None:
            self.parameters.follow_arrays()

    def _rotated_column(self, key: str, own: np.ndarray) -> np.ndarray:
        """Room for a shape's parameter as it is in the world."""
        column = self.rotated_columns.get(key)
        if column is None or column.shape != own.shape:
            column = self.rotated_columns[key] = np.zeros_like(own)
            self._columns_made += 1
        return column

    def link_shapes(self, sweeps: bool) -> None:
        """Compile or load the functions of the shapes; sweeps: also those of swept bodies and casts."""
        if self.linked is not None:
            self.linked.fill(self.state.shapes, sweeps, self.moments_asked)

    # -- what changes from step to step -----------------------------------------------------------

    def refresh_rotation(self) -> None:
        """Axes of the bodies where something needs them, of those alone that are turned as they were not before; the
        shapes' parameters as they are in the world then."""
        if self.linked is None:
            return
        table, bodies = self.table, self.state.bodies
        rotation = self._sound_rotation()
        before, self.rotated = self.rotated, self.spins() or any_rotated(rotation)
        self.state.rotated, self.state.rotation_stale = self.rotated, False
        count, needed = table.count, self.rotated or self.linked.needs_axes
        fresh = needed and len(self._axes) != table.capacity
        if fresh:
            self._axes = np.zeros((table.capacity, self.state.dimensions, self.state.dimensions))
            self._columns_made += 1
            bodies.axes = self._axes.reshape(-1)
            bodies.axes_rotation = np.full(table.capacity * (1 if self.state.dimensions == 2 else 4), np.nan)
        if fresh or self.rotated != before:
            self._bind_shapes()
            self.state.statics_version += 1
        if needed:
            known = bodies.axes_rotation[: rotation.size].reshape(rotation.shape)
            old = rotation != known  # of the four numbers of a quaternion any
            rows = (old if old.ndim == 1 else old.view(np.int32)[:, 0]).nonzero()[0]
            if len(rows):
                self._axes[rows] = axes_of(rotation[rows], self.state.dimensions)
                known[rows] = rotation[rows]
        if self.state.several_levels:  # a box that is stretched may reach out of the level around it
            turned = rotation != 0.0 if self.state.dimensions == 2 else rotation[:, 1:].any(axis=1)
            bodies.level_not_enclosing[:count] = self.stretches & turned

    def spins(self) -> bool:
        """Whether any body has a Spin, so that it may turn within the step."""
        table = self.table
        return Spin in table.component_types and bool(table.has_mask(Spin)[: table.count].any())

    def _sound_rotation(self) -> np.ndarray:
        """The column, none for bodies that are taken out."""
        rotation, rows = self.table.column("rotation"), self._excluded
        if len(rows):
            rotation = rotation.copy()
            rotation[rows] = self.table.default_of("rotation") if rotation.ndim == 1 else (1.0, 0.0, 0.0, 0.0)
        return rotation

    def refresh_statics(self) -> None:
        """Static bodies are read, and their boxes made, again if any of them may have changed; they stay without a
        velocity, whatever the game has written."""
        table = self.table
        if table.static_version != self.static_version:
            self.static_version = table.static_version
            self.state.statics_version += 1
            table.arrays["linear_velocity"][table.stops[1] : table.count] = 0.0


def any_rotated(rotation: np.ndarray) -> bool:
    """Whether any angle is not 0, in 3D any quaternion has a part beside the first."""
    return bool(rotation.any() if rotation.ndim == 1 else rotation[:, 1:].any())


def make_table(dimensions: int) -> Table:
    """The table of a world's bodies, with the columns that no component has. Those of sleep move with the rows; none of
    them has an array before something sleeps."""
    table = Table(dimensions)
    for component in (Transform, RigidBody):
        table.add_component_type(component)
    table.add_array("previous_position", "vector")
    table.add_array("previous_rotation", "rotation", fill=table.default_of("rotation"), on_demand=True)
    table.add_array("force", "vector", on_demand=True)
    table.add_array("torque", "angular", on_demand=True)
    table.add_array("inverse_mass")
    table.add_array(STOPS, dtype=np.int8, on_demand=True)
    for name, column in (*SLEEP_COLUMNS.fields.items(), *HELD_COLUMNS.fields.items(), *DAMPING_COLUMNS.fields.items()):
        table.add_array(f"_{name}", column.item, dtype=column.dtype, on_demand=True)
    return table
