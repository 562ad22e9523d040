"""The uniform grid against brute force: the same exact sets as the tree, or no answer where it does not suit."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_boxes import UNIFORM_GRID_ALONE, Boxes, overlapping, pair_set
from helpers_pairwise import pairwise
from hypothesis import given, settings
from hypothesis import strategies as st
from worlds import both_dimensions


def check(lower, upper, inside, grid=None):
    """None if the grid does not suit, else the number of pairs, after comparing them with brute force."""
    grid = grid or Boxes(lower.shape[1], functions=UNIFORM_GRID_ALONE)
    grid.set(lower, upper, inside)
    found = grid.find()
    if not grid.state.grid.suits:
        return None
    assert pair_set(*found) == overlapping(lower, upper, inside)
    return len(found[0])


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
    assert check(lower, upper, 800) > 0
    grid = Boxes(d, functions=UNIFORM_GRID_ALONE)
    for inside in (800, 300, 700):  # buffers are reused
        assert check(lower[:inside], upper[:inside], inside, grid) is not None


@both_dimensions
@settings(max_examples=40, deadline=None)
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
    check(lower, upper, data.draw(st.integers(1, n)))


@both_dimensions
def test_full_cells(d):
    """More objects in a row of cells than are looked at together, up to the limit of a cell, and beyond it none."""
    rng = np.random.default_rng(2)
    spread = rng.random((2000, d)) * 2000 ** (1 / d) * 2
    for crowd in (12, 30, 60):
        spread[:crowd] = 10.0
        assert check(spread - 0.1, spread + 0.1, 2000) is not None
        spread[:crowd] = 10.0 + 0.3 * rng.random((crowd, d))
        assert check(spread - 0.1, spread + 0.1, 2000) is not None
    spread[:70] = 10.0
    assert check(spread - 0.1, spread + 0.1, 2000) is None


@both_dimensions
def test_what_does_not_suit(d):
    """Very different sizes, one place, points, an infinite box, no box at all: left to the tree."""
    rng = np.random.default_rng(3)
    centre = rng.random((1000, d)) * 40
    half = np.full((1000, 1), 0.01)
    half[0] = 15.0
    assert check(centre - half, centre + half, 1000) is None
    assert check(0 * centre - 0.5, 0 * centre + 0.5, 1000) is None
    assert check(centre, centre, 1000) is None
    half[0] = np.inf
    assert check(centre - half, centre + half, 1000) is None
    nothing = np.full((10, d), np.nan)
    assert check(nothing, nothing, 10) is None
