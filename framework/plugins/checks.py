"""What a plugin's functions are checked for when they are registered, before anything compiles.

They are run as plain Python on a few inputs: what is refused could not work in any scene. A message names plugin,
shape, function, the input and the cure. ``carom plugins check`` checks the laws that they have to obey, on many inputs.
"""

from __future__ import annotations

import collections
import inspect
import math
import numbers
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from ..data.component import Component
from ..errors import PluginError
from ..jit.records.schema import Column, Schema
from ..schedule.stages import answers
from .registry import Convex, Shape

SHAPE_FUNCTIONS = {
    "bounds": ("shape", "dimensions"),
    "support": ("shape", "direction"),
    "rounding": ("shape",),
    "turned": ("shape", "axes"),
    "second_moments": ("shape", "dimensions"),
}
POSES = ((1.0, 0.0, 0.0), (0.3, -0.2, 0.1), (0.0, 0.0, 0.0), (-2.0, 3.0, 1.0))  # of b as seen from a
VALUES = ((0.0, 0.0), (0.25, 1.0), (1.0, 0.5), (3.0, 0.0))  # of both bodies, for a mixing rule
# What functions of pairs with Convex get besides, by how many of the two it is.
HELPERS = {0: (), 1: ("support", "rounding"), 2: ("a_support", "b_support", "a_rounding", "b_rounding")}
UNIT = 1e-9  # how far from 1 a normal's length may be


# -- shapes ---------------------------------------------------------------------------------------


def check_shape(plugin: Any, component: Any, cost: float) -> None:
    """PluginError unless the class can be a shape; also tries its functions."""
    where = f"plugin {plugin.name}: shape {getattr(component, '__name__', component)!s}"
    if not (isinstance(component, type) and issubclass(component, Component)) or component._abstract:
        raise PluginError(f"{where}: a shape is a class derived from Collider, got {component!r}")
    if getattr(component, "stack", None) is None:
        raise PluginError(f"{where} must derive from carom.components.Collider, which brings friction, layer and mask")
    if isinstance(cost, bool) or not isinstance(cost, numbers.Real) or not (math.isfinite(cost) and cost > 0):
        raise PluginError(f"{where}: cost must be a number above 0, the sphere's being 1, got {cost!r}")
    allowed = getattr(component, "dimensions", (2, 3))
    if not isinstance(allowed, tuple) or not allowed or not set(allowed) <= {2, 3}:
        raise PluginError(f"{where}: dimensions must be (2,), (3,) or (2, 3), got {allowed!r}")
    for name, arguments in SHAPE_FUNCTIONS.items():
        function = inspect.getattr_static(component, name, None)
        function = getattr(function, "__func__", function)
        if function is None:
            if name == "bounds":
                raise PluginError(
                    f"{where} has no bounds: write bounds(shape, dimensions) that returns the half extents of the box "
                    f"around it, a tuple of {allowed[0]} numbers"
                )
            continue
        if not inspect.isfunction(function):
            raise PluginError(f"{where}: {name} must be a function, got {function!r}")
        _check_arity(f"{where}: {name}", function, arguments)
    for dimensions in allowed:
        _check_extents(where, component, parameters_of(component, dimensions), dimensions)


