"""Builds one drawn scene, plays it, and notes what became of it."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .....components import AABBCollider, RigidBody, SphereCollider, Transform
from .....framework import CaromError, Settings, World
from .....plugins import Physics, capsule, convex_polygon, half_space, one_way_segment, tile_grid
from .....plugins.springs import Springs
from ....cli.usage_errors import one_line
from .axes import DROP, ROOM, STACK, Draw

STEPS = {STACK: 60, DROP: 60, ROOM: 40}
FEWEST, MOST = 10, 30  # bodies in a room
APART = 1.1  # least spacing that a room has place for, of the largest size
FLOOR = 2.0  # thickness, m
WIDE = 20.0  # half width of a floor, m
PLUGINS = {
    "capsule": capsule.plugin, "polygon": convex_polygon.plugin, "half_space": half_space.plugin,
    "tiles": tile_grid.plugin, "one_way": one_way_segment.plugin,
}  # fmt: skip
PASSED = {"box": FLOOR, "tiles": FLOOR, "half_space": 1.0, "one_way": 0.0}  # m below its top: a body is lost
INTERLOCKED = 2.0  # size / spacing beyond which bodies of a stack are created past each other's middle
GAIN = 0.01  # of the energy at the start: more is a failure


@dataclass
class Outcome:
    """What became of a scene.

    lost
        bodies that ended a step beyond what holds them
    not_finite
        bodies with a number that is not finite
    disordered
        True if bodies of a stack passed each other
    gain
        energy gained, of that at the start; None where it says nothing: springs, bodies created in each other, or a
        scene that has ended otherwise
    slowest
        s, of all steps but the first, which may compile
    broken
        the step at which the first of these happened; None: never
    refused
        the error that ended it, or empty
    faults
        how many the world reported
    outside
        how the scene leaves the valid range of its mode
    """

    number: int
    lost: int = 0
    not_finite: int = 0
    disordered: bool = False
    gain: float | None = None
    slowest: float = 0.0
    broken: int | None = None
    refused: str = ""
    faults: int = 0
    outside: list[str] = field(default_factory=list)

    @property
    def failures(self) -> list[str]:
        """In words; empty if all went well."""
        return [word for word, failed in (
            ("lost", self.lost > 0), ("not finite", self.not_finite > 0), ("order", self.disordered),
            ("energy", self.gain is not None and self.gain > GAIN), ("refused", bool(self.refused)),
        ) if failed]  # fmt: skip


@dataclass
class Scene:
    """A built scene; ``rows`` of its moving bodies, a stack's from below. Positions are relative to ``origin``, (d,) m.

    lost
        (positions (n, d)) -> (n,) true for bodies beyond what holds them
    height
        m, the largest fall
    """

    draw: Draw
    world: World
    origin: np.ndarray
    rows: np.ndarray
    lost: Callable[[np.ndarray], np.ndarray]
    height: float


def played(draw: Draw) -> Outcome:
    """Build and play the scene. An error raised by carom is part of the outcome."""
    outcome = Outcome(draw.number)
    with np.errstate(all="ignore"):
        scene = build(draw)
        outcome.outside = draw.outside(scene.height)
        with closing(scene.world):
            try:
                _play(scene, outcome)
            except (CaromError, ValueError, ArithmeticError, MemoryError) as error:
                outcome.refused = one_line(error.__cause__ or error)
                outcome.broken = scene.world.step_count
                outcome.gain = None
            outcome.faults = len(scene.world.faults)
    return outcome


def _play(scene: Scene, outcome: Outcome) -> None:
    draw, world = scene.draw, scene.world
    start, most = energy(scene) + drift(scene, 0), 0.0
    ordered = draw.kind == STACK and draw.values["density"] <= INTERLOCKED
    judged = draw.values["stiffness"] == 0.0 and draw.values["density"] <= 1.0
    for step in range(1, STEPS[draw.kind] + 1):
        began = time.perf_counter()
        world.step()
        if step > 1:
            outcome.slowest = max(outcome.slowest, time.perf_counter() - began)
        place, velocity = world.bodies.position[scene.rows] - scene.origin, world.bodies.linear_velocity[scene.rows]
        outcome.not_finite = int((~np.isfinite(place + velocity).all(axis=1)).sum())
        outcome.lost = int(scene.lost(place).sum())
        outcome.disordered = ordered and bool((np.diff(place[:, 1]) <= 0.0).any())
        if outcome.not_finite or outcome.lost or outcome.disordered:
            outcome.broken = step
            return
        if judged:
            most = max(most, (energy(scene) - drift(scene, step) - start) / start)
            if most > GAIN and outcome.broken is None:
                outcome.broken = step
    if judged:
        outcome.gain = float(most)


def energy(scene: Scene) -> float:
    """Joules, with gravity's from the lowest place that holds the bodies, so that it is never negative."""
    bodies = scene.world.bodies
    velocity, place, mass = (column[scene.rows] for column in (bodies.linear_velocity, bodies.position, bodies.mass))
    height = place[:, 1] - scene.origin[1] + 0.5 * scene.height
    return float((mass * (0.5 * (velocity**2).sum(axis=1) + scene.draw.gravity * height)).sum())


