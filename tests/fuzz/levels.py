"""Levels that a seed makes, and characters that play them at random: what they must never do is looked for each step.

Levels have tiles as grids, floors and walls, and boxes, chains, ramps, turned boxes, steps, conveyors, one-way
platforms, ladders, crates, and movers by velocity, by assigned places and turning; in 3D fields of heights, meshes and
hulls. Each level is played by several characters, that see each other in some.

``python -m tests.fuzz.levels 2 0 5000`` plays the 2D levels of these seeds and names those that go wrong.
"""

from __future__ import annotations

import math
import sys
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

if __name__ == "__main__":  # the helpers of tests are no package
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from helpers_character import Each, vector, world_of

from carom import (
    AABBCollider,
    CapsuleCollider,
    ConvexHullCollider,
    ConvexPolygonCollider,
    RigidBody,
    SphereCollider,
    Spin,
    TileGridCollider,
    Transform,
    World,
    create_chain,
    create_height_field,
    create_triangle_mesh,
)
from carom.plugins.character import Character, Ladder
from carom.plugins.rotation import BoxCollider

SOLID, ONE_WAY, MOVER, CRATE, HERO, ZONE = 1, 2, 4, 8, 16, 32
FIRM = SOLID | MOVER
SIZE = {2: (30.0, 14.0), 3: (14.0, 7.0, 14.0)}  # m; levels begin at 0
STEPS, HEROES = 120, 4
AIR, FLOOR, STEEP, CLIMB = range(4)
DEEPEST = 1e-6  # m in what is static or kinematic
STILL = 1e-5  # m a step
RESTS, CALM = 20, 20  # steps
CLOSE, WALKABLE = 0.02, math.cos(math.radians(50))  # m: twice the skin; of a normal upwards
FREES = 30  # steps after it was crushed
FASTEST, PUSHED_OUT = 35.0, 0.3  # m/s, m in a step: what moves farther leaps


