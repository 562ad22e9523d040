"""A segment that is solid from one side only, in 2D: jump through it from below, stand on it, slide off its ends.

The segment has contacts with every convex shape. Between NARROW, which finds the contacts, and RESPONSE, which acts on
them, a system disables those of bodies that do not come from its front. It uses only state that ``world.snapshot()``
contains.
"""

from __future__ import annotations

import weakref
from collections.abc import Mapping
from typing import Any, Literal, Self

import numpy as np

from ..components import AABBCollider, Collider, SphereCollider
from ..framework import Phase, Plugin, System, World, column
from ..framework.typing import VectorField
from ..framework.vectors import dot
from ..systems.shapes.linking.parameters import parameter_tuple
from .corners import in_world

__all__ = ["OneWaySegmentCollider"]

plugin = Plugin("one_way_segment", version="1.0")

SLACK = 0.02  # of its height: a body that begins to touch at most this deep counts as coming from the front
UPRIGHT = 0.5  # cosine: contacts whose normal leans farther from the front are with the segment's ends
FRONTS = ("left", "right")


@plugin.shape(cost=2)
class OneWaySegmentCollider(Collider):
    """A segment that stops what comes from its front and lets everything else pass; in 2D worlds.

    start, end
        (2,) m, relative to the centre, turned with the Transform; ValueError if they are equal
    front
        the solid side, as seen along the direction from start to end: ``"left"`` or ``"right"``
    """

    __slots__ = ()

    rotates = True
    dimensions = (2,)
    start: VectorField = column(item="vector", unit="m")
    end: VectorField = column(item="vector", unit="m")
    front: Literal["left", "right"] = column(default="left", choices=FRONTS)

    def _fill(self, given: Mapping[str, Any]) -> None:
        super()._fill(given)
        if np.array_equal(self.start, self.end):
            raise ValueError(f"OneWaySegmentCollider: start and end must differ, both are {self.start!r}")

    @classmethod
    def sample(cls, **common: Any) -> Self:
        return cls((-0.5, 0.0), (0.5, 0.0), **common)

    @staticmethod
    def bounds(shape, dimensions):
        one, two = in_world(shape, shape.start), in_world(shape, shape.end)
        return max(abs(one[0]), abs(two[0])), max(abs(one[1]), abs(two[1]))

    @staticmethod
    def support(shape, direction):
        one, two = in_world(shape, shape.start), in_world(shape, shape.end)
        return one if dot(one, direction) >= dot(two, direction) else two


# Pairs in contact at the end of the last step, by world: (step, pairs). Derived from the contacts, not accumulated.
_held: weakref.WeakKeyDictionary[World, tuple[int, set[tuple[int, int]]]] = weakref.WeakKeyDictionary()


@plugin.system
class ContactMemory(System):
    """Records, at the start of a step, the pairs with a one-way segment that touched at the end of the last step."""

    phase = Phase.START

    def process(self, dt: float) -> None:
        world, held = self.world, set()
        chosen = _segments_among(world)
        if chosen is not None:
            rows = np.flatnonzero((chosen[0] | chosen[1]) & world.contacts.enabled)
            held.update(zip(*(getattr(world.contacts, name)[rows].tolist() for name in PAIR), strict=True))
        _held[world] = world.step_count, held

    def reason(self) -> str:
        return _reason(self.world)


