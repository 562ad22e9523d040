"""Quality of a state, measured from positions and velocities alone, so that it is the same for every engine."""

from __future__ import annotations

import numpy as np

from ...framework import World
from ..measure.body_shapes import Enclosure, Floats, overlaps_of


class Quality:
    """Quality of one engine's run: call :meth:`sample` at intervals, :meth:`figures` at the end of a window.

    world: one of carom at its start, which takes no steps: it gets the positions whose overlaps are asked for.
    """

    def __init__(self, world: World) -> None:
        self.world = world
        dynamic = world.bodies.dynamic
        self._order = np.argsort(dynamic.entity, kind="stable")
        self.mass, self.start = dynamic.mass[self._order], dynamic.position[self._order]
        self.kinetic, self.enclosure = world.kinetic_energy(), Enclosure.around(world)
        self.begin()

    def begin(self) -> None:
        """Discard the overlaps of the previous window."""
        self.overlap_means, self.overlap_most = [], 0.0

    def sample(self, position: Floats) -> None:
        """Record the overlaps at ``position`` (n, 2)."""
        self.world.bodies.dynamic.position[self._order] = position
        depths = overlaps_of(self.world)[2]
        self.overlap_means.append(float(depths.mean()) if len(depths) else 0.0)
        self.overlap_most = max(self.overlap_most, float(depths.max(initial=0.0)))

    def figures(self, position: Floats, velocity: Floats) -> dict[str, float]:
        """Energies in J, overlaps in diameters, drift (sideways) and sink (downwards) in m since the start."""
        finite = np.isfinite(position).all(axis=1) & np.isfinite(velocity).all(axis=1)
        way = (position - self.start)[finite]
        return {
            "kinetic_start": self.kinetic,
            "kinetic_end": float(0.5 * self.mass[finite] @ (velocity[finite] ** 2).sum(axis=1)),
            "overlap_mean": float(np.mean(self.overlap_means)) if self.overlap_means else 0.0,
            "overlap_max": self.overlap_most,
            "escaped": float(self.enclosure.outside(position[finite]) + (~finite).sum()),
            "drift": float(np.abs(way[:, 0]).max(initial=0.0)),
            "sink": float((-way[:, 1]).max(initial=0.0)),
        }
