"""Sweeps in closed form (B13, B14, C15), and ten thousand random motions against the pairs' depth."""

from __future__ import annotations

import itertools
import math
from collections import namedtuple
from decimal import Decimal, localcontext
from functools import cache

import numpy as np
import pytest
from worlds import both_dimensions, box, make_world, registry

from carom.components import AABBCollider, SphereCollider
from carom.framework.plugins.laws import size_of
from carom.lab.plugins.kernels import PairCode
from carom.lab.plugins.samples import WIDTH, Rows, poses
from carom.plugins import capsule, half_space
from carom.plugins.capsule import CapsuleCollider, capsule_sphere_sweep
from carom.plugins.half_space import HalfSpaceCollider
from carom.plugins.standard_sweeps import box_box_sweep, sphere_box_sweep, sphere_sphere_sweep

Sphere = namedtuple("Sphere", "radius")
Box = namedtuple("Box", "half_extents")
Capsule = namedtuple("Capsule", "radius half_height axes")
EPS = float(np.finfo(float).eps)
MISS, AT_ONCE = (False, 0.0), (True, 0.0)
NOWHERE = 1e-300  # keeps tolerances above zero


def exact_time(d, v, reach):
    """When |d + t v| is first reach, for these exact floats, to 60 digits; infinite for never."""
    with localcontext() as context:
        context.prec = 60
        d, v, reach = [Decimal(x) for x in d], [Decimal(x) for x in v], Decimal(reach)
        way, along = sum(x * x for x in v), sum(x * y for x, y in zip(d, v, strict=True))
        rest = along * along - way * (sum(x * x for x in d) - reach * reach)
        return math.inf if rest < 0 or along >= 0 else float((-along - rest.sqrt()) / way)


def test_b13_radius_zero_is_a_ray():
    """Also against a wall without thickness, a point, along a face, and to a corner."""
    point, unit, wall = Sphere(0.0), Box((1.0, 1.0)), Box((0.0, 1.0))
    assert sphere_box_sweep(point, unit, (3.0, 0.0), (-4.0, 0.0)) == (True, 0.5)
    assert sphere_box_sweep(point, unit, (3.0, 3.0), (-4.0, -4.0)) == (True, 0.5)
    assert sphere_box_sweep(point, unit, (3.0, 1.0), (-4.0, 0.0)) == (True, 0.5)
    assert sphere_box_sweep(point, unit, (3.0, 1.0 + 1e-12), (-4.0, 0.0)) == MISS
    assert sphere_box_sweep(point, unit, (3.0, -1.0), (-4.0, 4.0)) == (True, 0.5)  # past the corner at (1, 1)
    assert sphere_box_sweep(point, unit, (3.0, -1.0 + 1e-12), (-4.0, 4.0)) == MISS
    assert sphere_box_sweep(point, wall, (3.0, 0.5), (-4.0, 0.0)) == (True, 0.75)
    assert sphere_box_sweep(point, wall, (3.0, 0.0), (0.0, 4.0)) == MISS
    assert sphere_box_sweep(point, wall, (0.0, 3.0), (0.0, -4.0)) == (True, 0.5)
    assert sphere_box_sweep(point, Box((0.0, 0.0)), (3.0, 1.5), (-6.0, -3.0)) == (True, 0.5)
    assert sphere_sphere_sweep(point, point, (3.0, 1.5), (-6.0, -3.0)) == (True, pytest.approx(0.5, rel=1e-15))
    assert sphere_sphere_sweep(point, point, (0.0, 0.0), (0.0, 0.0)) == AT_ONCE


@pytest.mark.parametrize("size", [0.1, 0.3, 1 / 3, 0.7])
def test_nothing_slips_through_the_seams_of_a_row_of_boxes(size):
    """Neither a ray nor a point box, on its way to the end of the seam between two boxes."""
    half, point = Box((0.5 * size, 0.5 * size)), Box((0.0, 0.0))
    for seam, high in itertools.product(range(40), (0.7, 3.0, 17.1)):
        way = (-2 * seam * size, -2 * high * size)
        pair = [((k + 0.5) * size, (high + 0.5) * size) for k in (seam - 1, seam)]
        assert any(sphere_box_sweep(Sphere(0.0), half, d, way)[0] for d in pair)
        assert any(box_box_sweep(point, half, d, way)[0] for d in pair)


