"""Bodies of shapes in a record without a world, and kernels that call the linked functions of these shapes."""

from __future__ import annotations

import math

import numpy as np

from carom.components import AABBCollider, Collider, SphereCollider
from carom.framework.compilation import kernel
from carom.framework.data.columns import column
from carom.framework.jit.records.record import make_record
from carom.framework.jit.records.record_type import record_at
from carom.framework.jit.records.schema import Schema, flags, floats, ints, vectors
from carom.framework.plugins.plugin import Plugin
from carom.framework.plugins.registry import Registry
from carom.framework.vectors import negative, sub
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
from carom.systems.shapes.linking.linked_shapes import ParameterRecords, linked_shapes
from carom.systems.shapes.linking.mixing import mix, mix_friction
from carom.systems.shapes.linking.parameters import parameter_tuple

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
    state_at, cases_at = record_at(STATE, dimensions), record_at(CASES, dimensions)
    query_at = record_at(query.QUERY, dimensions)

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

    def __init__(self, dimensions, components, plugins=None, makers=MAKERS, each=4, seed=7, rotated=True):
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


def all_pairs(scene):
    a, b = np.divmod(np.arange(scene.count**2), scene.count)
    return a[a != b], b[a != b]


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
