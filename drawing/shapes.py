"""The colliders of some rows of a world's table: their outlines, and where these are in a frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..components import SphereCollider
from ..framework.plugins.registry import Shape
from ..systems.shapes.quaternions import axes_of
from .lists import Capsules, Circles, Floats, Lines, Polygons, Style, no_capsules, no_circles
from .outline_cache import Kind, OutlineCache, Rows
from .outlines import fields_of

PLAIN = -1  # neither a sensor nor one-way
ALL = "offset", "sensor", "one_way", "enabled"  # columns of every collider that tell where it is, and its style


class Colliders(NamedTuple):
    """S colliders."""

    row: Rows  # of the table
    outline: Rows  # its number in the cache
    offset: Floats  # (S, d)
    turns: NDArray[np.bool_]  # whether the shape turns with its body
    special: NDArray[np.int8]  # its style, PLAIN: that of its body
    radius: Floats  # of a sphere, whose outline is the same for all; NaN: as the cache says


@dataclass
class Part:
    """The pieces of one kind: rings (n, k, d) of the colliders of these rows."""

    kind: Kind
    ring: Floats
    radius: Floats
    row: Rows
    offset: Floats | None  # None: all are 0
    turns: NDArray[np.bool_] | None  # whether a shape turns with its body; None: all do
    special: NDArray[np.int8] | None  # as of colliders; None: all are PLAIN


@dataclass
class Places:
    """Where the rows from ``first`` on are, how they are turned, and what they are."""

    first: int
    position: Floats  # (m, d)
    angle: Floats  # (m,), in space (m, 4)
    axes: Floats | None  # (m, d, d); None: nothing is turned
    style: NDArray[np.int8]
    entity: Rows
    spins: NDArray[np.bool_]

    @classmethod
    def of(cls, first: int, position: Floats, angle: Floats, style: Any, entity: Rows, spins: Any) -> Places:
        d = position.shape[1]
        turned = angle.any() if d == 2 else angle[:, 1:].any()
        return cls(first, position, angle, axes_of(angle, d) if turned else None, style, entity, spins)


def watched_of(world: Any, rows: slice) -> dict[str, bytes]:
    """The bits of the columns that the shapes of these rows, and their places along their bodies, depend on."""
    table = world.physics.table
    found = {"entity": table.column("entity")[rows].tobytes()}
    for component, shape in world.registry.shapes.items():
        mask = table.mask_names.get(component)
        if mask and table.arrays[mask][rows].any():
            keys = (mask, *(component.columns[name].key for name in (*shape.columns, *ALL)))
            found |= {key: table.column(key)[rows].tobytes() for key in keys}
            if hasattr(component, "turned"):
                found[mask + " turned"] = table.column("rotation")[rows][table.arrays[mask][rows]].tobytes()
    return found


def arrays_of(world: Any, rows: slice) -> dict[str, bytes]:
    """Those of these columns that change with no version: a map has other cells."""
    table = world.physics.table
    return {
        column.key: table.column(column.key)[rows].tobytes()
        for component in world.registry.shapes if component in table.mask_names for column in component._pooled
    }  # fmt: skip


def colliders_of(world: Any, cache: OutlineCache, rows: slice) -> Colliders:
    """Those of the bodies of these rows, one shape after the other."""
    table, d = world.physics.table, cache.dimensions
    none = np.zeros(0, np.int64)
    found = [(none, none, np.zeros((0, d)), np.zeros(0, bool), np.zeros(0, np.int8), np.zeros(0))]
    for component, shape in world.registry.shapes.items():
        mask = table.mask_names.get(component)
        row = np.flatnonzero(table.arrays[mask][rows]) + rows.start if mask else none
        if len(row):
            own = {name: table.values(component.columns[name].key, row) for name in shape.columns}
            offset, sensor, one_way, enabled = (table.values(component.columns[name].key, row) for name in ALL)
            if component is SphereCollider:  # often thousands, each of another size, which grow and shrink
                radius = own["radius"]
                outline = np.repeat(cache.numbers_of(shape, {"radius": np.zeros(1)}, 1), len(row))
            else:
                radius, outline = np.full(len(row), np.nan), cache.numbers_of(shape, own, len(row))
            if hasattr(component, "turned"):
                _follow_turns(table, cache, shape, row, own, outline)
            special = np.where(sensor | ~enabled, Style.SENSOR, np.where(one_way.any(axis=1), Style.ONE_WAY, PLAIN))
            found.append((row, outline, offset, np.full(len(row), component.rotates), special.astype(np.int8), radius))
    return Colliders(*(np.concatenate(columns) for columns in zip(*found, strict=True)))


def parts_of(world: Any, cache: OutlineCache, rows: slice) -> list[Part]:
    """What the bodies of these rows look like."""
    row, outline, offset, turns, special, own = colliders_of(world, cache, rows)
    parts = []
    for kind, pieces in sorted(cache.pieces.items()):
        shape, ring, radius = pieces.of(outline)
        if len(shape):
            if kind.corners == 1:
                radius = np.where(np.isnan(own[shape]), radius, own[shape])
            rest = offset[shape], turns[shape], special[shape]
            used = rest[0].any(), not rest[1].all(), (rest[2] != PLAIN).any()
            rest: Any = (column if some else None for column, some in zip(rest, used, strict=True))
            parts.append(Part(kind, ring, radius, row[shape], *rest))
    return parts


def _follow_turns(table: Any, cache: OutlineCache, shape: Shape, row: Rows, own: Any, outline: Rows) -> None:
    """The outlines of those whose fields are others on a body that is turned."""
    component: Any = shape.component
    rotation = table.values("rotation", row)
    turned = np.flatnonzero(rotation if rotation.ndim == 1 else rotation[:, 1:].any(axis=1))
    for k, axes in zip(turned.tolist(), axes_of(rotation[turned], cache.dimensions), strict=True):
        values = component.turned(fields_of(component, own, k, cache.dimensions), axes)
        columns = {name: np.array(value)[None] for name, value in zip(own, values, strict=True)}
        outline[k] = cache.numbers_of(shape, columns, 1)[0]


def shapes_at(parts: list[Part], places: Places) -> tuple[list[Polygons], Circles, Capsules, list[Lines]]:
    """The shapes where their bodies are."""
    d = places.position.shape[1]
    polygons, circles, capsules, lines = [], no_circles(d), no_capsules(d), []
    for part in parts:
        row = part.row - places.first
        style, entity, centre = places.style[row], places.entity[row], places.position[row]
        if part.special is not None:
            style = np.where(part.special == PLAIN, style, part.special)
        axes, turned = None, part.ring
        if places.axes is not None:
            axes = places.axes[row]
            turned = _turned(part.ring, axes)
            if part.turns is not None:
                turned = np.where(part.turns[:, None, None], turned, part.ring)
        if part.offset is not None:
            centre = centre + (part.offset if axes is None else _turned(part.offset[:, None], axes)[:, 0])
        points = turned + centre[:, None]
        if part.kind.corners == 1:
            spins = places.spins[row]
            angle = np.where(spins if d == 2 else spins[:, None, None], _angles(places, row), np.nan)
            circles = Circles(points[:, 0], part.radius, angle, style, entity)
        elif part.kind.round:
            capsules = Capsules(points, part.radius, style, entity)
        elif part.kind.corners == 2:
            lines.append(Lines(points, style, entity))
        else:
            polygons.append(Polygons(points, style, entity, centre))
    return polygons, circles, capsules, lines


def _angles(places: Places, row: Rows) -> Floats:
    if places.position.shape[1] == 2:
        return places.angle[row]
    return np.broadcast_to(np.eye(3), (len(row), 3, 3)) if places.axes is None else places.axes[row]


def _turned(points: Floats, axes: Floats) -> Floats:
    """Points (n, k, d) along these axes (n, d, d); by hand, for numpy multiplies so small matrices one by one."""
    turned = np.empty(points.shape)
    for i in range(points.shape[2]):
        turned[..., i] = axes[:, None, i, 0] * points[..., 0]
        for j in range(1, points.shape[2]):
            turned[..., i] += axes[:, None, i, j] * points[..., j]
    return turned
