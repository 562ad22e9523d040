"""Objects of a map as bodies, chains, places and sprites."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from ..components import Collider, RigidBody, Transform
from ..components.spin import Spin
from ..plugins.character import Character
from ..plugins.joints import Joint
from ..plugins.parts import parts_from_outline
from ..plugins.paths import MODES, Legs, Path
from .contents import LevelLayer, LevelObject, LevelSprite
from .errors import RefusedError
from .fields import Fields, Sorter, checked
from .formats.model import MapLayer, MapObject, Tile
from .formats.reading import Property
from .plan import Chain, Late, Planned, transform
from .shapes import Shape, collider_of, is_convex, shape_of, tile_shapes, turned

PATHS = ("path", "Path.points", "points")  # properties that make a path of the line they refer to


class Bodies:
    """Makes plans of objects.

    scale: m per pixel; height: m, of the map
    """

    def __init__(self, objects: dict[Any, tuple[MapObject, MapLayer]], scale: float, height: float) -> None:
        self.objects, self.scale, self.height = objects, scale, height
        self.sorter: Sorter
        self.paths = {  # what is a path is no chain
            given.value for thing, _ in objects.values() for name, given in _all_properties(thing)
            if given.type == "object" and name in PATHS
        }  # fmt: skip

    # -- places ----------------------------------------------------------------------------------------

    def to_world(self, pixels: np.ndarray) -> np.ndarray:
        """(n, 2) m."""
        return np.stack((pixels[:, 0] * self.scale, self.height - pixels[:, 1] * self.scale), axis=1)

    def world_place(self, thing: MapObject, layer: MapLayer) -> np.ndarray:
        """(2,) m, of the point from which an object is drawn."""
        x, y = thing.place + layer.offset
        return np.array((x * self.scale, self.height - y * self.scale))

    def place_of(self, id: Any) -> tuple[float, float]:
        """Of the middle of an object."""
        thing, layer = self._object(id)
        place = self.world_place(thing, layer) + turned(self._middle(thing), -math.radians(thing.angle))
        return tuple(place.tolist())

    def points_of(self, id: Any) -> tuple[np.ndarray, bool]:
        """((n, 2) m, whether they are closed) of a polyline or polygon."""
        thing, layer = self._object(id)
        if thing.shape not in ("polyline", "polygon") or thing.points is None:
            raise RefusedError(f"object {id} {thing.name!r} is a {thing.shape}, and no polyline")
        points = turned(thing.points * (self.scale, -self.scale), -math.radians(thing.angle))
        return self.world_place(thing, layer) + points, thing.shape == "polygon"

    def _object(self, id: Any) -> tuple[MapObject, MapLayer]:
        if id not in self.objects:
            raise RefusedError(f"it refers to object {id}, which is not in the map")
        return self.objects[id]

    def _middle(self, thing: MapObject) -> np.ndarray:
        """(2,) m, from its place, not turned."""
        if thing.points is not None:
            points = thing.points * (self.scale, -self.scale)
            return 0.5 * (points.min(axis=0) + points.max(axis=0)) if len(points) else np.zeros(2)
        (w, h), (x, y) = thing.size, thing.origin
        return np.array(((0.5 - x) * w, (y - 0.5) * h)) * self.scale

    # -- objects ---------------------------------------------------------------------------------------

    def seen(self, thing: MapObject, layer: MapLayer) -> LevelObject:
        """An object as its game sees it."""
        angle = -math.radians(thing.angle)
        points = self.points_of(thing.id)[0] if thing.points is not None else None
        kinds = thing.kinds or (thing.tile.kinds if thing.tile is not None else "")
        properties = {**(thing.tile.properties if thing.tile is not None else {}), **thing.properties}
        place = self.world_place(thing, layer) + turned(self._middle(thing), angle)
        size = thing.size[0] * self.scale, thing.size[1] * self.scale
        return LevelObject(
            thing.id, thing.name, tuple(each.strip() for each in kinds.split(",") if each.strip()),
            tuple(place.tolist()), size, angle, {name: _plain(each) for name, each in properties.items()},
            points=points,
        )  # fmt: skip

    def planned(
        self, place: str, thing: MapObject, layer: MapLayer, base: Fields, out: LevelLayer, seen: LevelObject | None
    ) -> Planned | None:
        """What an object becomes, None if it is a place, a path or decoration alone."""
        kinds, properties = thing.kinds, thing.properties
        if thing.tile is not None:
            kinds, properties = kinds or thing.tile.kinds, {**thing.tile.properties, **properties}
        is_place = thing.shape in ("point", "text")
        fielded = any("." in name or isinstance(given.value, dict) for name, given in properties.items())
        of_layer = base.prefabs or base.of.keys() - {RigidBody, Spin}
        if is_place and not (kinds or fielded or of_layer):
            return None  # what it says is for the game
        fields = self.sorter.sort(kinds, properties, base)
        if thing.id in self.paths and thing.id is not None:
            if "path" in fields.words:
                raise RefusedError("it is a path, and has one itself")
            return None
        made = Planned(place, out, fields.kinds, seen)
        solid = fields.is_solid is not False and not is_place
        shapes = self._shapes(thing, fields) if solid else []
        if not shapes and not fields.of and not fields.prefabs:
            if thing.tile is not None:
                out.sprites.append(self._sprite(thing, layer, None, np.zeros(2), 0.0))
            return None
        self._body(made, thing, layer, fields, shapes)
        return made

    def _shapes(self, thing: MapObject, fields: Fields) -> list[Shape]:
        """From its place, not turned."""
        if thing.tile is None:
            shape = shape_of(thing, self.scale, fields.words.get("shape", ""))
            return [] if shape is None else [shape]
        size = thing.size[0] * self.scale, thing.size[1] * self.scale
        if not (size[0] > 0.0 and size[1] > 0.0):
            raise RefusedError(f"a tile of {thing.size[0]:g} x {thing.size[1]:g} pixels")
        lower = np.array((-thing.origin[0] * size[0], (thing.origin[1] - 1.0) * size[1]))
        found = self.tile_shapes(thing.tile, thing.flips, size)
        if not found:
            found = [Shape("box", np.array(((0, 0), (1, 0), (1, 1), (0, 1)), float) * size)]
        return [shape.moved(lambda points: points + lower) for shape in found]

    def tile_shapes(self, tile: Tile, flips: int, size: tuple[float, float]) -> list[Shape]:
        """Those of the collision editor, flipped and stretched to ``size`` m; from its lower left corner."""
        for each in tile.shapes:
            with self.sorter.findings.at(f"shape {each.id}"):
                said = self.sorter.sort(each.kinds, each.properties)
                if replace(said, kinds=[], words={}) != Fields() or said.words.keys() - {"shape"}:
                    raise RefusedError("a shape of a tile can say 'shape' alone; the rest is for the tile to say")
        return tile_shapes(tile.shapes, tile.size, flips, size)

    def _body(self, made: Planned, thing: MapObject, layer: MapLayer, fields: Fields, shapes: list[Shape]) -> None:
        if tuple(layer.parallax) != (1.0, 1.0):
            raise RefusedError(f"a body in a layer with parallax {layer.parallax}: class Decoration makes it a picture")
        path = self._path(fields)
        rigid = self._rigid(fields)
        if any(issubclass(kind, Collider) for each in _parts_of(fields) for kind in each):
            shapes = []  # the prefab has its own
        angle, origin = -math.radians(thing.angle), self.world_place(thing, layer)
        for kind in fields.of:
            if issubclass(kind, Joint):
                self._joint(kind, fields, origin + turned(self._middle(thing), angle))
        if rigid is not None or not shapes:
            mass = 1.0 if rigid is None else rigid.mass
            centre, own, rotation = self._moving(made, thing, shapes, fields, angle, mass)
            place = origin + turned(centre, angle)
            if path:
                place = self._start(path)
            made.bodies.insert(0, [transform(place, rotation), *self._components(fields), *own])
        else:
            made.beside = self._components(fields)
            centre, rotation = self.static(made, shapes, fields, angle, origin), angle
        if thing.tile is not None:
            made.sprite = self._sprite(thing, layer, 0, centre, rotation)

    def _rigid(self, fields: Fields) -> RigidBody | None:
        """Whether it moves: its RigidBody, which is among its fields then."""
        prefab: Any = next((each[RigidBody] for each in _parts_of(fields) if RigidBody in each), None)
        if fields.words.get("spins"):
            fields.of.setdefault(Spin, {})
        driven = any(kind in each for kind in (Path, Character) for each in (fields.of, *_parts_of(fields)))
        if RigidBody in fields.of or Spin in fields.of or driven:
            values = fields.of.setdefault(RigidBody, {})
            kind = values.setdefault("kind", "kinematic") if driven else values.get("kind")
            with self.sorter.findings.at("property 'kind'"):
                if driven and kind != "kinematic":
                    raise RefusedError(f"what has a path or is a Character is kinematic, got {kind!r}")
                if Spin in fields.of and kind == "static":
                    raise RefusedError("what spins, or has a property of Spin, cannot be static")
            if kind == "static" and prefab is None and not driven and Spin not in fields.of:
                del fields.of[RigidBody]
                return None
            made = prefab.copy() if prefab is not None else RigidBody()
            for name, value in values.items():
                setattr(made, name, value)
            return made
        return prefab

    def _joint(self, kind: type[Joint], fields: Fields, place: np.ndarray) -> None:
        """Unless it says something else, a joint is where it was drawn, and joins to the world."""
        of_prefab = any(kind in each for each in _parts_of(fields))
        given = {each.field for each in fields.references if each.component is kind}
        for name, value in (("anchor", tuple(place.tolist())), ("a", None)):
            if name in kind._arguments and name not in given and not of_prefab:
                fields.of[kind].setdefault(name, value)

    def _components(self, fields: Fields) -> list[Any]:
        """All but place and shape: of prefabs, with changes, and of classes."""
        made: dict[type, Any] = {}
        for name, prefab in fields.prefabs:
            for kind, component in prefab._components.items():
                if kind is Transform:
                    continue
                if kind in made:
                    raise RefusedError(f"prefab {name!r} and another one both have a {kind.__name__}")
                made[kind] = component.copy()
                for field, value in fields.material.items() if isinstance(component, Collider) else ():
                    setattr(made[kind], field, value)
        for kind, values in fields.of.items():
            references = [each for each in fields.references if each.component is kind]
            late = Late(kind, values, references, made.get(kind))
            try:
                trial = late.made(dict.fromkeys(each.field for each in references))
            except (ValueError, TypeError) as error:
                raise RefusedError(str(error)) from error
            made[kind] = late if references else trial
        return list(made.values())

    # -- shapes ----------------------------------------------------------------------------------------

    def _moving(
        self, made: Planned, thing: MapObject, shapes: list[Shape], fields: Fields, angle: float, mass: float
    ) -> tuple[np.ndarray, list[Any], float]:
        """(its centre from the object's place, the body's collider, its rotation); other parts go to the plan."""
        if not shapes:
            return self._middle(thing), [], angle
        if any(shape.kind == "line" for shape in shapes):
            raise RefusedError("a polyline is a chain, which is static: it has no body")
        pieces = [piece for shape in shapes for piece in _convex(shape)]
        turns = Spin in fields.of or any(Spin in each for each in _parts_of(fields))
        turns = turns or len(pieces) > 1 or fields.words.get("shape") == "box" or bool(angle % (0.5 * math.pi))
        if len(pieces) == 1:
            collider, centre, own = collider_of(pieces[0], fields.material, turns)
            return centre, [collider], angle + own
        pieces.sort(key=lambda piece: -piece.area)
        total = sum(piece.area for piece in pieces)
        middle = np.sum([piece.area * piece.centre for piece in pieces], axis=0) / total
        first, centre, own = collider_of(pieces[0], fields.material, True)
        first.offset = tuple(turned(centre - middle, -own).tolist())
        sensor = bool(fields.material.get("sensor"))
        for piece in pieces[1:]:
            collider, centre, turn = collider_of(piece, fields.material, True)
            share = 0.0 if sensor else mass * piece.area / total
            made.parts.append((turned(centre - middle, -own), turn - own, share, collider))
        if not sensor:
            fields.of.setdefault(RigidBody, {})["mass"] = mass * pieces[0].area / total
        return middle, [first], angle + own

    def static(
        self, made: Planned, shapes: list[Shape], fields: Fields, angle: float, origin: np.ndarray
    ) -> np.ndarray:
        """Plans what does not move, an entity for each shape; the centre of the first one, from the object's place."""
        material, thickness = fields.material, fields.words.get("thickness", 0.0)
        hollow = fields.words.get("hollow", False)
        one_way, sensor = bool(np.any(material.get("one_way", 0.0))), bool(material.get("sensor"))
        own_sides = {name: value for name, value in material.items() if name != "one_way"}
        for shape in shapes:
            placed = shape.moved(lambda points: origin + turned(points, angle))
            if shape.kind == "line":
                made.chains.append(Chain(placed.points, False, thickness, own_sides, one_way))
            elif shape.kind == "polygon" and (hollow or not (sensor or is_convex(shape.points))):
                outline = placed.points if hollow else placed.points[::-1]
                made.chains.append(Chain(outline, True, thickness, material))
            else:
                for piece in _convex(shape):
                    turns = bool(angle % (0.5 * math.pi)) or fields.words.get("shape") == "box"
                    collider, centre, own = collider_of(piece, material, turns)
                    made.bodies.append([transform(origin + turned(centre, angle), angle + own), collider])
        return shapes[0].centre

    # -- paths -----------------------------------------------------------------------------------------

    def _path(self, fields: Fields) -> dict[str, Any]:
        """The fields of its Path, from the word ``path`` too, and from a prefab; {} if it has none."""
        given = fields.words.get("path")
        if given is not None:
            values = fields.of.setdefault(Path, {})
            if given.type == "places":
                points, closed = self.to_world(given.value), False
            else:
                points, closed = self.points_of(given.value)
            values.setdefault("points", checked(Path.columns["points"], points))
            if closed:
                values.setdefault("mode", "loop")
        if Path not in fields.of:
            return {}
        prefab = next((each[Path] for each in _parts_of(fields) if Path in each), None)
        found = {name: getattr(prefab, name) for name in Path._arguments if prefab is not None} | fields.of[Path]
        if "points" not in found:
            raise RefusedError("its Path needs points: property 'path', of type object, that refers to a polyline")
        if "speed" not in found:
            raise RefusedError("its path needs a speed: property 'speed' or 'Path.speed', m/s")
        return found

    def _start(self, values: dict[str, Any]) -> np.ndarray:
        """(2,) m, where a body on this path begins."""
        mode = MODES.index(values.get("mode", "back_and_forth"))
        legs = Legs([np.asarray(values["points"], float)], np.array([mode]))
        travelled = legs.folded(np.array([values.get("travelled", 0.0)]), np.zeros(1))
        return legs.places(travelled, np.array([bool(values.get("ease", False))]))[0]

    def _sprite(
        self, thing: MapObject, layer: MapLayer, entity: int | None, centre: np.ndarray, rotation: float
    ) -> LevelSprite:
        """The picture of a tile object; ``centre`` of its body from its place, and the body's rotation."""
        angle, middle = -math.radians(thing.angle), self._middle(thing)
        if entity is None:
            offset = self.world_place(thing, layer) + turned(middle, angle)
        else:
            offset, angle = turned(middle - centre, angle - rotation), angle - rotation
        size = thing.size[0] * self.scale, thing.size[1] * self.scale
        x, y = offset.tolist()
        picture = thing.tile.picture if thing.tile is not None else -1
        return LevelSprite(entity, picture, size, (x, y), angle, thing.flips, thing.visible and layer.visible)


def _convex(shape: Shape) -> list[Shape]:
    """The convex pieces of a shape."""
    if shape.kind != "polygon" or is_convex(shape.points):
        return [shape]
    try:
        outline = parts_from_outline(shape.points)
    except (ValueError, ImportError) as error:
        raise RefusedError(f"the polygon is not convex: {error}") from error
    return [Shape("polygon", outline.centre + piece.position + piece.vertices) for piece in outline.pieces]


def _parts_of(fields: Fields) -> list[dict[type[Any], Any]]:
    """The components of each of its prefabs, by type."""
    return [prefab._components for _, prefab in fields.prefabs]


def _plain(given: Property) -> Any:
    if isinstance(given.value, dict):
        return {name: _plain(each) for name, each in given.value.items()}
    return given.value


def _all_properties(thing: MapObject) -> list[tuple[str, Property]]:
    """Those in classes too."""
    found = list(thing.properties.items())
    for given in thing.properties.values():
        if isinstance(given.value, dict):
            found += given.value.items()
    return found
