"""Linked functions of shapes against the plugins' own functions, which run as plain Python and give the same bits."""

from __future__ import annotations

import math
import os
import subprocess
import sys

import numpy as np
import pytest
from numba.core.errors import NumbaError

from carom.components import AABBCollider, Collider, SphereCollider
from carom.framework.compilation import kernel
from carom.framework.data.columns import column
from carom.framework.errors import PluginError
from carom.framework.jit.record import make_record
from carom.framework.jit.record_type import record_at, record_type
from carom.framework.jit.schema import Schema, flags, floats, ints, vectors
from carom.framework.plugins.plugin import Plugin
from carom.framework.plugins.registry import Registry
from carom.framework.vectors import add, negative, sub
from carom.plugins import capsule, convex_polygon, half_space, one_way_segment, tile_grid
from carom.plugins.capsule import CapsuleCollider
from carom.plugins.convex_polygon import ConvexPolygonCollider
from carom.plugins.half_space import HalfSpaceCollider
from carom.plugins.one_way_segment import OneWaySegmentCollider
from carom.plugins.standard_shapes import standard_shapes
from carom.plugins.tile_grid import TileGridCollider
from carom.systems.records import STATE
from carom.systems.shapes import dispatch, query
from carom.systems.shapes.attribution import ErrorAttribution
from carom.systems.shapes.linking.linked_shape import half_extents_of
from carom.systems.shapes.linking.linked_shapes import ParameterRecords, linked_shapes
from carom.systems.shapes.linking.mixing import mix, mix_friction, rule_number
from carom.systems.shapes.linking.parameters import bind, make_parameter_record, parameter_tuple

COMMON = {"offset": 0.0, "restitution": 0.0, "friction": None, "sensor": False, "layer": 1, "mask": -1}
PLUGINS = (standard_shapes, capsule.plugin, half_space.plugin)
PLUGINS_2D = (convex_polygon.plugin, one_way_segment.plugin, tile_grid.plugin)
MAKERS = {
    SphereCollider: lambda rng, d: SphereCollider(rng.uniform(0.2, 1.0)),
    AABBCollider: lambda rng, d: AABBCollider(rng.uniform(0.1, 1.0, d)),
    CapsuleCollider: lambda rng, d: CapsuleCollider(rng.uniform(0.0, 0.5), rng.uniform(0.0, 1.0)),
    HalfSpaceCollider: lambda rng, d: HalfSpaceCollider(rng.normal(size=d)),
    ConvexPolygonCollider: lambda rng, d: ConvexPolygonCollider.regular(
        int(rng.integers(3, 8)), rng.uniform(0.3, 1.0), corner_radius=rng.uniform(0.0, 0.2)
    ),
    OneWaySegmentCollider: lambda rng, d: OneWaySegmentCollider(*rng.normal(size=(2, d)), "left"),
    TileGridCollider: lambda rng, d: TileGridCollider(np.eye(3, 4) + (rng.random((3, 4)) < 0.4) > 0.0, 0.5),
}
SHIPPED = {2: tuple(MAKERS), 3: tuple(MAKERS)[:4]}

# One row per test: rows of bodies, the shapes they are tested as, and what kernels answer.
CASES = Schema(
    "Cases", a=ints(), b=ints(), shape_a=ints(), shape_b=ints(), d=vectors(), v=vectors(), slop=floats(), hit=flags(),
    depth=floats(), normal=vectors(), point=vectors(), corner=flags(), known=flags(), swept=flags(), time=floats(),
    convex=flags(), half=vectors(), mixed=floats(),
)  # fmt: skip


