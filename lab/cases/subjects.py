"""What is measured: a scene of the library, a file, or a function of the caller's, built anew for each run."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import importlib.metadata
import inspect
import marshal
import pickle
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ... import scenes
from ...framework import Settings, World
from ..commands.loading import Loaded, load

DEFAULT_SECONDS = 5.0  # of what does not say


@dataclass(frozen=True)
class Subject:
    """``target``: a scene's name or a file; or ``build``, a function build(settings, seed=0) -> World.

    options
        keywords for the scene's build besides settings and seed
    """

    name: str
    target: str = ""
    build: Any = None
    options: tuple[tuple[str, Any], ...] = ()
    seed: int = 0

    def world(self, settings: Settings | None, seed: int | None = None) -> World:
        """A new world; Problem for what goes wrong in somebody's file. settings None: the recommended ones."""
        return self._loaded.build(settings, {}, self.seed if seed is None else seed)

    def blamed(self) -> contextlib.AbstractContextManager[None]:
        """What is raised inside becomes a Problem that names the line of the file it came from."""
        return self._loaded.blame()

    @property
    def _loaded(self) -> Loaded:
        if self.build is not None:
            return Loaded(self.name, functools.partial(self.build, **dict(self.options)))
        loaded = _load_once(self.target)
        if not self.options:
            return loaded
        return Loaded(loaded.name, functools.partial(loaded.function, **dict(self.options)), loaded.file)

    @property
    def recommended(self) -> tuple[float, Any]:
        """Seconds that the scene or file recommends, and its view or None."""
        if self.build is not None:
            return DEFAULT_SECONDS, None
        loaded = _load_once(self.target)
        return loaded.seconds or DEFAULT_SECONDS, loaded.view

    @property
    def description(self) -> str:
        """One line of the library, of the file's docstring, or of the function's."""
        if self.build is not None:
            return _first_line(self.build.__doc__)
        if self.target in scenes.names():
            return scenes.get(self.target).description
        module = getattr(_load_once(self.target).function, "__globals__", {})
        return _first_line(module.get("__doc__"))

    @functools.cached_property
    def mark(self) -> str:
        """What tells its results from those of another scene, file content or version of carom."""
        text = repr((self.name, self.target, self.options, self.seed, importlib.metadata.version("carom")))
        if self.build is not None:
            text += _source_of(self.build)
        elif self.target not in scenes.names():
            text += _text_around(_load_once(self.target).file)
        return hashlib.sha256(text.encode()).hexdigest()[:12]


def _text_around(file: Path | None) -> str:
    """That of the file and of the modules it has imported from its own folder."""
    if file is None:
        return ""
    places = {Path(found) for module in list(sys.modules.values()) if (found := getattr(module, "__file__", None))}
    near = {place for place in places if place.is_relative_to(file.parent) and "site-packages" not in place.parts}
    sources = [place for place in sorted({file, *near}) if place.suffix == ".py" and place.is_file()]
    return "".join(place.read_text(encoding="utf-8", errors="replace") for place in sources)


def _source_of(function: Any) -> str:
    """What tells it from other functions, and from itself after a change: its module's text or its code, its name, and
    what it closes over. Values that do not show themselves in their repr make it another one each time, which is safe.
    """
    code = getattr(function, "__code__", None)
    try:
        text = inspect.getsource(inspect.getmodule(function) or function)
    except (OSError, TypeError):
        text = marshal.dumps(code).hex() if code is not None else ""
    closed = [cell.cell_contents for cell in getattr(function, "__closure__", None) or ()]
    defaults = getattr(function, "__defaults__", None), getattr(function, "__kwdefaults__", None)
    facts = getattr(function, "__qualname__", ""), closed, defaults, function if code is None else vars(function)
    try:
        return text + pickle.dumps(facts).hex()  # repr would shorten large arrays
    except (TypeError, AttributeError, pickle.PicklingError):
        return text + repr(facts)


def _load_once(target: str) -> Loaded:
    """A file again only if it has changed."""
    path = Path(target)
    if target in scenes.names() or not path.is_file():
        return load(target)
    return _load_file(str(path.resolve()), target, path.stat().st_mtime_ns)


@functools.lru_cache(maxsize=32)
def _load_file(place: str, target: str, changed: int) -> Loaded:
    del place, changed  # tell two files of one name, or of two times, apart
    return load(target)


def _first_line(text: str | None) -> str:
    return (text or "").strip().partition("\n")[0]


def subject_of(target: Any, options: Mapping[str, Any] | None = None, seed: int = 0) -> Subject:
    """A subject from a scene's name, a path, or a build function; Problem if there is none of that name."""
    chosen = tuple(sorted((options or {}).items()))
    if callable(target):
        return Subject(getattr(target, "__name__", "scene"), build=target, options=chosen, seed=seed)
    loaded = _load_once(str(target))
    return Subject(loaded.name, target=str(target), options=chosen, seed=seed)
