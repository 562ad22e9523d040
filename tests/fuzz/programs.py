"""Programs that a random game plays over the public API, and the twins that must follow it bit by bit.

A seed tells a world and a list of deeds: bodies, joints of nine kinds, parts and terrain come, change and go, rotation
and sleeping are turned on and off, and steps are taken in between. What is refused with a documented error changes
nothing, and the program goes on.

``python -m tests.fuzz.programs 0 5000`` plays the programs of these seeds and names those that fail; with CAROM_CHECK=1
each index is checked.
"""

from __future__ import annotations

import faulthandler
import os
import sys
import tempfile
import time
import traceback
from collections import Counter
from typing import Any

import numpy as np

from carom import (
    AABBCollider,
    CapsuleCollider,
    CaromError,
    ConvexPolygonCollider,
    Physics,
    RigidBody,
    Settings,
    SphereCollider,
    Transform,
    World,
    create_chain,
    create_height_field,
)
from carom.plugins import capsule, convex_polygon, terrain
from carom.plugins.joints import (
    Ball,
    Cone,
    Distance,
    Hinge,
    Joints,
    Motor,
    MousePull,
    Slider,
    Weld,
    Wheel,
)
from carom.plugins.parts import PartOf, Parts
from carom.plugins.rotation import BoxCollider, Rotation, Spin
from carom.systems.records import BODY_COLUMNS

JOINTS = Ball, Cone, Distance, Hinge, Motor, MousePull, Slider, Weld, Wheel
SOLIDS = SphereCollider, BoxCollider, CapsuleCollider, ConvexPolygonCollider
MODES = "discrete", "continuous", "event_driven"
INTEGRATORS = "explicit_euler", "semi_implicit_euler", "velocity_verlet", "rk4"
REFUSED = ValueError, CaromError, OverflowError  # what the docs name: the deed was refused, or the step put back
HALF = 4.0  # m, of the room in which bodies come
MOST = 24  # bodies
# What is spawned inside of another body is pushed out, by a bounded push: 0.4 % of the energy of the heaviest here at
# the speed of pushing, which is 1.7 m/s for the largest at the shortest substep.
OVERLAP, PUSH = 0.003, 0.2  # m, J


class BrokenError(AssertionError):
    """A promise that did not hold."""


