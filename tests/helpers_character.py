"""Worlds with characters: one recipe for each dimension, with all shapes in it, so that kernels compile once."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest

from carom import (
    AABBCollider,
    CapsuleCollider,
    ConvexHullCollider,
    ConvexPolygonCollider,
    Physics,
    RigidBody,
    Settings,
    SphereCollider,
    System,
    TileGridCollider,
    Transform,
    World,
    create_chain,
    create_height_field,
)
from carom.framework import Phase
from carom.plugins import capsule, convex_hull, convex_polygon, terrain, tile_grid
from carom.plugins.character import Character, Characters
from carom.plugins.parts import Parts
from carom.plugins.rotation import BoxCollider, Rotation

G = 30.0  # m/s^2
SKIN = 0.01  # m, that a character keeps
JUMP = 9.0  # m/s, and so 1.35 m high
TOP = JUMP**2 / (2 * G)  # m
STEP = 1 / 60  # s
FAR = 900.0  # m, where one of each shape waits


class Figure(NamedTuple):
    """What a character is: dimensions, half its height, and its collider."""

    d: int
    half: float
    shape: Any

    def collider(self, **material: Any) -> Any:
        made = self.shape.copy()
        for name, value in material.items():
            setattr(made, name, value)
        return made


FIGURES = {
    "box 2D": Figure(2, 0.8, AABBCollider((0.4, 0.8))),
    "capsule 2D": Figure(2, 0.8, CapsuleCollider(0.4, 0.4)),
    "capsule 3D": Figure(3, 0.8, CapsuleCollider(0.4, 0.4)),
    "box 3D": Figure(3, 0.8, AABBCollider((0.4, 0.8, 0.4))),
    "sphere 3D": Figure(3, 0.4, SphereCollider(0.4)),
}
each_figure = pytest.mark.parametrize("figure", FIGURES.values(), ids=FIGURES)
each_dimension = pytest.mark.parametrize(
    "figure", [FIGURES["capsule 2D"], FIGURES["capsule 3D"]], ids=["2D", "3D"]
)


def vector(d: int, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> tuple[float, ...]:
    return (x, y, z)[:d]


def plugins_of(d: int, gravity: float) -> list[Any]:
    """Of the recipe."""
    shapes = (capsule, terrain, *((convex_polygon, tile_grid) if d == 2 else (convex_hull,)))
    physics = Physics(d, gravity=vector(d, 0.0, -gravity))
    return [physics, Rotation(), Parts(), *(each.plugin for each in shapes), Characters()]


def world_of(d: int, dt: float = STEP, gravity: float = G, **settings: Any) -> World:
    """The recipe: with one of each shape far away, and a crate on a floor."""
    world = World(*plugins_of(d, gravity), settings=Settings(dt=dt, on_fault="ignore", **settings))
    x = np.arange(2.0)
    if d == 2:
        create_chain(world, np.stack((x, 0 * x), 1), position=(FAR, 0))
        others = [
            TileGridCollider(["##"], 1.0),
            ConvexPolygonCollider(((0, 0), (1, 0), (0, 1))),
        ]  # fmt: skip
    else:
        create_height_field(world, np.zeros((2, 2)), 1.0, position=(FAR, 0, 0))
        others = [ConvexHullCollider(np.eye(4)[:, :3])]
    half = (0.5,) * d
    others += [CapsuleCollider(0.5, 0.5), SphereCollider(0.5), BoxCollider(half)]
    others += [AABBCollider(half, one_way=vector(d, 0.0, 1.0), surface_velocity=vector(d, 1.0))]
    for k, shape in enumerate(others):
        world.create_entity(Transform(vector(d, FAR, 9.0 * k + 9.0)), shape)
    world.create_entity(Transform(vector(d, -FAR, -0.5)), AABBCollider((1.0,) * d, friction=0.5))
    world.create_entity(Transform(vector(d, -FAR, 1.0)), RigidBody(), AABBCollider((0.5,) * d, friction=0.5))
    return world


class Each(System):
    """Calls a function of the world's time at the start of each step."""

    phase = Phase.START

    def __init__(self, act: Callable[[float], object]) -> None:
        self.act = act

    def process(self, dt: float) -> None:
        self.act(self.world.time)


class Track(NamedTuple):
    """After each step of a run."""

    position: np.ndarray  # (n, d) m
    velocity: np.ndarray  # (n, d) m/s, the character's own
    state: list[str]
    crushed: list[int]

    @property
    def x(self) -> np.ndarray:
        return self.position[:, 0]

    @property
    def y(self) -> np.ndarray:
        return self.position[:, 1]

    def steps(self) -> np.ndarray:
        """(n - 1,) m, how far each step went."""
        return np.linalg.norm(np.diff(self.position, axis=0), axis=1)

    def __getitem__(self, part: Any) -> Any:
        return Track(*(column[part] for column in tuple(self))) if isinstance(part, slice) else tuple(self)[part]


