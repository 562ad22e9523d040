"""Timers: due in the step of their seconds, in any of these kinds of entities, and repeated to the bit by rollback."""

from __future__ import annotations

import itertools
import math
import pickle
from fractions import Fraction

import numpy as np
import pytest

from carom import (
    NoPhysicsError,
    Phase,
    Physics,
    Prefab,
    RigidBody,
    Settings,
    SphereCollider,
    StepError,
    System,
    Timer,
    Timers,
    Transform,
    World,
)
from carom.plugins.timers import FireTimers, StartTimers

KINDS = ("loose", "dynamic", "kinematic", "static")


def world_of(**settings):
    return World(Physics(2), Timers(), settings=Settings(**settings))


def give(world, kind, *timer, **values):
    """An entity of that kind with such a timer."""
    place = 9.0 * len(world.bodies), 0.0
    body = () if kind == "loose" else (Transform(place), RigidBody(kind=kind), SphereCollider(0.5))
    return world.create_entity(*body, Timer(*timer, **values))


def log_of(world):
    """(step, entity) of all events from now on."""
    log = []
    world.on("timer", lambda entity, timer: log.append((world.step_count, entity)))
    return log


def run(world, steps):
    for _ in range(steps):
        world.step()


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("dt", [1 / 60, 1 / 10, 1 / 1000, 0.01])
def test_a_timer_fires_once_in_the_step_that_ends_with_its_seconds(kind, dt):
    """Of n steps and a half the step n, counted from 0; of n steps, also as a sum or a decimal, the step n - 1."""
    world, start = world_of(dt=dt), 7
    log = log_of(world)
    run(world, start)
    parts = (0.1, 1.0, 3.0, 2.5, 30.0, 0.5)
    entities = [give(world, kind, part * dt) for part in parts]
    also = give(world, kind, sum([dt] * 30))
    run(world, 50)
    due = [(start + math.ceil(part) - 1, entity) for part, entity in zip((*parts, 30), (*entities, also), strict=True)]
    assert log == sorted(due)
    for entity in entities:
        assert world.entity_exists(entity) is (kind != "loose")
        assert kind == "loose" or not world.has_component(entity, Timer)


@pytest.mark.slow
def test_what_repeats_keeps_its_phase():
    """The n-th event is in the step in which n times the seconds end, and once a step at most."""
    world, due = world_of(dt=1 / 60), set()
    log = log_of(world)
    for kind, steps in itertools.product(("loose", "dynamic"), (1.0, 2.0, 7.3, 1.25, 1 / 3)):
        exact, entity = Fraction(steps).limit_denominator(100), give(world, kind, steps / 60, repeat=True)
        due |= {(math.ceil(n * exact) - 1, entity) for n in range(1, int(3000 / exact) + 1)}
    run(world, 3000)
    assert log == sorted(due)


def test_events_of_a_step_come_in_order_of_the_entities_also_of_bulk_and_of_no_bodies():
    world, log = world_of(), []
    world.on("timer", lambda entity, timer: log.append(entity))
    ids = [give(world, kind, 0.5) for kind in ("loose", "static", "dynamic", "loose")]
    ids += world.create_entities(50, Transform.many(np.zeros((50, 2))), RigidBody.many(), Timer.many(0.5))
    ids += [give(world, kind, 0.5) for kind in ("kinematic", "loose")]
    run(world, 40)
    assert log == sorted(ids)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_what_is_created_inside_a_step_counts_from_its_end(kind):
    """Before, and in, and after the timers' own systems."""
    made = []

    class Makes(System):
        def process(self, dt):
            if self.world.step_count == 3:
                made.append(give(self.world, kind, 2 * dt))

    for phase, before in [*((phase, ()) for phase in Phase), (Phase.START, StartTimers), (Phase.END, FireTimers)]:
        Makes.phase, world = phase, world_of()
        log = log_of(world)
        world.add_system(Makes(), before=before)
        run(world, 3)
        give(world, kind, 100.0)  # so that this step has others to look at anyway
        run(world, 7)
        assert log == [(5, made[-1])]


@pytest.mark.parametrize("kind", ["loose", "dynamic"])
def test_handlers_may_do_anything_to_timers(kind):
    """Delete, cancel and replace their own and those that are due after it."""
    world = world_of()
    first, second, third, fourth = (give(world, kind, 0.1, repeat=k == 3) for k in range(4))
    log = log_of(world)

    def change(entity, timer):
        assert timer is world.component_for_entity(entity, Timer)
        if entity == first and world.step_count == 5:
            world.add_component(first, Timer(0.1))
            world.delete_entity(second)
            world.remove_component(third, Timer)
        if entity == fourth and world.step_count == 11:
            timer.repeat = False

    world.on("timer", change)
    world.step()
    assert world.component_for_entity(first, Timer).left(world.time) == pytest.approx(0.1 - 1 / 60)
    run(world, 40)
    assert log == [(5, first), (5, fourth), (11, first), (11, fourth)]


@pytest.mark.plain
def test_seconds_that_are_set_count_from_the_begin_or_the_last_time():
    world = world_of(dt=0.1)
    log = log_of(world)
    once, often = give(world, "dynamic", 10.0), give(world, "loose", 0.5, repeat=True)
    run(world, 12)
    world.component_for_entity(once, Timer).seconds = 1.5
    world.component_for_entity(often, Timer).seconds = 1.0
    run(world, 10)
    assert log == [(4, often), (9, often), (14, once), (19, often)]
    world.settings = world.settings.replace(dt=0.25)
    run(world, 8)
    assert log[4:] == [(25, often), (29, often)]


