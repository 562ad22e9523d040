"""The generic pair of convex shapes against closed forms, brute force over features, and the definition of depth."""

from __future__ import annotations

import itertools
import math
from collections import namedtuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import convex_brute
from worlds import both_dimensions

from carom.framework.compilation import inlined, kernel
from carom.framework.vectors import dot, item, replace, row, scale, store
from carom.systems.shapes.convex.pair import convex_convex

pytestmark = pytest.mark.slow  # its shapes take long to compile

# A core is the sum of a hull of points and an ellipsoid along the axes, so that one support serves all the tests.
Shape = namedtuple("Shape", "points semi_axes radii row")
COUNT = 10_000
EPS = 1e-13  # of the coordinates; measured 3e-15


@inlined
def support(shape, direction):
    best, farthest = direction, -math.inf
    for k in range(shape.points.shape[1]):
        point = direction
        for m in range(len(direction)):
            point = replace(point, m, shape.points[shape.row, k, m])
        along = dot(point, direction)
        if along > farthest:
            best, farthest = point, along
    squares, bulge = direction, 0.0
    for m in range(len(direction)):
        part = shape.semi_axes[shape.row, m] * item(direction, m)
        squares = replace(squares, m, part)
        bulge = max(bulge, abs(part))
    if bulge > 0.0:
        squares = scale(squares, 1.0 / bulge)
        size = math.sqrt(dot(squares, squares))
        for m in range(len(direction)):
            along = shape.semi_axes[shape.row, m] * item(squares, m) / size
            best = replace(best, m, item(best, m) + along)
    return best


@inlined
def rounding(shape):
    return shape.radii[shape.row]


@kernel
def meet_all(a, b, offsets, hits, depths, normals, points, like):
    for i in range(len(offsets)):
        one, two = Shape(a.points, a.semi_axes, a.radii, i), Shape(b.points, b.semi_axes, b.radii, i)
        d = row(offsets, i, like)
        hits[i], depths[i], normal, point = convex_convex(one, two, d, support, support, rounding, rounding)
        store(normals, i, normal)
        store(points, i, point)


Met = namedtuple("Met", "hit depth normal point")


def shapes(points, radii=0.0, semi_axes=0.0):
    points = np.ascontiguousarray(np.asarray(points, float))
    n, d = len(points), points.shape[2]
    filled = np.zeros((n, d)) + semi_axes, np.zeros(n) + radii
    return Shape(points, *filled, 0)


def meet(a, b, offsets):
    offsets = np.ascontiguousarray(np.asarray(offsets, float))
    n, d = offsets.shape
    met = Met(np.zeros(n, bool), np.zeros(n), np.zeros((n, d)), np.zeros((n, d)))
    meet_all(a, b, offsets, *met, (0.0,) * d)
    assert np.isfinite(met.depth).all()
    assert np.isfinite(met.point).all()
    assert abs(np.linalg.norm(met.normal, axis=1) - 1).max() < 1e-12
    assert (met.hit == (met.depth >= 0)).all()
    return met


def meet_one(a, b, offset, radius_a=0.0, radius_b=0.0, axes_a=0.0, axes_b=0.0):
    """The same for one pose; a, b: lists of points."""
    met = meet(shapes([a], radius_a, axes_a), shapes([b], radius_b, axes_b), [offset])
    return Met(*(values[0] for values in met))


def box_corners(half_extents):
    half_extents = np.asarray(half_extents, float)
    d = half_extents.shape[-1]
    return half_extents[..., None, :] * np.array(list(itertools.product((-1.0, 1.0), repeat=d)))


def turned(rng, points):
    n, _, d = points.shape
    return points @ np.linalg.qr(rng.normal(size=(n, d, d)))[0]


