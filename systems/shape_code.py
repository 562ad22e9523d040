"""Code made for the shapes of a scene: which function meets which pair, compiled into one.

The kernels of the collision phases are written once, over ``evaluate`` and ``shape_bounds``; here these two are put
together from the registered functions of exactly the shapes that the scene has. A scene of spheres compiles nothing
of boxes.
"""

from __future__ import annotations

import collections
import hashlib
import linecache
import sys
import types
from dataclasses import dataclass
from typing import Any

from ..framework.compilation import deep_hash, inlined, kernel
from ..framework.component import Component
from ..framework.registry import Registry, Shape
from ..framework.vectors import negative, row, store, sub


@dataclass(frozen=True)
class ShapeCode:
    """Compiled functions for a list of shapes, which are meant by their index in it.

    evaluate(shape_a, a, shape_b, b, d, shapes, like) -> (hit, depth, normal, point)
        rows a and b, d = centre of b - centre of a; normal from a to b, point relative to a's centre;
        depth is negative while the two are apart
    corner(shape_a, a, shape_b, b, d, slop, shapes, like) -> whether the two touch at a corner only, which is no contact
    shape_bounds(shape, row, shapes, like) -> half extents
    write_world(shape, row, shapes, world, turn, axes, like); writes the parameters as turned into ``world``
    """

    shapes: tuple[Shape, ...]
    evaluate: Any
    corner: Any
    shape_bounds: Any
    write_world: Any
    turns: bool


_made: dict[tuple[Any, ...], ShapeCode] = {}
_half_extents: dict[tuple[int, Shape], Any] = {}


def shape_code(registry: Registry, components: list[type[Component]], dimensions: int) -> ShapeCode:
    """The code for these shapes, cheapest first; UnhandledPairError if a pair of them has no function."""
    registry.require_pairs(components)
    shapes = tuple(registry.shapes[component] for component in components)
    functions = [registry.pair(a, b) for i, a in enumerate(components) for b in components[i:]]
    key = (dimensions, shapes, tuple(functions))
    if key not in _made:
        _made[key] = _make(registry, shapes, dimensions)
    return _made[key]


def _make(registry: Registry, shapes: tuple[Shape, ...], dimensions: int) -> ShapeCode:
    scope: dict[str, Any] = {"row": row, "negative": negative, "sub": sub}
    source = [f'"""Shapes: {", ".join(shape.component.__name__ for shape in shapes)}, {dimensions}D."""', ""]
    for index, shape in enumerate(shapes):
        scope[f"Shape{index}"] = collections.namedtuple(f"Shape{index}", shape.parameters)
        scope[f"bounds{index}"] = shape.bounds
        scope[f"turned{index}"] = shape.turned
    source += _evaluate_source(registry, shapes, scope)
    source += _corner_source(registry, shapes, scope)
    source += _bounds_source(shapes)
    source += _world_source(shapes)
    module = source_module("\n".join(source) + "\n", scope)
    return ShapeCode(
        shapes,
        inlined(module.evaluate),
        inlined(module.corner),
        inlined(module.shape_bounds),
        inlined(module.write_world),
        any(shape.turned is not None for shape in shapes),
    )


def half_extents_kernel(shape: Shape, dimensions: int) -> Any:
    """A kernel (shapes, half, like) that writes the half extents (n, d) of the boxes around n shapes of one kind.

    shapes: a tuple with one tuple of the shape's parameters, each an array of n.
    """
    key = (dimensions, shape)
    if key not in _half_extents:
        scope: dict[str, Any] = {"row": row, "bounds0": shape.bounds}
        scope["Shape0"] = collections.namedtuple("Shape0", shape.parameters)
        source = [f'"""Bounds of {shape.component.__name__}, {dimensions}D."""', "", *_bounds_source((shape,))]
        bounds = inlined(source_module("\n".join(source) + "\n", scope).shape_bounds)

        @kernel
        def half_extents(shapes, half, like):
            for i in range(len(half)):
                store(half, i, bounds(0, i, shapes, like))

        _half_extents[key] = half_extents
    return _half_extents[key]


def parameters_source(shapes: tuple[Shape, ...], index: int, at: str) -> str:
    """Source of the parameter tuple of shape ``index`` at row ``at``."""
    shape = shapes[index]
    parts = []
    for place, name in enumerate(shape.parameters):
        array = f"shapes[{index}][{place}]"
        vector = shape.component.columns[name].item == "vector"
        parts.append(f"row({array}, {at}, like)" if vector else f"{array}[{at}]")
    return f"Shape{index}({', '.join(parts)})"


