"""The physics of one world: its table, what the scene needs, and the buffers the systems hand to each other."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from ..components import AABBCollider, Collider, RigidBody, Transform
from ..framework.data.adoption import Adoption
from ..framework.data.bodies import Bodies
from ..framework.data.component import Component
from ..framework.data.table import Table
from ..framework.schedule.plan import PlannedColumn, PlannedKernel
from ..framework.settings import AUTOMATIC, MIXING_RULES
from ..framework.world.contacts import Contacts, EntityLookup
from ..framework.world.services import PhysicsServices
from . import preparation
from .ccd.search_bounds import DISCRETE, MODES
from .forces.energy import kinetic_energy, momentum, potential_energy
from .integration.flat_columns import all_finite, any_turned, invert_masses
from .integration.flight import Flight
from .integration.integrators import Integrator
from .kernels import SceneKernels, kernels_for
from .narrow_phase.buffers import PairBuffers
from .planned_columns import planned_columns
from .queries.system import Queries
from .shapes.attribute_errors import Blame
from .shapes.dispatch import TRACE_SIZE, ShapeCode, parameter_columns, shape_code
from .shapes.geometry_levels import COUNTERS, LevelCheck, arrange, check_sensors, in_order
from .shapes.pair_coverage import check_pairs
from .shapes.rotation import axes_of

if TYPE_CHECKING:
    from ..framework.world.world import World


class PhysicsState(PairBuffers, PhysicsServices):
    """What the systems share."""

    # Per row: for every body that moves, where anything has a collider, on curved paths, and where bodies are swept.
    FLIGHT = (("start_velocity", "vector", float),)
    COLLISIONS = (
        ("path_velocity", "vector", float), ("origin", "vector", float), ("size", "scalar", float),
        ("material", "scalar", np.int64), ("gravity_share", "scalar", float), ("lower", "vector", float),
        ("upper", "vector", float),
    )  # fmt: skip
    CURVES = (("path_second", "vector", float), ("path_third", "vector", float))
    SWEEPS = (("room", "scalar", float), ("roam_lower", "vector", float), ("roam_upper", "vector", float))

    def __init__(self, world: World, dimensions: int, gravity: Any) -> None:
        self.world = world
        self.dimensions = dimensions
        self.like = (0.0,) * dimensions
        self.set_gravity(gravity)
        self.table = Table(dimensions)
        self.table.clock = world.clock  # type: ignore[attr-defined]
        self.table.forces_summed = False  # type: ignore[attr-defined]
        for component in (Transform, RigidBody):
            self.table.add_component_type(component)
        for key in ("previous_position", "force"):
            self.table.add_array(key, "vector")
        self.table.add_array("inverse_mass")
        self.scratch: dict[str, np.ndarray] = {}  # per row, made anew within a step or when rows have moved
        self._allocate_scratch(False)
        self.adoption = Adoption(self.table, Transform, _makes_body, LevelCheck(self.table, world.registry))
        self.bodies = Bodies(self.table)
        self.lookup = EntityLookup(self._living_with)
        self.contacts = Contacts(dimensions, self.lookup, self._running_step)
        self.queries = Queries(self)
        PairBuffers.__init__(self, dimensions)
        self.pair_counters.update(dict.fromkeys(COUNTERS, 0))
        self._integrators: dict[type[Integrator], Integrator] = {}
        self.preparing = False  # a small world in which all shapes are together, see preparation
        self.prepared: set[type[Any]] = set()  # colliders whose kernels are kept ready
        self.structure: Any = None
        self.structures = 0  # how often refresh_structure has made everything anew
        self.code: ShapeCode | None = None
        self.kernels: SceneKernels | None = None
        self.shapes: tuple[Any, ...] = ()
        self.world_shapes: tuple[Any, ...] = ()
        self.slots = np.empty(0, np.int64)
        self._set_levels(np.empty((1, 0), np.int8))
        self.rank = np.empty(0, np.int64)
        self.axes = np.empty((0, dimensions, dimensions))
        self.trace, self.blame = np.zeros(TRACE_SIZE, np.int64), Blame(self)
        self.turned = False
        self._unturned: int | None = None  # the structure that was last seen with nothing turned
        self.collides = False
        self.limits_speed = False
        self.pushed = True  # whether applied_force or step_force may hold something that has to be cleared
        self.unforced = False  # whether nothing acts on any body in this step, unless a system of the game adds it yet
        self.sweeping = False  # whether some bodies are swept in this step
        self.sweep_of: tuple[int, Any] = (DISCRETE, self.table.arrays["ccd"])
        self.known_until = math.inf  # s since the start of the step, up to which all pairs that may meet are known
        self.moved = False  # whether the columns hold a motion from previous_position to position
        self.path_degree = 1
        self.motion_stamp = 0

    # -- structure --------------------------------------------------------------------------------

    def refresh_structure(self) -> None:
        """What follows from which bodies and colliders there are."""
        table = self.table
        structure = (
            table.version, table.members_version, tuple(table.component_types), self.world.settings.geometry,
            self.world.registry.version,
        )  # fmt: skip
        if structure == self.structure:
            return
        self.structure = structure
        self.structures += 1
        count, arrays = table.count, table.arrays
        arrays["linear_velocity"][table.stops[1] : count] = 0.0
        known = table.stacked_types(Collider.stack)
        present = [c for c in known if c in self.prepared or table.has_mask(c)[:count].any()]
        present = in_order(self.world.registry, present)
        self._allocate_scratch(bool(present))
        masks = [table.has_mask(component)[:count] for component in present]
        levels = arrange(np.array(masks).reshape(len(present), count))
        slots = np.array([table.slot_of(component) for component in present], np.int64)
        for group in (self.FLIGHT, self.COLLISIONS, self.CURVES):  # what does not move may be where something did
            for key, item, _ in group:
                if item == "vector" and len(self.scratch[key]):
                    self.scratch[key][table.stops[1] : count] = 0.0
        if present:
            self.scratch["material"][:count] = slots[levels[-1]]
        if self.world.settings.geometry == "bounds" and len(levels) > 1:  # shapes that are never tested cost nothing
            levels = levels[:1]
            used = [index for index, c in enumerate(present) if c in self.prepared or (levels == index).any()]
            levels = np.where(levels < 0, -1, np.searchsorted(used, levels)).astype(np.int8)
            present, slots = [present[index] for index in used], slots[used]
        self._set_levels(levels)
        boxes = present.index(AABBCollider) if AABBCollider in present else len(present)
        if len(levels) > 1:
            self.stretches = (levels[1:] == boxes).any(axis=0) & (levels[0] != boxes)
        self.collides = bool((levels[0, : table.stops[1]] >= 0).any())
        self.slots = slots
        self.code = shape_code(self.world.registry, present, self.dimensions) if present else None
        self.kernels = kernels_for(self.code) if self.code else None
        self.rank = np.empty(count if self.code else 0, np.int64)
        if self.code:
            self.rank[np.argsort(arrays["entity"][:count], kind="stable")] = np.arange(count)
        self._bind_shapes()

    def _set_levels(self, levels: np.ndarray) -> None:
        """Room for what follows from the levels (levels, n); the last one decides, and others know it as the shape."""
        count, capacity = len(levels), self.table.capacity
        self.levels = np.full((count, capacity), -1, np.int8)
        self.levels[:, : levels.shape[1]] = levels
        self.level_offsets = np.zeros((count, capacity if (levels >= 0).any() else 0, self.dimensions))
        self.scratch["shape"], self.scratch["offset"] = self.levels[-1], self.level_offsets[-1]
        self.stretches = np.zeros(levels.shape[1] if count > 1 else 0, bool)
        self.outgrown = np.zeros(capacity if count > 1 else 0, bool)

    def _bind_shapes(self) -> None:
        """The parameter columns of each shape: as given, and as they are in the world."""
        shapes, world_shapes = [], []
        for shape in self.code.shapes if self.code else ():
            keys = {name: shape.component.columns[name].key for name in shape.columns}
            columns = {name: self.table.arrays[key] for name, key in keys.items()}
            shapes.append(parameter_columns(shape, columns, self.axes))
            if shape.turned is None or not self.turned:
                world_shapes.append(shapes[-1])
                continue
            for name, key in keys.items():
                twin = self.scratch.get(key)
                if twin is None or len(twin) != len(columns[name]):
                    self.scratch[key] = np.zeros_like(columns[name])
                columns[name] = self.scratch[key]
            world_shapes.append(parameter_columns(shape, columns, self.axes))
        self.shapes, self.world_shapes = (*shapes, self.trace), (*world_shapes, self.trace)

    def refresh_rotation(self) -> None:
        """Axes of the bodies where something needs them; the shapes' parameters as they are in the world then."""
        if self.code is None:
            return
        before, self.turned = self.turned, any_turned(self.table.count, self.table.arrays["rotation"])
        if not self.turned and self._unturned == self.structures:
            return
        self._unturned = None if self.turned else self.structures
        count, rotation = self.table.count, self.table.column("rotation")
        fresh = (self.turned or self.code.rotates) and len(self.axes) != self.table.capacity
        if fresh:
            self.axes = np.zeros((self.table.capacity, self.dimensions, self.dimensions))
        if fresh or self.turned != before:
            self._bind_shapes()
        if self.turned or self.code.rotates:
            self.axes[:count] = axes_of(rotation, self.dimensions)
        if len(self.levels) > 1:  # a box that is stretched may reach out of the level around it
            turned = rotation != 0.0 if self.dimensions == 2 else rotation[:, 1:].any(axis=1)
            self.outgrown[:count] = self.stretches & turned

    def _allocate_scratch(self, colliders: bool) -> None:
        """Room for every row the table can hold, in what is needed with colliders or without."""
        capacity = self.table.capacity
        with_colliders = (self.COLLISIONS, capacity if colliders else 0)
        for group, rows in ((self.FLIGHT, capacity), with_colliders, (self.CURVES, 0), (self.SWEEPS, 0)):
            for key, item, dtype in group:
                if key not in self.scratch or (rows and len(self.scratch[key]) != rows):
                    self.scratch[key] = np.zeros((rows, self.dimensions) if item == "vector" else rows, dtype)

    def allocate_curves(self, degree: int) -> None:
        """Room for the path's second and third coefficient, once an integrator needs it."""
        if degree > 1:
            self._allocate_late(self.CURVES)

    def _allocate_late(self, group: tuple[tuple[str, str, type], ...]) -> None:
        capacity = self.table.capacity
        if len(self.scratch[group[0][0]]) != capacity:
            for key, item, dtype in group:
                self.scratch[key] = np.zeros((capacity, self.dimensions) if item == "vector" else capacity, dtype)

    def begin_sweeps(self) -> None:
        """Whether bodies are swept in this step, and room for what that needs."""
        mode, ccd = MODES[self.world.settings.collision], self.table.arrays["ccd"]
        self.sweeping = self.collides and bool(mode != DISCRETE or ccd[: self.table.stops[1]].any())
        self.sweep_of = mode, ccd
        if self.sweeping:
            self._allocate_late(self.SWEEPS)

    def motion(self, origin: np.ndarray) -> tuple[Any, ...]:
        """The paths of the bodies within the step, as kernels take them; origin (n, d): where they begin."""
        scratch = self.scratch
        curves = scratch["path_second"], scratch["path_third"]
        return origin, scratch["path_velocity"], *curves, self.path_degree

    @property
    def integrator_name(self) -> str:
        """As the settings say, unless another one goes with the kind of collision."""
        settings = self.world.settings
        return "flight" if settings.collision == "event_driven" else settings.integrator

    def integrator(self) -> Integrator:
        make: Any = Flight
        if self.world.settings.collision != "event_driven":  # another one may be registered under the name at any time
            make = self.world.registry.integrators[self.world.settings.integrator]
        if make not in self._integrators:
            self._integrators[make] = make()
        return self._integrators[make]

    def check_settings(self, settings: Any) -> None:
        registry = self.world.registry
        for name, known in (
            ("integrator", registry.integrators),
            ("restitution_mixing", (*MIXING_RULES, *registry.mixing_rules)),
            ("friction_mixing", (*MIXING_RULES, *registry.mixing_rules)),
            ("broad_phase", (AUTOMATIC, *registry.broad_phases)),
        ):
            value = getattr(settings, name)
            if value not in known:
                near = difflib.get_close_matches(value, known, 1)
                hint = f" (did you mean {near[0]!r}?)" if near else ""
                raise ValueError(f"Settings.{name} must be one of {', '.join(known)}, got {value!r}{hint}")

    def set_gravity(self, gravity: Any) -> None:
        vector = np.array(gravity, float)
        if vector.ndim == 0 and vector == 0:
            vector = np.zeros(self.dimensions)
        if vector.shape != (self.dimensions,) or not np.isfinite(vector).all():
            raise ValueError(f"gravity must be {self.dimensions} finite numbers, got {gravity!r}")
        vector.flags.writeable = False
        self.gravity = vector
        self.gravity_numbers = tuple(vector.tolist())  # as kernels take it

    # -- around a step ----------------------------------------------------------------------------

    def begin_step(self) -> None:
        self.refresh_structure()
        table, arrays = self.table, self.table.arrays
        self.limits_speed = invert_masses(
            table.stops[0], table.count, arrays["mass"], arrays["inverse_mass"], arrays["max_linear_speed"]
        )
        check_sensors(self)
        check_pairs(self)
        self.refresh_rotation()
        self.begin_sweeps()
        self.pushed = True
        self.unforced = False
        self.moved = False
        table.forces_summed = False  # type: ignore[attr-defined]
        self.motion_stamp += 1
        self.begin_pairs()

    def abandon_step(self) -> None:
        self.moved = False
        self.motion_stamp += 1
        self.table.forces_summed = False  # type: ignore[attr-defined]

    def end_step(self) -> None:
        self.moved = False
        self.motion_stamp += 1
        self.report_faults("")

    def report_faults(self, prefix: str) -> None:
        """Name the bodies whose state is not finite in the world's faults; they disturb no others."""
        moving, arrays = self.table.stops[1], self.table.arrays
        if all_finite(moving, arrays["position"], arrays["linear_velocity"]):
            return
        for name in ("position", "linear_velocity"):
            column = arrays[name][:moving]
            for row in np.flatnonzero(~np.isfinite(column).all(axis=1)).tolist():
                entity = int(arrays["entity"][row])
                self.world.report_fault(f"{prefix}entity {entity}: {name} is {column[row].tolist()}")

    def end_window(self) -> None:
        if self.pushed or self.table.everything_kept:
            self.table.arrays["applied_force"][: self.table.stops[0]] = 0.0
        self.table.arrays["applied_frame"][: self.table.stops[0]] = -1  # else state_hash would tell frame rates apart

    def tracking_state(self) -> Any:
        return self.contact_events.touching, self.contact_solver.memory

    def restore_tracking(self, state: Any) -> None:
        self.contact_events.touching, memory = state
        self.contact_solver.restore(memory)

    # -- looking inside ---------------------------------------------------------------------------

    def look_ahead(self, others_write: bool) -> None:
        self.refresh_structure()
        self.refresh_rotation()
        self.begin_sweeps()
        self.table.everything_kept = others_write
        limits = self.table.arrays["max_linear_speed"][: self.table.stops[0]]
        self.limits_speed = not np.isnan(limits).all()

    def planned_kernels(self) -> Iterator[PlannedKernel]:
        yield PlannedKernel("invert_masses", "1 / mass of what moves freely; whether any has a max_linear_speed")
        if self.code is not None:
            yield PlannedKernel("any_turned", "whether any Transform.rotation is set")
        yield PlannedKernel("all_finite", "positions and velocities, for world.faults")

    def planned_columns(self) -> Iterator[PlannedColumn]:
        return planned_columns(self)

    # -- answers ----------------------------------------------------------------------------------

    def kinetic_energy(self) -> float:
        return kinetic_energy(self.bodies.dynamic)

    def potential_energy(self) -> float:
        return potential_energy(self)

    def momentum(self) -> np.ndarray:
        return momentum(self.bodies.dynamic, self.dimensions)

    def counters(self) -> dict[str, int]:
        return {**self.pair_counters, "force_evaluations": self.forces.evaluations}

    def reset_counters(self) -> None:
        self.forces.evaluations = 0
        self.pair_counters = dict.fromkeys(self.pair_counters, 0)

    def prepare(self, components: tuple[type[Any], ...]) -> None:
        """See :mod:`preparation`."""
        preparation.prepare(self, components)

    def keep_ready(self, colliders: set[type[Any]]) -> None:
        """From now on the kernels are those for these shapes and others, whether there are bodies of them or not."""
        self.prepared |= colliders
        self.structure = None

    def _running_step(self) -> int | None:
        return self.world.step_count if self.table.in_step else None

    def _living_with(self, entity: int, component: type[Any]) -> bool:
        return self.world.entity_exists(entity) and self.world.has_component(entity, component)

    # the systems, set by the plugin that makes them
    forces: Any
    broad_phase: Any
    narrow_phase: Any
    contact_events: Any
    contact_solver: Any
    event_queue: Any = None  # once something may bounce
    start_positions: np.ndarray  # where the bodies were at the start of the step


def _makes_body(component: type[Component]) -> bool:
    """A Transform together with one of these is a body."""
    return component is RigidBody or issubclass(component, Collider)