class Game:
    """One world, and deeds by name; numbers for them come from a generator that each twin gets alike."""

    def __init__(self, seed: int, load: str = "") -> None:
        rng = np.random.default_rng([seed, 0])
        self.d = int(rng.integers(2, 4))
        self.mode, self.integrator = str(rng.choice(MODES)), str(rng.choice(INTEGRATORS))
        self.gravity = float(rng.choice((0.0, -9.81)))
        settings = Settings(
            collision=self.mode, integrator=self.integrator, sleeping=bool(rng.random() < 0.6), on_fault="ignore",
            dt=float(rng.choice((1 / 30, 1 / 60, 1 / 120))), substeps=int(rng.choice((1, 2, 4, 8))),
        )  # fmt: skip
        plugins = self.plugins()
        self.world = World.load(load, *plugins) if load else World(*plugins, settings=settings)
        self.refused: Counter[str] = Counter()
        self.events: list[tuple[str, int]] = []
        for name in ("joint_lost", "joint_broken"):
            self.world.on(name, lambda entity, joint, name=name: self.events.append((name, entity)))

    def plugins(self) -> tuple[object, ...]:
        self.joints = Joints()
        physics = Physics(dimensions=self.d, gravity=(0.0, self.gravity) + (0.0,) * (self.d - 2))
        shapes = (convex_polygon.plugin,) if self.d == 2 else ()
        return physics, Rotation(), self.joints, Parts(), capsule.plugin, terrain.plugin, *shapes

    # -- deeds --------------------------------------------------------------------------------------

    def play(self, deeds: list[tuple[str, int]]) -> list[object]:
        """What is seen after each: hash, entities, events, and what was refused."""
        seen: list[object] = []
        for name, number in deeds:
            self.events.clear()
            said = ""
            try:
                getattr(self, name)(np.random.default_rng(number))
            except REFUSED as error:
                if isinstance(error, BrokenError):
                    raise
                said = f"{type(error).__name__}: {error}".replace(self.world.name, "")
                self.refused[f"{name} {said.split(':')[0]}"] += 1
            told = (self.world.state_hash(), self.world.get_entities()) if name == "step" else ()
            seen.append((name, told, [*self.events], said))
        return seen

    def pick(self, rng: np.random.Generator, *having: type) -> int | None:
        """An entity with a Transform and these components."""
        found = sorted({entity for entity, _ in self.world.get_components(Transform, *having)})
        return int(rng.choice(found)) if found else None

    def part_or_body(self, rng: np.random.Generator, kinds: tuple[type, ...]) -> tuple[int, object] | None:
        """An entity with one of these components, and that."""
        found = sorted((entity, kinds.index(kind)) for kind in kinds for entity, _ in self.world.get_component(kind))
        if not found:
            return None
        entity, kind = found[int(rng.integers(len(found)))]
        return entity, self.world.component_for_entity(entity, kinds[kind])

    def vector(self, rng: np.random.Generator, size: float = 1.0) -> tuple[float, ...]:
        return tuple(float(x) for x in size * rng.normal(size=self.d))

    def place(self, rng: np.random.Generator) -> tuple[float, ...]:
        return tuple(float(x) for x in rng.uniform(-HALF, HALF, self.d))

    def turn(self, rng: np.random.Generator) -> object:
        """A rotation, half of the time none."""
        angle = float(rng.choice((0.0, rng.uniform(-4, 4))))
        return angle if self.d == 2 else (np.cos(angle / 2), *(np.sin(angle / 2) * np.array((0.36, 0.48, 0.8))))

    def spins(self, rng: np.random.Generator) -> object:
        return float(rng.normal()) if self.d == 2 else self.vector(rng)

    def solid(self, rng: np.random.Generator) -> object:
        """A collider that may turn."""
        size = float(rng.choice((0.2, 0.4, 0.8)))
        more = {
            "restitution": float(rng.choice((0.0, 0.0, 0.5, 1.0))), "friction": float(rng.choice((0.0, 0.5, 1.0))),
            "sensor": bool(rng.random() < 0.05),
        }  # fmt: skip
        kind = SOLIDS[rng.integers(len(SOLIDS) - (self.d == 3))]
        if kind is SphereCollider:
            return SphereCollider(size, **more)
        if kind is CapsuleCollider:
            return CapsuleCollider(size, 0.5 * size, **more)
        if kind is BoxCollider:
            return BoxCollider(tuple(size * rng.uniform(0.3, 1.0, self.d)), **more)
        corners = 2 * np.pi * np.arange(5) / 5
        return ConvexPolygonCollider(np.stack((np.cos(corners), np.sin(corners)), 1) * size, **more)

    def spawn(self, rng: np.random.Generator) -> None:
        if len(self.world.bodies) >= MOST:
            return
        kind = str(rng.choice(("dynamic", "dynamic", "dynamic", "kinematic", "static")))
        body = RigidBody(
            mass=float(10 ** rng.uniform(-1.5, 1.5)), kind=kind, ccd=bool(rng.random() < 0.2),
            linear_velocity=0.0 if kind == "static" else self.vector(rng, 3.0),
            linear_damping=float(rng.choice((0.0, 0.0, 0.3))),
        )  # fmt: skip
        turns, shape = rng.random() < 0.6, self.solid(rng) if rng.random() < 0.9 else None
        if rng.random() < 0.1:
            turns, shape = False, AABBCollider((0.4,) * self.d)
        spin = [Spin(self.spins(rng), inertia=None if shape else 1.0)] if turns and kind != "static" else []
        turn = () if isinstance(shape, AABBCollider) else (self.turn(rng),)
        self.world.create_entity(Transform(self.place(rng), *turn), body, *([shape] if shape else []), *spin)

    def spawn_many(self, rng: np.random.Generator) -> None:
        count = int(rng.integers(1, 5))
        if len(self.world.bodies) + count <= MOST:
            places = rng.uniform(-HALF, HALF, (count, self.d))
            self.world.create_entities(
                count, Transform.many(places), RigidBody.many(mass=2.0), SphereCollider.many(radius=0.3, friction=0.5)
            )

    def ground(self, rng: np.random.Generator) -> None:
        """Terrain."""
        heights = 0.3 * rng.normal(size=(4, 4)) - HALF
        if len(self.world.bodies) >= 2 * MOST:
            return
        if self.d == 2:
            x = np.linspace(-HALF, HALF, 8)
            create_chain(self.world, np.stack((x, np.resize(heights, 8)), 1), thickness=0.1, friction=0.5)
        else:
            create_height_field(self.world, heights, 2 * HALF / 3, position=(-HALF, 0.0, -HALF), thickness=0.1)

    def delete(self, rng: np.random.Generator) -> None:
        entity = self.pick(rng)
        if entity is not None:
            self.world.delete_entity(entity, immediate=bool(rng.random() < 0.5))

    def give_spin(self, rng: np.random.Generator) -> None:
        entity = self.pick(rng, RigidBody)
        excluded = Spin, AABBCollider, PartOf
        if entity is not None and not any(self.world.has_component(entity, kind) for kind in excluded):
            self.world.add_component(entity, Spin(self.spins(rng)))

    def take_spin(self, rng: np.random.Generator) -> None:
        entity = self.pick(rng, Spin)
        if entity is not None:
            self.world.remove_component(entity, Spin)

    def take_all_spins(self, rng: np.random.Generator) -> None:
        """Nothing turns any more."""
        for entity, _ in sorted(self.world.get_component(Spin), key=lambda found: found[0]):
            self.world.remove_component(entity, Spin)

    def join(self, rng: np.random.Generator) -> None:
        a, b = self.pick(rng, RigidBody), self.pick(rng, RigidBody)
        kind = JOINTS[rng.integers(len(JOINTS))]
        if a is None or b is None or (kind is Cone and self.d == 2):
            return
        at, way = self.world.component_for_entity(b, Transform).position, self.vector(rng)
        across = np.cross(way, self.vector(rng)) if self.d == 3 else way
        limits = (-float(rng.uniform(0.1, 1)), float(rng.uniform(0.1, 1))) if rng.random() < 0.4 else None
        driven = {"frequency": float(rng.uniform(0.5, 4))} if rng.random() < 0.3 else {}
        driven |= {"motor_speed": float(rng.normal())} if rng.random() < 0.3 else {}
        axis = {"axis": tuple(across)} if self.d == 3 else {}
        own = {
            Ball: {"anchor": at}, Weld: {"anchor": at}, Slider: {"direction": way, "limits": limits, **driven},
            Distance: {"length": float(rng.uniform(0.5, 3)) if limits is None else (0.0, limits[1] * 3)},
            Hinge: {"anchor": at, "limits": limits, **driven, **axis}, Motor: {"speed": float(rng.normal()), **axis},
            Wheel: {"anchor": at, "direction": way, "limits": limits, **driven, **axis},
            Cone: {"anchor": at, "axis": way, "swing": float(rng.uniform(0.1, 3)), "twist": limits},
            MousePull: {"grip": at, "target": self.place(rng), "max_force": float(rng.uniform(1, 100))},
        }[kind]  # fmt: skip
        ends = {"b": b} if kind is MousePull else {"a": None if rng.random() < 0.3 else a, "b": b}
        more = {"breaking_force": float(rng.uniform(5, 500))} if rng.random() < 0.2 else {}
        self.world.create_entity(kind(**ends, **own, **more, collide_connected=bool(rng.random() < 0.3)))

    def part_joint(self, rng: np.random.Generator) -> None:
        found = self.part_or_body(rng, JOINTS)
        if found is not None:
            self.world.delete_entity(found[0])

    def set_joint(self, rng: np.random.Generator) -> None:
        found = self.part_or_body(rng, JOINTS)
        values = {
            "motor_speed": float(rng.normal()), "lower": -float(rng.random()), "frequency": float(rng.uniform(0.5, 4)),
            "target": self.place(rng), "breaking_force": float(rng.uniform(5, 500)), "speed": float(rng.normal()),
            "collide_connected": bool(rng.random() < 0.5), "anchor": self.place(rng), "b": self.pick(rng, RigidBody),
        }  # fmt: skip
        name = list(values)[rng.integers(len(values))]
        if found is not None and name in type(found[1]).columns and values[name] is not None:
            setattr(found[1], name, values[name])

    def add_part(self, rng: np.random.Generator) -> None:
        body = self.pick(rng, RigidBody)
        if body is not None and len(self.world.bodies) < MOST:
            self.world.create_entity(PartOf(body, self.vector(rng, 0.5), self.turn(rng)), self.solid(rng))

    def set_part(self, rng: np.random.Generator) -> None:
        found = self.part_or_body(rng, (PartOf,))
        if found is not None:
            values = {"position": self.vector(rng, 0.5), "mass": float(rng.random()), "rotation": self.turn(rng)}
            name = list(values)[rng.integers(len(values))]
            setattr(found[1], name, values[name])

    def take_part(self, rng: np.random.Generator) -> None:
        entity = self.pick(rng, PartOf)
        if entity is not None:
            self.world.remove_component(entity, PartOf)

    def set_body(self, rng: np.random.Generator) -> None:
        entity = self.pick(rng, RigidBody)
        if entity is not None:
            values = {
                "mass": float(10 ** rng.uniform(-1.5, 1.5)), "linear_velocity": self.vector(rng, 3.0),
                "kind": str(rng.choice(("dynamic", "kinematic", "static"))), "gravity_scale": float(rng.normal()),
                "max_linear_speed": float(rng.uniform(1, 20)), "constant_force": self.vector(rng), "ccd": True,
            }  # fmt: skip
            name = list(values)[rng.integers(len(values))]
            setattr(self.world.component_for_entity(entity, RigidBody), name, values[name])

    def set_column(self, rng: np.random.Generator) -> None:
        """Of all bodies at once, in place."""
        rows = self.world.bodies.dynamic
        rows.linear_velocity[:] = rng.normal(size=rows.linear_velocity.shape)

    def set_place(self, rng: np.random.Generator) -> None:
        entity = self.pick(rng)
        if entity is not None:
            transform = self.world.component_for_entity(entity, Transform)
            if rng.random() < 0.5:
                transform.position = self.place(rng)
            else:
                transform.rotation = self.turn(rng)

    def set_collider(self, rng: np.random.Generator) -> None:
        found = self.part_or_body(rng, SOLIDS)
        if found is not None:
            values = {
                "restitution": float(rng.random()), "friction": float(rng.random()), "sensor": bool(rng.random() < 0.3),
                "layer": int(rng.integers(1, 4)), "radius": float(rng.uniform(0.1, 0.8)),
            }  # fmt: skip
            name = list(values)[rng.integers(len(values))]
            if name in type(found[1]).columns:
                setattr(found[1], name, values[name])

    def push(self, rng: np.random.Generator) -> None:
        entity = self.pick(rng, RigidBody)
        if entity is not None:
            body = self.world.component_for_entity(entity, RigidBody)
            (body.apply_force if rng.random() < 0.5 else body.apply_impulse)(self.vector(rng, 5.0))

    def twist(self, rng: np.random.Generator) -> None:
        entity = self.pick(rng, Spin)
        if entity is not None:
            spin = self.world.component_for_entity(entity, Spin)
            if rng.random() < 0.5:
                spin.apply_torque(self.spins(rng))
            else:
                spin.angular_velocity = self.spins(rng)

    def set_world(self, rng: np.random.Generator) -> None:
        values = {
            "sleeping": not self.world.settings.sleeping, "collision": str(rng.choice(MODES)),
            "substeps": int(rng.choice((1, 4))), "integrator": str(rng.choice(INTEGRATORS)),
            "dt": float(rng.choice((1 / 30, 1 / 60))),
        }  # fmt: skip
        name = str(rng.choice([*values, "sleeping", "sleeping"]))
        self.world.settings = self.world.settings.replace(**{name: values[name]})

    def set_gravity(self, rng: np.random.Generator) -> None:
        self.world.gravity = tuple(float(rng.choice((0.0, -9.81))) * (k == 1) for k in range(self.d))

    def step(self, rng: np.random.Generator) -> None:
        for number in range(int(rng.integers(1, 9))):
            before = self.most_energy()
            self.world.step()
            before *= 1.0 + 1e-9
            if number > 0 and self.world.kinetic_energy() > before:  # the first takes what the game has pushed
                raise BrokenError(f"{before} J of motion become {self.world.kinetic_energy()} by themselves")
        self.check()

    # -- promises -----------------------------------------------------------------------------------

    def most_energy(self) -> float:
        """J of motion that there may be after the next step, where nothing gives any."""
        world, bodies = self.world, self.world.bodies
        forces = np.any(world.gravity) or bodies.dynamic.constant_force.any()
        drives = forces or len(self.joints) or bodies.kinematic.linear_velocity.any() or world.get_component(PartOf)
        overlapping = np.count_nonzero(world.contacts.manifold.depth > OVERLAP)
        return np.inf if drives else (1.0 + 1e-9) * world.kinetic_energy() + 1e-9 + PUSH * overlapping

    def check(self) -> None:
        """After steps."""
        bodies, joints = self.world.bodies, self.joints.columns()
        columns = {name: getattr(bodies, name) for name in ("position", "linear_velocity", "rotation")}
        for name, column in {**columns, **{f"joints {name}": column for name, column in joints.items()}}.items():
            if not np.isfinite(column).all():
                raise BrokenError(f"{name} is not finite; {list(self.world.faults)[-1:]}")
        entities = joints["entity"].tolist()
        if entities != sorted(set(entities)) or {len(column) for column in joints.values()} != {len(entities)}:
            raise BrokenError(f"columns of joints {entities}")
        if (bodies.linear_velocity[bodies.asleep] != 0.0).any():
            raise BrokenError("a sleeper moves")
        self.check_room()

    def check_room(self) -> None:
        """Columns that grow together have as many rows, and those of bodies none or one for each of the table."""
        physics = self.world.physics
        for name in ("candidates", "pairs", "solver", "warm_start", "contacts", "impacts"):
            record = getattr(physics.state, name)
            for section in record.schema.sections:
                if len({record.rows_of(column) for column in section}) > 1:
                    raise BrokenError(f"columns of {record.schema.name} grow apart: {list(section)}")
        for name in BODY_COLUMNS:
            if physics.state.bodies.rows_of(name) not in (0, physics.table.capacity):
                raise BrokenError(f"column {name} of the bodies has {physics.state.bodies.rows_of(name)} rows")


