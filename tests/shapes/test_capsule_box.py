"""A capsule against a box beyond what test_shipped_pairs says: bits of mirrored poses, ends of the range, ties."""

from __future__ import annotations

import math
from collections import namedtuple
from functools import cache

import numpy as np
import pytest
from worlds import both_dimensions, registry

from carom.components import AABBCollider
from carom.lab.plugins.kernels import PairCode
from carom.lab.plugins.samples import Rows
from carom.plugins import capsule
from carom.plugins.capsule import CapsuleCollider

pytestmark = pytest.mark.slow  # its shapes take long to compile

Met = namedtuple("Met", "hit depth normal point")
Poses = namedtuple("Poses", "sizes directions boxes offsets")  # (n, 2): radius and half height; (n, d) each


@cache
def compiled(d):
    """(the pair as worlds compile it, both shapes)."""
    made = registry(capsule.plugin)
    shapes = made.shapes[CapsuleCollider], made.shapes[AABBCollider]
    return PairCode(made.pair(CapsuleCollider, AABBCollider), *shapes, d), *shapes


def meet(poses):
    sizes, directions, boxes, offsets = map(np.ascontiguousarray, poses)
    n, d = offsets.shape
    axes = np.zeros((n, d, d))
    axes[:, :, 1] = directions
    code, one, two = compiled(d)
    first = Rows(one, {"radius": sizes[:, 0].copy(), "half_height": sizes[:, 1].copy()}, axes, boxes)
    found = code(first, Rows(two, {"half_extents": boxes}, np.zeros((n, d, d)) + np.eye(d), boxes), offsets)
    met = Met(found.hit, found.depth, found.normal, found.point)
    assert np.isfinite(met.depth).all()
    assert np.isfinite(met.point).all()
    assert abs(np.linalg.norm(met.normal, axis=1) - 1).max() < 1e-12
    assert (met.hit == (met.depth >= 0)).all()
    return met


def one_pose(radius, half_height, direction, box, offset, d):
    """The same for one pose, from numbers of which the first d count."""
    direction = np.array([direction[:d]], float)
    direction /= np.linalg.norm(direction)
    box, offset = (np.array([vector[:d]], float) for vector in (box, offset))
    met = meet(Poses(np.array([[radius, half_height]], float), direction, box, offset))
    return Met(*(values[0] for values in met))


def units(vectors):
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def random_poses(rng, n, d):
    sizes, boxes = 10.0 ** rng.uniform(-1, 0.5, (n, 2)), 10.0 ** rng.uniform(-1, 0.5, (n, d))
    return Poses(sizes, units(rng.normal(size=(n, d))), boxes, 1.5 * rng.normal(size=(n, d)))


def along_axes(rng, n, d):
    return np.eye(d)[rng.integers(0, d, n)]


def parallel(rng, n, d):
    return random_poses(rng, n, d)._replace(directions=along_axes(rng, n, d))


def nearly_parallel(rng, n, d):
    tilt = 10.0 ** rng.uniform(-18, -2, (n, 1)) * rng.normal(size=(n, d))
    return random_poses(rng, n, d)._replace(directions=units(along_axes(rng, n, d) + tilt))


def without_extents(rng, n, d):
    poses = random_poses(rng, n, d)
    sizes, boxes = poses.sizes * rng.integers(0, 2, (n, 2)), poses.boxes * rng.integers(0, 2, (n, d))
    return poses._replace(sizes=sizes, boxes=boxes)


def on_a_grid(rng, n, d):
    directions = rng.integers(-2, 3, (n, d)).astype(float)
    directions[(directions == 0).all(1), 0] = 1.0
    return Poses(
        rng.integers(0, 3, (n, 2)).astype(float), units(directions), rng.integers(0, 3, (n, d)).astype(float),
        0.5 * rng.integers(-5, 6, (n, d)),
    )  # fmt: skip


def just_touching(rng, n, d):
    poses = random_poses(rng, n, d)
    met = meet(poses)
    gap = rng.choice([-1.0, 1.0], n) * 10.0 ** rng.uniform(-17, -2, n)
    return poses._replace(offsets=poses.offsets + met.normal * (met.depth - poses.sizes[:, 0] + gap)[:, None])


FAMILIES = (random_poses, parallel, nearly_parallel, without_extents, on_a_grid, just_touching)


@both_dimensions
def test_mirrored_turned_and_scaled_poses_have_the_same_bits(d):
    rng = np.random.default_rng(3)
    for family in FAMILIES:
        poses = family(rng, 2000, d)
        if family is on_a_grid:  # without ties
            poses = poses._replace(offsets=poses.offsets + 1e-3 * rng.normal(size=poses.offsets.shape))
        met = meet(poses)
        for axis in range(d):
            flip = np.where(np.arange(d) == axis, -1.0, 1.0)
            mirrored = meet(poses._replace(directions=poses.directions * flip, offsets=poses.offsets * flip))
            assert (mirrored.depth == met.depth).all()
            assert (mirrored.normal * flip == met.normal).all()
            assert (mirrored.point * flip == met.point).all()
        turned = meet(poses._replace(directions=-poses.directions))
        np.testing.assert_allclose(turned.depth, met.depth, rtol=0, atol=1e-14)
        for factor in (2.0**-40, 2.0**40):
            scaled = meet(Poses(factor * poses.sizes, poses.directions, factor * poses.boxes, factor * poses.offsets))
            assert (scaled.depth == factor * met.depth).all()
            assert (scaled.normal == met.normal).all()
            assert (scaled.point == factor * met.point).all()


