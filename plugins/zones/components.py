"""Wind, Water and Field: what a sensor does to the bodies in it."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any, ClassVar

from ...components import Collider
from ...framework import Component, column
from ...framework.typing import VectorField


class Zone(Component, abstract=True):
    """What all of them have: they act on dynamic bodies that touch the collider of their entity, as layers, masks and
    groups allow."""

    __slots__ = ()
    plugin: ClassVar[str] = "zones"

    def check_in(self, contents: Any, entity: int | None, beside: Collection[type[Any]] = ()) -> None:
        """ValueError if its entity has no collider."""
        types = {*beside, *(() if entity is None else contents.entities.types_of(entity))}
        if not any(issubclass(each, Collider) for each in types if isinstance(each, type)):
            name = type(self).__name__ if entity is None else f"entity {entity}: {type(self).__name__}"
            raise ValueError(f"{name} acts on what is in a collider, and its entity has none: give it one, sensor=True")


class Wind(Zone):
    """A force on each body in it.

    force
        (d,) N, at the centre of each body, whatever its mass and size
    """

    __slots__ = ()
    force: VectorField = column(item="vector", unit="N")


class Water(Zone):
    """Lifts what is in it by the weight of what it displaces, and slows it down.

    density
        kg/m^3, in 2D kg/m^2: what is lighter floats
    drag
        1/s: a body that is all in it and as dense gets as fast as the flow at this rate, others by the mass that they
        displace over theirs
    flow
        (d,) m/s, of the water
    """

    __slots__ = ()
    density: float = column(minimum=0.0, unit="kg/m^3")
    drag: float = column(default=1.0, minimum=0.0, unit="1/s")
    flow: VectorField = column(default=0.0, item="vector", unit="m/s")


class Field(Zone):
    """Attracts bodies to the centre of its collider, each with strength / distance ** falloff.

    strength
        m/s^2 at a distance of 1 m; below 0 it repels
    falloff
        0: the same everywhere; 2: as gravity of a planet
    core
        m, above 0: nearer than that it gets weaker again in proportion to the distance, as inside a planet
    """

    __slots__ = ()
    strength: float = column(unit="m/s^2")
    falloff: float = column(default=2.0, minimum=0.0)
    core: float = column(default=0.1, positive=True, kw_only=True, unit="m")
