"""What a plugin's functions are checked for when they are registered, before anything compiles.

They are run as plain Python on a few inputs: what is refused could not work in any scene. A message names plugin,
shape, function, the input and the cure. ``carom plugins check`` tries the same laws on many inputs.
"""

from __future__ import annotations

import collections
import inspect
import math
import numbers
from collections.abc import Callable, Iterable, Iterator
from itertools import repeat
from typing import Any

import numpy as np

from ..data.component import Component
from ..errors import PluginError
from ..jit.records.schema import Column, Schema
from ..outlines import SIGNS, Outline
from ..schedule.stages import answers
from .laws import (
    Contacts,
    Law,
    Support,
    Trial,
    edge_laws,
    mixing_laws,
    outline_laws,
    pair_laws,
    plain,
    shape_laws,
    sweep_laws,
)  # fmt: skip
from .registry import Convex, Shape

# Functions of a shape: their arguments, and what they return.
SHAPE_FUNCTIONS = {
    "bounds": (("shape", "dimensions"), "half extents of the box around it"),
    "support": (("shape", "direction"), "a point"),
    "rounding": (("shape",), "how far it reaches beyond its core"),
    "edge": (("shape", "direction"), "both ends of an edge"),
    "turned": (("shape", "axes"), ""),
    "outline": (("shape", "dimensions"), "corners, faces"),
    "second_moments": (("shape", "dimensions"), "measure, centre, means of xx, xy, yy (in 3D xx, yy, zz, xy, xz, yz)"),
    "material": (("shape", "point", "normal"), "friction, restitution, surface velocity"),
}
POSES = np.array(((1.0, 0.0, 0.0), (0.3, -0.2, 0.1), (0.0, 0.0, 0.0), (-2.0, 3.0, 1.0)))  # of b as seen from a
STEPS = np.array(((0.1, 0.2, 0.0), (-0.3, 0.1, 0.2), (0.0, 0.5, -0.1), (0.04, -0.06, -0.02)))
LOOK = np.array(((0.6, -0.3, 0.2), (-0.7, 0.1, -0.5), (0.2, 0.9, 0.4)))  # directions beside axes and corners
VALUES = (0.25, 1.0, 0.0, 1e-9, 0.1, 0.3, 0.45, 0.6, 0.75, 0.9, 3.0, 1e9)  # for a mixing rule, each with each
# What functions of pairs with Convex get besides, by how many of the two it is.
HELPERS = {0: (), 1: ("support", "rounding"), 2: ("a_support", "b_support", "a_rounding", "b_rounding")}


class PlainFunction:
    """A plugin's function, called as plain Python for many inputs; PluginError if it takes other arguments, raises, or
    returns something else.

    names
        of its arguments
    returns, form
        what it returns, in words; for each part of it bool, float, or how many numbers a tuple has
    """

    def __init__(self, where: str, function: Any, names: tuple[str, ...], returns: str, *form: Any) -> None:
        self.where, self.function, self.names = where, plain_function(function), names
        self.returns, self.form = returns, form
        if not inspect.isfunction(self.function):
            raise PluginError(f"{where}: register a plain function; carom compiles it itself; got {function!r}")
        _check_arity(where, self.function, names)

    def __call__(self, *columns: Any) -> tuple[np.ndarray, ...]:
        """An array for each part of what it returns, for inputs that stand one after the other in the columns."""
        results = []
        for row in zip(*columns, strict=False):
            given = tuple(tuple(value) if isinstance(value, np.ndarray) else value for value in row)
            found = self.called(*given)
            parts = found if len(self.form) > 1 else (found,)
            if not (isinstance(parts, tuple) and len(parts) == len(self.form) and all(map(_fits, parts, self.form))):
                forms = ", ".join({bool: "True or False", float: "a number"}.get(kind) or f"a tuple of {kind} numbers"
                                  for kind in self.form)  # fmt: skip
                cure = f"return {self.returns}: {forms}"
                raise PluginError(f"{self.at(*given)} it returned {plain(found)!r}: {cure}")
            results.append(parts)
        kinds = (bool if kind is bool else float for kind in self.form)
        return tuple(map(np.array, zip(*results, strict=True), kinds))

    def at(self, *given: Any) -> str:
        """Which function, and the input."""
        return f"{self.where}: for {', '.join(f'{n} = {shown(v)}' for n, v in zip(self.names, given, strict=False))}"

    def called(self, *given: Any) -> Any:
        """What it returns; PluginError if it raises."""
        try:
            with np.errstate(all="ignore"):
                return self.function(*given)
        except ZeroDivisionError as error:
            raise PluginError(f"{self.at(*given)} it divides by zero; handle that case first") from error
        except AttributeError as error:
            fields = ", ".join(getattr(given[0], "_fields", ()))
            raise PluginError(f"{self.at(*given)} {error}{f' (it has {fields})' if fields else ''}") from error
        except Exception as error:  # whatever the plugin's function raises, its author has to hear of
            raise PluginError(f"{self.at(*given)} it raised {type(error).__name__}: {error}") from error


