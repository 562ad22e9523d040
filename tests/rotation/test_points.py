"""The points of a contact: against all corners of what two faces share, found by brute force, and laws."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from rotation.helpers_pair import MARGIN, TILT, Pair, matrix, product, rotation

from carom.components import AABBCollider, SphereCollider
from carom.plugins.capsule import CapsuleCollider
from carom.plugins.convex_hull import ConvexHullCollider
from carom.plugins.convex_polygon import ConvexPolygonCollider
from carom.plugins.half_space import HalfSpaceCollider
from carom.plugins.rotation import BoxCollider
from carom.plugins.tile_grid import TileGridCollider

pytestmark = pytest.mark.plain


# -- the oracle -----------------------------------------------------------------------------------


def plane_of(corners, across):
    """Height over the plane at right angles to the normal, as (gradient, height at the origin); of edges along them."""
    flat, height = corners @ across[:-1].T, corners @ across[-1]
    centre = flat.mean(axis=0)
    gradient = np.linalg.lstsq(flat - centre, height - height.mean(), rcond=1e-9)[0]
    return gradient, height.mean() - gradient @ centre


def hull(points):
    """In order around their middle."""
    way = points - points.mean(axis=0)
    return points[np.argsort(np.arctan2(way[:, 1], way[:, 0]))] if points.shape[1] == 2 else points


def holds(polygon, point, slack=1e-9):
    """Whether a convex polygon in a plane, an interval or an edge has a point."""
    if polygon.shape[1] == 1:
        return polygon.min() - slack <= point[0] <= polygon.max() + slack
    if len(polygon) == 2:
        way, at = polygon[1] - polygon[0], point - polygon[0]
        return abs(way[0] * at[1] - way[1] * at[0]) < slack and -slack <= way @ at <= way @ way + slack
    edges, ways = np.roll(polygon, -1, axis=0) - polygon, point - polygon
    return (edges[:, 0] * ways[:, 1] - edges[:, 1] * ways[:, 0] >= -slack).all()


def crossings(one, two):
    """Where edges of two polygons cross."""
    if one.shape[1] == 1:
        return
    for i, k in itertools.product(range(len(one)), range(len(two))):
        p, r, q, s = one[i], one[i - 1] - one[i], two[k], two[k - 1] - two[k]
        area = r[0] * s[1] - r[1] * s[0]
        if abs(area) > 1e-12:
            t = ((q - p)[0] * s[1] - (q - p)[1] * s[0]) / area
            yield p + t * r


def all_corners(normal, of_a, of_b, margin):
    """Every corner of what two faces share that is near enough, and the gap: the roundings are in the corners.

    A face is an array of corners, or the height of a plane without end.
    """
    across = np.vstack((np.linalg.svd(normal[None])[2][1:], normal))
    planes = [plane_of(face, across) if np.ndim(face) else (0.0, face) for face in (of_a, of_b)]
    flat = [hull(face @ across[:-1].T) if np.ndim(face) else None for face in (of_a, of_b)]
    candidates = [point for one in flat if one is not None for point in one]
    if flat[0] is not None and flat[1] is not None:
        candidates += crossings(*flat)
    found = []
    for point in candidates:
        if all(one is None or holds(one, point) for one in flat):
            top, bottom = (gradient @ point + height if np.ndim(gradient) else height for gradient, height in planes)
            found.append((*(across[:-1].T @ point + normal * (top + bottom) / 2), bottom - top))
    found = np.array(found)
    found = found[found[:, -1] <= margin + max(0.0, found[:, -1].min())]
    return np.array([row for k, row in enumerate(found) if not (np.abs(found[:k] - row).max(axis=1) < 1e-8).any()])


def area(points, normal):
    """Of the convex hull of points on a face; of two their distance."""
    if len(points) < 3:
        return np.ptp(points, axis=0).max()
    across = np.linalg.svd(normal[None])[2][1:]
    x, y = hull(points @ across.T).T
    return 0.5 * abs((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())


def flat_shapes(random, d):
    """Shapes that lie flat: (shape, turn that lays it flat, corners of its lower and upper face, rounding)."""
    half = random.uniform(0.3, 1.0, d)
    signs = np.array(list(itertools.product((-1, 1), repeat=d - 1)))
    box = [np.insert(signs * np.delete(half, 1), 1, side * half[1], axis=1) for side in (-1, 1)]
    yield BoxCollider(half), None, *box, 0.0
    yield AABBCollider(half), 0, *box, 0.0
    r, long = random.uniform(0.2, 0.6, 2)
    segment = np.array(((-long, *np.zeros(d - 1)), (long, *np.zeros(d - 1))))
    yield CapsuleCollider(r, long), -math.pi / 2, segment, segment, r
    if d == 2:
        (low, high, wide), h, r = random.uniform(0.3, 0.6, 3), random.uniform(0.3, 0.6), random.uniform(0, 0.2)
        corners = np.array(((-low, -h), (low, -h), (0.7 + wide, 0.1), (high, h), (-high, h), (-0.7 - wide, -0.1)))
        yield ConvexPolygonCollider(corners, corner_radius=r), None, corners[:2], corners[3:5], r


def turned(random, d, lay, tilt, yaw=True):
    """(rotation for a Transform, matrix for the corners of faces): a small tilt after any turn about the vertical."""
    if lay == 0:  # it never turns
        return (0.0 if d == 2 else (1.0, 0, 0, 0)), np.eye(d)
    if d == 2:
        angle = random.uniform(-tilt, tilt)
        c, s = math.cos(angle), math.sin(angle)
        return angle + (lay or 0), np.array(((c, -s), (s, c)))
    q = product(
        rotation(*random.uniform(-tilt, tilt, 3) * (1, 0, 1)),
        rotation(0, random.uniform(-math.pi, math.pi) if yaw else 0, 0),
    )
    return product(q, rotation(0, 0, lay or 0)), matrix(q)


# -- against it -----------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("seed", range(4))
def test_points_are_the_corners_of_what_two_faces_share(seed, d):
    """Of every two shapes that lie on each other, nearly flat; both ways round, and at any size."""
    random = np.random.default_rng(seed)
    size, tilt = (1.0, 1e-6, 1e6, 30.0)[seed], 0.3 * TILT
    lower = [(HalfSpaceCollider(np.eye(d)[1]), None, 0.0, 0.0, 0.0), *flat_shapes(random, d)]
    for (one, lay, _, top, up), (two, lay_two, bottom, _, down) in itertools.product(lower, flat_shapes(random, d)):
        if d == 3 and isinstance(one, CapsuleCollider) and isinstance(two, CapsuleCollider):
            continue  # they cross
        turns = turned(random, d, lay, tilt), turned(random, d, lay_two, tilt)
        angles, (turn_one, turn_two) = zip(*turns, strict=True)
        one, two = (scaled(shape, size) for shape in (one, two))
        with Pair(one, two, d, angles, MARGIN * size, TILT) as pair:
            way = np.array((random.uniform(-0.3, 0.3), 2.5, random.uniform(-0.3, 0.3))[:d]) * size
            way = pair.touching(way, random.uniform(-0.005, 0.01) * size)
            _, normal, places, gaps = pair.at(way)
            of_a = top @ turn_one.T + normal * up if np.ndim(top) else top
            expected = all_corners(normal, of_a, bottom @ turn_two.T + way / size - normal * down, MARGIN)
            found = np.column_stack((places, gaps)) / size
            distance = np.abs(found[:, None] - expected[None]).max(axis=2)
            assert distance.min(axis=1).max() < 1e-8, (one, two)
            assert gaps.min() / size == pytest.approx(expected[:, -1].min(), abs=1e-9)
            if len(expected) <= 2 * (d - 1):
                assert len(found) == len(expected), (one, two)
                assert distance.min(axis=0).max() < 1e-8, (one, two)
            else:
                assert len(found) == 4
                assert area(found[:, :-1], normal) > 0.5 * area(expected[:, :-1], normal)
            _, _, other_places, other_gaps = pair.at(way, swapped=True)
            other = np.column_stack((other_places, other_gaps)) / size
            assert len(other) == len(found)
            assert np.abs(other[:, None] - found[None]).max(axis=2).min(axis=1).max() < 1e-8


def scaled(shape, size):
    """The same shape, larger."""
    lengths = {"half_extents", "radius", "half_height", "vertices", "corner_radius"}
    return type(shape)(**{
        name: np.array(getattr(shape, name)) * size for name in type(shape).columns if name in lengths
    } if not isinstance(shape, HalfSpaceCollider) else {"normal": shape.normal})  # fmt: skip


# -- one by one -----------------------------------------------------------------------------------


def lying(d, angle):
    """A unit box turned by an angle about an axis that lies in the ground."""
    return angle if d == 2 else rotation(0, 0, angle)


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("floor", [HalfSpaceCollider, AABBCollider, BoxCollider])
def test_a_box_on_the_floor_stands_on_all_its_corners(floor, d):
    """With the same gap, off the floor or in it; tilted with other gaps; beyond the tilt on what is lowest."""
    up = np.eye(d)[1]
    ground, level = (floor(up), 0.0) if floor is HalfSpaceCollider else (floor(np.full(d, 5.0)), 5.0)
    for gap in (-0.01, 0.0, 0.01):
        with Pair(ground, BoxCollider(np.full(d, 0.5)), d, (None, lying(d, 0.0))) as pair:
            _, normal, places, gaps = pair.at((level + 0.5 + gap) * up)
            assert np.allclose(gaps, gap, atol=1e-14)
            assert np.allclose(normal, up)
            flat = {tuple(place.round(12)) for place in np.delete(places, 1, axis=1)}
            assert flat == set(itertools.product((-0.5, 0.5), repeat=d - 1)), places
    for angle, count in ((0.9 * TILT, 2 * (d - 1)), (1.5 * TILT, d - 1)):
        with Pair(ground, BoxCollider(np.full(d, 0.5)), d, (None, lying(d, angle)), margin=1.0) as pair:
            depth, _, places, gaps = pair.at((level + 0.55) * up)
            assert len(gaps) == count
            assert np.ptp(gaps) == pytest.approx(math.sin(angle) if angle < TILT else 0.0, abs=1e-12)
            assert gaps.min() == pytest.approx(-depth, abs=1e-14)


@pytest.mark.parametrize("d", [2, 3])
def test_what_has_no_face_there_touches_in_the_point_of_the_pair(d):
    """Balls, boxes on a corner, on a tile too, and edges that cross."""
    box, ball, up = BoxCollider(np.full(d, 0.5)), SphereCollider(0.4), np.eye(d)[1]
    corner, other = (0.6, 0.25) if d == 2 else (rotation(0.5, 0.2, 0.6), rotation(0.1, 0.9, 0.4))
    pairs = [(box, ball, None, None), (ball, ball, None, None), (box, box, None, corner), (box, box, corner, other)]
    if d == 2:
        pairs.append((TileGridCollider([[1]], 1.0), box, None, corner))
    else:
        capsules = CapsuleCollider(0.2, 1.0), CapsuleCollider(0.3, 1.0)
        edge = rotation(0, 0, math.pi / 4)
        pairs.append((*capsules, rotation(0, 0, math.pi / 2), rotation(math.pi / 2, 0, 0)))
        pairs.append((box, box, edge, product(rotation(0, math.pi / 2, 0), edge)))
        pairs.append((box, capsules[0], edge, rotation(math.pi / 2 - 0.4, 0, 0)))
    for one, two, turn_one, turn_two in pairs:
        with Pair(one, two, d, (turn_one, turn_two)) as pair:
            way = pair.touching(2.0 * up)
            depth, _, places, gaps = pair.at(way)
            assert len(gaps) == 1, (one, two)
            assert gaps[0] == -depth
            assert np.abs(places[0]).max() < 1.5


@pytest.mark.parametrize(("turn", "count"), [(0.0, 1), (0.5, 2)])
def test_a_polygon_of_many_edges_lies_on_one_of_them_or_on_a_corner(turn, count):
    """Though several are within the tilt: what rolls on them is held by none that is not on the ground yet."""
    edge = 2 * math.pi / 400
    wheel = ConvexPolygonCollider.regular(400, 1.0)
    with Pair(HalfSpaceCollider((0, 1)), wheel, 2, (None, -math.pi / 2 + turn * edge)) as pair:
        depth, _, places, gaps = pair.at((0, 0.999))
        assert np.allclose(gaps, -depth, atol=1e-12)
        assert np.allclose(sorted(places[:, 0]), [0.0] if count == 1 else (-0.5 * edge, 0.5 * edge), atol=1e-6)


@pytest.mark.parametrize("angle", [0.0, 0.001, 0.01])
def test_a_hull_lies_on_its_lowest_face_though_the_next_one_is_within_the_tilt(angle):
    """It touches in the corners of that face, with the gaps of these, while it is nearer to level than the next."""
    square = np.array(list(itertools.product((-0.5, 0.5), (0.0,), (-0.5, 0.5))))
    next_one = [(1.0, 0.5 * math.tan(0.03), z) for z in (-0.5, 0.5)]
    rock = ConvexHullCollider([*square, *next_one, (0.0, 0.8, 0.0)])
    turn = rotation(0.0, 0.0, -angle)
    with Pair(HalfSpaceCollider((0, 1, 0)), rock, 3, (None, turn)) as pair:
        _, _, places, gaps = pair.at((0, 0.001, 0))
        expected = square @ matrix(turn).T + (0, 0.001, 0)
        assert len(places) == 4
        for corner in expected:
            away = np.abs(places - corner * (1, 0.5, 1)).max(axis=1)
            assert away.min() < 1e-12
            assert gaps[away.argmin()] == pytest.approx(corner[1], abs=1e-12)


def test_edges_lie_on_faces_and_along_each_other_in_two_points():
    """In 3D: a box on its edge, and capsules beside each other, level, askew by little, and by more."""
    edge, level = rotation(0, 0, math.pi / 4), rotation(0, 0, math.pi / 2)
    box, capsule_, up = BoxCollider((0.5, 0.5, 0.5)), CapsuleCollider(0.2, 1.0), np.eye(3)[1]
    with Pair(box, box, 3, (None, edge)) as pair:
        _, _, places, gaps = pair.at(pair.touching(1.3 * up + (0.1, 0, 0.2)))
        assert np.allclose(sorted(places[:, 2]), (-0.3, 0.5))
        assert np.allclose(gaps, 0, atol=1e-12)
        assert np.allclose(places[:, :2], (0.1, 0.5))
    for askew, count in ((0.0, 2), (0.01, 2), (0.04, 2), (0.06, 1), (0.5, 1)):
        with Pair(capsule_, capsule_, 3, (level, product(rotation(0, askew, 0), level))) as pair:
            _, _, places, gaps = pair.at(pair.touching(0.5 * up + (0.5, 0, 0)))
            assert len(gaps) == count
            if count == 2:
                assert np.ptp(places[:, 0]) == pytest.approx(1.5, abs=0.01)
                aside = askew * np.abs(places[:, 0] - 0.5).max()  # from where they cross to the farther end
                assert gaps.max() == pytest.approx(0.4 - math.sqrt(0.16 - aside**2), rel=0.01, abs=1e-12)


@pytest.mark.compiled
def test_points_keep_their_order_while_a_box_turns():
    """On the ground, through a whole turn in small steps: the same place in the list, but for a few starts anew."""
    places, jumps = None, 0
    with Pair(HalfSpaceCollider((0, 1, 0)), BoxCollider((0.5, 0.5, 0.7)), 3, (None, rotation(0, 0, 0))) as pair:
        for step in range(200):
            pair.world.bodies.rotation[:] = rotation(0.01, step * math.pi / 100, 0.0)
            pair.world.step()
            _, _, now, _ = pair.at((0, 0.5, 0))
            assert len(now) == 4
            jumps += places is not None and np.abs(now - places).max() > 0.1
            places = now
    assert jumps <= 8
