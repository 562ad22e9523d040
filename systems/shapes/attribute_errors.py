"""Whose fault it is when the function of a pair raises, or returns what is no contact."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
from numba.core.errors import NumbaError

from ...framework.errors import PluginError
from .dispatch import ALONE, OUT_OF_TIME, ROW_A, ROW_B, UNSOUND, UNSOUND_A, UNSOUND_B

if TYPE_CHECKING:
    from ..state import PhysicsState


BUILT_IN = "standard shapes"  # the plugin of carom's own shapes


class Blame:
    """``with blame:`` around kernels that ask pairs: what goes wrong names plugin, pair and entities."""

    def __init__(self, state: PhysicsState) -> None:
        self._state = state

    def __enter__(self) -> None:
        self._state.trace[ROW_A] = -1  # no pair has been asked yet

    def __exit__(self, kind: Any, error: BaseException | None, traceback: Any) -> None:
        trace = self._state.trace
        if error is not None:
            uncompiled = isinstance(error, NumbaError) or trace[ROW_A] < 0
            about = self._uncompiled(error) if uncompiled else self._describe(int(trace[ROW_A]), int(trace[ROW_B]))
            if isinstance(error, Exception) and about:
                error.add_note(about)
        elif trace[UNSOUND]:
            late, trace[UNSOUND] = trace[UNSOUND] == OUT_OF_TIME, 0
            a, b = int(trace[UNSOUND_A]), int(trace[UNSOUND_B])
            if late:
                raise PluginError(f"{self._describe(a, b)}: its sweep returned a time that is not from 0 to 1")
            if b != ALONE:
                raise PluginError(f"{self._describe(a, b)} returned a contact that is not finite")
            if np.isfinite(self._state.table.arrays["rotation"][a]).all():
                raise PluginError(f"{self._describe(a, b)} are not numbers from 0")

    def _uncompiled(self, error: BaseException) -> str:
        """The pairs and shapes whose functions numba's message mentions."""
        text, registry = str(error), self._state.world.registry
        functions = {
            f"plugin {pair.plugin}: pair {pair.function.__name__} of {pair.names}": pair.function
            for pair in registry.pairs.values()
        }
        for shape in registry.shapes.values():
            for name in ("bounds", "turned", "support", "rounding"):
                functions[f"plugin {shape.plugin}: shape {shape.component.__name__}: {name}"] = getattr(shape, name)
        found = [what for what, function in functions.items() if function is not None and _mentions(text, function)]
        names = " or ".join(found)
        cure = "use numbers, tuples, math and carom.framework.vectors"
        if "Untyped global name" in text:
            cure = "functions that it calls need @plugin.kernel"
        return f"{names} cannot be compiled; {cure}" if names else ""

    def _describe(self, a: int, b: int) -> str:
        """The pair of two rows: plugin, function, shapes, entities; of bodies with levels every pair it can be."""
        state = self._state
        if state.code is None or max(a, b) >= state.table.count:
            return ""
        found: dict[str, None] = {}
        if b == ALONE:
            shape = state.code.shapes[int(state.levels[-1][a])]
            entity = state.table.arrays["entity"][a]
            return f"plugin {shape.plugin}: bounds of {shape.component.__name__}, entity {entity}"
        a, b = sorted((a, b), key=lambda row: int(state.table.arrays["entity"][row]))
        for level in reversed(state.levels):
            shapes = [state.code.shapes[int(level[row])].component for row in (a, b)]
            pair = state.world.registry.pair(shapes[0], shapes[1])
            if pair is not None:
                names = f"{shapes[0].__name__} and {shapes[1].__name__}"
                helped = {state.world.registry.shapes[shape].plugin: None for shape in shapes if pair.helpers}
                others = [plugin for plugin in helped if plugin not in (pair.plugin, BUILT_IN)]
                of = f" (support by plugin {' and '.join(others)})" if others else ""
                found[f"plugin {pair.plugin}: pair {pair.function.__name__} of {names}{of}"] = None
        entities = [int(state.table.arrays["entity"][row]) for row in (a, b)]
        return f"{' or '.join(found)}, entities {entities[0]} and {entities[1]}"


def _mentions(text: str, function: Any) -> bool:
    """Whether numba's message names the function, or a line of it."""
    plain = getattr(getattr(function, "author", function), "py_func", function)
    lines = [line for _, _, line in plain.__code__.co_lines() if line is not None]
    places = re.findall(r" at (.+) \((\d+)\)", text)
    own = plain.__code__.co_filename
    return f"<function {plain.__qualname__} " in text or any(
        file == own and min(lines) <= int(line) <= max(lines) for file, line in places
    )
