"""What a plugin's functions are checked for when they are registered, before anything compiles.

They are run as plain Python on a few inputs: what is refused could not work in any scene. A message names plugin,
shape, function, the input and the cure. ``carom plugins check`` tries the same laws on many inputs.
"""

from __future__ import annotations

import collections
import inspect
import math
import numbers
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from ..data.component import Component
from ..errors import PluginError
from ..jit.records.schema import Column, Schema
from ..schedule.stages import answers
from .laws import Contacts, Law, Trial, mixing_laws, pair_laws, plain, shape_laws, sweep_laws
from .registry import Convex, Shape

SHAPE_FUNCTIONS = {
    "bounds": ("shape", "dimensions"),
    "support": ("shape", "direction"),
    "rounding": ("shape",),
    "turned": ("shape", "axes"),
    "second_moments": ("shape", "dimensions"),
}
POSES = np.array(((1.0, 0.0, 0.0), (0.3, -0.2, 0.1), (0.0, 0.0, 0.0), (-2.0, 3.0, 1.0)))  # of b as seen from a
STEPS = np.array(((0.1, 0.2, 0.0), (-0.3, 0.1, 0.2), (0.0, 0.5, -0.1), (0.04, -0.06, -0.02)))
VALUES = np.array(((0.0, 0.0), (0.25, 1.0), (1.0, 0.5), (3.0, 0.0)))  # of both bodies, for a mixing rule
# What functions of pairs with Convex get besides, by how many of the two it is.
HELPERS = {0: (), 1: ("support", "rounding"), 2: ("a_support", "b_support", "a_rounding", "b_rounding")}


def require(where: Sequence[Any], laws: Iterable[Law]) -> None:
    """PluginError for the first law that one of a few inputs breaks; it begins with ``where`` of that input."""
    with np.errstate(all="ignore"):
        for law in laws:
            if law.most is None and law.is_broken:
                row = int(np.argmax(law.broken))
                raise PluginError(f"{where[row]} {law.said(row)}: {law.cure}")


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
        if function is None and name == "bounds":
            raise PluginError(
                f"{where} has no bounds: write bounds(shape, dimensions) that returns the half extents of the box "
                f"around it, a tuple of {allowed[0]} numbers"
            )
        if function is not None and not inspect.isfunction(function):
            raise PluginError(f"{where}: {name} must be a function, got {function!r}")
        if function is not None:
            _check_arity(f"{where}: {name}", function, arguments)
    for dimensions in allowed:
        sample = parameters_of(component, dimensions)
        _check_moments(where, component, sample, dimensions)
        half = _bounds(where, component, sample, dimensions)
        support = _support(where, component, [sample] * len(POSES))
        look, other = (np.delete(poses[:, :dimensions], 2, axis=0) for poses in (POSES, STEPS))
        laws = shape_laws(np.array([half] * len(look)), support, look, other)
        require([f"{where}: for {shown(sample)} in {dimensions}D"] * len(look), laws)


def _bounds(where: str, component: Any, sample: Any, dimensions: int) -> tuple[float, ...]:
    what = "half extents of the box around it"
    return _vector_of(f"{where}: bounds", component.bounds, (sample, dimensions), dimensions, what)


