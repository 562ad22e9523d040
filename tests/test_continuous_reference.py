"""Random scenes against a plain reference that handles impacts one by one: balls and boxes of all sizes and
masses, static, kinematic and dynamic, from slow to crossing the scene in a step."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers_modes import SWEPT, bullet, mode_world, positions, rows_of, strikes, velocities
from helpers_pairwise import pairwise
from worlds import ball

DT = 1 / 60
INFINITE = math.inf
MOST = 12  # impacts that are compared


def balls_meet(offset, w, sizes):
    """Time until spheres at that offset with relative velocity w touch, and the normal then; None if they do not."""
    closing, reach = offset @ w, sizes[0][0] + sizes[1][0]
    under = closing**2 - (w @ w) * (offset @ offset - reach**2)
    if closing >= 0 or under < 0:
        return None
    time = max(0.0, (offset @ offset - reach**2) / (-closing + math.sqrt(under)))
    return time, (offset + w * time) / np.linalg.norm(offset + w * time)


def boxes_meet(offset, w, sizes):
    """The same for boxes: the last axis to meet decides, unless another has separated by then."""
    reach, enter, leave, axis = sizes[0] + sizes[1], -INFINITE, INFINITE, 0
    for k in range(len(offset)):
        if w[k] == 0:
            if abs(offset[k]) >= reach[k]:
                return None
            continue
        first = (-math.copysign(reach[k], w[k]) - offset[k]) / w[k]
        if first > enter:
            enter, axis = first, k
        leave = min(leave, (math.copysign(reach[k], w[k]) - offset[k]) / w[k])
    if enter >= leave or enter < -1e-9 or offset[axis] * w[axis] >= 0:
        return None
    return max(enter, 0.0), math.copysign(1.0, offset[axis]) * np.eye(len(offset))[axis]


def reference(meet, x, v, sizes, masses, e, end):
    """Positions and velocities at the end, and (time, a, b) of all impacts."""
    x, v, now, told = x.copy(), v.copy(), 0.0, []
    while True:
        soonest, what = end - now, None
        for a in range(len(x)):
            for b in range(a + 1, len(x)):
                if masses[a] == masses[b] == INFINITE:
                    continue
                met = meet(x[b] - x[a], v[b] - v[a], (sizes[a], sizes[b]))
                if met is not None and met[0] < soonest:
                    soonest, what = met[0], (a, b, met[1])
        x += v * soonest
        now += soonest
        if what is None or len(told) > MOST:
            return x, v, told
        a, b, normal = what
        impulse = -(1 + e) * ((v[b] - v[a]) @ normal) / (1 / masses[a] + 1 / masses[b])
        v[a] -= impulse / masses[a] * normal
        v[b] += impulse / masses[b] * normal
        told.append((now, a, b))


def scattered(rng, d, apart):
    """Up to eight bodies without overlap that fly inwards, sizes over a decade, masses over four; one can move."""
    n = int(rng.integers(3, 9))
    sizes = 10 ** rng.uniform(-1, 0, (n, d))
    masses, kinds = 10 ** rng.uniform(-2, 2, n), ["dynamic"] * n
    for k in range(1, n):
        kinds[k] = str(rng.choice(["dynamic", "dynamic", "dynamic", "static", "kinematic"]))
        if kinds[k] != "dynamic":
            masses[k] = INFINITE
    width = 2 * (sizes.max(axis=1) ** d).sum() ** (1 / d)
    x = []
    while len(x) < n:
        place = rng.uniform(-width, width, d)
        if all(apart(place - other, sizes[len(x)], sizes[k]) for k, other in enumerate(x)):
            x.append(place)
        width *= 1.01  # until they fit
    x = np.array(x)
    v = (-x * rng.uniform(0, 4, (n, 1)) + rng.normal(size=(n, d)) * width) * 10 ** rng.uniform(0, 2)
    v[np.array(kinds) == "static"] = 0.0
    return x, v, sizes, masses, kinds, width


@pytest.mark.parametrize(("mode", "d", "shape"), pairwise(SWEPT, (2, 3), ("balls", "boxes")))
def test_as_the_reference(mode, d, shape):
    """40 scenes in three steps of 1.7, 17 or 83 ms: the same impacts, times to 1e-9 of the path, states to 1e-8.

    Impacts of curved bodies amplify rounding about tenfold; scenes with more than a dozen are left out. A pair decided
    by rounding would change the count: none of these seeds has one.
    """
    compared = 0
    for seed in range(40):
        rng = np.random.default_rng(1000 * d + seed)
        meet, apart = boxes_meet, lambda offset, one, two: (np.abs(offset) > 1.01 * (one + two)).any()
        if shape == "balls":
            meet, apart = balls_meet, lambda offset, one, two: np.linalg.norm(offset) > 1.01 * (one[0] + two[0])
        x, v, sizes, masses, kinds, width = scattered(rng, d, apart)
        e, dt = rng.choice([1.0, 1.0, 0.9]), DT * rng.choice([0.1, 1.0, 5.0])
        exact_x, exact_v, told = reference(meet, x, v, sizes, masses, e, 3 * dt)
        if len(told) > MOST:
            continue
        world = mode_world(mode, d, dt=dt, max_impacts_per_step=100)
        ids = [
            bullet(
                world, x[k], v[k], mass=masses[k] if kinds[k] == "dynamic" else 1.0, kind=kinds[k], restitution=e,
                **({"radius": sizes[k][0]} if shape == "balls" else {"half": sizes[k]}),
            )
            for k in range(len(x))
        ]  # fmt: skip
        hits = strikes(world, 3)
        scale, speed = width + np.abs(v).max() * dt, np.abs(v).max()
        assert [(ids[a], ids[b]) for _, a, b in told] == list(zip(hits.entity_a, hits.entity_b, strict=True)), seed
        np.testing.assert_allclose(hits.time, [row[0] for row in told], rtol=0, atol=1e-8 * scale / speed)
        np.testing.assert_allclose(positions(world, ids), exact_x, rtol=0, atol=1e-8 * scale)
        np.testing.assert_allclose(velocities(world, ids), exact_v, rtol=0, atol=1e-8 * speed)
        compared += len(told)
    assert compared > 20


@pytest.mark.parametrize(("d", "cap", "pillar"), pairwise((2, 3), (1, 2), (False, True)))
def test_beyond_the_cap_nothing_is_lost(d, cap, pillar):
    """50 separate clusters of three to eight elastic bullets, with one or two impacts each in a step: stopped bodies
    keep their velocity, so momentum (without a pillar among them) and energy of every cluster are conserved to
    rounding."""
    world = mode_world("continuous", d, max_impacts_per_step=cap)
    clusters = []
    for lane in range(50):
        rng = np.random.default_rng(lane)
        places = [np.zeros(d)] if pillar else []
        while len(places) < 3 + lane % 6:
            place = rng.uniform(-2, 2, d)
            if all(np.linalg.norm(place - other) > 1.001 for other in places):
                places.append(place)
        lift = 1e5 * lane * np.eye(d)[1]
        if pillar:
            ball(world, places.pop(0) + lift, kind="static")
        speeds = [rng.normal(size=d) * 300 - 100 * place for place in places]
        clusters.append(
            [bullet(world, p + lift, v, radius=0.5, restitution=1.0) for p, v in zip(places, speeds, strict=True)]
        )
    before = [velocities(world, ids) for ids in clusters]
    capped = 0
    for _ in range(10):
        world.step()
        capped += world.stats().counters["capped_impacts"]
        for ids, start in zip(clusters, before, strict=True):
            now = world.bodies.linear_velocity[rows_of(world, ids)]
            if not pillar:
                np.testing.assert_allclose(now.sum(axis=0), start.sum(axis=0), rtol=0, atol=1e-12 * np.abs(start).sum())
            assert (now**2).sum() == pytest.approx((start**2).sum(), rel=1e-12)
    assert capped > 0
