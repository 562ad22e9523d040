"""Conserved quantities of the dynamic bodies, summed in order of their ids."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .accumulation import required_bodies

if TYPE_CHECKING:
    from ..state import PhysicsState


def kinetic_energy(dynamic: Any) -> float:
    """Sum of m v^2 / 2, joules."""
    speeds = np.einsum("ij,ij->i", dynamic.linear_velocity, dynamic.linear_velocity)
    return float(0.5 * (dynamic.mass * speeds).sum())


def momentum(dynamic: Any, dimensions: int) -> np.ndarray:
    """Sum of m v, (d,) kg m/s."""
    if not len(dynamic):
        return np.zeros(dimensions)
    return (dynamic.mass[:, None] * dynamic.linear_velocity).sum(axis=0)


def potential_energy(state: PhysicsState) -> float:
    """-Sum of m s g.x and of F.x for gravity and constant forces, plus what force systems say; joules."""
    dynamic = state.bodies.dynamic
    if not len(dynamic):
        return 0.0
    weight = (dynamic.mass * dynamic.gravity_scale)[:, None] * state.gravity
    total = -float(((weight + dynamic.constant_force) * dynamic.position).sum())
    for system in state.world.force_systems:
        bodies = required_bodies(state, system) if hasattr(system, "potential_energy") else None
        if bodies is not None:
            total += float(system.potential_energy(bodies))  # type: ignore[attr-defined]
    return total