def drift(scene: Scene, step: int) -> float:
    """Joules that the Euler methods may have gained by themselves: half a step of gravity on each body's way, and, in
    the explicit one, m (g dt)^2 / 2 at every step."""
    draw, world = scene.draw, scene.world
    if not draw.drifts:
        return 0.0
    bodies, change = world.bodies, draw.gravity * world.settings.dt
    mass, speed = bodies.mass[scene.rows], np.abs(bodies.linear_velocity[scene.rows, 1])
    return float((mass * change * (speed + step * change)).sum())


def build(draw: Draw) -> Scene:
    """The scene before its first step."""
    random = np.random.default_rng([draw.seed, draw.number, 1])  # another stream than that of the draw
    gravity = (0.0, -draw.gravity, 0.0)[: draw.dimensions]
    used = {draw.shape, draw.floor if draw.kind != ROOM else ""}
    plugins: list[Any] = [plugin for name, plugin in PLUGINS.items() if name in used]
    springs = Springs() if draw.values["stiffness"] else None
    world = World(
        Physics(dimensions=draw.dimensions, gravity=gravity), *plugins, *(() if springs is None else (springs,)),
        settings=Settings(**draw.settings()),
    )  # fmt: skip
    origin = np.zeros(draw.dimensions) + draw.values["distance"]
    count = round(draw.values["height"]) if draw.kind != ROOM else int(random.integers(FEWEST, MOST + 1))
    sizes, masses = (_spread(draw.values[name], count, random) for name in ("size", "mass"))
    if draw.kind == ROOM:
        place, velocity, lost, height = _room(draw, world, origin, sizes, random)
    else:
        place, velocity, lost, height = _column(draw, world, origin, sizes)
    entities = [
        world.create_entity(
            Transform(tuple((origin + place[k]).tolist())), RigidBody(float(masses[k]), tuple(velocity[k].tolist())),
            collider_of(draw.shape, draw.dimensions, float(sizes[k]), draw.values["restitution"]),
        )
        for k in range(count)
    ]  # fmt: skip
    if springs is not None:
        for k in range(0, count - 1, 2):  # in pairs, whose frequency is known
            rate = 1.0 / masses[k] + 1.0 / masses[k + 1]
            stiffness = (draw.values["stiffness"] / world.settings.dt) ** 2 / rate
            springs.connect(entities[k], entities[k + 1], stiffness=float(stiffness))
    rows = np.array([world.bodies.row_of(entity) for entity in entities])
    return Scene(draw, world, origin, rows, lost, height)


def collider_of(shape: str, dimensions: int, size: float, restitution: float) -> Any:
    """A collider as high as ``size``, with a flat or round foot."""
    half = 0.5 * size
    if shape == "ball":
        return SphereCollider(half, restitution=restitution)
    if shape == "box":
        return AABBCollider((half,) * dimensions, restitution=restitution)
    if shape == "capsule":
        return capsule.CapsuleCollider(0.5 * half, 0.5 * half, restitution=restitution)
    corners = half * np.array([(-1.0, -1.0), (1.0, -1.0), (0.6, 1.0), (-0.6, 1.0)])
    return convex_polygon.ConvexPolygonCollider(corners, restitution=restitution)


