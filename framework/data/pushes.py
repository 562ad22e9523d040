"""Forces on many bodies at once, as handles give them one by one, and velocities at points."""

from __future__ import annotations

from typing import Any

import numpy as np

SPINS, ANGULAR = "has:spin.", "spin.angular_velocity"
MOST_TORQUE = 1e150  # N m, as of Spin
DYNAMIC = 0


def push(table: Any, rows: np.ndarray, forces: np.ndarray, points: np.ndarray | None) -> None:
    """Push the dynamic ones of these bodies with forces (n, d) N, at points (n, d) m of the world if given: then they
    turn. ValueError, and nothing is pushed, for one without a Spin then, or a torque that is too large."""
    entity, torques = table.column("entity"), None
    if points is not None:
        loose = rows[~table.arrays.get(SPINS, np.zeros(table.count, bool))[rows]]
        if len(loose):
            raise ValueError(f"entity {entity[loose[0]]}: apply_force: it has no Spin, to be pushed at a point")
        with np.errstate(over="ignore", invalid="ignore"):
            torques = _cross(points - table.column("position")[rows], forces)
        wrong = ~(np.abs(torques.reshape(len(rows), -1)) <= MOST_TORQUE).all(axis=1)
        if wrong.any():
            name = f"entity {entity[rows[wrong][0]]}"
            raise ValueError(f"{name}: apply_force: its torque must be at most {MOST_TORQUE:g}")
    moved = table.column("kind")[rows] == DYNAMIC
    late = table.in_step and table.forces_are_summed()
    if late:
        np.add.at(table.make("force"), rows[moved], forces[moved])
    else:
        _add(table, rows[moved], forces[moved], "", "force")
    if torques is not None:
        _add(table, rows[moved], torques[moved], "spin.", "torque")


def _add(table: Any, rows: np.ndarray, values: np.ndarray, prefix: str, name: str) -> None:
    """To what acts till the frame ends, or inside a system to what acts for one step."""
    key = f"{prefix}{'step' if table.in_step else 'applied'}_{name}"
    if table.on_written is not None:
        for row, value in zip(rows.tolist(), values, strict=True):
            table.on_written(row, key, value)
    column = table.make(key)
    if not table.in_step and len(rows):
        frames = table.make(f"{prefix}applied_frame")
        column[rows[frames[rows] != table.frame]] = 0.0
        frames[rows] = table.frame
        table.frames_applied = True
    np.add.at(column, rows, values)


def velocities(table: Any, rows: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(n, d) m/s of these bodies at points (n, d) m of the world."""
    linear = table.values("linear_velocity", rows)
    if SPINS not in table.arrays:
        return linear
    arms = points - table.column("position")[rows]
    spins = np.where(_like(table.arrays[SPINS][rows], table.column(ANGULAR)), table.column(ANGULAR)[rows], 0.0)
    if table.dimensions == 3:
        return linear + np.cross(spins, arms)
    return linear + spins[:, None] * np.stack((-arms[:, 1], arms[:, 0]), axis=1)


def _like(mask: np.ndarray, column: np.ndarray) -> np.ndarray:
    return mask.reshape(-1, *(1,) * (column.ndim - 1))


def _cross(arms: np.ndarray, forces: np.ndarray) -> np.ndarray:
    if arms.shape[1] == 3:
        return np.cross(arms, forces)
    return arms[:, 0] * forces[:, 1] - arms[:, 1] * forces[:, 0]
