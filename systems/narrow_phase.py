"""NARROW: which candidates touch at the end of their motion, and how."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from ..framework.compilation import kernel
from ..framework.schedule import Phase, System
from ..framework.vectors import add, row, store, sub

if TYPE_CHECKING:
    from .state import PhysicsState


def make_narrow_kernel(evaluate: Any) -> Callable[..., tuple[int, int]]:
    """The kernel that tests candidates, over the shapes of a scene."""

    @kernel
    def find_contacts(
        first, second, entity, position, offset, shape_of, slots, shapes, layers, masks, all_meet, sensors,
        inverse_mass, pair_a, pair_b, responds, hits, depths, normals, points, like,
    ):  # fmt: skip
        """Sort each pair by entity, drop pairs whose layers do not meet, test the rest; (pairs kept, hits).

        pair_a, pair_b, responds (m,): the pairs kept, and whether they push each other.
        hits: their indices that touch, with depth, normal and point in the world.
        """
        kept = 0
        found = 0
        for c in range(len(first)):
            a, b = first[c], second[c]
            if entity[a] > entity[b]:
                a, b = b, a
            shape_a, shape_b = shape_of[a], shape_of[b]
            if not all_meet:
                slot_a, slot_b = slots[shape_a], slots[shape_b]
                if layers[slot_a, a] & masks[slot_b, b] == 0 or layers[slot_b, b] & masks[slot_a, a] == 0:
                    continue
            pair_a[kept] = a
            pair_b[kept] = b
            passive = sensors[slots[shape_a], a] or sensors[slots[shape_b], b]
            responds[kept] = not passive and inverse_mass[a] + inverse_mass[b] > 0.0
            centre = add(row(position, a, like), row(offset, a, like))
            d = sub(add(row(position, b, like), row(offset, b, like)), centre)
            hit, depth, normal, point = evaluate(shape_a, a, shape_b, b, d, shapes, like)
            if hit:
                hits[found] = kept
                depths[found] = depth
                store(normals, found, normal)
                store(points, found, add(centre, point))
                found += 1
            kept += 1
        return kept, found

    return find_contacts


class NarrowPhase(System):
    """Tests the candidates with the functions of their shapes and fills ``world.contacts``.

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
            self._test()
        else:
            state.set_pairs(0, 0)
        state.publish_contacts()

    def _test(self) -> None:
        state, arrays, scratch = self._state, self._state.table.arrays, self._state.scratch
        first, second = state.candidates
        state.reserve_pairs(len(first))
        stacks = state.table.stacks
        kept, found = state.kernels.find_contacts(
            first, second, arrays["entity"], arrays["position"], scratch["offset"], scratch["shape"], state.slots,
            state.world_shapes, stacks["collider.layer"], stacks["collider.mask"], state.all_layers_meet(),
            stacks["collider.sensor"], arrays["inverse_mass"], state.pair_a, state.pair_b, state.responds, state.hits,
            state.depths, state.normals, state.points, state.like,
        )  # fmt: skip
        state.set_pairs(kept, found)

    def reason(self) -> str:
        if not self._state.collides:
            return "no colliders: nothing to do"
        names = ", ".join(shape.component.__name__ for shape in self._state.code.shapes)
        return f"all pairs of {names}"


def order_of_pairs(a: np.ndarray, b: np.ndarray, rank: np.ndarray) -> np.ndarray:
    """The canonical order: by the smaller entity id, then by the larger; ``rank`` is the place of a row by id."""
    return np.argsort(rank[a] * len(rank) + rank[b], kind="stable")
