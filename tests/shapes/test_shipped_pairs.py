"""Every shipped convex pair: the normal attains the depth, no other direction of many gives more distance, and the
point lies between the two."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from worlds import registry

from carom.components import AABBCollider, SphereCollider
from carom.framework.plugins.laws import size_of
from carom.lab.plugins.kernels import PairCode
from carom.lab.plugins.samples import WIDTH, Poses, Rows, poses
from carom.plugins import capsule, convex_hull, convex_polygon, half_space
from carom.plugins.capsule import CapsuleCollider
from carom.plugins.convex_hull import FIRST, ConvexHullCollider
from carom.plugins.convex_polygon import ConvexPolygonCollider
from carom.plugins.half_space import HalfSpaceCollider
from carom.plugins.rotation.box_pairs import BoxCollider, boxes

SHAPES = (
    AABBCollider, BoxCollider, CapsuleCollider, ConvexHullCollider, ConvexPolygonCollider, HalfSpaceCollider,
    SphereCollider,
)  # fmt: skip
DIRECTIONS = 24  # per pose: half of them anywhere, half near the normal
ROUNDING = 1e-12  # of distance and sizes


REGISTRY = registry(boxes, capsule.plugin, convex_hull.plugin, convex_polygon.plugin, half_space.plugin)
PAIRS = [
    (first, second, d)
    for first, second in itertools.combinations_with_replacement(SHAPES, 2)
    for d in sorted(set(first.dimensions) & set(second.dimensions))
    if not first is second is HalfSpaceCollider
]


def turned(rows: Rows, vectors: np.ndarray) -> np.ndarray:
    """The bodies' own vectors (n, d) in world axes."""
    return np.einsum("pij,pj->pi", rows.axes, vectors)


def reach(rows: Rows, n: np.ndarray) -> np.ndarray:
    """(poses, directions): extent of each shape from its centre along n (poses, directions, d)."""
    arrays = rows.arrays
    component = rows.shape.component
    if component is SphereCollider:
        return np.broadcast_to(arrays["radius"][:, None], n.shape[:2])
    if component is AABBCollider:
        return np.einsum("pkd,pd->pk", np.abs(n), arrays["half_extents"])
    if component is BoxCollider:
        along = np.abs(np.einsum("pkd,pdj->pkj", n, rows.axes))
        return np.einsum("pkj,pj->pk", along, arrays["half_extents"])
    if component is CapsuleCollider:
        along = np.abs(np.einsum("pkd,pd->pk", n, rows.axes[:, :, 1]))
        return along * arrays["half_height"][:, None] + arrays["radius"][:, None]
    name, first = ("hull", FIRST) if component is ConvexHullCollider else ("vertices", 0)
    result = np.empty(n.shape[:2])
    for number in np.unique(arrays[name]):
        those = arrays[name] == number
        corners = np.einsum("pij,cj->pci", rows.axes[those], component.columns[name].shown(number)[first:])
        result[those] = np.einsum("pkd,pcd->pkc", n[those], corners).max(axis=2)
    return result + (arrays["corner_radius"][:, None] if component is ConvexPolygonCollider else 0.0)


def gap(cases: Poses, n: np.ndarray) -> np.ndarray:
    """(poses, directions): gap of the two along n."""
    return np.einsum("pkd,pd->pk", n, cases.d) - reach(cases.a, n) - reach(cases.b, -n)


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


@pytest.mark.slow
@pytest.mark.parametrize(("first", "second", "d"), PAIRS)
def test_depth_and_normal_of(first, second, d):
    pair = REGISTRY.pair(first, second)
    assert pair is not None
    first, second = pair.first, pair.second
    examples = np.random.default_rng(5).uniform(-1, 1, (400, WIDTH))
    cases = poses(REGISTRY.shapes[first], REGISTRY.shapes[second], d, examples)
    found = PairCode(pair, REGISTRY.shapes[first], REGISTRY.shapes[second], d)(cases.a, cases.b, cases.d)
    scale = np.linalg.norm(cases.d, axis=1) + size_of(cases.a.half) + size_of(cases.b.half)
    allowed = ROUNDING * scale
    if first is second is CapsuleCollider:  # far from the centres rounding turns the normal of segments that are close
        apart = np.abs(cases.a.arrays["radius"] + cases.b.arrays["radius"] - found.depth)
        allowed = allowed + np.finfo(float).eps * scale**2 / np.maximum(apart, np.finfo(float).tiny)
    np.testing.assert_allclose(np.linalg.norm(found.normal, axis=1), 1.0, rtol=0, atol=1e-12)
    assert (found.hit == (found.depth >= 0.0)).all()
    if HalfSpaceCollider in (first, second):  # only its own direction counts
        plane, other, sign = (cases.a, cases.b, 1.0) if first is HalfSpaceCollider else (cases.b, cases.a, -1.0)
        normal = unit(turned(plane, plane.arrays["normal"]))
        height = np.einsum("pd,pd->p", sign * cases.d, normal) - reach(other, -normal[:, None])[:, 0]
        np.testing.assert_allclose(found.normal, sign * normal, rtol=0, atol=1e-12)
        np.testing.assert_array_less(np.abs(-found.depth - height), allowed + 1e-300)
        middle = sign * np.einsum("pd,pd->p", found.point - (0.0 if sign > 0.0 else cases.d), normal)
        np.testing.assert_array_less(np.abs(middle + 0.5 * sign * found.depth), allowed + 1e-300)
        return
    attained = gap(cases, found.normal[:, None])[:, 0]
    worst = np.argmax(np.abs(attained + found.depth) - allowed)
    assert (np.abs(attained + found.depth) <= allowed).all(), (worst, attained[worst], found.depth[worst])
    rng = np.random.default_rng(6)
    noise = rng.normal(size=(len(cases.d), DIRECTIONS, d))
    width = 10.0 ** rng.uniform(-6, 0, (len(cases.d), DIRECTIONS // 2, 1))
    near = found.normal[:, None] + width * noise[:, : DIRECTIONS // 2]
    tries = unit(np.concatenate((near, noise[:, DIRECTIONS // 2 :]), axis=1))
    tried = gap(cases, tries).max(axis=1)
    if first is second is AABBCollider:  # apart, their depth is the gap along one axis: less than the distance
        tried = np.where(found.hit, tried, attained)
    worst = np.argmax(tried + found.depth - allowed)
    assert (tried <= -found.depth + allowed).all(), (worst, tried[worst], found.depth[worst])
    if not {first, second} <= {AABBCollider, SphereCollider}:  # theirs lies on a face, or in the middle of the overlap
        middle = reach(cases.a, found.normal[:, None])[:, 0] - 0.5 * found.depth
        off = np.abs(np.einsum("pd,pd->p", found.normal, found.point) - middle) - allowed
        if first is second is CapsuleCollider:  # whose segments cross: near there
            off -= np.where(found.depth > cases.a.arrays["radius"] + cases.b.arrays["radius"], found.depth, 0.0)
        assert (off <= 0.0).all(), (np.argmax(off), off.max())
    for rows, place in ((cases.a, found.point), (cases.b, found.point - cases.d)):  # beside none of them
        out = np.einsum("pkd,pd->pk", tries, place) - reach(rows, tries) - (np.abs(found.depth) + allowed)[:, None]
        assert (out <= 0.0).all(), (np.argmax(out.max(axis=1)), out.max())
    assert found.hit.any()
    assert not found.hit.all()
