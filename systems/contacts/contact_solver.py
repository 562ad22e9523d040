"""Contacts at rest from start to end of the response: support before the impacts, the solver after them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from ...framework.schedule.plan import PlannedKernel
from ..impacts.impulses import STOPPED
from ..shapes.mixing import rule_number
from .bodies import COLOURS, gather, put_back, squeeze
from .resting_prediction import drop_support, predict_support
from .solver import solve_contacts
from .warm_start import ContactMemory, recall, remember

if TYPE_CHECKING:
    from ..state import PhysicsState

NONE = np.empty(0, np.int64)


class ContactSolver:
    """Holds what persists between steps, and buffers that only grow."""

    def __init__(self, state: PhysicsState) -> None:
        self._state = state
        self.memory = ContactMemory(state.dimensions)
        self._spare = ContactMemory(state.dimensions)
        self._rows: tuple[np.ndarray, np.ndarray] = (NONE, NONE)
        self._rows_of: object = None
        self.supported = np.empty(0, bool)
        self._held = np.empty(0, bool)
        self.any_support = False
        self.travels = 1.0
        self._allocate_bodies(0)
        self._allocate_contacts(0)

    def _allocate_bodies(self, rows: int) -> None:
        d = self._state.dimensions
        self.change = np.empty((rows, d))
        self._place, self._used = np.full(rows, -1, np.int64), np.empty(rows, np.int64)
        self._body_rows, self._last = np.empty(rows, np.int64), np.empty(rows, np.int64)
        self._velocity, self._moved, self._acceleration = (np.empty((rows, d)) for _ in range(3))
        self._inverse_mass = np.empty(rows)

    def _allocate_contacts(self, count: int) -> None:
        d = self._state.dimensions
        self._first, self._second = np.empty(count, np.uint32), np.empty(count, np.uint32)  # no negative indices
        self._slot, self._colours, self._light, self._before = (np.empty(count, np.int64) for _ in range(4))
        self._normal, self._tangent = np.empty((count, d)), np.empty((count, d))
        self._gap, self._mass, self._friction, self._extent = (np.empty(count) for _ in range(4))
        self._impulse, self._total, self._opening, self._pushing = (np.empty(count) for _ in range(4))
        self._in_block, self._worked, self._parting = (np.empty(count, bool) for _ in range(3))
        self._active, self._soft = np.empty(count, bool), np.empty(count, bool)
        self._blocks = np.empty((count, 2), np.int64)

    def kernels(self) -> Iterator[PlannedKernel]:
        """For ``world.plan()``."""
        friction = self._state.table.stacks["collider.friction"][:, : self._state.table.count]
        rubs = "with friction" if (friction > 0.0).any() else "no collider has friction: without its sweeps"
        rest, rested = "contacts rest", "contacts rested in the step before"
        yield PlannedKernel("predict_support", "what carried a body carries it in the prediction too", rested)
        yield PlannedKernel("gather", "the resting bodies and their contacts, by colour", rest)
        yield PlannedKernel("linearise", "normal and gap of each resting contact", rest)
        yield PlannedKernel("recall", "the impulses of the step before, to start with", rest)
        yield PlannedKernel("squeeze", "light bodies between heavy ones", rest)
        yield PlannedKernel("solve_contacts", rubs, rest)
        yield PlannedKernel("put_back", "where the resting bodies are at the end", rest)
        yield PlannedKernel("remember", "the impulses, for the next step", rest)
        yield PlannedKernel("drop_support", "takes predicted support back from who was not held", rested)

    # -- before the impacts -----------------------------------------------------------------------

    def predict(self, dt: float, disabled: np.ndarray) -> None:
        """Let last step's supports push in the prediction; ``disabled``: pairs that shall not."""
        state, memory = self._state, self.memory
        count = state.table.count
        self.supported = np.zeros(count, bool)
        self.any_support = False
        if len(self._place) < count:
            self._allocate_bodies(state.table.capacity)
        if not memory.count:
            return
        memory.scale_to(dt, dt / state.world.settings.substeps)
        first, second = self._rows_now()
        if len(disabled):
            first = self._without(first, second, disabled)
        arrays, scratch = state.table.arrays, state.scratch
        self.any_support = True
        self.travels = self._force_travels()
        predict_support(
            dt, self.travels, first, second, memory.count, memory.normal, memory.total, np.empty(memory.count),
            arrays["inverse_mass"], state.table.stops[1], arrays["position"], arrays["linear_velocity"],
            scratch["path_velocity"], scratch["path_second"], state.path_degree > 1, self.supported, self.change,
            state.like,
        )  # fmt: skip

    def _force_travels(self) -> float:
        """Displacement by a constant force in one step, as a part of dt times the change of velocity."""
        if self._state.path_degree > 1:
            return 0.5
        return 0.0 if getattr(self._state.integrator(), "moves_with_old_velocity", False) else 1.0

    def _rows_now(self) -> tuple[np.ndarray, np.ndarray]:
        """The rows of the pairs in memory; -1 for what is gone."""
        table, memory = self._state.table, self.memory
        stamp = (memory, memory.stamp, table.version)
        if self._rows_of != stamp:
            count = memory.count
            self._rows = table.rows_of(memory.entity_a[:count]), table.rows_of(memory.entity_b[:count])
            self._rows_of = stamp
        return self._rows

    def _without(self, first: np.ndarray, second: np.ndarray, disabled: np.ndarray) -> np.ndarray:
        """``first`` with -1 for the pairs that are disabled."""
        state, count = self._state, self._state.table.count
        barred = state.pair_a[disabled] * count + state.pair_b[disabled]
        return np.where(np.isin(first * count + second, barred), -1, first)

    # -- after the impacts ------------------------------------------------------------------------

    def solve(self, dt: float, resting: np.ndarray, struck: np.ndarray) -> None:
        """Hold the contacts ``resting`` (pairs, canonical order) and advance their bodies again from the start.

        struck (n,): see ``impacts``.
        """
        state, arrays = self._state, self._state.table.arrays
        state.resting = resting
        if not len(resting) and not self.memory.count:
            return
        self._held = np.zeros(state.table.count, bool)
        self._solve(dt, resting)
        if self.any_support:
            drop_support(
                dt, self.travels, state.table.stops[1], self.supported, self._held, struck >= STOPPED,
                arrays["position"], arrays["linear_velocity"], self.change, state.like,
            )  # fmt: skip

    def _solve(self, dt: float, resting: np.ndarray) -> None:
        state, memory, spare, count = self._state, self.memory, self._spare, len(resting)
        if not count:
            self._swap(0, NONE, NONE, dt)
            return
        arrays, scratch, settings = state.table.arrays, state.scratch, state.world.settings
        start = state.start_positions
        if len(self._first) < count:
            self._allocate_contacts(2 * count)
        first, second, slot = self._first[:count], self._second[:count], self._slot[:count]
        normal, gap, mass = self._normal[:count], self._gap[:count], self._mass[:count]
        friction = self._friction[:count]
        impulse, tangent, total = self._impulse[:count], self._tangent[:count], self._total[:count]
        extent, worked, in_block = self._extent[:count], self._worked[:count], self._in_block[:count]
        parting = self._parting[:count]
        inverse_mass, position, velocity = arrays["inverse_mass"], arrays["position"], arrays["linear_velocity"]
        bodies = gather(
            dt, resting, state.pair_a, state.pair_b, inverse_mass, state.table.stops[1], start, scratch["origin"],
            velocity, scratch["start_velocity"], self.supported, self.change, self._place, self._body_rows,
            self._used, self._colours, np.empty(COLOURS + 2, np.int64), slot, first, second, self._velocity,
            self._moved, self._acceleration, self._inverse_mass, state.like,
        )  # fmt: skip
        stacks, slop = state.table.stacks, settings.slop
        state.kernels.linearise(
            resting, slot, state.pair_a, state.pair_b, scratch["shape"], scratch["offset"], state.world_shapes,
            position, start, scratch["size"], stacks["collider.friction"], scratch["material"],
            rule_number(state.world.registry, settings.friction_mixing), -1.0 if slop is None else slop, inverse_mass,
            state.pair_impulse, state.pair_parts, state.pair_normal, state.pair_point, normal, gap, mass, friction,
            extent, parting, state.like,
        )  # fmt: skip
        entity = arrays["entity"]
        rows_a, rows_b = state.pair_a[resting], state.pair_b[resting]
        entity_a, entity_b = entity[rows_a], entity[rows_b]
        loose = np.zeros(bodies, bool)
        any_loose = recall(
            entity_a, entity_b, slot, memory.entity_a, memory.entity_b, memory.count, memory.normal, memory.impulse,
            memory.tangent, *self._rows_now(), self._place, normal, impulse, tangent, loose, state.like,
        )  # fmt: skip
        body_mass, body_velocity, shift = self._inverse_mass[:bodies], self._velocity[:bodies], self._moved[:bodies]
        blocks = squeeze(
            first, second, normal, body_mass, self._light, self._last, self._before, in_block, self._blocks, state.like
        )
        substeps = settings.substeps
        solve_contacts(
            substeps, dt / substeps, not len(state.impact_pairs), any_loose, loose, self._active, first, second, normal,
            gap, mass, bool(friction.any()), friction, extent, parting, in_block, self._blocks[:blocks], impulse,
            tangent, total, worked, self._opening, self._pushing, self._soft, body_velocity, shift, self._acceleration,
            body_mass, state.like,
        )  # fmt: skip
        put_back(
            resting, slot, first, second, total, worked, self._body_rows, bodies, self._place, self._held, start,
            position, velocity, body_velocity, shift, body_mass, state.pair_impulse, state.like,
        )  # fmt: skip
        spare.reserve(count)
        kept = remember(
            entity_a, entity_b, slot, normal, impulse, total, tangent, spare.entity_a, spare.entity_b, spare.normal,
            spare.impulse, spare.total, spare.tangent,
        )  # fmt: skip
        if kept == count:
            self._swap(kept, rows_a, rows_b, dt)
        else:
            pushed = total[slot] > 0.0
            self._swap(kept, rows_a[pushed], rows_b[pushed], dt)

    def _swap(self, count: int, rows_a: np.ndarray, rows_b: np.ndarray, dt: float) -> None:
        """What was just remembered becomes the memory; the former one is kept, for a step that is undone."""
        self.memory, self._spare = self._spare, self.memory
        memory = self.memory
        memory.count = count
        memory.stamp += 1
        memory.step, memory.substep = dt, dt / self._state.world.settings.substeps
        self._rows = rows_a, rows_b
        self._rows_of = (memory, memory.stamp, self._state.table.version)

    def restore(self, memory: ContactMemory) -> None:
        """Go on from that memory; it is taken over."""
        if memory is self._spare:
            self._spare = self.memory
        self.memory = memory
        self._rows_of = None
        self._place[:] = -1