FAMILIES = {
    "box": lambda rng, n, d: turned(rng, box_corners(rng.uniform(0.1, 1, (n, d)))),
    "plate": lambda rng, n, d: turned(rng, box_corners(rng.uniform(0.1, 1, (n, d)) * (np.arange(d) > 0))),
    "hull": lambda rng, n, d: rng.normal(size=(n, d + 2 if d == 2 else d + 1, d)),
    "segment": lambda rng, n, d: rng.normal(size=(n, 2, d)),
    "point": lambda rng, n, d: rng.normal(size=(n, 1, d)) * 0.1,
}


def check_against_brute_force(a, b, offsets, eps=EPS):
    met = meet(a, b, offsets)
    rounded = a.radii + b.radii
    size = np.maximum(np.maximum(abs(a.points).max((1, 2)), abs(b.points).max((1, 2))), abs(offsets).max(1))
    moved = b.points + offsets[:, None]
    depth, way = convex_brute.meet(a.points, moved)
    core = met.depth - rounded
    slack = size + rounded
    assert (abs(core - depth) / slack).max() < eps
    # The direction is as accurate as the depth: the overlap along it is the depth. If corners or edges nearly touch,
    # it depends on the rounding of their distance.
    tilt = np.where(core < 0, 1e-14 * size / np.maximum(abs(core), 1e-300), 0)
    along = convex_brute.overlap_along(a.points, moved, met.normal)
    assert (abs(along - core) / size - tilt).max() < eps
    apart = depth < 0
    error = np.linalg.norm(met.normal + way / np.where(apart, depth, 1)[:, None], axis=1)
    # At 1e12 sizes the brute force cannot find the nearest points: their distances are the same double.
    assert (error * -depth / slack)[apart].max(initial=0) < max(eps, 1e-11)
    level = np.einsum("nvd,nd->nv", a.points, met.normal).max(1) + a.radii - met.depth / 2
    assert (abs(np.einsum("nd,nd->n", met.point, met.normal) - level) / slack - tilt).max() < eps
    swapped = meet(b, a, -offsets)
    assert (abs(met.depth - swapped.depth) / slack).max() < eps
    assert (np.linalg.norm(met.normal + swapped.normal, axis=1) * abs(depth) / slack)[apart].max(initial=0) < eps
    return met


ALWAYS = {  # the other pairs wait for the long run
    ("box", "box"), ("hull", "segment"), ("box", "plate"), ("hull", "hull"), ("segment", "segment"), ("plate", "point"),
}  # fmt: skip


def pairs_of_families(d):
    return [pair for pair in itertools.combinations_with_replacement(FAMILIES, 2) if set(pair) != {"point"}]


@pytest.mark.parametrize(("d", "first", "second"), [
    pytest.param(d, *pair, marks=[pytest.mark.long] * (pair not in ALWAYS))
    for d in (2, 3) for pair in pairs_of_families(d)
])  # fmt: skip
def test_hulls_meet_as_brute_force_finds(d, first, second):
    rng = np.random.default_rng(1)
    solid = {"box", "plate"}
    n = COUNT // 5 if d == 3 else COUNT
    if d == 3 and {first, second} <= solid:
        n //= 10
    a = shapes(FAMILIES[first](rng, n, d), rng.choice([0, 0.5], n))
    b = shapes(FAMILIES[second](rng, n, d), rng.choice([0, 0.1], n))
    offsets = rng.normal(size=(n, d)) * rng.choice([0.01, 0.3, 1, 3, 1e12], (n, 1))
    met = check_against_brute_force(a, b, offsets)
    # The same poses, moved until the cores are about to touch.
    near = rng.choice([0, 1e-15, -1e-15, 1e-13, -1e-13, 1e-10, -1e-10, 1e-7, -1e-7], n)
    keep = abs(offsets).max(1) < 1e6
    moved = offsets + met.normal * (met.depth - a.radii - b.radii - near)[:, None]
    kept = [Shape(*(values[keep] for values in shape[:3]), 0) for shape in (a, b)]
    check_against_brute_force(*kept, moved[keep])


