"""Worlds in files: a snapshot as numpy's npz, without pickle. Reading runs no code of the file.

The entry ``carom`` is JSON; an array in it stands as ``{"#array": name}`` for the entry of that name, and other keys
that begin with # have another # before it. Component classes stand as numbers of the list ``components``, which names
them and their fields.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import io
import json
import os
import secrets
import time
import zipfile
from collections.abc import Callable, Collection, Iterable, Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from ..data.component import Component
from ..data.layers import LayerNames
from ..data.saved.population import LooseValues, Population, is_ours
from ..data.saved.table import SavedTable
from ..errors import CaromError
from ..settings import Settings
from .snapshots import Snapshot

FORMAT = 6  # of the files; a reader refuses others
PARTS = ("dimensions", "plugins", "dead", "next_id", "contacts", "physics", "clock", "steps")  # of a snapshot, as it is
ARRAY = "#array"
PART = ".carom-part-"  # and a random number: a file that is being written
LEFT_ALONE = 3600  # s, after which no process writes it any more
DAMAGE = (ArithmeticError, AttributeError, LookupError, MemoryError, TypeError, ValueError)  # by what is not as written


# -- writing -----------------------------------------------------------------------------------------------------------


def must_be_path(verb: str, path: Any) -> None:
    if not isinstance(path, (str, os.PathLike)):
        raise TypeError(f"{verb} takes the path of a file, got {path!r}")


def write(
    path: str | os.PathLike[str], snapshot: Snapshot, settings: Settings, layers: LayerNames | None,
    leave_out: Collection[type],
) -> None:  # fmt: skip
    """A file at that path, whole or not at all; CaromError if a component or a plugin keeps what no file can hold."""
    population = _without(snapshot.population, leave_out)
    types = list(dict.fromkeys((*snapshot.table.types, *population.types)))
    number = {component: index for index, component in enumerate(types)}
    arrays: dict[str, np.ndarray] = {}
    contents = {
        "format": FORMAT,
        "settings": dataclasses.asdict(settings),
        "layers": {} if layers is None else layers.single,
        "components": [_described(component) for component in types],
        **{name: getattr(snapshot, name) for name in PARTS},
        "population": _population(population, number),
        "loose": _numbered(snapshot.loose.__getstate__(), number),
        "table": _numbered(snapshot.table.__getstate__(), number),
    }
    plain = _plain(contents, arrays)
    plain["kept"] = {name: _kept_by(name, kept, arrays) for name, kept in snapshot.kept.items()}
    plain["sum"] = _sum_of(arrays)
    arrays["carom"] = np.frombuffer(json.dumps(plain).encode(), np.uint8)
    with whole_file(path) as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]


@contextlib.contextmanager
def whole_file(path: str | os.PathLike[str]) -> Iterator[BinaryIO]:
    """A file to write, which takes the place of the one at that path in the end, with its mode, or not at all.

    A link stays, and what it leads to is replaced. CaromError for what is no ordinary file.
    """
    given, path = os.fspath(path), Path(os.path.realpath(path))
    if path.exists() and not path.is_file():
        raise CaromError(f"{path} is no file that can be replaced")
    for left in path.parent.glob(f"{PART}*"):  # by a process that was killed
        with contextlib.suppress(OSError):
            if time.time() - left.stat().st_mtime > LEFT_ALONE:
                left.unlink()
    part = path.with_name(f"{PART}{secrets.token_hex(8)}")
    try:
        with part.open("xb") as file:
            yield file
        if path.exists():
            part.chmod(path.stat().st_mode)
        part.replace(path)
    except BaseException as error:
        with contextlib.suppress(OSError):
            part.unlink()
        if isinstance(error, OSError) and str(error.filename) == str(part):
            error.filename = given
        raise


def _without(population: Population, leave_out: Collection[type]) -> Population:
    """Without components that no file can hold, if they may be left out."""
    for component in leave_out:
        if is_ours(component):
            raise TypeError(f"leave_out takes types that no file can hold; {component.__name__} is a Component")
    entities = {}
    for entity, components in population.entities.items():
        for component in components:
            if not is_ours(component) and component not in leave_out:
                name = getattr(component, "__name__", repr(component))
                raise CaromError(
                    f"entity {entity} has a {name}, which is no carom Component: a file holds components with columns "
                    f"only. Leave them out with world.save(path, leave_out=[{name}]) and add them again after "
                    f"World.load"
                )
        entities[entity] = {component: None for component in components if is_ours(component)}
    return dataclasses.replace(population, entities=entities, others=[])


def _described(component: type[Component]) -> dict[str, Any]:
    fields = [[name, column.item, np.dtype(column.dtype).str] for name, column in component.columns.items()]
    return {"name": component.__name__, "module": component.__module__, "fields": fields}


def _population(population: Population, number: dict[type, int]) -> dict[str, Any]:
    """Entities that have the same types share the list of these."""
    groups: dict[tuple[int, ...], int] = {}
    types = (tuple(number[component] for component in components) for components in population.entities.values())
    group = [groups.setdefault(each, len(groups)) for each in types]
    return {
        "types": [number[component] for component in population.types],
        "entities": np.array(list(population.entities), np.int64),
        "group": np.array(group, np.int64),
        "groups": list(groups),
        "loose": [[entity, number[component]] for entity, component in population.loose],
    }


def _numbered(value: Any, number: dict[type, int]) -> Any:
    """Numbers in place of component classes."""
    if isinstance(value, dict):
        if value and all(key in number for key in value):
            return [[number[key], _numbered(item, number)] for key, item in value.items()]
        return {key: _numbered(item, number) for key, item in value.items()}
    if isinstance(value, list):
        return [_numbered(item, number) for item in value]
    return number[value] if isinstance(value, type) else value


def _plain(value: Any, arrays: dict[str, np.ndarray]) -> Any:
    """What JSON can hold; the arrays go where they are collected. TypeError for what no file can hold."""
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, (str, int, float)):
        return value
    if isinstance(value, np.ndarray) and not value.dtype.hasobject:
        name = f"a{len(arrays)}"
        arrays[name] = value
        return {ARRAY: name}
    if isinstance(value, dict) and all(isinstance(key, str) for key in value):
        return {f"#{key}" if key[:1] == "#" else key: _plain(item, arrays) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item, arrays) for item in value]
    raise TypeError(f"{value!r}")


def _kept_by(plugin: str, kept: Any, arrays: dict[str, np.ndarray]) -> Any:
    try:
        return _plain(kept, arrays)
    except TypeError as error:
        raise CaromError(
            f"plugin {plugin!r} keeps what no file can hold: {error}. Plugin.saved returns arrays, numbers, texts, and "
            f"lists and dicts (by text) of these"
        ) from None


# -- reading -----------------------------------------------------------------------------------------------------------


class SavedFile:
    """What is in a file; CaromError if it is not one, or not whole, or of a newer carom."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        with self.path.open("rb") as file:
            if file.read(2) != b"PK":
                raise self._none()
            try:
                arrays = _arrays_in(file)
                contents = json.loads(arrays.pop("carom").tobytes()) if "carom" in arrays else None
            except Exception as error:  # numpy and zipfile raise many kinds
                raise self._damaged(error) from error
        if not isinstance(contents, dict) or not isinstance(contents.get("format"), int):
            raise self._none()
        if contents["format"] != FORMAT:
            other = "a newer" if contents["format"] > FORMAT else "another"
            raise CaromError(
                f"{self.path} was saved by {other} carom, in format {contents['format']}; this one reads format "
                f"{FORMAT}"
            )
        if contents.get("sum") != _sum_of(arrays):
            raise self._damaged(ValueError("arrays are not those that world.save has written"))
        self._contents = self.whole(lambda: _with_arrays(contents, arrays))
        self.dimensions: int = self.whole(lambda: self._contents["dimensions"])
        self.plugins: dict[str, str] = self.whole(lambda: dict(self._contents["plugins"]))

    def _none(self) -> CaromError:
        return CaromError(f"{self.path} is no saved world: World.load reads what world.save has written")

    def settings(self) -> Settings:
        return self.whole(lambda: Settings(**self._contents["settings"]))

    def _damaged(self, error: Exception) -> CaromError:
        said = " ".join(f"{type(error).__name__}: {error}".split())
        return CaromError(f"{self.path} is damaged or not complete ({said})")

    def whole(self, read: Callable[[], Any]) -> Any:
        """What that returns; CaromError if something in the file is not as it was written."""
        try:
            return read()
        except CaromError:
            raise
        except DAMAGE as error:
            raise self._damaged(error) from error

    def check_plugins(self, plugins: Iterable[Any]) -> None:
        """CaromError if one is missing, older than it was, or of other dimensions."""
        here = {plugin.name: plugin for plugin in plugins}
        for name, version in self.plugins.items():
            if name not in here:
                raise CaromError(
                    f"{self.path} needs plugin {name!r}{f' {version}' if version else ''}: "
                    f"World.load(path, *plugins) takes all that the world had: {', '.join(self.plugins)}"
                )
            own = here[name].version
            if is_newer(version, own):
                raise CaromError(f"{self.path} was saved with plugin {name!r} {version}, this one is {own or 'older'}")
        for plugin in here.values():
            dimensions = getattr(plugin, "dimensions", self.dimensions)
            if dimensions != self.dimensions:
                raise CaromError(
                    f"{self.path} holds a world of {self.dimensions} dimensions, and plugin {plugin.name!r} is for "
                    f"{dimensions}"
                )

    def check_layers(self, given: LayerNames | None) -> None:
        """CaromError if the world gave names to layers, and none are given now, or one with other bits."""
        saved = self.whole(lambda: dict(self._contents.get("layers", {})))
        if saved and given is None:
            raise CaromError(
                f"{self.path} needs the names of its layers, {', '.join(saved)}: World.load(path, ..., layers=Layers)"
            )
        here = {} if given is None else given.single
        for name, bit in saved.items():
            if here.get(name, bit) != bit:
                raise CaromError(f"{self.path}: layer {name!r} was {bit} when it was saved, and is {here[name]} now")

    def snapshot(self, known: Iterable[type[Component]]) -> Snapshot:
        """What it holds; known: the component classes there are."""
        types = self.whole(lambda: self._component_types(known))
        return self.whole(lambda: self._snapshot(types))

    def _component_types(self, known: Iterable[type[Component]]) -> list[type[Component]]:
        """The classes by their numbers; CaromError if one is missing or has other fields."""
        by_name: dict[str, type[Component]] = {}
        for component in known:
            if by_name.setdefault(component.__name__, component) is not component:
                raise CaromError(f"two component classes are named {component.__name__}: {self.path} cannot tell them")
        needed = {described["name"]: described["module"] for described in self._contents["components"]}
        missing = [name for name in needed if name not in by_name]
        if missing:
            classes = ", ".join(f"{name} of {needed[name]}" for name in missing)
            raise CaromError(
                f"{self.path} needs the component class{'es' * bool(missing[1:])} {classes}: "
                f"World.load(path, ..., components=[{', '.join(missing)}])"
            )
        found = []
        for described in self._contents["components"]:
            name = described["name"]
            own = {field: rest for field, *rest in _described(by_name[name])["fields"]}
            saved = {field: rest for field, *rest in described["fields"]}
            other = sorted(field for field in {*own, *saved} if own.get(field) != saved.get(field))
            if other:
                raise CaromError(
                    f"{self.path}: component {name} had other fields when it was saved: {', '.join(other)}"
                )
            found.append(by_name[name])
        return found

    def _snapshot(self, types: list[type[Component]]) -> Snapshot:
        contents = self._contents
        table, loose = SavedTable.__new__(SavedTable), LooseValues.__new__(LooseValues)
        table.__setstate__({
            **contents["table"], "types": [types[n] for n in contents["table"]["types"]],
            "blocks": tuple(contents["table"]["blocks"]),
        })  # fmt: skip
        _check_columns(table, contents["dimensions"])
        loose.handles = contents["loose"]["handles"]
        population = _population_of(contents["population"], types)
        return Snapshot(
            owner=None, population=population, loose=loose, table=table, kept=contents["kept"],
            **{name: contents[name] for name in PARTS},
        )  # fmt: skip


