"""``load`` and ``check``: from a file to a plan of all its entities, and, if nothing is wrong, to a world."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..components import Collider, Prefab
from ..framework import CaromError, Component, Plugin, Settings, World
from ..framework.plugins.discovery import find
from ..plugins import Physics
from ..systems.shapes.geometry_levels import LevelCheck, check_beside, in_order
from .bodies import Bodies
from .contents import LevelLayer
from .errors import Finding, Findings, MapError, RefusedError
from .fields import Fields, Sorter, Vocabulary
from .formats.ldtk import is_ldtk, level_names, read_ldtk
from .formats.model import MapData, MapLayer, MapObject
from .formats.reading import Property, document
from .formats.tiled import read_tiled
from .level import Level
from .plan import Late, Maker, Planned
from .tiles import TileLayers


def load(
    path: str | Path,
    world: World,
    components: Iterable[type[Component]] = (),
    prefabs: Mapping[str, Prefab] | None = None,
    *,
    layers: Any = None,
    materials: Mapping[str, Mapping[str, Any] | None] | None = None,
    level: str | None = None,
    metres: float = 1.0,
) -> Level:
    """A map of Tiled (.tmx, .tmj) or LDtk (.ldtk) into a 2D world; its lower left corner is at (0, 0), y is up.
    MapError for what is wrong with it, and nothing of it is in the world then.

    components, prefabs
        what classes in the map mean by their names, and those of carom
    layers
        an ``enum.IntFlag`` class or a dict of bits: names of layers in the map; None: those of the world
    materials
        fields of colliders, as ``{"Ice": {"friction": 0.02}}``, by the classes of solid tiles, or the names of IntGrid
        values; None: no body
    level
        of the LDtk project; None: the only one
    metres
        m, side length of a tile
    """
    if world.dimensions != 2:
        raise ValueError(f"maps.load: maps are for 2D worlds, this world has {world.dimensions} dimensions")
    plan = Plan.of(path, Vocabulary(world, components, prefabs, layers, materials), level, metres)
    plan.findings.refuse()
    Maker(world, plan.level).make(plan.planned)
    return plan.level


def check(
    path: str | Path,
    components: Iterable[type[Component]] = (),
    prefabs: Mapping[str, Prefab] | None = None,
    *,
    layers: Any = None,
    materials: Mapping[str, Mapping[str, Any] | None] | None = None,
    level: str | None = None,
    world: World | None = None,
    lenient: bool = False,
) -> list[Finding]:
    """All that is wrong with a map, [] if nothing is; arguments as of :func:`load`, ``lenient``: classes that are not
    given are taken for the game's, and not looked at; images that are missing are findings too."""
    return look_at(path, Vocabulary(world, components, prefabs, layers, materials, lenient), level)


def look_at(path: str | Path, known: Vocabulary, level: str | None = None) -> list[Finding]:
    """What :func:`check` finds; ``known.unknown`` has the classes that a lenient one has not looked at."""
    try:
        plan = Plan.of(path, known, level)
    except MapError as error:
        return error.findings
    for each in missing_images(plan.level):
        plan.findings.add(f"image {each} is missing; what it shows is drawn as boxes")
    return plan.findings.found


def world_of(
    path: str | Path, *plugins: Plugin, components: Iterable[type[Component]] = (), settings: Settings | None = None,
    level: str | None = None, metres: float = 1.0,
) -> tuple[World, Level]:  # fmt: skip
    """(a new world with the plugins that a map needs and others, the map in it); ``components``: as of :func:`load`,
    but other classes mean nothing. MapError for what is wrong with the map."""
    components = tuple(components)
    plan = Plan.of(path, Vocabulary(None, components, lenient=True), level, metres)
    plan.findings.refuse()
    names = {component.plugin or component.__module__.split(".")[2] for component in plan.types if _is_carom(component)}
    given = {plugin.name for plugin in plugins}
    needed = [find(name) for name in sorted(names - given)]
    world = World(Physics(dimensions=2, gravity=(0.0, -9.81)), *needed, *plugins, settings=settings or Settings())
    plan = Plan.of(path, Vocabulary(world, components, lenient=True), level, metres)
    plan.findings.refuse()
    Maker(world, plan.level).make(plan.planned)
    return world, plan.level


def _is_carom(component: type[Component]) -> bool:
    """Whether a plugin of this package brings it."""
    return bool(component.plugin) or component.__module__.startswith(f"{__name__.partition('.')[0]}.plugins.")


def levels_of(path: str | Path) -> list[str | None]:
    """The names of the levels in an LDtk project; of one without levels, a map of Tiled, or a file that cannot be read,
    [None]."""
    try:
        node = document(Path(path))
        return [*level_names(node)] or [None] if is_ldtk(node) else [None]
    except RefusedError:
        return [None]


def missing_images(level: Level) -> list[Path]:
    """Those that the pictures of a level should come from."""
    paths = dict.fromkeys(picture.path for picture in level.pictures if picture.path is not None)
    return [path for path in paths if not path.is_file()]


