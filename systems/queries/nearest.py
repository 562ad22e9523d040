"""The nearest surface to a point: boxes around it that grow until nothing outside can be nearer."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ...framework.compilation import kernel
from ...framework.vectors import add, add_scaled, item, replace, row, store, sub
from ..broad_phase.tree.build import BEGIN, END, FINE, HIGHEST, LEVELS, LOWEST, ORIGIN
from ..broad_phase.tree.pairs import cover
from ..broad_phase.tree.queries import cells_of, parts_of, uncertainty

FIRST = 1.0  # half the size of the first box, in cells of the finest level


def make_nearest_kernel(against: Any) -> Callable[..., None]:
    """The kernel over the shapes of a scene; it asks with points, spheres of radius 0."""

    @kernel
    def nearest(
        query, points, mask, excluded, table, frame, directory, order, boxes, entity, position, offset, shape_of,
        material, layers, shapes, rows, distances, normals, surface, like,
    ):  # fmt: skip
        """Improve on what each point has as its nearest in ``rows`` (-1: nothing) and ``distances`` (its limit)."""
        top = int(frame[LEVELS])
        fine = frame[FINE]
        for q in range(len(points)):
            point = row(points, q, like)
            slack = uncertainty(point, frame)
            best = distances[q]
            wide = FIRST * fine  # half the size of the first box, which reaches what is there
            for k in range(len(like)):
                below = frame[ORIGIN + k] + frame[LOWEST + k] * fine - item(point, k)
                above = item(point, k) - frame[ORIGIN + k] - frame[HIGHEST + k] * fine
                wide = max(wide, max(below, above) + FIRST * fine)
            reach = 0.0
            level = top  # at first what is too large or too far out for cells
            while True:
                low, high = like, like
                all_seen = True
                for k in range(len(like)):
                    low = replace(low, k, item(point, k) - reach - item(slack, k))
                    high = replace(high, k, item(point, k) + reach + item(slack, k))
                    all_seen &= item(low, k) <= frame[ORIGIN + k] + frame[LOWEST + k] * fine
                    all_seen &= item(high, k) >= frame[ORIGIN + k] + frame[HIGHEST + k] * fine
                first, n0, n1, n2 = 0, 0, 0, 0
                if table[level, END] > table[level, BEGIN]:
                    first, n0, n1, n2 = cover(low, high, table, frame, level)
                parts, wraps = parts_of(first, n0, n1, n2, table, level)
                for part in range(parts):
                    c, stop = cells_of(part, wraps, first, n0, n1, n2, table, directory, level)
                    while c < stop:
                        at = c
                        c += 1
                        square = 0.0
                        for k in range(len(like)):
                            gap = max(boxes[at, k] - item(point, k), item(point, k) - boxes[at, len(like) + k])
                            gap = max(gap - item(slack, k), 0.0)
                            square += gap * gap
                        if not square <= max(best, 0.0) ** 2:
                            continue
                        i = order[at]
                        if layers[material[i], i] & mask == 0 or entity[i] == excluded[q]:
                            continue
                        d = sub(add(row(position, i, like), row(offset, i, like)), point)
                        _, depth, normal, _ = against(query, q, shape_of[i], i, d, shapes, like)
                        distance = -depth
                        if not distance <= best:
                            continue
                        if distance == best and rows[q] >= 0 and entity[rows[q]] <= entity[i]:
                            continue
                        best = distance
                        rows[q] = i
                        store(normals, q, sub(like, normal))
                        store(surface, q, add_scaled(point, normal, distance))
                if level < top - 1:
                    level += 1
                    continue
                if level == top:
                    if table[top, BEGIN] == 0:  # all are in the top level
                        break
                    reach = wide
                else:
                    if best <= reach or all_seen:
                        break
                    reach = best if rows[q] >= 0 else 2.0 * reach
                reach = min(reach, max(best, 0.0))
                level = 0
            distances[q] = best

    return nearest
