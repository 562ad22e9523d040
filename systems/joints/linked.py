"""The linked function of a plugin's joint: gives the function its fields and bodies, looks at what it returns."""

from __future__ import annotations

import math
from functools import lru_cache

from ...framework.data.component import Component
from ...framework.jit.linking import CACHE_SIZE, Linked
from ...framework.jit.source import source_module
from ...framework.vectors import add, dot
from ..shapes.linking.user_functions import user_function
from .custom import custom_signature
from .measuring import turned_with
from .own import OwnJoint, Placed, fields_of, seen_columns


def _fields_source(component: type[Component], dimensions: int) -> str:
    parts, at = [], 0
    for column in seen_columns(component):
        places = [f"numbers[at + {at + k}]" for k in range(math.prod(column.item_shape(dimensions)))]
        parts.append(f"({', '.join(places)})" if column.item_shape(dimensions) else places[0])
        at += len(places)
    return f"Fields({', '.join(parts)})"


def _body_source(side: str, body: str, dimensions: int) -> str:
    axes = (f"turned_with(solver, {body}, joints.axes_{side}[{dimensions} * j + {k}])" for k in range(dimensions))
    return f"Placed(add(joints.base_{side}[j], solver.shift[{body}]), ({', '.join(axes)}))"


@lru_cache(maxsize=CACHE_SIZE)
def linked_joint(joint: OwnJoint, dimensions: int) -> Linked:
    """The function of that joint, the same one for all worlds of this process."""
    rows, single, lines = joint.rows[dimensions == 3], joint.single[dimensions == 3], []
    for k, tells in enumerate(rows):
        row = "made" if single else f"made[{k}]"
        value, size = f"{row}[0] * 1.0" if tells else "math.nan", f"{row}[0]" if tells else "0.0"
        lines += [
            f"if joints.part[j] == {k}:" if k < len(rows) - 1 else "if True:",
            f"    size = {size} * 1.0",
            *(f"    size += dot({row}[{place}], {row}[{place}])" for place in range(1, 5)),
            "    if not math.isfinite(size):",
            "        raise ValueError('it returned a number that is not finite')",
            f"    return {value}, {row}[1], {row}[2], {row}[3], {row}[4]",
        ]
    scope = {
        "function": user_function(joint.function), "Fields": fields_of(joint.component), "Placed": Placed,
        "turned_with": turned_with, "add": add, "dot": dot, "math": math,
    }  # fmt: skip
    header = [
        "def given(solver, j):", "joints, a, b = solver.joints, solver.joints.first[j], solver.joints.second[j]",
        "numbers, at = joints.numbers, joints.numbers_at[j]",
        f"fields = {_fields_source(joint.component, dimensions)}",
        f"place_a = {_body_source('a', 'a', dimensions)}", f"place_b = {_body_source('b', 'b', dimensions)}",
        "made = function(fields, place_a, place_b)",
    ]  # fmt: skip
    title = f'"""{joint.component.__name__}, {dimensions}D."""\n\n'
    made = source_module(title + "\n    ".join([*header, *lines]) + "\n", scope)
    what = f"plugin {joint.plugin}: constraint of joint {joint.component.__name__}, {dimensions}D,"
    return Linked(made.given, custom_signature(dimensions), what)