def kernels_of(dimensions):
    state_at, cases_at = record_at(record_type(STATE, dimensions)), record_at(record_type(CASES, dimensions))
    query_at = record_at(record_type(query.QUERY, dimensions))

    @kernel
    def evaluate_all(state_address, address):
        state, cases = state_at(state_address), cases_at(address)
        for k in range(len(cases.a)):
            one, a, two, b, d = cases.shape_a[k], cases.a[k], cases.shape_b[k], cases.b[k], cases.d[k]
            hit, depth, normal, point = dispatch.evaluate(state, one, a, two, b, d)
            cases.hit[k], cases.depth[k], cases.normal[k], cases.point[k] = hit, depth, normal, point
            cases.convex[k] = dispatch.both_convex(state, one, two)
            cases.corner[k] = dispatch.is_corner_touch(state, one, a, two, b, d, cases.slop[k])

    @kernel
    def sweep_all(state_address, address):
        state, cases = state_at(state_address), cases_at(address)
        for k in range(len(cases.a)):
            one, a, two, b, d = cases.shape_a[k], cases.a[k], cases.shape_b[k], cases.b[k], cases.d[k]
            known, hit, time = dispatch.sweep(state, one, a, two, b, d, cases.v[k])
            cases.known[k], cases.swept[k], cases.time[k] = known, hit, time

    @kernel
    def batches(state_address, starts_kind, starts, stops):
        state = state_at(state_address)
        for k in range(len(starts_kind)):
            dispatch.evaluate_batch(state, starts_kind[k], starts[k], stops[k])

    @kernel
    def boxes(state_address, address, rotated):
        state, cases = state_at(state_address), cases_at(address)
        for k in range(len(cases.a)):
            dispatch.write_rotated(state, cases.shape_a[k], cases.a[k], rotated)
            cases.half[k] = dispatch.half_extents(state, cases.shape_a[k], cases.a[k])

    @kernel
    def ask_all(state_address, query_address, address):
        state, asked, cases = state_at(state_address), query_at(query_address), cases_at(address)
        for k in range(len(cases.a)):
            q, two, b, d = cases.a[k], cases.shape_b[k], cases.b[k], cases.d[k]
            hit, depth, normal, point = query.evaluate_against(state, asked, q, two, b, d)
            cases.hit[k], cases.depth[k], cases.normal[k], cases.point[k] = hit, depth, normal, point
            known, hit, time = query.sweep_against(state, asked, q, two, b, d, cases.v[k])
            cases.known[k], cases.swept[k], cases.time[k] = known, hit, time
            cases.half[k] = query.query_half_extents(state, asked, q)

    @kernel
    def mix_all(state_address, rule, address):
        state, cases = state_at(state_address), cases_at(address)
        for k in range(len(cases.a)):
            cases.mixed[k] = mix(state, rule, cases.depth[k], cases.time[k])
            cases.slop[k] = mix_friction(state, rule, cases.depth[k], cases.time[k])

    return evaluate_all, sweep_all, batches, boxes, ask_all, mix_all


KERNELS = {dimensions: kernels_of(dimensions) for dimensions in (2, 3)}


def registry_of(*plugins):
    registry = Registry()
    for plugin in plugins:
        registry.add(plugin)
    return registry


def rotations(rng, n, d):
    q, _ = np.linalg.qr(rng.normal(size=(n, d, d)))
    q[:, :, 0] *= np.sign(np.linalg.det(q))[:, None]
    return np.ascontiguousarray(q)