def _check_extents(where: str, component: Any, sample: Any, dimensions: int) -> None:
    """Bounds, support and rounding of a sample."""
    half = _call(f"{where}: bounds(shape, {dimensions})", component.bounds, (sample, dimensions), sample)
    said = f"{where}: bounds(shape, {dimensions}) for {shown(sample)} returned {plain(half)!r}"
    if not _is_vector(half, dimensions):
        raise PluginError(f"{said}: return half extents of the box around it, a tuple of {dimensions} numbers")
    if any(math.isnan(x) or x < 0 for x in half):
        raise PluginError(f"{said}: half extents are not negative")
    if hasattr(component, "second_moments"):
        _check_moments(f"{where}: second_moments(shape, {dimensions})", component, sample, dimensions)
    if not hasattr(component, "support"):
        return
    rounding = getattr(component, "rounding", lambda shape: 0.0)
    beyond = _call(f"{where}: rounding(shape)", rounding, (sample,), sample)
    if not _is_number(beyond) or not (math.isfinite(beyond) and beyond >= 0):
        raise PluginError(f"{where}: rounding(shape) for {shown(sample)} returned {beyond!r}: return a number from 0")
    for direction in (pose[:dimensions] for pose in POSES if any(pose)):
        point = _call(f"{where}: support(shape, direction)", component.support, (sample, direction), sample)
        said = f"{where}: support(shape, {direction}) for {shown(sample)} returned {plain(point)!r}"
        if not _is_vector(point, dimensions):
            raise PluginError(f"{said}: return a point, a tuple of {dimensions} numbers")
        if not all(map(math.isfinite, point)):
            raise PluginError(f"{said}: the shape's farthest point in a direction must be finite")


def _check_moments(where: str, component: Any, sample: Any, dimensions: int) -> None:
    """Measure, centre and second moments of a sample: squares have no mean below zero."""
    found = _call(where, component.second_moments, (sample, dimensions), sample)
    count = 1 + dimensions + dimensions * (dimensions + 1) // 2
    if not _is_vector(found, count) or not all(map(math.isfinite, found)):
        names = f"measure, centre, means of {'xx, xy, yy' if dimensions == 2 else 'xx, yy, zz, xy, xz, yz'}"
        raise PluginError(f"{where} for {shown(sample)} returned {plain(found)!r}: return {count} numbers, {names}")
    squares = (found[3], found[5]) if dimensions == 2 else found[4:7]
    if found[0] < 0 or min(squares) < 0:
        raise PluginError(f"{where} for {shown(sample)} returned {plain(found)!r}: squares are not negative")


# -- pairs ----------------------------------------------------------------------------------------


def check_pair(plugin: Any, first: Any, second: Any, function: Any) -> None:
    """PluginError unless the function can be that of the two shapes; also tries it."""
    name = getattr(function, "__name__", repr(function))
    where = f"plugin {plugin.name}: pair {name} of {_name(first)} and {_name(second)}"
    for shape in (first, second):
        if shape is not Convex and not (isinstance(shape, type) and issubclass(shape, Component)):
            raise PluginError(f"{where}: a pair is of two collider classes, or one and Convex, got {shape!r}")
    if not inspect.isfunction(plain_function(function)):
        raise PluginError(f"{where}: register a plain function; carom compiles it itself")
    convex = (first is Convex) + (second is Convex)
    _check_arity(where, plain_function(function), ("a", "b", "d", *HELPERS[convex]))
    depths = [_check_contact(where, function, *sample) for sample in _samples(first, second)]
    if max(depths, default=-math.inf) >= 0 and -math.inf in depths:
        raise PluginError(
            f"{where}: apart, its depth is minus infinity; return minus the gap, or less than it: times of impact and "
            f"casts are found from it"
        )


def _check_contact(where: str, function: Any, a: Any, b: Any, d: tuple[Any, ...]) -> float:
    """Call a pair function and return the depth; PluginError if the result is no contact."""
    at = f"a = {shown(a)}, b = {shown(b)}, d = {plain(d)}"
    result = _call(f"{where}: {at}", function, (a, b, d), a)
    said = f"{where}: for {at} it returned {plain(result)!r}"
    if not (isinstance(result, tuple) and len(result) == 4):
        raise PluginError(f"{said}: return (hit, depth, normal, point)")
    hit, depth, normal, point = result
    if not isinstance(hit, (bool, np.bool_)):
        raise PluginError(f"{said}: hit, the first value, must be True or False")
    if not _is_number(depth):
        raise PluginError(f"{said}: depth, the second value, must be a number")
    for what, vector in (("normal", normal), ("point", point)):
        if not _is_vector(vector, len(d)):
            flat = "; a shape of 2D worlds only has dimensions = (2,)" if len(d) == 3 else ""
            raise PluginError(f"{said}: {what} must be a tuple of {len(d)} numbers{flat}")
    fault = contact_fault(hit, depth, normal, point)
    if fault:
        centres = " (the centres coincide: choose any normal then)" if not any(d) else ""
        raise PluginError(f"{said}: {fault}{centres}")
    return float(depth)


