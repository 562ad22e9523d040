"""Code for questions: one shape that is asked with against all shapes of a scene, compiled when first asked."""

from __future__ import annotations

import collections
import math
from dataclasses import replace
from typing import Any

from ...framework.compilation import inlined
from ...framework.data.array_columns import array_at
from ...framework.data.component import Component
from ...framework.plugins.registry import Registry, Shape
from ...framework.vectors import add, axes_at, negative, row
from ..shapes.dispatch import pair_call, parameters_source, source_module
from .casts import make_cast_kernel
from .nearest import make_nearest_kernel
from .overlap import make_touching_kernel


class QueryKernels:
    """The kernels of one asking shape; each compiles when first called."""

    def __init__(self, against: Any, swept: Any, half_extents: Any) -> None:
        self.touching: Any = make_touching_kernel(against)
        self.cast: Any = make_cast_kernel(against, swept, half_extents)
        self.nearest: Any = make_nearest_kernel(against)


_made: dict[tuple[Any, ...], QueryKernels] = {}


def query_kernels(
    registry: Registry, shapes: tuple[Shape, ...], component: type[Component], dimensions: int
) -> QueryKernels:
    """The kernels that ask with ``component`` for ``shapes``; ValueError if no plugin has registered it as a shape."""
    if component not in registry.shapes:
        raise ValueError(f"no plugin has registered {component.__name__} as a shape, which this question needs")
    asking = registry.shapes[component]
    pairs = tuple(registry.pair(component, shape.component) for shape in shapes)
    key = (asking, shapes, pairs, dimensions)
    if key not in _made:
        _made[key] = _make(asking, shapes, pairs, dimensions)
    return _made[key]


def _make(
    asking: Shape, shapes: tuple[Shape, ...], pairs: tuple[Any, ...], dimensions: int
) -> QueryKernels:
    """Compile together against(query, q, shape, at, d, shapes, like) -> (hit, depth, normal, point), and
    swept(query, q, shape, at, d, way, shapes, like) -> (whether the pair has a sweep, hit, part of the way).

    query: the parameter columns of what asks, q its row; d: from its centre to that of the body in row ``at``. The
    answer is seen from what asks. A shape that has no pair with it is never hit.
    """
    name = asking.component.__name__
    scope: dict[str, Any] = {
        "row": row, "negative": negative, "add": add, "FAR": -math.inf, "bounds": asking.bounds, "array_at": array_at,
        "axes_at": axes_at,
    }  # fmt: skip
    scope["Query"] = collections.namedtuple("Query", asking.parameters)
    query = parameters_source((asking,), 0, "q").replace("Shape0", "Query").replace("shapes[0]", "query")
    lines = [f'"""{name} against {", ".join(shape.component.__name__ for shape in shapes)}."""', ""]
    lines.append("def against(query, q, shape, at, d, shapes, like):")
    lines.append("    hit, depth, normal, point = False, FAR, like, like")
    for index, (shape, pair) in enumerate(zip(shapes, pairs, strict=True)):
        if pair is None:
            continue
        scope[f"Shape{index}"] = collections.namedtuple(f"Shape{index}", shape.parameters)
        body = parameters_source(shapes, index, "at")
        lines.append(f"    if shape == {index}:")
        if pair.first is asking.component:
            call = pair_call(pair, f"pair{index}", scope, query, body, "d")
            lines.append(f"        hit, depth, normal, point = {call}")
        else:
            call = pair_call(pair, f"pair{index}", scope, body, query, "negative(d)")
            lines += [
                f"        hit, depth, normal, point = {call}",
                "        normal, point = negative(normal), add(point, d)",
            ]
    lines += ["    return hit, depth, normal, point", ""]
    lines.append("def swept(query, q, shape, at, d, way, shapes, like):")
    for index, pair in enumerate(pairs):
        if pair is None or pair.sweep is None:
            continue
        body, moving = parameters_source(shapes, index, "at"), replace(pair, function=pair.sweep)
        if pair.first is asking.component:
            call = pair_call(moving, f"sweep{index}", scope, query, body, "d, negative(way)")
        else:
            call = pair_call(moving, f"sweep{index}", scope, body, query, "negative(d), way")
        lines += [f"    if shape == {index}:", f"        hit, time = {call}", "        return True, hit, time"]
    lines += ["    return False, False, 0.0", ""]
    lines += ["def half_extents(query, q, like):", f"    return bounds({query}, {dimensions})", ""]
    module = source_module("\n".join(lines) + "\n", scope)
    return QueryKernels(inlined(module.against), inlined(module.swept), inlined(module.half_extents))