@dataclass
class Level:
    """A world, its characters by their shapes, and the generator of their wishes."""

    d: int
    world: World
    rng: np.random.Generator
    kind: str
    heroes: list[int] = field(default_factory=list)
    shapes: list[Any] = field(default_factory=list)
    movers: set[int] = field(default_factory=set)
    lowest: Any = field(default=lambda place: 0.0)  # m, where characters may begin: terrain is solid from its front

    def place(self, edge: float = 1.0) -> np.ndarray:
        size = np.array(SIZE[self.d])
        return self.rng.uniform(edge, size - edge)

    def add(self, *components: Any) -> int:
        return self.world.create_entity(*components)

    def some(self, below: int) -> range:
        return range(int(self.rng.integers(below)))

    def box(self, half: Any, **material: Any) -> AABBCollider:
        return AABBCollider(tuple(np.broadcast_to(half, self.d).tolist()), **material)

    # -- what both dimensions have ----------------------------------------------------------------

    def fill(self) -> None:
        """Turned boxes, steps, conveyors, one-way platforms, movers, ladders, crates and characters."""
        rng, d = self.rng, self.d
        for _ in self.some(4):
            half = tuple(rng.uniform(0.2, 1.2, d).tolist())
            turn = rng.uniform(0, 3) if d == 2 else tuple(rng.normal(size=4).tolist())
            self.add(Transform(self.place(), turn), BoxCollider(half, layer=SOLID))
        for _ in self.some(4):
            half = rng.uniform(0.2, 1.0, d)
            half[1] = rng.uniform(0.02, 0.3)
            place = self.place()
            place[1] = round(place[1])
            runs = rng.uniform(-3, 3) * np.eye(d)[rng.choice((0, -1))] if rng.random() < 0.3 else np.zeros(d)
            belt = self.add(Transform(place), self.box(half, layer=SOLID, surface_velocity=runs))
            self.movers |= {belt} if runs.any() else set()
        for _ in self.some(4):
            half = rng.uniform(0.3, 1.5, d)
            half[1] = rng.uniform(0.01, 0.2)
            up = np.zeros(d)
            up[1] = 1.0
            body = [RigidBody(kind="kinematic", linear_velocity=0.3 * rng.normal(size=d))] if rng.random() < 0.2 else []
            self.add(Transform(self.place()), *body, self.box(half, one_way=up, layer=ONE_WAY))
        for _ in self.some(4):
            entity, body = self.mover(RigidBody(kind="kinematic"))
            way = np.zeros(d)
            way[rng.integers(d)] = rng.uniform(0.5, 4)
            period = rng.uniform(0.3, 1.5)
            self.drive(lambda t, b=body, w=way, p=period: setattr(b, "linear_velocity", w if t % (2 * p) < p else -w))
        for _ in self.some(3):
            entity, _ = self.mover(*([RigidBody(kind="kinematic")] if rng.random() < 0.5 else []))
            to = self.world.component_for_entity(entity, Transform)
            middle, way = to.position.copy(), np.zeros(d)
            way[rng.integers(d)], rate = rng.uniform(0.5, 2), rng.uniform(0.5, 3)
            self.drive(lambda t, to=to, m=middle, w=way, r=rate: setattr(to, "position", m + w * math.sin(r * t)))
        if rng.random() < 0.4:
            half = rng.uniform(0.8, 2.0, d)
            half[1] = 0.2
            rate = rng.uniform(-1.5, 1.5)
            axis = np.array((0.0, 1.0, 0.0)) if rng.random() < 0.5 else rng.normal(size=3)
            spin = Spin(rate if d == 2 else tuple(rate * axis / np.linalg.norm(axis)))
            shape = BoxCollider(tuple(half.tolist()), layer=MOVER)
            self.movers.add(self.add(Transform(self.place()), RigidBody(kind="kinematic"), spin, shape))
        if rng.random() < 0.3:
            half = np.full(d, 0.5)
            half[1] = 2.0
            self.add(Transform(self.place()), self.box(half, sensor=True, layer=ZONE), Ladder())
        self.world.step()
        for _ in self.some(5):
            place, half = self.place(), rng.uniform(0.25, 0.4)
            if not self.world.shape_cast(self.box(half), place, (0.0,) * d):
                crate = self.box(half, friction=0.5, layer=CRATE)
                self.add(Transform(place), RigidBody(mass=rng.uniform(0.5, 5)), crate)
        sees = 63 if rng.random() < 0.4 else 63 & ~HERO
        for _ in range(HEROES):
            self.hero(sees)

    def drive(self, act: Any) -> None:
        self.world.add_system(Each(act))

    def mover(self, *body: RigidBody) -> tuple[int, Any]:
        half = self.rng.uniform(0.3, 1.5, self.d)
        half[1] = self.rng.uniform(0.1, 0.6)
        runs = self.rng.uniform(-2, 2, self.d) if self.rng.random() < 0.2 else 0.0
        entity = self.add(Transform(self.place()), *body, self.box(half, layer=MOVER, surface_velocity=runs))
        self.movers.add(entity)
        return entity, body[0] if body else None

    def hero(self, sees: int) -> None:
        """One more, where there is room."""
        rng, wide, tall = self.rng, self.rng.uniform(0.25, 0.4), self.rng.uniform(0.5, 0.8)
        look = {"layer": HERO, "mask": sees}
        half = np.full(self.d, wide)
        half[1] = tall
        kind = rng.integers(self.d)
        shape = (
            self.box(half, **look), CapsuleCollider(wide, tall - wide, **look), SphereCollider(wide, **look)
        )[kind]  # fmt: skip
        values = {
            "jump_cut": float(rng.choice((1.0, 0.5))), "step_height": float(rng.choice((0.3, 0.3, 0.1, 0.5))),
            "snap": float(rng.choice((0.3, 0.3, 0.0))), "wall_slide": 3.0 if rng.random() < 0.5 else None,
            "wall_jump": float(rng.choice((0.0, 6.0))), "air_jumps": int(rng.integers(2)),
            "weight": float(rng.choice((0.0, 20.0))), "leave": str(rng.choice(("all", "up", "none"))),
            "pushable": bool(rng.random() < 0.5),
        }  # fmt: skip
        for _ in range(30):
            place = self.place()
            if place[1] > self.lowest(place) and not self.world.shape_cast(shape, place, (0.0,) * self.d, mask=31):
                body = RigidBody(kind="kinematic", mass=rng.uniform(0.5, 5))
                self.heroes.append(self.add(Transform(place), body, shape.copy(), Character(**values)))
                self.shapes.append(shape)
                return


