"""Contacts at rest, in their plain form: bodies that overlap at the end of the step must not approach.

Impulses are summed over the contacts of all bodies (projected Gauss-Seidel), every contact allowed to close the gap
it had at the start; the bodies concerned take the step again with the velocities that result. Overlap that remains is
pushed out in position alone, a part per step, so that repairing it never makes energy.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..framework.compilation import allocating_kernel, part
from ..framework.vectors import add, add_scaled, dot, row, scale, store, sub
from .impacts import gravity_share, mix

ITERATIONS = 24
SLOP = 0.005  # of the size of the smaller body: overlap left alone, so that contacts persist
PUSH_RATE = 0.2  # of the overlap beyond the slop, per step
PUSH_LIMIT = 0.05  # of the size, per step


@part
def solve(resting, pair_a, pair_b, normals, room, impulse, velocity, inverse_mass, like):
    """Impulses (added to ``impulse``) after which no contact closes faster than ``room`` allows."""
    for _ in range(ITERATIONS):
        for r in range(len(resting)):
            c = resting[r]
            a, b = pair_a[c], pair_b[c]
            normal = row(normals, r, like)
            speed = dot(sub(row(velocity, b, like), row(velocity, a, like)), normal)
            total = max(0.0, impulse[r] - (speed + room[r]) / (inverse_mass[a] + inverse_mass[b]))
            change = total - impulse[r]
            impulse[r] = total
            if change != 0.0:
                store(velocity, a, add_scaled(row(velocity, a, like), normal, -change * inverse_mass[a]))
                store(velocity, b, add_scaled(row(velocity, b, like), normal, change * inverse_mass[b]))


def make_resting_kernels(evaluate: Any) -> tuple[Callable[..., Any], Callable[..., None]]:
    """The kernels over the shapes of a scene: (find the contacts at rest, solve them)."""

    @part
    def geometry(a, b, position, offset, shape_of, shapes, like):
        centre = add(row(position, a, like), row(offset, a, like))
        d = sub(add(row(position, b, like), row(offset, b, like)), centre)
        hit, depth, normal, point = evaluate(shape_of[a], a, shape_of[b], b, d, shapes, like)
        return hit, depth, normal, add(centre, point)

    @allocating_kernel
    def find_resting(
        pair_a, pair_b, pairs, responds, hits, found, shape_of, offset, shapes, position, velocity, start_velocity,
        restitution, slots, rule, fixed_threshold, share, struck, pair_impulse, like,
    ):  # fmt: skip
        """Indices of the pairs that overlap after the impacts and are not bouncing off each other."""
        touching = np.zeros(pairs, np.bool_)
        for h in range(found):
            touching[hits[h]] = True
        result = np.empty(pairs, np.int64)
        count = 0
        for c in range(pairs):
            a, b = pair_a[c], pair_b[c]
            if not responds[c]:
                continue
            if struck[a] == 0 and struck[b] == 0 and not touching[c]:
                continue
            hit, _, normal, _ = geometry(a, b, position, offset, shape_of, shapes, like)
            if not hit:
                continue
            e = mix(rule, restitution[slots[shape_of[a]], a], restitution[slots[shape_of[b]], b])
            if e > 0.0:
                threshold = fixed_threshold
                if threshold < 0.0:
                    threshold = max(
                        gravity_share(a, share, velocity, start_velocity, like),
                        gravity_share(b, share, velocity, start_velocity, like),
                    )
                speed = dot(sub(row(velocity, b, like), row(velocity, a, like)), normal)
                if speed > (threshold if pair_impulse[c] > 0.0 else 0.0):
                    continue  # on its way out
            result[count] = c
            count += 1
        return result[:count]

    @allocating_kernel
    def solve_resting(
        dt, resting, pair_a, pair_b, shape_of, offset, shapes, position, velocity, origin, start, inverse_mass, size,
        fixed_slop, pair_impulse, pair_normal, pair_point, pair_depth, like,
    ):  # fmt: skip
        """Solve the contacts ``resting`` (canonical order) and move their bodies anew from ``origin``."""
        count = len(resting)
        impulse = np.zeros(count)
        room = np.empty(count)
        normals = np.empty((count, len(like)))
        loaded = np.zeros(len(position), np.bool_)
        for r in range(count):
            c = resting[r]
            a, b = pair_a[c], pair_b[c]
            _, depth, normal, point = geometry(a, b, position, offset, shape_of, shapes, like)
            travel = sub(
                sub(row(position, b, like), row(start, b, like)), sub(row(position, a, like), row(start, a, like))
            )
            room[r] = max(0.0, -depth - dot(travel, normal)) / dt
            store(normals, r, normal)
            store(pair_normal, c, normal)
            store(pair_point, c, point)
            pair_depth[c] = depth
        solve(resting, pair_a, pair_b, normals, room, impulse, velocity, inverse_mass, like)
        for r in range(count):
            if impulse[r] > 0.0:
                loaded[pair_a[resting[r]]] = loaded[pair_b[resting[r]]] = True
        for i in range(len(position)):
            if loaded[i] and inverse_mass[i] > 0.0:
                store(position, i, add_scaled(row(origin, i, like), row(velocity, i, like), dt))
        closed = False
        for r in range(count):
            if impulse[r] > 0.0 and room[r] > 0.0:
                room[r] = 0.0
                closed = True
        if closed:  # they have come as near as they may: none keeps the speed it came with, else it bounces off later
            solve(resting, pair_a, pair_b, normals, room, impulse, velocity, inverse_mass, like)
        for r in range(count):
            pair_impulse[resting[r]] += impulse[r]
        for r in range(count):
            c = resting[r]
            a, b = pair_a[c], pair_b[c]
            extent = min(size[a], size[b])
            if extent == 0.0:  # a point: the other body sets the scale
                extent = max(size[a], size[b])
            slop = fixed_slop if fixed_slop >= 0.0 else SLOP * extent
            hit, depth, normal, _ = geometry(a, b, position, offset, shape_of, shapes, like)
            if hit and depth > slop:
                push = min(PUSH_RATE * (depth - slop), PUSH_LIMIT * extent) / (inverse_mass[a] + inverse_mass[b])
                store(position, a, sub(row(position, a, like), scale(normal, push * inverse_mass[a])))
                store(position, b, add(row(position, b, like), scale(normal, push * inverse_mass[b])))

    return find_resting, solve_resting
