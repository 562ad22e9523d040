"""The longest step at which an integrator keeps oscillators from growing: found by one step of a world of them.

They are x'' = -k x - (c + g) x': k stiffness and c drag by forces, g linear damping, which integrators treat apart. A
step of a basis of states gives its matrix; it is stable while no eigenvalue lies outside of the unit circle. For
semi-implicit Euler and velocity Verlet that is up to sqrt(k) dt = 2, for Runge-Kutta 4 up to 2 sqrt 2 (Hairer & Wanner,
Solving Ordinary Differential Equations II, section IV.2).
"""

from __future__ import annotations

from contextlib import closing
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...components import RigidBody, Transform
from ...framework import ForceSystem, Plugin, Settings, World
from ...plugins import Physics
from ...systems import Integrator

Floats = NDArray[np.float64]

ROUNDING = 1e-12  # growth per step that counts as none
SHORTEST, LONGEST = 1e-5, 30.0  # steps that are tried, in units of the oscillator's own time
STEPS, ZOOMS = 500, 3  # tried between these, then between the last stable one and the next
# A growth with a power of the step is above rounding from some short step on, where twice the step multiplies it by at
# most STEEPEST: no step is stable.
SHORT, STEEPEST = 0.05, 2.0**8
DT = 2.0**-6  # s: the step that is taken, of oscillators whose time is scaled


class Oscillators(ForceSystem):
    """Forces on bodies of 1 kg whose planes are those of complex numbers."""

    def __init__(self, stiffness: Any, drag: Any) -> None:
        self.stiffness, self.drag = stiffness, drag

    def add_forces(self, bodies: Any, time: float) -> None:
        force = self.stiffness * _complex(bodies.position) + self.drag * _complex(bodies.linear_velocity)
        bodies.force[:] -= _plane(force)


def growth(integrator: type[Integrator], collision: str, stiffness: Any, drag: Any, damping: Any) -> Floats:
    """The largest absolute eigenvalue of a step of 1 s of each oscillator (n,); stiffness and drag may be complex."""
    count, plugin = len(stiffness), Plugin("limits")
    plugin.integrator("limits")(integrator)
    settings = Settings(dt=DT, integrator="limits", collision=collision)
    with closing(World(Physics(), plugin, settings=settings)) as world:
        x, v = np.repeat(np.eye(2, dtype=complex), count, axis=1)
        body = RigidBody.many(linear_velocity=_plane(v / DT), linear_damping=np.tile(damping / DT, 2))
        world.create_entities(2 * count, Transform.many(_plane(x)), body)
        world.add_system(Oscillators(np.tile(stiffness, 2) / DT**2, np.tile(drag, 2) / DT))
        world.step()
        x, v = _complex(world.bodies.position) - x, _complex(world.bodies.linear_velocity) * DT - v
    a, b, c, d = x[:count], x[count:], v[:count], v[count:]  # the matrix, less the unit matrix
    middle, root = 1 + (a + d) / 2, np.sqrt((a + d) ** 2 / 4 - (a * d - b * c))
    return np.maximum(np.abs(middle + root), np.abs(middle - root))


def stability_limits(
    integrator: type[Integrator], collision: str, stiffness: ArrayLike, drag: ArrayLike = 0.0, damping: ArrayLike = 0.0
) -> Floats:
    """Seconds (n,), for each oscillator: stiffness 1/s^2, drag and damping 1/s, (n,) or one for all.

    0 if it grows at any step, inf if at none; inf too if the exact solution grows, whatever the step.
    """
    k, c, g = np.broadcast_arrays(*(np.atleast_1d(np.asarray(each)) for each in (stiffness, drag, damping)))
    limits, scale = np.full(len(k), np.inf), np.maximum(np.sqrt(np.abs(k)), np.abs(c))
    asked = np.flatnonzero((scale > 0.0) & ~_grows_by_itself(k, c, g))
    k, c, g, scale = k[asked], c[asked], np.real(g)[asked], scale[asked]
    low, high = SHORTEST / scale, LONGEST / scale * (1.0 + g / scale)
    for zoom in range(ZOOMS if len(asked) else 0):
        h = np.geomspace(low, high, STEPS)
        grown = growth(integrator, collision, (k * h * h).ravel(), (c * h).ravel(), (g * h).ravel()).reshape(h.shape)
        grows = grown > 1.0 + ROUNDING
        first, rows = grows.argmax(axis=0), np.arange(len(asked))
        if not zoom:
            never, always = ~grows.any(axis=0), grows[0]
        low, high = h[np.maximum(first - 1, 0), rows], h[first, rows]
    if len(asked):
        beyond = growth(integrator, collision, k * (2 * low) ** 2, c * 2 * low, g * 2 * low) - 1.0
        always |= (low * scale < SHORT) & (beyond < STEEPEST * ROUNDING)
        limits[asked] = np.where(never, np.inf, np.where(always, 0.0, low))
    return limits


def _grows_by_itself(stiffness: Any, drag: Any, damping: Any) -> NDArray[np.bool_]:
    """True if the exact solution of x'' = -stiffness x - (drag + damping) x' grows: no step could prevent it."""
    half = (drag + damping) / 2
    root = np.sqrt(half * half - stiffness + 0j)
    fastest = np.maximum((root - half).real, (-root - half).real)
    return fastest > 1e-9 * np.maximum(np.sqrt(np.abs(stiffness)), np.abs(drag))


def _complex(columns: Any) -> Any:
    return np.ascontiguousarray(columns).view(complex)[:, 0]


def _plane(numbers: Any) -> Floats:
    return np.ascontiguousarray(numbers, complex)[:, None].view(float)