def _evaluate_source(registry: Registry, shapes: tuple[Shape, ...], scope: dict[str, Any]) -> list[str]:
    many = len(shapes) > 1
    lines = ["def evaluate(shape_a, a, shape_b, b, d, shapes, like):"]
    if many:  # a pair is tested in the order of its shapes, and turned round afterwards if that is not (a, b)
        lines += [
            "    swapped = shape_a > shape_b",
            "    direction = d",
            "    if swapped:",
            "        shape_a, shape_b = shape_b, shape_a",
            "        a, b = b, a",
            "        d = negative(d)",
        ]
    opening = "if"
    for i, first in enumerate(shapes):
        for j in range(i, len(shapes)):
            pair = registry.pair(first.component, shapes[j].component)
            assert pair is not None
            scope[f"pair{i}_{j}"] = pair.function
            in_order = pair.first is first.component
            one, two = parameters_source(shapes, i, "a"), parameters_source(shapes, j, "b")
            indent = "    "
            if many:
                last = i == j == len(shapes) - 1
                lines.append("    else:" if last else f"    {opening} shape_a == {i} and shape_b == {j}:")
                opening = "elif"
                indent = "        "
            if in_order:
                lines.append(f"{indent}hit, depth, normal, point = pair{i}_{j}({one}, {two}, d)")
            else:
                lines += [
                    f"{indent}hit, depth, normal, point = pair{i}_{j}({two}, {one}, negative(d))",
                    f"{indent}normal = negative(normal)",
                    f"{indent}point = sub(point, negative(d))",
                ]
    if many:
        lines += ["    if swapped:", "        normal = negative(normal)"]
        lines += ["        point = sub(point, negative(direction))"]
    return [*lines, "    return hit, depth, normal, point", ""]


def _corner_source(registry: Registry, shapes: tuple[Shape, ...], scope: dict[str, Any]) -> list[str]:
    """Only of the pairs that know corners; nearly all do not."""
    lines = ["def corner(shape_a, a, shape_b, b, d, slop, shapes, like):"]
    for i, first in enumerate(shapes):
        for j, second in enumerate(shapes):
            pair = registry.pair(first.component, second.component)
            if pair is None or pair.corner is None or pair.first is not first.component:
                continue
            scope[f"corner{i}_{j}"] = pair.corner
            one, two = parameters_source(shapes, i, "a"), parameters_source(shapes, j, "b")
            lines += [f"    if shape_a == {i} and shape_b == {j}:"]
            lines += [f"        return corner{i}_{j}({one}, {two}, d, slop)"]
            if i != j:
                one, two = parameters_source(shapes, i, "b"), parameters_source(shapes, j, "a")
                lines += [f"    if shape_a == {j} and shape_b == {i}:"]
                lines += [f"        return corner{i}_{j}({one}, {two}, negative(d), slop)"]
    return [*lines, "    return False", ""]


def _bounds_source(shapes: tuple[Shape, ...]) -> list[str]:
    lines = ["def shape_bounds(shape, at, shapes, like):"]
    for index in range(len(shapes) - 1):
        lines.append(f"    if shape == {index}:")
        lines.append(f"        return bounds{index}({parameters_source(shapes, index, 'at')}, like)")
    last = len(shapes) - 1
    return [*lines, f"    return bounds{last}({parameters_source(shapes, last, 'at')}, like)", ""]


def _world_source(shapes: tuple[Shape, ...]) -> list[str]:
    """Parameters as they are in the world: turned where the shape turns."""
    lines = ["def write_world(shape, at, shapes, world, turn, axes, like):"]
    for index, shape in enumerate(shapes):
        if shape.turned is None:
            continue
        lines += [f"    if shape == {index}:", "        if turn:"]
        lines.append(f"            new = turned{index}({parameters_source(shapes, index, 'at')}, axes[at])")
        for place, name in enumerate(shape.parameters):
            lines.append(_assign(shape, index, place, name, f"new[{place}]", 12))
        lines.append("        else:")
        for place, name in enumerate(shape.parameters):
            vector = shape.component.columns[name].item == "vector"
            value = f"shapes[{index}][{place}][at]" if not vector else f"row(shapes[{index}][{place}], at, like)"
            lines.append(_assign(shape, index, place, name, value, 12))
    return [*lines, "    return", ""]


def _assign(shape: Shape, index: int, place: int, name: str, value: str, indent: int) -> str:
    space = " " * indent
    target = f"world[{index}][{place}]"
    if shape.component.columns[name].item != "vector":
        return f"{space}{target}[at] = {value}"
    return f"{space}value = {value}\n{space}for k in range(len(like)):\n{space}    {target}[at, k] = value[k]"


def source_module(source: str, scope: dict[str, Any]) -> types.ModuleType:
    """A module of that source, findable by name (numba looks functions up there) and by tracebacks."""
    functions = [value for value in scope.values() if hasattr(value, "py_func")]
    digest = hashlib.sha256((source + "".join(deep_hash(f) for f in functions)).encode()).hexdigest()[:24]
    name = f"carom_shapes_{digest}"
    if name not in sys.modules:
        module = types.ModuleType(name)
        vars(module).update(scope)
        filename = f"<{name}>"
        linecache.cache[filename] = (len(source), None, source.splitlines(keepends=True), filename)
        exec(compile(source, filename, "exec"), vars(module))
        sys.modules[name] = module
    return sys.modules[name]