def contact_fault(hit: bool, depth: float, normal: Iterable[float], point: Iterable[float]) -> str:
    """What is wrong with a contact, and the cure; "" if nothing is."""
    if not hit and depth == -math.inf:  # far apart, and the function did not care how far
        return ""
    if not all(map(math.isfinite, (depth, *normal, *point))):
        return "every value must be finite"
    if bool(hit) != (depth >= 0):
        return "depth is how far they overlap, so hit must be depth >= 0; apart, depth is minus the gap"
    length = math.hypot(*normal)
    if abs(length - 1.0) > UNIT:
        return f"the normal's length is {length:.6g}, it must be 1: divide it by its length"
    return ""


def check_sweep(plugin: Any, first: Any, second: Any, function: Any) -> None:
    name = getattr(function, "__name__", repr(function))
    where = f"plugin {plugin.name}: sweep {name} of {_name(first)} and {_name(second)}"
    if (first, second) not in plugin.pairs:
        raise PluginError(f"{where}: register the pair itself first, with @plugin.pair in the same order")
    if not inspect.isfunction(function):
        raise PluginError(f"{where}: register a plain function; carom compiles it itself")
    convex = (first is Convex) + (second is Convex)
    _check_arity(where, function, ("a", "b", "d", "v", *HELPERS[convex]))
    for a, b, d in _samples(first, second):
        v = tuple(-2.0 * x for x in d)
        at = f"a = {shown(a)}, b = {shown(b)}, d = {plain(d)}, v = {plain(v)}"
        result = _call(f"{where}: {at}", function, (a, b, d, v), a)
        said = f"{where}: for {at} it returned {plain(result)!r}"
        if not (isinstance(result, tuple) and len(result) == 2 and isinstance(result[0], (bool, np.bool_))):
            raise PluginError(f"{said}: return (hit, time), whether they touch on that way and after which part of it")
        if not _is_number(result[1]) or (result[0] and not 0 <= result[1] <= 1):
            raise PluginError(f"{said}: the time of a hit is the part of v after which they touch, from 0 to 1")


def check_corner(plugin: Any, first: Any, second: Any, corner: Any) -> None:
    """PluginError unless it is None or can tell corners."""
    if corner is None:
        return
    name = getattr(corner, "__name__", repr(corner))
    where = f"plugin {plugin.name}: corner {name} of {_name(first)} and {_name(second)}"
    if not inspect.isfunction(plain_function(corner)):
        raise PluginError(f"{where}: corner= takes a function of (a, b, d, slop)")
    convex = (first is Convex) + (second is Convex)
    _check_arity(where, plain_function(corner), ("a", "b", "d", "slop", *HELPERS[convex]))
    for a, b, d in _samples(first, second):
        result = _call(where, corner, (a, b, d, np.float64(0.01)), a)
        if not isinstance(result, (bool, np.bool_)):
            raise PluginError(f"{where}: for d = {plain(d)} it returned {plain(result)!r}: return True or False")


def _samples(first: Any, second: Any) -> Iterator[tuple[Any, Any, Any]]:
    """(a, b, d) of two samples in some poses, in every dimension both can be in; none of Convex."""
    for dimensions in () if Convex in (first, second) else sorted({*_dimensions(first)} & {*_dimensions(second)}):
        a, b = (parameters_of(each, dimensions) for each in (first, second))
        for pose in POSES:
            yield a, b, tuple(np.float64(x) for x in pose[:dimensions])


# -- other things ---------------------------------------------------------------------------------


