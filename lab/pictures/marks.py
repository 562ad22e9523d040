"""Drawing of walls, bodies, contacts, arrows and paths into a sheet."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.collections import EllipseCollection, LineCollection, PolyCollection
from matplotlib.colors import to_rgba_array
from numpy.typing import NDArray

from ...drawing import Circles, Lines, Polygons
from ...drawing.outlines import rounded
from . import canvas
from .canvas import Sheet
from .figures import Figures, Floats
from .projection import Projection

MOST_ARROWS = 1500  # in 2D; more could not be distinguished
MOST_ARROWS_3D = 400  # the nearest
MOST_SEGMENTS = 160_000
MOST_CONTACTS_3D = 200  # more would hide the bodies
SPOTS = (0.6, 0.4, 0.2)  # rad, on balls in 3D, at both ends of each axis: how far they reach
ANGLES = np.linspace(0, 2 * np.pi, 40, endpoint=False)
FACE_SHADE = np.array([(0.3, 0.6, 0.5), (0.3, 0.0, 0.5)])  # of faces in 3D that look down or up, by axis of the ground
FAINT = 0.3  # opacity of sensors
GLASS = 0.13  # opacity of walls in 3D
Painted = tuple[int, Floats, Any, Any]  # the row of a body, a polygon in the plane, the colours of it and its edge
OUTLINED = 6.0  # points: smaller bodies have no outline


def draw_walls(sheet: Sheet, walls: Figures, projection: Projection) -> None:
    """Static geometry: filled in 2D; in 3D transparent, clipped by the view; sensors faint."""
    colours = np.where(walls.sensor[:, None], to_rgba_array(canvas.SENSOR, FAINT), to_rgba_array(canvas.WALL))
    if projection.flat:
        _draw_flat(sheet, walls, colours, canvas.WALL_EDGE, 0.6, zorder=1)
        return
    draw_bodies(sheet, replace(walls, polygons=[]), colours, projection, zorder=1)
    places, fills = [], []
    for group, seen, _ in _seen_faces(walls, projection):
        rings, owner = group.points[seen], walls.rows(group)[seen]
        within = np.all((rings >= projection.lower) & (rings <= projection.upper), axis=(1, 2))
        parts = [ring if whole else projection.clipped(ring) for ring, whole in zip(rings, within, strict=True)]
        lengths = np.array([len(part) for part in parts], int)
        if lengths.any():
            places += np.split(projection.plane(np.concatenate(parts))[0], np.cumsum(lengths)[:-1])
            fills.append(colours[owner] * (1.0, 1.0, 1.0, 0.0) + (0.0, 0.0, 0.0, GLASS))
    if places:
        style: dict[str, Any] = {"edgecolors": to_rgba_array(canvas.WALL_EDGE, 0.7), "linewidths": 0.6, "zorder": 1}
        sheet.axes.add_collection(PolyCollection(places, facecolors=np.concatenate(fills), **style))


def draw_bodies(sheet: Sheet, bodies: Figures, colours: Floats, projection: Projection, zorder: float = 3) -> None:
    """Moving shapes in the ``colours`` (n, 4) of their bodies; in 3D far ones first and dimmed; sensors faint."""
    colours = colours * np.where(bodies.sensor, FAINT, 1.0)[:, None] ** (0, 0, 0, 1)
    if not len(bodies.entity):
        return
    outline = 0.7 if bodies.typical_diameter * sheet.points > OUTLINED else 0.0
    if projection.flat:
        _draw_flat(sheet, bodies, colours, canvas.PANEL, outline, zorder)
    else:
        _draw_solids(sheet, bodies, colours, projection, outline, zorder)


def _draw_solids(
    sheet: Sheet, bodies: Figures, colours: Floats, projection: Projection, outline: float, zorder: float
) -> None:
    """Faces, balls and capsules as polygons in one list, painted from far to near."""
    depth = projection.plane(bodies.centre)[2]
    shade = canvas.mixed(colours, canvas.BACKGROUND, 0.75 * (1 - depth))
    painted = [*_painted_faces(bodies, shade, projection), *_painted_balls(sheet, bodies, shade, projection)]
    painted.sort(key=lambda one: depth[one[0]])
    style: dict[str, Any] = {"linewidths": 0.6 * outline, "zorder": zorder}
    if painted:
        _, polygons, fill, edge = zip(*painted, strict=True)
        sheet.axes.add_collection(PolyCollection(polygons, facecolors=fill, edgecolors=edge, **style))


def _painted_faces(bodies: Figures, shade: Floats, projection: Projection) -> Iterator[Painted]:
    """Each face that looks at the camera."""
    for group, seen, normals in _seen_faces(bodies, projection):
        normals, owner = normals @ projection.ground.T, bodies.rows(group)[seen]
        squares = normals**2
        dark = FACE_SHADE[(normals[:, 1] > 0.0).astype(int)]
        share = (squares * dark).sum(axis=1) / squares.sum(axis=1)
        colours = canvas.mixed(shade[owner], canvas.BACKGROUND, share)
        for k, ring, colour in zip(owner.tolist(), projection.plane(group.points[seen])[0], colours, strict=True):
            yield k, ring, colour, canvas.BACKGROUND


def _painted_balls(sheet: Sheet, bodies: Figures, shade: Floats, projection: Projection) -> Iterator[Painted]:
    """Balls and capsules: each with its spots, if it spins, and a highlight."""
    circle = np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1)
    light, spots = (canvas.mixed(shade, *other) for other in (("#ffffff", 0.35), (canvas.PANEL, 0.6)))
    for group in (*bodies.circles, *bodies.capsules):
        ball, owner = isinstance(group, Circles), bodies.rows(group)
        ends = projection.plane(group.centre[:, None] if isinstance(group, Circles) else group.ends)[0]
        middle = group.centre if isinstance(group, Circles) else group.ends.mean(axis=1)
        radii = group.radius * projection.plane(middle)[1]
        for i, (k, radius) in enumerate(zip(owner.tolist(), radii, strict=True)):
            inner, outer = ((ends[i] + r * circle if ball else rounded(ends[i], r)) for r in (0.35 * radius, radius))
            yield k, outer, shade[k], canvas.BACKGROUND
            if isinstance(group, Circles) and np.isfinite(group.angle[i]).all() and radius * sheet.points > OUTLINED:
                toward = projection.camera - group.centre[i]
                for spot in _spots(group.angle[i], toward / np.linalg.norm(toward)):
                    yield k, projection.plane(group.centre[i] + group.radius[i] * spot)[0], spots[k], spots[k]
            yield k, inner + radius * np.array((-0.3, 0.33)), light[k], light[k]


def _spots(axes: Floats, toward: Floats) -> Iterator[Floats]:
    """On a unit ball, what the camera sees of a circle about either end of each axis."""
    for k, size in enumerate(SPOTS):
        rim = np.cos(ANGLES)[:, None] * axes[:, k - 1] + np.sin(ANGLES)[:, None] * axes[:, k - 2]
        for middle in (axes[:, k], -axes[:, k]):
            circle = np.cos(size) * middle + np.sin(size) * rim
            ahead = circle @ toward
            if (ahead > 0.0).any():
                level = circle - ahead[:, None] * toward  # what is hidden is drawn at the edge
                level /= np.linalg.norm(level, axis=1, keepdims=True)
                yield np.where(ahead[:, None] > 0.0, circle, level)


def _seen_faces(shapes: Figures, projection: Projection) -> Iterator[tuple[Polygons, NDArray[np.bool_], Floats]]:
    """Groups of faces, which of each look at the camera, and vectors along the normals of these, (f, 3)."""
    for group in shapes.polygons:
        normals = np.cross(group.points, np.roll(group.points, -1, axis=1)).sum(axis=1)
        seen = ((projection.camera - group.points[:, 0]) * normals).sum(axis=1) > 0.0
        yield group, seen, normals[seen]


def draw_contacts(sheet: Sheet, points: Floats, normals: Floats, diameter: float, projection: Projection) -> bool:
    """A dot at each contact point, with a line along its normal; ``diameter`` is a typical body's. False for none."""
    if not len(points) or (not projection.flat and len(points) > MOST_CONTACTS_3D):
        return False
    size = float(np.clip(0.16 * diameter * sheet.points, 1.6, 5.0))
    length = float(np.clip(0.28 * diameter * sheet.points, 2.5, 12.0)) / sheet.points
    places, _, _ = projection.plane(points)
    ends, _, _ = projection.plane(np.stack([points - length * normals, points + length * normals], axis=1))
    _lines(sheet, list(ends), colors=canvas.CONTACT, linewidths=0.9, alpha=0.9, zorder=5)
    style = {"color": canvas.CONTACT, "ms": size, "mec": canvas.PANEL, "mew": 0.4}
    sheet.axes.plot(places[:, 0], places[:, 1], "o", **style, zorder=6)
    return True


