"""The energy of spins, over columns."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...components.colliders import Collider
from ...components.part_of import PartOf
from ...components.second_moments import moments_of
from ...components.spin import UNKNOWN, Spin, inertia_about
from ...framework.data.table import Table
from ...framework.errors import CaromError

GYRATION = "gyration", "gyration_products"


def spin_energy(table: Table, rows: np.ndarray) -> float:
    """Sum of w . I w / 2 of the bodies in these rows that have a Spin, joules; inertia as Spin.moments says."""
    if Spin not in table.mask_names:
        return 0.0
    rows = rows[table.has_mask(Spin)[rows]]
    if not len(rows):
        return 0.0
    spins = table.values("spin.angular_velocity", rows).reshape(len(rows), -1)
    turning = spins.any(axis=1)
    rows, spins = rows[turning], spins[turning]
    if not len(rows):
        return 0.0
    if table.dimensions == 3:
        spins = _turned_back(table.values("rotation", rows), spins)
    given = table.values("spin.inertia", rows).reshape(len(rows), -1)
    known = ~np.isnan(given[:, 0])
    total = float((given[known] * spins[known] * spins[known]).sum())
    rows, spins = rows[~known], spins[~known]
    if len(rows):
        total += _of_shapes(table, rows, spins)
    return 0.5 * total


def _of_shapes(table: Table, bodies: np.ndarray, spins: np.ndarray) -> float:
    """Sum of w . I w of bodies with these spins (n, 1 or 3) along their own axes, whose inertia their shapes tell:
    their own, and those of their parts."""
    count, mass = len(bodies), table.values("mass", bodies)
    parts, owner = _parts_of(table, bodies)
    masses = table.values("part_of.added", parts) if len(parts) else np.empty(0)
    of_parts = np.bincount(owner, masses, count)
    share = np.minimum(1.0, mass / np.maximum(of_parts, mass))
    squares = _squares(table, "spin", bodies, mass - of_parts, spins)
    whole = np.bincount(owner, minlength=count) == 0
    if np.isnan(squares[whole]).any():
        wrong = bodies[whole & np.isnan(squares)][0]
        raise CaromError(f"entity {table.column('entity')[wrong]}: {UNKNOWN}")
    total = float(np.nansum(squares))
    if len(parts):
        turned = spins[owner]
        if table.dimensions == 3:
            turned = _turned_back(table.values("part_of.turn", parts), turned)
        total += float(np.nansum(_squares(table, "part_of", parts, share[owner] * masses, turned)))
    return total


def _parts_of(table: Table, bodies: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The rows of all parts of these bodies, and of which of them each is one."""
    if PartOf not in table.mask_names:
        return np.empty(0, np.int64), np.empty(0, np.int64)
    parts = np.flatnonzero(table.has_mask(PartOf)[: table.count])
    holders = table.rows_of(table.values("part_of.holder", parts))
    place = np.full(table.count + 1, -1)  # the last one is for those that no body holds
    place[bodies] = np.arange(len(bodies))
    owner = place[holders]
    return parts[owner >= 0], owner[owner >= 0]


def _squares(table: Table, kind: str, rows: np.ndarray, mass: np.ndarray, spins: np.ndarray) -> np.ndarray:
    """(n,) w . I w of shapes of that mass; 0 for one without mass, nan where no shape tells the inertia."""
    squares, shapes = np.full(len(rows), np.nan), np.zeros(len(rows), np.int64)
    colliders = [component for component in table.component_types if issubclass(component, Collider)]
    owned = [table.has_mask(component)[rows] for component in colliders]
    for has in owned:
        shapes += has
    for component, has in zip(colliders, owned, strict=True):
        chosen = np.flatnonzero(has & (shapes == 1))
        if len(chosen) and hasattr(component, "second_moments"):
            found = moments_of(component, table.dimensions).of(table, rows[chosen]).T
            offset = table.values(component.columns["offset"].key, rows[chosen]).T
            squares[chosen] = _product(inertia_about(found, offset, mass[chosen]), spins[chosen])
    if f"{kind}.gyration" in table.arrays:  # of what has lost its collider
        own, products = (table.values(f"{kind}.{name}", rows).reshape(len(rows), -1).T for name in GYRATION)
        moments = (0.0, 0.0, *own, 0.0, 0.0, 0.0) if len(own) == 1 else (*own, *products)
        squares = np.where(shapes == 0, mass * _product(moments, spins), squares)
    return np.where(mass > 0.0, squares, 0.0)


def _product(inertia: Any, spins: np.ndarray) -> np.ndarray:
    """w . I w, of xx, yy, zz, xy, xz, yz."""
    xx, yy, zz, xy, xz, yz = inertia
    if spins.shape[1] == 1:
        return zz * spins[:, 0] * spins[:, 0]
    x, y, z = spins.T
    return xx * x * x + yy * y * y + zz * z * z + 2.0 * (xy * x * y + xz * x * z + yz * y * z)


def _turned_back(rotations: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """(n, 3) along the axes that quaternions (n, 4) have turned."""
    w, axis = -rotations[:, :1], rotations[:, 1:]
    twice = 2.0 * np.cross(axis, vectors)
    return vectors + w * twice + np.cross(axis, twice)
