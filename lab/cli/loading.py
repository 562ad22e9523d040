"""Loading of what a command runs: a scene of the library by name, or a file that defines build(settings, seed=0)."""

from __future__ import annotations

import contextlib
import hashlib
import inspect
import math
import symtable
import sys
import traceback
import weakref
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import click
import numpy as np

from ... import maps, scenes
from ...framework import Plugin, Settings, World
from .options import Corners, apply, corners
from .usage_errors import Problem, did_you_mean, one_line

MAPS = (".tmx", ".tmj", ".ldtk")


@dataclass(frozen=True)
class Loaded:
    """Something that builds worlds; what it does not define is None.

    seconds, view, settings: those that it recommends
    compared: compared(world) -> dict: what a game is judged by
    level_of: level_of(world): of a map, which has pictures of its own
    """

    name: str
    function: Any
    file: Path | None = None
    seconds: float | None = None
    view: Corners | None = None
    settings: Settings | None = None
    siblings: Siblings | None = None
    compared: Any = None
    level_of: Any = None

    def build(
        self, settings: Settings | None, changes: Mapping[str, Any], seed: int, plugins: Sequence[Plugin] = ()
    ) -> World:
        """A world with ``settings`` (None: those that the scene or the file has itself), with fields changed, and with
        further plugins; Problem if it fails."""
        given = settings or self.settings
        if given is not None and not plugins:  # else these may be names that the plugins bring
            given = apply(given, changes)
        with self.attribute_errors(), stdout_kept_clean():
            world = self._world(given, seed)
        if not isinstance(world, World):
            raise Problem(f"{self.name}: build returned {_kind(world)}, not a World")
        if world.dimensions is None:
            raise Problem(f"{self.name}: no physics in this world: World(Physics(...))")
        for plugin in plugins:
            try:
                with stdout_kept_clean():
                    world.add_plugin(plugin)
            except (Exception, SystemExit) as error:  # runs third-party code that creates systems
                raise Problem(f"--plugin {plugin.name}: {one_line(error)}") from error
        wanted = apply(settings or world.settings, changes)
        if wanted != world.settings:
            with self.attribute_errors():
                world.settings = wanted
        return world

    def _world(self, settings: Settings | None, seed: int) -> Any:
        """With the settings that ``build`` has by default, or makes of None; Settings() if it cannot take None."""
        if settings is not None:
            return self.function(settings, seed=seed)
        first = next(iter(inspect.signature(self.function).parameters.values()))
        try:
            return self.function(None if first.default is first.empty else first.default, seed=seed)
        except (AttributeError, TypeError):
            return self.function(Settings(), seed=seed)

    def values_of(self, world: World) -> dict[str, list[float]]:
        """What the game compares, now: numbers as lists of one (NaN for None), places as lists of coordinates."""
        if self.compared is None:
            return {}
        with self.attribute_errors():
            found = self.compared(world)
        if not isinstance(found, Mapping):
            raise Problem(f"{self.name}: compared must return a dict of names and values, not {found!r}")
        values = {}
        for name, value in found.items():
            try:
                numbers = np.atleast_1d(np.array(math.nan if value is None else value, float))
            except (TypeError, ValueError):
                numbers = np.zeros(0)
            if numbers.shape not in ((1,), (world.dimensions,)):
                raise Problem(f"{self.name}: compared must give a number, None or a place, not {value!r} for {name!r}")
            values[str(name)] = numbers.tolist()
        return values

    @contextmanager
    def attribute_errors(self) -> Iterator[None]:
        """Convert exceptions raised inside to a Problem that names the line of the user's file.

        Imports inside find the modules beside that file.
        """
        try:
            with self.siblings.at_hand() if self.siblings is not None else contextlib.nullcontext():
                yield
        except Problem:
            raise
        except (Exception, SystemExit) as error:
            raise Problem(f"{self.name}{_place_in(self.file, error)}: {one_line(error)}") from error


def _kind(value: object) -> str:
    return "nothing (None)" if value is None else f"a {type(value).__name__}"


