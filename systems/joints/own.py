"""Joints of plugins: what their function gets, what it is checked for when it is registered, and
how it is linked: with its fields and bodies given, and a look at what it returns."""

from __future__ import annotations

import collections
import inspect
import math
import numbers
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from ...framework.compilation import inlined
from ...framework.data.arrays.column import ArrayColumn
from ...framework.data.columns import REQUIRED
from ...framework.data.component import Component
from ...framework.errors import PluginError
from ...framework.jit.linking import CACHE_SIZE, Linked
from ...framework.jit.source import source_module
from ...framework.plugins.laws import Law
from ...framework.vectors import add, dot
from ..shapes.linking.user_functions import user_function
from .custom import custom_signature
from .measuring import turned_with

# What functions do not see of a joint.
HIDDEN = ("a", "b", "collide_connected", "breaking_force", "breaking_torque", "attached", "changed")
ARGUMENTS = ("joint", "a", "b")
ROW_FIELDS = "(value, along_a, turn_a, along_b, turn_b)"
CHANGE = (
    "along_a . v_a + turn_a . w_a + along_b . v_b + turn_b . w_b is the change of the value per second; a push at an "
    "arm turns by moment(arm, push)"
)
STEP = 1e-6  # m and rad
RATE = 1e-3  # of the vectors: by so much the change of the value may differ

# Positions and rotation matrices of two bodies to try functions with, and how they move.
SAMPLE_PLACES = np.array(((0.0, 0.0, 0.0), (1.0, 0.5, -0.25)))
MATRICES = np.array((np.eye(3), ((0.8, -0.6, 0.0), (0.6, 0.8, 0.0), (0.0, 0.0, 1.0))))
WAYS = np.array((((0.5, -0.2, 0.1), (0.3, 0.7, -0.4)), ((0.8, 0.0, -0.3), (-0.6, 0.0, 0.2))))


@dataclass(frozen=True)
class OwnJoint:
    """A joint whose rows a function gives; (joint, a, b) -> (value, along a, turn of a, along b, turn of b), or a tuple
    of such rows, compiled.

    single
        in 2D and in 3D: whether it returns one row
    rows
        likewise, for each row whether it tells its value; none in worlds in which it cannot be
    """

    component: type[Component]
    function: Any
    plugin: str
    single: tuple[bool, bool]
    rows: tuple[tuple[bool, ...], tuple[bool, ...]]


class Placed(NamedTuple):
    """Where a body is, for the function: ``position``, m, and ``axes``, those of the body in the world, d vectors."""

    position: Any
    axes: Any


def seen_columns(component: type[Component]) -> list[Any]:
    """The columns that the function sees."""
    columns = component.columns.items()
    return [column for name, column in columns if name not in HIDDEN and not isinstance(column, ArrayColumn)]


@lru_cache(maxsize=1024)
def fields_of(component: type[Component]) -> Any:
    """The named tuple of the fields that the function gets."""
    return collections.namedtuple(component.__name__, [column.name for column in seen_columns(component)])


def custom_numbers(joint: Component, dimensions: int) -> np.ndarray:
    """These fields one after the other, NaN for None."""
    found = []
    for column in seen_columns(type(joint)):
        value = np.asarray(column.checked(getattr(joint, column.name)), float)
        found.append(np.broadcast_to(value, column.item_shape(dimensions)).ravel())
    return np.concatenate(found)


def custom_parameters(joint: Component, dimensions: int) -> Any:
    """These fields, for a call from Python."""
    given, values, at = custom_numbers(joint, dimensions), [], 0
    for column in seen_columns(type(joint)):
        shape = column.item_shape(dimensions)
        part = tuple(given[at : at + math.prod(shape)])
        values.append(part if shape else part[0])
        at += len(part)
    return fields_of(type(joint))(*values)


def rows_of(component: Any, joint: Any, a: Placed, b: Placed) -> tuple[Any, ...]:
    """What the function returns where these bodies are, as a tuple of rows."""
    made = component.constraint(custom_parameters(joint, len(a.position)), a, b)
    return (made,) if _is_single(made) else made


