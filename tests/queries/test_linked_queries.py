"""The linked functions of query shapes, and of the rules by which restitutions and frictions are mixed."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers_linked_shapes import (
    KERNELS,
    MAKERS,
    SHIPPED,
    Scene,
    all_pairs,
    columns_of,
    failing_plugin,
    raising,
    same,
    vector,
)

from carom.components import AABBCollider, SphereCollider
from carom.framework.jit.records.record import make_record
from carom.framework.plugins.plugin import Plugin
from carom.framework.vectors import add, negative
from carom.plugins.capsule import CapsuleCollider
from carom.plugins.standard_shapes import standard_shapes
from carom.systems.shapes import query
from carom.systems.shapes.attribution import ErrorAttribution
from carom.systems.shapes.linking.mixing import rule_number
from carom.systems.shapes.linking.parameters import bind, make_parameter_record


@pytest.fixture(scope="module", params=(2, 3), ids=("2D", "3D"))
def scene(request):
    return Scene(request.param, SHIPPED[request.param])


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