def level_2d(level: Level) -> None:
    """Tiles of one of three kinds, ramps and hills."""
    rng, (wide, high) = level.rng, SIZE[2]
    cells = rng.random((int(high), int(wide))) < rng.choice((0.05, 0.12, 0.2))
    for _ in level.some(4):
        y, x, n = rng.integers(1, high - 1), rng.integers(0, wide - 6), rng.integers(3, 8)
        cells[y, x : x + n] = True
    cells[0] = cells[-1] = cells[:, 0] = cells[:, -1] = True
    if level.kind == "grid":
        level.add(Transform((0, 0)), TileGridCollider(cells[::-1], 1.0, lower=(0, 0), layer=SOLID))
    elif level.kind == "faces":
        for faces in TileGridCollider.floors_and_walls(cells[::-1], 1.0, lower=(0, 0)):
            faces.layer = SOLID
            level.add(Transform((0, 0)), faces)
    else:
        at = np.argwhere(cells)[:, ::-1] + 0.5
        level.world.create_entities(len(at), Transform.many(at), AABBCollider.many(half_extents=0.5, layer=SOLID))
    for _ in level.some(5):
        run = rng.uniform(1, 4)
        rise = min(run * math.tan(math.radians(rng.uniform(5, 80))), 4.0)
        corners = (0, 0), (run, 0), (run if rng.random() < 0.5 else 0, rise)
        place = float(rng.integers(1, wide - 4)), float(rng.integers(1, high - 2))
        level.add(Transform(place), ConvexPolygonCollider(corners, layer=SOLID))
    if rng.random() < 0.4:
        x = np.linspace(1.2, wide - 1.2, 24)
        hills = 1.0 + rng.uniform(0, 0.8) * (1 + np.sin(x * rng.uniform(0.3, 2.0)))
        level.lowest = lambda place: float(np.interp(place[0], x, hills)) + 0.9
        create_chain(level.world, np.stack((x, hills), 1), layer=SOLID, thickness=1.5)


