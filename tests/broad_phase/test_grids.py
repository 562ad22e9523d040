"""Grids of what moves and of what does not against brute force, alone and in the broad phase of whole worlds."""

from __future__ import annotations

import numpy as np
import pytest
from broad_phase.helpers_boxes import STATIC_GRID_ALONE, UNIFORM_GRID_ALONE, Boxes, overlapping, pair_set
from broad_phase.helpers_statics import level
from helpers_pairwise import pairwise
from hypothesis import given, settings
from hypothesis import strategies as st
from worlds import both_dimensions

from carom.components import RigidBody, Transform
from carom.systems.broad_phase.brute_force import BRUTE_FORCE_MAX
from carom.systems.broad_phase.stages import CANDIDATE_LIMIT, UNIFORM_GRID
from carom.systems.broad_phase.tree.tree import CandidateLimitError
from carom.systems.broad_phase.uniform_grid import OUTSIDE_MAX
from carom.systems.record_buffers import SPARE_ROWS

# -- what moves ------------------------------------------------------------------------------------


def check_uniform(lower, upper, inside, grid=None):
    """None if the grid does not suit, else the number of pairs, after comparing them with brute force."""
    grid = grid or Boxes(lower.shape[1], functions=UNIFORM_GRID_ALONE)
    grid.set(lower, upper, inside)
    found = grid.find()
    if not grid.state.grid.suits:
        return None
    assert pair_set(*found) == overlapping(lower, upper, inside)
    return len(found[0])


@pytest.mark.slow
@pytest.mark.parametrize(("d", "filling", "offset"), pairwise((2, 3), (0.01, 0.3, 1.0, 2.5), (0.0, -1e7)))
def test_even_boxes_and_some_of_any_size(d, filling, offset):
    rng = np.random.default_rng(1)
    centre = rng.random((900, d)) * (900 / filling) ** (1 / d) + offset
    half = rng.uniform(0.35, 0.5, (900, 1))
    half[800:] = 10.0 ** rng.uniform(-3, 3, (100, 1))
    lower, upper = centre - half, centre + half
    lower[:5] = np.nan
    lower[800:810, 0] = np.nan
    lower[810:820, 0], upper[815:825] = -np.inf, np.inf
    lower[830:835], upper[830:835] = np.inf, np.inf
    assert check_uniform(lower, upper, 800) > 0
    grid = Boxes(d, functions=UNIFORM_GRID_ALONE)
    for inside in (800, 300, 700):  # buffers are reused
        assert check_uniform(lower[:inside], upper[:inside], inside, grid) is not None


@pytest.mark.slow
@both_dimensions
@settings(max_examples=20, deadline=None)
@given(data=st.data())
def test_lattices_lines_and_touching(d, data):
    """Edges on multiples of the cell, extents of zero, touching and one ulp apart."""
    rng = np.random.default_rng(data.draw(st.integers(0, 1000)))
    n = data.draw(st.integers(1, 120))
    shape = np.array(data.draw(st.lists(st.integers(1, 9), min_size=d, max_size=d)))
    spacing = data.draw(st.sampled_from([1.0, 0.5, np.nextafter(1.0, 2.0), np.nextafter(1.0, 0.0), 0.1]))
    unit = 10.0 ** data.draw(st.integers(-100, 100))
    centre = rng.integers(0, shape, (n, d)) * spacing + data.draw(st.sampled_from([0.0, 0.5, 1e6]))
    lower, upper = (centre - 0.5) * unit, (centre + 0.5) * unit
    check_uniform(lower, upper, data.draw(st.integers(max(1, n - BRUTE_FORCE_MAX), n)))


@pytest.mark.slow
@both_dimensions
def test_full_cells(d):
    """More objects in a row of cells than are looked at together, up to the limit of a cell, and beyond it none."""
    rng = np.random.default_rng(2)
    spread = rng.random((2000, d)) * 2000 ** (1 / d) * 2
    for crowd in (12, 30, 60):
        spread[:crowd] = 10.0
        assert check_uniform(spread - 0.1, spread + 0.1, 2000) is not None
        spread[:crowd] = 10.0 + 0.3 * rng.random((crowd, d))
        assert check_uniform(spread - 0.1, spread + 0.1, 2000) is not None
    spread[:70] = 10.0
    assert check_uniform(spread - 0.1, spread + 0.1, 2000) is None