@both_dimensions
@pytest.mark.parametrize("kind", ["hull", "segment"])
def test_any_scale_serves(d, kind):
    rng = np.random.default_rng(2)
    n = COUNT // 10
    a, b = FAMILIES[kind](rng, n, d), FAMILIES[kind](rng, n, d)
    offsets = rng.normal(size=(n, d)) * 0.5
    units = 10.0 ** rng.uniform(-9, 9, (n, 1, 1))
    check_against_brute_force(shapes(a * units), shapes(b * units), offsets * units[:, 0])
    ratios = 10.0 ** rng.uniform(-12, 0, (n, 1, 1))
    met = check_against_brute_force(shapes(a), shapes(b * ratios), offsets)
    # A small shape at the surface of a large one: the error is that of the large one's coordinates.
    moved = offsets + met.normal * (met.depth + 0.5 * ratios[:, 0, 0] * rng.uniform(-1, 1, n))[:, None]
    small = meet(shapes(a), shapes(b * ratios), moved)
    depth, _ = convex_brute.meet(a, b * ratios + moved[:, None])
    size = np.maximum(abs(a).max((1, 2)), abs(moved).max(1))
    assert (abs(small.depth - depth) / size).max() < 1e-10


@both_dimensions
def test_scaling_by_powers_of_two_changes_nothing_else(d):
    rng = np.random.default_rng(3)
    a, b = rng.normal(size=(2, 200, d + 1, d))
    offsets = rng.normal(size=(200, d))
    met = meet(shapes(a), shapes(b), offsets)
    for exponent in (-30, 30):
        unit = 2.0**exponent
        other = meet(shapes(a * unit), shapes(b * unit), offsets * unit)
        assert (other.depth == met.depth * unit).all()
        assert (other.normal == met.normal).all()
        assert (other.point == met.point * unit).all()
    for unit in (1e-200, 1e-100, 1e100, 1e200):  # where squares vanish or overflow
        other = meet(shapes(a * unit), shapes(b * unit), offsets * unit)
        np.testing.assert_allclose(other.depth / unit, met.depth, atol=1e-13)
        np.testing.assert_allclose(other.normal, met.normal, atol=1e-10)
        np.testing.assert_allclose(other.point / unit, met.point, atol=1e-10)


@both_dimensions
def test_coincident_centres_and_cores_without_extent(d):
    zero, x = [0.0] * d, [1.0] + [0.0] * (d - 1)
    y = [0.0, 1.0] + [0.0] * (d - 2)
    met = meet_one([zero], [zero], zero, 1.0, 2.0)
    assert met.depth == 3.0
    assert (met.normal == x).all()
    assert (met.point == np.multiply(x, -0.5)).all()
    assert meet_one([zero], [zero], zero).depth == 0.0
    assert meet_one([zero], [zero], np.multiply(x, 1e-200), 1.0, 1.0).depth == 2.0
    cube = box_corners(np.ones(d))
    met = meet_one(cube, cube, zero)
    assert met.depth == 2.0
    assert abs(met.normal).max() == 1.0
    flat = box_corners(np.array(y))  # a segment, as a box
    assert meet_one(flat, flat, zero).depth == 0.0
    assert meet_one(box_corners(np.zeros(d)), cube, np.multiply(x, 0.75)).depth == 0.25
    # Two capsules on one line, overlapping side by side, and end to end.
    for offset, depth in ((0.0, 0.75), (1.5, 0.75), (2.0, 0.75), (2.5, 0.25)):
        met = meet_one([negated(y), y], [negated(y), y], np.multiply(y, offset), 0.5, 0.25)
        assert met.depth == depth
        if offset < 2.0:
            assert abs(met.normal @ y) < 1e-12


def negated(vector):
    return [-x for x in vector]