def stdout_kept_clean() -> contextlib.AbstractContextManager[Any]:
    """Redirect prints of user code to stderr, so that stdout holds only the result."""
    return contextlib.redirect_stdout(sys.stderr)


def load(target: str, level: str | None = None) -> Loaded:
    """The scene named ``target``, with hyphens if one likes, or the file at that path, of an LDtk project a ``level``;
    Problem if neither exists."""
    name, path = target.replace("-", "_"), Path(target)
    if path.suffix in MAPS:
        return _load_map(path, level)
    if level is not None:
        raise Problem(f"--level is for maps of LDtk, {target!r} is none")
    if name in scenes.names():
        scene = scenes.get(name)
        return Loaded(scene.name, scene.build, seconds=scene.seconds, view=scene.view, settings=scene.settings)
    if path.suffix == ".py":
        return _load_file(path)
    if path.exists() or path.parent != Path():
        raise Problem(f"{target!r} is no scene, and no Python file: its name ends in .py")
    raise Problem(f"no scene named {target!r}{did_you_mean(target, scenes.names())} (a file of one's own ends in .py)")


def _load_map(path: Path, level: str | None) -> Loaded:
    """A map, in a world with the plugins that it needs; of an LDtk project that level, None: its first one."""

    levels: weakref.WeakKeyDictionary[World, maps.Level] = weakref.WeakKeyDictionary()

    def build(settings: Settings | None = None, seed: int = 0) -> World:
        world, levels[world] = maps.world_of(path, settings=settings, level=level)
        return world

    try:
        first, *more = maps.levels_of(path)
        if level is None and more:
            click.echo(f"carom: {path}: level {first!r}, the first of {1 + len(more)}: --level chooses one", err=True)
        level = level or first
        size = maps.world_of(path, level=level)[1].size
    except maps.MapError as error:
        raise Problem(one_line(error)) from error
    return Loaded(path.name, build, path.resolve(), view=((0.0, 0.0), size), level_of=levels.__getitem__)


def import_file(path: Path) -> ModuleType:
    """Import the module in that file, under a name of its own; Problem if it does not exist or raises."""
    return _execute(path, _source(path))


