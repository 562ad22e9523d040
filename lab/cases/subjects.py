"""What is measured: a scene of the library, a file, or a caller's function, rebuilt for each run."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import hashlib
import importlib
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
from ..cli.loading import Loaded, load
from ..inputs import texts_read
from ..plugins.command import plugin_named

DEFAULT_SECONDS = 5.0  # if the subject does not define it


@dataclass(frozen=True)
class Subject:
    """``target``: a scene's name or a file; or ``build``, a function build(settings, seed=0) -> World.

    options: keywords for the scene's build besides settings and seed
    chosen, changes: instead of the recommended settings, and of some of their fields
    plugins: names of those that are added
    """

    name: str
    target: str = ""
    build: Any = None
    options: tuple[tuple[str, Any], ...] = ()
    seed: int = 0
    chosen: Settings | None = None
    changes: tuple[tuple[str, Any], ...] = ()
    plugins: tuple[str, ...] = ()

    def world(self, settings: Settings | None, seed: int | None = None) -> World:
        """A new world; Problem for errors in a user's file. settings None: the recommended ones."""
        changes = dict(self.changes) if settings is None else {}
        added = [plugin_named(name) for name in self.plugins]
        return self.loaded.build(settings or self.chosen, changes, self.seed if seed is None else seed, added)

    @property
    def loaded(self) -> Loaded:
        """What builds the world, with the options."""
        if self.build is not None:
            build = functools.partial(self.build, **dict(self.options))
            return Loaded(self.name, build, compared=getattr(self.build, "compared", None))
        loaded = load_once(self.target)
        if not self.options:
            return loaded
        return dataclasses.replace(loaded, function=functools.partial(loaded.function, **dict(self.options)))

    @functools.cached_property
    def names(self) -> tuple[str, ...]:
        """The names of what the game says is compared; none for a scene."""
        if self.loaded.compared is None:
            return ()
        with contextlib.closing(self.world(None)) as world:
            return tuple(self.loaded.values_of(world))

    @property
    def seconds(self) -> float:
        """The seconds that the scene or file recommends."""
        return self.loaded.seconds or DEFAULT_SECONDS

    @property
    def description(self) -> str:
        """One line from the library, the file's docstring or the function's docstring."""
        if self.build is not None:
            return _first_line(self.build.__doc__)
        if self.target in scenes.names():
            return scenes.get(self.target).description
        module = getattr(load_once(self.target).function, "__globals__", {})
        return _first_line(module.get("__doc__"))

    @functools.cached_property
    def mark(self) -> str:
        """Identifies its results: differs between scenes, file contents and versions of carom."""
        text = repr((self.name, self.target, self.options, self.seed, self.plugins, _version()))
        if self.build is not None:
            text += _source_of(self.build)
        elif self.target not in scenes.names():
            text += _text_around(load_once(self.target))
        return hashlib.sha256(text.encode()).hexdigest()[:12]


@functools.cache
def _version() -> str:
    """carom's version, and what tells its edited sources apart: kept runs of other code are not used."""
    facts = [importlib.metadata.version("carom")]
    for package in ("framework", "components", "systems", "plugins", "scenes", "lab"):
        folder = Path(str(importlib.import_module(f"carom.{package}").__file__)).parent
        stats = ((path.name, path.stat()) for path in sorted(folder.rglob("*.py")))
        facts += [f"{name} {stat.st_size} {stat.st_mtime_ns}" for name, stat in stats]
    return hashlib.sha256("\n".join(facts).encode()).hexdigest()


def _text_around(loaded: Loaded) -> str:
    """The text of the file and of the modules it has imported from its folder."""
    file = loaded.file
    if file is None or loaded.siblings is None:
        return ""
    modules = list(sys.modules.values())
    places = {Path(found) for module in modules if (found := getattr(module, "__file__", None))} | loaded.siblings.files
    near = {place for place in places if place.is_relative_to(file.parent) and "site-packages" not in place.parts}
    sources = [place for place in sorted({file, *near}) if place.suffix == ".py" and place.is_file()]
    return "".join(place.read_text(encoding="utf-8", errors="replace") for place in sources) + texts_read()


def _source_of(function: Any) -> str:
    """Identifies a function and its version: module text or code, name, and closed-over values. Values whose repr does
    not show their contents give a different text each time, which is safe: results are not reused.
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


def load_once(target: str) -> Loaded:
    """Load a file; load it again only if it has changed."""
    path = Path(target)
    if target in scenes.names() or not path.is_file():
        return load(target)
    return _load_file(str(path.resolve()), target, path.stat().st_mtime_ns)


@functools.lru_cache(maxsize=32)
def _load_file(place: str, target: str, changed: int) -> Loaded:
    del place, changed  # in the cache key only: distinguish files of one name, and versions of one file
    return load(target)


def _first_line(text: str | None) -> str:
    return (text or "").strip().partition("\n")[0]


def subject_of(target: Any, options: Mapping[str, Any] | None = None, seed: int = 0) -> Subject:
    """A subject from a subject, a scene's name, a path, or a build function; Problem if there is none of that name."""
    if isinstance(target, Subject):
        return target
    chosen = tuple(sorted((options or {}).items()))
    if callable(target):
        return Subject(getattr(target, "__name__", "scene"), build=target, options=chosen, seed=seed)
    loaded = load_once(str(target))
    return Subject(loaded.name, target=str(target), options=chosen, seed=seed)