@both_dimensions
def test_touching_exactly_is_a_hit(d):
    cube = box_corners(np.full(d, 0.5))
    for axis, sign in itertools.product(range(d), (-1.0, 1.0)):
        offset = np.zeros(d)
        offset[axis] = sign
        met = meet_one(cube, cube, offset)
        assert met.hit
        assert met.depth == 0.0
        assert (met.normal == offset).all()
        met = meet_one(cube, [[0.0] * d], 0.75 * offset, 0.0, 0.25)
        assert met.hit
        assert met.depth == 0.0
        assert (met.normal == offset).all()
    assert meet_one(cube, cube, np.ones(d)).depth == 0.0  # corner to corner


@pytest.mark.parametrize("tilt", [0.0, 1e-9, -1e-9, 1e-15])
@pytest.mark.parametrize("gap", [0.01, 0.0, -0.01])
def test_edges_on_each_other_touch_in_the_middle_of_what_they_share(tilt, gap):
    ground, crate = box_corners(np.array([5.0, 0.5])), box_corners(np.array([0.5, 0.5]))
    crate = crate @ np.array([[math.cos(tilt), math.sin(tilt)], [-math.sin(tilt), math.cos(tilt)]])
    for x, middle in ((0.0, 0.0), (3.0, 3.0), (5.0, 4.75), (-5.25, -4.875)):
        met = meet_one(ground, crate, (x, 1.0 + gap))
        assert abs(met.depth + gap) < 1e-8
        np.testing.assert_allclose(met.point, (middle, 0.5 + gap / 2), atol=1e-8)
        np.testing.assert_allclose(met.normal, (0.0, 1.0), atol=1e-8)


@both_dimensions
@pytest.mark.parametrize("aspect", [1.0, 3.0, 100.0])
def test_smooth_cores_meet_within_a_millionth(d, aspect):
    rng = np.random.default_rng(7)
    n = 12
    semi_a, semi_b = aspect ** rng.uniform(-1, 0, (2, n, d))
    hull = rng.normal(size=(n, 3, d)) * rng.choice([0, 0.3], (n, 1, 1))
    offsets = rng.normal(size=(n, d)) * rng.choice([0.1, 0.5, 1.5], (n, 1))
    met = meet(shapes(hull, 0.0, semi_a), shapes(np.zeros((n, 1, d)), 0.1, semi_b), offsets)
    for i in range(n):

        def overlap(units, i=i):
            return (
                (units @ hull[i].T).max(1) + np.linalg.norm(units * semi_a[i], axis=1)
                + np.linalg.norm(units * semi_b[i], axis=1) + 0.1 - units @ offsets[i]
            )  # fmt: skip

        assert abs(overlap(met.normal[i][None])[0] - met.depth[i]) < 1e-6
        assert abs(convex_brute.least_overlap(overlap, d) - met.depth[i]) < 1e-6


grid = st.integers(-2, 2).map(float)


@both_dimensions
@settings(max_examples=150, deadline=None)
@given(data=st.data())
def test_hulls_on_a_grid_part_along_the_normal_and_nowhere_sooner(d, data):
    """Collinear, coplanar and coincident points, parallel edges and faces, exact touches."""
    vector = st.tuples(*[grid] * d)
    a, b = (data.draw(st.lists(vector, min_size=1, max_size=5)) for _ in range(2))
    offset = data.draw(vector)
    met = meet_one(pad(a), pad(b), offset)
    moved = np.array(b) + offset

    def overlap(units):
        return (units @ np.array(a).T).max(1) - (units @ moved.T).min(1)

    assert abs(overlap(met.normal[None])[0] - met.depth) < 1e-13
    assert met.depth <= overlap(DIRECTIONS[d]).min() + 1e-13
    other = meet_one(pad(b), pad(a), np.multiply(offset, -1.0))
    assert abs(met.depth - other.depth) < 1e-13


def pad(points):
    return [*points, *[points[0]] * (5 - len(points))]


def grid_directions(d):
    """All normals that edges and faces on the grid may have, about."""
    found = np.array([v for v in itertools.product(range(-6, 7), repeat=d) if any(v)], float)
    return found / np.linalg.norm(found, axis=1, keepdims=True)


