"""Options shared by several commands, and the types of their values."""

from __future__ import annotations

import functools
import math
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import click

from ...framework import Settings
from ...view.tools.entered import value_of
from .usage_errors import Problem, one_line

Option = Callable[[Any], Any]
Corners = tuple[tuple[float, ...], tuple[float, ...]]
FARTHEST = 1e100  # m: pictures of what is farther overflow


def together(*options: Option) -> Option:
    """Several options as one decorator; the help shows them in this order."""
    return lambda function: functools.reduce(lambda made, option: option(made), reversed(options), function)


# -- types of values --------------------------------------------------------------------------------------


class Real(click.FloatRange):
    """A finite number; 1/120 is an exact one."""

    name = "number"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        number = value_of(value) if isinstance(value, str) else value
        if type(number) not in (int, float) or not math.isfinite(number):
            self.fail(f"{value!r} is not a finite number", param, ctx)
        return super().convert(number, param, ctx)


class Whole(click.IntRange):
    """A whole number."""

    name = "whole number"


class Listed(click.ParamType):
    """Values with commas between them, as a tuple, each once."""

    name = "list"

    def __init__(self, each: click.ParamType) -> None:
        self.each = each

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[Any, ...]:
        words = [word for part in value.split(",") if (word := part.strip())] if isinstance(value, str) else value
        if not words:
            self.fail(f"{value!r} names none", param, ctx)
        return tuple(dict.fromkeys(self.each.convert(word, param, ctx) for word in words))


class Assignment(click.ParamType):
    """NAME=VALUE, as a pair of both."""

    name = "assignment"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[str, Any]:
        name, equals, text = value.partition("=")
        if not equals or not name.strip().isidentifier():
            self.fail(f"{value!r} is not NAME=VALUE", param, ctx)
        return name.strip(), value_of(text)


class View(click.ParamType):
    """The lower and the upper corner, as in 0,0,4,3."""

    name = "view"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Corners:
        numbers = [value_of(word) for word in value.split(",")]
        half = len(numbers) // 2
        try:
            return corners((numbers[:half], numbers[half:]))
        except (TypeError, ValueError):
            self.fail(f"{value!r} is not a lower and an upper corner, as in 0,0,4,3, within {FARTHEST:g}", param, ctx)


def corners(view: Any) -> Corners:
    """A lower and an upper corner in 2D or 3D; TypeError or ValueError for anything else."""
    lower, upper = (tuple(float(x) for x in end) for end in view)
    if len(lower) not in (2, 3) or not all(-FARTHEST <= a < b <= FARTHEST for a, b in zip(lower, upper, strict=True)):
        raise ValueError
    return lower, upper


POSITIVE = Real(min=0, min_open=True)
NOT_NEGATIVE = Real(min=0)
COUNT = Whole(min=1)


def apply(settings: Settings, values: Mapping[str, Any]) -> Settings:
    """``settings`` with ``values`` replaced; Problem with the message of Settings if it rejects one."""
    try:
        return settings.replace(**values)
    except (ValueError, TypeError) as error:
        raise Problem(f"--set: {one_line(error)}") from error


# -- worlds -----------------------------------------------------------------------------------------------

seed_option = click.option(
    "--seed", default=0, show_default=True, type=Whole(min=0), metavar="NUMBER",
    help="Which variant of the scene: 0, 1, 2, ...",
)  # fmt: skip
traceback_option = click.option(  # seen by Commands.main
    "--traceback", is_flag=True, expose_value=False, help="Show in full where an error came from."
)
world_options = together(
    click.option(
        "--settings", type=click.Choice(("fast", "balanced", "accurate")),
        callback=lambda context, option, name: name and getattr(Settings, name)(),
        help="Default: what the scene recommends.",
    ),
    click.option(
        "--set", "changes", type=Assignment(), multiple=True, metavar="FIELD=VALUE",
        callback=lambda context, option, pairs: dict(pairs), help="Set one field of Settings; repeatable.",
    ),
    seed_option,
    click.option(
        "--plugin", "plugins", multiple=True, metavar="NAME", help="Add an installed plugin to the world; repeatable."
    ),
)  # fmt: skip

# -- results ----------------------------------------------------------------------------------------------

json_option = click.option("--json", "as_json", is_flag=True, help="Print the result as JSON, and nothing else.")


def out_option(help_text: str, default: Path | None = None) -> Option:
    """``--out FOLDER``."""
    folder = click.Path(path_type=Path, file_okay=False)
    shown = default is not None
    return click.option("--out", type=folder, metavar="FOLDER", default=default, show_default=shown, help=help_text)


def writable_folder(folder: Path, value: Path | None = None, option: str = "--out") -> None:
    """Create the folder if missing; Problem if it is not writable. value: that of the option, if different."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise Problem(f"{option} {value or folder}: {error.strerror or error}") from error
    if not os.access(folder, os.W_OK | os.X_OK):
        raise Problem(f"{option} {value or folder}: no permission to write there")
