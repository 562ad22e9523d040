"""NARROW: which candidates touch at the end of their motion, and how."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from ...framework.compilation import inlined, kernel
from ...framework.schedule.phases import Phase, System
from ...framework.schedule.plan import PlannedKernel
from ...framework.vectors import add, length, row, store, sub
from ..shapes.geometry_levels import COUNTERS
from ..shapes.tolerances import reach
from .filters import filtered

if TYPE_CHECKING:
    from ..shapes.dispatch import ShapeCode
    from ..state import PhysicsState


@inlined
def all_layers_meet(layers, masks, bodies):
    """Whether no layer or mask keeps any two bodies apart (usual, and then no pair need be asked)."""
    apart = False
    for slot in range(len(layers)):
        for i in range(bodies):
            apart |= masks[slot, i] != -1 or layers[slot, i] == 0
    return not apart


def make_narrow_kernel(evaluate: Any, several: bool = False) -> Callable[..., tuple[int, int, int, int, int]]:
    """The kernel that tests candidates, over the shapes of a scene; ``several``: some body has several levels.

    Known when it is compiled: levels in the loop cost other scenes 1 to 6 ns per candidate.
    """

    @kernel
    def find_contacts(
        first, second, bodies, entity, position, levels, level_offsets, outgrown, material, shapes, layers, masks,
        sensors, inverse_mass, dt, velocity, start_velocity, share, size, fixed_slop, pair_a, pair_b, responds,
        involved, pair_depth, pair_normal, pair_point, hits, hit_a, hit_b, like,
    ):  # fmt: skip
        """Drop pairs whose layers do not meet, test the rest, level by level.

        levels (levels, n): each body's shapes, the last one repeated where it has fewer than others; a pair hits if
        every level does, and the last one gives the contact. outgrown: whether a body's last level may reach out of
        one around it. material: the slot of the collider that gives layer, mask and sensor.
        pair_a, pair_b, responds, pair_depth (m,): the pairs kept, whether they push each other, and their overlap.
        involved (m,): those that touch, or are so near that the response may push them, with a negative depth. hits,
        hit_a, hit_b: the indices and entities of the contacts, which are the former and, with dt above 0, the latter;
        they have pair_normal and pair_point, in the world. share (n,): what forces change of a body's speed in this
        step, made here.
        Returns (pairs kept, hits, pairs tested by cheaper levels first, those of them that their first levels let
        pass, those of these that another level has kept apart).
        """
        for i in range(bodies):
            share[i] = length(sub(row(velocity, i, like), row(start_velocity, i, like))) if dt > 0.0 else 0.0
        all_meet = all_layers_meet(layers, masks, bodies)
        kept, found = 0, 0
        tested, passed, wrong = 0, 0, 0
        last = len(levels) - 1 if several else 0
        for c in range(len(first)):
            a, b = first[c], second[c]
            slot_a, slot_b = material[a], material[b]
            if not all_meet and (
                layers[slot_a, a] & masks[slot_b, b] == 0 or layers[slot_b, b] & masks[slot_a, a] == 0
            ):
                continue
            pair_a[kept] = a
            pair_b[kept] = b
            passive = sensors[slot_a, a] or sensors[slot_b, b]
            responds[kept] = not passive and inverse_mass[a] + inverse_mass[b] > 0.0
            hit, depth, normal, point, centre = False, 0.0, like, like, like
            missed = 0.0  # depth of the level that keeps them apart
            first_hit = False
            margin = 0.0
            if several and dt > 0.0 and responds[kept]:
                margin = reach(dt, a, b, share, size, fixed_slop)
            for level in range(last + 1):
                shape_a, shape_b = levels[level, a], levels[level, b]
                centre = add(row(position, a, like), row(level_offsets[level], a, like))
                d = sub(add(row(position, b, like), row(level_offsets[level], b, like)), centre)
                hit, depth, normal, point = evaluate(shape_a, a, shape_b, b, d, shapes, like)
                if level == last or (shape_a == levels[last, a] and shape_b == levels[last, b]):
                    break
                if level == 0:
                    tested += 1
                    first_hit = hit
                    passed += 1 if hit else 0
                if not hit:
                    missed = min(missed, depth)
                    if depth < -margin and not (outgrown[a] or outgrown[b]):
                        break
            if missed < 0.0:
                hit = False
                if depth > missed and (outgrown[a] or outgrown[b]):  # it sticks out: they are kept apart in this step
                    wrong += 1 if first_hit else 0
                    continue
            if first_hit and not hit:
                wrong += 1
            pair_depth[kept] = depth
            near = hit or (responds[kept] and depth >= -reach(dt, a, b, share, size, fixed_slop))
            involved[kept] = near
            if hit or (near and dt > 0.0):
                store(pair_normal, kept, normal)
                store(pair_point, kept, add(centre, point))
                hits[found], hit_a[found], hit_b[found] = kept, entity[a], entity[b]
                found += 1
            kept += 1
        return kept, found, tested, passed, wrong

    return find_contacts


@lru_cache(maxsize=64)
def narrow_kernel_with_levels(code: ShapeCode) -> Callable[..., tuple[int, int, int, int, int]]:
    return make_narrow_kernel(code.evaluate, several=True)


class NarrowPhase(System):
    """Tests the candidates with the functions of their shapes, level by level, and fills ``world.contacts``.

    Reads position and the colliders; writes the contacts, with ``enabled`` set. Systems that run after it and before
    RESPONSE may clear ``enabled``.
    """

    phase = Phase.NARROW

    def __init__(self, state: PhysicsState) -> None:
        self._state = state

    def process(self, dt: float) -> None:
        state = self._state
        if not state.candidates_ready:
            state.broad_phase.process(dt)
        if state.collides:
            self._test(dt)
        else:
            state.set_pairs(0, 0)
        state.publish_found()

    def _test(self, dt: float) -> None:
        state = self._state
        first, second = filtered(state, *state.sort_candidates())
        with state.blame:
            kept, found, *counts = self._find(
                dt, first, second, state.pair_a, state.pair_b, state.responds, state.involved, state.pair_depth,
                state.pair_normal, state.pair_point, state.hits, state.hit_a, state.hit_b,
            )  # fmt: skip
        if len(state.levels) > 1:
            for name, count in zip(COUNTERS, counts, strict=True):
                state.pair_counters[name] += count
        if state.sweeping and state.moved and kept:
            found = self._sweep(dt, kept)
        state.set_pairs(kept, found)

    def _sweep(self, dt: float, kept: int) -> int:
        """Add the pairs that touch on their way only; returns how many contacts there are."""
        state, arrays, scratch = self._state, self._state.table.arrays, self._state.scratch
        slop = state.world.settings.slop
        with state.blame:
            return state.kernels.find_swept(
                dt, state.pair_a, state.pair_b, kept, state.involved, arrays["entity"], scratch["gravity_share"],
                scratch["size"], scratch["shape"], scratch["offset"], state.world_shapes,
                state.motion(arrays["previous_position"]), -1.0 if slop is None else slop, state.sweep_of,
                state.pair_depth, state.pair_normal, state.pair_point, state.hits, state.hit_a, state.hit_b, state.like,
            )  # fmt: skip

    def _find(self, dt: float, first: np.ndarray, second: np.ndarray, *out: np.ndarray) -> tuple[int, ...]:
        """Call the kernel; ``out``: what it fills."""
        state, arrays, stacks = self._state, self._state.table.arrays, self._state.table.stacks
        scratch, slop = state.scratch, state.world.settings.slop
        several = len(state.levels) > 1
        find_contacts = narrow_kernel_with_levels(state.code) if several else state.kernels.find_contacts
        return find_contacts(
            first, second, state.table.count, arrays["entity"], arrays["position"], state.levels, state.level_offsets,
            state.outgrown, scratch["material"], state.world_shapes, stacks["collider.layer"],
            stacks["collider.mask"], stacks["collider.sensor"], arrays["inverse_mass"], dt if state.moved else 0.0,
            arrays["linear_velocity"], scratch["start_velocity"], scratch["gravity_share"], scratch["size"],
            -1.0 if slop is None else slop, *out, state.like,
        )  # fmt: skip

    def kernels(self) -> Iterator[PlannedKernel]:
        if self._state.collides:
            yield PlannedKernel("sort_pairs", "canonical order of the candidates, by entity id")
            yield PlannedKernel("find_contacts", "layers and masks, then the shapes' functions")
        if self._state.sweeping:
            yield PlannedKernel("find_swept", "which pairs touch on their way", "pairs are near each other")

    def reason(self) -> str:
        if not self._state.collides:
            return "no colliders: nothing to do"
        names = ", ".join(shape.component.__name__ for shape in self._state.code.shapes)
        levels = "; bodies with several colliders: level by level, the cheap one first"
        return f"all pairs of {names}" + (levels if len(self._state.levels) > 1 else "")
