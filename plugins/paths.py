"""Paths of kinematic bodies: ``World(Physics(), Paths())``, then bodies with a ``Path(points, speed)``."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np

from ..components import RigidBody, Transform
from ..framework import Component, Phase, Plugin, System, array_column, column
from ..framework.data.arrays.column import ArrayColumn
from ..framework.data.columns import Column
from ..framework.data.component import NOTHING
from ..framework.typing import ArrayField

__all__ = ["Path", "Paths"]

MODES = ("back_and_forth", "loop", "once")
BACK_AND_FORTH, LOOP, ONCE = range(3)
STEEPEST = 1.5  # of the curve of ease, u^2 (3 - 2 u)
ROUNDING = 1e-9  # of what a body moves in a step
DIGITS = 16  # spacings of a coordinate that computing it may be wrong by
Mode = Literal["back_and_forth", "loop", "once"]


class PointsColumn(ArrayColumn):
    """Arrays (k, 2) or (k, 3): three numbers a row are stored, the last one is nan in 2D."""

    def checked(self, value: Any, entity: int | None = None) -> Any:
        if isinstance(value, (str, os.PathLike)):
            raise self._error(value, "must be points, it is not a path of files, which is pathlib.Path", entity)
        array = Column(item="vector", name=self.name, owner=self.owner)._as_numbers(value, entity)
        if array.ndim != 2 or array.shape[1] not in (2, 3) or len(array) < 2:
            raise self._error(value, "must be two points or more, an array of shape (n, 2) or (n, 3)", entity)
        self.check_numbers(array, array.tolist(), entity)
        with np.errstate(over="ignore"):
            lengths = np.linalg.norm(np.diff(array, axis=0), axis=1)
        if not lengths.all():
            raise self._error(array[int(lengths.argmin())], "must not have a point twice in a row", entity)
        if not np.isfinite(2.0 * lengths.sum()):
            raise self._error(value, "must not be so long that its length is not finite", entity)
        return self.unshared(array)

    def checked_many(self, values: Any, count: int, dimensions: int) -> np.ndarray:
        numbers = super().checked_many(values, count, dimensions)
        for number in set(numbers.tolist()):
            self.check_dimensions(number, dimensions)
        return numbers

    def check_dimensions(self, value: Any, dimensions: int, entity: int | None = None) -> None:
        if len(self.shown(value)[0]) != dimensions:
            points, rule = self.shown(value), f"must be points of {dimensions} numbers in this {dimensions}D world"
            raise self._error(points, rule, entity)

    def unshared(self, value: Any) -> Any:
        padded = np.full((len(value), 3), np.nan)
        padded[:, : len(value[0])] = value
        return self.pool.number_of(padded)

    def shown(self, value: Any) -> np.ndarray:
        points = super().shown(value)
        return points[:, :2] if len(points) and np.isnan(points[0, 2]) else points


def _points_column() -> Any:
    plain = array_column(3)
    return PointsColumn(**{field.name: getattr(plain, field.name) for field in dataclasses.fields(plain)})


class Path(Component):
    """Moves a kinematic body along straight legs, and so whatever stands on it.

    points
        (n, d) m, two or more places of the world
    speed
        m/s, at least 0
    mode
        ``"back_and_forth"``; ``"loop"``, from the last point straight to the first; ``"once"``, to the last one
    ease
        slow at each point: legs take as long, and halfway the body is 1.5 times as fast
    travelled
        m, how far it has come, there and back or round; where it starts
    """

    __slots__ = ()
    plugin: ClassVar[str] = "paths"
    needs: ClassVar[tuple[type[Component], ...]] = (RigidBody,)

    if TYPE_CHECKING:
        points: ArrayField = array_column(3)
    else:
        points = _points_column()
    speed: float = column(minimum=0.0, unit="m/s")
    mode: Mode = column(default="back_and_forth", choices=MODES, kw_only=True)
    ease: bool = column(default=False, dtype=bool, kw_only=True)
    travelled: float = column(default=0.0, minimum=0.0, kw_only=True, unit="m")

    def check_in(self, contents: Any, entity: int | None, beside: Mapping[type[Any], Any] = NOTHING) -> None:
        """ValueError if its entity is no body that moves."""
        types = {*beside, *(() if entity is None else contents.entities.types_of(entity))}
        if not {Transform, RigidBody} <= types:
            raise ValueError(_refusal(entity, "its entity has no Transform and RigidBody"))


class Paths(Plugin):
    """Moves the bodies that have a :class:`Path`: at the end of each step they are on it."""

    def __init__(self) -> None:
        super().__init__("paths", version="1.0", needs_physics=True)
        self.component(Path)
        self.system(FollowPaths)


class FollowPaths(System):
    """Sets velocities that end the step on the path."""

    phase = Phase.START
    _rounds, _made_of, _legs = -1, None, None

    def process(self, dt: float) -> None:
        table, bodies = self.world.physics.table, self.world.bodies.kinematic
        self._refuse_loose()
        rows = np.flatnonzero(table.has_mask(Path)[: table.count] & ~self.world.physics.excluded())
        own = rows - bodies.rows.start
        if not len(rows):
            return
        for row in rows[(own < 0) | (own >= len(bodies))].tolist():
            raise ValueError(_refusal(table.column("entity")[row], "this one is dynamic or static"))
        speed, ease, travelled = (table.arrays[f"path.{name}"][rows] for name in ("speed", "ease", "travelled"))
        legs = self._legs_of(table.arrays["path.points"][rows], table.arrays["path.mode"][rows])
        after = legs.folded(travelled + speed * dt, ROUNDING * speed * dt)
        target = legs.places(after, ease)
        gap = target - bodies.position[own]
        apart = np.linalg.norm(gap, axis=1)
        rounding = DIGITS * np.spacing(np.abs(target).max(axis=1))
        reach = speed * dt * np.where(ease, STEEPEST, 1.0) * (1.0 + ROUNDING) + rounding
        off = ~(apart <= reach)  # put elsewhere, or not there yet: straight to it; nan leaves travelled as it is
        velocity = gap / dt
        velocity[off] = gap[off] / apart[off, None] * speed[off, None]
        velocity[(apart <= rounding) & (after == travelled)] = 0.0  # so that what stands on it can sleep
        bodies.linear_velocity[own] = velocity
        table.arrays["path.travelled"][rows] = np.where(off, travelled, after)

    def _legs_of(self, numbers: np.ndarray, modes: np.ndarray) -> Legs:
        made_of = numbers.tobytes(), modes.tobytes()
        if self._made_of != made_of:
            points = [Path.columns["points"].shown(number) for number in numbers.tolist()]
            self._made_of, self._legs = made_of, Legs(points, modes)
        return self._legs

    def _refuse_loose(self) -> None:
        """ValueError for a path of what is no body; those made one by one are refused before."""
        contents = self.world._contents()
        if contents.log.rounds != self._rounds:
            self._rounds, members = contents.log.rounds, contents.members.get(Path)
            loose = () if members is None else self.world.physics.adoption.loose(Path, members.listed)
            for entity in sorted({*loose} - contents.log.touched):
                self._rounds = -1
                raise ValueError(_refusal(entity, "its entity has no Transform and RigidBody"))


class Legs:
    """The legs of n paths.

    points
        (n, k, d) m, from which legs begin and, the last one, end; k is that of the longest path
    starts
        (n, k) m, how far along; inf beyond the last point
    """

    def __init__(self, points: list[np.ndarray], modes: np.ndarray) -> None:
        points = [np.vstack((p, p[:1])) if m == LOOP else p for p, m in zip(points, modes.tolist(), strict=True)]
        shape = len(points), max(map(len, points)), len(points[0][0])
        self.points, self.starts = np.zeros(shape), np.full(shape[:2], np.inf)
        self.last = np.array([len(each) - 2 for each in points])  # leg
        for k, each in enumerate(points):
            self.points[k, : len(each)] = each
            self.starts[k, 0] = 0.0
            self.starts[k, 1 : len(each)] = np.cumsum(np.linalg.norm(np.diff(each, axis=0), axis=1))
        self.all, self.modes = np.arange(len(points)), modes
        self.lengths = self.starts[self.all, self.last + 1]

    def folded(self, travelled: np.ndarray, rounding: np.ndarray) -> np.ndarray:
        """(n,) m, less than once there and back, or round; at most once there. As near at a point as ``rounding``, (n,)
        m, it is at the point: what should arrive there in a step does, and no error grows beyond it."""
        round_trip = np.where(self.modes == LOOP, 1.0, 2.0) * self.lengths
        travelled = np.where(self.modes == ONCE, np.minimum(travelled, self.lengths), np.mod(travelled, round_trip))
        along = self._along(travelled)
        nearest = np.abs(self.starts - along[:, None]).argmin(axis=1)
        point = self.starts[self.all, nearest]
        at = np.where(travelled > self.lengths, round_trip - point, point)
        is_there = np.abs(point - along) <= rounding + DIGITS * np.spacing(self.lengths)
        return np.where(is_there, np.where((self.modes != ONCE) & (at >= round_trip), 0.0, at), travelled)

    def _along(self, travelled: np.ndarray) -> np.ndarray:
        """(n,) m from the first point; on the way back less and less."""
        return np.where(travelled > self.lengths, 2.0 * self.lengths - travelled, travelled)

    def places(self, travelled: np.ndarray, ease: np.ndarray) -> np.ndarray:
        """(n, d) m, where that is."""
        along = self._along(travelled)
        leg = np.minimum((self.starts[:, 1:] <= along[:, None]).sum(axis=1), self.last)
        start = self.starts[self.all, leg]
        length = self.starts[self.all, leg + 1] - start
        part = np.divide(along - start, length, out=np.zeros_like(along), where=length > 0.0)
        part = np.where(ease, part * part * (3.0 - 2.0 * part), part)[:, None]
        return (1.0 - part) * self.points[self.all, leg] + part * self.points[self.all, leg + 1]


def _refusal(entity: int | None, why: str) -> str:
    name = "Path" if entity is None else f"entity {entity}: Path"
    return f'{name} moves kinematic bodies, RigidBody(kind="kinematic"): {why}'
