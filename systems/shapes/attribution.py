"""Which plugin an error comes from: its function raised, cannot be compiled, or returned what is no contact."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from ...framework.data.component import Component
from ...framework.errors import LibraryError, PluginError
from ...framework.jit.lazy import is_of_compiler
from ...framework.jit.records.record import Record
from ...framework.plugins.registry import Registry, Shape
from .linking.signatures import ALONE, OUT_OF_TIME

BUILT_IN = "standard shapes"  # the plugin of carom's own shapes
NOTHING_TESTED = -1  # in place of a row: no pair has been tested yet


class ErrorAttribution:
    """``with attribute_errors():`` around calls of kernels that test shapes: errors name plugin, pair and entities.

    state
        the record; ``row_a`` to ``unsound_b`` tell what was tested last and what was wrong
    shapes
        returns the scene's shapes by number
    """

    def __init__(self, registry: Registry, state: Record, shapes: Callable[[], Sequence[Shape]]) -> None:
        self._registry, self._state, self._shapes = registry, state, shapes

    @contextmanager
    def __call__(self, query: type[Component] | None = None) -> Any:
        """``query``: the shape that a query asks with; rows of queries are not bodies."""
        state = self._state
        state.row_a, state.unsound = NOTHING_TESTED, 0
        try:
            yield
        except Exception as error:
            self.describe(error, query)
            raise
        self.check(query)

    def describe(self, error: BaseException, query: type[Component] | None = None) -> None:
        """Add to an error which plugin's function it comes from; one of libraries says that itself."""
        if isinstance(error, LibraryError):
            return
        state, joints = self._state, self._state.solver.joints
        uncompiled = is_of_compiler(error) or state.row_a == NOTHING_TESTED
        if joints.asked:
            about, joints.asked = self._joint(joints.asked), 0
        else:
            about = self._uncompiled(error) if uncompiled else self._describe(state.row_a, state.row_b, query)
        if about and about not in getattr(error, "__notes__", ()):  # numba raises the same object once more
            error.add_note(about)

    def check(self, query: type[Component] | None = None) -> None:
        """PluginError if a kernel has noted an answer that is none; for callers that time their calls themselves."""
        state = self._state
        unsound, state.unsound = state.unsound, 0
        if not unsound:
            return
        a, b = state.unsound_a, state.unsound_b
        about = self._describe(a, b, query)
        if unsound == OUT_OF_TIME:
            raise PluginError(f"{about}: its sweep returned a time that is not from 0 to 1")
        if b != ALONE:
            raise PluginError(f"{about} returned a contact that is not finite")
        if query is not None or self._rotation_is_finite(a):
            raise PluginError(f"{about} are not numbers from 0")

    def _rotation_is_finite(self, i: int) -> bool:
        width = 1 if self._state.dimensions == 2 else 4
        return bool(np.isfinite(self._state.bodies.rotation[i * width : (i + 1) * width]).all())

    def _uncompiled(self, error: BaseException) -> str:
        """The pairs, shapes and stages whose functions numba's message mentions."""
        text, registry = str(error), self._registry
        functions = {f"plugin {each.plugin}: stage {each.name}": each.function for each in registry.stages.values()}
        for pair in registry.pairs.values():
            for kind in ("function", "sweep", "corner"):
                function = getattr(pair, kind)
                if function is not None:
                    what = "pair" if kind == "function" else kind
                    functions[f"plugin {pair.plugin}: {what} {function.__name__} of {pair.names}"] = function
        for shape in registry.shapes.values():
            for name in ("bounds", "turned", "support", "rounding"):
                functions[f"plugin {shape.plugin}: shape {shape.component.__name__}: {name}"] = getattr(shape, name)
        found = [what for what, function in functions.items() if function is not None and _mentions(text, function)]
        names = " or ".join(found)
        cure = "use numbers, tuples, math and carom.framework.vectors"
        if "Untyped global name" in text and "<class 'function'>" in text:
            cure = "functions that it calls need @plugin.kernel"
        return f"{names} cannot be compiled; {cure}" if names else ""

    def _describe(self, a: int, b: int, query: type[Component] | None) -> str:
        """Plugin, function, shapes and entities of two rows, or of one; "" if there are no such rows."""
        if query is not None:
            return self._describe_query(a, b, query)
        state, shapes = self._state, self._shapes()
        if not shapes or max(a, b) >= state.count:
            return ""
        entity, levels = state.bodies.entity, state.bodies.own_levels
        if b == ALONE:
            shape = shapes[int(levels[-1][a])]
            return f"plugin {shape.plugin}: bounds of {shape.component.__name__}, entity {entity[a]}"
        a, b = sorted((a, b), key=lambda row: int(entity[row]))
        found = {}  # of bodies with levels every pair it can be
        for level in reversed(levels):
            one, two = (shapes[int(level[row])].component for row in (a, b))
            found[self._pair(one, two)] = None
        return f"{' or '.join(filter(None, found))}, entities {entity[a]} and {entity[b]}"

    def _joint(self, entity: int) -> str:
        """Plugin, class and entity of the joint whose function has raised an error."""
        for each in self._registry.joints.values():
            if self._registry.world.has_component(entity, each.component):
                return f"plugin {each.plugin}: constraint of {each.component.__name__}, entity {entity}"
        return ""

    def _describe_query(self, a: int, b: int, query: type[Component]) -> str:
        state, shapes = self._state, self._shapes()
        if b == ALONE:
            return f"plugin {self._registry.shapes[query].plugin}: bounds of {query.__name__}, of a query"
        found = {}
        for row, other in ((b, a), (a, b)):  # the body is the second, unless the pair is registered that way round
            if not 0 <= row < state.count:
                continue
            body = shapes[int(state.bodies.own_levels[-1][row])].component
            pair = self._registry.pair(query, body)
            if pair is not None and (pair.first is query) == (row == b and other == a):
                found[f"{self._pair(query, body)} of a query, entity {state.bodies.entity[row]}"] = None
            if a == b:
                break
        return " or ".join(found)

    def _pair(self, one: type[Component], two: type[Component]) -> str:
        pair = self._registry.pair(one, two)
        if pair is None:
            return ""
        helped = {self._registry.shapes[shape].plugin: None for shape in (one, two) if pair.helpers}
        others = [plugin for plugin in helped if plugin not in (pair.plugin, BUILT_IN)]
        of = f" (support by plugin {' and '.join(others)})" if others else ""
        return f"plugin {pair.plugin}: pair {pair.function.__name__} of {one.__name__} and {two.__name__}{of}"


def _mentions(text: str, function: Any) -> bool:
    """Whether numba's message names the function, or a line of it."""
    plain = getattr(getattr(function, "author", function), "py_func", function)
    lines = [line for _, _, line in plain.__code__.co_lines() if line is not None]
    places = re.findall(r" at (.+) \((\d+)\)", text)
    own = plain.__code__.co_filename
    return f"<function {plain.__qualname__} " in text or any(
        file == own and min(lines) <= int(line) <= max(lines) for file, line in places
    )