@plugin.system
class OneWay(System):
    """Clears ``enabled`` of the contacts of one-way segments with bodies that do not come from their front."""

    phase = Phase.NARROW

    def process(self, dt: float) -> None:
        chosen = _segments_among(self.world)
        if chosen is None:
            return
        enabled = self.world.contacts.enabled
        for of_second in (False, True):  # which of the two is the segment; both if two segments meet
            rows = np.flatnonzero(chosen[of_second])
            if len(rows):
                enabled[rows] &= self._holds(rows, of_second)

    def reason(self) -> str:
        return _reason(self.world)

    def _holds(self, contacts: np.ndarray, of_second: bool) -> np.ndarray:
        """True for contacts whose segment stops the other body."""
        world, bodies, found = self.world, self.world.bodies, self.world.contacts
        entities = [getattr(found, name)[contacts] for name in PAIR]
        if of_second:
            entities.reverse()
        order = np.argsort(bodies.entity, kind="stable")
        segment, other = (order[np.searchsorted(bodies.entity, which, sorter=order)] for which in entities)
        shapes = _Shapes(world, other, entities[1])
        fields = bodies.one_way_segment_collider
        turn = _rotations(bodies, segment)
        start, end = (_turned(turn, getattr(fields, name)[segment]) for name in ("start", "end"))
        way = end - start
        size = np.hypot(*way.T)
        with np.errstate(invalid="ignore", divide="ignore"):  # equal ends: no front, nothing is stopped
            along = way / size[:, None]
        sign = np.where(fields.front[segment] == FRONTS.index("left"), 1.0, -1.0)[:, None]
        front = sign * np.stack((-along[:, 1], along[:, 0]), axis=1)
        corner = start + _turned(turn, fields.offset[segment])
        # Height of the other's lowest point over the segment's line: at the start of the step, and after free flight.
        below = shapes.reach(-front)
        before, after = (
            shapes.centres(column) - column[segment] - corner for column in (bodies.previous_position, bodies.position)
        )
        low, lower = ((place * front).sum(axis=1) - below for place in (before, after))
        slack = SLACK * 2.0 * below
        # Position of the other along the segment when it meets the line. If it is beside the segment then, or barely
        # over its end, it comes from the side.
        with np.errstate(invalid="ignore", divide="ignore"):
            share = np.where((low > 0.0) & (lower < 0.0), low / (low - lower), 0.0)[:, None]
        at = ((before + share * (after - before)) * along).sum(axis=1)
        shared = np.minimum(at + shapes.reach(along), size - at + shapes.reach(-along))
        over = (shared > np.maximum(-low, 0.0)) | (lower >= 0.0)
        comes = (low >= 0.0) | ((low >= -slack) & (lower <= low))
        stands = self._stood(entities, of_second) & (low >= -np.where(below > 0.0, below, SLACK * size))
        # Contacts with the ends do not act; but a body that has come deep from the front is stopped wherever it is.
        normal = found.normal[contacts] * (-1.0 if of_second else 1.0)
        beside = ((normal * front).sum(axis=1) < UPRIGHT) & ~(comes & over & (lower < -slack))
        return (comes | stands) & over & ~beside | self._passive(segment, shapes)

    def _stood(self, entities: list[np.ndarray], of_second: bool) -> np.ndarray:
        step, held = _held.get(self.world, (-1, set()))
        if step != self.world.step_count or not held:
            return np.zeros(len(entities[0]), bool)
        pairs = zip(*(which.tolist() for which in (reversed(entities) if of_second else entities)), strict=True)
        return np.array([pair in held for pair in pairs], bool)

    def _passive(self, segment: np.ndarray, shapes: _Shapes) -> np.ndarray:
        """True for contacts with a sensor, which have no response and are left unchanged."""
        return self.world.bodies.one_way_segment_collider.sensor[segment] | shapes.sensors()


