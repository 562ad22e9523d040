"""Questions about where things are: which colliders touch a sphere or a box."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from ..framework.compilation import kernel
from ..framework.vectors import add, row, sub

if TYPE_CHECKING:
    from .state import PhysicsState


def make_query_kernel(meets: Any) -> Callable[..., Any]:
    """The kernel that tests candidates of many queries with one shape, over the shapes of a scene."""

    @kernel
    def touching(
        offsets, rows, centres, sizes, mask, position, offset, shape_of, slots, layers, shapes, found, found_offsets, like
    ):  # fmt: skip
        """Of the candidates rows[offsets[q]:offsets[q + 1]] of query q keep those it touches and whose layer it asks for."""
        count = 0
        for q in range(len(offsets) - 1):
            centre = row(centres, q, like)
            size = row(sizes, q, like)
            for c in range(offsets[q], offsets[q + 1]):
                i = rows[c]
                shape = shape_of[i]
                if layers[slots[shape], i] & mask == 0:
                    continue
                d = sub(add(row(position, i, like), row(offset, i, like)), centre)
                if meets(size, shape, i, d, shapes, like):
                    found[count] = i
                    count += 1
            found_offsets[q + 1] = count
        return count

    return touching


class Queries:
    """Answers from the trees, boxed anew when the bodies have moved since the last question."""

    def __init__(self, state: PhysicsState) -> None:
        self._state = state
        self._stamp: Any = None

    def forget(self) -> None:
        """The next question looks at the bodies anew."""
        self._stamp = None

    def spheres(self, centres: np.ndarray, radii: np.ndarray, mask: int) -> list[np.ndarray]:
        """Ids of the entities that touch each sphere, ascending."""
        sizes = np.repeat(radii[:, None], centres.shape[1], axis=1)
        return self._ask(centres, sizes, mask, "touching_sphere")

    def boxes(self, lower: np.ndarray, upper: np.ndarray, mask: int) -> list[np.ndarray]:
        """Ids of the entities that touch each box, ascending."""
        return self._ask((lower + upper) / 2, (upper - lower) / 2, mask, "touching_box")

    def _ask(self, centres: np.ndarray, sizes: np.ndarray, mask: int, kernel_name: str) -> list[np.ndarray]:
        state = self._state
        state.refresh_structure()
        if state.code is None:
            return [np.empty(0, np.int64) for _ in range(len(centres))]
        touching = getattr(state.kernels, kernel_name)
        if touching is None:
            raise ValueError(f"no plugin has registered the shape that {kernel_name} needs")
        stamp = (state.motion_stamp, state.table.version, state.table.static_version)
        if stamp != self._stamp:
            state.broad_phase.trees_now()
            self._stamp = stamp
        arrays, scratch = state.table.arrays, state.scratch
        answers: list[list[np.ndarray]] = [[] for _ in range(len(centres))]
        for tree in state.broad_phase.trees:
            if not tree.count:
                continue
            offsets, rows = tree.query(centres - sizes, centres + sizes)
            found, bounds = np.empty(len(rows), np.int64), np.zeros(len(offsets), np.int64)
            touching(
                offsets, rows, centres, sizes, mask, arrays["position"], scratch["offset"], scratch["shape"],
                state.slots, state.table.stacks["collider.layer"], state.world_shapes, found, bounds, state.like,
            )  # fmt: skip
            ids = arrays["entity"][found[: bounds[-1]]]
            for q in np.flatnonzero(np.diff(bounds)):
                answers[q].append(ids[bounds[q] : bounds[q + 1]])
        return [np.sort(np.concatenate(parts)) if parts else np.empty(0, np.int64) for parts in answers]