class Plan:
    """What a map becomes: a level, and entities to be made."""

    def __init__(self, file: Path, data: MapData, findings: Findings, known: Vocabulary, metres: float) -> None:
        self.findings, self.known, self.planned = findings, known, list[Planned]()
        scale = metres / data.tile
        self.level = level = Level(file, (data.columns * metres, data.rows * metres), metres, data.tile)
        level.pictures, level.background = data.pictures, data.background
        level.properties = {name: each.value for name, each in data.properties.items()}
        objects: dict[Any, tuple[MapObject, MapLayer]] = {}
        for layer in data.layers:
            for thing in layer.objects:
                if thing.id and thing.id in objects:
                    findings.add(f"two objects have the id {thing.id}, in layers {objects[thing.id][1].name!r} and "
                                 f"{layer.name!r}")  # fmt: skip
                objects[thing.id] = thing, layer
        bodies = Bodies(objects, scale, data.rows * metres)
        bodies.sorter = Sorter(known, findings, bodies.points_of, bodies.place_of, bodies.to_world)
        tiles = TileLayers(data, metres, bodies, findings)
        for layer in data.layers:
            base = Fields()
            for each in (*layer.groups, layer):
                with findings.at(f"layer {each.name!r}"):
                    base = bodies.sorter.sort(each.kinds, each.properties, base)
            with findings.at(f"layer {layer.name!r}"):
                self._layer(layer, base, bodies, tiles, scale)
        self._check_references(objects)
        for each in self.planned:
            with findings.at(each.place):
                self._check_body(each)
        self._check_world()

    @classmethod
    def of(cls, path: str | Path, known: Vocabulary, level: str | None, metres: float = 1.0) -> Plan:
        """Of a file; MapError if there is no way on after what is wrong."""
        if isinstance(metres, str) or not 0.0 < metres < np.inf:
            raise ValueError(f"maps.load: metres must be a finite number above 0, got {metres!r}")
        file = Path(path)
        findings = Findings(file)
        try:
            node = document(file)
            if is_ldtk(node):
                data = read_ldtk(file, node, level, findings, known.is_class, known.materials)
            else:
                data = read_tiled(file, node, findings)
        except (RefusedError, RecursionError) as error:
            text = str(error) if isinstance(error, RefusedError) else "groups are nested too deep"
            findings.found.insert(0, Finding(file, "", text))
            raise MapError(findings.found) from error
        return cls(file, data, findings, known, metres)

    def _layer(self, layer: MapLayer, base: Fields, bodies: Bodies, tiles: TileLayers, scale: float) -> None:
        x, y = layer.offset
        whole = *layer.groups, layer
        out = LevelLayer(
            layer.name, layer.kind,
            tuple(kind.strip() for each in whole for kind in each.kinds.split(",") if kind.strip()),
            {name: value for each in whole for name, value in _plain(each.properties).items()},
            (x * scale, -y * scale), layer.parallax, layer.opacity, layer.visible, layer.tint,
            picture=layer.picture, repeat=layer.repeat,
        )  # fmt: skip
        self.level.layers[_free(layer.name, self.level.layers)] = out
        if layer.kind == "tiles":
            self.planned += tiles.planned(layer, base, out)
        for thing in layer.objects:
            title = f"object {thing.id}" + (f" {thing.name!r}" if thing.name else "")
            with self.findings.at(title):
                seen = self.level.objects[thing.id] = bodies.seen(thing, layer)
                if thing.shape == "point":
                    self.level.points.put(thing.name, seen.place)  # type: ignore[attr-defined]
                made = bodies.planned(f"layer {layer.name!r}, {title}", thing, layer, base, out, seen)
                self.planned += [made] if made is not None else []

    def _check_references(self, objects: Mapping[Any, Any]) -> None:
        have = {each.object.id for each in self.planned if each.object is not None}
        for each in self.planned:
            for reference in each.references:
                what = f"property '{reference.component.__name__}.{reference.field}'"
                with self.findings.at(each.place), self.findings.at(what):
                    if reference.id not in objects:
                        raise RefusedError(f"it refers to object {reference.id}, which is not in the map")
                    if reference.id not in have:
                        thing = objects[reference.id][0]
                        if thing.shape == "point" and self.known.lenient and self.known.world is None:
                            continue  # a prefab of the game, maybe
                        raise RefusedError(f"it refers to object {reference.id} {thing.name!r}, which has no entity")

    @property
    def types(self) -> dict[type[Component], str]:
        """Types of components in the map, each with the first place that has it."""
        found: dict[type[Component], str] = {}
        for each in self.planned:
            for component in each.types:
                found.setdefault(component, each.place)
        return found

    def _check_body(self, planned: Planned) -> None:
        """What no step takes: components that cannot be together."""
        world = self.known.world
        check = None
        if world is not None and world.physics is not None:
            check = LevelCheck(world.physics.table, world.registry)
        for body in planned.bodies:
            of: dict[Any, Any] = {}
            for each in (*body, *planned.beside):
                of[each.kind if isinstance(each, Late) else type(each)] = each
            levels = [each for kind, each in of.items() if issubclass(kind, Collider)]
            try:
                for kind in of:
                    check_beside(kind, of, "it")
                if check is not None and world is not None and len(levels) > 1:
                    levels = [each.copy() for each in levels]
                    for each in levels:
                        each.take_bits(each.bits_by_name(world._layer_names))
                    check({0: {type(each): each for each in levels}})
            except (ValueError, CaromError) as error:
                raise RefusedError(str(error).removeprefix("entity 0: ")) from error

    def _check_world(self) -> None:
        """What the world has no plugin for."""
        world = self.known.world
        if world is None:
            return
        for component, place in self.types.items():
            with self.findings.at(place):
                try:
                    if component.plugin:
                        world.registry.require(component)
                    elif issubclass(component, Collider):
                        in_order(world.registry, [component])
                except (ValueError, CaromError) as error:
                    raise RefusedError(str(error)) from error


def _free(name: str, names: Mapping[str, Any]) -> str:
    """A name that is not taken: layers of Tiled may share theirs."""
    count, free = 1, name
    while free in names:
        count += 1
        free = f"{name} ({count})"
    return free


def _plain(properties: Mapping[str, Property]) -> dict[str, Any]:
    return {name: each.value for name, each in properties.items()}
