"""Code made for the shapes of a scene: which function meets which pair, compiled into one.

The kernels of the collision phases are written once, over ``evaluate`` and ``shape_bounds``; here these two are put
together from the registered functions of exactly the shapes that the scene has. A scene of spheres compiles nothing
of boxes.
"""

from __future__ import annotations

import collections
import hashlib
import linecache
import math
import sys
import types
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...framework.compilation import deep_hash, inlined, kernel
from ...framework.data.array_columns import ArrayColumn, array_at
from ...framework.data.component import Component
from ...framework.plugins.registry import Pair, Registry, Shape
from ...framework.vectors import axes_at, dot, negative, row, store, sub
from .mixing import mixing

# Places in the trace.
ROW_A, ROW_B, UNSOUND, UNSOUND_A, UNSOUND_B = range(5)
TRACE_SIZE = 5
OUT_OF_TIME = 2  # in place of 1: it is a sweep that was wrong
ALONE = -1  # in place of a second row: the bounds of the first


@inlined
def sound(hit, depth, normal, point):
    """Whether what a pair's function returned is a contact, or a miss."""
    if hit:
        return math.isfinite(depth + dot(normal, normal) + dot(point, point))
    return depth < math.inf


@dataclass(frozen=True)
class ShapeCode:
    """Compiled functions for a list of shapes, which are meant by their index in it.

    evaluate(shape_a, a, shape_b, b, d, shapes, like) -> (hit, depth, normal, point)
        rows a and b, d = centre of b - centre of a; normal from a to b, point relative to a's centre;
        depth is negative while the two are apart. Two shapes that no plugin has a pair for never hit
    corner(shape_a, a, shape_b, b, d, slop, shapes, like) -> whether the two touch at a corner only, which is no contact
    swept(shape_a, a, shape_b, b, d, v, shapes, like) -> (known, hit, time)
        b moving by v relative to a: whether the pair has a sweep of its own, and what that says
    convex(shape_a, shape_b) -> whether both are
    shape_bounds(shape, row, shapes, like) -> half extents
    write_world(shape, row, shapes, world, turn, axes, like); writes the parameters as turned into ``world``
    mix(rule, a, b) -> the contact's restitution or friction, see :mod:`mixing`
    unhandled
        pairs of indices, of shapes that no plugin has a pair for

    ``shapes`` is what :func:`parameter_columns` makes, one for each shape, and behind them the trace, see ``evaluate``.
    """

    shapes: tuple[Shape, ...]
    evaluate: Any
    corner: Any
    swept: Any
    convex: Any
    shape_bounds: Any
    write_world: Any
    mix: Any
    turns: bool
    unhandled: tuple[tuple[int, int], ...]

    @property
    def dented(self) -> bool:
        """Whether some shape is not convex."""
        return not all(shape.convex for shape in self.shapes)

    @property
    def rotates(self) -> bool:
        """Whether some shape needs the bodies' axes."""
        return any(shape.rotates for shape in self.shapes)


_made: dict[tuple[Any, ...], ShapeCode] = {}
_half_extents: dict[tuple[int, Shape], Any] = {}


def shape_code(registry: Registry, components: list[type[Component]], dimensions: int) -> ShapeCode:
    """The code for these shapes, cheapest first."""
    shapes = tuple(registry.shapes[component] for component in components)
    pairs = {
        (i, j): registry.pair(components[i], components[j]) for i in range(len(shapes)) for j in range(i, len(shapes))
    }
    rules = tuple(registry.mixing_rules.values())
    key = (dimensions, shapes, tuple(pairs.values()), rules)
    if key not in _made:
        _made[key] = _make(shapes, pairs, rules, dimensions)
    return _made[key]


def _make(
    shapes: tuple[Shape, ...], pairs: dict[tuple[int, int], Pair | None], rules: tuple[Any, ...], dimensions: int
) -> ShapeCode:
    scope: dict[str, Any] = {
        "row": row, "negative": negative, "sub": sub, "array_at": array_at, "axes_at": axes_at, "finite": math.isfinite,
        "APART": -math.inf, "sound": sound, "dot": dot, "ROW_A": ROW_A, "ROW_B": ROW_B, "UNSOUND": UNSOUND,
        "UNSOUND_A": UNSOUND_A, "UNSOUND_B": UNSOUND_B, "ALONE": ALONE, "OUT_OF_TIME": OUT_OF_TIME,
    }  # fmt: skip
    source = [f'"""Shapes: {", ".join(shape.component.__name__ for shape in shapes)}, {dimensions}D."""', ""]
    for index, shape in enumerate(shapes):
        scope[f"Shape{index}"] = collections.namedtuple(f"Shape{index}", shape.parameters)
        scope[f"bounds{index}"] = shape.bounds
        scope[f"turned{index}"] = shape.turned
    source += _evaluate_source(shapes, pairs, scope)
    source += _corner_source(shapes, pairs, scope)
    source += _swept_source(shapes, pairs, scope)
    source += _convex_source(shapes)
    source += _bounds_source(shapes, dimensions, traced=True)
    source += _world_source(shapes)
    module = source_module("\n".join(source) + "\n", scope)
    return ShapeCode(
        shapes,
        inlined(module.evaluate),
        inlined(module.corner),
        inlined(module.swept),
        inlined(module.convex),
        inlined(module.shape_bounds),
        inlined(module.write_world),
        mixing(rules),
        any(shape.turned is not None for shape in shapes),
        tuple(indices for indices, pair in pairs.items() if pair is None),
    )