def _support(where: str, component: Any, samples: list[Any]) -> Any:
    """Support and rounding of each sample in a direction per row; None if the class has no support."""
    if not hasattr(component, "support"):
        return None
    rounding = getattr(component, "rounding", lambda shape: 0.0)

    def support(directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        points, beyond = [], []
        for sample, direction in zip(samples, directions, strict=False):
            given = (sample, tuple(direction))
            points.append(_vector_of(f"{where}: support", component.support, given, len(direction), "a point"))
            beyond.append(_call(f"{where}: rounding", rounding, (sample,)))
            if not _is_number(beyond[-1]):
                raise PluginError(f"{where}: rounding for {shown(sample)} returned {beyond[-1]!r}: return a number")
        return np.array(points, float), np.array(beyond, float)

    return support


def _check_moments(where: str, component: Any, sample: Any, dimensions: int) -> None:
    """Measure, centre and second moments of a sample: squares have no mean below zero."""
    if not hasattr(component, "second_moments"):
        return
    what = f"measure, centre, means of {'xx, xy, yy' if dimensions == 2 else 'xx, yy, zz, xy, xz, yz'}"
    where, count = f"{where}: second_moments", 1 + dimensions + dimensions * (dimensions + 1) // 2
    found = _vector_of(where, component.second_moments, (sample, dimensions), count, what)
    squares = (found[3], found[5]) if dimensions == 2 else found[4:7]
    if not all(map(math.isfinite, found)) or found[0] < 0 or min(squares) < 0:
        raise PluginError(
            f"{where} for {shown(sample)} returned {plain(found)!r}: numbers are finite, measure and squares not "
            f"negative"
        )


def _vector_of(where: str, function: Any, arguments: tuple[Any, ...], count: int, what: str) -> tuple[float, ...]:
    """What a function of a shape returns, if it is a tuple of so many numbers."""
    found = _call(where, function, arguments)
    if not _is_vector(found, count):
        given = ", ".join((shown(arguments[0]), *(repr(plain(each)) for each in arguments[1:])))
        raise PluginError(f"{where}({given}) returned {plain(found)!r}: return {what}, a tuple of {count} numbers")
    return found


# -- pairs ----------------------------------------------------------------------------------------


def contacts_of(where: str, function: Any, *helpers: Any) -> Any:
    """(a, b, d) -> Contacts of a pair function as plain Python, for lists of n parameter tuples and d (n, d);
    PluginError if it returns what is no contact."""

    def contact(*pose: Any) -> tuple[Any, ...]:
        at, n = _Pose(where, *pose), len(pose[2])
        result = _call(at, function, (*pose, *helpers))
        if not (isinstance(result, tuple) and len(result) == 4):
            raise PluginError(f"{at} it returned {plain(result)!r}: return (hit, depth, normal, point)")
        if not isinstance(result[0], (bool, np.bool_)) or not _is_number(result[1]):
            cure = "hit, the first value, must be True or False, depth, the second, a number"
            raise PluginError(f"{at} it returned {plain(result)!r}: {cure}")
        if not (_is_vector(result[2], n) and _is_vector(result[3], n)):
            flat = "; a shape of 2D worlds only has dimensions = (2,)" if n == 3 else ""
            cure = f"normal and point must be tuples of {n} numbers{flat}"
            raise PluginError(f"{at} it returned {plain(result)!r}: {cure}")
        return result

    def contacts(a: list[Any], b: list[Any], d: np.ndarray) -> Contacts:
        hit, *rest = zip(*map(contact, a, b, map(tuple, d)), strict=True)
        return Contacts(np.array(hit, bool), *(np.array(values, float) for values in rest))

    return contacts


def _sweeps_of(where: str, function: Any) -> Any:
    """The same of a sweep, which returns (hit, time)."""

    def sweep(*pose: Any) -> tuple[Any, ...]:
        at = _Pose(where, *pose)
        result = _call(at, function, pose)
        fits = isinstance(result, tuple) and len(result) == 2 and isinstance(result[0], (bool, np.bool_))
        if not fits or not _is_number(result[1]):
            raise PluginError(f"{at} it returned {plain(result)!r}: return (hit, time)")
        return result

    def sweeps(a: list[Any], b: list[Any], d: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        hit, time = zip(*map(sweep, a, b, map(tuple, d), map(tuple, v)), strict=True)
        return np.array(hit, bool), np.array(time, float)

    return sweeps


class _Pose(NamedTuple):
    """The input of a pair's function, as messages show it."""

    where: str
    a: Any
    b: Any
    d: Any
    v: Any = ()

    def __str__(self) -> str:
        way = f", v = {plain(self.v)}" if self.v else ""
        return f"{self.where}: for a = {shown(self.a)}, b = {shown(self.b)}, d = {plain(self.d)}{way}"


def _trials(where: str, first: Any, second: Any, function: Any, sweep: Any = None) -> Iterator[Trial]:
    """Four poses of two samples, in every dimension both can be in; none of Convex."""
    for dimensions in () if Convex in (first, second) else sorted({*_dimensions(first)} & {*_dimensions(second)}):
        a, b = ([parameters_of(each, dimensions)] * len(POSES) for each in (first, second))
        d, steps = POSES[:, :dimensions], STEPS[:, :dimensions]
        given = ((first, a), (second, b))
        one, two = (np.array([_bounds(where, shape, each[0], dimensions)] * len(d), float) for shape, each in given)
        supports: Any = tuple(_support(where, *each) for each in given)
        calls = contacts_of(where, function), _sweeps_of(where, sweep)
        supports = None if None in supports else supports
        yield Trial(*calls, a, b, d, (one, two), steps, -2.0 * d, supports, first is second)


def _check_function(where: str, function: Any, first: Any, second: Any, arguments: tuple[str, ...]) -> str:
    """What messages about it begin with; PluginError unless it is a function of these arguments and the helpers'."""
    where = f"{where} {getattr(function, '__name__', repr(function))} of {_name(first)} and {_name(second)}"
    if not inspect.isfunction(plain_function(function)):
        raise PluginError(f"{where}: register a plain function; carom compiles it itself")
    convex = (first is Convex) + (second is Convex)
    _check_arity(where, plain_function(function), (*arguments, *HELPERS[convex]))
    return where


def check_pair(plugin: Any, first: Any, second: Any, function: Any) -> None:
    """PluginError unless the function can be that of the two shapes; also tries it."""
    for shape in (first, second):
        if shape is not Convex and not (isinstance(shape, type) and issubclass(shape, Component)):
            raise PluginError(
                f"plugin {plugin.name}: pair of {_name(first)} and {_name(second)}: a pair is of two collider classes, "
                f"or one and Convex, got {shape!r}"
            )
    where = _check_function(f"plugin {plugin.name}: pair", function, first, second, ("a", "b", "d"))
    for trial in _trials(where, first, second, function):
        require(list(map(partial(_Pose, where), trial.a, trial.b, map(tuple, trial.d))), pair_laws(trial))


def check_sweep(plugin: Any, first: Any, second: Any, function: Any) -> None:
    where = f"plugin {plugin.name}: sweep"
    if (first, second) not in plugin.pairs:
        raise PluginError(f"{where}: register the pair itself first, with @plugin.pair in the same order")
    where = _check_function(where, function, first, second, ("a", "b", "d", "v"))
    for trial in _trials(where, first, second, plugin.pairs[first, second].function, function):
        require(
            list(map(partial(_Pose, where), trial.a, trial.b, map(tuple, trial.d), map(tuple, trial.ways))),
            sweep_laws(trial),
        )


def check_corner(plugin: Any, first: Any, second: Any, corner: Any) -> None:
    """PluginError unless it is None or can tell corners."""
    if corner is None:
        return
    where = _check_function(f"plugin {plugin.name}: corner", corner, first, second, ("a", "b", "d", "slop"))
    for trial in _trials(where, first, second, None):
        for a, b, d in zip(trial.a, trial.b, map(tuple, trial.d), strict=True):
            result = _call(where, corner, (a, b, d, np.float64(0.01)))
            if not isinstance(result, (bool, np.bool_)):
                raise PluginError(f"{where}: for d = {plain(d)} it returned {plain(result)!r}: return True or False")


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
    require([f"{where}:"] * len(VALUES), mixing_laws(*mixed(where, function, VALUES)))


def mixed(where: str, function: Any, values: np.ndarray) -> tuple[np.ndarray, ...]:
    """x, y and what the rule makes of them in this and in the other order, for ``values`` (n, 2)."""
    found = []
    for x, y in values.tolist():
        found.append((x, y, _call(where, function, (x, y)), _call(where, function, (y, x))))
        if not all(map(_is_number, found[-1])):
            raise PluginError(f"{where}: for {x} and {y} it returned {found[-1][2]!r}: return a number from 0")
    return tuple(np.array(found, float).T)


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


def _call(where: Any, function: Any, arguments: tuple[Any, ...]) -> Any:
    try:
        with np.errstate(all="ignore"):
            return function(*arguments)
    except ZeroDivisionError as error:
        raise PluginError(f"{where}: it divides by zero; handle that case first") from error
    except AttributeError as error:
        fields = getattr(arguments[0], "_fields", ())
        raise PluginError(f"{where}: {error}" + (f" (it has {', '.join(fields)})" if fields else "")) from error
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