def draw_joints(sheet: Sheet, lines: Lines, projection: Projection) -> None:
    """A line between both anchors of each joint, with a dot at either."""
    places, _, _ = projection.plane(lines.points)
    _lines(sheet, list(places), colors=canvas.MUTED, linewidths=1.2, zorder=3.5)
    dots = places.reshape(-1, 2)
    sheet.axes.plot(dots[:, 0], dots[:, 1], "o", color=canvas.MUTED, ms=2.0, mew=0, zorder=3.5)


def draw_arrows(sheet: Sheet, bodies: Figures, projection: Projection, top_speed: float) -> float:
    """Velocity arrows of the visible bodies; returns how many seconds an arrow stands for (0: none)."""
    start, _, depth = projection.plane(bodies.centre)
    x, y = sheet.axes.get_xlim(), sheet.axes.get_ylim()
    visible = (start[:, 0] > x[0]) & (start[:, 0] < x[1]) & (start[:, 1] > y[0]) & (start[:, 1] < y[1])
    chosen = np.flatnonzero(visible & (bodies.speed > 0.02 * top_speed) & np.isfinite(bodies.speed))
    if not len(chosen):
        return 0.0
    if projection.flat:
        chosen = chosen[:: len(chosen) // MOST_ARROWS + 1]
    else:
        chosen = chosen[np.argsort(-depth[chosen], kind="stable")[:MOST_ARROWS_3D]]
    extent = max(x[1] - x[0], y[1] - y[0])
    wanted = float(np.clip(1.6 * bodies.typical_diameter, 0.018 * extent, 0.07 * extent))
    seconds = _round_number(wanted / top_speed)
    end, _, _ = projection.plane(bodies.centre[chosen] + seconds * bodies.velocity[chosen])
    way = end - start[chosen]
    sheet.axes.quiver(
        start[chosen, 0], start[chosen, 1], way[:, 0], way[:, 1], angles="xy", scale_units="xy", scale=1,
        units="dots", width=1.5, headwidth=4, headlength=4.5, headaxislength=4, minlength=0.5,
        color=canvas.TEXT, alpha=0.85, zorder=4,
    )  # fmt: skip
    return seconds


def draw_paths(sheet: Sheet, positions: Floats, colours: Floats, projection: Projection) -> None:
    """Paths (samples, bodies, d) that fade with age; a jump across a third of the view is not connected."""
    stride = max(1, positions.shape[0] * positions.shape[1] // MOST_SEGMENTS)
    positions = np.concatenate([positions[:-1:stride], positions[-1:]])
    steps, bodies = len(positions) - 1, positions.shape[1]
    places, _, depth = projection.plane(positions)
    ways = np.linalg.norm(np.diff(positions, axis=0), axis=2)
    drawn = np.isfinite(ways) & (ways < 0.33 * np.linalg.norm(projection.upper - projection.lower))
    segments = np.stack([places[:-1], places[1:]], axis=2)  # (steps, bodies, two ends, 2)
    age = np.linspace(0, 1, steps)[:, None] * np.ones(bodies)  # 0: the oldest
    rgba = np.broadcast_to(colours, (steps, bodies, 4)).copy()
    if bodies > 40:
        opacity, width = 0.05 + 0.75 * age**2.2, 0.5 + 0.9 * age
    else:
        opacity, width = 0.25 + 0.75 * age**1.2, 0.9 + 1.3 * age
    rgba[..., 3] = opacity if projection.flat else opacity * (0.25 + 0.75 * depth[1:])
    _lines(sheet, list(segments[drawn]), colors=rgba[drawn], linewidths=width[drawn], capstyle="butt", zorder=2.5)


def _draw_flat(sheet: Sheet, shapes: Figures, colours: Floats, edge: str, outline: float, zorder: float) -> None:
    style: dict[str, Any] = {"edgecolors": edge, "linewidths": outline, "zorder": zorder}
    for discs in shapes.circles:
        own = colours[shapes.rows(discs)]
        _ellipses(sheet, discs.centre, 2 * discs.radius, facecolors=own, **style)
        _draw_hands(sheet, discs, own[:, 3], zorder)
    groups = [*shapes.polygons, *shapes.lines]
    if groups:
        polygons = [polygon for group in groups for polygon in group.points]
        fill = np.concatenate([colours[shapes.rows(group)] for group in groups])
        sheet.axes.add_collection(PolyCollection(polygons, facecolors=fill, **style))


def _draw_hands(sheet: Sheet, discs: Circles, opacity: Floats, zorder: float) -> None:
    """A line from the centre to the rim of each that spins, to see how far it has turned."""
    spins = np.isfinite(discs.angle) & (2 * discs.radius * sheet.points > OUTLINED)
    if spins.any():
        some = discs.where(spins)
        colours = to_rgba_array(np.full(len(some), canvas.PANEL), opacity[spins])
        widths = np.clip(0.14 * some.radius * sheet.points, 0.8, 3.0)
        ways = some.radius[:, None] * np.stack([np.cos(some.angle), np.sin(some.angle)], axis=1)
        hands = list(np.stack([some.centre, some.centre + ways], axis=1))
        _lines(sheet, hands, colors=colours, linewidths=widths, capstyle="butt", zorder=zorder)


def _ellipses(sheet: Sheet, centres: Floats, widths: Floats, **style: Any) -> None:
    """Circles to scale."""
    transform = sheet.axes.transData
    angles = np.zeros(len(widths))
    sheet.axes.add_collection(
        EllipseCollection(widths, widths, angles, units="xy", offsets=centres, offset_transform=transform, **style)
    )


def _lines(sheet: Sheet, segments: list[Floats], **style: Any) -> None:
    sheet.axes.add_collection(LineCollection(segments, **style))


def _round_number(value: float) -> float:
    """The nearest of 1, 2, 5 times a power of ten."""
    options = np.array([1, 2, 5, 10]) * 10.0 ** np.floor(np.log10(value))
    return float(options[np.argmin(np.abs(np.log(options / value)))])