@pytest.mark.parametrize("gap", [1e-15, 1e-12, 1e-6])
@pytest.mark.parametrize("v", [1.0, 3.0, 1e-150, 1e150])
def test_b14_nearly_touching(gap, v):
    """Along an axis only the rounding of the start is lost; obliquely, roundings of the distance."""
    start, way = 2.0 + gap, v * max(gap * 2, 1e-3)
    ratio = (start - 2.0) / way
    for shapes in ((Sphere(0.5), Sphere(1.5)), (Sphere(0.5), Box((1.5, 1.5))), (Box((0.5, 0.1)), Box((1.5, 0.2)))):
        sweep = {1: box_box_sweep, 0: sphere_box_sweep}[hasattr(shapes[0], "half_extents")]
        if isinstance(shapes[1], Sphere):
            sweep = sphere_sphere_sweep
        hit, time = sweep(*shapes, (start, 0.0), (-way, 0.0))
        if ratio > 1.0:
            assert (hit, time) == MISS
        else:
            assert hit
            assert time == pytest.approx(ratio, rel=4e-15)
    aslant, down = (0.6 * start, 0.8 * start), (0.0, -max(v, 1.0))
    hit, time = sphere_sphere_sweep(Sphere(0.5), Sphere(1.5), aslant, down)
    expected = exact_time(aslant, down, 2.0)
    assert hit
    assert time == pytest.approx(expected, abs=4 * EPS * 2.0 / 0.8 / -down[1])


@pytest.mark.parametrize("offset", [0.0, 0.3, 0.9, 1 - 1e-6])
@pytest.mark.parametrize("speed", [1e-150, 1e-9, 1.0, 1e9, 1e145])
def test_b14_far_starts_and_scales(offset, speed):
    """At 1e7 radii, lengths from 1e-150 to 1e150: the remaining digits of the coordinates, over the closing slope."""
    for d, v in (((1e7, offset), (-2e7, 0.0)), ((1e7, offset, 0.0), (-1.9e7, 0.0, 0.0)), ((6e6, 8e6), (-9e6, -1.2e7))):
        d, v, reach = [x * speed for x in d], [x * speed for x in v], speed
        expected = exact_time(d, v, reach)
        hit, time = sphere_sphere_sweep(Sphere(0.25 * reach), Sphere(0.75 * reach), tuple(d), tuple(v))
        assert hit
        assert time == pytest.approx(expected, abs=8 * EPS / math.sqrt(1 - offset * offset) + 4 * EPS)


@pytest.mark.parametrize("scale", [1e-154, 1e-150, 1e150, 1e153])
def test_extreme_ways(scale):
    """A negligible motion, or one that ends at once; and equally extreme sizes."""
    one, two = Sphere(1.0), Box((1.0, 1.0))
    for sweep, a, b in ((sphere_sphere_sweep, one, one), (sphere_box_sweep, one, two), (box_box_sweep, two, two)):
        hit, time = sweep(a, b, (3.0, 0.5), (-scale, 0.0))
        if scale < 1.0:
            assert (hit, time) == MISS
        else:
            still = sweep(a, b, (3.0, 0.5), (-4.0, 0.0))[1] * 4.0
            assert hit
            assert time * scale == pytest.approx(still, rel=1e-14)
        assert sweep(a, b, (3.0, 0.5), (scale, 0.0)) == MISS
        assert sweep(a, b, (1.0, 0.5), (scale, 0.0)) == AT_ONCE
    large, wide = Sphere(scale), Box((scale, scale))
    for sweep, a, b, c, e in (
        (sphere_sphere_sweep, one, one, large, large), (sphere_box_sweep, one, two, large, wide),
        (box_box_sweep, two, two, wide, wide),
    ):  # fmt: skip
        expected = sweep(a, b, (3.0, 2.5), (-3.0, -2.0))
        assert expected[0]
        hit, time = sweep(c, e, (3.0 * scale, 2.5 * scale), (-3.0 * scale, -2.0 * scale))
        assert hit
        assert time == pytest.approx(expected[1], rel=1e-14)


