"""What characters cost: crowds on many tiles, and one hero beside pymunk's usual way to make one."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from carom.components import AABBCollider, RigidBody, Transform
from carom.framework import World
from carom.lab.cli.usage_errors import Problem
from carom.lab.measure.timing import timed
from carom.lab.reporting.text import NOTHING, TextTable, compact, span
from carom.plugins import Physics, capsule, terrain, tile_grid
from carom.plugins.capsule import CapsuleCollider
from carom.plugins.character import Character, Characters
from carom.plugins.terrain import create_height_field
from carom.plugins.tile_grid import TileGridCollider

from .bench.engines import PYMUNK, module_of
from .runner import ATTEMPTS, Axis, Result

GROUND, HERO = 1, 2  # layers
GRAVITY, SPEED, JUMP = 30.0, 4.0, 9.0
SIZES, QUICK = (1000, 10, 0), (100,)
WARM_UP, STEPS, TURNS = 60, 100, 20  # steps; after how many a crowd gets other wishes
WIDE, TALL = 0.35, 0.7  # m, half the size of a hero
COURSE, RUN = (200, 50), 1200  # tiles; steps


class Crowd(NamedTuple):
    """So many characters on 10,000 tiles of one kind."""

    d: int
    tiles: str
    shape: str
    count: int

    def __str__(self) -> str:
        who = f"{self.count:,} {'boxes' if self.shape == 'box' else 'capsules'}" if self.count else "none"
        return f"{self.d}D {self.tiles}, {who}"


def crowds(sizes: tuple[int, ...]) -> tuple[Crowd, ...]:
    """All that is timed."""
    places = (2, "grid"), (2, "boxes"), (3, "boxes"), (3, "field")
    shapes = {n: ("box", "capsule") if n else ("box",) for n in sizes}
    return tuple(Crowd(*place, shape, n) for place in places for n in sizes for shape in shapes[n])


def _collider(shape: str, d: int) -> Any:
    if shape == "box":
        return AABBCollider.many(half_extents=(WIDE, TALL, WIDE)[:d], layer=HERO, mask=GROUND)
    return CapsuleCollider.many(radius=WIDE, half_height=TALL - WIDE, layer=HERO, mask=GROUND)


def _ground_2d(world: World, tiles: str, rng: np.random.Generator) -> np.ndarray:
    """Rooms of five tiles; places (n, 2) where a hero has room."""
    cells = rng.random((100, 360)) < 0.1
    cells[::5] = rng.random((20, 360)) < 0.9
    cells[0] = cells[-1] = cells[:, 0] = cells[:, -1] = True
    if tiles == "grid":
        world.create_entity(Transform((0, 0)), TileGridCollider(cells[::-1], 1.0, lower=(0, 0), layer=GROUND))
    else:
        at = np.argwhere(cells)[:, ::-1] + 0.5
        world.create_entities(len(at), Transform.many(at), AABBCollider.many(half_extents=0.5, layer=GROUND))
    return np.argwhere(~cells[1:] & ~cells[:-1])[:, ::-1] + (0.5, 1.0)


def _ground_3d(world: World, tiles: str, rng: np.random.Generator) -> np.ndarray:
    """Steps of 0.25 m, or hills; places (n, 3) above."""
    if tiles == "boxes":
        x, z = np.indices((100, 100))
        tops = 0.25 * rng.integers(0, 3, (100, 100))
        at = np.stack((x, tops - 0.5, z), axis=-1).reshape(-1, 3)
        world.create_entities(len(at), Transform.many(at), AABBCollider.many(half_extents=0.5, layer=GROUND))
    else:
        x, z = np.indices((72, 72))
        create_height_field(world, np.sin(0.5 * x) + np.cos(0.4 * z), 1.4, layer=GROUND)
    return rng.uniform(2, 97, (5000, 3)) * (1, 0, 1) + (0, 3.0, 0)


def crowd(case: Crowd, seed: int, characters: bool = True) -> World:
    """The world of a case; characters: else bodies that stand there."""
    rng = np.random.default_rng(seed)
    physics = Physics(dimensions=case.d, gravity=(0, -GRAVITY, 0)[: case.d])
    world = World(physics, capsule.plugin, tile_grid.plugin, terrain.plugin, Characters())
    free = (_ground_2d if case.d == 2 else _ground_3d)(world, case.tiles, rng)
    if case.count:
        places = free[rng.choice(len(free), case.count, replace=case.count > len(free))]
        wishes = [Character.many()] if characters else []
        bodies = RigidBody.many(kind="kinematic")
        world.create_entities(case.count, Transform.many(places), bodies, _collider(case.shape, case.d), *wishes)
    return world


def _wish(world: World, rng: np.random.Generator) -> None:
    """Other ways to go; half of them jump."""
    mine = world.bodies.has(Character)
    if not mine.any():
        return
    me, n = world.bodies.character, int(mine.sum())
    if world.dimensions == 2:
        me.move[mine] = rng.choice((-SPEED, SPEED), n)
    else:
        angle = rng.uniform(0, 2 * math.pi, n)
        me.move[mine] = SPEED * np.stack((np.cos(angle), 0 * angle, np.sin(angle)), axis=1)
    me.jump[mine] = rng.random(n) < 0.5


def _milliseconds(make: Callable[[], World], seed: int) -> float:
    """The median step; new wishes are not timed."""
    for _ in range(ATTEMPTS):
        taken, valid, rng = [], True, np.random.default_rng(seed)
        with contextlib.closing(make()) as world:
            for step in range(WARM_UP + STEPS):
                if step % TURNS == 0:
                    _wish(world, rng)
                seconds, counts, _ = timed(world.step)
                if step >= WARM_UP:
                    taken.append(seconds)
                    valid &= counts
        if valid:
            return 1e3 * float(np.median(taken))
    raise Problem("kernels were compiled in all steps; run it once more")


def measure_crowd(case: Crowd, repeat: int) -> dict[str, float]:
    """ms of a step, and of one in which the same bodies stand."""
    return {
        "ms": _milliseconds(partial(crowd, case, repeat), repeat),
        "without": _milliseconds(partial(crowd, case, repeat, characters=False), repeat),
    }


# -- beside pymunk ----------------------------------------------------------------------------------------------------


def course(seed: int = 0) -> np.ndarray:
    """(50, 200) which cells are tiles, the lowest row first: hills of single steps, with walls at both ends."""
    rows = np.arange(COURSE[1])[:, None]
    heights = np.clip(10 + np.cumsum(np.random.default_rng(seed).choice((-1, 0, 0, 0, 1), COURSE[0])), 3, 30)
    heights[[0, -1]] = COURSE[1]
    heights[1:12] = heights[12]
    return rows < heights


class OwnHero:
    """A character on one tile grid."""

    def __init__(self, shape: str, cells: np.ndarray) -> None:
        plugins = capsule.plugin, tile_grid.plugin, Characters()
        self.world = World(Physics(dimensions=2, gravity=(0, -GRAVITY)), *plugins)
        tiles = TileGridCollider(cells[::-1], 1.0, lower=(0, 0), layer=GROUND)
        self.world.create_entity(Transform((0, 0)), tiles)
        start = 2.0, int(cells[:, 2].sum()) + TALL + 0.01
        body = Transform.many([start]), RigidBody.many(kind="kinematic"), _collider(shape, 2), Character.many()
        (entity,) = self.world.create_entities(1, *body)
        self.me = self.world.component_for_entity(entity, Character)
        self.place = self.world.component_for_entity(entity, Transform)

    def step(self, right: bool, jump: bool) -> None:
        """One step; jump: when something is in the way, or at once if it does not run."""
        self.me.move = SPEED if right else 0.0
        self.me.jump = jump and (not right or bool(self.me.on_wall))
        self.world.step()

    def at(self) -> tuple[float, float]:
        """m"""
        return self.place.x, self.place.y

    def close(self) -> None:
        self.world.close()


class PymunkHero:
    """A dynamic body that does not turn, on a box for each tile; what it touches says where the ground is."""

    def __init__(self, shape: str, cells: np.ndarray) -> None:
        pymunk = module_of(PYMUNK)
        self.space = pymunk.Space()
        self.space.gravity = 0, -GRAVITY
        for y, x in np.argwhere(cells).tolist():
            tile = pymunk.Poly(self.space.static_body, [(x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1)])
            self.space.add(tile)
        self.body = pymunk.Body(1.0, math.inf)
        self.body.position = 2.0, int(cells[:, 2].sum()) + TALL
        ends = (0, WIDE - TALL), (0, TALL - WIDE)
        made = pymunk.Poly.create_box(self.body, (2 * WIDE, 2 * TALL)) if shape == "box" else None
        self.space.add(self.body, made or pymunk.Segment(self.body, *ends, WIDE))

    def step(self, right: bool, jump: bool) -> None:
        """One step; jump: when something is in the way, or at once if it does not run."""
        normals: list[Any] = []
        self.body.each_arbiter(lambda arbiter: normals.append(-arbiter.contact_point_set.normal))
        grounded, walled = any(n.y > 0.7 for n in normals), any(n.x < -0.7 for n in normals)
        up = JUMP if jump and grounded and (walled or not right) else self.body.velocity.y
        self.body.velocity = SPEED if right else 0.0, up
        self.space.step(1 / 60)

    def at(self) -> tuple[float, float]:
        """m"""
        return self.body.position.x, self.body.position.y

    def close(self) -> None:
        pass


FIGURES = {
    "us": "us per step", "far": "has come to, m", "height": "height over seams, m",
    "speed": "speed over seams, m/s", "jump": "jump, m off",
}  # fmt: skip
HEROES: dict[str, Callable[[str, np.ndarray], Any]] = {"carom": OwnHero, PYMUNK: PymunkHero}


def measure_hero(shape: str, repeat: int) -> dict[str, float]:
    """By engine: us of a step of a run; how far it came; of 8 m of flat ground by how much height and speed change; of
    a jump how far it is from v^2 / 2g."""
    found = {}
    for name, make in HEROES.items():
        hero = make(shape, course(repeat))
        for _ in range(30):
            hero.step(right=False, jump=False)
        start = hero.at()[1]
        top = max(_after(hero, right=False, jump=step == 0)[1] for step in range(40))
        found[f"{name}/jump"] = abs(top - start - JUMP**2 / (2 * GRAVITY))
        flat = np.array([_after(hero, right=True, jump=False) for _ in range(120)])[10:]
        found[f"{name}/height"], found[f"{name}/speed"] = np.ptp(flat[:, 1]), 60 * np.ptp(np.diff(flat[:, 0]))
        took = [timed(partial(hero.step, right=True, jump=True))[0] for _ in range(RUN)]
        found[f"{name}/us"], found[f"{name}/far"] = 1e6 * float(np.median(took)), hero.at()[0]
        hero.close()
    return {key: float(value) for key, value in found.items()}


def _after(hero: Any, right: bool, jump: bool) -> tuple[float, float]:
    hero.step(right, jump)
    return hero.at()


# -- the tables -------------------------------------------------------------------------------------------------------


def axes(quick: bool = False) -> list[Axis]:
    """Crowds, and one hero."""
    return [
        Axis("crowd", "characters on 10,000 tiles", crowds(QUICK if quick else SIZES), measure_crowd),
        Axis("hero", f"a level of {COURSE[0]} x {COURSE[1]} tiles", ("box", "capsule"), measure_hero),
    ]


def report(result: Result) -> tuple[list[TextTable], list[str]]:
    """A table for each axis."""
    tables = []
    for line in result.lines:
        of = f"{line.of}; medians of {result.repeats}"
        if line.axis == "crowd":
            cells = []
            for sample in line.samples:
                ms, still, n = sample.figures["ms"], sample.figures["without"], sample.value.count
                each = NOTHING if n == 0 else compact(1e3 * (ms.median - still.median) / n)
                cells.append((str(sample.value), compact(ms.median), span(ms), compact(still.median), each))
            head = ("on", "ms per step", "from .. to", "the same bodies standing", "us per character")
            tables.append(TextTable(of, head, cells))
        else:
            cells = [
                (f"{sample.value}, {name}", *(compact(sample.figures[f"{name}/{key}"].median) for key in FIGURES))
                for sample in line.samples for name in HEROES
            ]  # fmt: skip
            head = ("hero", *FIGURES.values())
            tables.append(TextTable(of, head, cells))
    return tables, []
