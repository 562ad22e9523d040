"""Round shapes with right support functions pass ``carom plugins check``, whatever examples are drawn."""

from __future__ import annotations

import math

import numpy as np
import pytest

from carom import Collider, Plugin, column
from carom.framework.plugins.laws import OF_CAROM
from carom.framework.vectors import add_scaled, dot, item, replace, scale
from carom.lab.plugins import check
from carom.lab.plugins.samples import WIDTH

pytestmark = pytest.mark.slow  # its shapes take long to compile

plugin = Plugin("rounds", version="1.0")


@plugin.shape(cost=4)
class EllipsoidCollider(Collider):
    dimensions = (3,)
    rotates = True
    semi = column(item="vector", positive=True)

    def bounds(shape, dimensions):
        half = scale(shape.semi, 0.0)
        for k in range(3):
            square = 0.0
            for n in range(3):
                square += (item(shape.semi, n) * item(shape.axes[n], k)) ** 2
            half = replace(half, k, math.sqrt(square))
        return half

    def support(shape, direction):
        out, largest, square = scale(direction, 0.0), 0.0, 0.0
        for k in range(3):
            largest = max(largest, abs(item(shape.semi, k) * dot(shape.axes[k], direction)))
        for k in range(3):
            part = item(shape.semi, k) * dot(shape.axes[k], direction) / largest
            square += part * part
            out = add_scaled(out, shape.axes[k], item(shape.semi, k) * part)
        return scale(out, 1.0 / math.sqrt(square))


@plugin.shape(cost=4)
class CylinderCollider(Collider):
    """About the y axis, with a round edge; a cone, if ``top`` is 0."""

    dimensions = (3,)
    rotates = True
    radius = column(positive=True)
    half_height = column(positive=True)
    edge = column(minimum=0.0)
    top = column(1.0, minimum=0.0)  # of the radius, from above 0.5 on

    def bounds(shape, dimensions):
        y, r, h, e = shape.axes[1], shape.radius, shape.half_height, shape.edge
        wide = shape.radius if shape.top > 0.5 else 0.0
        half = scale(y, 0.0)
        for k in range(3):
            along, beside = h * item(y, k), math.sqrt(max(0.0, 1.0 - item(y, k) * item(y, k)))
            reach = max(max(along + wide * beside, r * beside - along), max(wide * beside - along, r * beside + along))
            half = replace(half, k, e + reach)
        return half

    def support(shape, direction):
        x, y, z = dot(shape.axes[0], direction), dot(shape.axes[1], direction), dot(shape.axes[2], direction)
        large = max(abs(x), abs(z))
        out, size = scale(direction, 0.0), 0.0
        if large > 1e-12 * abs(y):
            x, z = x / large, z / large
            size = math.sqrt(x * x + z * z)
            out = scale(add_scaled(scale(shape.axes[0], x), shape.axes[2], z), 1.0 / size)
        wide = shape.radius if shape.top > 0.5 else 0.0
        up = 2.0 * shape.half_height * y > (shape.radius - wide) * large * size
        return add_scaled(scale(out, wide if up else shape.radius), shape.axes[1],
                          shape.half_height if up else -shape.half_height)  # fmt: skip

    def rounding(shape):
        return shape.edge


@pytest.mark.parametrize("seed", [None, *(pytest.param(seed, marks=pytest.mark.long) for seed in (1, 2))])
def test_round_shapes_pass_the_check(monkeypatch, seed):
    if seed is not None:
        random = np.random.default_rng(seed)
        drawn = random.uniform(-1.0, 1.0, (400, WIDTH))
        drawn[random.random(drawn.shape) < 0.6 * random.random((400, 1))] = 0.0  # as hypothesis likes them
        monkeypatch.setattr(check, "all_examples", lambda: drawn)
    found = check.check_plugin(plugin, [])
    assert len(found) == 10
    assert [(each.place, each.finding) for each in found if each.finding] == []


def test_a_support_of_what_is_not_convex_is_told_as_such(monkeypatch):
    monkeypatch.setattr(check, "simplest", lambda is_wanted: None)
    wrong = Plugin("wrong", version="1.0")

    @wrong.shape(cost=2)
    class DentCollider(Collider):
        dimensions = (3,)
        radius = column(positive=True)

        def bounds(shape, dimensions):
            return shape.radius, shape.radius, shape.radius

        def support(shape, direction):
            size = math.sqrt(dot(direction, direction))
            return scale(direction, shape.radius * (1.0 - 0.1 * abs(direction[0]) / size) / size)

    cures = [each.finding[2] for each in check.check_plugin(wrong, []) if each.finding and each.kind == "pair"]
    assert cures
    assert set(cures) == {OF_CAROM}