def test_boxes_by_face_edge_and_corner():
    one, wall, point = Box((1.0, 0.5)), Box((0.0, 2.0)), Box((0.0, 0.0, 0.0))
    assert box_box_sweep(one, one, (4.0, 0.0), (-4.0, 0.0)) == (True, 0.5)
    assert box_box_sweep(one, one, (4.0, 3.0), (-4.0, -4.0)) == (True, 0.5)  # corner to corner
    assert box_box_sweep(one, one, (4.0, 1.0), (-4.0, 0.0)) == (True, 0.5)  # along a side: touching counts
    assert box_box_sweep(one, one, (4.0, 1.0 + 1e-12), (-4.0, 0.0)) == MISS
    assert box_box_sweep(one, one, (4.0, -1.0), (-4.0, 4.0)) == (True, 0.5)  # corners that just touch in passing
    assert box_box_sweep(one, one, (4.0, -1.0 + 1e-12), (-4.0, 4.0)) == MISS
    assert box_box_sweep(one, one, (4.0, 0.0), (-2.0, 0.0)) == (True, 1.0)
    assert box_box_sweep(one, one, (4.0, 0.0), (-1.99, 0.0)) == MISS
    assert box_box_sweep(one, one, (2.0, 1.0), (1.0, 1.0)) == AT_ONCE  # touching, and parting
    assert box_box_sweep(one, one, (2.5, 0.0), (1.0, 0.0)) == MISS
    assert box_box_sweep(one, one, (2.5, 0.0), (0.0, 0.0)) == MISS
    assert box_box_sweep(wall, point, (1.0, 2.0), (-4.0, 0.0)) == (True, 0.25)
    assert box_box_sweep(point, point, (1.0, 2.0, -3.0), (-4.0, -8.0, 12.0)) == (True, 0.25)
    assert box_box_sweep(point, point, (1.0, 2.0, -3.0), (-4.0, -8.0, 11.0)) == MISS


@pytest.mark.slow
def test_finite_numbers_of_any_size_give_a_time():
    """Lengths from 1e-300 to 1e300, all in one call."""
    rng = np.random.default_rng(4)
    for _ in range(3000):
        numbers = [float(x) for x in rng.normal(size=11) * 10.0 ** rng.uniform(-300, 300, 11)]
        d, v, sizes = tuple(numbers[:3]), tuple(numbers[3:6]), [abs(x) for x in numbers[6:]]
        ball, other, block = Sphere(sizes[0]), Sphere(sizes[1]), Box(tuple(sizes[2:]))
        for hit, time in (
            sphere_sphere_sweep(ball, other, d, v),
            sphere_box_sweep(ball, block, d, v),
            box_box_sweep(block, block, d, v),
            capsule_sphere_sweep(Capsule(sizes[0], sizes[1], np.eye(3).tolist()), other, d, v),
        ):
            assert 0.0 <= time <= 1.0
            assert hit or time == 0.0


REGISTRY = registry(capsule.plugin, half_space.plugin)
PAIRS = [
    (SphereCollider, SphereCollider), (SphereCollider, AABBCollider), (AABBCollider, AABBCollider),
    (CapsuleCollider, SphereCollider), (HalfSpaceCollider, SphereCollider), (HalfSpaceCollider, AABBCollider),
    (HalfSpaceCollider, CapsuleCollider),
]  # fmt: skip
every_pair = pytest.mark.parametrize("pair", PAIRS, ids=lambda pair: "-".join(each.__name__[:-8] for each in pair))


@cache
def ways(pair, d):
    """(compiled pair, poses, displacements, hit, time): towards the other or anywhere, some slanted, some zero."""
    found = REGISTRY.pair(*pair)
    assert found is not None
    assert found.sweep is not None
    one, two = REGISTRY.shapes[found.first], REGISTRY.shapes[found.second]
    examples = np.random.default_rng(3).uniform(-1, 1, (1000, WIDTH))
    code, cases = PairCode(found, one, two, d), poses(one, two, d, examples)
    rng = np.random.default_rng(8)
    n = len(cases.d)
    sizes = (size_of(cases.a.half) + size_of(cases.b.half))[:, None]
    v = rng.uniform(-1.2, 1.2, (n, d)) * sizes - cases.d
    v *= rng.uniform(0.3, 3.0, (n, 1))
    v = np.where(rng.random((n, 1)) < 0.15, 3.0 * sizes * rng.normal(size=(n, d)), v)
    v[rng.random((n, d)) < 0.1] = 0.0
    v[rng.random(n) < 0.02] = 0.0
    v = np.ascontiguousarray(v)
    return code, cases, v, *code.sweep(cases.a, cases.b, cases.d, v)


def scale_of(cases, v):
    return np.linalg.norm(cases.d, axis=1) + size_of(cases.a.half) + size_of(cases.b.half) + np.linalg.norm(v, axis=1)


