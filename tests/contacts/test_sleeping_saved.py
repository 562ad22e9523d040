"""Sleep in snapshots, files and failed steps: worlds go on from them to the bit."""

from __future__ import annotations

import pickle

import pytest
from contacts.helpers_sleeping import CAUSES, GRAVITY, is_asleep, sleep, sleeping_tower, sleepy_world, tower, two_towers
from worlds import Calls, ball, floor, run

from carom.components import RigidBody, Transform
from carom.framework import Phase, Settings, StepError, System, World
from carom.plugins import Physics, convex_polygon
from carom.plugins.springs import Springs


@pytest.fixture(scope="module")
def asleep():
    return two_towers()


class Failing(System):
    phase = Phase.RESPONSE

    def process(self, dt):
        raise ValueError("no")


def go_on(world: World, boxes: list[int], steps: int = 12) -> list[str]:
    """Hashes of steps in which a sleeper is pushed."""
    hashes = []
    for step in range(steps):
        if step == 3:
            world.component_for_entity(boxes[1], RigidBody).apply_impulse((0.4, 0.0))
        world.step()
        contacts = world.contacts
        hashes.append(f"{world.state_hash()} {contacts.normal_impulse.tobytes().hex()} {len(contacts.begin)}")
    return hashes


@pytest.mark.slow
@pytest.mark.parametrize("when", ["due", "asleep", "woken"])
def test_snapshots_and_files_go_on_to_the_bit(when, tmp_path):
    world = World(Physics(2, gravity=(0.0, -GRAVITY)), convex_polygon.plugin, settings=Settings(sleeping=True))
    floor(world, friction=0.5)
    boxes = tower(world, 0.0)
    corners = ((-0.5, -0.5), (0.5, -0.5), (0.0, 0.5))
    world.create_entity(Transform((5.0, 0.5)), RigidBody(), convex_polygon.ConvexPolygonCollider(corners))
    while not is_asleep(world, boxes[1])[0]:
        world.step()
    if when != "due":
        sleep(world, *boxes)
    if when == "woken":
        world.wake(boxes[0])
    snapshot = world.snapshot()
    world.save(tmp_path / "world.npz")
    expected = go_on(world, boxes)
    world.restore(snapshot)
    assert go_on(world, boxes) == expected
    world.restore(pickle.loads(pickle.dumps(snapshot)))
    assert go_on(world, boxes) == expected
    loaded = World.load(tmp_path / "world.npz", Physics(2), convex_polygon.plugin)
    assert loaded.settings.sleeping
    assert go_on(loaded, boxes) == expected


def test_a_world_that_does_not_sleep_goes_on_from_a_snapshot_of_one_that_does():
    world, other = sleepy_world(), sleepy_world(sleeping=False)
    boxes = tower(world, 0.0)
    sleep(world, *boxes)
    other.restore(world.snapshot())
    other.step()
    assert not any(is_asleep(other, *boxes))
    assert len(other.contacts) == 3
    assert len(other.contacts.begin) == len(other.contacts.end) == 0
    assert "_sleep_state" in other.physics.table.arrays
    world.restore(other.snapshot())
    assert not any(is_asleep(world, *boxes))
    sleep(world, *boxes)


def test_a_snapshot_when_the_last_sleeper_was_deleted():
    with World(Physics(dimensions=2), settings=Settings(sleeping=True)) as world:
        lonely = ball(world, (0.0, 0.0))
        world.bodies.position  # noqa: B018 - lent: what is written into it later wakes it
        run(world, 100)
        assert is_asleep(world, lonely) == [True]
        world.delete_entity(lonely, immediate=True)
        kept = world.snapshot()
        world.step()
        world.restore(kept)
        assert world.step_count == 100


def test_a_snapshot_from_before_wakes_what_sleeps():
    world = sleepy_world()
    boxes = tower(world, 0.0)
    run(world, 5)
    snapshot = world.snapshot()
    first = [world.step() or world.state_hash() for _ in range(10)]
    sleep(world, *boxes)
    world.restore(snapshot)
    assert not any(is_asleep(world, *boxes))
    assert [world.step() or world.state_hash() for _ in range(10)] == first


