"""False positives and cost of geometry levels, for several kinds of objects.

Equal objects lie at random in a 2D world, upright or turned at random. Each option gives them other colliders around
the same polygons. The true overlaps are found without the engine, see :mod:`carom.lab.studies.geometry.reference`.
"""

from __future__ import annotations

import contextlib
import math
import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from ....components import AABBCollider, RigidBody, SphereCollider, Transform
from ....framework import Phase, World
from ....plugins import Physics, convex_polygon
from ....plugins.convex_polygon import ConvexPolygonCollider
from ...bench.results import machine
from ...cli.usage_errors import Problem, did_you_mean
from ...measure.timing import Spread, no_garbage_collection, now
from ...reporting.progress import NO_PROGRESS, Progress
from .objects import OBJECTS, Object
from .records import GeometryCost, GeometryStudy
from .reference import expected_area, touching

OPTIONS = {
    "sphere": ("sphere",),
    "box": ("box",),
    "sphere then box": ("sphere", "box"),
    "sphere then precise": ("sphere", "precise"),
    "box then precise": ("box", "precise"),
    "precise": ("precise",),
}
COUNT = 4000  # objects in a world
WORLDS = 4  # per option: repeating one world would train the branch predictor
REPEATS = 7
CALLS = 3  # consecutive calls on one world; then another option runs
ROOM = 4.0  # m2 of the world per object of 1 m2
ROUNDING = 1e-9  # m, tolerance between the engine's depth and that of the separating axes


def geometry_study(
    count: int = COUNT,
    repeats: int = REPEATS,
    *,
    things: Sequence[Object] = OBJECTS,
    options: Sequence[str] = tuple(OPTIONS),
    worlds: int = WORLDS,
    room: float = ROOM,
    seed: int = 0,
    progress: Progress = NO_PROGRESS,
) -> GeometryStudy:
    """Count and time these options, of :data:`OPTIONS`, for these objects, upright and turned.

    count: objects in each world; worlds: per option; room: m2 of the world per object of 1 m2. Equal arguments give
    equal counts. ValueError for arguments out of range, Problem if the engine's precise level and the separating axes
    disagree.
    """
    for option in options:
        if option not in OPTIONS:
            raise ValueError(f"geometry_study: options has {option!r}{did_you_mean(str(option), OPTIONS)}")
    if not (things and options):
        raise ValueError("geometry_study: things and options must not be empty")
    for name, value, least in (("count", count, 2), ("repeats", repeats, 1), ("worlds", worlds, 1), ("seed", seed, 0)):
        if operator.index(value) < least:
            raise ValueError(f"geometry_study: {name} must be a whole number from {least}, got {value!r}")
    if not (math.isfinite(room) and room > 0):
        raise ValueError(f"geometry_study: room must be positive, got {room!r}")
    progress.begin(2 * len(things) * (repeats + 1))
    costs = []
    for thing in things:
        for turned in (False, True):
            progress.say(f"{thing.name}, {'turned' if turned else 'upright'}")
            crowds = [Crowd.random(thing, turned, count, room, (seed, number)) for number in range(worlds)]
            costs += _case(crowds, tuple(options), repeats, progress)
    return GeometryStudy(machine(), count, worlds, repeats, room, seed, costs)


@dataclass(frozen=True)
class Crowd:
    """Objects of one kind: positions (n, 2) m, rotations (n,) radians."""

    thing: Object
    turned: bool
    positions: np.ndarray
    rotations: np.ndarray

    @classmethod
    def random(cls, thing: Object, turned: bool, count: int, room: float, seed: tuple[int, ...]) -> Self:
        """Uniformly in a square of that area per object; equal seeds give equal positions for all kinds of objects."""
        rng = np.random.default_rng(seed)
        positions = rng.uniform(0.0, math.sqrt(count * room), (count, 2))
        rotations = rng.uniform(-math.pi, math.pi, count) if turned else np.zeros(count)
        return cls(thing, turned, positions, rotations)

    def world(self, levels: tuple[str, ...]) -> World:
        """These objects with colliders of those levels; sensors, so that only finding contacts takes time."""
        world = World(Physics(dimensions=2), convex_polygon.plugin)
        colliders = [COLLIDERS[level](self.thing, levels, len(self.positions)) for level in levels]
        world.create_entities(
            len(self.positions), Transform.many(self.positions, rotation=self.rotations), RigidBody.many(), *colliders
        )
        return world


def _sphere(thing: Object, levels: tuple[str, ...], count: int) -> Any:
    """The smallest circle around the polygon; around the box if the next level is a box."""
    if "box" in levels:
        return SphereCollider.many(radius=float(np.linalg.norm(thing.half_extents)), sensor=True)
    centre, radius = thing.circle
    return SphereCollider.many(radius=radius, offset=centre, sensor=True)