@both_dimensions
@every_pair
def test_they_touch_then_and_not_before(pair, d):
    code, cases, v, hit, time = ways(pair, d)
    scale = scale_of(cases, v)
    slack = 1e-12 * scale + NOWHERE
    start = code(cases.a, cases.b, cases.d)
    np.testing.assert_array_equal(hit & (time == 0.0) & start.hit, start.hit)
    assert ((time >= 0.0) & (time <= 1.0)).all()
    assert (time[~hit] == 0.0).all()
    later = hit & ~start.hit
    end = code(cases.a, cases.b, cases.d + time[:, None] * v)
    assert (np.abs(end.depth[later]) <= slack[later]).all(), np.abs(end.depth / scale)[later].max()
    until = np.where(hit, time, 1.0)
    for part in np.linspace(0.0, 1.0, 9, endpoint=False)[1:]:
        on_way = code(cases.a, cases.b, cases.d + (part * until)[:, None] * v).depth
        assert (on_way[~start.hit] <= slack[~start.hit]).all(), np.max((on_way / scale)[~start.hit])
    missed = ~hit
    last = code(cases.a, cases.b, cases.d + v).depth
    assert (last[missed] <= slack[missed]).all()
    assert later.sum() > 1000
    assert missed.sum() > 500


@pytest.mark.slow
@both_dimensions
@every_pair
def test_what_is_missed_is_missed_by_something(pair, d):
    """The least gap during the motion, by a ternary search: the gap of convex shapes is a convex function of time."""
    code, cases, v, hit, _ = ways(pair, d)
    slack = 1e-12 * scale_of(cases, v)
    low, high = np.zeros(len(v)), np.ones(len(v))
    for _ in range(60):
        one, two = low + (high - low) / 3, high - (high - low) / 3
        nearer = code(cases.a, cases.b, cases.d + one[:, None] * v).depth
        nearer = nearer >= code(cases.a, cases.b, cases.d + two[:, None] * v).depth
        low, high = np.where(nearer, low, one), np.where(nearer, two, high)
    least = code(cases.a, cases.b, cases.d + low[:, None] * v).depth
    assert (least <= slack)[~hit].all(), (least / slack)[~hit].max()


@both_dimensions
@pytest.mark.parametrize("pair", PAIRS[:3], ids=["spheres", "sphere-box", "boxes"])
def test_c22_mirrored_and_swapped_the_digits_stay(pair, d):
    """Mirrored along one axis; x and y exchanged in 2D; with exchanged roles for equal shapes."""
    code, cases, v, hit, time = ways(pair, d)
    mirror = np.ones(d)
    mirror[d - 1] = -1.0
    twins = [(cases.a, cases.b, cases.d * mirror, v * mirror)]
    if d == 2:
        twins.append((exchanged(cases.a), exchanged(cases.b), cases.d[:, ::-1], v[:, ::-1]))
    if pair[0] is pair[1]:
        twins.append((cases.b, cases.a, -cases.d, -v))
    for a, b, other_d, other_v in twins:
        hit_twin, time_twin = code.sweep(a, b, other_d, np.ascontiguousarray(other_v))
        np.testing.assert_array_equal(hit_twin, hit)
        np.testing.assert_array_equal(time_twin, time)


def exchanged(rows):
    """The same shapes with x and y exchanged."""
    arrays = {name: array[:, ::-1].copy() if array.ndim == 2 else array for name, array in rows.arrays.items()}
    return Rows(rows.shape, arrays, rows.axes, rows.half[:, ::-1])


@both_dimensions
def test_a_cast_that_slides_along_a_face_says_where_it_came_from(d):
    """At the touch, two directions are equally near; before it there is one."""
    world = make_world(d)
    box(world, (5.0, 0.0, 0.0)[:d], half=1.0, kind="static")
    for place, axis, face in (((5.0, -9.0), 1, -1.0), ((7.0, -9.0), 1, -1.0), ((0.0, 2.0), 0, 4.0)):
        way = np.eye(d)[axis]
        (hit,) = world.shape_cast(AABBCollider(np.ones(d)), (*place, 0.0)[:d], 30.0 * way)
        np.testing.assert_array_equal(hit.normal, -way)
        assert hit.distance == face - 1.0 - place[axis]
        assert hit.point[axis] == face
    world.close()
