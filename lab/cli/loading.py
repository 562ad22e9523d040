"""Loading of what a command runs: a scene of the library by name, or a file that defines build(settings, seed=0)."""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import inspect
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

import numpy as np

from ... import scenes
from ...framework import Plugin, Settings, World
from .options import apply, is_view
from .usage_errors import Problem, did_you_mean, one_line

Bounds = tuple[tuple[float, ...], tuple[float, ...]]


@dataclass(frozen=True)
class Loaded:
    """Something that builds worlds; ``seconds``, ``view`` and ``compared`` are None if not defined.

    settings: those that it recommends; None: not known before a world is built
    compared: compared(world) -> dict: what a game is judged by
    """

    name: str
    function: Any
    file: Path | None = None
    seconds: float | None = None
    view: Bounds | None = None
    settings: Settings | None = None
    siblings: Siblings | None = None
    compared: Any = None

    def build(
        self, settings: Settings | None, changes: dict[str, Any], seed: int, plugins: Sequence[Plugin] = ()
    ) -> World:
        """A world with ``settings`` (None: those that the scene or the file has itself) and with additional plugins;
        Problem if it fails."""
        chosen = settings
        if settings is None:
            settings = self.settings
        brought = {name for each in plugins for name in (*each.integrators, *each.broad_phases, *each.mixing_rules)}
        late = {field: value for field, value in changes.items() if value in brought}
        early = {field: value for field, value in changes.items() if field not in late}
        if early:
            settings = apply(settings or self._own_settings(seed), early)
        world = self._call(settings, seed)
        ignored = _what_is_ignored(world.settings, chosen, early)
        if ignored is not None:
            world.close()
            raise Problem(
                f"{self.name}: build ignores its settings, so {ignored} has no effect: give them to the world, "
                f"World(..., settings=settings)"
            )
        for plugin in plugins:
            try:
                with stdout_kept_clean():
                    world.add_plugin(plugin)
            except (Exception, SystemExit) as error:  # runs third-party code that creates systems
                raise Problem(f"--plugin {plugin.name}: {one_line(error)}") from error
        if late:
            with self.attribute_errors():
                world.settings = apply(world.settings, late)
        return world

    def _call(self, settings: Settings | None, seed: int) -> World:
        with self.attribute_errors(), stdout_kept_clean():
            world = self._own_world(seed) if settings is None else self.function(settings, seed=seed)
        if not isinstance(world, World):
            what = "nothing (None)" if world is None else f"a {type(world).__name__}"
            raise Problem(f"{self.name}: build returned {what}, not a World")
        if world.dimensions is None:
            raise Problem(f"{self.name}: no physics in this world: World(Physics(...))")
        return world

    @property
    def _default(self) -> Settings | None:
        """The default of the parameter of ``build``, if it has one."""
        default = next(iter(inspect.signature(self.function).parameters.values())).default
        return default if isinstance(default, Settings) else None

    def _own_settings(self, seed: int) -> Settings:
        """Those to be changed: of a build that makes its own of None, of a world that it has built."""
        if self._default is not None:
            return self._default
        with contextlib.closing(self._call(None, seed)) as world:
            return world.settings

    def _own_world(self, seed: int) -> Any:
        """With the settings that ``build`` has by default, or makes of None; Settings() if it cannot take None."""
        try:
            return self.function(self._default, seed=seed)
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
                numbers = np.atleast_1d(np.array(np.nan if value is None else value, float))
            except (TypeError, ValueError):
                numbers = np.zeros(0)
            if numbers.shape not in ((1,), (world.dimensions,)):
                raise Problem(
                    f"{self.name}: compared must give a number, None or a place for each name, not {value!r} for "
                    f"{name!r}"
                )
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
        except (Exception, SystemExit) as error:
            if isinstance(error, Problem):
                raise
            raise Problem(f"{self.name}{_line_in(self.file, error)}: {one_line(error)}") from error


def _what_is_ignored(found: Settings, chosen: Settings | None, changes: dict[str, Any]) -> str | None:
    """The option that a world's settings show nothing of; of a preset a build may change this and that, not all."""
    for field, value in changes.items():
        if getattr(found, field) != value:
            return f"--set {field}={value}"
    if chosen is None:
        return None
    default = Settings()
    told = [field.name for field in dataclasses.fields(Settings)]
    told = [name for name in told if name not in changes and getattr(chosen, name) != getattr(default, name)]
    if told and all(getattr(found, name) != getattr(chosen, name) for name in told):
        return "--settings"
    return None