def require(where: Callable[[int], str], laws: Iterable[Law]) -> None:
    """PluginError for the first law that one of a few inputs breaks; it begins with ``where`` of that input."""
    with np.errstate(all="ignore"):
        for law in laws:
            if law.most is None and law.is_broken:
                row = int(np.argmax(law.broken))
                raise PluginError(f"{where(row)} {law.said(row)}: {law.cure}")


# -- shapes ---------------------------------------------------------------------------------------


def check_shape(plugin: Any, component: Any, cost: float) -> None:
    """PluginError unless the class can be a shape; also tries its functions."""
    where = f"plugin {plugin.name}: shape {_name(component)}"
    if not (isinstance(component, type) and issubclass(component, Component)) or component._abstract:
        raise PluginError(f"{where}: a shape is a class derived from Collider, got {component!r}")
    if getattr(component, "stack", None) is None:
        raise PluginError(f"{where} must derive from carom.components.Collider, which brings friction, layer and mask")
    if isinstance(cost, bool) or not isinstance(cost, numbers.Real) or not (math.isfinite(cost) and cost > 0):
        raise PluginError(f"{where}: cost must be a number above 0, the sphere's being 1, got {cost!r}")
    allowed = getattr(component, "dimensions", (2, 3))
    if not isinstance(allowed, tuple) or not allowed or not set(allowed) <= {2, 3}:
        raise PluginError(f"{where}: dimensions must be (2,), (3,) or (2, 3), got {allowed!r}")
    if _ships(component):
        return
    for name in SHAPE_FUNCTIONS:
        _shape_function(where, component, name, allowed[0])
    for dimensions in allowed:
        look, other = (np.delete(poses[:, :dimensions], 2, axis=0) for poses in (POSES, STEPS))
        samples = [parameters_of(component, dimensions)] * len(look)
        moments = _shape_function(where, component, "second_moments", dimensions)
        if moments is not None:
            (found,) = moments(samples[:1], [dimensions])[0]
            squares = found[[3, 5] if dimensions == 2 else [4, 5, 6]]
            if not np.isfinite(found).all() or found[0] < 0 or squares.min() < 0:
                cure = "numbers are finite, measure and squares not negative"
                raise PluginError(f"{moments.at(samples[0], dimensions)} it returned {plain(found)!r}: {cure}")
        half, support = _extents(where, component, samples, dimensions)
        said = f"{where}: for {shown(samples[0])} in {dimensions}D"
        require(lambda row, said=said: said, shape_laws(half, support, look, other))
        edge = _shape_function(where, component, "edge", dimensions)
        if dimensions == 2 and edge is not None and support is not None:
            require(lambda row, said=said: said, edge_laws(edge(samples, look), support, look))
        require(lambda row, said=said: said, laws_of_outline(where, component, samples[:1], dimensions))


def _ships(thing: Any) -> bool:
    """Whether it comes with carom, whose tests try its functions once: not every import of it."""
    return getattr(thing, "__module__", "").partition(".")[0] == "carom"


def shape_function(component: Any, name: str) -> Any:
    """The plain function behind a method, static or not; None if the class has none, or a field of that name."""
    found = inspect.getattr_static(component, name, None)
    return None if name in component.columns else getattr(found, "__func__", found)