class Scene:
    """Some bodies of each shape, in a record without a world."""

    def __init__(self, dimensions, components, plugins=None, makers=MAKERS, each=5, seed=7, rotated=True):
        rng = np.random.default_rng(seed)
        plugins = plugins or (*PLUGINS, *(PLUGINS_2D if dimensions == 2 else ()))
        self.registry = registry_of(*plugins)
        self.dimensions = dimensions
        shapes = self.registry.shapes
        self.components = sorted(components, key=lambda c: (shapes[c].cost, c.__name__))
        self.linked = linked_shapes(self.registry, self.components, dimensions)
        count = each * len(components)
        self.count = count
        self.axes = rotations(rng, count, dimensions)
        if not rotated:
            self.axes[:] = np.eye(dimensions)
        self.state = make_record(STATE, dimensions)
        state = self.state
        state.count, bodies = count, state.bodies
        bodies.shape = np.repeat(np.arange(len(components), dtype=np.int8), each)
        bodies.levels = bodies.shape[None].copy()
        bodies.position, bodies.offset = rng.normal(size=(2, count, dimensions))
        bodies.entity = np.arange(count) + 100
        bodies.rotation = np.zeros(count * (1 if dimensions == 2 else 4))
        self.columns, self.rotated = [], []
        self.records = ParameterRecords(self.linked)
        for number, component in enumerate(self.components):
            handles = [makers[component](rng, dimensions) for _ in range(count)]
            columns = columns_of(self.linked.shapes[number], handles, dimensions)
            self.columns.append(columns)
            self.rotated.append({name: array.copy() for name, array in columns.items()} if rotated else columns)
            self.records.bind(number, columns, self.axes, self.rotated[-1] if rotated else None)
        self.linked.fill(state.shapes, sweeps=True)
        self.records.fill(state.shapes)

    def cases(self, rng, a, b):
        """A record of cases for rows a and b, with random ways."""
        cases = make_record(CASES, self.dimensions)
        n, bodies = len(a), self.state.bodies
        for name, field in CASES.fields.items():
            setattr(cases, name, np.zeros((n, *field.item_shape(self.dimensions)), field.dtype))
        cases.a[:], cases.b[:] = a, b
        cases.shape_a[:], cases.shape_b[:] = bodies.shape[a], bodies.shape[b]
        cases.d[:] = bodies.position[b] + bodies.offset[b] - (bodies.position[a] + bodies.offset[a])
        cases.v[:] = 2.0 * rng.normal(size=cases.v.shape) - cases.d
        cases.slop[:] = 0.3
        return cases

    def parameters(self, number, i, columns=None):
        """What functions of plugins get for row i."""
        shape = self.linked.shapes[number]
        values = []
        for name in shape.columns:
            column, value = shape.component.columns[name], (columns or self.rotated[number])[name][i]
            if column.item == "vector":
                value = tuple(value)
            elif column.item == "array":
                value = column.pool.array(value)
            values.append(value)
        if shape.rotates:
            values.append(tuple(tuple(self.axes[i, :, j]) for j in range(self.dimensions)))
        return parameter_tuple(shape)(*values)

    def expected(self, one, a, two, b, d):
        """What evaluate should answer: turned into the order of the shapes, then into that of the registered pair."""
        if one > two:
            hit, depth, normal, point = self.expected(two, b, one, a, negative(d))
            return hit, depth, negative(normal), sub(point, negative(d))
        pair = self.registry.pair(self.components[one], self.components[two])
        if pair is None:
            return False, -math.inf, d, d
        first, second = self.parameters(one, a), self.parameters(two, b)
        if pair.first is self.components[one]:
            return pair.function(first, second, d, *pair.helpers)
        hit, depth, normal, point = pair.function(second, first, negative(d), *pair.helpers)
        return hit, depth, negative(normal), sub(point, negative(d))

    def expected_sweep(self, one, a, two, b, d, v):
        pair = self.registry.pair(self.components[one], self.components[two])
        if pair is None or pair.sweep is None:
            return False, False, 0.0
        first, second = self.parameters(one, a), self.parameters(two, b)
        if pair.first is self.components[one]:
            return True, *pair.sweep(first, second, d, v, *pair.helpers)
        return True, *pair.sweep(second, first, negative(d), negative(v), *pair.helpers)


def columns_of(shape, handles, dimensions):
    columns = {}
    for name in shape.columns:
        column = shape.component.columns[name]
        values = [np.broadcast_to(handle._values[name], column.item_shape(dimensions)) for handle in handles]
        columns[name] = np.array(values, column.dtype)
    return columns


def same(left, right):
    left, right = np.asarray(left, float), np.asarray(right, float)
    np.testing.assert_array_equal(left, right)


def vector(values):
    return tuple(values)


@pytest.fixture(scope="module", params=(2, 3), ids=("2D", "3D"))
def scene(request):
    return Scene(request.param, SHIPPED[request.param])


def all_pairs(scene):
    a, b = np.divmod(np.arange(scene.count**2), scene.count)
    return a[a != b], b[a != b]


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