def level_3d(level: Level) -> None:
    """A room whose floor is of boxes, a field of heights or a mesh, with ramps and rocks."""
    rng, size = level.rng, np.array(SIZE[3])
    for axis in range(3):
        for end in (0, 1):
            middle, half = size / 2, size / 2 + 1.0
            middle[axis], half[axis] = end * (size[axis] + 1.0) - 0.5, 0.5
            level.add(Transform(middle), level.box(half, layer=SOLID))
    n = int(size[0])
    if level.kind == "boxes":
        heights = rng.choice((0.25, 0.5, 1.0)) * rng.integers(0, 3, (n, n)) + 1e-3
        heights[rng.random((n, n)) < 0.08] = 3.0
        i, j = np.indices((n, n))
        middles = np.stack((i + 0.5, heights / 2, j + 0.5), axis=-1).reshape(-1, 3)
        half = np.stack((0 * heights + 0.5, heights / 2, 0 * heights + 0.5), axis=-1).reshape(-1, 3)
        boxes = AABBCollider.many(half_extents=half, layer=SOLID)
        level.world.create_entities(n * n, Transform.many(middles), boxes)
    else:
        i, j = np.meshgrid(np.linspace(-0.1, size[0] + 0.1, n), np.linspace(-0.1, size[2] + 0.1, n), indexing="ij")
        rough = rng.uniform(0.1, 0.9)
        heights = 0.7 + rough * 0.3 * (np.sin(i * rng.uniform(0.3, 1.5)) + np.sin(j * rng.uniform(0.3, 1.5)))
        heights += rough * rng.uniform(0, 0.3, (n, n))
        level.lowest = lambda place: float(heights.max()) + 0.8
        if level.kind == "field":
            cell = (size[0] + 0.2) / (n - 1)
            create_height_field(level.world, heights, cell, position=(-0.1, 0, -0.1), thickness=2.0, layer=SOLID)
        else:
            points = np.stack((i, heights, j), axis=-1)
            points[1:-1, 1:-1, ::2] += rng.uniform(-0.3, 0.3, (n - 2, n - 2, 2))
            corner = np.arange(n * n).reshape(n, n)
            a, b, c, e = corner[:-1, :-1], corner[1:, :-1], corner[:-1, 1:], corner[1:, 1:]
            faces = np.concatenate([np.stack(f, axis=-1).reshape(-1, 3) for f in ((a, c, b), (b, c, e))])
            create_triangle_mesh(level.world, points.reshape(-1, 3), faces, thickness=2.0, layer=SOLID)
    for _ in level.some(4):
        run, wide = rng.uniform(1, 4), rng.uniform(0.5, 2)
        rise = min(run * math.tan(math.radians(rng.uniform(5, 80))), 4.0)
        outline = np.array(((0, -1), (run, -1), (run, rise), (0, 0)))
        points = np.concatenate([np.insert(outline, 2, z, axis=1) for z in (-wide, wide)])
        turn = rng.uniform(0, 2 * math.pi)
        place = level.place()
        place[1] = rng.uniform(0.2, 1.0)
        level.add(
            Transform(place, (math.cos(turn / 2), 0, math.sin(turn / 2), 0)), ConvexHullCollider(points, layer=SOLID)
        )
    for _ in level.some(4):
        points = rng.normal(size=(8, 3)) * rng.uniform(0.3, 1.0, 3)
        place = level.place()
        place[1] = rng.uniform(0.2, 2.0)
        level.add(Transform(place), ConvexHullCollider(points, layer=SOLID))


KINDS = {2: ("grid", "faces", "boxes"), 3: ("boxes", "field", "mesh")}


def make(d: int, seed: int) -> Level:
    """The level of a seed; heroes may be missing where there is no room."""
    rng = np.random.default_rng([d, seed])
    rate = float(rng.choice((60, 60, 60, 30, 120)))
    level = Level(d, world_of(d, 1 / rate), rng, KINDS[d][seed % 3])
    (level_2d if d == 2 else level_3d)(level)
    level.fill()
    level.world.step()
    return level


