"""Rollback: worlds whose players hear from each other late have the bits of one that knows all inputs at once."""

from __future__ import annotations

import numpy as np
import pytest

from carom import (
    AABBCollider,
    CaromError,
    Physics,
    RigidBody,
    Rollback,
    SphereCollider,
    StepError,
    System,
    Transform,
    World,
)


def game():
    """Two players push their balls about on a floor, among others."""
    world = World(Physics(dimensions=2, gravity=(0, -9.81)))
    world.create_entity(Transform((0, -0.5)), AABBCollider((20, 0.5), friction=0.3))
    players = [world.create_entity(Transform((x, 0.5)), RigidBody(), SphereCollider(0.5)) for x in (-2, 2)]
    for k in range(6):
        world.create_entity(Transform((0.3 * k - 1, 2 + k)), RigidBody(), SphereCollider(0.3))

    def apply(inputs):
        for player, push in zip(players, inputs, strict=True):
            world.component_for_entity(player, RigidBody).apply_impulse((push, abs(push)))

    return world, apply


def pushes(random, frames):
    """Some that change now and then."""
    return (random.integers(-1, 2, frames // 7 + 1).repeat(7)[:frames] * 0.5).tolist()


@pytest.mark.slow
@pytest.mark.parametrize(("late", "lost", "most"), [(0, 0.0, 8), (5, 0.0, 8), (12, 0.3, 8), (3, 0.2, 2)])
def test_late_and_lost_inputs_end_in_the_same_bits(late, lost, most):
    random, frames = np.random.default_rng(late), 120
    given = [pushes(random, frames) for _ in range(2)]
    world, apply = game()
    for both in zip(*given, strict=True):
        apply(list(both))
        world.step()
    right = world.state_hash()
    peers = [Rollback(*game(), most=most) for _ in range(2)]
    under_way = []  # (tick, to, first frame, inputs, checksum)
    for tick in range(20 * frames):
        for packet in [packet for packet in under_way if packet[0] <= tick]:
            under_way.remove(packet)
            _, to, first, inputs, checksum = packet
            peers[to].give(1 - to, first, inputs)
            assert not peers[to].differs(*checksum)
        for number, peer in enumerate(peers):
            known = len(peer.inputs(number))
            if peer.frame < frames and known == peer.frame:
                peer.give(number, known, [given[number][known]])
            if peer.frame < frames:
                peer.step()
                assert peer.frame - peer.confirmed <= most
            if random.random() >= lost:
                mine = peer.inputs(number)
                first = max(0, len(mine) - 2 * most - 2)
                delay = random.integers(0, late + 1)
                under_way.append((tick + delay, 1 - number, first, mine[first:], peer.checksum()))
        if all(peer.confirmed == frames for peer in peers):
            break
    for peer in peers:
        peer.settle()
        assert peer.frame == frames
        assert peer.world.state_hash() == right
        assert peer.replayed > 0


def test_worlds_that_differ_are_found_out():
    peers = [Rollback(*game()) for _ in range(2)]
    for peer in peers:
        peer.give(0, 0, [0.5] * 70)
        peer.give(1, 0, [-0.5] * 70)
        assert peer.checksum() == (0, "")
    peers[1].world.component_for_entity(2, RigidBody).linear_velocity = 0.0, 1e-12
    for peer in peers:
        while peer.frame < 70:
            assert peer.step()
            assert peer.differs(0, "") is None  # of one that has not begun
    frame, hash_there = peers[0].checksum()
    assert frame == 60
    assert peers[1].differs(frame, hash_there) is True
    assert peers[0].differs(frame, hash_there) is False
    assert peers[0].differs(90, hash_there) is None  # not played


@pytest.mark.plain
@pytest.mark.parametrize("where", ["apply", "step"])
@pytest.mark.parametrize("at", [0, 3, 4, 7])
def test_what_raises_is_played_once_more(where, at):
    """Inputs act once, made bodies are made once, and no frame gets lost, in frames that are played again as well."""
    errors = []

    class Fails(System):
        def process(self, dt):
            if where == "step" and errors and world.step_count == errors[0]:
                errors.clear()
                raise RuntimeError("once")

    def apply(inputs):
        world.component_for_entity(body, RigidBody).apply_impulse((sum(inputs), 0))
        if inputs[1] == 2:
            world.create_entity(Transform((0, 9)), RigidBody())
        if where == "apply" and errors and world.step_count == errors[0]:
            errors.clear()
            raise RuntimeError("once")

    def play(call):
        try:
            call()
        except (StepError, RuntimeError):
            call()

    found = []
    for failing in (False, True):
        world = World(Physics(2))
        world.add_system(Fails())
        body = world.create_entity(Transform((0, 0)), RigidBody())
        rollback = Rollback(world, apply)
        for again in (False, True):  # all as guessed; then with what has come late
            errors[:] = [at] if failing else []
            if again:
                rollback.give(1, 0, [0, 0, 1, 2, 1, 0, 0, 0])
                play(rollback.settle)
            for frame in () if again else range(8):
                rollback.give(0, frame, [1])
                play(rollback.step)
            found.append((rollback.frame, world.step_count, len(world.bodies), world.state_hash()))
        assert not errors or at < 2
    assert found[:2] == found[2:]


def test_an_error_of_apply_before_the_first_input_of_a_player_names_idle():
    world = World(Physics(2))
    given = []
    rollback = Rollback(world, lambda inputs: given.append([steer for steer, _ in inputs]))
    rollback.give(0, 0, [(1.0, False)])
    with pytest.raises(TypeError) as raised:
        rollback.step()
    (note,) = raised.value.__notes__
    assert note.startswith("Rollback: apply got 0 for player 1, of whom no input is known yet; Rollback(..., idle=...)")
    rollback = Rollback(world, lambda inputs: given.append([steer for steer, _ in inputs]), idle=(0.5, False))
    rollback.give(0, 0, [(1.0, False)])
    assert rollback.step()
    assert given == [[1.0, 0.5]]


def test_it_waits_for_the_slowest_and_ignores_gaps():
    world, apply = game()
    rollback = Rollback(world, apply, most=3)
    rollback.give(0, 0, [0.0] * 10)
    assert [rollback.step() for _ in range(5)] == [True, True, True, False, False]
    rollback.give(1, 2, [0.5])  # frames 0 and 1 are missing
    assert not rollback.step()
    rollback.give(1, 0, [0.0, 0.0, 0.5])
    assert rollback.step()
    assert (rollback.confirmed, rollback.frame, rollback.replayed) == (3, 4, 1)


@pytest.mark.plain
@pytest.mark.parametrize(("wrong", "told"), [
    ((2, 0, [1]), "from 0 to 1, got 2"), ((-1, 0, [1]), "player must be .* from 0, got -1"),
    ((0, -1, [1]), "frame must be a whole number from 0, got -1"), ((0, 0.5, [1]), "frame must .*, got 0.5"),
    (("0", 0, [1]), "player must be .* got '0'"), ((0, 0, 5), "inputs must be a list, one for each frame, got 5"),
    ((0, 0, [0.5, np.zeros(2)]), r"do not, got array\(\[0., 0.\]\)"),
    ((0, 0, [0.5, 0.5, (0.5, np.zeros(2))]), "do not, got .0.5, array"),
])  # fmt: skip
def test_what_cannot_be_an_input_is_refused_at_once(wrong, told):
    world, apply = game()
    rollback = Rollback(world, lambda inputs: apply([0.0, 0.0]), idle=(0.5, np.ones(2)))
    for _ in range(3):
        rollback.step()
    with pytest.raises((ValueError, TypeError), match=told):
        rollback.give(*wrong)
    assert [rollback.inputs(player) for player in (0, 1)] == [[], []]
    rollback.settle()
    assert rollback.replayed == 0


@pytest.mark.plain
@pytest.mark.parametrize(("wrong", "told"), [
    ({"players": 0}, "players must be a whole number from 1, got 0"), ({"players": 2.5}, "players .* got 2.5"),
    ({"players": "2"}, "players .* got '2'"), ({"players": True}, "players .* got True"),
    ({"most": 0}, "most must be a whole number from 1, got 0"), ({"most": 2.5}, "most .* got 2.5"),
    ({"most": "a"}, "most .* got 'a'"), ({"apply": None}, "apply must be callable, got None"),
    ({"world": None}, "world must be a World, got None"),
])  # fmt: skip
def test_what_it_cannot_be_made_of_is_named(wrong, told):
    world, apply = game()
    with pytest.raises((ValueError, TypeError), match=f"Rollback: {told}"):
        Rollback(**{"world": world, "apply": apply, **wrong})


@pytest.mark.plain
@pytest.mark.parametrize("wrong", [("a", "x"), (None, "x"), (-3, "x"), (0.5, "x"), (0, None), (0, 7)])
def test_what_is_no_checksum_of_a_frame_is_named(wrong):
    rollback = Rollback(*game())
    name, value = ("frame", wrong[0]) if wrong[0] != 0 else ("checksum", wrong[1])
    with pytest.raises((ValueError, TypeError), match=rf"Rollback\.differs: {name} must be .*, got {value!r}"):
        rollback.differs(*wrong)


@pytest.mark.plain
@pytest.mark.parametrize("call", ["step", "settle", "checksum"])
def test_apply_takes_no_step_itself(call):
    """Told so; the frame is played by the next call."""
    world, apply = game()
    calls = [call]

    def steps(inputs):
        apply(inputs)
        if calls:
            getattr(rollback, calls.pop())()

    rollback = Rollback(world, steps)
    before = world.state_hash()
    with pytest.raises(CaromError, match="Rollback: apply, and what is in a step, must not call step"):
        rollback.step()
    assert (rollback.frame, world.state_hash()) == (0, before)
    assert rollback.step()
    assert rollback.frame == 1