def half_extents_kernel(shape: Shape, dimensions: int) -> Any:
    """A kernel (shapes, half, like) that writes the half extents (n, d) of the boxes around n shapes of one kind.

    shapes: a tuple with the shape's :func:`parameter_columns`.
    """
    key = (dimensions, shape)
    if key not in _half_extents:
        scope: dict[str, Any] = {"row": row, "array_at": array_at, "axes_at": axes_at, "bounds0": shape.bounds}
        scope["Shape0"] = collections.namedtuple("Shape0", shape.parameters)
        title = f'"""Bounds of {shape.component.__name__}, {dimensions}D."""'
        lines = [title, "", *_bounds_source((shape,), dimensions)]
        bounds = inlined(source_module("\n".join(lines) + "\n", scope).shape_bounds)

        @kernel
        def half_extents(shapes, half, like):
            for i in range(len(half)):
                store(half, i, bounds(0, i, shapes, like))

        _half_extents[key] = half_extents
    return _half_extents[key]


def parameter_columns(shape: Shape, arrays: Mapping[str, np.ndarray], axes: np.ndarray) -> tuple[Any, ...]:
    """What kernels need to make the parameters of any row; arrays: columns by name; axes (n, d, d) of the bodies."""
    columns: list[Any] = []
    for name in shape.columns:
        column = shape.component.columns[name]
        columns.append(column.parameters(arrays[name]) if isinstance(column, ArrayColumn) else arrays[name])
    return (*columns, axes) if shape.rotates else tuple(columns)


def parameters_source(shapes: tuple[Shape, ...], index: int, at: str) -> str:
    """Source of the parameter tuple of shape ``index`` at row ``at``."""
    shape = shapes[index]
    parts = []
    for place, name in enumerate(shape.columns):
        array = f"shapes[{index}][{place}]"
        column = shape.component.columns[name]
        if isinstance(column, ArrayColumn):
            parts.append(f"array_at({array}[0], {array}[1], {array}[2], {at})")
        else:
            parts.append(f"row({array}, {at}, like)" if column.item == "vector" else f"{array}[{at}]")
    if shape.rotates:
        parts.append(f"axes_at(shapes[{index}][{len(shape.columns)}], {at}, like)")
    return f"Shape{index}({', '.join(parts)})"


def pair_call(pair: Pair, name: str, scope: dict[str, Any], one: str, two: str, d: str) -> str:
    """Source of a call of the pair's function, with its helpers; puts these into ``scope``."""
    scope[name] = pair.function
    helpers = ""
    for place, helper in enumerate(pair.helpers):
        scope[f"{name}_{place}"] = helper
        helpers += f", {name}_{place}"
    return f"{name}({one}, {two}, {d}{helpers})"


def _evaluate_source(
    shapes: tuple[Shape, ...], pairs: dict[tuple[int, int], Pair | None], scope: dict[str, Any]
) -> list[str]:
    """The trace, an array behind the shapes' parameters, keeps the rows looked at last, for when a pair's function
    raises; and those of a contact that is not finite, which counts as none."""
    many, trace = len(shapes) > 1, f"shapes[{len(shapes)}]"
    lines = ["def evaluate(shape_a, a, shape_b, b, d, shapes, like):"]
    lines += [f"    {trace}[ROW_A], {trace}[ROW_B] = a, b"]
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
    for (i, j), pair in pairs.items():
        indent = "    "
        if many:
            last = i == j == len(shapes) - 1
            lines.append("    else:" if last else f"    {opening} shape_a == {i} and shape_b == {j}:")
            opening = "elif"
            indent = "        "
        one, two = parameters_source(shapes, i, "a"), parameters_source(shapes, j, "b")
        if pair is None:
            lines.append(f"{indent}hit, depth, normal, point = False, APART, d, d")
        elif pair.first is shapes[i].component:
            lines.append(f"{indent}hit, depth, normal, point = {pair_call(pair, f'pair{i}_{j}', scope, one, two, 'd')}")
        else:
            call = pair_call(pair, f"pair{i}_{j}", scope, two, one, "negative(d)")
            lines += [
                f"{indent}hit, depth, normal, point = {call}",
                f"{indent}normal = negative(normal)",
                f"{indent}point = sub(point, negative(d))",
            ]
    lines += [
        "    if not sound(hit, depth, normal, point):",
        "        hit, depth, normal, point = False, APART, d, d",
        "        if finite(dot(d, d)):",
        f"            {trace}[UNSOUND], {trace}[UNSOUND_A], {trace}[UNSOUND_B] = 1, a, b",
    ]
    if many:
        lines += ["    if swapped:", "        normal = negative(normal)"]
        lines += ["        point = sub(point, negative(direction))"]
    return [*lines, "    return hit, depth, normal, point", ""]


