"""The axes that are crossed, and the scene that a seed and a number draw from them.

Scene ``number`` crosses pair ``number % 36`` of the axes in mode ``number // 36 % 3``, so any run covers all of them
alike. Both axes of the pair take a value from one of their bins, the others stay at ordinary values.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from ..records import MODES

DT = 1 / 60  # s, of every scene; sizes are 1 m: only their ratios matter
INTEGRATORS = ("explicit_euler", "semi_implicit_euler", "velocity_verlet", "rk4", "yoshida4")
STABLE = {"explicit_euler": 0.0, "rk4": 2.82, "yoshida4": 1.57}  # largest w dt of a spring; 2 for the others
STACK, DROP, ROOM = KINDS = ("stack", "drop", "room")
SHAPES = {2: ("ball", "box", "capsule", "polygon"), 3: ("ball", "box", "capsule")}
FLOORS = {2: ("box", "half_space", "tiles", "one_way"), 3: ("box", "half_space")}
WALLS = (0.1, 1.0, 4.0)  # thickness, of the radius of the largest body
FALLS = (0.3, 10.0)  # heights of a drop, of the size of the body

# Valid ranges. What leaves them is counted apart.
DISCRETE_WAY = 0.3  # of the smallest size: the way in a step, with the speed of the start and that of the fall
DISCRETE_WALL = 1.0  # thinnest wall, of a radius
FARTHEST = 1e9  # from the origin, of the smallest size
HEAVIEST = 1e4  # mass of a body in a stack, of the lightest
SWEPT_WAY, SWEPT_FALL = 100.0, 10.0  # of the smallest size in a step: by speed, where forces make more than the second


@dataclass(frozen=True)
class CrossedAxis:
    """A quantity, and the bins (low, high) that its values are drawn from.

    home
        the ordinary values; one is drawn for scenes that do not cross this axis
    logarithmic
        values are drawn evenly in their logarithm
    """

    name: str
    title: str
    bins: tuple[tuple[float, float], ...]
    home: tuple[float, ...]
    logarithmic: bool = True

    def value(self, place: int, random: np.random.Generator) -> float:
        """A value of that bin."""
        low, high = self.bins[place]
        if self.logarithmic:
            return float(math.exp(random.uniform(math.log(low), math.log(high))))
        return float(random.uniform(low, high))


AXES = (
    CrossedAxis(
        "gravity", "g dt^2 / size", ((1e-6, 1e-3), (1e-3, 0.1), (0.1, 10.0), (10.0, 1e3), (1e3, 1e6)), (2.7e-3,)
    ),
    CrossedAxis("mass", "ratio of masses", ((1.0, 10.0), (10.0, 100.0), (100.0, 1e4), (1e4, 1e6)), (1.0,)),
    CrossedAxis("size", "ratio of sizes", ((1.0, 3.0), (3.0, 10.0), (10.0, 30.0), (30.0, 100.0)), (1.0,)),
    CrossedAxis("speed", "speed dt / size", ((1e-3, 0.1), (0.1, 1.0), (1.0, 100.0), (100.0, 1e4)), (0.1,)),
    CrossedAxis("distance", "distance / size", ((1.0, 1e3), (1e3, 1e6), (1e6, 1e9), (1e9, 1e12), (1e12, 1e15)), (0.0,)),
    CrossedAxis(
        "restitution", "restitution", ((0.0, 0.0), (0.0, 0.5), (0.5, 1.0), (1.0, 1.0)), (0.0, 0.3, 1.0), False
    ),
    CrossedAxis("density", "size / spacing", ((0.1, 0.5), (0.5, 0.9), (0.9, 1.0), (1.0, 2.0), (2.0, 10.0)), (0.5,)),
    CrossedAxis("height", "bodies in a stack", tuple((float(n), float(n)) for n in range(1, 6)), (3.0,), False),
    CrossedAxis("stiffness", "stiffness x dt", ((1e-2, 0.1), (0.1, 0.5), (0.5, 1.5), (1.5, 10.0)), (0.0,)),
)  # fmt: skip
NAMES = tuple(axis.name for axis in AXES)
PAIRS = tuple(itertools.combinations(range(len(AXES)), 2))
ROUND = len(PAIRS) * len(MODES)  # scenes until each pair was drawn once in each mode


@dataclass(frozen=True)
class Draw:
    """One scene as drawn.

    seed
        with number, it draws the same scene again; it also places the bodies
    crossed
        two names of axes, and the bin of each
    values
        the value of each axis
    wall
        thickness, of the radius of the largest body
    fall
        height of a drop, sizes
    """

    seed: int
    number: int
    mode: str
    integrator: str
    dimensions: int
    kind: str
    shape: str
    floor: str
    wall: float
    fall: float
    crossed: dict[str, int]
    values: dict[str, float]

    @classmethod
    def of(cls, seed: int, number: int) -> Self:
        """The scene of that seed and number."""
        random = np.random.default_rng([seed, number])
        mode = MODES[number // len(PAIRS) % len(MODES)]
        dimensions = int(random.integers(2, 4))
        integrator = str(random.choice(INTEGRATORS))
        values = {axis.name: float(random.choice(axis.home)) for axis in AXES}
        crossed = {}
        for place in PAIRS[number % len(PAIRS)]:
            axis = AXES[place]
            crossed[axis.name] = int(random.integers(len(axis.bins)))
            values[axis.name] = axis.value(crossed[axis.name], random)
        kind = _kind(crossed, random)
        if kind == STACK and "speed" not in crossed:
            values["speed"] = 0.0
        if kind == STACK and "density" not in crossed:
            values["density"] = 1.0  # they touch
        if kind == DROP:
            values["height"] = 1.0
        shape, floor = str(random.choice(SHAPES[dimensions])), str(random.choice(FLOORS[dimensions]))
        wall = float(random.choice(WALLS))
        fall = float(np.exp(random.uniform(*np.log(FALLS))))
        return cls(seed, number, mode, integrator, dimensions, kind, shape, floor, wall, fall, crossed, values)

    @property
    def smallest(self) -> float:
        """Size of the smallest body, m; the largest has 1 m."""
        return 1.0 / self.values["size"]

    @property
    def gravity(self) -> float:
        """m/s^2."""
        return self.values["gravity"] * self.smallest / DT**2

    @property
    def speed(self) -> float:
        """Of the bodies at the start, m/s."""
        return self.values["speed"] * self.smallest / DT

    def outside(self, height: float) -> list[str]:
        """How it leaves the valid range of its mode; empty if it does not. height: the largest fall, m."""
        found = []
        if self.mode == MODES[0]:
            way = DT * (self.speed + math.sqrt(2.0 * self.gravity * height))
            if way > DISCRETE_WAY * self.smallest:
                found.append("way in a step")
            if self.kind == ROOM and self.wall < DISCRETE_WALL:
                found.append("thin walls")
        elif self.values["speed"] > SWEPT_WAY and (
            self.values["gravity"] > SWEPT_FALL or self.values["stiffness"] > 0.0
        ):
            found.append("speed and forces")
        if self.kind == STACK and self.values["mass"] > HEAVIEST:
            found.append("load")
        if self.values["distance"] > FARTHEST * self.smallest:
            found.append("distance")
        if self.values["stiffness"] > STABLE.get(self._flight, 2.0):
            found.append("stiffness")
        return found

    @property
    def _flight(self) -> str:
        return self.integrator if self.mode != MODES[2] else "velocity_verlet"

    @property
    def drifts(self) -> bool:
        """True if the flight itself changes the energy: that of both Euler methods does."""
        return self._flight.endswith("euler")

    def settings(self) -> dict[str, Any]:
        """Fields of Settings."""
        return {"dt": DT, "collision": self.mode, "integrator": self.integrator}


def _kind(crossed: dict[str, int], random: np.random.Generator) -> str:
    """A kind of scene in which both axes mean something."""
    if "height" in crossed:
        return STACK
    if "density" in crossed:
        return ROOM
    if "mass" in crossed or "size" in crossed or "stiffness" in crossed:
        return str(random.choice((STACK, ROOM)))
    return str(random.choice(KINDS))