@both_dimensions
def test_what_does_not_suit_the_uniform_grid(d):
    """Very different sizes, one place, points, an infinite box, no box at all: left to the tree."""
    rng = np.random.default_rng(3)
    centre = rng.random((1000, d)) * 40
    half = np.full((1000, 1), 0.01)
    half[0] = 15.0
    assert check_uniform(centre - half, centre + half, 1000) is None
    assert check_uniform(0 * centre - 0.5, 0 * centre + 0.5, 1000) is None
    assert check_uniform(centre, centre, 1000) is None
    half[0] = np.inf
    assert check_uniform(centre - half, centre + half, 1000) is None
    nothing = np.full((10, d), np.nan)
    assert check_uniform(nothing, nothing, 10) is None


# -- what does not move ----------------------------------------------------------------------------


def grid_of(lower, upper, moving):
    """A grid of all but the first rows, into which these look."""
    boxes = Boxes(lower.shape[1], functions=STATIC_GRID_ALONE)
    boxes.set(lower, upper, moving)
    return boxes


def outside(boxes):
    """The rows that are not in the grid."""
    grid = boxes.state.static_grid
    return grid.outside[: grid.outside_count]


def check(lower, upper, moving):
    """The number of pairs, after comparing what the first rows find in the grid with brute force; None without one."""
    boxes = grid_of(lower, upper, moving)
    found = boxes.find()
    if not boxes.state.static_grid.suits:
        return None
    left_out = set(outside(boxes).tolist())
    expected = {(i, j) for i, j in overlapping(lower, upper, moving) if j >= moving and j not in left_out}
    assert pair_set(*found) == expected
    return len(expected)


@pytest.mark.slow
@both_dimensions
@settings(max_examples=12, deadline=None)
@given(data=st.data())
def test_any_boxes_look_into_even_ones(d, data):
    """Boxes of all sizes, touching, infinite and without shape; the largest of what does not move stay outside."""
    rng = np.random.default_rng(data.draw(st.integers(0, 1000)))
    count, large = data.draw(st.integers(OUTSIDE_MAX + 1, 300)), data.draw(st.integers(0, OUTSIDE_MAX))
    unit = 10.0 ** data.draw(st.integers(-100, 100))
    centre = rng.integers(0, data.draw(st.integers(2, 40)), (count + 100, d)) * 0.5 + data.draw(
        st.sampled_from([0.0, 0.25, 1e6])
    )
    half = np.full((count + 100, 1), 0.25)
    half[:100] = 10.0 ** rng.uniform(-2, 2, (100, 1))
    half[100 : 100 + large] = 50.0
    lower, upper = (centre - half) * unit, (centre + half) * unit
    lower[3], upper[4, 0], lower[5:9, d - 1], lower[9], upper[9] = np.nan, np.inf, -np.inf, -np.inf, np.inf
    lower[-1] = np.nan
    check(lower, upper, 100)


@pytest.mark.slow
@both_dimensions
@settings(max_examples=10, deadline=None)
@given(data=st.data())
def test_boxes_that_move_look_into_a_lattice(d, data):
    """Most no longer than a cell and inside of the frame, some beyond; static ones that change now and then."""
    rng = np.random.default_rng(data.draw(st.integers(0, 10**6)))
    moving, side = 40, int(np.ceil(400 ** (1 / d)))
    centre = np.stack(np.unravel_index(np.arange(400), (side,) * d), axis=1) * 2.0
    centre = np.concatenate((rng.uniform(-1.0, 2.0 * side, (moving, d)), centre))
    half = np.full((moving + 400, 1), 0.5)
    half[:moving, 0] = rng.uniform(0.1, 1.5, moving)
    boxes = Boxes(d)
    for turn in range(6):
        changed = turn == 0 or data.draw(st.booleans())
        if changed:
            centre[moving:] += rng.uniform(-0.1, 0.1, (400, d))
        centre[:moving] += rng.standard_normal((moving, d))
        centre[3, 0] = np.nan if turn == 3 else 1.0
        boxes.set(centre - half, centre + half, moving, changed)
        assert pair_set(*boxes.find()) == overlapping(centre - half, centre + half, moving)