def stdout_kept_clean() -> contextlib.AbstractContextManager[Any]:
    """Redirect prints of user code to stderr, so that stdout holds only the result."""
    return contextlib.redirect_stdout(sys.stderr)


def load(target: str) -> Loaded:
    """The scene named ``target``, with hyphens if one likes, or the file at that path; Problem if neither exists."""
    name = target.replace("-", "_")
    if name in scenes.names():
        scene = scenes.get(name)
        return Loaded(scene.name, scene.build, seconds=scene.seconds, view=scene.view, settings=scene.settings)
    path = Path(target)
    if path.is_dir():
        raise Problem(f"{target!r} is a folder, not a scene or a file")
    if path.is_file() and path.suffix != ".py":
        raise Problem(f"{target!r} is not a Python file: a file of one's own ends in .py")
    if path.suffix == ".py":
        return _load_file(path)
    if path.parent != Path():
        raise Problem(f"no file {target!r}: a file of one's own ends in .py")
    raise Problem(f"no scene named {target!r}{did_you_mean(target, scenes.names())} (a file of one's own ends in .py)")


def import_file(path: Path) -> ModuleType:
    """Import the module in that file; Problem if it does not exist or raises."""
    _must_exist(path)
    return _execute(path, Siblings(path))


def _must_exist(path: Path) -> None:
    if not path.exists():
        siblings = [p.name for p in path.parent.glob("*.py")]
        hint = did_you_mean(path.name, siblings) if siblings else ""
        raise Problem(f"no file {str(path)!r}{hint if 'mean' in hint else ''}")
    if not path.is_file():
        raise Problem(f"{str(path)!r} is not a file")


def _load_file(path: Path) -> Loaded:
    _must_exist(path)
    _check_source(path)
    siblings = Siblings(path)
    module = _execute(path, siblings)
    function = getattr(module, "build", None)
    if not callable(function):
        raise Problem(f"{path.name} defines no build(settings, seed=0)")
    _check_signature(path, function)
    seconds, view = _seconds_of(path, module), _view_of(path, module)
    compared = getattr(module, "compared", None)
    if compared is not None and not callable(compared):
        raise Problem(f"{path.name}: compared must be a function, compared(world) -> dict, not {compared!r}")
    settings = _value_in(module, "settings")
    own = settings if isinstance(settings, Settings) else None
    return Loaded(path.name, function, path.resolve(), seconds, view, own, siblings, compared)


def _check_source(path: Path) -> None:
    """Problem for a file without a build; such a file is not executed, since it may be a whole game."""
    try:
        source = path.read_bytes()
        module = symtable.symtable(source.decode(errors="replace"), str(path), "exec")
    except SyntaxError as error:
        raise Problem(f"{path.name}, line {error.lineno}: {error.msg}") from error
    except (OSError, ValueError) as error:
        raise Problem(f"{path.name}: {one_line(error)}") from error
    names = [symbol.get_name() for symbol in module.get_symbols() if symbol.is_assigned() or symbol.is_imported()]
    if "build" not in names and b"import *" not in source:
        hint = did_you_mean("build", names) if names else ""
        raise Problem(f"{path.name} defines no build(settings, seed=0){hint if 'mean' in hint else ''}")


def _value_in(module: Any, name: str) -> Any:
    """What the file calls that, or the same in capitals."""
    return getattr(module, name, getattr(module, name.upper(), None))


def _seconds_of(path: Path, module: Any) -> float | None:
    """The duration that the file recommends."""
    value = _value_in(module, "seconds")
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 <= value < float("inf"):
        raise Problem(f"{path.name}: seconds must be a number of at least 0, not {value!r}")
    return float(value)


def _view_of(path: Path, module: Any) -> Bounds | None:
    """The file's ``view``: its lower and its upper corner."""
    value = _value_in(module, "view")
    if value is None or callable(value):
        return None
    try:
        lower, upper = (tuple(float(x) for x in end) for end in value)
    except (TypeError, ValueError):
        lower, upper = (), ()
    if not is_view((lower, upper)):
        raise Problem(f"{path.name}: view must be (lower corner, upper corner), not {value!r}")
    return lower, upper