def test_a_batch_gives_what_evaluate_gives(scene):
    evaluate_all, _, batches, *_ = KERNELS[scene.dimensions]
    rng, state = np.random.default_rng(4), scene.state
    a, b = all_pairs(scene)
    chosen = rng.random(len(a)) < 0.5
    a, b = a[chosen], b[chosen]
    cases = scene.cases(rng, a, b)
    evaluate_all(state.address, cases.address)
    candidates, count = state.candidates, len(scene.components)
    pairs = state.pairs
    pairs.a, pairs.b = a.astype(np.int32), b.astype(np.int32)
    low, high = np.minimum(cases.shape_a, cases.shape_b), np.maximum(cases.shape_a, cases.shape_b)
    kinds = low * count + high
    candidates.bucket = np.argsort(kinds, kind="stable").astype(np.int32)
    pairs.hit, pairs.depth = np.zeros(len(a), bool), np.zeros(len(a))
    pairs.normal, pairs.point = np.zeros_like(cases.d), np.zeros_like(cases.d)
    sizes = np.bincount(kinds, minlength=count * count)
    stops = np.cumsum(sizes)
    batches(state.address, np.arange(count * count), stops - sizes, stops)
    assert (pairs.hit == cases.hit).all()
    same(pairs.depth, cases.depth)
    known = cases.depth > -math.inf
    same(pairs.normal[known], cases.normal[known])
    same(pairs.point[known], (state.bodies.position[a] + state.bodies.offset[a] + cases.point)[known])
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


@pytest.mark.parametrize("asking", [SphereCollider, CapsuleCollider, AABBCollider])
@np.errstate(all="ignore")
def test_queries_get_the_answers_of_the_pair_as_it_is_registered(scene, asking):
    linked = query.linked_query(scene.registry, scene.linked, asking)
    record, rng = make_record(query.QUERY, scene.dimensions), np.random.default_rng(8)
    shape = scene.registry.shapes[asking]
    handles = [MAKERS[asking](rng, scene.dimensions) for _ in range(scene.count)]
    parameters, columns = make_parameter_record(shape, scene.dimensions), columns_of(shape, handles, scene.dimensions)
    bind(parameters, shape, columns, scene.axes)
    linked.fill(record, parameters, scene.records, sweeps=True)
    cases = scene.cases(rng, *all_pairs(scene))
    KERNELS[scene.dimensions][4](scene.state.address, record.address, cases.address)
    number = scene.components.index(asking)
    for k in range(len(cases.a)):
        two, b, d, way = int(cases.shape_b[k]), int(cases.b[k]), vector(cases.d[k]), vector(cases.v[k])
        pair = scene.registry.pair(asking, scene.components[two])
        if pair is None:
            continue
        one, other = scene.parameters(number, int(cases.a[k]), columns), scene.parameters(two, b)
        flipped = pair.first is not asking
        if flipped:
            hit, depth, normal, point = pair.function(other, one, negative(d), *pair.helpers)
            normal, point = negative(normal), add(point, d)
        else:
            hit, depth, normal, point = pair.function(one, other, d, *pair.helpers)
        assert cases.hit[k] == hit
        same(cases.depth[k], depth)
        same(cases.normal[k], normal)
        same(cases.point[k], point)
        assert cases.known[k] == (pair.sweep is not None)
        if pair.sweep is not None:
            moved = (other, one, negative(d), way) if flipped else (one, other, d, negative(way))
            assert (cases.swept[k], cases.time[k]) == pair.sweep(*moved, *pair.helpers)


# -- functions of plugins that fail ---------------------------------------------------------------


def blob_class(bounds_function):
    class BlobCollider(Collider):
        __slots__ = ()

        dimensions = (2,)
        radius = column(minimum=0.0)
        bounds = staticmethod(bounds_function)

        def __init__(self, radius, **common):
            self._fill({"radius": radius, **COMMON, **common})

    return BlobCollider


def failing_plugin(pair, sweep=None, bounds=None):
    """A plugin whose shape fails for some radii; the checks at registration see none of these."""
    plugin = Plugin("failing")

    blob = blob_class(bounds or SphereCollider.bounds)
    plugin.shape(cost=1)(blob)
    plugin.pair(blob, blob)(pair)
    if sweep is not None:
        plugin.sweep(blob, blob)(sweep)
    scene = Scene(2, (blob,), (standard_shapes, plugin), {blob: lambda rng, d: blob(77.0)}, each=3, rotated=False)
    return scene, blob


def apart(a, b, d):
    return False, -math.inf, d, d


