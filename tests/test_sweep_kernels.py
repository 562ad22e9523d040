"""The small kernels of sweeps against brute force: roots, the heap, merged pairs, search bounds, touches on curved
paths, flight."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from worlds import both_dimensions

from carom.systems.ccd import time_of_impact as touches
from carom.systems.ccd.refresh_pairs import merge_pairs
from carom.systems.ccd.search_bounds import CONTINUOUS, DISCRETE, EVENT_DRIVEN, find_rooms, leaves_at, places_at, widen
from carom.systems.ccd.time_of_impact import make_first_touch
from carom.systems.impacts.heap import heap_pop, heap_push
from carom.systems.integration.flight import land, take_off
from carom.systems.integration.trajectory import first_root

DT = 1 / 60

numbers = st.floats(-10, 10).map(lambda x: round(x, 3))


@settings(max_examples=300, deadline=None, derandomize=True)
@given(st.floats(0, 10), numbers, numbers, numbers, st.floats(0.01, 2))
def test_first_root_against_numpy(gap, c1, c2, c3, span):
    """Exact for a parabola; never late for a cubic. Tolerance: double roots lose half of the digits."""
    exact, cubic = first_root(gap, c1, c2, 0.0, span), first_root(gap, c1, c2, c3, span)
    for root, third in ((exact, 0.0), (cubic, c3)):
        polynomial = np.polynomial.Polynomial([gap, c1, c2, third])
        times = np.linspace(0, min(root, span), 101)[1:-1]
        assert (polynomial(times) >= -1e-12 * (gap + abs(c1) + abs(c2) + abs(third))).all()
    found = [r.real for r in np.roots([c2, c1, gap]) if abs(r.imag) < 1e-12 and r.real > 1e-6] if c1 or c2 else []
    if gap > 1e-3 and abs(c1 * c1 - 4 * c2 * gap) > 1e-3 and (abs(c2) > 1e-6 or not c2):
        assert exact == pytest.approx(min(found, default=math.inf), rel=1e-8)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.lists(st.one_of(st.none(), st.integers(0, 5)), max_size=60), st.integers(0, 2**32 - 1))
def test_the_heap_against_sorted(orders, seed):
    """Pushes (a time, many alike) and pops (None) in any order; the rest comes off sorted."""
    rng = np.random.default_rng(seed)
    room = len(orders) + 1
    heap, times, keys = np.arange(room), np.zeros(room), rng.permutation(room)
    size, waiting = 0, []
    for order in [*orders, *[None] * room]:
        if order is not None:
            place = heap[size]
            times[place] = order
            size = heap_push(heap, size, times, keys)
            waiting.append((order, int(keys[place])))
        elif size:
            earliest = min(waiting)
            waiting.remove(earliest)
            size = heap_pop(heap, size, times, keys)
            assert (times[heap[size]], keys[heap[size]]) == earliest
        assert size == len(waiting)
        assert sorted(heap.tolist()) == list(range(room))


@settings(max_examples=25, deadline=None, derandomize=True)
@given(st.integers(0, 2**32 - 1), st.integers(2, 9))
def test_merged_pairs_against_sets(seed, n):
    """Pairs that crossed, had impacts or hit are kept with their data; of the others the new candidates are kept."""
    rng = np.random.default_rng(seed)
    rank = rng.permutation(n)
    every = sorted(((a, b) for a in range(n) for b in range(n) if rank[a] < rank[b]), key=lambda p: tuple(rank[[*p]]))
    old = [pair for pair in every if rng.random() < 0.5]
    new = [pair for pair in every if rng.random() < 0.5]
    m, like = len(old), (0.0, 0.0)

    def columns(pairs, room):
        a, b = (np.array([p[k] for p in pairs] + [0] * (room - len(pairs)), np.int64) for k in range(2))
        flags = [rng.random(room) < 0.5 for _ in range(2)]
        impulse = np.where(rng.random(room) < 0.3, rng.random(room), 0.0)
        return a, b, *flags, rng.random(room), impulse, rng.integers(0, 3, room).astype(np.uint8), rng.random(
            (room, 2)), rng.random((room, 2))  # fmt: skip

    before, merged = columns(old, m), columns([], m + len(new))
    crossed, now_crossed = rng.random(m) < 0.2, np.zeros(m + len(new), bool)
    hits = np.flatnonzero(rng.random(m) < 0.3)
    layers = rng.integers(1, 4, (1, n))
    masks, sensors = rng.integers(0, 4, (1, n)), rng.random((1, n)) < 0.2
    masses = np.where(rng.random(n) < 0.3, 0.0, 1.0)
    disabled, log = hits[::2].copy(), hits[::-1].copy()
    of_hits, of_disabled, of_log = ([old[c] for c in which] for which in (hits, disabled, log))
    kept = {old[c] for c in range(m) if crossed[c] or before[5][c] > 0.0} | {old[c] for c in hits}
    meet = {(a, b) for a, b in new if layers[0, a] & masks[0, b] and layers[0, b] & masks[0, a]}
    first, second = (np.array([p[k] for p in new], np.int64) for k in range(2))
    count = merge_pairs(
        first, second, len(new), before, m, crossed, rank, np.zeros(n, np.int64), layers, masks, sensors, masses,
        merged, now_crossed, np.empty(m, np.int64), hits, disabled, log, like,
    )  # fmt: skip
    pairs = list(zip(merged[0][:count].tolist(), merged[1][:count].tolist(), strict=True))
    assert pairs == [pair for pair in every if pair in kept | meet]
    for names, which in ((of_hits, hits), (of_disabled, disabled), (of_log, log)):
        assert [pairs[c] for c in which] == names
    for place, (a, b) in enumerate(pairs):
        if (a, b) in kept:
            c = old.index((a, b))
            assert now_crossed[place] == crossed[c]
            for now, then in zip(merged[2:], before[2:], strict=True):
                np.testing.assert_array_equal(now[place], then[c])
        else:
            assert not now_crossed[place]
            assert merged[2][place] == (not (sensors[0, a] or sensors[0, b]) and masses[a] + masses[b] > 0.0)
            assert merged[5][place] == 0.0


@both_dimensions
@pytest.mark.parametrize("mode", [CONTINUOUS, EVENT_DRIVEN, DISCRETE])
@pytest.mark.parametrize("degree", [1, 2])
def test_no_body_leaves_its_search_bounds_before_the_stated_time(mode, degree, d):
    """100 bodies close together, from slow to 50 sizes per step; each is deflected at some time of the step, and its
    new path sampled. Bodies that are not swept are left out. Tolerance: rounding of positions."""
    rng, like = np.random.default_rng(10 * mode + degree), (0.0,) * d
    n = 100
    size = 10 ** rng.uniform(-2, 0, n)
    path = rng.normal(size=(n, d)) * (size / DT * 10 ** rng.uniform(-2, 1.7, n))[:, None]
    second = rng.normal(size=(n, d)) * (size / DT**2)[:, None] * (degree > 1)
    third, origin = np.zeros((n, d)), rng.uniform(-2, 2, (n, d))
    ccd = rng.random(n) < 0.5
    motion, sweep_of = (origin, path, second, third, degree), (mode, ccd)
    shape, inverse_mass, room = np.zeros(n, np.int64), 10 ** rng.uniform(-2, 2, n), np.empty(n)
    before, after = origin.copy(), np.empty((n, d))
    crossing = find_rooms(0.0, DT, n, shape, size, inverse_mass, before, motion, sweep_of, room, like)
    until = min(crossing, DT)
    places_at(until, DT, n, size, motion, after, like)
    lower, upper, roam_lower, roam_upper = (np.zeros((n, d)) for _ in range(4))
    frame = np.zeros(7)
    widen(n, before, after, room, size, lower, upper, roam_lower, roam_upper, frame, like)
    asked = 0
    for i in range(n):
        now = rng.uniform(0, until)
        dv = rng.normal(size=d) * np.linalg.norm(path[i]) * rng.uniform(0, 2)
        path[i] += dv
        origin[i] -= dv * now
        leaves = leaves_at(i, now, DT, size, motion, sweep_of, roam_lower, roam_upper, like)
        assert leaves >= now
        speed = np.linalg.norm(path[i] + 2 * second[i] * now)
        swept = mode == EVENT_DRIVEN or speed * (DT - now) > 0.2 * size[i]
        if swept:
            asked += 1
            times = np.linspace(now, min(leaves, DT), 200)[:, None]
            places = origin[i] + path[i] * times + second[i] * times**2
            if (places[0] >= roam_lower[i]).all() and (places[0] <= roam_upper[i]).all():
                assert (places >= roam_lower[i] - 1e-12).all()
                assert (places <= roam_upper[i] + 1e-12).all()
            else:
                assert leaves == now
        else:
            assert leaves == math.inf
    assert asked > 20


@both_dimensions
@pytest.mark.parametrize("off", [0.0, 1e-10, 0.3])
def test_bodies_in_a_row_have_room_however_little_they_are_off_it(off, d):
    """40 balls 2 m apart that fall 0.2 m in the step: each is alone in its search bounds, 0.4 m wide, so no round is
    needed. A volume of nearly zero must not count as a dense crowd."""
    n, like = 40, (0.0,) * d
    origin = np.zeros((n, d))
    origin[:, 0] = 2.0 * np.arange(n)
    origin[:, 1:] = off * np.random.default_rng(1).random((n, d - 1))
    path, second, third = np.zeros((n, d)), np.zeros((n, d)), np.zeros((n, d))
    path[:, 1] = -0.2 / DT
    motion, sweep_of = (origin, path, second, third, 1), (EVENT_DRIVEN, np.zeros(n, bool))
    room = np.empty(n)
    size, shape, inverse_mass = np.full(n, 0.2), np.zeros(n, np.int64), np.ones(n)
    assert find_rooms(0.0, DT, n, shape, size, inverse_mass, origin, motion, sweep_of, room, like) == math.inf
    assert (room >= 0.2).all()


def plain_sphere(_, a, __, b, d, shapes, like):
    distance = math.hypot(*d)
    depth = shapes[a] + shapes[b] - distance
    normal = tuple(x / distance for x in d)
    return depth >= 0.0, depth, normal, normal


def plain_box(_, a, __, b, d, shapes, like):
    overlaps = [shapes[a] + shapes[b] - abs(x) for x in d]
    depth = min(overlaps)
    axis = overlaps.index(depth)
    normal = tuple(math.copysign(1.0, x) if k == axis else 0.0 for k, x in enumerate(d))
    return depth >= 0.0, depth, normal, normal


@both_dimensions
@pytest.mark.parametrize("shape", [plain_sphere, plain_box])
def test_first_touch_on_parabolas_against_sampling(shape, d):
    """Touches on curved paths, spheres and boxes of half extents, found at 4000 moments and by bisection between two.

    Except for grazes, which are ambiguous, times agree to rounding over the slope.
    """

    def corner(*_):
        return False

    def no_sweep(*_):
        return False, False, 0.0

    first_touch = make_first_touch(shape, corner, no_sweep, lambda *_: True, dented=False)
    plainly = getattr(first_touch, "py_func", first_touch)
    rng, like, found = np.random.default_rng(d), (0.0,) * d, 0
    for _ in range(60):
        sizes = rng.uniform(0.1, 1.0, 2)
        x0, x2 = rng.normal(size=d) * 2, rng.normal(size=d) * 3
        x1 = -x0 * rng.uniform(0, 4) + rng.normal(size=d)
        if shape(0, 0, 0, 1, tuple(x0), sizes, like)[1] >= -1e-3:
            continue

        def depth(t, x0=x0, x1=x1, x2=x2, sizes=sizes):
            return shape(0, 0, 0, 1, tuple(x0 + x1 * t + x2 * t * t), sizes, like)[1]

        times = np.linspace(0, 1, 4001)
        depths = np.array([depth(t) for t in times])
        if abs(depths.max()) < 1e-4:
            continue
        outcome, time, normal, _, at = plainly(
            0, 0, 0, 1, tuple(x0), tuple(x1), tuple(x2), like, False, 0.0, 1.0, 0.0, 1e-3, 0.0, sizes, like
        )
        touched = depths >= 0.0
        assert outcome == (touches.TOUCHES if touched.any() else touches.APART)
        if not touched.any():
            continue
        low, high = times[touched.argmax() - 1], times[touched.argmax()]
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if depth(middle) >= 0.0 else (middle, high)
        slope = -(x1 + 2 * high * x2) @ np.array(normal)
        assert time == pytest.approx(high, abs=1e-13 / slope + 1e-15)
        np.testing.assert_allclose(at, x0 + x1 * time + x2 * time * time, atol=1e-14)
        found += 1
    assert found > 10


@settings(max_examples=100, deadline=None, derandomize=True)
@given(st.integers(2, 3), st.integers(0, 2**32 - 1), st.booleans())
def test_flight_against_closed_forms(d, seed, damped):
    """A parabola under the forces of the start, between two half kicks of damping; then the mean of the forces at both
    ends. Equal forces at the end change nothing. Tolerance: a few roundings."""
    rng, h = np.random.default_rng(seed), 0.1
    n = 5
    position, velocity = rng.normal(size=(2, n, d))
    early, later = rng.normal(size=(2, n, d))
    inverse_mass, damping = rng.uniform(0.1, 10, n), rng.uniform(0, 3, n) * damped
    x, v = position.copy(), velocity.copy()
    path, second = np.empty((2, n, d))
    assert take_off(x, v, early, inverse_mass, damping, path, second, h) == damped
    w, decay = inverse_mass[:, None], np.exp(-0.5 * damping * h)[:, None]
    start = velocity * decay
    np.testing.assert_allclose(path, start, rtol=1e-14, atol=1e-14)
    np.testing.assert_allclose(second, 0.5 * w * early, rtol=1e-14)
    np.testing.assert_allclose(x, position + start * h + 0.5 * w * early * h * h, rtol=1e-14, atol=1e-14)
    np.testing.assert_allclose(v, start + h * w * early, rtol=1e-14, atol=1e-14)
    for force in (early, later):
        landed = v.copy()
        land(landed, force, inverse_mass, damping, second, h)
        end = (start + 0.5 * h * w * (early + force)) * decay
        np.testing.assert_allclose(landed, end, rtol=1e-13, atol=1e-13)