@pytest.mark.parametrize("cause", ["push", "touched", "bottom deleted", "static placed"])
def test_a_failed_step_is_undone(asleep, cause):
    world, boxes, _, snapshot = asleep
    world.settings = world.settings.replace(dt=1 / 60)
    world.restore(snapshot)
    CAUSES[cause](world, boxes)
    kept = world.snapshot()
    world.step()
    expected = [world.state_hash(), *go_on(world, boxes[1:], 5)]
    world.restore(kept)
    failing = Failing()
    world.add_system(failing)
    for _ in range(2):
        with pytest.raises(Exception, match="no"):
            world.step()
    world.remove_system(failing)
    world.step()
    assert [world.state_hash(), *go_on(world, boxes[1:], 5)] == expected


def test_contacts_that_were_read_before_going_back_are_no_trouble():
    """With a handler the step asks which contacts have been disabled: of those that are shown now."""
    world = sleepy_world()
    world.on("contact_begin", lambda contact: None)
    empty = world.snapshot()
    sleep(world, *tower(world, 0.0, 1))
    full = world.snapshot()
    for snapshot, count in ((empty, 0), (full, 1), (empty, 0)):
        list(world.contacts)
        world.restore(snapshot)
        assert len(world.contacts) == count
        world.step()
        assert len(world.contacts) == count


def test_a_spring_from_a_sleeper_to_what_is_awake_goes_on_from_a_snapshot_to_the_bit():
    springs, settings = Springs(), Settings(sleeping=True, integrator="rk4")
    world = World(Physics(2, gravity=(0.0, -GRAVITY)), springs, settings=settings)
    floor(world)
    boxes = tower(world, 0.0, 1)
    sleep(world, *boxes)
    springs.connect(boxes[0], ball(world, (0.0, 3.0)), stiffness=20.0, damping=0.5)
    snapshot, ends = world.snapshot(), []
    for _ in range(2):
        run(world, 10)
        ends.append(world.state_hash())
        world.restore(snapshot)
    assert ends[0] == ends[1]


@pytest.mark.parametrize("fails", ["the step in which all wake", "the step after"])
def test_turned_off_a_failed_step_puts_nobody_back_to_sleep(fails):
    world, boxes = sleeping_tower()
    world.settings = world.settings.replace(sleeping=False)
    if fails == "the step after":
        world.step()
    failing = Failing()
    world.add_system(failing)
    with pytest.raises(Exception, match="no"):
        world.step()
    world.remove_system(failing)
    world.step()
    assert not any(is_asleep(world, *boxes))
    assert len(world.contacts) == 3
    assert len(world.contacts.begin) == len(world.contacts.end) == 0


@pytest.mark.parametrize("cause", ["", "delete", "impulse"])
def test_a_step_that_fails_around_falling_asleep_is_taken_again_to_the_bit(cause):
    """Whichever of the steps fails, before, in and after the one in which the tower falls asleep."""

    def play(failing=None):
        world, found = sleepy_world(), []
        boxes = tower(world, 0.0)
        state = {"on": False}

        def fail():
            if state["on"]:
                raise RuntimeError("once")

        world.add_system(Calls(Phase.END, fail))
        for k in range(60):
            if k == 50 and cause == "delete":
                world.delete_entity(boxes[-1])
            elif k == 50 and cause == "impulse":
                world.component_for_entity(boxes[0], RigidBody).apply_impulse((0.5, 0.0))
            if k == failing:
                state["on"] = True
                with pytest.raises(StepError):
                    world.step()
                state["on"] = False
            world.step()
            found.append((world.state_hash(), is_asleep(world, boxes[0])))
        return found

    expected = play()
    first = next(k for k, (_, asleep) in enumerate(expected) if all(asleep))
    for failing in (first - 1, first, first + 1, 50, 51):
        assert play(failing) == expected, (failing, first)