def check_integrator(plugin: Any, name: str, integrator: Any) -> None:
    where = f"plugin {plugin.name}: integrator {name!r}"
    check_name(where, name)
    missing = [part for part in ("advance", "order", "evaluations", "path") if not hasattr(integrator, part)]
    if missing or not callable(integrator):
        raise PluginError(
            f"{where}: register a class with advance(motion, dt), order, evaluations and path"
            + (f"; {getattr(integrator, '__name__', integrator)} has no {', '.join(missing)}" if missing else "")
        )
    _check_arity(f"{where}: advance", integrator.advance, ("self", "motion", "dt"))
    for part, least, most in (("order", 1, 99), ("evaluations", 1, 99), ("path", 1, 3)):
        value = getattr(integrator, part)
        if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
            raise PluginError(f"{where}: {part} must be a whole number from {least} to {most}, got {value!r}")


def check_broad_phase(plugin: Any, name: str, broad_phase: Any) -> None:
    where = f"plugin {plugin.name}: broad phase {name!r}"
    check_name(where, name)
    if not isinstance(broad_phase, type) or not inspect.isfunction(getattr(broad_phase, "pairs", None)):
        raise PluginError(f"{where}: register a class with pairs(lower, upper, moving), got {broad_phase!r}")
    _check_arity(f"{where}: pairs", broad_phase.pairs, ("self", "lower", "upper", "moving"))


def check_mixing_rule(plugin: Any, name: str, function: Any) -> None:
    where = f"plugin {plugin.name}: mixing rule {name!r}"
    check_name(where, name)
    if not inspect.isfunction(function):
        raise PluginError(f"{where}: register a plain function of two numbers, got {function!r}")
    _check_arity(where, function, ("x", "y"))
    check_mixed(where, function, VALUES)


def check_mixed(where: str, function: Any, values: Iterable[Any]) -> None:
    """PluginError unless the rule makes one number of each two, from 0, whichever comes first."""
    for x, y in values:
        there, back = _call(where, function, (x, y), None), _call(where, function, (y, x), None)
        if not _is_number(there) or not (math.isfinite(there) and there >= 0):
            raise PluginError(f"{where}: for {x} and {y} it returned {there!r}: return a number from 0")
        if there != back:
            raise PluginError(f"{where}: for {x} and {y} it returned {there!r}, for {y} and {x} {back!r}: both are one")


def check_filter(plugin: Any, function: Any) -> None:
    where = f"plugin {plugin.name}: pair filter {getattr(function, '__name__', function)!s}"
    if not inspect.isfunction(function):
        raise PluginError(f"{where}: register a function of (bodies, a, b), got {function!r}")
    _check_arity(where, function, ("bodies", "a", "b"))


def check_stage(
    plugin: Any, function: Any, places: tuple[str, str], records: Any, columns: dict[str, Iterable[str]]
) -> tuple[str, list[tuple[Any, ...]]]:
    """The one name of a stage that is given, then records and columns as tuples; PluginError unless it can be one."""
    where = f"plugin {plugin.name}: stage {getattr(function, '__name__', function)!s}"
    if not inspect.isfunction(function) or not function.__name__.isidentifier():
        raise PluginError(f"{where}: register a plain function with a name; carom compiles it itself")
    given = [name for name in places if name]
    if len(given) != 1 or not isinstance(given[0], str):
        after, before = places
        raise PluginError(f"{where}: say after= or before= which one stage, got after={after!r}, before={before!r}")
    for what, names in columns.items():
        if isinstance(names, str) or not all(isinstance(name, str) for name in names):
            raise PluginError(f"{where}: {what} takes a tuple of names, got {names!r}")
    if not isinstance(records, tuple) or not all(map(_is_record, records)):
        raise PluginError(f"{where}: records takes a tuple of component types of your own and schemas, got {records!r}")
    names = (each.name if isinstance(each, Schema) else each.prefix.rstrip(".") for each in records)
    _check_arity(where, function, ("state", "dt", *names))
    if answers(function) != {False} and not (answers(function) == {True} and _has_rows(records)):
        raise PluginError(
            f"{where} must return nothing; one with a record of its own that has columns may return, on every path, "
            f"how many rows these need"
        )
    return given[0], [records, *(tuple(names) for names in columns.values())]


