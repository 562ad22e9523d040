"""RESPONSE: what contacts do to the bodies: impacts first, at their times, then what rests."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ...framework.schedule.phases import Phase, System
from ...framework.schedule.plan import PlannedKernel
from ...framework.settings import Settings
from ..ccd.refresh_pairs import Rounds
from ..impacts.find import DONE, FULL
from ..impacts.queue import EventQueue
from ..shapes.mixing import rule_number
from .contact_solver import ContactSolver

if TYPE_CHECKING:
    from ..state import PhysicsState


NOTHING = np.empty(0, bool)
NO_CLUSTERS = (*(np.empty(0, np.int64) for _ in range(3)), np.empty(0))


class Response(System):
    """Bounces pairs that approach, at the time they meet on their path, and holds those that rest.

    Reads the contacts and their ``enabled``, the path of the step, restitution, friction; writes position,
    linear_velocity and the contacts' normal_impulse, and logs the impacts.
    """

    phase = Phase.RESPONSE
    writes = ("normal_impulse",)

    def __init__(self, state: PhysicsState) -> None:
        self._state = state
        self._settings: Settings | None = None
        self._bounces = False
        self._rounds = Rounds(state)
        self._crossed = NOTHING  # pairs of which one does not push, and that met on their way
        state.contact_solver = self._solver = ContactSolver(state)

    @cached_property
    def _queue(self) -> EventQueue:
        queue = self._state.event_queue = EventQueue(self._state.dimensions)
        return queue

    def process(self, dt: float) -> None:
        state = self._state
        self._crossed = NOTHING
        if not state.contacts_ready:
            state.narrow_phase.process(dt)
        near = state.found if state.moved else state.pairs  # in a step, who is near at its end is among those found
        if state.sweeping and state.moved and state.known_until < dt:
            near = 1  # who is, is not known yet
        if not near and not self._solver.memory.count:
            return
        self._read_settings(state.world.settings)
        disabled = state.take_enabled()
        self._start_paths()
        self._solver.predict(dt, disabled)
        struck = self._impacts(dt, disabled)
        with state.blame:
            resting = self._resting(dt, struck)
            self._solver.solve(dt, resting, struck)
            self._publish(disabled)

    def _read_settings(self, settings: Settings) -> None:
        """As the kernels take them."""
        if settings is self._settings:
            return
        self._settings = settings
        self._restitution_rule = rule_number(self.world.registry, settings.restitution_mixing)
        self._friction_rule = rule_number(self.world.registry, settings.friction_mixing)
        self._threshold = -1.0 if settings.restitution_threshold is None else float(settings.restitution_threshold)
        self._slop = -1.0 if settings.slop is None else float(settings.slop)
        self._cap = settings.impact_cap

    def _start_paths(self) -> None:
        state, arrays, scratch = self._state, self._state.table.arrays, self._state.scratch
        count = state.table.count
        state.pair_impulse[: state.pairs] = 0.0
        start = "previous_position" if state.moved else "position"
        np.copyto(scratch["origin"][:count], arrays[start][:count])
        state.start_positions = arrays["previous_position"]
        if not state.moved:  # the phase is run alone: the bodies stand where they overlap
            np.copyto(arrays["previous_position"][:count], arrays["position"][:count])
            np.copyto(scratch["path_velocity"][:count], arrays["linear_velocity"][:count])
            np.copyto(scratch["start_velocity"][:count], arrays["linear_velocity"][:count])
            state.path_degree = 1

    def _impacts(self, dt: float, disabled: np.ndarray) -> np.ndarray:
        """Bounce what bounces; returns how often each row was struck. The ``disabled`` pairs may get new places."""
        state, arrays, scratch = self._state, self._state.table.arrays, self._state.scratch
        count, stacks = state.table.count, state.table.stacks
        struck = np.zeros(count, np.int64)
        sweeping = state.sweeping and state.moved
        if not state.found and not self._solver.any_support and not (sweeping and state.known_until < dt):
            return struck
        if not sweeping and not self._may_bounce():
            return struck
        queue, spent = self._queue, np.zeros(count, np.int64)
        queue.begin(count, state.pairs, state.known_until if sweeping else np.inf)
        self._crossed = np.zeros(state.pairs if sweeping else 0, bool)
        resolve = state.kernels.sweeping_impacts if sweeping else state.kernels.resolve_impacts
        last, clusters = np.empty(0), NO_CLUSTERS
        if sweeping:
            rows, alone = np.arange(count), np.full(count, -1, np.int64)
            last, clusters = np.full(count, -1.0), (rows, alone, rows.copy(), arrays["inverse_mass"][:count].copy())
        rules, limits = (self._restitution_rule, self._friction_rule), (self._threshold, self._slop, self._cap)
        while True:
            with state.blame:
                outcome = resolve(
                    dt, state.pair_a, state.pair_b, state.pairs, state.responds, state.hits[: state.found],
                    self._solver.supported, queue.heads, queue.links, queue.looks, state.rank, scratch["size"],
                    scratch["shape"], scratch["offset"], state.world_shapes, arrays["position"],
                    arrays["linear_velocity"], scratch["start_velocity"], arrays["inverse_mass"],
                    arrays["linear_damping"], state.start_positions, state.motion(scratch["origin"]),
                    stacks["collider.restitution"], stacks["collider.friction"], rules, scratch["material"], limits,
                    scratch["gravity_share"], struck, spent, last, clusters, state.sweep_of,
                    scratch["roam_lower"], scratch["roam_upper"], self._crossed, state.pair_impulse, state.pair_normal,
                    state.pair_point, state.pair_depth, *queue.arrays, state.like,
                )  # fmt: skip
            if outcome == DONE:
                break
            if outcome == FULL:
                queue.grow(state.pairs)
                continue
            self._crossed = self._rounds.begin(dt, queue, disabled, self._crossed)
        state.log_impacts(queue.log_pair, queue.log_value, queue.counts)
        return struck

    def _may_bounce(self) -> bool:
        """Whether a collider has a restitution; once one has had it this is not asked again: the kernel is there."""
        table = self._state.table
        self._bounces = self._bounces or bool(table.stacks["collider.restitution"][:, : table.count].any())
        return self._bounces

    def _resting(self, dt: float, struck: np.ndarray) -> np.ndarray:
        """The pairs that neither bounce nor are apart."""
        state, arrays, scratch = self._state, self._state.table.arrays, self._state.scratch
        result = np.empty(state.pairs, np.int64)
        if not state.pairs:
            return result
        count = state.kernels.find_resting(
            dt, state.pair_a, state.pair_b, state.pairs, state.responds, state.involved, state.pair_depth,
            scratch["shape"], scratch["offset"], state.world_shapes, arrays["position"], arrays["linear_velocity"],
            state.start_positions, scratch["size"],
            state.table.stacks["collider.restitution"], scratch["material"],
            self._restitution_rule, self._threshold, self._slop, scratch["gravity_share"], struck,
            self._solver.supported, self._solver.change, self._solver.travels * dt, state.pair_impulse,
            state.pair_parts, result, state.like,
        )  # fmt: skip
        return result[:count]

    def _publish(self, disabled: np.ndarray) -> None:
        """The contacts as they are now."""
        state, arrays, scratch = self._state, self._state.table.arrays, self._state.scratch
        if not state.pairs:
            state.publish_final(state.no_pairs, disabled)
            return
        touching = np.empty(state.pairs, np.int64)
        count = state.kernels.find_touching(
            state.pair_a, state.pair_b, state.pairs, state.responds, state.involved, state.resting,
            state.impact_pairs, scratch["shape"], scratch["offset"], state.world_shapes, arrays["position"],
            scratch["size"], self._crossed, state.pair_impulse, state.pair_depth, state.pair_normal,
            state.pair_point, touching, state.like,
        )  # fmt: skip
        state.publish_final(touching[:count], disabled)

    def kernels(self) -> Iterator[PlannedKernel]:
        if not self._state.collides:
            return
        near = "bodies are near each other"
        if self._state.sweeping:
            yield PlannedKernel("resolve_impacts", "bodies are swept along their paths", near)
            rare = "a blow has sent a body farther than its neighbours were known"
            for name in ("places_at", "find_rooms", "widen", "merge_pairs"):
                yield PlannedKernel(name, "who is near the bodies on their new paths", rare)
        elif self._may_bounce():
            yield PlannedKernel("resolve_impacts", "some collider has a restitution", near)
        yield PlannedKernel("find_resting", "which pairs neither bounce nor are apart", near)
        yield from self._solver.kernels()
        yield PlannedKernel("find_touching", "which pairs touch now that all is done", near)
        yield PlannedKernel("collect_contacts", "world.contacts", "bodies touch")

    def reason(self) -> str:
        if not self._state.collides:
            return "no colliders: nothing to do"
        mode = self.world.settings.collision
        if mode == "event_driven":
            return "all impacts at their true time, in order, then contacts at rest"
        if mode == "continuous":
            return "impacts at their time on the path, what is fast where it first touches, then contacts at rest"
        if self._state.sweeping:
            return "impacts at their time on the path, bodies with ccd where they first touch, then contacts at rest"
        if not self._may_bounce():
            return "contacts at rest; nothing bounces: every restitution is 0"
        return "impacts at their time on the path, then contacts at rest"
