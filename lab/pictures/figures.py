"""The shapes of a drawing list, body by body: what pictures choose, colour and measure."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...drawing import Capsules, Circles, DrawingList, Lines, Polygons, Style
from ...framework import World
from ..measure.bodies import Floats


@dataclass(frozen=True)
class Figures:
    """n bodies with shapes, ascending by ``entity (n,)``, and these shapes in groups, as drawing lists have them.

    ``lower``, ``upper (n, d)``: the box around a body's shapes; ``centre (n, d)``: that of the first; ``position``,
    ``velocity (n, d)``; ``static``, ``sensor (n,)``.
    """

    entity: NDArray[np.int64]
    lower: Floats
    upper: Floats
    centre: Floats
    position: Floats
    velocity: Floats
    static: NDArray[np.bool_]
    sensor: NDArray[np.bool_]
    polygons: list[Polygons]
    circles: list[Circles]
    capsules: list[Capsules]
    lines: list[Lines]

    @classmethod
    def of(cls, world: World, shown: DrawingList) -> Figures:
        """The shapes of ``shown``, and how their bodies move."""
        d = shown.dimensions
        moving = [*shown.polygons, shown.circles, shown.capsules, *shown.lines]
        still = [*shown.fixed, shown.fixed_circles, shown.fixed_capsules, *shown.fixed_lines]
        groups = [group for group in (*moving, *still) if len(group) and group.style[0] < Style.JOINT]
        boxes = [np.zeros((0, 3, d)), *(_box(group) for group in groups)]
        entities = np.concatenate([np.zeros(0, np.int64), *(group.entity for group in groups)])
        order = np.argsort(entities, kind="stable")
        entity, first = np.unique(entities[order], return_index=True)
        lower, upper, centre = np.concatenate(boxes)[order].transpose(1, 0, 2)
        style = np.concatenate([np.zeros(0, np.int8), *(group.style for group in groups)])[order][first]
        static = np.isin(entity, np.concatenate([group.entity for group in still]))
        if len(entity):
            lower, upper = np.minimum.reduceat(lower, first), np.maximum.reduceat(upper, first)
        row = world.bodies.rows_of(entity)
        motion = world.bodies.position[row], world.bodies.linear_velocity[row]
        kinds: Any = (Polygons, Circles, Capsules, Lines)
        of_kind = ([group for group in groups if isinstance(group, kind)] for kind in kinds)
        return cls(entity, lower, upper, centre[first], *motion, static, style == Style.SENSOR, *of_kind)

    @property
    def speed(self) -> Floats:
        return np.where(self.static, 0.0, np.linalg.norm(self.velocity, axis=1))

    @property
    def extent(self) -> Floats:
        """(n,) the longest side of each box."""
        return (self.upper - self.lower).max(axis=1)

    @property
    def typical_diameter(self) -> float:
        """The median extent; 0 without shapes."""
        return float(np.median(self.extent)) if len(self.entity) else 0.0

    def where(self, chosen: NDArray[np.bool_] | NDArray[np.int64]) -> Figures:
        """The bodies where ``chosen`` is true, or those of these numbers, which ascend."""
        kept = self.entity[chosen]
        columns: dict[str, Any] = {name: getattr(self, name) for name in self.__dataclass_fields__}
        for name, column in columns.items():
            if isinstance(column, list):
                some = [group.where(np.isin(group.entity, kept)) for group in column]
                columns[name] = [group for group in some if len(group)]
            else:
                columns[name] = column[chosen]
        return Figures(**columns)

    def rows(self, group: Any) -> NDArray[np.int64]:
        """Which of the bodies the things of a group belong to."""
        return np.searchsorted(self.entity, group.entity)

    def at(self, places: Floats, turns: Floats) -> Figures:
        """A single body, repeated at each of m places (m, d), turned on by matrices (m, d, d); the entities are
        numbers."""
        m, about = len(places), self.position[0]

        def moved(points: Floats) -> Floats:
            """(m * n, k, d) of points (n, k, d)"""
            turned = np.einsum("mij,nkj->mnki", turns, points - about) + places[:, None, None]
            return turned.reshape(-1, *points.shape[1:])

        def again(group: Any, **columns: Any) -> Any:
            repeated = group.where(np.tile(np.arange(len(group)), m))
            return replace(repeated, **columns, entity=np.repeat(np.arange(m), len(group)))

        def angles(circles: Circles) -> Floats:
            if circles.angle.ndim == 3:
                return np.einsum("mij,njk->mnik", turns, circles.angle).reshape(-1, 3, 3)
            return (np.arctan2(turns[:, 1, 0], turns[:, 0, 0])[:, None] + circles.angle).ravel()

        columns = {name: np.repeat(getattr(self, name), m, axis=0) for name in ("velocity", "static", "sensor")}
        low, high, centre = (places + place - about for place in (self.lower, self.upper, self.centre))
        return Figures(
            np.arange(m), low, high, centre, places, **columns,
            polygons=[again(g, points=moved(g.points), centre=moved(g.centre[:, None])[:, 0]) for g in self.polygons],
            circles=[again(g, centre=moved(g.centre[:, None])[:, 0], angle=angles(g)) for g in self.circles],
            capsules=[again(g, ends=moved(g.ends)) for g in self.capsules],
            lines=[again(g, points=moved(g.points)) for g in self.lines],
        )  # fmt: skip


def _box(group: Any) -> Floats:
    """(n, 3, d): lower and upper corners of the boxes, and the centres of the shapes."""
    low, high = group.boxes()
    return np.stack((low, high, getattr(group, "centre", (low + high) / 2)), axis=1)
