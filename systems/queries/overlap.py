"""Which candidates of many queries touch the shapes that are asked with."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ...framework.compilation import kernel
from ...framework.vectors import add, row, sub


def make_touching_kernel(against: Any) -> Callable[..., int]:
    """The kernel that tests the candidates of many queries with one kind of shape, over the shapes of a scene."""

    @kernel
    def touching(
        offsets, rows, other_offsets, other_rows, query, centres, mask, entity, position, offset, shape_of, material,
        layers, shapes, found, bounds, like,
    ):  # fmt: skip
        """Rows of the candidates that each query touches and whose layer it asks for, by id; returns how many.

        Candidates of query q: rows[offsets[q]:offsets[q + 1]] and likewise among the others. query: the parameter
        columns of the asking shapes. bounds (m + 1,): where each query's rows in ``found`` end.
        """
        count = 0
        for q in range(len(offsets) - 1):
            centre = row(centres, q, like)
            begin = count
            for side in range(2):
                start = offsets[q] if side == 0 else other_offsets[q]
                stop = offsets[q + 1] if side == 0 else other_offsets[q + 1]
                for c in range(start, stop):
                    i = rows[c] if side == 0 else other_rows[c]
                    if layers[material[i], i] & mask == 0:
                        continue
                    d = sub(add(row(position, i, like), row(offset, i, like)), centre)
                    if not against(query, q, shape_of[i], i, d, shapes, like)[0]:
                        continue
                    place = count  # rows come nearly in order of their ids: each kind of body is sorted
                    while place > begin and entity[found[place - 1]] > entity[i]:
                        found[place] = found[place - 1]
                        place -= 1
                    found[place] = i
                    count += 1
            bounds[q + 1] = count
        return count

    return touching