def _source(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        near = did_you_mean(path.name, [each.name for each in path.parent.glob("*.py")])
        raise Problem(f"no file {str(path)!r}{near}") from None
    except OSError as error:
        raise Problem(f"{path}: {error.strerror}") from error


def _binds_build(source: bytes) -> bool:
    try:
        symbols = symtable.symtable(source.decode(errors="replace"), "", "exec").get_symbols()
    except (SyntaxError, ValueError):
        return True  # its execution will say where
    own = {symbol.get_name() for symbol in symbols if symbol.is_assigned() or symbol.is_imported()}
    return "build" in own or b"import *" in source


def _load_file(path: Path) -> Loaded:
    source = _source(path)
    missing = f"{path.name} defines no build(settings, seed=0)"
    if not _binds_build(source):
        raise Problem(missing)  # before it runs: it may be a whole game
    module = _execute(path, source)
    function, compared = getattr(module, "build", None), getattr(module, "compared", None)
    if not callable(function):
        raise Problem(missing)
    try:
        inspect.signature(function).bind(None, seed=0)
    except TypeError:
        line = getattr(getattr(function, "__code__", None), "co_firstlineno", "?")
        raise Problem(f"{path.name}, line {line}: build must take (settings, seed=0)") from None
    seconds, view, settings = (getattr(module, name, getattr(module, name.upper(), None))
                               for name in ("seconds", "view", "settings"))  # fmt: skip
    number = isinstance(seconds, (int, float)) and not isinstance(seconds, bool)
    if seconds is not None and not (number and 0 <= seconds < math.inf):
        raise Problem(f"{path.name}: seconds must be a number of at least 0, not {seconds!r}")
    try:
        view = None if view is None or callable(view) else corners(view)
    except (TypeError, ValueError):
        raise Problem(f"{path.name}: view must be (lower corner, upper corner), not {view!r}") from None
    if compared is not None and not callable(compared):
        raise Problem(f"{path.name}: compared must be a function, compared(world) -> dict, not {compared!r}")
    own = settings if isinstance(settings, Settings) else None
    return Loaded(path.name, function, path.resolve(), seconds, view, own, vars(module)["__siblings__"], compared)


def _execute(path: Path, source: bytes) -> ModuleType:
    folder = hashlib.sha256(str(path.resolve().parent).encode()).hexdigest()[:8]
    name, siblings = f"carom_file_{path.stem}_{folder}", Siblings(path)
    module = ModuleType(name)
    module.__file__, module.__siblings__ = str(path), siblings  # type: ignore[attr-defined]
    sys.modules[name] = module  # dataclasses and pickle look here
    try:
        with siblings.at_hand(), stdout_kept_clean():
            exec(compile(source, str(path), "exec", dont_inherit=True), vars(module))  # no byte code is kept
    except SyntaxError as error:
        raise Problem(f"{Path(error.filename or path).name}, line {error.lineno}: {error.msg}") from error
    except (Exception, SystemExit) as error:
        raise Problem(f"{path.name}{_place_in(path.resolve(), error)}: {one_line(error)}") from error
    return module


def _place_in(file: Path | None, error: BaseException) -> str:
    """`, line 12`: the last line of the user's file, or of a module beside it, `, in enemies.py, line 3`, in the
    traceback of the error or its first cause; else empty."""
    if file is None:
        return ""
    links: list[BaseException] = []
    link: BaseException | None = error
    while link is not None and link not in links:
        links.append(link)
        link = link.__cause__ or link.__context__
    for each in reversed(links):  # the first cause is the most precise
        for frame, line in reversed([*traceback.walk_tb(each.__traceback__)]):
            place = Path(frame.f_code.co_filename or ".").resolve()
            if place == file:
                return f", line {line}"
            beside = file.parent / str(frame.f_globals.get("__name__")).partition(".")[0]
            if beside.with_suffix(".py") == place or beside in place.parents:
                return f", in {place.relative_to(file.parent)}, line {line}"
    return ""


# -- modules beside a file -------------------------------------------------------------------------------


_all: weakref.WeakSet[Siblings] = weakref.WeakSet()


def module_of(thing: type) -> ModuleType | None:
    """The module of a class, which may lie beside a file of the user."""
    name = thing.__module__
    found = (sys.modules.get(name), *(siblings.modules.get(name) for siblings in _all))
    return next((module for module in found if module and vars(module).get(thing.__name__) is thing), None)


class Siblings:
    """The modules that a file imports from its own folder.

    Two files from different folders may both ``import params``: each gets its own.
    """

    def __init__(self, file: Path) -> None:
        self.folder = file.resolve().parent
        self.modules: dict[str, ModuleType] = {}
        self._at_hand = False
        _all.add(self)

    @property
    def files(self) -> set[Path]:
        """Where those that have been imported come from."""
        return {Path(file) for module in self.modules.values() if (file := getattr(module, "__file__", None))}

    @contextmanager
    def at_hand(self) -> Iterator[None]:
        """Imports find the file's siblings; afterwards ``sys.path`` and ``sys.modules`` are as they were before."""
        if self._at_hand:
            yield
            return
        path, before = str(self.folder), {**sys.modules}
        sys.modules.update(self.modules)
        sys.path.insert(0, path)
        self._at_hand = True
        try:
            yield
        finally:
            self._at_hand = False
            if path in sys.path:
                sys.path.remove(path)
            own = [name for name, module in sys.modules.items() if before.get(name) is not module and self._holds(name)]
            self.modules.update((name, sys.modules.pop(name)) for name in own)
            sys.modules.update((name, before[name]) for name in own if name in before)

    def _holds(self, name: str) -> bool:
        """Whether a module, or the package it belongs to, lies in the folder itself."""
        top = sys.modules.get(name.partition(".")[0])
        places = [getattr(top, "__file__", None), *getattr(top, "__path__", ())]
        return any(self.folder in [*Path(place).parents][:2] for place in places if place)
