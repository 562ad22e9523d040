"""RESPONSE: what contacts do to the bodies: impacts first, at their times, then what rests."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..framework.schedule import Phase, System
from ..framework.settings import MIXING_RULES
from .event_queue import EventQueue
from .impacts import pairs_of_bodies
from .narrow_phase import order_of_pairs

if TYPE_CHECKING:
    from .state import PhysicsState


class Response(System):
    """Bounces pairs that approach, at the time they meet on their path, and holds those that rest.

    Reads the contacts and their ``enabled``, the path of the step, restitution; writes position, linear_velocity and
    the contacts' normal_impulse, and logs the impacts.
    """

    phase = Phase.RESPONSE
    writes = ("normal_impulse",)

    def __init__(self, state: PhysicsState) -> None:
        self._state = state
        self._queue = EventQueue(state.dimensions)

    def process(self, dt: float) -> None:
        state = self._state
        if not state.contacts_ready:
            state.narrow_phase.process(dt)
        if not state.found:
            return
        state.take_enabled()
        self._start_paths()
        struck = self._impacts(dt)
        self._resting(dt, struck)
        state.publish_contacts(final=True)

    def _start_paths(self) -> None:
        state, arrays, scratch = self._state, self._state.table.arrays, self._state.scratch
        count = state.table.count
        state.clear_pairs()
        start = "previous_position" if state.moved else "position"
        np.copyto(scratch["origin"][:count], arrays[start][:count])
        if not state.moved:  # the phase is run alone: the bodies stand where they overlap
            np.copyto(scratch["path_velocity"][:count], arrays["linear_velocity"][:count])
            np.copyto(scratch["start_velocity"][:count], arrays["linear_velocity"][:count])
            state.path_degree = 1
        scratch["gravity_share"][:count] = -1.0

    def _impacts(self, dt: float) -> np.ndarray:
        state, arrays, scratch = self._state, self._state.table.arrays, self._state.scratch
        settings, count = self.world.settings, state.table.count
        struck = np.zeros(count, np.int64)
        offsets = np.empty(count + 2, np.int64)
        neighbours = np.empty(2 * state.pairs + state.found, np.int64)
        pairs_of_bodies(
            state.pair_a, state.pair_b, state.pairs, state.hits, state.found, count, offsets, neighbours
        )
        queue = self._queue
        queue.begin()
        curves = (scratch["path_second"], scratch["path_third"])
        motion = (scratch["origin"], scratch["path_velocity"], *curves, state.path_degree)
        threshold = settings.restitution_threshold
        while not state.kernels.resolve_impacts(
            dt, state.pair_a, state.pair_b, state.responds, offsets, neighbours, state.rank, scratch["shape"],
            scratch["offset"], state.world_shapes, arrays["position"], arrays["linear_velocity"],
            scratch["start_velocity"], arrays["inverse_mass"], motion, state.table.stacks["collider.restitution"],
            state.slots, MIXING_RULES.index(settings.restitution_mixing), -1.0 if threshold is None else threshold,
            settings.max_impacts_per_step, scratch["gravity_share"], struck, state.pair_impulse, state.pair_normal,
            state.pair_point, state.pair_depth, *queue.arrays, state.like,
        ):  # fmt: skip
            queue.grow(state.found)
        state.log_impacts(queue.log_pair, queue.log_value, queue.counts)
        return struck

    def _resting(self, dt: float, struck: np.ndarray) -> None:
        state, arrays, scratch = self._state, self._state.table.arrays, self._state.scratch
        settings = self.world.settings
        threshold, slop = settings.restitution_threshold, settings.slop
        resting = state.kernels.find_resting(
            state.pair_a, state.pair_b, state.pairs, state.responds, state.hits, state.found, scratch["shape"],
            scratch["offset"], state.world_shapes, arrays["position"], arrays["linear_velocity"],
            scratch["start_velocity"], state.table.stacks["collider.restitution"], state.slots,
            MIXING_RULES.index(settings.restitution_mixing), -1.0 if threshold is None else threshold,
            scratch["gravity_share"], struck, state.pair_impulse, state.like,
        )  # fmt: skip
        state.resting = resting
        if not len(resting):
            return
        resting = resting[order_of_pairs(state.pair_a[resting], state.pair_b[resting], state.rank)]
        state.kernels.solve_resting(
            dt, resting, state.pair_a, state.pair_b, scratch["shape"], scratch["offset"], state.world_shapes,
            arrays["position"], arrays["linear_velocity"], scratch["origin"], arrays["previous_position"],
            arrays["inverse_mass"], scratch["size"], -1.0 if slop is None else slop, state.pair_impulse,
            state.pair_normal, state.pair_point, state.pair_depth, state.like,
        )  # fmt: skip

    def reason(self) -> str:
        if not self._state.collides:
            return "no colliders: nothing to do"
        return "impacts at their time on the path, then contacts at rest"
