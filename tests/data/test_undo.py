"""A step that fails leaves no trace, whoever fails in it and wherever; what forces leave behind when it does not."""

from __future__ import annotations

import itertools

import esper
import pytest
from helpers_determinism import Charge, state
from helpers_steps import both_ways  # noqa: F401  every test with each
from worlds import ball, floor, make_world

from carom.components import RigidBody, Transform
from carom.framework import ForceSystem, Phase, StepError, System
from carom.framework.schedule.stages import PythonPart
from carom.systems import ContactEvents, ForceAccumulation, Integration, Response

OF_ONE_STEP = ("force", "inverse_mass", "begin.", "end.", "impacts.")  # made anew in every step


class Health:
    """The game's own: not ours to put back."""

    points = 100


class Fails:
    """Writes into every column, also those that have had no memory, then raises."""

    world = None

    def act(self, *_):
        bodies = self.world.bodies
        for name in bodies.column_names():
            view = getattr(bodies, name)
            if view.flags.writeable and view.dtype == float:
                view += 1.0
            elif view.flags.writeable and view.dtype == bool:
                view[:] = ~view
        for _, health in self.world.get_component(Health):
            health.points -= 1
        raise RuntimeError("out of luck")


class FailingSystem(System, Fails):
    process = Fails.act


class FailingForce(ForceSystem, Fails):
    add_forces = Fails.act


class FailingProcessor(esper.Processor, Fails):
    process = Fails.act


def busy_world(colliders, limited):
    """A world with all kinds of state, about to have an impact, after a few steps."""
    world = make_world(gravity=9.81)
    if colliders:
        floor(world, restitution=0.5)
        ball(world, (0.0, 0.6), (0.3, -2.0), restitution=0.7)
        ball(world, (0.2, 4.0), (-0.1, 0.0), restitution=0.2)
        ball(world, (9.0, 0.499))  # it rests
    world.create_entity(Transform((-5, 5)), RigidBody(kind="kinematic", linear_velocity=(0.1, 0.2)))
    pushed = world.create_entity(Transform((5, 5)), RigidBody(2.0, (1, 0)), Charge(2.0), Health())
    for _ in range(3):
        world.step()
    for _, body in world.get_component(RigidBody):
        body.linear_velocity = 4.0 * body.linear_velocity
        body.step_force = (1.0, 2.0)  # as left by a user system
        body.apply_force((0.5, 0.25))
    if limited:
        world.component_for_entity(pushed, RigidBody).max_linear_speed = 0.5  # it is beyond that
    return world


def make_fail(patch, world, kind):
    """From now on that fails in each step: what the error names, and what was added for it."""
    if isinstance(kind, type):
        system = next(s for s in world.systems if isinstance(s, kind))
        parts = system.parts()

        def no_more(dt):
            raise RuntimeError("out of luck")

        patch.setattr(system, "_parts", lambda: [*parts, PythonPart(system.name, no_more)])
        world.settings = world.settings.replace(max_steps_per_advance=7)  # parts are looked at again
        return system.name, None
    if kind == "handler":
        fails = Fails()
        fails.world = world
        world.on("contact_stay", fails.act)
        return "contact_stay", None
    made = {"force system": FailingForce, "processor": FailingProcessor}.get(kind, FailingSystem)
    made = type(made.__name__, (made,), {"phase": Phase[kind]} if made is FailingSystem else {})()
    world.add_system(made)
    made.world = world
    return type(made).__name__, made


WITH_COLLIDERS = [*(phase.name for phase in Phase), "force system", "processor", "handler"]
BUILT_IN = [ForceAccumulation, Integration, Response, ContactEvents]
CASES = [
    *itertools.product(WITH_COLLIDERS, [True], [True], [None]),
    *itertools.product(BUILT_IN, [True, False], [True, False], [None]),
    *itertools.product([Response, "END"], [True], [False], [Integration]),
    ("END", True, True, Response),
]
CASES_AND_WAYS = zip(CASES, itertools.cycle(("step", "advance", "esper.process")), strict=False)


@pytest.mark.parametrize(("kind", "colliders", "limited", "without", "how"), [(*c, w) for c, w in CASES_AND_WAYS])
def test_a_step_that_fails_leaves_no_trace(monkeypatch, kind, colliders, limited, without, how):
    """Without a built-in system too, which else would keep what the others overwrite."""
    worlds = [busy_world(colliders, limited) for _ in range(2)]
    if without:
        for each in worlds:
            each.remove_processor(without)
    world, twin = worlds
    with monkeypatch.context() as patch:
        digest = world.state_hash()
        name, added = make_fail(patch, world, kind)
        go = {"step": lambda dt: world.step(), "advance": world.advance, "esper.process": esper.process}[how]
        with pytest.raises(StepError, match=f"{name}.*RuntimeError: out of luck") as caught, world:
            go(world.settings.dt)
    assert isinstance(caught.value.__cause__, RuntimeError)
    assert world.state_hash() == digest
    before, after = state(twin), state(world)
    assert [key for key in before if before[key] != after[key] and not key.startswith(OF_ONE_STEP)] == []
    assert (world.time, world.step_count) == (twin.time, twin.step_count)
    if added:
        assert all(health.points == 99 for _, health in world.get_component(Health))
        world.remove_system(added)
    elif kind == "handler":
        return
    for _ in range(5):
        world.step()
        twin.step()
    assert world.state_hash() == twin.state_hash()  # as if nothing had happened
    assert state(world) == state(twin)


class PushLate(System):
    """Pushes after the forces were summed, by writing into the columns."""

    phase = Phase.END

    def process(self, dt):
        self.world.bodies.dynamic.applied_force[:] = 5.0
        self.world.bodies.dynamic.step_force[:] = 0.0


def test_forces_applied_late_do_not_outlive_the_window():
    with make_world() as world:
        entity = world.create_entity(Transform((0, 0)), RigidBody())
        push = PushLate()
        world.add_system(push)
        world.step()
        body = world.component_for_entity(entity, RigidBody)
        assert body.applied_force.tolist() == [0.0, 0.0]
        world.remove_system(push)
        world.step()
        assert body.linear_velocity.tolist() == [0.0, 0.0]


@pytest.mark.parametrize("steps", [1, 3])
def test_forces_written_into_the_columns_act_for_one_window(steps):
    """A force of 6 N on 2 kg for that many steps of dt: v = 3 n dt; then no more."""
    with make_world() as world:
        world.create_entity(Transform((0, 0)), RigidBody(2.0))
        world.bodies.applied_force[:] = (6.0, 0.0)
        dt = world.settings.dt
        assert world.advance(steps * dt) == steps
        assert world.bodies.linear_velocity[0, 0] == pytest.approx(3.0 * steps * dt, rel=1e-14)
        world.step()
        assert world.bodies.linear_velocity[0, 0] == pytest.approx(3.0 * steps * dt, rel=1e-14)


def test_step_forces_written_between_steps_act_once():
    """A force of 6 N on 2 kg for one step: v = 3 dt."""
    with make_world() as world:
        world.create_entity(Transform((0, 0)), RigidBody(2.0))
        world.bodies.step_force[:] = (6.0, 0.0)
        world.step()
        world.step()
        assert world.bodies.linear_velocity[0, 0] == pytest.approx(3.0 * world.settings.dt, rel=1e-14)
        assert not world.bodies.step_force.any()