def _box(thing: Object, levels: tuple[str, ...], count: int) -> Any:
    return AABBCollider.many(half_extents=thing.half_extents, sensor=True)


def _precise(thing: Object, levels: tuple[str, ...], count: int) -> Any:
    return ConvexPolygonCollider.many(vertices=[thing.corners] * count, sensor=True)


COLLIDERS: dict[str, Callable[[Object, tuple[str, ...], int], Any]] = {
    "sphere": _sphere, "box": _box, "precise": _precise
}  # fmt: skip


@dataclass
class Tally:
    """Counts over the worlds of one option."""

    tested: int = 0
    first_hits: int = 0
    hits: int = 0
    misses: int = 0


class Finder:
    """Runs broad and narrow phase of a world on its present state."""

    def __init__(self, world: World) -> None:
        self._world = world
        world.run(Phase.NARROW)  # gathers the bodies and compiles
        physics: Any = world.physics
        self._broad, self._narrow = physics.broad_phase, physics.narrow_phase

    def seconds(self, calls: int) -> np.ndarray:
        """(2,) seconds of this many calls of the broad and of the narrow phase."""
        total = np.zeros(2)
        for _ in range(calls):
            started = now()
            self._broad.process(0.0)
            middle = now()
            self._narrow.process(0.0)
            total += middle - started, now() - middle
            _ = self._world.contacts.depth  # build the lazy column outside the timed part
        return total


def _case(crowds: list[Crowd], options: tuple[str, ...], repeats: int, progress: Progress) -> list[GeometryCost]:
    """Measure these options on the same crowds."""
    thing, turned = crowds[0].thing, crowds[0].turned
    truths = [touching(thing.corners, crowd.positions, crowd.rotations) for crowd in crowds]
    tallies = {option: Tally() for option in options}
    objects = sum(len(crowd.positions) for crowd in crowds)
    with contextlib.ExitStack() as stack:
        finders: dict[str, list[Finder]] = {option: [] for option in options}
        for crowd, truth in zip(crowds, truths, strict=True):
            for option in options:
                world = stack.enter_context(contextlib.closing(crowd.world(OPTIONS[option])))
                finders[option].append(Finder(world))
                _count(world, option, truth, tallies[option])
        progress.advance(1)
        seconds = _time(finders, repeats, progress)
    true_area = expected_area(thing, ("precise",), turned)
    costs = []
    for option in options:
        tally, spent = tallies[option], seconds[option] * 1e9
        hit_area = expected_area(thing, OPTIONS[option], turned)
        costs.append(
            GeometryCost(
                thing.name, turned, option, objects, sum(len(pairs) for pairs, _ in truths), tally.tested,
                tally.first_hits, tally.hits, tally.misses,
                None if hit_area is None or true_area is None else 1 - true_area / hit_area,
                Spread.of((spent[:, 1] / max(tally.tested, 1)).tolist()),
                Spread.of((spent.sum(axis=1) / objects).tolist()),
            )
        )  # fmt: skip
    return costs


def _count(world: World, option: str, truth: tuple[np.ndarray, np.ndarray], tally: Tally) -> None:
    """Add the counts of this world; Problem if the polygons' contacts differ from the reference."""
    counters, contacts = world.stats().counters, world.contacts
    count = len(world.bodies)
    first_entity = int(world.bodies.entity.min())
    found = np.sort(np.stack((contacts.entity_a, contacts.entity_b), axis=1) - first_entity, axis=1)
    pairs, depths = truth
    found_keys, true_keys = found @ (count, 1), pairs @ (count, 1)
    order = np.argsort(found_keys)
    if option == "precise" and not (
        np.array_equal(found_keys[order], true_keys) and np.all(np.abs(contacts.depth[order] - depths) <= ROUNDING)
    ):
        raise Problem("the precise level finds other contacts than the separating axes")
    tally.tested += counters["candidates"]
    tally.first_hits += counters["first_level_hits"] if len(OPTIONS[option]) > 1 else len(found)
    tally.hits += len(found)
    tally.misses += len(np.setdiff1d(true_keys, found_keys))


def _time(finders: dict[str, list[Finder]], repeats: int, progress: Progress) -> dict[str, np.ndarray]:
    """(repeats, 2) seconds of one pass of both phases through all worlds of an option; the options alternate."""
    seconds = {option: np.zeros((repeats, 2)) for option in finders}
    names = list(finders)
    for repeat in range(repeats):
        with no_garbage_collection():
            for turn in range(len(finders[names[0]])):
                shift = (turn + repeat) % len(names)
                for option in (*names[shift:], *names[:shift]):
                    seconds[option][repeat] += finders[option][turn].seconds(CALLS) / CALLS
        progress.advance(1)
    return seconds