def program(seed: int) -> list[tuple[str, int]]:
    """The deeds of a seed, with numbers for each."""
    rng = np.random.default_rng([seed, 1])
    names, weights = list(DEEDS), np.array(list(DEEDS.values()), float)
    chosen = rng.choice(len(names), int(rng.integers(12, 36)), p=weights / weights.sum())
    return [(name, int(rng.integers(2**31))) for name in ("spawn",) * 4 + tuple(names[k] for k in chosen)]


def run(seed: int) -> Game:
    """Play a program, and its second half once more in a twin: restored, loaded, or made of the same seed.

    BrokenError if a promise does not hold.
    """
    deeds, game, twin = program(seed), Game(seed), TWINS[seed % len(TWINS)]
    half = len(deeds) // 2
    with game.world as world, tempfile.TemporaryDirectory() as folder:
        first, before = game.play(deeds[:half]), world.state_hash()
        settings, snapshot, path = world.settings, world.snapshot(), os.path.join(folder, "saved")
        if twin == "loaded":
            world.save(path)
        second = game.play(deeds[half:])
        if twin == "restored":
            other, world.settings = game, settings
            world.restore(snapshot)
        else:
            other = Game(seed, path if twin == "loaded" else "")
            if twin == "played again":
                same(first, other.play(deeds[:half]), twin)
        with other.world:
            same([before], [other.world.state_hash()], twin)
            same(second, other.play(deeds[half:]), twin)
    return game


