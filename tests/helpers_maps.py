"""Maps of Tiled, made by code in the form of its JSON and written as .tmj or .tmx."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from carom import Physics, Rotation, Settings, World
from carom.plugins import capsule, convex_polygon, terrain, tile_grid
from carom.plugins.parts import Parts
from carom.plugins.paths import Paths

ELEMENTS = {"tilelayer": "layer", "objectgroup": "objectgroup", "imagelayer": "imagelayer", "group": "group"}
FLIPPED = {1: 0x80000000, 2: 0x40000000, 4: 0x20000000}
SLOPE = ((0, 16), (16, 0), (16, 16))  # rises to the right


def world_for_maps(*plugins: Any, **options: Any) -> World:
    own = capsule.plugin, convex_polygon.plugin, terrain.plugin, tile_grid.plugin
    return World(Physics(2, gravity=(0, -10)), Rotation(), Parts(), Paths(), *own, *plugins, **options)


def quiet_world_for_maps() -> World:
    return world_for_maps(settings=Settings(on_fault="ignore"))


class Ref(int):
    """An object property."""


def properties(values: dict[str, Any]) -> list[dict[str, Any]]:
    made = []
    for name, value in values.items():
        if isinstance(value, tuple):  # (class, fields)
            made.append({"name": name, "type": "class", "propertytype": value[0], "value": value[1]})
        else:
            kinds = {Ref: "object", bool: "bool", int: "int", float: "float", str: "string"}
            made.append({"name": name, "type": kinds[type(value)], "value": value})
    return made


def thing(id: int, x: float, y: float, w: float = 0, h: float = 0, **fields: Any) -> dict[str, Any]:
    """An object; ``polygon`` and ``polyline`` as pairs, ``properties`` as a dict, ``kind``: its class."""
    for name in ("polygon", "polyline"):
        if name in fields:
            fields[name] = [{"x": a, "y": b} for a, b in fields[name]]
    if "properties" in fields:
        fields["properties"] = properties(fields["properties"])
    whole = {"name": "", "type": fields.pop("kind", ""), "rotation": 0, "visible": True, "width": w, "height": h}
    return {"id": id, "x": x, "y": y, **whole, **fields}


def tile(id: int, kind: str = "", *shapes: dict[str, Any], **values: Any) -> dict[str, Any]:
    made: dict[str, Any] = {"id": id, "type": kind, "properties": properties(values)}
    if shapes:
        made["objectgroup"] = {"type": "objectgroup", "name": "", "objects": [*shapes]}
    return made


def tileset(*tiles: dict[str, Any], first: int = 1, count: int = 32, size: int = 16, **fields: Any) -> dict[str, Any]:
    image = {"image": "basic.png", "imagewidth": count * size, "imageheight": size}
    shape = {"tilewidth": size, "tileheight": size, "tilecount": count, "columns": count, "margin": 0, "spacing": 0}
    return {"firstgid": first, "name": "basic", **shape, **image, "tiles": [*tiles], **fields}


def tiles_of(cells: Any, name: str = "ground", **fields: Any) -> dict[str, Any]:
    cells = np.asarray(cells)
    if "properties" in fields:
        fields["properties"] = properties(fields["properties"])
    rows, columns = cells.shape
    whole = {"id": 1, "opacity": 1, "visible": True, "x": 0, "y": 0, "width": columns, "height": rows}
    return {"type": "tilelayer", "name": name, **whole, "data": cells.ravel().tolist(), **fields}


def objects_of(*things: dict[str, Any], name: str = "things", **fields: Any) -> dict[str, Any]:
    if "properties" in fields:
        fields["properties"] = properties(fields["properties"])
    whole = {"id": 2, "opacity": 1, "visible": True, "x": 0, "y": 0, "draworder": "topdown"}
    return {"type": "objectgroup", "name": name, **whole, "objects": [*things], **fields}


def map_of(columns: int, rows: int, *layers: dict[str, Any], tilesets: Any = None, **fields: Any) -> dict[str, Any]:
    whole = {
        "type": "map", "version": "1.10", "tiledversion": "1.11.0", "orientation": "orthogonal",
        "renderorder": "right-down", "infinite": False, "width": columns, "height": rows, "tilewidth": 16,
        "tileheight": 16, "nextlayerid": 9, "nextobjectid": 99,
    }  # fmt: skip
    return {**whole, "tilesets": tilesets or [tileset(tile(0, "Solid"))], "layers": [*layers], **fields}


def write(path: Path, node: dict[str, Any], tag: str = "map") -> Path:
    """As JSON or XML, by its name."""
    text = json.dumps(node) if path.suffix.endswith("j") or path.suffix in (".json", ".ldtk") else as_xml(tag, node)
    path.write_text(text, encoding="utf-8")
    return path


def as_xml(tag: str, node: dict[str, Any]) -> str:
    inside, given = [], {}
    if tag == "map":
        node = {key: value for key, value in node.items() if key != "type"}
    for key, value in node.items():
        if key == "properties":
            inside.append(_xml_properties(value))
        elif key == "layers":
            inside += [as_xml(ELEMENTS[each["type"]], each) for each in value]
        elif key in ("tilesets", "tiles", "objects"):
            inside += [as_xml(key[:-1], each) for each in value]
        elif key in ("objectgroup", "tileset", "object", "tileoffset"):
            inside.append(as_xml(key, value))
        elif key == "data":
            data = ",\n".join(map(str, value)) if isinstance(value, list) else value
            names = {"encoding": node.get("encoding", "csv"), "compression": node.get("compression", "")}
            inside.append(f"<data {_attributes({k: v for k, v in names.items() if v})}>{data}</data>")
        elif key in ("polygon", "polyline"):
            pairs = " ".join(f"{point['x']},{point['y']}" for point in value)
            inside.append(f'<{key} points="{pairs}"/>')
        elif key in ("ellipse", "point", "capsule"):
            inside.append(f"<{key}/>")
        elif key == "image":
            size = {"source": value, "width": node.get("imagewidth", 16), "height": node.get("imageheight", 16)}
            inside.append(f"<image {_attributes(size)}/>")
        elif key == "text":
            inside.append("<text>words</text>")
        elif key == "animation":
            inside.append(f"<animation>{''.join(f'<frame {_attributes(each)}/>' for each in value)}</animation>")
        elif not (key in ("encoding", "compression", "imagewidth", "imageheight")
                  or (key == "type" and (tag in ELEMENTS.values()))):  # fmt: skip
            given[key] = value
    return f"<{tag} {_attributes(given)}>{''.join(inside)}</{tag}>"


def _attributes(given: dict[str, Any]) -> str:
    return " ".join(f"{key}={quoteattr(_text(value))}" for key, value in given.items())


def _text(value: Any) -> str:
    return str(int(value)) if isinstance(value, bool) else str(value)


def _xml_properties(given: list[dict[str, Any]]) -> str:
    made = []
    for each in given:
        if each.get("type") == "class":
            inner = properties(each["value"])
            made.append(f"<property {_attributes({k: v for k, v in each.items() if k != 'value'})}>"
                        f"{_xml_properties(inner)}</property>")  # fmt: skip
        else:
            value = str(each["value"]).lower() if isinstance(each["value"], bool) else each["value"]
            made.append(f"<property {_attributes({**each, 'value': value})}/>")
    return f"<properties>{''.join(made)}</properties>"