class Stage:
    """A world with a character, and what is around it. In 3D everything is as wide as ``WIDE``, both ways.

    x, y
        m, of its feet; without y on a floor at 0, which is made
    """

    WIDE = 30.0

    def __init__(
        self, figure: Figure, x: float = 0.0, y: float | None = None, dt: float = STEP, gravity: float = G,
        settings: dict[str, Any] | None = None, **character: Any,
    ) -> None:  # fmt: skip
        self.figure, self.d, self.half = figure, figure.d, figure.half
        self.world, self.stands = world_of(self.d, dt, gravity, **(settings or {})), figure.half + SKIN
        self.floor = self.box((-50, -1), (50, 0)) if y is None else -1
        self.told: list[tuple[Any, ...]] = []  # events: step, name, arguments
        for name in ("crushed", "landed", "character_hit"):
            self.world.on(name, lambda *what, name=name: self.told.append((self.world.step_count, name, *what)))
        self.hero = self.character(x, (y or 0.0) + self.stands, **character)
        self.me: Character = self.world.component_for_entity(self.hero, Character)
        self.place: Transform = self.world.component_for_entity(self.hero, Transform)

    def at(self, x: float, y: float, z: float = 0.0) -> tuple[float, ...]:
        return vector(self.d, x, y, z)

    def character(self, x: float, y: float, z: float = 0.0, figure: Figure | None = None, **values: Any) -> int:
        """One more, with its centre there; layer, mask and mass are its collider's and body's."""
        material = {name: values.pop(name) for name in ("layer", "mask") if name in values}
        body = RigidBody(kind="kinematic", mass=values.pop("mass", 1.0))
        collider = (figure or self.figure).collider(**material)
        return self.world.create_entity(Transform(self.at(x, y, z)), body, collider, Character(**values))

    def box(self, lower: tuple[float, float], upper: tuple[float, float], *more: Any, **material: Any) -> int:
        """An axis-aligned box, by default static."""
        low, high = np.array(lower, float), np.array(upper, float)
        middle, half = (low + high) / 2, (high - low) / 2
        shape = AABBCollider(vector(self.d, *half, self.WIDE), **material)
        return self.world.create_entity(Transform(vector(self.d, *middle)), *more, shape)

    def mover(self, x: float, top: float, half: tuple[float, float] = (2.0, 0.5), **body: Any) -> int:
        """A kinematic box whose top is there."""
        lower, upper = (x - half[0], top - 2 * half[1]), (x + half[0], top)
        return self.box(lower, upper, RigidBody(kind="kinematic", **body))

    def one_way(self, left: float, right: float, height: float, *more: Any) -> int:
        """A platform that holds from above only, with its top there."""
        return self.box((left, height - 0.2), (right, height), *more, one_way=self.at(0, 1))

    def wedge(self, points: Any, **material: Any) -> int:
        """A static prism over a convex outline of the x-y plane."""
        outline = np.array(points, float)
        if self.d == 2:
            return self.world.create_entity(Transform((0, 0)), ConvexPolygonCollider(outline, **material))
        ends = [np.column_stack((outline, np.full(len(outline), z))) for z in (-self.WIDE, self.WIDE)]
        return self.world.create_entity(Transform((0, 0, 0)), ConvexHullCollider(np.vstack(ends), **material))

    def crate(self, x: float, y: float, mass: float = 1.0, half: float = 0.5, friction: float = 0.5) -> int:
        """A dynamic box with its middle there."""
        shape = AABBCollider((half,) * self.d, friction=friction)
        return self.world.create_entity(Transform(self.at(x, y)), RigidBody(mass=mass), shape)

    def sensor(self, x: float, y: float, half: tuple[float, ...], *more: Any) -> int:
        shape = AABBCollider(vector(self.d, *half, half[0]), sensor=True)
        return self.world.create_entity(Transform(self.at(x, y)), shape, *more)

    def move(self, speed: float, character: Character | None = None) -> None:
        """It wants to walk along x."""
        (character or self.me).move = speed if self.d == 2 else (speed, 0.0, 0.0)

    def position_of(self, entity: int) -> np.ndarray:
        return self.world.component_for_entity(entity, Transform).position.copy()

    def velocity_of(self, entity: int) -> np.ndarray:
        return self.world.component_for_entity(entity, RigidBody).linear_velocity.copy()

    def walk(self, speed: float) -> Callable[[int], object]:
        """For :meth:`run`: it wants to walk along x in each step."""
        return lambda step: self.move(speed)

    def hold(self, steps: int = 10**9, **wishes: Any) -> Callable[[int], object]:
        """For :meth:`run`: these wishes for so many steps, then none."""

        def act(step: int) -> None:
            for name, value in wishes.items():
                setattr(self.me, name, value if step < steps else type(value)(0))

        return act

    def each(self, act: Callable[[float], object]) -> None:
        self.world.add_system(Each(act))

    def events(self, name: str) -> list[tuple[Any, ...]]:
        """(step, arguments ...) of these."""
        return [(step, *what) for step, told, *what in self.told if told == name]

    def run(self, steps: int, act: Callable[[int], object] = lambda step: None) -> Track:
        """Take steps; ``act`` is called before each with its number."""
        rows = []
        for step in range(steps):
            act(step)
            self.world.step()
            me = self.me
            rows.append((self.place.position.copy(), np.array(me.velocity), me.state, me.crushed))
        position, velocity, state, crushed = zip(*rows, strict=True)
        return Track(np.array(position), np.array(velocity), list(state), list(crushed))


def slope(angle: float, length: float = 6.0, x: float = 0.0) -> tuple[tuple[float, float], ...]:
    """The outline of a ramp that rises to the right by this angle, in degrees."""
    return (x, 0.0), (x + length, 0.0), (x + length, length * math.tan(math.radians(angle)))


def is_walking(states: list[str]) -> bool:
    return set(states) == {"floor"}