class Play:
    """A run of a level's characters; ``said`` is what went wrong, by kind and where."""

    def __init__(self, level: Level) -> None:
        self.level, self.world, self.said = level, level.world, Counter[str]()
        self.first: dict[str, str] = {}
        n, bodies = len(level.heroes), level.world.bodies
        self.rows = np.array([bodies.row_of(entity) for entity in level.heroes], int)
        self.until, self.wish = np.zeros(n, int), np.zeros((n, 3))
        self.jumps, self.drops, self.climbs = np.zeros(n, bool), np.zeros(n, bool), np.zeros(n)
        self.free_from, self.still, self.calm = np.zeros(n, int), np.zeros(n, int), np.zeros(n, int)
        self.crushes = 0
        kinds = [type(shape) for shape in level.shapes]
        self.groups = [np.flatnonzero([kind is of for kind in kinds]) for of in dict.fromkeys(kinds)]

    def complain(self, what: str, k: int, where: str) -> None:
        self.said[what] += 1
        shape = type(self.level.shapes[k]).__name__
        self.first.setdefault(what, f"step {self.world.step_count}, {shape} {self.level.heroes[k]} {where}")

    def wishes(self, step: int) -> None:
        """New ones now and then, held for a while."""
        rng, me = self.level.rng, self.world.bodies.character
        for k in np.flatnonzero(step >= self.until):
            speed, angle = rng.choice((5.0, 0.0), p=(0.8, 0.2)), rng.uniform(0, 2 * math.pi)
            ways = (math.copysign(1.0, math.cos(angle)), 0.0, 0.0), (math.cos(angle), 0.0, math.sin(angle))
            self.wish[k] = speed * np.array(ways[self.level.d - 2])
            self.jumps[k], self.drops[k] = rng.random() < 0.5, rng.random() < 0.2
            self.climbs[k], self.until[k] = rng.choice((0.0, 0.0, 2.0, -2.0)), step + rng.integers(20, 90)
        me.move[self.rows] = self.wish[:, 0] if self.level.d == 2 else self.wish
        me.jump[self.rows] = self.jumps & (step % 25 < 12)
        me.drop[self.rows], me.climb[self.rows] = self.drops, self.climbs

    def step(self, step: int) -> None:
        self.wishes(step)
        bodies = self.world.bodies
        before = bodies.position[self.rows].copy()
        self.world.step()
        self.look(step, before, bodies.position[self.rows].copy())

    def look(self, step: int, before: np.ndarray, places: np.ndarray) -> None:
        """All that must hold after a step."""
        me, level = self.world.bodies.character, self.level
        state, floor = me.state[self.rows], me.floor_entity[self.rows]
        crushed = me.crushed[self.rows] >= 0
        self.crushes += int(crushed.sum())
        self.free_from[crushed] = step + FREES
        free = step >= self.free_from
        moved = np.linalg.norm(places - before, axis=1)
        size = np.array(SIZE[level.d])
        for k in np.flatnonzero(~np.isfinite(places).all(axis=1) | ((places < 0) | (places > size)).any(axis=1)):
            self.complain("left the level", k, f"at {places[k]}")
        for k in np.flatnonzero(free & (moved > FASTEST * self.world.settings.dt + PUSHED_OUT)):
            self.complain("leaps", k, f"from {before[k].round(4)} to {places[k].round(4)}")
        for k, depth, entity in self.depths(places, free):
            what = "mover" if entity in level.movers else "static"
            detail = f"{depth:.2e} deep in {entity} at {places[k].round(5)}, state {state[k]}, floor {floor[k]}"
            self.complain(f"in a wall ({what})", k, detail)
        self.still = np.where((moved < STILL) & free, self.still + 1, 0)
        for k in np.flatnonzero(self.still == RESTS):
            at = f"at {places[k].round(5)}, velocity {np.round(me.velocity[self.rows[k]], 4)}"
            pressed = self.wish[k].any() and self.is_blocked(k, places[k])  # into a notch, say, which holds it
            if state[k] in (AIR, STEEP) and not pressed and not self.jumps[k]:
                self.complain("floats", k, at)
            elif state[k] == FLOOR and self.wish[k].any() and not pressed:
                self.complain("stuck", k, f"{at}, wish {self.wish[k].round(3)}")
        idle = (state == FLOOR) & ~self.wish.any(axis=1) & ~self.jumps & ~self.drops & (self.climbs == 0.0) & free
        rests = np.array([entity >= 0 and self.is_still(entity) for entity in floor.tolist()], bool)
        self.calm = np.where(idle & rests, self.calm + 1, 0)
        for k in np.flatnonzero((self.calm > CALM) & (moved > 1e-6)):
            if not self.world.query_aabb(places[k] - 1.3, places[k] + 1.3, MOVER | CRATE) and not self.sees_others(k):
                self.complain("jitters", k, f"by {moved[k]:.2e} at {places[k].round(5)}")

    def is_still(self, entity: int) -> bool:
        return entity not in self.level.movers and self.world.try_component(entity, RigidBody) is None

    def sees_others(self, k: int) -> bool:
        return bool(self.level.shapes[k].mask & HERO)

    def depths(self, places: np.ndarray, free: np.ndarray) -> list[tuple[int, float, int]]:
        """(which, depth, in which entity) of those too deep in what is static or kinematic, by casts back from
        outside."""
        found = []
        still = np.zeros(self.level.d)
        for group in self.groups:
            group = group[free[group]]
            for k in group:
                shape, place = self.level.shapes[k], places[k]
                for hit in self.world.shape_cast(shape, place, still, FIRM, exclude=self.level.heroes[k]):
                    depth = self.depth(shape, place, hit)
                    if depth > DEEPEST:
                        found.append((int(k), depth, hit.entity))
        return found

    def depth(self, shape: Any, place: np.ndarray, hit: Any) -> float:
        for reach in (0.01, 0.1, 0.5, 3.0):
            back = self.world.shape_cast(shape, place + reach * hit.normal, -reach * hit.normal, FIRM)
            distance = next((one.distance for one in back if one.entity == hit.entity), reach)
            if distance > 0.0:
                return reach - distance
        return math.inf

    def is_blocked(self, k: int, place: np.ndarray) -> bool:
        """Whether something opposes its wish that is no floor, along its floor, or it is wedged in under a ceiling."""
        normal = self.world.bodies.character.floor_normal[self.rows[k]]
        way = self.wish[k][: self.level.d] - (self.wish[k][: self.level.d] @ normal) * normal
        size = np.linalg.norm(way)
        if size < 1e-6:
            return True
        shape, way, mask = self.level.shapes[k], way / size, self.level.shapes[k].mask & ~ZONE
        hero, up = self.level.heroes[k], vector(self.level.d, 0.0, CLOSE)
        above = self.world.shape_cast(shape, place, up, mask, exclude=hero)
        if any(hit.normal[1] < -1e-9 for hit in above):
            return True
        ahead = self.world.shape_cast(shape, place, 0.3 * way, mask, exclude=hero)
        ahead = [(hit.distance, -(hit.normal @ way)) for hit in ahead if hit.normal[1] < WALKABLE]
        return any(closes > 1e-9 and distance * closes < CLOSE for distance, closes in ahead)


