"""Casts: what a ray or a moving shape meets on a straight way, and where.

The time of touch is found with the pair functions alone, which serves any shape: while a shape and a body are apart,
a plane with the pair's normal lies between them and the gap is at least -depth wide, so the shape is free to move until
it has closed that gap along the normal; from there it looks again. For convex shapes that never steps past a touch, and
it converges as Newton's method does (the gap is a convex function of the way): a box in a few steps exactly, a sphere
with the square of the error, a graze by halves. If the shape does not approach the plane, they never meet. A
pair that has a sweep of its own says itself when it touches; shapes that are not convex need one.

The way through the tree is cut into slices, for each level of the tree by itself, a few cells long. The level whose
next slice begins first is looked at first, and once that is beyond the nearest hit, nothing nearer can come.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ...framework.compilation import inlined, kernel
from ...framework.vectors import add, add_scaled, dot, item, length, replace, row, scale, store, sub
from ..broad_phase.tree.build import BEGIN, END, EXTENT, INVERSE, LEVELS, ORIGIN, SCALES
from ..broad_phase.tree.pairs import cover
from ..broad_phase.tree.queries import cells_of, parts_of, uncertainty

LOOKS = 100  # a graze takes about 30; whatever is still closing in after that counts as touching
ROUNDING = 4e-16  # of the distance between the centres: a gap smaller than that is none
LAST_STEP = 1e-9  # of the way: the most that rounding is made up for
SLACK = 1.0 + 4.0 * LAST_STEP  # so that bodies at the nearest distance are all looked at, in whatever order
SLICE = 3.0  # cells; measured: 2 is as good, 6 is worse
ENDLESS = 1e300  # instead of infinity, which times zero is no number
FARTHEST = 1e200  # on the way past bodies without end
MUCH = 1e6  # a way for sweeps may be so many times longer than needed


@inlined
def inverse_of(direction):
    """1 / direction, per axis; along an axis on which it does not move a huge number in place of infinity."""
    result = direction
    for k in range(len(direction)):
        along = item(direction, k)
        result = replace(result, k, 1.0 / along if abs(along) > 1.0 / ENDLESS else ENDLESS)
    return result


@inlined
def power_above(length):
    """A power of two that is larger. With ways of such lengths a sweep finds the same digits, however long they are."""
    return math.ldexp(1.0, math.frexp(length)[1])


def make_cast_kernel(against: Any, swept: Any, half_extents: Any) -> Callable[..., int]:
    """The kernel that moves shapes of one kind through one tree, over the shapes of a scene."""

    @kernel
    def cast(
        query, starts, directions, mask, excluded, only_nearest, table, frame, directory, order, boxes, walk, entity,
        position, offset, shape_of, material, layers, shapes, count, rows, distances, normals, points, like,
    ):  # fmt: skip
        """What each shape meets; ``count`` rows are filled already, returns how many are then.

        query: the parameter columns of the moving shapes; starts (m, d) their centres; directions (m, d) unit vectors
        (zero: the shapes do not move). walk (2, MAX_LEVELS + 2): memory for the levels in use and their next slices.
        only_nearest: row q of the results holds what shape q has met so far (-1: nothing) and at which distance (its
        limit). Otherwise all that the only shape meets is appended; ``distances``, one longer than there are bodies,
        ends in its limit.
        """
        top = int(frame[LEVELS])
        used, span = 0, 0.0
        for level in range(top + 1):
            if table[level, END] > table[level, BEGIN]:
                walk[0, used] = level
                used += 1
        for q in range(len(starts)):
            start, direction = row(starts, q, like), row(directions, q, like)
            limit = distances[q] if only_nearest else distances[len(distances) - 1]
            reach = limit * SLACK
            half = add(half_extents(query, q, like), uncertainty(start, frame))
            back, front = sub(start, half), add(start, half)
            inverse = inverse_of(direction)
            fine, coarse = 0.0, np.inf  # nearly all cells in use lie within the frame, which the way enters and leaves
            for k in range(len(like)):
                one = (frame[ORIGIN + k] - item(front, k)) * item(inverse, k)
                two = (frame[ORIGIN + k] + frame[EXTENT + k] - item(back, k)) * item(inverse, k)
                fine, coarse = max(fine, min(one, two)), min(coarse, max(one, two))
            for k in range(used):
                walk[1, k] = 0.0
            while True:
                turn = 0
                for other in range(1, used):
                    if walk[1, other] < walk[1, turn]:
                        turn = other
                level, begin = int(walk[0, turn]), walk[1, turn]
                if not begin <= reach:
                    break
                end = np.inf
                if level < top and begin < coarse and fine <= coarse:
                    end = fine
                    if begin >= fine:
                        end = min(begin + SLICE / (frame[INVERSE] * frame[SCALES + level]), coarse)
                    if not end > begin:
                        end = coarse
                walk[1, turn] = end
                low, high = add_scaled(start, direction, begin), add_scaled(start, direction, min(end, reach))
                for k in range(len(like)):
                    one, two = item(low, k), item(high, k)
                    low = replace(low, k, min(one, two) - item(half, k))
                    high = replace(high, k, max(one, two) + item(half, k))
                first, n0, n1, n2 = cover(low, high, table, frame, level)
                parts, wraps = parts_of(first, n0, n1, n2, table, level)
                for part in range(parts):
                    c, stop = cells_of(part, wraps, first, n0, n1, n2, table, directory, level)
                    while c < stop:
                        at = np.uint64(c)  # an index without a sign is taken as it is
                        c += 1
                        enter, leave = 0.0, reach
                        for k in range(len(like)):
                            one = (boxes[at, k] - item(front, k)) * item(inverse, k)
                            two = (boxes[at, len(like) + k] - item(back, k)) * item(inverse, k)
                            low_end, high_end = (one, two) if one < two else (two, one)
                            enter = low_end if low_end > enter else enter
                            leave = high_end if high_end < leave else leave
                        # every body has its turn in the slice in which its box is entered
                        if not (enter <= leave and begin <= enter < end):
                            continue
                        i = np.uint64(order[at])
                        if layers[material[i], i] & mask == 0 or entity[i] == excluded[q]:
                            continue
                        away = sub(add(row(position, i, like), row(offset, i, like)), start)
                        distance, touches, normal, point = 0.0, False, like, like
                        if not leave <= span < MUCH * leave:
                            span = power_above(min(leave, FARTHEST))
                        way = scale(direction, span)
                        known, met, part_of_way = swept(query, q, shape_of[i], i, away, way, shapes, like)
                        if known:
                            if not met:
                                continue
                            distance = part_of_way * span
                        before = 0.0
                        for look in range(LOOKS):
                            d = add_scaled(away, direction, before - distance)
                            hit, depth, n, spot = against(query, q, shape_of[i], i, d, shapes, like)
                            rate = dot(direction, n)
                            if look == 0 or rate > 0.0:  # a step too far by a rounding error may turn the normal round
                                normal = n
                            if before == 0.0:
                                point = spot
                            if known:
                                touches = True
                                if rate > 0.0 or look > 0 or distance == 0.0:
                                    break
                                before = min(distance, LAST_STEP * length(away))  # just before, the normal is plain
                                continue
                            near = abs(depth) <= ROUNDING * length(d)
                            touches = hit or (near and (look > 0 or rate > 0.0))
                            further = distance - depth / rate
                            if touches or not rate > 0.0:
                                if near and look > 0 and abs(further - distance) <= LAST_STEP * distance:
                                    distance = further  # what rounding leaves of the gap is a long way at a graze
                                break
                            if further > reach:
                                break
                            touches = look == LOOKS - 1
                            if not further > distance:
                                touches = True
                                break
                            distance = further
                        if not touches or distance > limit:
                            continue
                        place = q if only_nearest else count
                        if only_nearest:
                            if distance == limit and rows[q] >= 0 and entity[rows[q]] <= entity[i]:
                                continue
                            limit = distance
                            reach = limit * SLACK
                        else:
                            count += 1
                        rows[place] = i
                        distances[place] = distance
                        store(normals, place, sub(like, normal))
                        store(points, place, add(add_scaled(start, direction, distance), point))
        return count

    return cast
