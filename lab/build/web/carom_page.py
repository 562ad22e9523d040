"""What a page calls of its game: ``frame(seconds)``, or one for the world that its ``build`` makes."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Callable
from typing import Any


def frame_of(game: str) -> Callable[[float], str | None]:
    """What runs for each picture with the seconds since the one before; the page shows the text that it returns.

    TypeError for a game that has nothing to run.
    """
    module = importlib.import_module(game)
    frame, build = (getattr(module, name, None) for name in ("frame", "build"))
    if frame is not None:
        return frame
    if build is None:
        raise TypeError(f"{game}.py defines neither frame(seconds) nor build(settings, seed=0): the page runs nothing")
    world = _built(build)
    world.prepare()  # what was not built is told before anything moves

    def advance(seconds: float) -> str:
        world.advance(seconds)
        return f"{world.time:.1f} s, {world.step_count:,} steps, state {world.state_hash()}"

    return advance


def _built(build: Callable[..., Any]) -> Any:
    """As carom's commands do it, see lab/cli/loading."""
    from carom import Settings

    first = next(iter(inspect.signature(build).parameters.values()))
    try:
        return build(None if first.default is first.empty else first.default)
    except (AttributeError, TypeError):
        return build(Settings())