UP, SLOPE, ALONG = (0, 1, 0), (1, 1, 0), (1, 0, 0)
EXTREMES = {  # radius, half height, direction, half extents, offset; depth
    "a ball above the box": (0.5, 0, UP, (1, 1, 1), (0, -1.25, 0), 0.25),
    "a point on a face": (0, 0, UP, (1, 1, 1), (0, -1, 0), 0),
    "a point in the centre": (0, 0, UP, (1, 2, 3), (0, 0, 0), 1),
    "a point on a point": (0, 0, UP, (0, 0, 0), (0, 0, 0), 0),
    "two points": (0, 0, UP, (0, 0, 0), (3, 4, 0), -5),
    "a segment through a point": (0.5, 2, SLOPE, (0, 0, 0), (1, 1, 0), 0.5),
    "a segment along a line": (0.5, 2, ALONG, (3, 0, 0), (1, 0, 0), 0.5),
    "end to end with a line": (0.5, 2, ALONG, (3, 0, 0), (5.25, 0, 0), 0.25),
    "upright, centre on centre": (0.5, 1, UP, (1, 2, 3), (0, 0, 0), 1.5),
    "lying, centre on centre": (0.5, 1, ALONG, (1, 1.5, 3), (0, 0, 0), 2),
    "oblique, centre on centre": (0.5, math.sqrt(2), SLOPE, (1, 1, 9), (0, 0, 0), 0.5 + math.sqrt(2)),
    "on a face": (0.25, 1, ALONG, (5, 1, 5), (0, -1.25, 0), 0),
    "in a face": (0.25, 1, ALONG, (5, 1, 5), (0, -1, 0), 0.25),
    "beside an edge": (1, 1, UP, (1, 1, 1), (1.3, 0, 0), 0.7),
    "from a corner": (1, 1, SLOPE, (1, 1, 1), (1 + math.sqrt(0.5), 1 + math.sqrt(0.5), 0), 1),
    "far away": (1, 1, UP, (1, 1, 1), (1e12, 0, 0), 2 - 1e12),
    "a speck in a huge box": (1e-12, 1e-12, UP, (1e6, 1e6, 1e6), (1e6, 0, 0), 1e-12),
    "a huge capsule round a speck": (1e6, 1e6, UP, (1e-12, 1e-12, 1e-12), (0, 0, 0), 1e6 + 1e-12),
}


@both_dimensions
@pytest.mark.parametrize("size", [1.0, 1e-150, 1e143])
@pytest.mark.parametrize("name", EXTREMES)
def test_extremes(d, name, size):
    radius, half_height, direction, box, offset, depth = EXTREMES[name]
    scaled = (size * radius, size * half_height, direction, np.multiply(size, box), np.multiply(size, offset))
    met = one_pose(*scaled, d)
    largest = size * max(radius, half_height, *box, *np.abs(offset))
    assert met.depth == pytest.approx(size * depth, rel=1e-15, abs=1e-15 * largest)
    assert (met.normal == one_pose(*scaled, d).normal).all()
    if np.any(offset[:d]):
        opposite = one_pose(*scaled[:4], np.negative(scaled[4]), d)
        assert opposite.depth == met.depth


@both_dimensions
@pytest.mark.parametrize("height", [1.2, 1.25, 1.3])
def test_a_lying_capsule_touches_in_the_middle_of_what_it_shares_with_the_box(d, height):
    """Of a face, and in 3D also of an edge."""
    for x, middle in ((0.0, 0.0), (3.0, 3.0), (5.0, 4.5), (-5.5, -4.75), (0.5, 0.5)):
        met = one_pose(0.25, 1.0, ALONG, (5, 1, 5), (-x, -height, 0), d)
        assert met.normal == pytest.approx(np.array([0.0, -1.0, 0.0])[:d])
        assert met.point == pytest.approx(np.array([middle - x, -0.25 + (1.25 - height) / 2, 0.0])[:d])
    if d == 3:
        met = one_pose(0.25, 1.0, ALONG, (5, 1, 1), (-5.0, -1.1, 1.1), d)
        assert met.normal == pytest.approx(np.array([0.0, -1.0, 1.0]) / math.sqrt(2))
        assert met.point[0] == pytest.approx(-0.5)


@both_dimensions
def test_ties_follow_the_segment(d):
    """Half way through a plate it leaves towards its longer half; the opposite offset gives the opposite normal."""
    for x, sign in ((0.5, 1.0), (-0.5, -1.0)):
        for turn in (1, -1):
            met = one_pose(0.25, 2.0, (3 * turn, turn, 0), (9, 1, 9), (x, 0, 0), d)
            assert met.depth == pytest.approx(0.25 + 1 + 2 / math.sqrt(10))
            assert met.normal == pytest.approx(np.array([0.0, sign, 0.0])[:d])


@pytest.mark.parametrize("arguments", [(-0.1, 1.0), (0.1, -1.0), (math.nan, 1.0), ("x", 1.0)])
def test_wrong_sizes_are_named(arguments):
    with pytest.raises(ValueError, match=r"CapsuleCollider\.(radius|half_height)"):
        CapsuleCollider(*arguments)