def _corner_source(
    shapes: tuple[Shape, ...], pairs: dict[tuple[int, int], Pair | None], scope: dict[str, Any]
) -> list[str]:
    """Only of the pairs that know corners; nearly all do not."""
    lines = ["def corner(shape_a, a, shape_b, b, d, slop, shapes, like):"]
    for (one, two), pair in pairs.items():
        if pair is None or pair.corner is None:
            continue
        i, j = (one, two) if pair.first is shapes[one].component else (two, one)
        scope[f"corner{i}_{j}"] = pair.corner
        first, second = parameters_source(shapes, i, "a"), parameters_source(shapes, j, "b")
        lines += [f"    if shape_a == {i} and shape_b == {j}:"]
        lines += [f"        return corner{i}_{j}({first}, {second}, d, slop)"]
        if i != j:
            first, second = parameters_source(shapes, i, "b"), parameters_source(shapes, j, "a")
            lines += [f"    if shape_a == {j} and shape_b == {i}:"]
            lines += [f"        return corner{i}_{j}({first}, {second}, negative(d), slop)"]
    return [*lines, "    return False", ""]


def _swept_source(
    shapes: tuple[Shape, ...], pairs: dict[tuple[int, int], Pair | None], scope: dict[str, Any]
) -> list[str]:
    """Only of the pairs that have a sweep; one whose time is out of its bounds counts as a miss, and is kept in the
    trace."""
    trace, lines = f"shapes[{len(shapes)}]", ["def swept(shape_a, a, shape_b, b, d, v, shapes, like):"]
    for (one, two), pair in pairs.items():
        if pair is None or pair.sweep is None:
            continue
        i, j = (one, two) if pair.first is shapes[one].component else (two, one)
        moving = replace(pair, function=pair.sweep)
        for first, second in ((i, j), (j, i)) if i != j else ((i, j),):
            turned = (first, second) != (i, j)
            one_row, two_row = ("b", "a") if turned else ("a", "b")
            call = pair_call(
                moving, f"sweep{i}_{j}", scope, parameters_source(shapes, i, one_row),
                parameters_source(shapes, j, two_row), "negative(d), negative(v)" if turned else "d, v",
            )  # fmt: skip
            lines += [
                f"    if shape_a == {first} and shape_b == {second}:",
                f"        {trace}[ROW_A], {trace}[ROW_B] = a, b",
                f"        hit, time = {call}",
                "        if hit and not 0.0 <= time <= 1.0:",
                f"            {trace}[UNSOUND], {trace}[UNSOUND_A], {trace}[UNSOUND_B] = OUT_OF_TIME, a, b",
                "            return True, False, 0.0",
                "        return True, hit, time",
            ]
    return [*lines, "    return False, False, 0.0", ""]


def _convex_source(shapes: tuple[Shape, ...]) -> list[str]:
    dented = [str(index) for index, shape in enumerate(shapes) if not shape.convex]
    tests = [f"shape_a != {index} and shape_b != {index}" for index in dented]
    return ["def convex(shape_a, shape_b):", f"    return {' and '.join(tests) or 'True'}", ""]


def _bounds_source(shapes: tuple[Shape, ...], dimensions: int, traced: bool = False) -> list[str]:
    """``traced``: the trace keeps the row looked at last, and one whose bounds are no numbers."""
    trace, lines = f"shapes[{len(shapes)}]", ["def shape_bounds(shape, at, shapes, like):"]
    if traced:
        lines.append(f"    {trace}[ROW_A], {trace}[ROW_B] = at, ALONE")
    for index in range(len(shapes)):
        last = index == len(shapes) - 1
        branch = "else:" if last else f"{'el' if index else ''}if shape == {index}:"
        lines.append(f"    {'if True:' if len(shapes) == 1 else branch}")
        lines.append(f"        half = bounds{index}({parameters_source(shapes, index, 'at')}, {dimensions})")
    if traced:
        wrong = " or ".join(f"not half[{k}] >= 0.0" for k in range(dimensions))
        lines.append(f"    if {wrong}:")
        lines.append(f"        {trace}[UNSOUND], {trace}[UNSOUND_A], {trace}[UNSOUND_B] = 1, at, ALONE")
    return [*lines, "    return half", ""]


def _world_source(shapes: tuple[Shape, ...]) -> list[str]:
    """Parameters as they are in the world: turned where the shape turns."""
    lines = ["def write_world(shape, at, shapes, world, turn, axes, like):"]
    for index, shape in enumerate(shapes):
        if shape.turned is None:
            continue
        lines += [f"    if shape == {index}:", "        if turn:"]
        lines.append(f"            new = turned{index}({parameters_source(shapes, index, 'at')}, axes[at])")
        for place, name in enumerate(shape.columns):
            lines.append(_assign(shape, index, place, name, f"new[{place}]", 12))
        lines.append("        else:")
        for place, name in enumerate(shape.columns):
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
