"""Kinematic bodies that are to be somewhere at the end of a step: they have the velocity that leads there, and stand
still after it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..elementary import atan2

STOPS = "_stops"  # column on demand: which step stops the body at its end, and whether it stops to turn, too
THIS, NEXT, TURNS = 1, 2, 4
VELOCITY, SPIN, SPINS = "linear_velocity", "spin.angular_velocity", "has:spin."


def drive(table: Any, rows: np.ndarray, places: np.ndarray, rotations: np.ndarray | None, what: str) -> None:
    """The next step ends with these kinematic bodies at ``places``, (n, d) m, turned the short way to ``rotations``,
    (n,) rad or (n, 4) unit quaternions. ValueError, which begins with the entity and ``what``, for what cannot be."""
    with np.errstate(over="ignore", invalid="ignore"):
        velocity = (places - table.column("position")[rows]) / table.clock.dt
    far = ~(np.abs(velocity) <= table.kind_carrier.columns[VELOCITY].largest).all(axis=1)
    if far.any():
        raise ValueError(f"{_whose(table, rows, far)}{what}: {places[far][0].tolist()} is farther than a step goes")
    values = {VELOCITY: velocity}
    if rotations is not None:
        still = ~table.arrays.get(SPINS, np.zeros(table.count, bool))[rows]
        if still.any():
            raise ValueError(f"{_whose(table, rows, still)}{what}: it does not turn without a Spin")
        values[SPIN] = _turns(table.column("rotation")[rows], rotations) / table.clock.dt
    written = table.on_written
    for key, column in values.items():
        if written is not None:
            for row, value in zip(rows.tolist(), column, strict=True):
                written(row, key, value)
        table.arrays[key][rows] = column
    stops = table.make(STOPS)
    step = NEXT if table.in_step and table.has_flown() else THIS
    stops[rows] = stops[rows] & TURNS | step | (TURNS if SPIN in values else 0)
    table.driven = True


def stop(table: Any) -> None:
    """At the end of a step, before anything falls asleep."""
    stops, (dynamic, moving) = table.arrays[STOPS][: table.count], table.stops[:2]
    due = np.flatnonzero(stops & ~TURNS == THIS)
    rows = due[(due >= dynamic) & (due < moving)]  # those of another kind go on
    table.arrays[VELOCITY][rows] = 0.0
    turned = rows[stops[rows] & TURNS > 0]
    if len(turned):
        table.arrays[SPIN][turned] = 0.0
    stops[due] = 0
    stops[stops & NEXT > 0] -= NEXT - THIS
    table.driven = bool(stops.any())


def _whose(table: Any, rows: np.ndarray, wrong: np.ndarray) -> str:
    return f"entity {table.column('entity')[rows[wrong][0]]}: "


def _turns(now: np.ndarray, then: np.ndarray) -> np.ndarray:
    """(n,) or (n, 3) rad along the world's axes, the short way from one rotation to the other."""
    if now.ndim == 1:
        return then - now - 2.0 * math.pi * np.round((then - now) / (2.0 * math.pi))
    w, x, y, z = (now * (1.0, -1.0, -1.0, -1.0)).T
    a, b, c, d = then.T
    real = a * w - b * x - c * y - d * z
    turn = np.stack((a * x + b * w + c * z - d * y, a * y - b * z + c * w + d * x, a * z + b * y - c * x + d * w), 1)
    size = np.linalg.norm(turn, axis=1)
    half = [atan2(aside, along) for aside, along in zip(size.tolist(), np.abs(real).tolist(), strict=True)]
    angle = np.where(real < 0.0, -2.0, 2.0) * np.array(half)
    return turn * np.divide(angle, size, out=np.zeros_like(size), where=size > 0.0)[:, None]