def numbers_at(component: Any, joint: Any, places: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """(n, rows, 1 + 4 d) values and vectors where the bodies are at ``places`` (n, 2, d), m, with rotation matrices
    ``axes`` (n, 2, d, d); NaN for values that are not told."""
    found = []
    for at, matrices in zip(places, axes, strict=True):
        bodies = (Placed(tuple(p), tuple(map(tuple, matrix.T))) for p, matrix in zip(at, matrices, strict=True))
        with np.errstate(all="ignore"):
            rows = rows_of(component, joint, *bodies)
        found.append([(np.nan if row[0] is None else row[0], *np.ravel(row[1:])) for row in rows])
    return np.array(found, float)


def change_law(component: Any, joint: Any, places: np.ndarray, axes: np.ndarray, ways: np.ndarray) -> Law:
    """The vectors of each row are the change of its value, for bodies that move by ``ways`` (n, 2, 2, d) m and rad."""
    turns = ways[:, 1]
    if places.shape[-1] == 3:
        turned = np.cross(turns[..., None, :], axes.swapaxes(-1, -2)).swapaxes(-1, -2)
    else:
        turned = turns[..., :1, None] * np.stack((-axes[..., 1, :], axes[..., 0, :]), axis=-2)
    behind, ahead = (
        numbers_at(component, joint, places + step * ways[:, 0], axes + step * turned)[..., 0] for step in (-STEP, STEP)
    )
    vectors = numbers_at(component, joint, places, axes)[..., 1:]
    said = (vectors * ways.swapaxes(1, 2).reshape(len(ways), 1, -1)).sum(axis=-1)
    true = (ahead - behind) / (2 * STEP)
    wrong = np.abs(said - true) > RATE * (1.0 + np.abs(vectors).sum(axis=-1))
    row = wrong.argmax(axis=1)
    true, said = (np.take_along_axis(each, row[:, None], axis=1)[:, 0] for each in (true, said))
    what = "row {}: its value changes by {:.6g}, by its vectors {:.6g}"
    return Law(wrong.any(axis=1), what, CHANGE, (row, true, said))


def _is_single(made: Any) -> bool:
    """Whether that is one row, and no tuple of rows."""
    return not (isinstance(made, tuple) and made and isinstance(made[0], tuple))


def sample_of(component: Any, dimensions: int) -> Any:
    """A joint with 0.5 in all fields that have to be given, which holds two bodies."""
    if hasattr(component, "sample"):
        joint = component.sample()
    else:
        demanded = {name: 1 if column.dtype is np.int64 else 0.5
                    for name, column in component.columns.items() if column.default is REQUIRED}  # fmt: skip
        joint = component(**{**demanded, "a": 1, "b": 2})
    one, other = np.eye(dimensions)[:2]
    joint.keep(at_a=0.25 * one, at_b=0.5 * other, axis_a=one, axis_b=one, side_a=other, side_b=other)
    return joint


def own_joint(plugin: Any, component: type[Component]) -> OwnJoint:
    """The joint that a class of a plugin is; PluginError unless it can be one. Tries its function."""
    where = f"plugin {plugin.name}: joint {component.__name__}"
    if component._abstract or not {"a", "b"} <= component.columns.keys():
        raise PluginError(f"{where} cannot be a joint: give the class columns a and b")
    function = inspect.getattr_static(component, "constraint", None)
    function = getattr(function, "__func__", function)
    if not inspect.isfunction(function):
        raise PluginError(f"{where} has no constraint: write constraint(joint, a, b) that returns {ROW_FIELDS}")
    given = tuple(inspect.signature(function).parameters)
    if len(given) != len(ARGUMENTS):
        raise PluginError(f"{where}: constraint takes ({', '.join(given)}), it must take ({', '.join(ARGUMENTS)})")
    tried = [_try(where, component, dimensions) for dimensions in (2, 3)]
    single, rows = tuple(single for single, _ in tried), tuple(rows for _, rows in tried)
    return OwnJoint(component, inlined(function), plugin.name, single, rows)


def _try(where: str, component: Any, dimensions: int) -> tuple[bool, tuple[bool, ...]]:
    """Whether the function returns one row, and for each whether it tells its value."""
    if dimensions not in component.dimensions:
        return True, ()
    d, sample = dimensions, sample_of(component, dimensions)
    a, b = (
        Placed(tuple(place), tuple(map(tuple, axes)))
        for place, axes in zip(SAMPLE_PLACES[:, :d].tolist(), MATRICES[:, :d, :d].swapaxes(1, 2).tolist(), strict=True)
    )
    said = f"{where}: constraint, tried in {dimensions}D,"
    try:
        made = component.constraint(custom_parameters(sample, dimensions), a, b)
    except Exception as error:  # whatever it raises, its author has to hear of
        raise PluginError(f"{said} raised {type(error).__name__}: {error}") from error
    rows = (made,) if _is_single(made) else made
    for row in rows:
        if not isinstance(row, tuple) or len(row) != 5:
            raise PluginError(f"{said} returned {row!r}: return {ROW_FIELDS}, or a tuple of such rows")
        for name, vector in zip(("along_a", "turn_a", "along_b", "turn_b"), row[1:], strict=True):
            if not (isinstance(vector, tuple) and len(vector) == dimensions and all(map(_is_finite, vector))):
                flat = " (in 2D a turn is (turn, 0.0))" if dimensions == 2 and name[:4] == "turn" else ""
                raise PluginError(f"{said} returned {vector!r} as {name}: return a tuple of {dimensions} numbers{flat}")
        if row[0] is not None and not _is_finite(row[0]):
            raise PluginError(f"{said} returned {row[0]!r} as value: return a number, or None for the sum of changes")
    law = change_law(component, sample, SAMPLE_PLACES[None, :, :d], MATRICES[None, :, :d, :d], WAYS[None, :, :, :d])
    if law.is_broken:
        raise PluginError(f"{said} {law.said(0)}: {law.cure}")
    return _is_single(made), tuple(row[0] is not None for row in rows)


def _is_finite(value: Any) -> bool:
    number = isinstance(value, numbers.Real) and not isinstance(value, (bool, np.bool_))
    return bool(number and math.isfinite(value))


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
