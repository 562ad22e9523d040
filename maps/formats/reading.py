"""Files as plain dictionaries: JSON as it is, Tiled's XML in the form of Tiled's JSON, and fields of these by type.

Numbers of XML stay texts; :func:`number` and its neighbours take both.
"""

from __future__ import annotations

import json
import math
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import RefusedError

Node = dict[str, Any]

LAYERS = {"layer": "tilelayer", "objectgroup": "objectgroup", "imagelayer": "imagelayer", "group": "group"}
XML = (".tmx", ".tsx", ".tx")  # ends of names of files that are none of JSON
MARKS = ("ellipse", "point", "capsule")
REQUIRED: Any = object()
LARGEST = 1e12  # pixels, and numbers of tiles


def document(path: Path) -> Node:
    """The file; RefusedError if it is missing, or neither XML nor JSON."""
    try:
        data = path.read_bytes()
    except OSError as error:
        what = "is missing" if isinstance(error, FileNotFoundError) else f"cannot be read: {error.strerror}"
        raise RefusedError(f"{path.name} {what}") from error
    try:
        if path.suffix.lower() in XML or data.lstrip().startswith((b"<", b"\xef\xbb\xbf<")):
            root = ElementTree.fromstring(data)
            return {"": root.tag, **_node(root)}
        found = json.loads(data)
    except ElementTree.ParseError as error:
        line, column = error.position
        raise RefusedError(f"{path.name} is no XML that can be read: {error.msg.partition(':')[0]}, line {line}, "
                      f"column {column + 1}") from error  # fmt: skip
    except json.JSONDecodeError as error:
        raise RefusedError(f"{path.name} is no JSON that can be read: {error.msg}, line {error.lineno}, "
                      f"column {error.colno}") from error  # fmt: skip
    except (UnicodeDecodeError, RecursionError, LookupError) as error:
        raise RefusedError(f"{path.name} is neither XML nor JSON that can be read: {error}") from error
    if not isinstance(found, dict):
        raise RefusedError(f"{path.name} is no map: its JSON is {type(found).__name__}")
    return found


def _node(element: ElementTree.Element) -> Node:
    """An element of Tiled's XML in the form that Tiled's JSON has."""
    node: Node = dict(element.attrib)
    for child in element:
        tag = child.tag
        if tag == "properties":
            node[tag] = [_property(each) for each in child.iter("property") if each in child]
        elif tag in LAYERS and element.tag != "tile":
            node.setdefault("layers", []).append({**_node(child), "type": LAYERS[tag]})
        elif tag in ("tileset", "object") and element.tag == "template":
            node[tag] = _node(child)
        elif tag in ("tileset", "object", "tile"):
            node.setdefault(f"{tag}s", []).append(_node(child))
        elif tag == "image":
            node.update({key: child.get(name) for key, name in (
                ("image", "source"), ("imagewidth", "width"), ("imageheight", "height"), ("transparentcolor", "trans"),
            ) if name in child.attrib})  # fmt: skip
        elif tag == "data":
            gids = [each.get("gid", "0") for each in child.findall("tile")]
            node.update(child.attrib, data=gids or child.text or "")
            if child.find("chunk") is not None:
                node["chunks"] = True
        elif tag in MARKS:
            node[tag] = True
        elif tag in ("polygon", "polyline"):
            node[tag] = child.get("points", "")
        elif tag == "text":
            node[tag] = {**child.attrib, "text": child.text or ""}
        elif tag == "animation":
            node[tag] = [dict(frame.attrib) for frame in child]
        else:
            node[tag] = _node(child)
    return node


def _property(element: ElementTree.Element) -> Node:
    value: Any = element.get("value", element.text or "")
    if element.get("type") == "class":
        inner = element.find("properties")
        value = [_property(each) for each in ([] if inner is None else inner)]
    return {**element.attrib, "value": value}


# -- fields ----------------------------------------------------------------------------------------------


def _of(node: Any) -> Node:
    if not isinstance(node, dict):
        raise RefusedError(f"there must be an object with fields, got {str(node)[:60]!r}")
    return node