def same(one: list[Any], other: list[Any], twin: str) -> None:
    if one != other:
        number = next(k for k, (a, b) in enumerate(zip(one, other, strict=True)) if a != b)
        raise BrokenError(f"{twin}: deed {number} differs: {one[number]} {other[number]}"[:500])


def main(first: int, stop: int) -> int:
    """Play the programs of these seeds; how many have failed."""
    failed, began, refused = 0, time.process_time(), Counter[str]()
    for seed in range(first, stop):
        faulthandler.dump_traceback_later(3600, exit=True)
        try:
            refused += run(seed).refused
        except Exception as error:
            failed += 1
            where = traceback.extract_tb(error.__traceback__)[-1]
            print(f"{seed}: {type(error).__name__}: {error} ({where.filename}:{where.lineno})", flush=True)
    print(f"{stop - first} programs, {failed} failed, {time.process_time() - began:.0f} s; refused: {dict(refused)}")
    return failed


TWINS = "restored", "loaded", "played again"
DEEDS = {
    "spawn": 8, "spawn_many": 2, "ground": 1, "delete": 3, "give_spin": 3, "take_spin": 3, "take_all_spins": 1,
    "join": 6, "part_joint": 2, "set_joint": 3, "add_part": 3, "set_part": 1, "take_part": 1, "set_body": 3,
    "set_column": 1, "set_place": 2, "set_collider": 2, "push": 2, "twist": 2, "set_world": 2, "set_gravity": 1,
    "step": 14,
}  # fmt: skip

if __name__ == "__main__":
    sys.exit(bool(main(int(sys.argv[1]), int(sys.argv[2]))))