@pytest.mark.parametrize("way", ["rollback", "file"])
def test_snapshots_and_files_go_on_to_the_bit(way, tmp_path):
    """With timers that come and go meanwhile, of bodies and of none."""
    world = world_of()
    log = log_of(world)
    for k in range(12):
        give(world, KINDS[k % 4], 0.1 + 0.07 * k, repeat=k % 3 == 0)
    run(world, 5)
    kept = world.snapshot()
    world.save(tmp_path / "timers")

    def play(world, log):
        log.clear()
        for k in range(60):
            if k == 8:
                give(world, "loose", 0.2)
                give(world, "dynamic", 0.3)
            world.step()
        return [*log], world.state_hash(), world.get_entities()

    first = play(world, log)
    assert len(first[0]) > 20
    if way == "file":
        world = World.load(tmp_path / "timers", Physics(2), Timers())
        log = log_of(world)
    else:
        world.restore(kept)
    assert play(world, log) == first
    world.close()


@pytest.mark.plain
@pytest.mark.parametrize("kind", ["loose", "dynamic"])
def test_a_handler_that_raises_loses_no_event(kind):
    """The step is taken again, with the events of all."""
    world, fails = world_of(), [True]
    ids = [give(world, kind, 0.1, repeat=k == 1) for k in range(3)]
    log = log_of(world)

    def fail(entity, timer):
        if entity == ids[1] and fails:
            fails.clear()
            raise RuntimeError("once")

    world.on("timer", fail)
    run(world, 5)
    with pytest.raises(StepError, match=r"in .*fail, a handler of timer: RuntimeError: once"):
        world.step()
    log.clear()
    run(world, 7)
    assert log == [(5, ids[0]), (5, ids[1]), (5, ids[2]), (11, ids[1])]


@pytest.mark.plain
@pytest.mark.parametrize("kind", ["loose", "dynamic"])
@pytest.mark.parametrize("repeat", [False, True])
def test_a_step_that_fails_after_the_event_spends_no_timer(kind, repeat):
    """What the handler did is undone, and done once when the step is taken again."""

    class Fails(System):
        on = False

        def process(self, dt):
            if self.on:
                raise RuntimeError("once")

    world = world_of()
    world.add_system(fails := Fails())  # at the end, after the timers
    ship = world.create_entity(Transform((-9.0, 0)), RigidBody())
    give(world, kind, 0.1, repeat=repeat)
    log = log_of(world)
    world.on("timer", lambda entity, timer: world.component_for_entity(ship, RigidBody).apply_impulse((2.0, 0)))
    run(world, 5)
    fails.on = True
    with pytest.raises(StepError):
        world.step()
    fails.on = False
    run(world, 7)
    assert [step for step, _ in log] == ([5, 5, 11] if repeat else [5, 5])
    assert world.component_for_entity(ship, RigidBody).linear_velocity[0] == (4.0 if repeat else 2.0)


@pytest.mark.plain
@pytest.mark.parametrize("kind", ["loose", "dynamic"])
def test_a_timer_that_is_given_again_begins_anew(kind):
    """A copy of one that runs, of a prefab, pickled, or removed and added; in snapshots it goes on."""
    world = world_of()
    own = give(world, kind, 0.5, repeat=True)
    run(world, 10)
    kept, timer = world.snapshot(), world.component_for_entity(own, Timer)
    log, other = log_of(world), world_of()

    def new():
        return () if kind == "loose" else (Transform((5.0, 0)), RigidBody())

    given = [world.create_entity(*new(), each) for each in (timer.copy(), pickle.loads(pickle.dumps(timer)))]
    given.append(Prefab(*new(), timer).spawn(world))
    other_log = log_of(other)
    there = other.create_entity(*new(), timer.copy())
    run(other, 30)
    run(world, 30)
    assert other_log == [(29, there)]
    assert log == [(29, own), *((39, entity) for entity in sorted(given))]
    if kind != "loose":
        world.add_component(own, world.remove_component(own, Timer))
        log.clear()
        run(world, 30)
        assert [step for step, entity in log if entity == own] == [69]
    world.restore(kept)
    log.clear()
    run(world, 30)
    assert log == [(29, own)]


def test_bodies_are_none_the_wiser():
    """Timers move nothing, wake nothing, and do not make what is static be looked at anew."""
    hashes = []
    for timers in (True, False):
        world = world_of(sleeping=True)
        world.gravity = (0, -9.81)
        world.create_entity(Transform((0, 0)), SphereCollider(5.0))
        ball = world.create_entity(Transform((0, 5.5)), RigidBody(), SphereCollider(0.5))
        if timers:
            for entity in (1, ball):
                world.add_component(entity, Timer(0.25, repeat=True))
        run(world, 200)
        assert world.bodies.asleep[0]
        hashes.append((world.bodies.position.tobytes(), world.bodies.linear_velocity.tobytes()))
        if timers:
            before = world.physics.table.static_version
            run(world, 60)
            assert world.bodies.asleep[0]
            assert world.physics.table.static_version == before
    assert hashes[0] == hashes[1]


@pytest.mark.plain
@pytest.mark.parametrize("seconds", [0.0, -1.0, 1e-9, math.nan, math.inf, None, "1", True])
def test_seconds_that_are_none_are_refused(seconds):
    for make in (Timer, lambda seconds: Timer.many(seconds).store(2, 2)):
        with pytest.raises(ValueError, match=r"Timer\.seconds must be "):
            make(seconds)


@pytest.mark.plain
def test_what_timers_need():
    with pytest.raises(NoPhysicsError, match=r"timers needs physics before it: World\(Physics\(...\), Timers\(\)\)"):
        World(Timers())
    with pytest.raises(
        ValueError, match=r"Timer does nothing without its plugin: .*Timers.*, from carom\.plugins\.timers"
    ):
        World(Physics(2)).create_entity(Timer(1.0))
