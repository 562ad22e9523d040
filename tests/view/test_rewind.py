"""The ring of snapshots: back and forth to the bit, within its megabytes."""

import pytest

from carom import scenes
from carom.view.tools.rewind import Rewind


@pytest.fixture
def world():
    made = scenes.get("stack").build(None, seed=0)
    yield made
    made.close()


def played(world, rewind, steps):
    hashes = {}
    for _ in range(steps):
        rewind._cost = 0.0  # however long the last one took
        rewind.keep()
        hashes[world.step_count] = world.state_hash()
        world.step()
    hashes[world.step_count] = world.state_hash()
    return hashes


def test_back_and_forth_are_what_was_there(world):
    rewind = Rewind(world)
    hashes = played(world, rewind, 40)
    steps = []
    while rewind.back():
        steps.append(world.step_count)
        assert world.state_hash() == hashes[world.step_count]
    assert steps == sorted(steps, reverse=True)
    assert steps[-1] == 0
    assert len(steps) == 7  # every sixth step: a tenth of a second
    while rewind.forth():
        assert world.state_hash() == hashes[world.step_count]
    assert world.step_count == 40
    rewind.back()
    after = world.step_count
    again = played(world, rewind, 10)  # another future, which is the same
    assert all(hashes[step] == value for step, value in again.items() if step in hashes)
    assert not rewind.forth()
    assert rewind.back()
    assert world.step_count <= after + 10


@pytest.mark.slow
def test_the_ring_keeps_to_its_bytes_and_takes_fewer_where_they_are_large(world):
    rewind = Rewind(world)
    played(world, rewind, 1)
    one = rewind.size
    small = Rewind(world, 4.5 * one / 1e6)
    played(world, small, 700)
    assert 2 <= len(small.ring) <= 5
    assert small.size <= 4.5 * one * 1.01
    span = small.ring[-1].step - small.ring[0].step
    assert span * world.settings.dt > 5.0  # of about ten seconds


def test_a_world_that_others_restore_goes_on_from_there(world):
    rewind = Rewind(world)
    start = world.snapshot()
    played(world, rewind, 30)
    world.restore(start)
    hashes = played(world, rewind, 8)
    assert rewind.back()
    assert world.step_count == 6
    assert world.state_hash() == hashes[6]
    assert rewind.back()
    assert not rewind.back()


def test_no_memory_is_refused(world):
    with pytest.raises(ValueError, match="megabytes must be a number above 0, got 0"):
        Rewind(world, 0)
