"""Shared test helpers beyond the users' kit carom.lab.testing: dimensions, and the invariants of any impact."""

from __future__ import annotations

import numpy as np
import pytest

from carom.framework import System
from carom.framework.plugins.registry import Registry
from carom.lab.testing import ball, box, floor, make_world, position, run, velocity
from carom.plugins import Physics

__all__ = [
    "EPS", "METHODS", "MODES", "Calls", "Conserved", "ball", "both_dimensions", "box", "floor", "make_world",
    "mostly_2d", "position", "registry", "run", "velocity",
]  # fmt: skip

EPS = np.finfo(float).eps
MODES = ("discrete", "continuous", "event_driven")
METHODS = ("explicit_euler", "semi_implicit_euler", "velocity_verlet", "rk4", "yoshida4")
both_dimensions = pytest.mark.parametrize("d", [2, 3])
mostly_2d = pytest.mark.parametrize("d", [2, pytest.param(3, marks=pytest.mark.slow)])  # 3D compiles all again


class Calls(System):
    """Runs a function in a phase."""

    def __init__(self, phase, function):
        self.phase = phase
        self.function = function

    def process(self, dt):
        self.function()


class Conserved:
    """Invariants of impacts: bodies, momentum; and energy, which impacts with e <= 1 may not raise.

    Forces and partners that are not dynamic change momentum: ``momentum=False``. Tolerances: rounding of the sums,
    1e-12 of the summed values.
    """

    def __init__(self, world):
        self.world = world
        self.bodies = len(world.bodies)
        self.momentum = world.momentum()
        self.scale = self._scale()
        self.energy = world.kinetic_energy()

    def _scale(self):
        moving = self.world.bodies.dynamic
        return float(np.abs(moving.mass[:, None] * moving.linear_velocity).sum())

    def check(self, momentum=True, energy=True):
        bodies = self.world.bodies
        assert len(bodies) == self.bodies
        assert np.isfinite(bodies.position).all()
        assert np.isfinite(bodies.linear_velocity).all()
        if momentum:
            np.testing.assert_allclose(self.world.momentum(), self.momentum, rtol=0, atol=1e-12 * self.scale)
        if energy:
            assert self.world.kinetic_energy() <= self.energy * (1 + 1e-12)


def registry(*plugins):
    """What physics and these plugins register."""
    made = Registry()
    for plugin in (Physics(), *plugins):
        made.add(plugin)
    return made