class _Shapes:
    """The deciding collider of each of some bodies: the most expensive one, or the cheapest for "bounds"."""

    def __init__(self, world: World, rows: np.ndarray, entities: np.ndarray) -> None:
        self._world, self._rows, self._entities = world, rows, entities
        self._samples: dict[int, Any] = {}  # parameters of shapes that are evaluated one by one
        shapes = sorted(world.registry.shapes.values(), key=lambda shape: (shape.cost, shape.component.__name__))
        self._of: dict[type[Any], np.ndarray] = {}  # indices of the bodies by collider type
        taken = np.zeros(len(rows), bool)
        for shape in shapes if world.settings.geometry == "bounds" else reversed(shapes):
            has = world.bodies.has(shape.component)[self._rows] & ~taken
            taken |= has
            if has.any():
                self._of[shape.component] = np.flatnonzero(has)
        self._turn = _rotations(world.bodies, self._rows)

    def _column(self, component: type[Any], name: str) -> np.ndarray:
        return getattr(getattr(self._world.bodies, component.prefix[:-1]), name)[self._rows[self._of[component]]]

    def sensors(self) -> np.ndarray:
        result = np.zeros(len(self._rows), bool)
        for component, chosen in self._of.items():
            result[chosen] = self._column(component, "sensor")
        return result

    def centres(self, positions: np.ndarray) -> np.ndarray:
        """(m, 2) centres of the shapes for these body positions."""
        result = positions[self._rows].copy()
        for component, chosen in self._of.items():
            result[chosen] += _turned(self._turn[chosen], self._column(component, "offset"))
        return result

    def reach(self, directions: np.ndarray) -> np.ndarray:
        """(m,) m, extent of each shape from its centre in its direction, a unit vector."""
        result = np.zeros(len(self._rows))
        for component, chosen in self._of.items():
            looks = directions[chosen]
            if component is SphereCollider:
                result[chosen] = self._column(component, "radius")
            elif component is AABBCollider:
                half = _turned(np.abs(self._turn[chosen]), self._column(component, "half_extents"))
                result[chosen] = (np.abs(looks) * half).sum(axis=1)
            else:
                for index, look in zip(chosen.tolist(), looks.tolist(), strict=True):
                    result[index] = self._reach_of(component, index, tuple(look))
        return result

    def _reach_of(self, component: type[Any], index: int, look: tuple[float, ...]) -> float:
        """The extent of one shape of any kind, by its own functions."""
        if index not in self._samples:
            self._samples[index] = self._parameters(component, index)
        sample = self._samples[index]
        if not hasattr(component, "support"):
            return float(np.abs(look) @ component.bounds(sample, 2))
        rounding = component.rounding(sample) if hasattr(component, "rounding") else 0.0
        return float(np.dot(component.support(sample, look), look)) + rounding

    def _parameters(self, component: type[Any], index: int) -> Any:
        """The parameters for the shape's functions, with the body's rotation applied."""
        shape, axes = self._world.registry.shapes[component], self._turn[index]
        handle = self._world.component_for_entity(int(self._entities[index]), component)
        values = [_plain(getattr(handle, name)) for name in shape.columns]
        sample = parameter_tuple(shape)(*values, *[tuple(map(tuple, axes.T.tolist()))] * shape.rotates)
        if hasattr(component, "turned"):
            sample = sample._replace(**dict(zip(shape.columns, component.turned(sample, axes), strict=True)))
        return sample


PAIR = ("entity_a", "entity_b")


def _segments_among(world: World) -> tuple[np.ndarray, np.ndarray] | None:
    """Masks of the contacts whose first and whose second body is a one-way segment; None if there are none."""
    segments = world.bodies.has(OneWaySegmentCollider)
    if not len(world.contacts) or not segments.any():
        return None
    entities = world.bodies.entity[segments]
    first, second = (np.isin(getattr(world.contacts, name), entities) for name in PAIR)
    return (first, second) if first.any() or second.any() else None


def _reason(world: World) -> str:
    count = int(world.bodies.has(OneWaySegmentCollider).sum())
    return f"{count} one-way segments" if count else "no one-way segments: nothing to do"


def _rotations(bodies: Any, rows: Any) -> np.ndarray:
    """Rotation matrices (m, 2, 2)."""
    angle = bodies.rotation[rows]
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.stack((np.stack((cosine, -sine), axis=-1), np.stack((sine, cosine), axis=-1)), axis=-2)


def _turned(matrices: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    return (matrices @ vectors[:, :, None])[:, :, 0]


def _plain(value: Any) -> Any:
    """A field as passed to shape functions: vectors as tuples, arrays unchanged."""
    return tuple(value.tolist()) if isinstance(value, np.ndarray) and value.ndim == 1 else value
