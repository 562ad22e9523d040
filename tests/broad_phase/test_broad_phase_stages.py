"""The stages that find candidates: each search gives the same exact set of pairs as brute force."""

from __future__ import annotations

import numpy as np
import pytest
from broad_phase.helpers_boxes import Boxes, overlapping, pair_set
from hypothesis import given, settings
from hypothesis import strategies as st
from worlds import both_dimensions

from carom.systems.broad_phase.brute_force import BRUTE_FORCE_MAX
from carom.systems.broad_phase.stages import BRUTE_FORCE, SPATIAL_TREE, UNIFORM_GRID
from carom.systems.codes import FIND_IN_PYTHON


def spread(rng, count, d, half=0.5):
    """Boxes of one size, one per two to three times their volume."""
    centre = rng.random((count, d)) * (2.5 * max(count, 1)) ** (1 / d)
    return centre - half, centre + half


def mixed(rng, count, d):
    """Boxes of many sizes."""
    centre, half = rng.random((count, d)) * count ** (1 / d), 10.0 ** rng.uniform(-2, 1, (count, 1))
    return centre - half, centre + half


@pytest.mark.slow
@both_dimensions
@pytest.mark.parametrize(
    ("moving", "static", "search"),
    [
        (0, 0, BRUTE_FORCE), (1, 0, BRUTE_FORCE), (20, 1, BRUTE_FORCE), (0, 40, BRUTE_FORCE),
        (BRUTE_FORCE_MAX, BRUTE_FORCE_MAX, BRUTE_FORCE), (BRUTE_FORCE_MAX + 1, 0, UNIFORM_GRID),
        (700, 700, UNIFORM_GRID), (0, 300, BRUTE_FORCE), (5, BRUTE_FORCE_MAX + 1, BRUTE_FORCE),
        (700, 701, UNIFORM_GRID), (60, 2000, BRUTE_FORCE),
    ],
)  # fmt: skip
def test_the_search_by_the_numbers_of_bodies(d, moving, static, search):
    lower, upper = spread(np.random.default_rng(1), moving + static, d)
    boxes = Boxes(d)
    boxes.set(lower, upper, moving)
    assert pair_set(*boxes.find()) == overlapping(lower, upper, moving)
    assert boxes.state.pair_search == boxes.search.last == search
    assert boxes.state.static_grid.suits == (static > max(moving, BRUTE_FORCE_MAX))
    assert FIND_IN_PYTHON not in boxes.asked


@pytest.mark.slow
@both_dimensions
@pytest.mark.parametrize("crowd", [spread, mixed])
@pytest.mark.parametrize(("moving", "static"), [(1, 0), (40, 10), (300, 20), (300, 400)])
@pytest.mark.parametrize("asleep", [1, 20, 250])
def test_sleepers_are_found_by_what_moves_and_look_for_nothing(d, crowd, moving, static, asleep):
    lower, upper = crowd(np.random.default_rng(7), asleep + moving + static, d)
    boxes = Boxes(d)
    boxes.set(lower, upper, asleep + moving, first=asleep)
    awake = set(range(asleep, asleep + moving))
    expected = {pair for pair in overlapping(lower, upper, asleep + moving) if awake & set(pair)}
    assert pair_set(*boxes.find()) == expected


@pytest.mark.slow
@both_dimensions
@settings(max_examples=12, deadline=None)
@given(data=st.data())
def test_any_boxes(d, data):
    """Sizes, crowds, nan, infinities, touching boxes, in one world that changes: always the set of brute force."""
    rng = np.random.default_rng(data.draw(st.integers(0, 10**6)))
    boxes = Boxes(d)
    for _ in range(3):
        count = data.draw(st.sampled_from([0, 3, 50, 81, 250, 600]))
        moving = data.draw(st.sampled_from([0, count, count // 2, count // 10, max(count - 2, 0), min(count, 81)]))
        lower, upper = data.draw(st.sampled_from([spread, mixed]))(rng, count, d)
        if data.draw(st.booleans()):
            lower, upper = np.round(lower) - 0.5, np.round(upper) + 0.5
        if count > 20 and data.draw(st.booleans()):
            rows = rng.integers(0, count, 5)
            lower[rows[0]], upper[rows[1], 0], lower[rows[2], d - 1], upper[rows[3]] = np.nan, np.nan, -np.inf, np.inf
            lower[rows[4]], upper[rows[4]] = -np.inf, np.inf
        boxes.set(lower, upper, moving)
        assert pair_set(*boxes.find()) == overlapping(lower, upper, moving)
        lower[:moving] += 0.3  # the static boxes are where they were
        upper[:moving] += 0.3
        boxes.set(lower, upper, moving, statics_changed=False)
        assert pair_set(*boxes.find()) == overlapping(lower, upper, moving)


@pytest.mark.slow
@both_dimensions
@pytest.mark.parametrize(("moving", "static"), [(600, 0), (600, 30), (600, 700), (20, 700)])
def test_uneven_boxes_are_left_to_trees(d, moving, static):
    rng = np.random.default_rng(2)
    lower, upper = mixed(rng, moving + static, d)
    boxes = Boxes(d)
    boxes.set(lower, upper, moving)
    assert pair_set(*boxes.find()) == overlapping(lower, upper, moving)
    assert boxes.state.pair_search == SPATIAL_TREE
    assert ("quadtree" if d == 2 else "octree") in boxes.search.describe()
    lower, upper = spread(rng, moving + static, d)  # and grids take over again
    boxes.set(lower, upper, moving)
    assert pair_set(*boxes.find()) == overlapping(lower, upper, moving)
    assert boxes.state.pair_search in (UNIFORM_GRID, BRUTE_FORCE)


def test_room_for_one_grid_leaves_the_other_as_it_is():
    """The grid of static boxes is there already when that of the first 81 moving ones needs room."""
    lower, upper = spread(np.random.default_rng(9), 1000, 2)
    boxes = Boxes(2)
    boxes.set(lower, upper, 0)
    boxes.find()
    boxes.set(lower[:700], upper[:700], BRUTE_FORCE_MAX + 1)
    assert pair_set(*boxes.find()) == overlapping(lower[:700], upper[:700], BRUTE_FORCE_MAX + 1)
    assert boxes.state.pair_search == UNIFORM_GRID
    assert boxes.state.static_grid.suits


def test_one_pair_more_than_there_is_room_for():
    lower, upper = spread(np.random.default_rng(4), 400, 2)
    boxes = Boxes(2)
    boxes.set(lower, upper, 400)
    expected = pair_set(*boxes.find())
    for room in range(len(expected) - 3, len(expected) + 3):
        boxes.state.candidates.first, boxes.state.candidates.second = (np.empty(room, np.int32) for _ in range(2))
        assert pair_set(*boxes.find()) == expected
