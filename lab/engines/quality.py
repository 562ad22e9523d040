"""Quality of a state, measured from positions and velocities alone, so that it is the same for every engine."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..measure.body_shapes import Floats
from ..measure.escape import Enclosure
from .body_arrays import BodyArrays

LARGE = 2.0  # times the largest moving body: larger fixed boxes are tested against all bodies, not by cell
NEIGHBOURS = ((0, 0), (1, -1), (1, 0), (1, 1), (0, 1))  # offsets of a cell's neighbours: each pair of cells once


@dataclass
class Quality:
    """Quality of one engine's run: call :meth:`sample` at intervals, :meth:`figures` at the end of a window."""

    moving: BodyArrays
    fixed: BodyArrays
    enclosure: Enclosure
    overlap_means: list[float] = field(default_factory=list)
    overlap_most: float = 0.0

    def begin(self) -> None:
        """Discard the overlaps of the previous window."""
        self.overlap_means, self.overlap_most = [], 0.0

    def sample(self, position: Floats) -> None:
        """Record the overlaps at ``position`` (n, 2)."""
        depths = overlaps(self.moving, position, self.fixed)
        self.overlap_means.append(float(depths.mean()) if len(depths) else 0.0)
        self.overlap_most = max(self.overlap_most, float(depths.max(initial=0.0)))

    def figures(self, position: Floats, velocity: Floats) -> dict[str, float]:
        """Energies in J, overlaps in diameters, drift (sideways) and sink (downwards) in m since the start."""
        finite = np.isfinite(position).all(axis=1) & np.isfinite(velocity).all(axis=1)
        way = (position - self.moving.position)[finite]
        return {
            "kinetic_start": kinetic_energy(self.moving.mass, self.moving.velocity),
            "kinetic_end": kinetic_energy(self.moving.mass[finite], velocity[finite]),
            "overlap_mean": float(np.mean(self.overlap_means)) if self.overlap_means else 0.0,
            "overlap_max": self.overlap_most,
            "escaped": float(self.enclosure.outside(position[finite]) + (~finite).sum()),
            "drift": float(np.abs(way[:, 0]).max(initial=0.0)),
            "sink": float((-way[:, 1]).max(initial=0.0)),
        }


def kinetic_energy(mass: Floats, velocity: Floats) -> float:
    """Joules: sum of m v^2 / 2."""
    return float(0.5 * np.sum(mass * np.sum(velocity**2, axis=1)))


def overlaps(moving: BodyArrays, position: Floats, fixed: BodyArrays) -> Floats:
    """The overlaps (k,) of overlapping pairs of moving bodies at ``position``, in diameters of the smaller one.

    Fixed bodies are tested against moving ones only. Bodies with non-finite positions overlap nothing.
    """
    shown = moving.shaped & np.isfinite(position).all(axis=1)
    bodies, places = moving.where(shown), position[shown]
    if not len(bodies):
        return np.zeros(0)
    cell = 2 * float(bodies.half.max())
    fixed = fixed.where(fixed.shaped)
    large = 2 * fixed.half.max(axis=1) > LARGE * cell
    found = [_depths(bodies, places, wall, wall.position) for wall in _one_by_one(fixed.where(large))]

    small = fixed.where(~large)
    cell = max(cell, 2 * float(small.half.max(initial=0.0)))
    both = _joined(bodies, small)
    all_places = np.concatenate([places, small.position])
    for first, second in _pairs_in_cells(all_places, cell):
        wanted = (first < len(bodies)) | (second < len(bodies))
        a, b = first[wanted], second[wanted]
        found.append(_depths(both.where(a), all_places[a], both.where(b), all_places[b]))
    depths = np.concatenate(found)
    return depths[depths > 0]


def _depths(a: BodyArrays, place_a: Floats, b: BodyArrays, place_b: Floats) -> Floats:
    """Depth of each row of ``a`` in the same (or the only) row of ``b``, in diameters; negative where apart."""
    apart = np.abs(place_b - place_a)
    reach = a.half + b.half
    axis_depth = (reach - apart).min(axis=1)
    discs = a.round & b.round
    boxes = ~a.round & ~b.round
    radius = np.where(a.round, a.half[:, 0], b.half[:, 0])
    box_half = np.where(a.round[:, None], b.half, a.half)
    outside = np.linalg.norm(np.maximum(apart - box_half, 0.0), axis=1)
    inside = (box_half - apart).min(axis=1)
    mixed = radius + np.where(outside > 0, -outside, inside)
    depth = np.where(discs, reach[:, 0] - np.linalg.norm(apart, axis=1), np.where(boxes, axis_depth, mixed))
    return depth / (2 * np.minimum(a.half, b.half).min(axis=1))


def _pairs_in_cells(places: Floats, cell: float) -> list[tuple[np.ndarray, np.ndarray]]:
    """Pairs of rows in the same cell or in neighbouring ones, each pair once."""
    column, row = np.floor((places - places.min(axis=0)) / cell).astype(np.int64).T
    height = int(row.max()) + 3
    key = (column + 1) * height + row + 1
    order = np.argsort(key, kind="stable")
    sorted_keys = key[order]
    found = []
    for across, up in NEIGHBOURS:
        wanted = key + across * height + up
        start, stop = np.searchsorted(sorted_keys, wanted), np.searchsorted(sorted_keys, wanted, side="right")
        counts = stop - start
        first = np.repeat(np.arange(len(places)), counts)
        within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        second = order[np.repeat(start, counts) + within]
        if (across, up) == (0, 0):
            first, second = first[first < second], second[first < second]
        found.append((first, second))
    return found


def _one_by_one(bodies: BodyArrays) -> list[BodyArrays]:
    return [bodies.where(np.arange(len(bodies)) == k) for k in range(len(bodies))]


def _joined(a: BodyArrays, b: BodyArrays) -> BodyArrays:
    return BodyArrays(*(np.concatenate([getattr(a, name), getattr(b, name)]) for name in a.__dataclass_fields__))