@both_dimensions
@pytest.mark.parametrize("seed", range(3))
def test_boxes_of_about_one_size_are_all_in_the_grid(d, seed):
    """Only what is much longer stays outside, such as the walls around a level: all that moves looks at that."""
    rng = np.random.default_rng(seed)
    walls, count = int(rng.integers(0, OUTSIDE_MAX // 2)), 400
    centre = rng.random((count, d)) * 3.0 * count ** (1 / d)
    half = rng.uniform(0.5, 0.6, (count, 1))
    half[:walls] *= rng.uniform(2.0, 20.0, (walls, 1))
    boxes = grid_of(centre - half, centre + half, 0)
    boxes.find()
    assert boxes.state.static_grid.suits
    assert sorted(outside(boxes)) == list(range(walls))


@both_dimensions
def test_what_does_not_suit(d):
    """More large ones than may stay outside, all in one place, points, no shapes, no boxes, too few of them."""
    rng = np.random.default_rng(2)
    centre, half = rng.random((1000, d)) * 40, np.full((1000, 1), 0.01)
    half[: OUTSIDE_MAX + 1] = 15.0
    nothing = np.full((1000, d), np.nan)
    for lower, upper in (
        (centre - half, centre + half), (0 * centre - 0.5, 0 * centre + 0.5), (centre, centre), (nothing, nothing),
        (centre[:0], centre[:0]), (centre[:OUTSIDE_MAX], centre[:OUTSIDE_MAX] + 1.0),
    ):  # fmt: skip
        assert check(lower, upper, 0) is None


@pytest.mark.slow
def test_too_many_pairs_are_left_to_the_tree():
    """Each of 8,500 boxes meets all 1,000 in the grid: what the limit does not allow, no grid finds."""
    centre = np.random.default_rng(4).random((9500, 2)) * 60
    lower, upper = centre - 0.1, centre + 0.1
    lower[:8500], upper[:8500] = -1.0, 1e3
    boxes = grid_of(lower, upper, 8500)
    with pytest.raises(CandidateLimitError):
        boxes.find()
    assert boxes.state.static_grid.suits
    assert CANDIDATE_LIMIT <= len(boxes.state.candidates.first) < CANDIDATE_LIMIT + 2 * SPARE_ROWS


def reason(world):
    return next(line for line in str(world.plan()).splitlines() if "BroadPhase" in line)


def touching(world):
    """Pairs of ids whose shapes overlap, by brute force, at least one of them a sphere."""
    bodies = world.bodies
    position, entity, moving = bodies.position, bodies.entity, len(bodies.dynamic)
    half = bodies.aabb_collider.half_extents[moving:]
    found = set()
    for i in range(moving):
        gap = np.maximum(np.abs(position[moving:] - position[i]) - half, 0.0)
        near = moving + np.flatnonzero((gap**2).sum(axis=1) < 0.39**2)
        near = [*near, *np.flatnonzero(((position[:moving] - position[i]) ** 2).sum(axis=1) < 0.78**2)]
        found |= {(min(entity[i], entity[j]), max(entity[i], entity[j])) for j in near if j != i}
    return found


@pytest.mark.slow
@both_dimensions
@pytest.mark.parametrize("movers", [1, 60, 400])
def test_a_level_is_seen_as_it_is(d, movers):
    """All that overlaps is in contact; also after static boxes were moved by their handles or in the columns."""
    with level(d, movers, speed=0.0) as world:
        sphere = int(world.bodies.entity[0])
        for turn in range(4):
            world.step()
            assert "uniform grid" in reason(world)
            contacts = set(zip(world.contacts.entity_a.tolist(), world.contacts.entity_b.tolist(), strict=True))
            assert touching(world) <= contacts
            box = int(world.bodies.static.entity[40 + turn])
            beside = world.component_for_entity(sphere, Transform).position + np.eye(d)[0] * 0.2
            if turn % 2:
                world.component_for_entity(box, Transform).position = beside
            else:
                world.bodies.position[world.bodies.row_of(box)] = beside
            world.component_for_entity(sphere, RigidBody).linear_velocity = (0.0,) * d


@pytest.mark.slow
@both_dimensions
@pytest.mark.parametrize("fixed", [0, 40, 900])
def test_long_kinematic_boxes_leave_the_others_in_their_grid(d, fixed):
    """They meet these, each other, what stands and what sleeps."""
    for seed in range(6):
        rng = np.random.default_rng(seed)
        kinematic, sleepers, dynamic = int(rng.integers(1, OUTSIDE_MAX // 2)), int(rng.integers(0, 30)), 300
        n = sleepers + dynamic + kinematic + fixed
        centre, half = rng.uniform(0.0, 30.0 if d == 2 else 12.0, (n, d)), np.full((n, d), 0.5)
        long = half[sleepers + dynamic : sleepers + dynamic + kinematic + 8]  # some that stand as well
        long[:] = 10.0 ** rng.uniform(-1.0, 1.5, long.shape)
        boxes, moving = Boxes(d), sleepers + dynamic + kinematic
        boxes.set(centre - half, centre + half, moving, first=sleepers, kinematic=kinematic)
        found = pair_set(*boxes.find())
        pairs = overlapping(centre - half, centre + half, moving)
        assert found == {(i, j) for i, j in pairs if sleepers <= i or sleepers <= j < moving}
        assert boxes.state.pair_search == UNIFORM_GRID
