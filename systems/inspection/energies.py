"""Conserved quantities of the dynamic bodies, summed in order of their ids."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from ...framework.data.bodies import Bodies
from ...framework.data.table import Table
from ..forces.accumulation import required_bodies
from .spin_energy import spin_energy


def kinetic_energy(table: Table, dynamic: Bodies) -> float:
    """Sum of m v^2 / 2, and of w . I w / 2 of those that have a Spin, joules."""
    speeds = np.einsum("ij,ij->i", dynamic.linear_velocity, dynamic.linear_velocity)
    rows = np.arange(dynamic.rows.start, dynamic.rows.stop)
    return float(0.5 * (dynamic.mass * speeds).sum()) + spin_energy(table, rows)


def momentum(dynamic: Any, dimensions: int) -> np.ndarray:
    """Sum of m v, (d,) kg m/s."""
    if not len(dynamic):
        return np.zeros(dimensions)
    return (dynamic.mass[:, None] * dynamic.linear_velocity).sum(axis=0)


def potential_energy(table: Table, bodies: Bodies, gravity: np.ndarray, force_systems: Iterable[Any]) -> float:
    """-Sum of m s g.x and of F.x for gravity and constant forces, plus what force systems say; joules."""
    dynamic = bodies.dynamic
    if not len(dynamic):
        return 0.0
    scale, constant = (table.column(key)[dynamic.rows] for key in ("gravity_scale", "constant_force"))
    weight = (dynamic.mass * scale)[:, None] * gravity
    total = -float(((weight + constant) * dynamic.position).sum())
    for system in force_systems:
        concerned = required_bodies(table, bodies, system) if hasattr(system, "potential_energy") else None
        if concerned is not None:
            total += float(system.potential_energy(concerned))
    return total
