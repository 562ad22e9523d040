"""What a world was like before leaves nothing behind: one that is restored from a snapshot goes on as it does, to the
bit, whatever comes, goes or changes; and what comes later is as what was there from the start."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from laws.helpers_laws import cases
from rotation.helpers_turning import G
from worlds import MODES

from carom import Physics, RigidBody, Settings, SphereCollider, Transform, World
from carom.plugins.joints import Distance, Hinge, Joints, Weld
from carom.plugins.parts import PartOf, Parts
from carom.plugins.rotation import BoxCollider, Rotation, Spin

FAR = 5.0  # m: nothing of one place comes to the other


def make(d: int, mode: str, **settings: Any) -> World:
    plugins = Physics(d, gravity=(0.0, -G, 0.0)[:d]), Rotation(), Joints(), Parts()
    return World(*plugins, settings=Settings(collision=mode, on_fault="ignore", **settings))


def static(world: World, place: tuple[float, ...], half: tuple[float, ...]) -> int:
    d = world.dimensions
    return world.create_entity(Transform(place[:d]), RigidBody(kind="static"), BoxCollider(half[:d], friction=0.5))


class History:
    """A floor, a mill, and a world to which random things happen."""

    def __init__(self, seed: int, d: int, mode: str) -> None:
        self.random, self.d = np.random.default_rng([seed, d]), d
        self.world = world = make(d, mode, sleeping=bool(seed % 2))
        static(world, (0.0, -1.0, 0.0), (30.0, 1.0, 30.0))
        mill = RigidBody(kind="kinematic", linear_velocity=(0.3, 0.0, 0.0)[:d])
        world.create_entity(Transform((3.0, 0.5, 0.0)[:d]), mill, self.spin(), BoxCollider((0.5, 0.5, 0.5)[:d]))

    def number(self, low: float, high: float) -> float:
        return float(self.random.uniform(low, high))

    def spin(self) -> Spin:
        return Spin(self.number(-2, 2) if self.d == 2 else (self.number(-2, 2), 0.0, self.number(-2, 2)))

    def place(self) -> tuple[float, ...]:
        return (self.number(-4, 4), self.number(0.6, 3), self.number(-0.5, 0.5))[: self.d]

    def bodies(self, kind: str = "dynamic") -> list[int]:
        every = self.world.get_component(RigidBody)
        return sorted(e for e, body in every if body.kind == kind and not self.world.has_component(e, PartOf))

    def some(self, entities: list[int]) -> int:
        return entities[int(self.random.integers(len(entities)))]

    def spawn(self) -> None:
        size, e = self.number(0.2, 0.4), self.number(0, 1)
        collider = BoxCollider((size, 0.7 * size, 0.4)[: self.d], friction=0.5, restitution=e)
        if self.random.random() < 0.3:
            collider = SphereCollider(size, friction=0.5, restitution=e)
        velocity = (self.number(-3, 3), self.number(-3, 1), 0.0)[: self.d]
        body = self.world.create_entity(
            Transform(self.place()), RigidBody(self.number(0.3, 5), velocity), self.spin(), collider
        )
        if self.random.random() < 0.3:
            part = PartOf(body, (size, 0.5 * size, 0.0)[: self.d], mass=0.5)
            self.world.create_entity(part, BoxCollider((0.1, 0.15, 0.1)[: self.d]))

    def build(self) -> None:
        static(self.world, self.place(), (0.5, 0.1, 0.5))

    def delete(self) -> None:
        gone = self.some([*self.bodies(), *self.bodies("static")[1:]] or [0])
        if gone:
            self.world.delete_entity(gone, immediate=self.random.random() < 0.5)

    def connect(self) -> None:
        found = self.bodies()
        if len(found) > 1:
            one, other = found[0], self.some(found[1:])
            middle, axis = 0.5 * (self.at(one) + self.at(other)), {} if self.d == 2 else {"axis": (0.0, 0.0, 1.0)}
            joints = Distance(one, other), Weld(one, other, anchor=middle), Hinge(one, other, anchor=middle, **axis)
            self.world.create_entity(joints[int(self.random.integers(3))])

    def at(self, entity: int) -> np.ndarray:
        return np.array(self.world.component_for_entity(entity, Transform).position)

    def stop(self) -> None:
        """Nothing turns any more; or all of it may."""
        turning = sorted(entity for entity, _ in self.world.get_component(Spin))
        for entity in turning or self.bodies():
            if turning:
                self.world.remove_component(entity, Spin)
            else:
                self.world.add_component(entity, Spin())

    def hold(self) -> None:
        found = self.bodies()
        if found:
            self.world.component_for_entity(self.some(found), RigidBody).kind = "kinematic"

    def go_on(self) -> None:
        happens = (*[History.spawn] * 4, *[History.connect] * 2, History.build, History.delete, History.stop,
                   History.hold)  # fmt: skip
        if self.random.random() < 0.25:
            happens[int(self.random.integers(len(happens)))](self)


def continuation(seed: int, d: int, mode: str, steps: int = 100) -> list[int]:
    """The steps that end otherwise in the world than in one restored from a snapshot before them."""
    history, differ = History(seed, d, mode), []
    with history.world as world, make(d, mode, sleeping=bool(seed % 2)) as other:
        for step in range(steps):
            history.go_on()
            other.restore(world.snapshot())
            world.step()
            other.step()
            if other.state_hash() != world.state_hash():
                differ.append(step)
    return differ


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "d"), cases([(seed, d) for seed in range(40) for d in (2, 3)], 12))
def test_a_world_restored_from_a_snapshot_takes_the_same_step(seed, d):
    """The reach of static bodies stayed with their rows when these moved, as others came or went: impacts were found
    late. And points of contacts were looked for where nothing turns: of the impulses of another step."""
    assert continuation(seed, d, MODES[seed % 3]) == []


@pytest.mark.slow
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("mode", MODES)
def test_a_world_goes_back_and_repeats_its_steps(mode, d):
    for seed in range(2):
        history = History(seed, d, mode)
        with history.world as world:
            for _ in range(40):
                history.go_on()
                world.step()
            snapshot, state = world.snapshot(), history.random.bit_generator.state
            ends = []
            for _ in range(2):
                for _ in range(60):
                    history.go_on()
                    world.step()
                ends.append(world.state_hash())
                world.restore(snapshot)
                history.random.bit_generator.state = state
            assert ends[0] == ends[1]


def falling(world: World, x: float, height: float, e: float) -> int:
    d, body = world.dimensions, RigidBody(linear_velocity=(1.0, 0.0, 0.0)[: world.dimensions])
    collider = BoxCollider((0.3, 0.2, 0.3)[:d], friction=0.5, restitution=e)
    return world.create_entity(Transform((x, height, 0.0)[:d]), body, Spin(), collider)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("d", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_what_comes_or_goes_far_away_changes_no_bounce(d, mode):
    """A box bounced 18 mm elsewhere when another one came 5 m away from it, in a step before it fell down."""
    paths = []
    for steps in ((), (0,), (1, 5), (3,)):
        with make(d, mode) as world:
            static(world, (0.0, -1.0, 0.0), (30.0, 1.0, 30.0))
            box, others = falling(world, 0.0, 1.2, 0.7), []
            path = []
            for step in range(90):
                if step in steps:
                    others.append(falling(world, FAR * (1 + len(others)), 1.5, 0.3))
                if step == 20 and others:
                    world.delete_entity(others.pop(0))
                world.step()
                path.append(np.array(world.component_for_entity(box, Transform).position))
            paths.append(path)
    for path in paths[1:]:
        np.testing.assert_array_equal(path, paths[0])


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("d", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_what_comes_later_is_as_what_was_there_from_the_start(d, mode):
    """Two boxes fall. The second one is created when it has fallen for some steps, as it is then."""
    with make(d, mode) as world, make(d, mode) as other:
        for each in (world, other):
            static(each, (0.0, -1.0, 0.0), (30.0, 1.0, 30.0))
            falling(each, 0.0, 1.2, 0.7)
        second = falling(world, FAR, 1.5, 0.4)
        for _ in range(5):
            world.step()
            other.step()
        kept = [world.component_for_entity(second, kind) for kind in (Transform, RigidBody, Spin)]
        there, body, spin = kept
        collider = BoxCollider((0.3, 0.2, 0.3)[:d], friction=0.5, restitution=0.4)
        other.create_entity(
            Transform(there.position, there.rotation), RigidBody(linear_velocity=body.linear_velocity),
            Spin(spin.angular_velocity), collider,
        )  # fmt: skip
        for _ in range(90):
            world.step()
            other.step()
            assert other.state_hash() == world.state_hash()


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("d", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_what_lies_and_loses_its_spin_lies_on(d, mode):
    """It had been borne at several points; those of what does not turn have no place. A restored world, which had none
    from before, read memory that was not there."""
    with make(d, mode) as world, make(d, mode) as other:
        static(world, (0.0, -1.0, 0.0), (30.0, 1.0, 30.0))
        collider = BoxCollider((0.3, 0.2, 0.3)[:d], friction=0.5)
        box = world.create_entity(Transform((0.0, 0.2, 0.0)[:d]), RigidBody(2.0), Spin(), collider)
        for _ in range(30):
            world.step()
        world.remove_component(box, Spin)
        other.restore(world.snapshot())
        for each in (world, other):
            each.step()
            assert np.linalg.norm(each.component_for_entity(box, RigidBody).linear_velocity) < 1e-9
            (contact,) = each.contacts
            assert contact.normal_impulse == pytest.approx(2.0 * G / 60, rel=1e-9)
        assert other.state_hash() == world.state_hash()