def raising(a, b, d):
    if a.radius == 77.0:
        raise ValueError("blobs this large are not done yet", a.radius)
    return False, -math.inf, d, d


def not_a_number(a, b, d):
    if a.radius == 77.0:
        return True, math.nan, (1.0, 0.0), (0.0, 0.0)
    return False, -math.inf, d, d


def late(a, b, d, v):
    return (True, 7.0) if a.radius == 77.0 else (False, 0.0)


def endless_bounds(shape, dimensions):
    return (math.nan, 1.0) if shape.radius == 77.0 else (1e30, 1e30)


def attempt(scene, name, **options):
    cases = scene.cases(np.random.default_rng(1), np.array([2]), np.array([1]))
    attribute_errors = ErrorAttribution(scene.registry, scene.state, lambda: scene.linked.shapes)
    with attribute_errors(**options):
        function = KERNELS[2][("evaluate", "sweep", "batch", "boxes").index(name)]
        arguments = (False,) if name == "boxes" else ()
        function(scene.state.address, cases.address, *arguments)
    return cases


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


def test_a_query_names_the_plugin_too():
    scene, blob = failing_plugin(raising)
    linked, record = query.linked_query(scene.registry, scene.linked, blob), make_record(query.QUERY, 2)
    parameters = make_parameter_record(linked.shape, 2)
    bind(parameters, linked.shape, {"radius": np.array([77.0])})
    linked.fill(record, parameters, scene.records)
    cases = scene.cases(np.random.default_rng(1), np.array([0]), np.array([1]))
    attribute_errors = ErrorAttribution(scene.registry, scene.state, lambda: scene.linked.shapes)
    with pytest.raises(ValueError, match="not done yet") as caught, attribute_errors(query=blob):
        KERNELS[2][4](scene.state.address, record.address, cases.address)
    assert caught.value.__notes__ == [
        "plugin failing: pair raising of BlobCollider and BlobCollider of a query, entity 101"
    ]


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


# -- rules of mixing, and shapes without a pair -----------------------------------------------------


def test_rules_of_plugins_mix_behind_the_standard_ones():
    plugin = Plugin("rules")

    @plugin.mixing_rule("harmonic")
    def harmonic(x, y):
        if x + y > 100.0:
            return -1.0
        return 2.0 * x * y / (x + y) if x + y > 0.0 else 0.0

    scene = Scene(2, (SphereCollider,), (standard_shapes, plugin))
    cases = scene.cases(np.random.default_rng(1), np.array([0, 0, 0]), np.array([1, 1, 1]))
    cases.depth[:], cases.time[:] = (0.25, math.nan, math.nan), (1.0, 0.5, math.nan)
    mix_all = KERNELS[2][5]
    for name, value in {"average": 0.625, "max": 1.0, "min": 0.25, "multiply": 0.25, "harmonic": 0.4}.items():
        mix_all(scene.state.address, rule_number(scene.registry, name), cases.address)
        assert cases.mixed[0] == value
        assert cases.slop.tolist() == [value, 0.5 if name != "multiply" else 0.25, 0.0]
        cases.depth[1:] = math.nan
    cases.depth[:], cases.time[:] = 1.0, 1000.0
    with pytest.raises(ValueError, match="no number from 0"):
        mix_all(scene.state.address, rule_number(scene.registry, "harmonic"), cases.address)
    with pytest.raises(ValueError, match="mixing rules of this world are"):
        rule_number(scene.registry, "none")


def test_shapes_without_a_pair_never_hit():
    scene = Scene(2, (OneWaySegmentCollider, TileGridCollider), (standard_shapes, *PLUGINS_2D), each=2)
    a, b = np.array([2, 3, 3]), np.array([3, 2, 2])
    cases = scene.cases(np.random.default_rng(1), a, b)
    assert scene.linked.unhandled == ((1, 1),)
    KERNELS[2][0](scene.state.address, cases.address)
    assert not cases.hit.any()
    assert (cases.depth == -math.inf).all()


@pytest.mark.skipif("NUMBA_DISABLE_JIT" in os.environ, reason="is this run")
def test_the_same_holds_without_the_compiler():
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "-p", "no:xdist", __file__]
    run = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert run.returncode == 0, run.stdout[-3000:]
