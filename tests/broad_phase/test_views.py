"""What moving bodies remember of the static grid: all pairs are found, and who need not look does not."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_boxes import Boxes, overlapping, pair_set
from helpers_statics import level
from hypothesis import given, settings
from hypothesis import strategies as st
from worlds import both_dimensions

from carom.components import RigidBody, SphereCollider, Transform
from carom.framework import Settings
from carom.systems.broad_phase.static_neighbours import NOT_KNOWN

MOVING, STATIC = 40, 400


def lattice(d):
    """(d,) unit boxes two apart, but for the rows of what moves, which are empty yet."""
    side = int(np.ceil(STATIC ** (1 / d)))
    places = np.stack(np.unravel_index(np.arange(STATIC), (side,) * d), axis=1) * 2.0
    centre = np.concatenate((np.zeros((MOVING, d)), places))
    return centre, 2.0 * side


def look(boxes, centre, motion, half, statics_changed=False):
    """What the stages find for boxes that have moved so in this step, and what brute force does."""
    lower, upper = centre - half, centre + half
    lower[:MOVING] = np.fmin(lower[:MOVING], lower[:MOVING] - motion)
    upper[:MOVING] = np.fmax(upper[:MOVING], upper[:MOVING] - motion)
    boxes.set(lower, upper, MOVING, statics_changed)
    boxes.state.bodies.position = centre.copy()
    boxes.state.bodies.previous_position = centre.copy()
    boxes.state.bodies.previous_position[:MOVING] -= motion
    return pair_set(*boxes.find()), overlapping(lower, upper, MOVING)


@both_dimensions
@settings(max_examples=10, deadline=None)
@given(data=st.data())
def test_bodies_on_their_way_see_what_is_there(d, data):
    """Slow and fast ones, some of which turn, jump elsewhere or have no place for a while; static ones that change."""
    rng = np.random.default_rng(data.draw(st.integers(0, 10**6)))
    centre, side = lattice(d)
    half = np.full((MOVING + STATIC, 1), 0.5)
    half[:MOVING, 0] = rng.uniform(0.1, 1.5, MOVING)
    centre[:MOVING] = rng.uniform(-1.0, side, (MOVING, d))
    speed = 10.0 ** rng.uniform(-3, 1, (MOVING, 1)) * data.draw(st.sampled_from([0.0, 0.1, 1.0]))
    motion = rng.standard_normal((MOVING, d)) * speed
    boxes = Boxes(d)
    for turn in range(12):
        changed = turn == 0 or bool(data.draw(st.integers(0, 5)) == 0)
        if changed:
            centre[MOVING:] += rng.uniform(-0.1, 0.1, (STATIC, d))
        centre[:MOVING] += motion
        motion[rng.integers(0, MOVING, 3)] *= -1.0
        jumps = rng.integers(0, MOVING, 2)
        centre[jumps] = rng.uniform(-1.0, side, (2, d))
        if turn == 5:
            centre[3], centre[4, 0] = np.nan, np.inf
        found, expected = look(boxes, centre, motion, half, changed)
        assert found == expected
        if turn == 5:
            centre[3:5] = 1.0


@pytest.mark.parametrize("collision", ["discrete", "continuous"])
def test_memory_changes_nothing(collision):
    """A level through which balls fly, with bodies that come and go, beside one in which nobody remembers anything."""
    with level(2, 60, speed=8.0) as world, level(2, 60, speed=8.0) as other:
        remembered = 0
        for both in (world, other):
            both.settings = Settings.balanced().replace(collision=collision)
        for step in range(60):
            for both in (world, other):
                if step % 20 == 10:
                    parts = Transform((4.5, 4.5)), RigidBody(linear_velocity=(3.0, 2.0)), SphereCollider(0.3)
                    both.create_entity(*parts)
                if step % 20 == 15:
                    both.delete_entity(int(both.bodies.dynamic.entity[7]))
            other.physics.state.views.count[:] = NOT_KNOWN
            world.step()
            other.step()
            remembered += int((world.physics.state.views.count[:60] > 0).sum())
        assert remembered > 100
        assert world.state_hash() == other.state_hash()
