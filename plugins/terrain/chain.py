"""A chain: a static polyline in 2D, one entity for each of its segments."""

from __future__ import annotations

from typing import Any, Unpack

import numpy as np

from ...components import Transform
from ...components.colliders import LONGEST, MaterialRows
from ...framework import Column, World
from ...framework.typing import Numbers, Vector
from .segment import ChainSegmentCollider

POSITION = Column(item="vector", owner="create_chain", name="position")


def create_chain(
    world: World,
    points: Any,
    *,
    loop: bool = False,
    thickness: Numbers = 0.0,
    position: Vector = (0.0, 0.0),
    **material: Unpack[MaterialRows],
) -> range:
    """Create the segments of a polyline, solid on its right; the ids of their entities, which are consecutive.
    ValueError if it is none, or the world is not 2D.

    points
        (n, 2) m, relative to ``position``; ground is drawn from left to right, an island clockwise, a cave
        counter-clockwise
    loop
        whether the last point is joined to the first
    thickness
        m, how far behind the line the centres of bodies may be that are still pushed out to the front
    material
        friction, restitution, sensor, layer, mask, group and the like: one value for all segments, or a list with one
        for each, in order; of vectors (n, 2). ``thickness`` too
    """
    if world.dimensions != 2:
        raise ValueError(f"create_chain: a chain is for 2D worlds, this world is {world.dimensions}D")
    places = _checked(points, loop) + POSITION.checked(position)
    starts, ends = places, np.roll(places, -1, axis=0)
    before, after = np.roll(places, 1, axis=0), np.roll(places, -2, axis=0)
    if not loop:
        before[0], after[-2] = places[0], places[-1]
        starts, ends, before, after = starts[:-1], ends[:-1], before[:-1], after[:-1]
    middles = 0.5 * (starts + ends)
    if world.physics is not None:
        Facing.of(world).fresh = True
    return world.create_entities(
        len(middles),
        Transform.many(middles),
        ChainSegmentCollider.many(
            start=starts - middles,
            end=ends - middles,
            before=before - middles,
            after=after - middles,
            thickness=thickness,
            **material,
        ),
    )


class Facing:
    """Tells of chains in which nothing can stand, in the first step with the last of them: in a world whose statics are
    chains alone, which are all solid above."""

    def __init__(self) -> None:
        self.fresh = True

    @classmethod
    def of(cls, world: Any) -> Facing:
        followers = world.physics.plugin_stages.followers
        found = next((follower for follower in followers if type(follower) is cls), None)
        if found is None:
            found = cls()
            followers.append(found)
        return found

    def __call__(self, world: Any) -> None:
        if not self.fresh:
            return
        self.fresh, table = False, world.physics.table
        statics = slice(table.stops[1], table.count)
        known = ChainSegmentCollider in table.mask_names  # not if it was gone before a step, as after a restore
        if not (known and table.count > table.stops[1] and table.has_mask(ChainSegmentCollider)[statics].all()):
            return
        start, end = (table.column(f"chain_segment_collider.{name}")[statics] for name in ("start", "end"))
        along, (x, y) = end - start, world.gravity
        outward = along @ (y, -x)  # gravity times the length, out of the front, which is on the left
        if 2.0 * outward.sum() > np.hypot(x, y) * np.hypot(*along.T).sum() and (outward >= 0.0).all():
            world.report_fault(
                f"entity {table.column('entity')[statics][0]}: all chains are solid above, where gravity is {(x, y)}: "
                f"what is to lie on them falls through; draw ground from left to right, "
                f"create_chain(world, points[::-1])"
            )


def bound(numbers: Any) -> str:
    """What one that is refused, of these, should be."""
    return f"at most {LONGEST:g} m" if np.isfinite(numbers).all() else "finite"


def points_of(given: Any, where: str, least: int, width: int) -> np.ndarray:
    """(n, width) m, ``least`` or more points; ValueError if they are none, or too far away."""
    try:
        array = np.asarray(given, float)
    except (TypeError, ValueError, OverflowError):
        array = np.empty(0)
    if array.ndim != 2 or array.shape[1:] != (width,) or len(array) < least:
        got = f"an array of shape {array.shape}" if isinstance(given, np.ndarray) else repr(given)
        raise ValueError(f"{where} must be {least} or more of {width} numbers each, got {got}")
    bad = ~(abs(array) <= LONGEST).all(axis=1)
    if bad.any():
        i = int(np.argmax(bad))
        raise ValueError(f"{where} must be {bound(array[i])}, row {i} is {tuple(array[i].tolist())}")
    return array


def _checked(points: Any, loop: bool) -> np.ndarray:
    """As an array; ValueError if they are no polyline."""
    array = points_of(points, "create_chain: points", 3 if loop else 2, 2)
    same = (array == np.roll(array, -1, axis=0)).all(axis=1)
    if not loop:
        same[-1] = False
    if same.any():
        i = int(np.argmax(same))
        raise ValueError(
            f"create_chain: points must differ from the next one, "
            f"points {i} and {(i + 1) % len(array)} are both {tuple(array[i].tolist())}"
        )
    return array
