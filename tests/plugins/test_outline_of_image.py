"""Outlines of images: area and distance against closed forms, and which side is solid."""

from __future__ import annotations

import numpy as np
import pytest

from carom import Physics, RigidBody, SphereCollider, Transform, World, create_chain, outline_of_image
from carom.plugins import terrain

pytestmark = pytest.mark.plain


def area_of(loop):
    x, y = loop.T
    return 0.5 * (x * np.roll(y, -1) - y * np.roll(x, -1)).sum()


def distances(points, loop):
    """(n,), from each point to the line through the points of a loop."""
    starts, ways = loop, np.roll(loop, -1, axis=0) - loop
    rest = points[:, None] - starts
    along = np.clip((rest * ways).sum(-1) / (ways * ways).sum(-1), 0, 1)
    return np.linalg.norm(rest - along[..., None] * ways, axis=-1).min(axis=1)


def along(loop, count=400):
    """Points of a loop, close to each other."""
    t = np.linspace(0, len(loop), count, endpoint=False)
    k = t.astype(int)
    return loop[k] + (t - k)[:, None] * (np.roll(loop, -1, axis=0)[k] - loop[k])


@pytest.mark.slow
@pytest.mark.parametrize("soft", [True, False])
@pytest.mark.parametrize("tolerance", [0.0, 0.3, 2.0])
def test_discs_and_rings_are_within_the_tolerance(soft, tolerance):
    """Both ways: of the outline from the circle and of the circle from the outline. Filled pixels are half a pixel's
    diagonal from their circle at most; alpha, cut off at 0 and 1, an eighth."""
    random, own = np.random.default_rng(4), 0.125 if soft else 0.71
    for radius, inner in ((9, 0), (40, 0), (40, 25), (23.4, 11.2)):
        middle = radius + 3 + random.uniform(0, 1, 2)
        y, x = np.mgrid[: int(2 * radius + 8), : int(2 * radius + 8)] + 0.5
        apart = np.hypot(x - middle[0], len(y) - y - middle[1])
        if soft:
            image = np.clip(radius - apart + 0.5, 0, 1) * np.clip(apart - inner + 0.5, 0, 1)
        else:
            image = (apart < radius) & (apart >= inner)
        loops = outline_of_image(image, tolerance)
        assert len(loops) == (2 if inner else 1)
        for loop, size, sign in zip(loops, (radius, inner), (-1, 1), strict=False):
            limit = tolerance + own
            assert np.abs(np.hypot(*(along(loop) - middle).T) - size).max() <= limit
            turn = np.linspace(0, 2 * np.pi, 500)
            circle = middle + size * np.stack((np.cos(turn), np.sin(turn)), axis=1)
            assert distances(circle, loop).max() <= limit
            assert abs(sign * area_of(loop) - np.pi * size**2) <= limit * 2 * np.pi * size
        if tolerance:
            assert len(loops[0]) <= 2 * np.pi / np.sqrt(8 * tolerance / radius) * 6 + 8


@pytest.mark.slow
def test_any_image_has_loops_that_do_not_cross_and_hold_its_area():
    """Noise, with corners that touch: at tolerance 0 the area is that of marching squares, which cuts half of a quarter
    of a pixel from each convex corner and adds it to each hollow one; coarser ones stay simple."""
    random = np.random.default_rng(7)
    for _ in range(20):
        image = random.random((12, 15)) < 0.5
        loops = outline_of_image(image, 0.0)
        padded = np.pad(image, 1).astype(int)
        corners = padded[:-1, :-1] + padded[:-1, 1:] + padded[1:, :-1] + padded[1:, 1:]
        opposite = (corners == 2) & (padded[:-1, :-1] == padded[1:, 1:])
        missing = (corners == 1).sum() + 2 * opposite.sum() - (corners == 3).sum()
        assert -sum(map(area_of, loops)) == pytest.approx(image.sum() - missing / 8)
        for loop in outline_of_image(image, 1.5):
            ends = np.roll(loop, -1, axis=0)
            for i in range(len(loop)):
                for j in range(i + 2, len(loop) - (i == 0)):
                    assert not crosses(loop[i], ends[i], loop[j], ends[j])


def crosses(a, b, c, d):
    def side(p, q, r):
        return np.sign((q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]))

    return side(a, b, c) * side(a, b, d) < 0 and side(c, d, a) * side(c, d, b) < 0


@pytest.mark.compiled
def test_the_filled_side_is_solid():
    """A ball lies on the disc in a ring's hole's lowest place, and one on top of the ring."""
    y, x = np.mgrid[:48, :48] + 0.5
    apart = np.hypot(x - 24, y - 24)
    world = World(Physics(2, gravity=(0, -10)), terrain.plugin)
    alpha = np.clip(20 - apart + 0.5, 0, 1) * np.clip(apart - 12 + 0.5, 0, 1)
    outer, hole = outline_of_image(alpha, 0.1, pixel_size=0.25)
    for loop in (outer, hole):
        create_chain(world, loop, loop=True)
    balls = [world.create_entity(Transform(place), RigidBody(), SphereCollider(0.5)) for place in ((6, 5), (6, 12))]
    for _ in range(150):
        world.step()
    heights = [world.component_for_entity(each, Transform).y for each in balls]
    assert heights[0] == pytest.approx(6 - 3 + 0.5, abs=0.05)
    assert heights[1] == pytest.approx(6 + 5 + 0.5, abs=0.05)
    world.close()


def test_nothing_and_everything_and_what_is_no_image():
    assert outline_of_image(np.zeros((3, 4))) == []
    (whole,) = outline_of_image(np.ones((3, 4)), 0.0)
    assert whole.min(axis=0).tolist() == [0, 0]
    assert whole.max(axis=0).tolist() == [4, 3]
    for image in (np.zeros(3), np.zeros((0, 3)), [["a"]], np.full((2, 2), np.nan)):
        with pytest.raises(ValueError, match="image must be rows and columns of numbers"):
            outline_of_image(image)
    for name, values in (("tolerance", {"tolerance": -1}), ("pixel_size", {"pixel_size": 0})):
        with pytest.raises(ValueError, match=f"{name} must be"):
            outline_of_image(np.ones((3, 3)), **values)
