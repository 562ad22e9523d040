"""The broad phase's tree against brute force, in exact sets: B21, C3, C4, C11, C18, C20 of the accuracy list."""

from __future__ import annotations

import numpy as np
import pytest
from broad_phase.helpers_boxes import overlapping
from hypothesis import given, settings
from hypothesis import strategies as st
from worlds import both_dimensions

from carom.systems.broad_phase.tree.tree import CandidateLimitError, SpatialTree

ONE_CELL_MAX = 24  # so that small trees have levels too; one cell is tested as well


def tree_of(lower, upper, start=0, stop=None, one_cell_max=ONE_CELL_MAX):
    tree = SpatialTree(lower.shape[1], one_cell_max)
    tree.build(lower, upper, start, len(lower) if stop is None else stop)
    return tree


def unordered(first, second):
    """The pairs as a set, after checking that there are no duplicates and no self pairs."""
    pairs = {(min(i, j), max(i, j)) for i, j in zip(first.tolist(), second.tolist(), strict=True)}
    assert len(pairs) == len(first)
    assert all(i != j for i, j in pairs)
    return pairs


def check_everything(lower, upper, rng):
    """Pairs within, pairs between two halves: all equal to brute force."""
    n = len(lower)
    expected = overlapping(lower, upper, n)
    one_cell = tree_of(lower, upper, one_cell_max=n)
    assert one_cell.record.levels == 0
    assert unordered(*one_cell.pairs_within()) == expected
    tree = tree_of(lower, upper)
    assert unordered(*tree.pairs_within()) == expected

    cut = int(rng.integers(0, n + 1))
    first, second = tree_of(lower, upper, 0, cut).pairs_between(tree_of(lower, upper, cut, n))
    found = list(zip(first.tolist(), second.tolist(), strict=True))
    assert len(set(found)) == len(found)
    assert set(found) == {(i, j) for i, j in expected if i < cut <= j}


def scene(name, n, d, rng):
    """Centres (n, d) and half sizes (n, 1)."""
    side = (4.0 * n) ** (1 / d)
    uniform = rng.random((n, d)) * side
    half = np.full((n, 1), 0.5)
    match name:
        case "uniform":
            return uniform, half
        case "power law":
            return uniform, 0.5 * np.clip((1.0 - rng.random((n, 1))) ** (-1 / 1.5), 1, 1000)
        case "clusters":
            return uniform[rng.integers(0, 5, n)] + rng.normal(size=(n, d)), rng.uniform(0.01, 0.2, (n, 1))
        case "all equal":
            return uniform[rng.integers(0, n // 4 + 1, n)], half
        case "split lines":  # centres and edges on multiples of powers of two
            return rng.integers(0, 17, (n, d)) * 4.0, 2.0 ** rng.integers(-3, 3, (n, 1))
        case "far outside":  # most of the extent is empty, with a quarter of the bodies
            far = rng.random((n, 1)) < 0.25
            return np.where(far, rng.standard_cauchy((n, d)) * 100 * side, uniform), half
        case "sizes 1e-9 to 1e9":
            return rng.standard_cauchy((n, d)), 10.0 ** rng.uniform(-9, 9, (n, 1))
        case "galaxies":  # two dense regions, 1e9 apart
            return uniform + rng.integers(0, 2, (n, 1)) * 1e9, half
        case "line":
            return uniform * np.eye(d)[d - 1], np.full((n, 1), 0.002)
        case "offset 1e15":
            return uniform + 1e15, half
        case "denormal":
            return rng.integers(0, 40, (n, d)) * 5e-324, rng.integers(0, 2, (n, 1)) * 5e-324
    raise AssertionError(name)


SCENES = (
    "uniform", "power law", "clusters", "all equal", "split lines", "far outside", "sizes 1e-9 to 1e9", "galaxies",
    "line", "offset 1e15", "denormal",
)  # fmt: skip


@both_dimensions
@pytest.mark.parametrize("name", SCENES)
def test_all_answers_equal_brute_force(name, d):
    rng = np.random.default_rng(7)
    centre, half = scene(name, 500, d, rng)
    check_everything(centre - half, centre + half, rng)


coordinate = st.one_of(
    st.integers(-4, 4).map(float),
    st.floats(-10, 10),
    st.floats(allow_nan=True, allow_infinity=True),
    st.sampled_from([0.0, 1.0, np.nextafter(1.0, 2.0), np.nextafter(1.0, 0.0), 5e-324, 1e308, -1e308, 1e15]),
)


@pytest.mark.slow
@both_dimensions
@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_any_boxes_at_all(d, data):
    """NaN, infinities, empty boxes, one ulp apart: exactly the result of brute force."""
    n = data.draw(st.integers(0, 70))
    values = data.draw(st.lists(coordinate, min_size=8, max_size=40))
    rng = np.random.default_rng(data.draw(st.integers(0, 1000)))
    boxes = rng.choice(values, (n, 2, d))
    if data.draw(st.booleans()):
        boxes = np.sort(boxes, axis=1)  # mostly real boxes
    check_everything(np.ascontiguousarray(boxes[:, 0]), np.ascontiguousarray(boxes[:, 1]), rng)


@pytest.mark.slow
@both_dimensions
@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10**6), exponent=st.integers(-300, 300), n=st.integers(25, 300))
def test_any_scale_and_any_spread(d, seed, exponent, n):
    """Positions and sizes over many magnitudes, in units from 1e-300 to 1e300."""
    rng = np.random.default_rng(seed)
    unit = 10.0**exponent
    centre = rng.normal(size=(n, d)) * 10.0 ** rng.uniform(-3, 3, (n, 1)) * unit
    half = 10.0 ** rng.uniform(-4, rng.uniform(-3, 4), (n, 1)) * unit
    check_everything(centre - half, centre + half, rng)