def play(d: int, seed: int, steps: int = STEPS, goes_back: bool = False) -> tuple[Play, int]:
    """Play a level; goes_back: its second half twice, to the bit."""
    level = make(d, seed)
    with level.world as world:
        run, taken = Play(level), 0
        if not level.heroes:
            return run, 0
        try:
            for step in range(steps):
                run.step(step)
                taken += 1
            if goes_back:
                kept, ends = world.snapshot(), []
                for _ in range(2):
                    for _ in range(8):
                        world.step()
                    ends.append(world.state_hash())
                    world.restore(kept)
                if ends[0] != ends[1]:
                    run.complain("goes back otherwise", 0, "")
        except Exception as error:
            run.complain("error", 0, repr(error.__cause__ or error)[:300])
        return run, taken


def main(d: int, first: int, stop: int, steps: int = STEPS) -> int:
    """Play the levels of these seeds; how many went wrong."""
    wrong, kinds, taken, played, crushes, began = 0, Counter[str](), 0, 0, 0, time.process_time()
    for seed in range(first, stop):
        run, count = play(d, seed, steps, goes_back=seed % 10 == 0)
        wrong, taken, played = wrong + bool(run.said), taken + count, played + bool(count)
        crushes += run.crushes > 0
        kinds.update(run.said.keys())
        for what, where in run.first.items():
            print(f"{seed} ({run.level.kind}): {what}, {run.said[what]} times: {where}", flush=True)
    seconds = time.process_time() - began
    print(f"{played} levels, {taken} steps, {crushes} with crushes, {seconds:.0f} s; {wrong} wrong: {dict(kinds)}")
    return wrong


if __name__ == "__main__":
    sys.exit(bool(main(*map(int, sys.argv[1:]))))