def _arrays_in(file: BinaryIO) -> dict[str, np.ndarray]:
    """The entries of an npz file; each is read as a whole, which checks its sum, before numpy looks at it."""
    with zipfile.ZipFile(file) as archive:
        whole = {name.removesuffix(".npy"): io.BytesIO(archive.read(name)) for name in archive.namelist()}
    return {name: np.lib.format.read_array(data, allow_pickle=False) for name, data in whole.items()}


def _sum_of(arrays: dict[str, np.ndarray]) -> str:
    """Of all arrays and their names: numbers that do not fit each other would fail, or be wrong, in some later step."""
    digest = hashlib.sha256()
    for name, array in sorted(arrays.items()):
        digest.update(f"{name} {array.dtype.str} {array.shape}".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def _with_arrays(value: Any, arrays: dict[str, np.ndarray]) -> Any:
    if isinstance(value, dict):
        if value.keys() == {ARRAY}:
            return arrays[value[ARRAY]]
        return {key.removeprefix("#"): _with_arrays(item, arrays) for key, item in value.items()}
    return [_with_arrays(item, arrays) for item in value] if isinstance(value, list) else value


def _population_of(saved: dict[str, Any], types: list[type[Component]]) -> Population:
    groups = [[types[n] for n in group] for group in saved["groups"]]
    entities, group = saved["entities"].tolist(), saved["group"].tolist()
    return Population(
        {entity: dict.fromkeys(groups[n]) for entity, n in zip(entities, group, strict=True)},
        [(entity, types[n]) for entity, n in saved["loose"]], [types[n] for n in saved["types"]], [], set(entities),
    )  # fmt: skip


def _check_columns(table: SavedTable, dimensions: int) -> None:
    """ValueError if a column of a component has another shape or type than the component says."""
    count = table.blocks[-1]
    for component in table.types:
        for column in component.columns.values():
            array, shape = table.columns.get(column.key), (count, *column.item_shape(dimensions))
            if array is not None and (array.shape, array.dtype) != (shape, column.dtype):
                raise ValueError(f"column {column.key}")
    if any(len(array) != count for array in table.columns.values()):
        raise ValueError("columns of different lengths")


def is_newer(version: str, than: str) -> bool:
    """Whether a version is newer, number by number; what is no list of numbers is older than any."""
    return _numbers(version) > _numbers(than)


def _numbers(version: str) -> list[int]:
    parts = version.split(".")
    return [int(part) for part in parts] if all(part.isdecimal() for part in parts) else []
