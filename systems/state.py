"""The physics of one world: its table, what the scene needs, and the buffers the systems hand to each other."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..components import Collider, RigidBody, Transform
from ..framework.adoption import Adoption
from ..framework.bodies import Bodies
from ..framework.component import Component
from ..framework.contacts import Contacts, EntityLookup
from ..framework.hits import Hits
from ..framework.services import PhysicsServices
from ..framework.table import Table
from .energy import kinetic_energy, momentum, potential_energy
from .integrators import Integrator
from .kernels import SceneKernels, kernels_for
from .pair_buffers import PairBuffers
from .queries import Queries
from .rotation import axes_of
from .shape_code import ShapeCode, shape_code

if TYPE_CHECKING:
    from ..framework.world import World


class PhysicsState(PairBuffers, PhysicsServices):
    """What the systems share."""

    SCRATCH = (
        ("start_velocity", "vector", float), ("path_velocity", "vector", float), ("origin", "vector", float),
        ("offset", "vector", float), ("size", "scalar", float), ("shape", "scalar", np.int8),
        ("gravity_share", "scalar", float), ("lower", "vector", float), ("upper", "vector", float),
    )  # fmt: skip
    CURVES = (("path_second", "vector", float), ("path_third", "vector", float))

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
        self._allocate_scratch()
        self.adoption = Adoption(self.table, Transform, _makes_body)
        self.bodies = Bodies(self.table)
        self.lookup = EntityLookup(self._living_with)
        self.contacts = Contacts(dimensions, self.lookup, self._running_step)
        self.queries = Queries(self)
        PairBuffers.__init__(self, dimensions)
        self._integrators: dict[str, Integrator] = {}
        self._structure: Any = None
        self.code: ShapeCode | None = None
        self.kernels: SceneKernels | None = None
        self.shapes: tuple[Any, ...] = ()
        self.world_shapes: tuple[Any, ...] = ()
        self.slots = np.empty(0, np.int64)
        self.rank = np.empty(0, np.int64)
        self.axes = np.empty((0, dimensions, dimensions))
        self.turned = False
        self.collides = False
        self.limits_speed = False
        self.moved = False  # whether the columns hold a motion from previous_position to position
        self.path_degree = 1
        self.motion_stamp = 0

    # -- structure --------------------------------------------------------------------------------

    def refresh_structure(self) -> None:
        """What follows from which bodies and colliders there are."""
        table = self.table
        structure = (table.version, table.members_version, tuple(table.component_types), self.world.settings.geometry)
        if structure == self._structure:
            return
        self._structure = structure
        self._allocate_scratch()
        count, arrays, scratch = table.count, table.arrays, self.scratch
        arrays["linear_velocity"][table.stops[1] : count] = 0.0
        present = [c for c in table.stacked_types(Collider.stack) if table.has_mask(c)[:count].any()]
        present.sort(key=lambda c: (self.world.registry.shapes[c].cost, c.__name__))
        shape_of = scratch["shape"]
        shape_of[:count] = -1
        precise = self.world.settings.geometry == "precise"
        for index in range(len(present)) if precise else reversed(range(len(present))):
            shape_of[:count][table.has_mask(present[index])[:count]] = index  # the last one written decides
        self.collides = bool((shape_of[: table.stops[1]] >= 0).any())
        self.slots = np.array([table.slot_of(component) for component in present], np.int64)
        self.rank = np.empty(count, np.int64)
        self.rank[np.argsort(arrays["entity"][:count], kind="stable")] = np.arange(count)
        self.code = shape_code(self.world.registry, present, self.dimensions) if present else None
        self.kernels = kernels_for(self.code) if self.code else None
        self._bind_shapes()

    def _bind_shapes(self) -> None:
        """The parameter columns of each shape: as given, and as they are in the world."""
        shapes, world_shapes = [], []
        for shape in self.code.shapes if self.code else ():
            keys = [shape.component.columns[name].key for name in shape.parameters]
            columns = tuple(self.table.arrays[key] for key in keys)
            shapes.append(columns)
            if shape.turned is None or not self.turned:
                world_shapes.append(columns)
                continue
            for key, column in zip(keys, columns, strict=True):
                twin = self.scratch.get(key)
                if twin is None or len(twin) != len(column):
                    self.scratch[key] = np.zeros_like(column)
            world_shapes.append(tuple(self.scratch[key] for key in keys))
        self.shapes, self.world_shapes = tuple(shapes), tuple(world_shapes)

    def refresh_rotation(self) -> None:
        """Axes of the bodies, if any is turned; the shapes' parameters as they are in the world then."""
        if self.code is None:
            return
        rotation = self.table.column("rotation")
        self.turned = bool((rotation if self.dimensions == 2 else rotation[:, 1:]).any())
        self.axes = axes_of(rotation, self.dimensions) if self.turned else self.axes[:0]
        self._bind_shapes()

    def _allocate_scratch(self) -> None:
        """Room for every row the table can hold."""
        capacity = self.table.capacity
        for key, item, dtype in (*self.SCRATCH, *self.CURVES):
            rows = capacity if (key, item, dtype) in self.SCRATCH else 0
            if key not in self.scratch or (rows and len(self.scratch[key]) != rows):
                self.scratch[key] = np.zeros((rows, self.dimensions) if item == "vector" else rows, dtype)

    def allocate_curves(self, degree: int) -> None:
        """Room for the path's second and third coefficient, once an integrator needs it."""
        if degree > 1 and len(self.scratch["path_second"]) != self.table.capacity:
            for key, _, dtype in self.CURVES:
                self.scratch[key] = np.zeros((self.table.capacity, self.dimensions), dtype)

    def all_layers_meet(self) -> bool:
        """Whether no layer or mask keeps any two bodies apart (usual, and then none need be looked at)."""
        stacks, count = self.table.stacks, self.table.count
        masks, layers = stacks["collider.mask"][:, :count], stacks["collider.layer"][:, :count]
        return bool((masks == -1).all() and layers.all())

    def integrator(self) -> Integrator:
        name = self.world.settings.integrator
        if name not in self._integrators:
            self._integrators[name] = self.world.registry.integrators[name]()
        return self._integrators[name]

    def check_settings(self, settings: Any) -> None:
        known = self.world.registry.integrators
        if settings.integrator not in known:
            raise ValueError(f"Settings.integrator must be one of {', '.join(known)}, got {settings.integrator!r}")

    def set_gravity(self, gravity: Any) -> None:
        vector = np.array(gravity, float)
        if vector.ndim == 0 and vector == 0:
            vector = np.zeros(self.dimensions)
        if vector.shape != (self.dimensions,) or not np.isfinite(vector).all():
            raise ValueError(f"gravity must be {self.dimensions} finite numbers, got {gravity!r}")
        vector.flags.writeable = False
        self.gravity = vector

    # -- around a step ----------------------------------------------------------------------------

    def begin_step(self) -> None:
        self.refresh_structure()
        table, arrays = self.table, self.table.arrays
        dynamic = table.stops[0]
        np.divide(1.0, arrays["mass"][:dynamic], out=arrays["inverse_mass"][:dynamic])
        arrays["inverse_mass"][dynamic : table.count] = 0.0
        self.limits_speed = not bool(np.isnan(arrays["max_linear_speed"][:dynamic]).all())
        self.refresh_rotation()
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
        moving = self.table.stops[1]
        for name in ("position", "linear_velocity"):
            column = self.table.arrays[name][:moving]
            if not np.isfinite(column.sum()):
                for row in np.flatnonzero(~np.isfinite(column).all(axis=1)).tolist():
                    entity = int(self.table.arrays["entity"][row])
                    self.world.report_fault(f"{prefix}entity {entity}: {name} is {column[row].tolist()}")

    def end_window(self) -> None:
        self.table.arrays["applied_force"][: self.table.stops[0]] = 0.0
        self.table.arrays["applied_frame"][: self.table.stops[0]] = -1  # else state_hash would tell frame rates apart

    def tracking_state(self) -> Any:
        return self.contact_events.touching

    def restore_tracking(self, state: Any) -> None:
        self.contact_events.touching = state

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

    def query_spheres(self, centres: np.ndarray, radii: np.ndarray, mask: int) -> Hits:
        return self.queries.spheres(centres, radii, mask)

    def query_sphere(self, centre: tuple[float, ...], radius: float, mask: int) -> list[int]:
        return self.queries.sphere(centre, radius, mask)

    def query_box(self, lower: tuple[float, ...], upper: tuple[float, ...], mask: int) -> list[int]:
        return self.queries.box(lower, upper, mask)

    def query_boxes(self, lower: np.ndarray, upper: np.ndarray, mask: int) -> Hits:
        return self.queries.boxes(lower, upper, mask)

    def prepare(self, components: tuple[type[Any], ...]) -> None:
        """Step a small world of such bodies, so that all they need is compiled."""
        for component in components:
            if not (isinstance(component, type) and issubclass(component, Component)):
                raise TypeError(f"prepare takes component types, got {component!r}")
        colliders = [c for c in components if issubclass(c, Collider)]
        if not colliders:
            colliders = [c for c in self.table.stacked_types(Collider.stack) if self.table.has_mask(c).any()]
        with type(self.world)(*self.world.plugins, settings=self.world.settings) as small:
            for restitution in (0.0, 1.0):
                for collider in colliders:
                    for x in (0.0, 0.1, 50.0, 50.5):
                        place = Transform([x, *(0.0,) * (self.dimensions - 1)])
                        body = RigidBody(linear_velocity=[-x, *(0.0,) * (self.dimensions - 1)])
                        small.create_entity(place, body, collider.sample(restitution=restitution))
                    small.create_entity(Transform([0.0] * self.dimensions), collider.sample(restitution=restitution))
            for _ in range(3):
                small.step()
        small.close()

    def refresh_queries(self) -> None:
        self.queries.forget()

    def _running_step(self) -> int | None:
        return self.world.step_count if self.table.in_step else None

    def _living_with(self, entity: int, component: type[Any]) -> bool:
        return self.world.entity_exists(entity) and self.world.has_component(entity, component)

    # the systems, set by the plugin that makes them
    forces: Any
    broad_phase: Any
    narrow_phase: Any
    contact_events: Any


def _makes_body(component: type[Component]) -> bool:
    """A Transform together with one of these is a body."""
    return component is RigidBody or issubclass(component, Collider)