def _is_record(thing: Any) -> bool:
    """Whether stages can have a record of it: a schema, or a component type whose columns have a name of their own."""
    component = isinstance(thing, type) and issubclass(thing, Component) and not thing._abstract
    return isinstance(thing, Schema) or bool(component and thing.prefix)


def _has_rows(records: tuple[Any, ...]) -> bool:
    schemas = (each for each in records if isinstance(each, Schema))
    return any(is_column(field) for each in schemas for field in each.fields.values())


def is_column(field: Any) -> bool:
    """Whether a field of a schema has rows that can become more."""
    return isinstance(field, Column) and not field.stacked


def check_system(plugin: Any, make: Any) -> None:
    if not callable(make):
        raise PluginError(f"plugin {plugin.name}: system takes a class, or a function that makes one, got {make!r}")


def check_name(where: str, name: Any) -> None:
    if not isinstance(name, str) or not name:
        raise PluginError(f"{where}: it needs a name")


# -- helpers of these checks ----------------------------------------------------------------------


def parameters_of(component: Any, dimensions: int) -> Any:
    """What a pair function gets for a sample of the shape."""
    shape, sample = Shape(component, 1.0, None, None, ""), component.sample()
    values: dict[str, Any] = {}
    for name in shape.columns:
        column, value = component.columns[name], getattr(sample, name)
        if column.item == "vector":
            value = tuple(np.float64(x) for x in np.broadcast_to(value, (dimensions,)))
        elif column.item != "array":
            value = np.float64(np.nan if value is None else value) if column.dtype is float else column.checked(value)
        values[name] = value
    if shape.rotates:
        values["axes"] = tuple(tuple(row) for row in np.eye(dimensions))
    return collections.namedtuple(component.__name__, values)(**values)


def _call(where: str, function: Any, arguments: tuple[Any, ...], sample: Any) -> Any:
    try:
        with np.errstate(all="ignore"):
            return function(*arguments)
    except ZeroDivisionError as error:
        raise PluginError(f"{where}: it divides by zero; handle that case first") from error
    except AttributeError as error:
        fields = f" (it has {', '.join(sample._fields)})" if sample is not None else ""
        raise PluginError(f"{where}: {error}{fields}") from error
    except Exception as error:  # whatever the plugin's function raises, its author has to hear of
        raise PluginError(f"{where}: it raised {type(error).__name__}: {error}") from error


def _check_arity(where: str, function: Any, names: tuple[str, ...]) -> None:
    parameters = inspect.signature(function).parameters.values()
    plain_ones = [p for p in parameters if p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD)]
    if len(plain_ones) != len(parameters) or len(plain_ones) != len(names):
        got = ", ".join(str(p) for p in parameters)
        raise PluginError(
            f"{where} takes ({got}), it must take {len(names)} argument{'s' if len(names) > 1 else ''}: "
            f"({', '.join(names)})"
        )


def plain_function(function: Any) -> Any:
    """What a compiled helper was made from."""
    return getattr(function, "py_func", function)


def _dimensions(component: Any) -> tuple[int, ...]:
    return tuple(getattr(component, "dimensions", (2, 3)))


def _is_number(value: Any) -> bool:
    return isinstance(value, numbers.Real) and not isinstance(value, (bool, np.bool_))


def _is_vector(value: Any, dimensions: int) -> bool:
    return isinstance(value, tuple) and len(value) == dimensions and all(map(_is_number, value))


def _name(shape: Any) -> str:
    return getattr(shape, "__name__", repr(shape))


def shown(parameters: Any) -> str:
    """A parameter tuple without numpy's types, without axes."""
    fields = ((name, value) for name, value in zip(parameters._fields, parameters, strict=True) if name != "axes")
    return f"{type(parameters).__name__}({', '.join(f'{name}={plain(value)!r}' for name, value in fields)})"


def plain(value: Any) -> Any:
    """Numbers and tuples without numpy's types."""
    if isinstance(value, tuple):
        return tuple(plain(part) for part in value)
    return value.tolist() if isinstance(value, (np.generic, np.ndarray)) else value