@both_dimensions
@pytest.mark.parametrize("offset", [0.0, 1.0, 1e6, 1e15])
def test_one_ulp_decides(d, offset):
    """Neighbours in a chain that share an edge overlap; with a gap of one ulp they do not."""
    edges = offset + np.arange(0, 401, dtype=float)
    lower = np.full((400, d), offset)
    upper = np.full((400, d), offset + 1.0)
    lower[:, 0], upper[:, 0] = edges[:-1], edges[1:]
    assert len(tree_of(lower, upper).pairs_within()[0]) == 399
    lower[:, 0] = np.nextafter(lower[:, 0], np.inf)
    assert len(tree_of(lower, upper).pairs_within()[0]) == 0


@both_dimensions
@pytest.mark.parametrize("n", [0, 1, 2])
def test_hardly_any_bodies(n, d):
    lower = np.zeros((n, d))
    tree = tree_of(lower, lower)
    assert len(tree.pairs_within()[0]) == n * (n - 1) // 2
    other = tree_of(np.zeros((5, d)), np.ones((5, d)))
    assert len(tree.pairs_between(other)[0]) == len(other.pairs_between(tree)[0]) == 5 * n


@both_dimensions
def test_many_bodies_at_one_point_are_counted_not_stored(d):
    lower = np.zeros((100_000, d))
    tree = SpatialTree(d)
    tree.build(lower[:1000], lower[:1000], 0, 1000)
    assert len(tree.pairs_within()[0]) == 1000 * 999 // 2
    tree.build(lower, lower, 0, len(lower))
    with pytest.raises(CandidateLimitError, match="4999950000 candidate pairs exceed the limit of 8388608") as caught:
        tree.pairs_within()
    assert (caught.value.count, caught.value.limit) == (100_000 * 99_999 // 2, 1 << 23)
    with pytest.raises(CandidateLimitError):
        tree.pairs_between(tree)
    with pytest.raises(CandidateLimitError, match="limit of 10"):
        tree_of(lower[:30], lower[:30]).pairs_within(limit=10)
