"""Questions about where things are: which colliders touch a sphere or a box."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from ..framework.compilation import kernel
from ..framework.hits import Hits
from ..framework.vectors import add, row, sub

if TYPE_CHECKING:
    from .state import PhysicsState

Point = tuple[float, ...]


def make_query_kernel(meets: Any) -> Callable[..., int]:
    """The kernel that tests the candidates of many queries with one shape, over the shapes of a scene."""

    @kernel
    def touching(
        offsets, rows, other_offsets, other_rows, centres, sizes, mask, entity, position, offset, shape_of, slots,
        layers, shapes, found, bounds, like,
    ):  # fmt: skip
        """Ids of the candidates that each query touches and whose layer it asks for, ascending; returns how many.

        Candidates of query q: rows[offsets[q]:offsets[q + 1]] and likewise among the others. bounds (m + 1,).
        """
        count = 0
        for q in range(len(offsets) - 1):
            centre, size = row(centres, q, like), row(sizes, q, like)
            begin = count
            for side in range(2):
                start = offsets[q] if side == 0 else other_offsets[q]
                stop = offsets[q + 1] if side == 0 else other_offsets[q + 1]
                for c in range(start, stop):
                    i = rows[c] if side == 0 else other_rows[c]
                    shape = shape_of[i]
                    if layers[slots[shape], i] & mask == 0:
                        continue
                    d = sub(add(row(position, i, like), row(offset, i, like)), centre)
                    if not meets(size, shape, i, d, shapes, like):
                        continue
                    place = count  # rows come nearly in order of their ids: each kind of body is sorted
                    while place > begin and found[place - 1] > entity[i]:
                        found[place] = found[place - 1]
                        place -= 1
                    found[place] = entity[i]
                    count += 1
            bounds[q + 1] = count
        return count

    return touching


class Queries:
    """Answers from the broad phase's boxes, made anew when the bodies have moved since the last question."""

    def __init__(self, state: PhysicsState) -> None:
        self._state = state
        self._stamp: Any = None

    def forget(self) -> None:
        """The next question looks at the bodies anew."""
        self._stamp = None

    def spheres(self, centres: np.ndarray, radii: np.ndarray, mask: int) -> Hits:
        """What touches each sphere."""
        return self._many(centres, np.repeat(radii[:, None], centres.shape[1], axis=1), mask, "touching_sphere")

    def boxes(self, lower: np.ndarray, upper: np.ndarray, mask: int) -> Hits:
        """What touches each box."""
        return self._many((lower + upper) / 2, (upper - lower) / 2, mask, "touching_box")

    def sphere(self, centre: Point, radius: float, mask: int) -> list[int]:
        """What touches one sphere; the quick way for a single one."""
        return self._one(centre, (radius,) * len(centre), mask, "touching_sphere")

    def box(self, lower: Point, upper: Point, mask: int) -> list[int]:
        """What touches one box."""
        centre = tuple((low + high) / 2 for low, high in zip(lower, upper, strict=True))
        size = tuple((high - low) / 2 for low, high in zip(lower, upper, strict=True))
        return self._one(centre, size, mask, "touching_box")

    def _one(self, centre: Point, size: Point, mask: int, kernel_name: str) -> list[int]:
        touching = self._kernel(kernel_name)
        if touching is None:
            return []
        lower = tuple(c - s for c, s in zip(centre, size, strict=True))
        upper = tuple(c + s for c, s in zip(centre, size, strict=True))
        moving, fixed = (boxes.query_one(lower, upper) for boxes in self._state.broad_phase.partitions)
        ends = np.array((0, len(moving))), np.array((0, len(fixed)))
        hits = self._touching(
            touching, ends[0], moving, ends[1], fixed, np.array((centre,)), np.array((size,)), mask
        )
        return hits.entities.tolist()

    def _many(self, centres: np.ndarray, sizes: np.ndarray, mask: int, kernel_name: str) -> Hits:
        touching = self._kernel(kernel_name)
        if touching is None:
            return Hits(np.zeros(len(centres) + 1, np.int64), np.empty(0, np.int64))
        lower, upper = centres - sizes, centres + sizes
        moving, fixed = (boxes.query(lower, upper) for boxes in self._state.broad_phase.partitions)
        return self._touching(touching, *moving, *fixed, centres, sizes, mask)

    def _kernel(self, name: str) -> Any:
        """The kernel of that name, with the boxes made ready for it; None if the world has no colliders."""
        state = self._state
        state.refresh_structure()
        if state.code is None:
            return None
        touching = getattr(state.kernels, name)
        if touching is None:
            raise ValueError(f"no plugin has registered the shape that {name} needs")
        stamp = (state.motion_stamp, state.table.version, state.table.static_version)
        if stamp != self._stamp:
            state.refresh_rotation()
            state.broad_phase.trees_now()
            self._stamp = stamp
        return touching

    def _touching(
        self, touching: Any, offsets: Any, rows: Any, other_offsets: Any, other_rows: Any, centres: Any, sizes: Any,
        mask: int,
    ) -> Hits:  # fmt: skip
        state = self._state
        found = np.empty(len(rows) + len(other_rows), np.int64)
        bounds = np.zeros(len(offsets), np.int64)
        arrays, scratch = state.table.arrays, state.scratch
        count = touching(
            offsets, rows, other_offsets, other_rows, centres, sizes, mask, arrays["entity"], arrays["position"],
            scratch["offset"], scratch["shape"], state.slots, state.table.stacks["collider.layer"],
            state.world_shapes, found, bounds, state.like,
        )  # fmt: skip
        return Hits(bounds, found[:count])
