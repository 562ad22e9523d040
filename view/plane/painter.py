"""Painting a drawing list in 2D with pygame, onto a window or any other surface.

pygame draws a shape per call, so little is called: discs are pictures that are kept and drawn with one ``fblits``, tiny
shapes are squares of that kind, round outlines of few pixels lose corners, what is not seen is left out, and what does
not move is painted once for each place of the camera.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from ...drawing import DrawingList, Polygons, Style
from ..camera import Camera
from ..colours import BACKGROUND, EDGES, FILLS, FILLS_MARKED, GRID, tints
from ..packages import package
from .clipping import clipped_lines, clipped_polygon

TINY = 3.0  # pixels: up to this size a shape is a square
EDGED = 7.0  # pixels: from this size on a shape has an edge
ROUND = 10  # corners: an outline of so many is round, and may lose some
LARGEST_DISC = 48.0  # pixels of radius, of discs that are kept as pictures
MOST_BYTES = 32_000_000  # of these
FAR = 8000.0  # pixels: shapes that reach beyond are cut
SMOOTH = 192  # corners of a circle that is so large


class Painter:
    """Paints what a ``Drawing`` lists; one for each surface."""

    def __init__(self) -> None:
        self._pygame: Any = package("pygame", "carom.view")
        self._discs: dict[tuple[int, int, int], Any] = {}
        self._disc_bytes = 0
        self._squares: dict[tuple[int, int], Any] = {}
        self._layer: Any = None
        self._fixed: Any = None  # the same list as long as nothing static changes
        self._layer_of: Any = None
        self._draw: Any = self._pygame.draw
        self._marks_sleepers: bool | None = None
        self.show_sleepers(False)

    def show_sleepers(self, marked: bool) -> None:
        """Whether sleepers have a colour of their own, instead of that of a body that is awake, but paler."""
        if marked == self._marks_sleepers:
            return
        self._marks_sleepers = marked
        colour = self._pygame.Color
        self._fills = [colour(*rgb) for rgb in (FILLS_MARKED if marked else FILLS).reshape(-1, 3).tolist()]
        self._edges = [colour(*rgb) for rgb in EDGES.reshape(-1, 3).tolist()]
        self._discs.clear()
        self._disc_bytes = 0
        self._squares.clear()
        self._layer_of = None

    def paint(self, surface: Any, shown: DrawingList, camera: Camera, ground: bool = True) -> None:
        """Paint all of ``shown`` as ``camera`` sees it; ``ground``: with a background, else onto what is there."""
        if ground:
            self._paint_layer(surface, shown, camera)
        else:
            self._paint_shapes(surface, shown.fixed, shown.fixed_circles, shown.fixed_lines, camera)
        self._paint_shapes(surface, shown.polygons, shown.circles, shown.lines, camera)
        for points in shown.points:
            self._paint_points(surface, points, camera)

    def _paint_layer(self, surface: Any, shown: DrawingList, camera: Camera) -> None:
        """What does not move, painted once for each place of the camera."""
        key = camera.scale, *camera.middle.tolist(), camera.size
        if shown.fixed is not self._fixed or key != self._layer_of or self._layer.get_size() != surface.get_size():
            if self._layer is None or self._layer.get_size() != surface.get_size():
                self._layer = self._pygame.Surface(surface.get_size(), 0, surface)
            self._layer.fill(BACKGROUND)
            self._paint_grid(self._layer, camera)
            self._paint_shapes(self._layer, shown.fixed, shown.fixed_circles, shown.fixed_lines, camera)
            self._layer_of, self._fixed = key, shown.fixed
        surface.blit(self._layer, (0, 0))

    def _paint_shapes(self, surface: Any, polygons: Any, circles: Any, lines: Any, camera: Camera) -> None:
        self._paint_polygons(surface, polygons, camera)
        self._paint_circles(surface, circles, camera)
        for some in lines:
            self._paint_lines(surface, some, camera)

    def _paint_grid(self, surface: Any, camera: Camera) -> None:
        """Lines at every 1, 2 or 5 times a power of ten of metres."""
        low, high = camera.visible
        least = 60.0 / camera.scale
        power = 10.0 ** math.floor(math.log10(least))
        step = next(power * factor for factor in (1, 2, 5, 10) if power * factor >= least)
        width, height = surface.get_size()
        for axis, length in ((0, height), (1, width)):
            marks = np.arange(math.ceil(low[axis] / step), math.floor(high[axis] / step) + 1) * step
            for place in camera.to_screen(np.stack((marks, marks), axis=1))[:, axis].tolist():
                rect = (round(place), 0, 1, length) if axis == 0 else (0, round(place), length, 1)
                surface.fill(GRID, rect)

    # -- polygons ---------------------------------------------------------------------------------

    def _paint_polygons(self, surface: Any, groups: Iterable[Polygons], camera: Camera) -> None:
        polygon, lines, fills, edges = self._draw.polygon, self._draw.lines, self._fills, self._edges
        squares: list[Any] = []
        for group in groups:
            pixels = camera.to_screen(group.points)
            corners = np.ascontiguousarray(pixels.transpose(1, 0, 2))  # six times as quick to reduce
            low, high = corners.min(axis=0), corners.max(axis=0)
            seen = np.flatnonzero((high > -1.0).all(axis=1) & (low < np.add(camera.size, 1.0)).all(axis=1))  # no NaN
            if not len(seen):
                continue
            low, high = low[seen], high[seen]
            extent = (high - low).max(axis=1)
            colour = tints(group.style[seen], group.entity[seen])
            hollow = group.style[seen] == Style.SENSOR
            tiny, far = extent <= TINY, (low < -FAR).any(axis=1) | (high > FAR).any(axis=1)
            if tiny.any():
                sizes = np.maximum(np.rint(extent[tiny]), 1.0).astype(np.int64).tolist()
                places = np.rint(low[tiny]).astype(np.int64).tolist()
                looks = zip(colour[tiny].tolist(), sizes, strict=True)
                squares += zip((self._square(*look) for look in looks), places, strict=True)
            for k in np.flatnonzero(far & ~tiny).tolist():
                outline = clipped_polygon(pixels[seen[k]], camera.size)
                if len(outline) > 2:
                    polygon(surface, fills[colour[k]], outline, 2 if hollow[k] else 0)
            kept = ~(tiny | far)
            for step, chosen in _by_detail(extent, kept, group.points.shape[1]):
                outlines = pixels[seen[chosen], ::step].tolist()
                edged = (extent[chosen] >= EDGED).tolist()
                rows = zip(outlines, colour[chosen].tolist(), hollow[chosen].tolist(), edged, strict=True)
                for outline, number, empty, has_edge in rows:
                    if empty:
                        polygon(surface, fills[number], outline, 2)
                        continue
                    polygon(surface, fills[number], outline)
                    if has_edge:
                        lines(surface, edges[number], True, outline)
        if squares:
            surface.fblits(squares)

    def _square(self, colour: int, size: int) -> Any:
        found = self._squares.get((colour, size))
        if found is None:
            found = self._squares[colour, size] = self._pygame.Surface((size, size))
            found.fill(self._fills[colour])
        return found

    # -- circles ----------------------------------------------------------------------------------

    def _paint_circles(self, surface: Any, circles: Any, camera: Camera) -> None:
        if not len(circles.radius):
            return
        pixels, radius = camera.to_screen(circles.centre), circles.radius * camera.scale
        reach = radius[:, None] + 1.0
        seen = np.flatnonzero(((pixels > -reach) & (pixels < reach + camera.size)).all(axis=1))
        pixels, radius, angle = pixels[seen], radius[seen], np.asarray(circles.angle)[seen]
        style = circles.style[seen]
        colour = tints(style, circles.entity[seen])
        small = radius <= LARGEST_DISC
        halves = np.maximum(np.rint(2.0 * radius), 1.0).astype(np.int64)  # radii in half pixels
        steps = np.clip(halves, 1, 64)
        turned = np.isfinite(angle) & (halves > 6)
        turn = np.where(
            turned, np.rint(np.where(turned, angle, 0.0) * steps / (2 * np.pi)).astype(np.int64) % steps, -1
        )
        corners = np.rint(pixels - np.ceil(halves / 2)[:, None] - 1).astype(np.int64)
        rows = zip(colour[small].tolist(), halves[small].tolist(), turn[small].tolist(), strict=True)
        surface.fblits(list(zip([self._disc(*row) for row in rows], corners[small].tolist(), strict=True)))
        for k in np.flatnonzero(~small).tolist():
            self._paint_large(surface, pixels[k], float(radius[k]), float(angle[k]), int(colour[k]), camera)

    def _disc(self, colour: int, halves: int, turn: int) -> Any:
        key = colour, halves, turn
        discs = self._discs
        found = discs.get(key)
        if found is None:
            radius = halves / 2
            side = 2 * math.ceil(radius) + 3
            found = self._pygame.Surface((side, side), self._pygame.SRCALPHA)
            angle = 2 * math.pi * turn / min(halves, 64) if turn >= 0 else math.nan
            self._draw_disc(found, (side // 2, side // 2), radius, angle, colour)
            discs[key] = found
            self._disc_bytes += 4 * side * side
            if self._disc_bytes > MOST_BYTES:  # those that are used will be made again
                discs.clear()
                self._disc_bytes = 0
        return found

    def _draw_disc(self, surface: Any, at: Any, radius: float, angle: float, colour: int) -> None:
        draw, fill, edge = self._draw, self._fills[colour], self._edges[colour]
        if colour // (len(self._fills) // len(FILLS)) == Style.SENSOR:
            draw.circle(surface, fill, at, radius, 2)
            return
        if radius < EDGED / 2:
            draw.circle(surface, fill, at, max(radius, 0.5))
            return
        draw.aacircle(surface, edge, at, radius)
        draw.aacircle(surface, fill, at, radius - 1.0)
        if angle == angle:
            rim = at[0] + (radius - 1) * math.cos(angle), at[1] - (radius - 1) * math.sin(angle)
            draw.line(surface, edge, at, rim, 1 if radius < 12 else 2)

    def _paint_large(self, surface: Any, at: Any, radius: float, angle: float, colour: int, camera: Camera) -> None:
        if radius < FAR / 4:
            self._draw_disc(surface, tuple(at.tolist()), radius, angle, colour)
            return
        around = np.linspace(0.0, 2 * np.pi, SMOOTH, endpoint=False)
        outline = clipped_polygon(at + radius * np.stack((np.cos(around), np.sin(around)), axis=1), camera.size)
        if len(outline) > 2:
            self._draw.polygon(surface, self._fills[colour], outline)

    # -- lines and points -------------------------------------------------------------------------

    def _paint_lines(self, surface: Any, lines: Any, camera: Camera) -> None:
        if not len(lines.points):
            return
        ends, rows = clipped_lines(camera.to_screen(lines.points), camera.size)
        styles = np.asarray(lines.style)[rows]
        line, fills = self._draw.line, self._fills
        widths = np.where(styles <= Style.ONE_WAY, 2, 1).tolist()  # what is solid is seen best
        colours = (styles.astype(np.int64) * (len(fills) // len(FILLS))).tolist()
        for (one, other), number, width in zip(np.rint(ends).astype(int).tolist(), colours, widths, strict=True):
            line(surface, fills[number], one, other, width)

    def _paint_points(self, surface: Any, points: Any, camera: Camera) -> None:
        if not len(points.points):
            return
        pixels = camera.to_screen(points.points)
        seen = ((pixels > -4.0) & (pixels < np.add(camera.size, 4.0))).all(axis=1)
        places = np.rint(pixels[seen]).astype(np.int64) - 3
        per_style = len(self._fills) // len(FILLS)
        dots = [self._disc(style * per_style, 4, -1) for style in np.asarray(points.style)[seen].tolist()]
        surface.fblits(list(zip(dots, places.tolist(), strict=True)))


def _by_detail(extent: Any, kept: Any, corners: int) -> list[tuple[int, Any]]:
    """Every how many-th corner is drawn, and of which shapes: round ones of few pixels do with fewer."""
    if corners < ROUND:
        return [(1, np.flatnonzero(kept))]
    enough = 2.0 + 1.8 * np.sqrt(extent)  # then an arc is half a pixel off
    step = np.clip(np.rint(corners / enough), 1, corners // 6).astype(np.int64)
    return [(int(one), np.flatnonzero(kept & (step == one))) for one in np.unique(step[kept])]
