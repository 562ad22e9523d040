"""What is measured: a scene of the library, a file, or a caller's function, built again for each run."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import importlib
import importlib.metadata
import inspect
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ... import scenes
from ...framework import Settings, World
from ..cli.loading import Loaded, load
from ..cli.usage_errors import Problem
from ..inputs import texts_read

DEFAULT_SECONDS = 5.0  # if the subject does not define it


@dataclass(frozen=True)
class Subject:
    """``target``: a scene's name or a file; or ``build``, a function build(settings, seed=0) -> World.

    options: keywords for the scene's build besides settings and seed
    """

    name: str
    target: str = ""
    build: Any = None
    options: tuple[tuple[str, Any], ...] = ()
    seed: int = 0

    @classmethod
    def of(cls, target: Any, options: Mapping[str, Any] | None = None, seed: int = 0) -> Subject:
        """From a scene's name, a path, or a build function; Problem if there is none of that name, or its build does
        not take the options."""
        chosen = tuple(sorted((options or {}).items()))
        if callable(target):
            made = cls(getattr(target, "__name__", "scene"), build=target, options=chosen, seed=seed)
        else:
            made = cls(load_once(str(target)).name, target=str(target), options=chosen, seed=seed)
        for name, value in chosen:
            try:
                inspect.signature(made.build or load_once(str(target)).function).bind_partial(**{name: value})
            except TypeError as error:
                raise Problem(f"{made.name}: --option {name}={value}: build {error}") from None
        return made

    def world(self, settings: Settings | None, seed: int | None = None) -> World:
        """A new world; Problem for errors in a user's file. settings None: the recommended ones."""
        return self.loaded.build(settings, {}, self.seed if seed is None else seed)

    @property
    def loaded(self) -> Loaded:
        """What builds the world, with the options."""
        if self.build is None:
            loaded = load_once(self.target)
        else:
            loaded = Loaded(self.name, self.build, compared=getattr(self.build, "compared", None))
        return dataclasses.replace(loaded, function=functools.partial(loaded.function, **dict(self.options)))

    @property
    def seconds(self) -> float:
        """The seconds that the scene or file recommends."""
        return self.loaded.seconds or DEFAULT_SECONDS

    @functools.cached_property
    def mark(self) -> str:
        """Identifies its results: differs between scenes, file contents and versions of carom. "" for a function, whose
        results are not kept: what it closes over has no version."""
        if self.build is not None:
            return ""
        text = repr((self.target, self.options, _version()))
        if self.target not in scenes.names():
            text += _text_around(load_once(self.target))
        return hashlib.sha256(text.encode()).hexdigest()[:12]


@functools.cache
def _version() -> str:
    """carom's version, and what tells its edited sources apart: kept runs of other code are not used."""
    facts = [importlib.metadata.version("carom")]
    for package in ("framework", "components", "systems", "plugins", "scenes", "lab"):
        for path in sorted(Path(str(importlib.import_module(f"carom.{package}").__file__)).parent.rglob("*.py")):
            facts.append(f"{path.name} {path.stat().st_size} {path.stat().st_mtime_ns}")
    return hashlib.sha256("\n".join(facts).encode()).hexdigest()


def _text_around(loaded: Loaded) -> str:
    """The text of the file and of the modules it has imported from its folder."""
    file = loaded.file
    if file is None or loaded.siblings is None:
        return ""
    sources = [place for place in sorted({file, *loaded.siblings.files}) if place.is_file()]
    return "".join(place.read_text(encoding="utf-8", errors="replace") for place in sources) + texts_read()


def load_once(target: str) -> Loaded:
    """Load a scene or a file; load it again only if it has changed."""
    path = Path(target)
    return _load(target, str(path.resolve()), path.stat().st_mtime_ns if path.is_file() else 0)


@functools.lru_cache(maxsize=32)
def _load(target: str, place: str, changed: int) -> Loaded:
    del place, changed  # in the cache key only: distinguish files of one name, and versions of one file
    return load(target)
