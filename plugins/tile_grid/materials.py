"""What cells are made of, and which shapes they have: the types that games write, and the numbers that a map stores."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np

from ...components.colliders import Collider
from ...framework.data.columns import Column
from ...framework.typing import Vector

MOST = 255  # the largest number of a material
OWN = -1.0  # in place of a friction: the collider's
FRICTION, RESTITUTION, RUN_X, RUN_Y, WIDTH = range(5)  # a row of the table of materials
# Arguments, checked like fields.
COEFFICIENTS = {name: Column(minimum=0.0, owner="TileMaterial", name=name) for name in ("friction", "restitution")}
SURFACE = Column(item="vector", owner="TileMaterial", name="surface_velocity")


class TileShape(IntEnum):
    """What of its cell a tile fills. UP and DOWN: as the line goes from left to right; LOW and HIGH: the part of a
    slope of 1:2, which takes two cells; ceilings are solid above the line, all others below it."""

    FULL = 0
    SLOPE_UP = 1
    SLOPE_DOWN = 2
    CEILING_UP = 3
    CEILING_DOWN = 4
    GENTLE_UP_LOW = 5
    GENTLE_UP_HIGH = 6
    GENTLE_DOWN_HIGH = 7
    GENTLE_DOWN_LOW = 8
    GENTLE_CEILING_UP_LOW = 9
    GENTLE_CEILING_UP_HIGH = 10
    GENTLE_CEILING_DOWN_HIGH = 11
    GENTLE_CEILING_DOWN_LOW = 12
    LOWER_HALF = 13
    UPPER_HALF = 14
    ONE_WAY = 15

    @property
    def corners(self) -> tuple[tuple[float, float], ...]:
        """Of what it fills, counter-clockwise, from the cell's lower left corner, of a tile of 1 m; none if ONE_WAY."""
        if self is TileShape.ONE_WAY:
            return ()
        square = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
        if self is TileShape.FULL:
            return square
        x0, y0, x1, y1 = (0.5 * number for number in LINES[self])
        below = [(x, y) for x, y in square if (x1 - x0) * (y - y0) < (y1 - y0) * (x - x0)]
        below.sort(key=lambda point: (along_border(*point) - along_border(x0, y0)) % 4.0)
        return ((x1, y1), (x0, y0), *below)


LINES = (  # of each TileShape: from where to where the line across it goes, solid on its right, in half tiles
    (0, 0, 0, 0), (0, 0, 2, 2), (0, 2, 2, 0), (2, 2, 0, 0), (2, 0, 0, 2),
    (0, 0, 2, 1), (0, 1, 2, 2), (0, 2, 2, 1), (0, 1, 2, 0),
    (2, 1, 0, 0), (2, 2, 0, 1), (2, 1, 0, 2), (2, 0, 0, 1),
    (0, 1, 2, 1), (2, 1, 0, 1), (0, 0, 0, 0),
)  # fmt: skip


def along_border(x: float, y: float) -> float:
    """How far a point of a cell's border is from its lower left corner, counter-clockwise."""
    if y == 0.0:
        return x
    if x == 1.0:
        return 1.0 + y
    return 3.0 - x if y == 1.0 else 4.0 - y


@dataclass(frozen=True)
class TileMaterial:
    """What the cells with one number are made of; None: as the collider.

    friction, restitution
        coefficients, as those of a collider
    surface_velocity
        m/s, (2,), or a number for (number, 0): friction drives what touches the cells to that, along the surface
    """

    friction: float | None = None
    restitution: float | None = None
    surface_velocity: Vector | float | None = None

    def __post_init__(self) -> None:
        for name, column in COEFFICIENTS.items():
            if getattr(self, name) is not None:
                column.checked(getattr(self, name))
        if self.surface_velocity is not None:
            run_of(self.surface_velocity)


def run_of(surface_velocity: Any) -> np.ndarray:
    """(2,) m/s."""
    value = np.asarray(SURFACE.checked(surface_velocity), float)
    if value.ndim == 0:
        return np.array((float(value), 0.0))
    if value.shape != (2,):
        raise ValueError(f"TileMaterial.surface_velocity must be a number or 2 of them, got {surface_velocity!r}")
    return value


def table_of(materials: Mapping[int, TileMaterial], common: dict[str, Any]) -> np.ndarray:
    """(n, WIDTH), a row for each number up to the largest, row 0 for numbers without a material. ``common``: the
    collider's fields, which get the largest restitution, and a surface velocity where some material has one: a step
    looks at materials only where these say that there may be something."""
    if not isinstance(materials, Mapping):
        raise ValueError(f"TileGridCollider.materials must be a dict of TileMaterial by number, got {materials!r}")
    for number, material in materials.items():
        if not isinstance(number, (int, np.integer)) or isinstance(number, bool) or not 1 <= number <= MOST:
            raise ValueError(f"TileGridCollider.materials: numbers are 1 to {MOST}, got {number!r}")
        if not isinstance(material, TileMaterial):
            raise ValueError(f"TileGridCollider.materials: number {number} must be a TileMaterial, got {material!r}")
    own_restitution = float(Collider.columns["restitution"].checked(common.get("restitution", 0.0)))
    own_run = np.broadcast_to(np.asarray(common.get("surface_velocity", 0.0), float), 2)
    table = np.tile((OWN, own_restitution, *own_run), (1 + max(materials, default=0), 1))
    for number, material in materials.items():
        row = table[number]
        if material.friction is not None:
            row[FRICTION] = material.friction
        if material.restitution is not None:
            row[RESTITUTION] = material.restitution
        if material.surface_velocity is not None:
            row[RUN_X:] = run_of(material.surface_velocity)
    if table[:, RESTITUTION].max() > own_restitution:
        common["restitution"] = float(table[:, RESTITUTION].max())
    if not own_run.any() and table[:, RUN_X:].any():
        common["surface_velocity"] = tuple(abs(table[:, RUN_X:]).max(axis=0).tolist())
    return table


def materials_of(table: np.ndarray) -> dict[int, TileMaterial]:
    """The inverse of :func:`table_of`, each with all values but friction."""
    return {
        number: TileMaterial(
            None if row[FRICTION] == OWN else float(row[FRICTION]), float(row[RESTITUTION]), tuple(row[RUN_X:].tolist())
        )
        for number, row in enumerate(table)
        if number > 0 and not np.array_equal(row, table[0])
    }