def floor_of(floor: str, dimensions: int, restitution: float) -> tuple[float, Any]:
    """(height of its centre, collider) of a floor whose top is at 0."""
    if floor == "half_space":
        return 0.0, half_space.HalfSpaceCollider((0.0, 1.0, 0.0)[:dimensions], restitution=restitution)
    if floor == "tiles":
        return -0.5 * FLOOR, tile_grid.TileGridCollider(["#" * 20, "#" * 20], 0.5 * FLOOR, restitution=restitution)
    if floor == "one_way":
        return 0.0, one_way_segment.OneWaySegmentCollider((-WIDE, 0.0), (WIDE, 0.0), restitution=restitution)
    half = (WIDE, 0.5 * FLOOR, WIDE)[:dimensions]
    return -0.5 * FLOOR, AABBCollider(half, restitution=restitution)


def _spread(ratio: float, count: int, random: np.random.Generator) -> np.ndarray:
    """(count,) values from 1 / ratio to 1, evenly in their logarithm; both ends are among them if count > 1."""
    values = ratio ** -random.uniform(0.0, 1.0, count)
    values[:2] = (1.0, 1.0 / ratio)[:count]
    return random.permutation(values)


def _column(draw: Draw, world: World, origin: np.ndarray, sizes: np.ndarray) -> tuple[Any, Any, Any, float]:
    """A floor; bodies above each other: at rest on it, apart, overlapping, or on their way down."""
    d, e = draw.dimensions, draw.values["restitution"]
    low, collider = floor_of(draw.floor, d, e)
    world.create_entity(Transform(tuple((origin + np.array((0.0, low, 0.0)[:d])).tolist())), collider)
    pitch = 0.5 * (sizes[1:] + sizes[:-1]) / (draw.values["density"] if draw.kind == STACK else 1.0)
    above = draw.fall * sizes[0] if draw.kind == DROP else sizes[0] * (draw.values["speed"] > 0.0)
    place, velocity = np.zeros((2, len(sizes), d))
    place[:, 1] = 0.5 * sizes[0] + above + np.concatenate(([0.0], np.cumsum(pitch)))
    velocity[:, 1] = -draw.speed
    # Bodies at rest fall by nothing but the gaps between them.
    falls = above + max(0.0, float((pitch - 0.5 * (sizes[1:] + sizes[:-1])).sum()))
    deep = PASSED[draw.floor]
    return place, velocity, (lambda place: place[:, 1] < -deep), float(falls)


def _room(
    draw: Draw, world: World, origin: np.ndarray, sizes: np.ndarray, random: np.random.Generator
) -> tuple[Any, Any, Any, float]:
    """Four or six walls; bodies on a lattice, thrown in all directions."""
    d, n, spacing = draw.dimensions, len(sizes), 1.0 / draw.values["density"]
    side = math.ceil(n ** (1 / d) - 1e-9)
    half, wall = 0.5 * side * max(spacing, APART) + 0.5, 0.5 * draw.wall
    for axis in range(d):
        for sign in (-1.0, 1.0):
            centre, extents = origin.copy(), np.full(d, half + wall)
            centre[axis] += sign * (half + 0.5 * wall)
            extents[axis] = 0.5 * wall
            collider = AABBCollider(tuple(extents.tolist()), restitution=draw.values["restitution"])
            world.create_entity(Transform(tuple(centre.tolist())), collider)
    cells = random.permutation(side**d)[:n]
    place = (np.stack(np.unravel_index(cells, (side,) * d), axis=1) - 0.5 * (side - 1)) * spacing
    ways = random.normal(size=(n, d))
    velocity = draw.speed * ways / np.linalg.norm(ways, axis=1)[:, None]
    return place, velocity, (lambda place: (np.abs(place) > half + wall).any(axis=1)), 2.0 * half
