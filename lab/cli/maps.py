"""``carom maps check``."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from ... import maps
from ...components import Prefab
from ...framework import Component
from ...maps.fields import Vocabulary
from ...maps.loading import look_at
from .group import Commands
from .loading import import_file
from .options import traceback_option

FOUND = 1  # exit code of a check with findings


@click.group("maps", cls=Commands, short_help="Check maps of Tiled and LDtk.")
def maps_command() -> None:
    """Maps of Tiled (.tmx, .tmj) and LDtk (.ldtk)."""


@maps_command.command("check", short_help="List all that is wrong with maps.")
@click.argument("files", metavar="MAP...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--with", "game", type=click.Path(path_type=Path), metavar="FILE.py",
    help="The game's components, prefabs, LAYERS or IntFlag, and MATERIALS, for classes and properties of the map.",
)  # fmt: skip
@click.option("--level", help="Of an LDtk project with several levels (default: all of them).")
@traceback_option
def check_command(files: tuple[Path, ...], game: Path | None, level: str | None) -> int:
    """List all findings with file, layer, object and property; exit code 1 if there are any."""
    known = {} if game is None else names_of(game)
    count = 0
    for file in files:
        unknown: set[str] = set()
        names = [level] if level is not None else maps.levels_of(file)
        for name in names:
            words = Vocabulary(lenient=game is None, **known)
            found = look_at(file, words, name)
            unknown |= words.unknown
            count += len(found)
            for each in found:
                place = f"level {name!r}, {each.place}".removesuffix(", ")
                click.echo(str(each._replace(place=place) if len(names) > 1 else each))
        if unknown:
            click.echo(f"carom: {file}: not looked at without --with game.py: {', '.join(sorted(unknown))}", err=True)
    return FOUND if count else 0


def names_of(file: Path) -> dict[str, Any]:
    """What a game's file offers to its maps."""
    module = import_file(file)
    values = vars(module)
    found: dict[str, Any] = {
        "components": [v for v in values.values() if _is(v, Component) and not v._abstract],
        "prefabs": {name: value for name, value in values.items() if isinstance(value, Prefab)},
    }
    for value in values.values():
        if isinstance(value, Mapping) and value and all(isinstance(each, Prefab) for each in value.values()):
            found["prefabs"].update(value)
    flags = [value for value in values.values() if _is(value, enum.IntFlag)]
    own = [value for value in flags if value.__module__ == module.__name__]
    layers = [value for name, value in values.items() if name.casefold() == "layers"] or own or flags
    if len(layers) == 1 and (_is(layers[0], enum.IntFlag) or isinstance(layers[0], Mapping)):
        found["layers"] = layers[0]
    if isinstance(values.get("MATERIALS"), Mapping):
        found["materials"] = values["MATERIALS"]
    return found


def _is(value: Any, kind: type) -> bool:
    return isinstance(value, type) and issubclass(value, kind) and value is not kind
