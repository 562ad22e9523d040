"""Queries inside compiled code: what is near, how deep two bodies would overlap, when one would first touch another.

For stages of plugins at the end of a step, ``before="update_sleep"``, with ``"tree"`` among their ``reads`` and
:data:`NEAR` among their ``records``. A body asks with its own shape, as it would be elsewhere. Boxes are those of the
places where the bodies were before the first of these stages.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ...framework.compilation import inlined, part
from ...framework.jit.records.record_type import zero_of
from ...framework.jit.records.schema import Schema, integer, ints, vectors
from ...framework.vectors import negative
from ..narrow_phase.one_way import front_of as front_of
from ..narrow_phase.one_way import is_from_front as is_from_front
from ..narrow_phase.one_way import is_one_way as is_one_way
from ..narrow_phase.stages import layers_meet
from ..shapes.dispatch import evaluate, half_extents, sweep
from ..shapes.surfaces import any_surface_runs, surface_velocity_at
from ..step_stages import FEW_BODIES
from .candidates import is_box_near, make_find_all, order_by_entity
from .candidates import to_collider as to_collider
from .casts import box_interval as box_interval
from .casts import inverse_of as inverse_of
from .first_touch import Path as Path
from .first_touch import make_first_touch

# What a stage gets to query with: as many rows as there are bodies.
NEAR = Schema(
    "Near",
    row=ints(),  # what was found, in the order of the ids
    entity=ints(),
    asking=integer(),  # the row that asks
    low=vectors(unit="m"),
    high=vectors(unit="m"),
    end=ints(),
)


@inlined
def meets(state, i, j):
    """Whether rows i and j have shapes whose layers, masks and groups let them meet."""
    return i != j and state.bodies.shape[j] >= 0 and layers_meet(state, i, j)


@inlined
def half_extents_of_row(state, i):
    """Half extents of the box around row i's shape."""
    return half_extents(state, state.bodies.shape[i], i)


@part
def surface_velocity_of(state, i, at, out):
    """At which the surface of row i runs, m/s along the axes of the world, at a place in the world; out: the unit
    vector away from it."""
    if not any_surface_runs(state):
        return zero_of(state)
    return surface_velocity_at(state, i, negative(to_collider(state, at, i)), out)


@inlined
def is_sensor(state, j):
    """Whether row j is a sensor."""
    return state.colliders.sensor[state.bodies.collider_slot[j], j]


def make_gather(wanted: Callable[..., bool]) -> Any:
    """gather(state, near, i, low, high): find what is near low..high, into ``near.row``; returns how many.

    wanted
        (state, i, j), to be compiled in: whether row i, which asks, looks for row j. Boxes around bodies are a little
        larger than these.
    """

    @inlined
    def box_of(state, near, q):
        return near.low[0], near.low[0], near.high[0]

    @inlined
    def may_be_wanted(state, near, q, low, j):
        return wanted(state, near.asking, j)

    @inlined
    def is_found(state, near, q, low, j):
        return True

    find = make_find_all(box_of, may_be_wanted, is_found, in_grids=True)

    @part
    def gather(state, near, i, low, high):
        if state.count <= FEW_BODIES:
            found = 0
            for j in range(state.count):
                near.row[found] = j
                found += is_box_near(state, j, low, high) and wanted(state, i, j)
            order_by_entity(state, near, 0, found)
            return found
        near.asking, near.low[0], near.high[0] = i, low, high
        find(state, near, state.tree, state.static_tree, 0, 1)
        return near.end[0]

    return gather


@inlined
def overlap(state, i, j, at):
    """(depth, out, point) of row i, with the centre of its shape ``at``, and row j: how far they overlap, below 0 while
    they are apart; the unit vector from j to i; the point from that centre."""
    shape = state.bodies.shape
    _, depth, normal, point = evaluate(state, shape[i], i, shape[j], j, to_collider(state, at, j))
    return depth, negative(normal), point


@inlined
def _evaluate_at(state, near, i, j, d):
    return evaluate(state, state.bodies.shape[i], i, state.bodies.shape[j], j, d)


@inlined
def _sweep_at(state, near, i, j, d, way):
    return sweep(state, state.bodies.shape[i], i, state.bodies.shape[j], j, d, negative(way))


_first_touch = make_first_touch(_evaluate_at, _sweep_at)


@part
def cast(state, near, i, j, path, leave, reach):
    """(touches, distance, out, point) of row i on a path and row j: where it first touches within ``reach``; the unit
    vector from j to i, and the point from where the centre of i's shape is then.

    path
        of the centre: (start, direction, inverse_of(direction), half extents of the shape)
    leave
        where it leaves j's box, see :func:`box_interval`; ``reach`` will do
    """
    touches, distance, normal, point = _first_touch(state, near, i, j, path, leave, reach)
    return touches, distance, negative(normal), point
