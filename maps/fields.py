"""What classes and properties in a map mean: components and prefabs by name, fields of these, of RigidBody, Spin and
the collider, and a few words of this package's own."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np

from ..components import Collider, Prefab, RigidBody
from ..components.spin import Spin
from ..framework import Component, World
from ..framework.data.arrays.column import ArrayColumn
from ..framework.data.columns import Column
from ..framework.names import did_you_mean
from ..plugins.paths import Path
from .errors import Findings, RefusedError
from .formats.reading import Property

SOLID, ONE_WAY, DECORATION = "Solid", "OneWay", "Decoration"  # classes with a meaning of their own
MATERIAL = tuple(name for name in Collider.columns if name != "offset")
VELOCITY = ("velocity_x", "velocity_y")
# Words that are no fields of components, and what they take.
WORDS: dict[str, tuple[type, ...]] = {
    "solid": (bool,), "spins": (bool,), "shape": (str,), "thickness": (float, int), "hollow": (bool,), "path": (),
}  # fmt: skip
THICKNESS = Column(minimum=0.0, owner="create_chain", name="thickness")
SHAPES = ("box", "capsule", "ellipse")
NO_REFERENCE = "it takes no reference to an object"
NO_OBJECT = 0  # an object property that is not set


class Reference(NamedTuple):
    """A field that holds the entity of another object, by its id."""

    component: type[Component]
    field: str
    id: Any


@dataclass
class Fields:
    """What the classes and properties of one thing give: fields by component, and words of our own."""

    of: dict[type[Component], dict[str, Any]] = field(default_factory=dict)
    material: dict[str, Any] = field(default_factory=dict)
    words: dict[str, Any] = field(default_factory=dict)
    references: list[Reference] = field(default_factory=list)
    prefabs: list[tuple[str, Prefab]] = field(default_factory=list)
    kinds: list[str] = field(default_factory=list)  # all that it is called, for Level.of_class
    marks: set[str] = field(default_factory=set)  # Solid, OneWay, Decoration

    @property
    def is_solid(self) -> bool | None:
        """Whether it says so, None if it does not."""
        if "solid" in self.words:
            return self.words["solid"]
        return True if SOLID in self.marks or ONE_WAY in self.marks else False if DECORATION in self.marks else None


class Vocabulary:
    """Which names a map may use.

    components, prefabs, materials
        by name; a material is a dict of the fields of colliders, None: no body
    layers
        bits by name; None: the world knows them, or nobody
    lenient
        take classes that nobody has given for marks, and their properties as they are: for looking at a map without
        its game
    """

    def __init__(
        self,
        world: World | None = None,
        components: Iterable[type[Component]] = (),
        prefabs: Mapping[str, Prefab] | None = None,
        layers: Any = None,
        materials: Mapping[str, Mapping[str, Any] | None] | None = None,
        lenient: bool = False,
    ) -> None:
        prefabs, materials = prefabs or {}, materials or {}
        self.components: dict[str, type[Component]] = {}
        for each in components:
            if not (isinstance(each, type) and issubclass(each, Component)):
                raise TypeError(f"maps.load: components are classes derived from Component, got {each!r}")
            self.components[each.__name__] = each
        for name, prefab in prefabs.items():
            if not isinstance(prefab, Prefab):
                raise TypeError(f"maps.load: prefabs[{name!r}] must be a Prefab, got {prefab!r}")
            self.components = {**{kind.__name__: kind for kind in prefab._components}, **self.components}
        members = getattr(layers, "__members__", layers)
        self.layers = None if members is None else {name.casefold(): int(bits) for name, bits in dict(members).items()}
        for name, material in materials.items():
            for key, value in (material or {}).items():
                if key not in MATERIAL:
                    near = did_you_mean(key, MATERIAL)
                    raise ValueError(f"maps.load: materials[{name!r}] has no field {key!r}{near}")
                Collider.columns[key].checked(value)
        self.world, self.prefabs, self.materials, self.lenient = world, dict(prefabs), dict(materials), lenient
        self.unknown: set[str] = set()  # classes, of a lenient reading

    def component(self, name: str) -> type[Component] | None:
        """The game's component of that name, or carom's."""
        own = self.components.get(name)
        if own is None:
            root = import_module(__name__.partition(".")[0])
            if name in root._MODULES:
                found = getattr(root, name)
                if isinstance(found, type) and issubclass(found, Component) and not found._abstract:
                    return found
        return own

    def is_class(self, name: str) -> bool:
        return name in self.prefabs or self.component(name) is not None

    def bits(self, value: Any) -> Any:
        """Of layers: a number, or names with commas."""
        if isinstance(value, (int, float)) and not isinstance(value, bool) and value == value // 1:
            return int(value)
        value = ",".join(map(str, value)) if isinstance(value, list) else value  # of LDtk
        names = [name.strip() for name in str(value).replace("|", ",").split(",") if name.strip()]
        if self.layers is None:
            known = None if self.world is None else self.world._layer_names
            if known is None and self.lenient:
                return 1
            if known is None:
                raise RefusedError(
                    f"no layer is named {value!r}: give names in maps.load(layers={{...}}), or to the world, "
                    f"World(layers=Layers)"
                )
            try:
                return sum({known.bits(name, "layers") for name in names})
            except ValueError as error:
                raise RefusedError(str(error)) from error
        total = 0
        for name in names:
            if name.casefold() not in self.layers:
                raise RefusedError(f"no layer is named {name!r}{did_you_mean(name, self.layers)}; there are "
                              f"{', '.join(self.layers)}")  # fmt: skip
            total |= self.layers[name.casefold()]
        return total


class Sorter:
    """Sorts classes and properties.

    points_of, place_of
        look at other objects, by id: (n, 2) and (2,) m
    to_world
        makes metres of pixels, (n, 2)
    """

    def __init__(
        self, known: Vocabulary, findings: Findings, points_of: Callable, place_of: Callable, to_world: Callable
    ) -> None:
        self.known, self.findings = known, findings
        self.points_of, self.place_of, self.to_world = points_of, place_of, to_world

    def sort(self, kinds: str, properties: Mapping[str, Property], base: Fields | None = None) -> Fields:
        """Fields of something of these classes, with these properties, on top of those of ``base``."""
        found = Fields()
        for name in (each.strip() for each in kinds.split(",")):
            if name:
                with self.findings.at(f"class {name!r}"):
                    self._class(name, found)
        if base is not None:  # what has come first is nearest
            found.of |= {kind: dict(values) for kind, values in base.of.items()}
            found.material, found.words = base.material | found.material, base.words | found.words
            found.references = list(base.references)
            found.prefabs += [each for each in base.prefabs if each not in found.prefabs]
            found.kinds = [*dict.fromkeys((*base.kinds, *found.kinds))]
        if found.marks:
            found.words.pop("solid", None)  # that of its layer
        elif base is not None:
            found.marks = set(base.marks)
        for name, given in sorted(properties.items(), key=lambda item: item[0] != "path"):  # its words need it
            with self.findings.at(f"property {name!r}"):
                self._property(name, given, found)
        return found

    def _class(self, name: str, found: Fields) -> None:
        known = self.known
        if name in (SOLID, ONE_WAY, DECORATION):
            found.marks.add(name)
            return
        if name in found.kinds:
            return
        found.kinds.append(name)
        if name in known.prefabs:
            found.prefabs.append((name, known.prefabs[name]))
        elif name in known.materials:
            found.kinds.remove(name)
            found.words["solid"] = known.materials[name] is not None
            found.material.update(known.materials[name] or {})
        elif (component := known.component(name)) is not None:
            if issubclass(component, Collider):
                raise RefusedError("the shape that was drawn makes the collider")
            found.of.setdefault(component, {})
        elif known.lenient:
            known.unknown.add(name)
        else:
            names = (*known.components, *known.prefabs, *known.materials, SOLID, ONE_WAY, DECORATION)
            raise RefusedError(f"it is no component and no prefab{did_you_mean(name, names)}; give it to maps.load, "
                          f"components=(...), prefabs={{...}}, or of a tile materials={{...}}")  # fmt: skip

    def _property(self, name: str, given: Property, found: Fields) -> None:
        if name.startswith("_"):  # the game's own, to be read from Level.object
            return
        if isinstance(given.value, dict):  # of a class of Tiled: a component with fields
            component = self.known.component(given.type) or self.known.component(name)
            if component is None:
                if self.known.lenient:
                    self.known.unknown.add(given.type)
                    return
                near = did_you_mean(given.type, self.known.components)
                raise RefusedError(f"class {given.type!r} is no component{near}")
            found.of.setdefault(component, {})
            for column, value in given.value.items():
                self._field(component, column, value, found)
            return
        first, dot, column = name.partition(".")
        if dot:
            component = self.known.component(first)
            if component is None:
                if self.known.lenient:
                    self.known.unknown.add(first)
                    return
                raise RefusedError(f"no component is named {first!r}{did_you_mean(first, self.known.components)}")
            if issubclass(component, Collider) and not any(component in p._components for _, p in found.prefabs):
                raise RefusedError("the shape that was drawn makes the collider; its material has names without a dot")
            found.of.setdefault(component, {})
            self._field(component, column, given, found)
            return
        for component in found.of:
            if name in component._arguments and component not in (RigidBody, Spin):
                self._field(component, name, given, found)
                return
        self._plain(name, given, found)

    def _plain(self, name: str, given: Property, found: Fields) -> None:
        """A name without a dot, of no component of the object."""
        if given.type == "object" and name != "path" and name in (*VELOCITY, *MATERIAL, *WORDS):
            raise RefusedError(NO_REFERENCE)
        if name in RigidBody._arguments:
            found.of.setdefault(RigidBody, {})
            self._field(RigidBody, name, given, found)
        elif name in VELOCITY:
            prefab: Any = next((p._components[RigidBody] for _, p in found.prefabs if RigidBody in p._components), None)
            values = found.of.setdefault(RigidBody, {})
            before = values.get("linear_velocity", 0.0 if prefab is None else prefab.linear_velocity)
            velocity = [*before] if np.ndim(before) else [before, before]
            velocity[VELOCITY.index(name)] = given.value
            values["linear_velocity"] = checked(RigidBody.columns["linear_velocity"], velocity)
        elif name in MATERIAL:
            self._material(name, given, found)
        elif name in Spin._arguments:
            found.of.setdefault(Spin, {})
            self._field(Spin, name, given, found)
        elif name in WORDS:
            self._word(name, given, found)
        elif "path" in found.words and name in Path._arguments:
            found.of.setdefault(Path, {})
            self._field(Path, name, given, found)
        elif any(name in prefab._fields for _, prefab in found.prefabs):
            named = next(prefab._fields[name] for _, prefab in found.prefabs if name in prefab._fields)
            if len(named) > 1:
                names = " or ".join(f"{kind.__name__}.{column}" for kind, column in named)
                raise RefusedError(f"{len(named)} components of its prefab have a field of that name: {names}")
            self._field(*named[0], given, found)
        elif not (self.known.lenient and set(found.kinds) & self.known.unknown):
            own = [column for component in found.of for column in component._arguments]
            names = (*own, *RigidBody._arguments, *VELOCITY, *MATERIAL, *Spin._arguments, *WORDS)
            near = did_you_mean(name, names)
            raise RefusedError(f"it is no field of its components, body or collider{near}; begin your own names with _")

    def _material(self, name: str, given: Property, found: Fields) -> None:
        value: Any = given.value
        if name in ("layer", "mask"):
            value = self.known.bits(value)
        elif name == "one_way" and isinstance(value, bool):
            value = (0.0, 1.0) if value else (0.0, 0.0)
        elif name == "surface_velocity" and isinstance(value, (int, float)):
            value = (float(value), 0.0)
        found.material[name] = checked(Collider.columns[name], value)

    def _word(self, name: str, given: Property, found: Fields) -> None:
        takes = WORDS[name]
        if name == "path":
            if given.type not in ("object", "places"):
                raise RefusedError("it must be of type object, and refer to a polyline")
            if given.type != "object" or given.value != NO_OBJECT:
                found.words[name] = given
            return
        if not isinstance(given.value, takes) or (bool not in takes and isinstance(given.value, bool)):
            raise RefusedError(f"it must be of type {takes[0].__name__}, got {given.value!r}")
        if name == "shape" and given.value not in SHAPES:
            raise RefusedError(f"it must be one of {', '.join(SHAPES)}, got {given.value!r}")
        if name == "thickness":
            checked(THICKNESS, given.value)
        found.words[name] = given.value

    def _field(self, component: type[Component], name: str, given: Property, found: Fields) -> None:
        """Field ``name`` of a component has this value."""
        column = component._arguments.get(name)
        if column is None:
            raise RefusedError(f"{component.__name__} has no field {name!r}{did_you_mean(name, component._arguments)}")
        value: Any = given.value
        if given.type == "places":
            value = self.to_world(value)
            if not len(value):
                raise RefusedError("it has no points")
            if not isinstance(column, ArrayColumn):
                if len(value) > 1:
                    raise RefusedError(f"it takes one point, got {len(value)}")
                value = tuple(value[0].tolist())
        elif given.type == "object":
            if value == NO_OBJECT:
                return
            if isinstance(column, ArrayColumn):
                value = self.points_of(value)[0]
            elif column.choices or column.dtype is bool or column.unit not in ("", "m" * (column.item == "vector")):
                raise RefusedError(NO_REFERENCE)
            elif column.item == "vector":
                value = self.place_of(value)
            else:
                found.references.append(Reference(component, name, value))
                found.of.setdefault(component, {}).pop(name, None)
                return
        elif column.layers:
            value = self.known.bits(value)
        found.references = [each for each in found.references if each[:2] != (component, name)]
        found.of.setdefault(component, {})[name] = checked(column, value)


def checked(column: Column, value: Any) -> Any:
    """A value as that column takes it, vectors written as "1, 2" too; RefusedError if it does not."""
    if column.item == "vector" and isinstance(value, str):
        try:
            value = tuple(float(each) for each in value.replace(",", " ").split())
        except ValueError as error:
            raise RefusedError(f"it must be numbers as '0, 1', got {value!r}") from error
    try:
        column.check_dimensions(column.checked(value), 2)
    except (ValueError, TypeError) as error:
        hint = ""
        if isinstance(value, str) and not column.choices and column.item == "scalar":
            hint = f": choose the type {'bool' if column.dtype is bool else 'float or int'} for it in the editor"
        raise RefusedError(f"{error}{hint}") from error
    return value
