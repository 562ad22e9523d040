"""Linked functions of shapes against the plugins' own functions, which run as plain Python and give the same bits."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers_linked_shapes import (
    KERNELS,
    PLUGINS_2D,
    SHIPPED,
    Scene,
    all_pairs,
    apart,
    attempt,
    blob_class,
    endless_bounds,
    failing_plugin,
    late,
    not_a_number,
    raising,
    registry_of,
    same,
    vector,
)
from numba.core.errors import NumbaError

from carom.components import AABBCollider, SphereCollider
from carom.framework.errors import PluginError
from carom.framework.jit.records.record import make_record
from carom.framework.plugins.plugin import Plugin
from carom.plugins.one_way_segment import OneWaySegmentCollider
from carom.plugins.standard_shapes import standard_shapes
from carom.plugins.tile_grid import TileGridCollider
from carom.systems.records import STATE
from carom.systems.shapes.attribution import ErrorAttribution
from carom.systems.shapes.linking import source
from carom.systems.shapes.linking.linked_shape import half_extents_of
from carom.systems.shapes.linking.linked_shapes import linked_shapes


@pytest.fixture(scope="module", params=(2, 3), ids=("2D", "3D"))
def scene(request):
    return Scene(request.param, SHIPPED[request.param])


@np.errstate(all="ignore")
def test_shipped_pairs_give_the_bits_of_their_functions(scene):
    _, _, _, boxes, _, _ = KERNELS[scene.dimensions]
    evaluate_all, sweep_all = KERNELS[scene.dimensions][:2]
    rng = np.random.default_rng(3)
    own = scene.cases(rng, np.arange(scene.count), np.arange(scene.count))
    boxes(scene.state.address, own.address, True)
    cases = scene.cases(rng, *all_pairs(scene))
    evaluate_all(scene.state.address, cases.address)
    sweep_all(scene.state.address, cases.address)
    for k in range(len(cases.a)):
        one, a, two, b = (int(column[k]) for column in (cases.shape_a, cases.a, cases.shape_b, cases.b))
        d, v = vector(cases.d[k]), vector(cases.v[k])
        hit, depth, normal, point = scene.expected(one, a, two, b, d)
        assert cases.hit[k] == hit
        same(cases.depth[k], depth)
        if depth > -math.inf:  # otherwise there is nothing to see
            same(cases.normal[k], normal)
            same(cases.point[k], point)
        assert (cases.known[k], cases.swept[k], cases.time[k]) == scene.expected_sweep(one, a, two, b, d, v)
        shapes = scene.linked.shapes
        assert cases.convex[k] == (shapes[one].convex and shapes[two].convex)
    assert cases.hit.any()
    assert cases.swept.any()


def run_batches(scene, cases, early=False):
    """Evaluate the cases as pairs of the state, in one batch for each kind of pair."""
    state, pairs, count = scene.state, scene.state.pairs, len(scene.components)
    pairs.a, pairs.b = cases.a.astype(np.int32), cases.b.astype(np.int32)
    low, high = np.minimum(cases.shape_a, cases.shape_b), np.maximum(cases.shape_a, cases.shape_b)
    kinds = low * count + high
    state.candidates.bucket = np.argsort(kinds, kind="stable").astype(np.int32)
    pairs.hit, pairs.depth, pairs.early = np.zeros(len(kinds), bool), np.zeros(len(kinds)), np.zeros(len(kinds), bool)
    pairs.at, pairs.normal, pairs.point = np.zeros((3, *cases.d.shape))
    if early:
        state.bodies.previous_position, state.bodies.position = state.bodies.position, state.bodies.position + 7.0
        pairs.early[:] = True
    sizes = np.bincount(kinds, minlength=count * count)
    stops = np.cumsum(sizes)
    KERNELS[scene.dimensions][2](state.address, np.arange(count * count), stops - sizes, stops)
    return pairs


@pytest.mark.parametrize("early", [False, True])
def test_a_batch_gives_what_evaluate_gives(scene, early):
    """Where the bodies are now, or where the step starts."""
    rng, state = np.random.default_rng(4), scene.state
    a, b = all_pairs(scene)
    chosen = rng.random(len(a)) < 0.5
    a, b = a[chosen], b[chosen]
    cases = scene.cases(rng, a, b)
    KERNELS[scene.dimensions][0](state.address, cases.address)
    before = state.bodies.position.copy()
    pairs = run_batches(scene, cases, early)
    state.bodies.position = before
    assert (pairs.hit == cases.hit).all()
    same(pairs.depth, cases.depth)
    known = cases.depth > -math.inf
    same(pairs.normal[known], cases.normal[known])
    same(pairs.point[known], cases.point[known])
    same(pairs.at[known], cases.d[known])
    assert (pairs.a == a).all()


def test_corners_are_those_of_the_pair():
    scene = Scene(2, (SphereCollider, AABBCollider), each=8)
    cases = scene.cases(np.random.default_rng(5), *all_pairs(scene))
    KERNELS[2][0](scene.state.address, cases.address)
    corner = scene.registry.pair(AABBCollider, AABBCollider).corner
    box = scene.components.index(AABBCollider)
    for k in range(len(cases.a)):
        boxes = cases.shape_a[k] == cases.shape_b[k] == box
        a, b = (scene.parameters(box, int(row)) for row in (cases.a[k], cases.b[k]))
        assert cases.corner[k] == (boxes and corner(a, b, vector(cases.d[k]), 0.3))
    assert cases.corner.any()


def test_bounds_are_those_of_the_shape_as_rotated(scene):
    boxes = KERNELS[scene.dimensions][3]
    cases = scene.cases(np.random.default_rng(6), np.arange(scene.count), np.arange(scene.count))
    boxes(scene.state.address, cases.address, True)
    for i in range(scene.count):
        number = int(cases.shape_a[i])
        shape = scene.linked.shapes[number]
        if shape.turned is not None:
            own = scene.parameters(number, i, scene.columns[number])
            for name, value in zip(shape.columns, shape.turned(own, scene.axes[i]), strict=True):
                same(scene.rotated[number][name][i], value)
        same(cases.half[i], shape.bounds(scene.parameters(number, i), scene.dimensions))
    number = int(cases.shape_a[0])
    same(half_extents_of(scene.linked.shapes[number], scene.rotated[number], scene.axes)[0], cases.half[0])
    boxes(scene.state.address, cases.address, False)
    box = scene.components.index(AABBCollider)
    rows = scene.state.bodies.shape == box
    same(scene.rotated[box]["half_extents"][rows], scene.columns[box]["half_extents"][rows])
    boxes(scene.state.address, cases.address, True)


def test_shapes_without_a_pair_never_hit():
    scene = Scene(2, (OneWaySegmentCollider, TileGridCollider), (standard_shapes, *PLUGINS_2D), each=2)
    a, b = np.array([2, 3, 3]), np.array([3, 2, 2])
    cases = scene.cases(np.random.default_rng(1), a, b)
    assert scene.linked.unhandled == ((1, 1),)
    KERNELS[2][0](scene.state.address, cases.address)
    assert not cases.hit.any()
    assert (cases.depth == -math.inf).all()


def test_an_exception_arrives_with_its_values_plugin_and_entities():
    scene, _ = failing_plugin(raising)
    with pytest.raises(ValueError, match="not done yet") as caught:
        attempt(scene, "evaluate")
    assert caught.value.args == ("blobs this large are not done yet", 77.0)
    assert caught.value.__notes__ == [
        "plugin failing: pair raising of BlobCollider and BlobCollider, entities 101 and 102"
    ]


def test_a_contact_that_is_not_finite_is_attributed_and_counts_as_a_miss():
    scene, _ = failing_plugin(not_a_number)
    with pytest.raises(
        PluginError, match=r"pair not_a_number of .* entities 101 and 102 returned a contact that is not"
    ):
        attempt(scene, "evaluate")
    assert scene.state.unsound == 0
    scene.state.bodies.position[1] = np.nan  # then it is the body's fault
    assert not attempt(scene, "evaluate").hit[0]


def test_of_a_batch_only_the_contacts_that_are_not_finite_are_misses():
    def sometimes(a, b, d):
        if a.radius == 77.0:
            return True, math.inf, d, d
        return False, -a.radius if 0.9 < a.radius < 2.1 else -math.inf, (1.0, 0.0), d

    scene, _ = failing_plugin(sometimes)
    scene.columns[0]["radius"][:2] = 1.0, 2.0
    rows = np.array([0, 2, 1]), np.array([1, 1, 0])
    cases = scene.cases(np.random.default_rng(1), *rows)
    attribute_errors = ErrorAttribution(scene.registry, scene.state, lambda: scene.linked.shapes)
    message = "pair sometimes of .* entities 101 and 102 returned a contact that is not finite"
    with pytest.raises(PluginError, match=message), attribute_errors():
        run_batches(scene, cases)
    assert not scene.state.pairs.hit.any()
    assert scene.state.pairs.depth.tolist() == [-1.0, -math.inf, -2.0]
    scene.state.bodies.position[2] = np.nan  # then it is the body's fault
    with attribute_errors():
        assert run_batches(scene, cases).depth.tolist() == [-1.0, -math.inf, -2.0]


def test_a_sweep_out_of_its_bounds_is_attributed():
    scene, _ = failing_plugin(apart, sweep=late)
    with pytest.raises(PluginError, match=r"plugin failing: .* its sweep returned a time that is not from 0 to 1"):
        attempt(scene, "sweep")


def test_bounds_that_are_no_numbers_are_attributed():
    scene, _ = failing_plugin(apart, bounds=endless_bounds)
    with pytest.raises(PluginError, match="plugin failing: bounds of BlobCollider, entity 102 are not numbers from 0"):
        attempt(scene, "boxes")
    scene.state.bodies.rotation[2] = np.inf
    attempt(scene, "boxes")


@pytest.mark.skipif("NUMBA_DISABLE_JIT" in os.environ, reason="nothing is compiled")
def test_a_function_that_cannot_be_compiled_is_named():
    def uncompiled(a, b, d):
        first = sorted({"x": 1}.items(), key=str)
        return len(first) > 1, -math.inf, d, d

    plugin, blob = Plugin("failing"), blob_class(SphereCollider.bounds)
    plugin.shape(cost=1)(blob)
    plugin.pair(blob, blob)(uncompiled)
    state = make_record(STATE, 2)
    attribute_errors = ErrorAttribution(registry_of(plugin), state, lambda: ())
    with pytest.raises(NumbaError) as caught, attribute_errors():
        linked_shapes(registry_of(plugin), [blob], 2).fill(state.shapes)
    assert "plugin failing: pair uncompiled of BlobCollider and BlobCollider cannot be" in caught.value.__notes__[-1]


@pytest.mark.slow
@pytest.mark.skipif("NUMBA_DISABLE_JIT" in os.environ, reason="is this run")
def test_the_same_holds_without_the_compiler():
    files = [__file__, str(Path(__file__).parents[1] / "queries" / "test_linked_queries.py")]
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "-p", "no:xdist", *files]
    run = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert run.returncode == 0, run.stdout[-3000:]


def test_a_process_remembers_a_bounded_number_of_generated_modules(monkeypatch):
    monkeypatch.setattr(source, "MODULES", len(source._made) + 3)
    names = [source.source_module(f"value = {k}", {}).__name__ for k in range(5)]
    assert [name in sys.modules for name in names][-3:] == [True] * 3
    assert len(source._made) == source.MODULES
    assert sum(name.startswith("carom_shapes_") for name in sys.modules) <= source.MODULES