def number(node: Node, name: str, default: Any = REQUIRED) -> float:
    """A number up to LARGEST; RefusedError if it is none, or missing without a default."""
    value = _of(node).get(name, default)
    if value is REQUIRED:
        raise RefusedError(f"{name!r} is missing")
    try:
        found = math.nan if isinstance(value, bool) else float(value)
    except (TypeError, ValueError):
        found = math.nan
    if not abs(found) <= LARGEST:
        limit = "" if math.isnan(found) else f" up to {LARGEST:g}"
        raise RefusedError(f"{name!r} must be a number{limit}, got {value!r}")
    return found


def above_0(node: Node, name: str, default: Any = REQUIRED) -> float:
    found = number(node, name, default)
    if found <= 0.0:
        raise RefusedError(f"{name!r} must be above 0, got {found:g}")
    return found


def whole(node: Node, name: str, default: Any = REQUIRED) -> int:
    """A whole number."""
    found = number(node, name, default)
    if found != int(found):
        raise RefusedError(f"{name!r} must be a whole number, got {node[name]!r}")
    return int(found)


def flag(node: Node, name: str, default: bool) -> bool:
    value = _of(node).get(name, default)
    known = {"1": True, "true": True, "0": False, "false": False}.get(str(value).lower())
    if known is None:
        raise RefusedError(f"{name!r} must be true or false, got {value!r}")
    return known


def word(node: Node, *names: str) -> str:
    """The first of these texts that is there, else ""."""
    return next((str(node[name]) for name in names if _of(node).get(name)), "")


def nodes(node: Node, name: str) -> list[Node]:
    """A list of dictionaries, [] if there is none."""
    found = _of(node).get(name) or []
    if not isinstance(found, list) or not all(isinstance(each, dict) for each in found):
        raise RefusedError(f"{name!r} must be a list of objects")
    return found


def points(node: Node, name: str) -> np.ndarray:
    """(n, 2) pixels: "0,0 16,-8" or [{"x": 0, "y": 0}, ...]."""
    given = node[name]
    try:
        if isinstance(given, str):
            rows = [[float(each) for each in pair.split(",")] for pair in given.split()]
        else:
            rows = [[float(each["x"]), float(each["y"])] for each in given]
        found = np.array(rows, float).reshape(len(rows), 2)
    except (TypeError, ValueError, KeyError) as error:
        raise RefusedError(f"{name!r} must be pairs of numbers, got {str(given)[:60]!r}") from error
    if not (np.abs(found) <= LARGEST).all():
        raise RefusedError(f"{name!r} must be numbers up to {LARGEST:g}, got {str(given)[:60]!r}")
    return found


# -- properties ------------------------------------------------------------------------------------------


class Property(NamedTuple):
    """A property of an object, tile, layer or map: Tiled's type of it, ``"class"`` with a value of dict[str, Property]
    and ``"object"`` with an id among them, and the value."""

    type: str
    value: Any


def properties(node: Node) -> dict[str, Property]:
    """By name, of their types."""
    given = _of(node).get("properties") or []
    if isinstance(given, dict):  # of old JSON
        given = [{"name": name, "value": value} for name, value in given.items()]
    return _by_name(given)


def _by_name(given: Any) -> dict[str, Property]:
    if not isinstance(given, list) or not all(isinstance(each, dict) and "name" in each for each in given):
        raise RefusedError("'properties' must be a list of names and values")
    return {str(each["name"]): _typed(each) for each in given}


def _typed(node: Node) -> Property:
    kind, value, name = str(node.get("type") or ""), node.get("value", ""), str(node["name"])
    if kind == "class" or isinstance(value, dict):
        if isinstance(value, list):
            return Property(str(node.get("propertytype") or name), _by_name(value))
        if not isinstance(value, dict):
            raise RefusedError(f"property {name!r} must be a class with fields, got {value!r}")
        inner = {key: _typed({"name": key, "value": each}) for key, each in value.items()}
        return Property(str(node.get("propertytype") or name), inner)
    try:
        if kind == "object":
            return Property(kind, int(value))
        if isinstance(value, str):
            value = {"int": int, "float": float, "bool": lambda each: each == "true"}.get(kind, str)(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise RefusedError(f"property {name!r} must be of type {kind}, got {value!r}") from error
    return Property(kind, value)