DIRECTIONS = {d: grid_directions(d) for d in (2, 3)}


def least_depth(axes, offsets):
    """Of ellipsoids with these semi-axes (2, n, 3): descent from both ends of each axis, an upper bound."""
    least = np.full(len(offsets), np.inf)
    for end in np.vstack([np.eye(3), -np.eye(3)]):
        way = np.tile(end + 1e-3, (len(offsets), 1))
        for _ in range(400):
            way /= np.linalg.norm(way, axis=1, keepdims=True)
            point = sum(a * a * way / np.linalg.norm(a * way, axis=1, keepdims=True) for a in axes) - offsets
            depth = (way * point).sum(axis=1)
            least = np.minimum(least, depth)
            way = way - 0.4 * (point - depth[:, None] * way)
    return least


@pytest.mark.parametrize("seed", range(2))
def test_ellipsoids_at_one_place_leave_each_other_on_the_shortest_way(seed):
    """They have several ways out that are nearly as short as each other."""
    random, count = np.random.default_rng(seed), 1000
    axes = np.exp(random.uniform(np.log(0.2), 0.0, (2, count, 3)))
    offsets = random.normal(size=(count, 3)) * 10 ** random.uniform(-6, -1, (count, 1))
    a, b = (shapes(np.zeros((count, 1, 3)), semi_axes=each) for each in axes)
    assert (meet(a, b, offsets).depth - least_depth(axes, offsets)).max() <= 2e-6


@pytest.mark.parametrize("seed", range(3))
def test_a_ball_leaves_a_cylinder_through_its_side_or_a_face_whichever_is_nearer(seed):
    """The depth has a kink all around the side, in which it changes little."""
    random, count = np.random.default_rng(seed), 2000
    radius, height, ball = np.exp(random.uniform(np.log(0.1), 0.0, (3, count)))
    centres = random.normal(size=(count, 3)) * 10 ** random.uniform(-9, -1, (count, 1))
    centres *= random.integers(0, 2, (count, 3))
    ends = np.array([[0, -1, 0], [0, 1, 0]]) * height[:, None, None]
    cylinder = shapes(ends, semi_axes=np.stack((radius, 0 * radius, radius), axis=1))
    met = meet(cylinder, shapes(np.zeros((count, 1, 3)), radii=ball), centres)
    inside = np.minimum(radius - np.hypot(centres[:, 0], centres[:, 2]), height - np.abs(centres[:, 1]))
    off = np.abs(met.depth - ball - inside) / (radius + height + ball)
    assert (inside > 0).sum() > 1500
    assert (off[inside > 0] > 2e-6).mean() <= 1 / 200  # of depths that round shapes seldom have
    assert off[inside > 0].max() < 1e-4
    assert (np.linalg.norm(met.point - centres, axis=1) <= np.abs(met.depth) + 2e-6)[inside > 0].all()


@both_dimensions
def test_a_smooth_ball_around_a_box_leaves_it_along_an_axis(d):
    """Half an edge and the radius, less how far its middle is off along that axis: the depth has a kink there, and such
    a minimum for each face."""
    random, count = np.random.default_rng(d), 1000
    half, radius = np.exp(random.uniform(np.log(0.01), 0.0, (2, count)))
    corners = np.array(list(itertools.product((-1.0, 1.0), repeat=d)))
    offsets = random.normal(size=(count, d)) * half[:, None] * 10 ** random.uniform(-9, -1, (count, 1))
    box = shapes(half[:, None, None] * corners)
    ball = shapes(np.zeros((count, 1, d)), semi_axes=np.tile(radius[:, None], d))
    wanted, scale_of = half + radius - np.abs(offsets).max(axis=1), half + radius
    assert (np.abs(meet(box, ball, offsets).depth - wanted) / scale_of).max() <= 1e-8