def _execute(path: Path, siblings: Siblings) -> Any:
    """Import the file under a name of its own."""
    folder = hashlib.sha256(str(path.resolve().parent).encode()).hexdigest()[:8]
    name = f"carom_file_{path.stem}_{folder}"
    module = ModuleType(name)
    module.__file__, module.__siblings__ = str(path), siblings  # type: ignore[attr-defined]
    sys.modules[name] = module  # dataclasses and pickle look here
    try:
        with siblings.at_hand(), stdout_kept_clean():
            exec(compile(path.read_bytes(), str(path), "exec", dont_inherit=True), vars(module))  # no byte code is kept
    except SyntaxError as error:
        file = Path(error.filename).name if error.filename else path.name
        raise Problem(f"{file}, line {error.lineno}: {error.msg}") from error
    except (Exception, SystemExit) as error:
        raise Problem(f"{path.name}{_line_in(path.resolve(), error)}: {one_line(error)}") from error
    return module


def _check_signature(path: Path, function: Any) -> None:
    try:
        inspect.signature(function).bind(None, seed=0)
    except TypeError:
        line = getattr(getattr(function, "__code__", None), "co_firstlineno", None)
        where = f", line {line}" if line else ""
        raise Problem(f"{path.name}{where}: build must take (settings, seed=0)") from None


def _line_in(file: Path | None, error: BaseException) -> str:
    """`, line 12`: the last line of the user's file in the traceback of the error or its first cause; else empty."""
    links: list[BaseException] = []
    link: BaseException | None = error
    while link is not None and link not in links:
        links.insert(0, link)  # the first cause is the most precise
        link = link.__cause__ or link.__context__
    frames = (reversed(traceback.extract_tb(link.__traceback__)) for link in links if file is not None)
    lines = (frame.lineno for some in frames for frame in some if Path(frame.filename or ".").resolve() == file)
    line = next(lines, None)
    return f", line {line}" if line is not None else ""


# -- modules beside a file -------------------------------------------------------------------------------


_all: weakref.WeakSet[Siblings] = weakref.WeakSet()


def module_of(thing: type) -> ModuleType | None:
    """The module of a class, which may lie beside a file of the user."""
    name = thing.__module__
    found = (sys.modules.get(name), *(siblings._modules.get(name) for siblings in _all))
    return next((module for module in found if vars(module or thing).get(thing.__name__) is thing), None)


class Siblings:
    """The modules that a file imports from its own folder.

    Two files from different folders may both ``import params``: each gets its own.
    """

    def __init__(self, file: Path) -> None:
        self.folder = file.resolve().parent
        self._modules: dict[str, ModuleType] = {}
        self._depth = 0
        _all.add(self)

    @property
    def files(self) -> set[Path]:
        """Where those that have been imported come from."""
        return {Path(file) for module in self._modules.values() if (file := getattr(module, "__file__", None))}

    @contextmanager
    def at_hand(self) -> Iterator[None]:
        """Imports find the file's siblings; afterwards ``sys.path`` and ``sys.modules`` are as they were before."""
        if self._depth:
            yield
            return
        self._depth += 1
        path = str(self.folder)
        before = {name: module for name, module in sys.modules.items() if name in self._modules}
        known = set(sys.modules) - before.keys()
        sys.modules.update(self._modules)
        sys.path.insert(0, path)
        try:
            yield
        finally:
            self._depth -= 1
            if path in sys.path:
                sys.path.remove(path)
            for name in [name for name in sys.modules if name not in known and self._is_sibling(name)]:
                self._modules[name] = sys.modules.pop(name)
            sys.modules.update(before)

    def _is_sibling(self, name: str) -> bool:
        """Whether a module, or the package it belongs to, lies in the folder itself."""
        top = sys.modules.get(name.partition(".")[0])
        file = getattr(top, "__file__", None)
        if file is not None:
            place = Path(file)
            return self.folder == (place.parent.parent if place.stem == "__init__" else place.parent)
        return any(Path(folder).parent == self.folder for folder in getattr(top, "__path__", ()))