def _shape_function(where: str, component: Any, name: str, dimensions: int) -> PlainFunction | None:
    function = shape_function(component, name)
    if function is None and name == "bounds":
        raise PluginError(
            f"{where} has no bounds: write bounds(shape, dimensions) that returns the half extents of the box around "
            f"it, a tuple of {dimensions} numbers"
        )
    moments = 1 + dimensions + dimensions * (dimensions + 1) // 2
    form = {"rounding": float, "second_moments": moments}.get(name, dimensions)
    several = {"material": (float, float, dimensions), "edge": (dimensions, dimensions)}
    forms, (names, returns) = several.get(name, (form,)), SHAPE_FUNCTIONS[name]
    if name == "edge" and shape_function(component, "support") is None:
        names = *names, "point"
    return None if function is None else PlainFunction(f"{where}: {name}", function, names, returns, *forms)


def _extents(where: str, component: Any, samples: list[Any], dimensions: int) -> tuple[np.ndarray, Support | None]:
    """Half extents of n samples, and what gives their support and rounding, None without these."""
    bounds, support, rounding = (
        _shape_function(where, component, name, dimensions) for name in ("bounds", "support", "rounding")
    )

    def supported(direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        beyond = np.zeros(len(samples)) if rounding is None else rounding(samples)[0]
        return support(samples, direction)[0], beyond  # type: ignore[misc]

    return bounds(samples, repeat(dimensions))[0], None if support is None else supported  # type: ignore[misc]


def laws_of_outline(where: str, component: Any, samples: list[Any], dimensions: int) -> Iterator[Law]:
    """Of n shapes that are not turned; none, if the class has no outline."""
    function = _shape_function(where, component, "outline", dimensions)
    if function is None:
        return
    outlines = []
    ways = np.concatenate((np.eye(dimensions), -np.eye(dimensions), SIGNS[dimensions], LOOK[:, :dimensions]))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    for sample in samples:
        found = function.called(sample, dimensions)
        try:
            outlines.append(Outline.of(found, dimensions))
        except (ValueError, TypeError) as error:
            raise PluginError(f"{function.at(sample, dimensions)} it returned {plain(found)!r}: {error}") from error
    half, support = _extents(where, component, samples, dimensions)
    rounding = _shape_function(where, component, "rounding", dimensions)
    beyond, reach = np.zeros(len(samples)) if rounding is None else rounding(samples)[0], None
    if support is not None:
        points = (support(np.tile(way, (len(samples), 1)))[0] @ way for way in ways)
        reach = np.stack(list(points), axis=1)
    yield from outline_laws(outlines, half, beyond, reach, ways)


# -- pairs ----------------------------------------------------------------------------------------


def check_pair(plugin: Any, first: Any, second: Any, function: Any) -> None:
    """PluginError unless the function can be that of the two shapes; also tries it."""
    for shape in (first, second):
        if shape is not Convex and not (isinstance(shape, type) and issubclass(shape, Component)):
            where = f"plugin {plugin.name}: pair of {_name(first)} and {_name(second)}"
            raise PluginError(f"{where}: a pair is of two collider classes, or one and Convex, got {shape!r}")
    for trial, called in () if _ships(function) else _trials(plugin, "pair", first, second, function):
        require(lambda row, t=trial, at=called.at: at(t.a[row], t.b[row], t.d[row]), pair_laws(trial))


def check_sweep(plugin: Any, first: Any, second: Any, function: Any) -> None:
    if (first, second) not in plugin.pairs:
        where = f"plugin {plugin.name}: sweep of {_name(first)} and {_name(second)}"
        raise PluginError(f"{where}: register the pair itself first, with @plugin.pair in the same order")
    if _ships(function):
        return
    pairs = _trials(plugin, "pair", first, second, plugin.pairs[first, second].function)
    sweeps = _trials(plugin, "sweep", first, second, function)
    for (trial, called), (pair, _) in zip(sweeps, pairs, strict=True):
        trial.call, trial.sweep = pair.call, called  # type: ignore[assignment]
        require(lambda row, t=trial, at=called.at: at(t.a[row], t.b[row], t.d[row], t.ways[row]), sweep_laws(trial))


def check_corner(plugin: Any, first: Any, second: Any, corner: Any) -> None:
    """PluginError unless it is None or can tell corners."""
    if corner is not None and not _ships(corner):
        for trial, called in _trials(plugin, "corner", first, second, corner):
            called(trial.a, trial.b, trial.d, repeat(np.float64(0.01)))


def _trials(plugin: Any, kind: str, first: Any, second: Any, function: Any) -> Iterator[tuple[Trial, PlainFunction]]:
    """Four poses of two samples, in every dimension both can be in, and the function of that kind; none of Convex."""
    where = f"plugin {plugin.name}: {kind} {_name(function)} of {_name(first)} and {_name(second)}"
    helpers = HELPERS[(first is Convex) + (second is Convex)]
    for d in (2,) if helpers else sorted({*_dimensions(first)} & {*_dimensions(second)}):
        names, returns, *form = {
            "pair": (("a", "b", "d"), "(hit, depth, normal, point)", bool, float, d, d),
            "sweep": (("a", "b", "d", "v"), "(hit, time)", bool, float),
            "corner": (("a", "b", "d", "slop"), "whether only corners touch", bool),
        }[kind]
        called = PlainFunction(where, function, (*names, *helpers), returns, *form)
        if helpers:
            return
        a, b = ([parameters_of(each, d)] * len(POSES) for each in (first, second))
        (one, core_a), (two, core_b) = (_extents(where, *each, d) for each in ((first, a), (second, b)))
        yield Trial(
            lambda a, b, d, called=called: Contacts(*called(a, b, d)), None, a, b, POSES[:, :d], (one, two),
            STEPS[:, :d], -2.0 * POSES[:, :d], None if core_a is None or core_b is None else (core_a, core_b),
            first is second,
        ), called  # fmt: skip


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
    called, (x, y) = PlainFunction(where, function, ("x", "y"), "a number from 0", float), np.meshgrid(VALUES, VALUES)
    x, y = x.ravel().tolist(), y.ravel().tolist()
    require(lambda row: called.at(x[row], y[row]), mixing_laws(*called(x, y), *called(y, x)))


def check_filter(plugin: Any, function: Any) -> None:
    where = f"plugin {plugin.name}: pair filter {getattr(function, '__name__', function)!s}"
    if not inspect.isfunction(function):
        raise PluginError(f"{where}: register a function of (bodies, a, b), got {function!r}")
    _check_arity(where, function, ("bodies", "a", "b"))


def check_stage(
    plugin: Any, function: Any, places: tuple[str, str], given_records: tuple[Any, Any],
    columns: dict[str, Iterable[str]],
) -> tuple[str, list[tuple[Any, ...]]]:  # fmt: skip
    """The one name of a stage that is given, then all its records and columns as tuples; PluginError unless it can be
    one."""
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
    for what, given_types in zip(("records", "optional"), given_records, strict=True):
        if not isinstance(given_types, tuple) or not all(map(_is_record, given_types)):
            raise PluginError(
                f"{where}: {what} takes a tuple of component types of your own and schemas, got {given_types!r}"
            )
    records = (*given_records[0], *given_records[1])
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


def check_component(plugin: Any, component: Any) -> None:
    where = f"plugin {plugin.name}: component {_name(component)}"
    if not (isinstance(component, type) and issubclass(component, Component)) or component._abstract:
        raise PluginError(f"{where}: register a class derived from Component, got {component!r}")
    if component.plugin not in ("", plugin.name):
        raise PluginError(f"{where} says that its plugin is {component.plugin!r}")


def check_record(plugin: Any, schema: Any) -> None:
    if not isinstance(schema, Schema):
        raise PluginError(f"plugin {plugin.name}: record takes a Schema, got {schema!r}")


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


def _fits(value: Any, kind: Any) -> bool:
    """Whether a part of a result is True or False, a number, or a tuple of so many numbers, as ``kind`` says."""
    if isinstance(kind, int):
        return isinstance(value, tuple) and len(value) == kind and all(_fits(each, float) for each in value)
    truth = isinstance(value, (bool, np.bool_))
    return truth if kind is bool else isinstance(value, numbers.Real) and not truth


def _name(shape: Any) -> str:
    return getattr(shape, "__name__", repr(shape))


def shown(value: Any) -> str:
    """A number, a tuple, or a parameter tuple, without numpy's types."""
    if not hasattr(value, "_fields"):
        return repr(plain(value))
    fields = (f"{name}={plain(each)!r}" for name, each in zip(value._fields, value, strict=True))
    return f"{type(value).__name__}({', '.join(fields)})"
