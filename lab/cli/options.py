"""Options shared by several commands, parsed and checked."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import os
from collections.abc import Callable, Iterable
from fractions import Fraction
from pathlib import Path
from typing import Any

import click

from ...framework import Settings
from ...framework.settings import COLLISION_MODES
from .usage_errors import Problem, did_you_mean, one_line

WORDS = "carom.words"  # key for the words of a command line: see KeepsWords

Option = Callable[[Any], Any]


def together(*options: Option) -> Option:
    """Several options as one decorator; the help shows them in this order."""

    def decorated(function: Any) -> Any:
        for option in reversed(options):
            function = option(function)
        return function

    return decorated


class KeepsWords(click.Command):
    """A command that stores the words it was called with in ``context.meta[WORDS]``."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        ctx.meta[WORDS] = list(args)
        return super().parse_args(ctx, args)


def _read(read: Callable[[Any], Any]) -> Callable[[click.Context, click.Parameter, Any], Any]:
    """A callback for click that passes a given value through ``read`` and leaves a missing one unchanged."""
    return lambda context, parameter, given: read(given) if given is not None else None


def above_zero(option: str, what: str = "a number above 0", zero: bool = False) -> Callable[..., Any]:
    """A callback for click that refuses a number that is not finite and above 0; ``zero``: 0 will do."""

    def checked(value: float) -> float:
        if not (0 < value < math.inf or (zero and value == 0)):
            raise Problem(f"{option} takes {what}, not {value:g}")
        return value

    return _read(checked)


def listed(option: str, what: str, read: Callable[[str], Any]) -> Callable[[Any, Any, str | None], Any]:
    """A callback for click that reads "a,b" as a tuple, each value once; Problem for a word that ``read`` refuses by a
    ValueError. what: the values, for the message."""

    def values(context: click.Context, parameter: click.Parameter, text: str | None) -> tuple[Any, ...] | None:
        if text is None:
            return None
        try:
            found = tuple(dict.fromkeys(read(word) for part in text.split(",") if (word := part.strip())))
        except (ValueError, ZeroDivisionError):
            found = ()
        if not found:
            raise Problem(f"{option} takes {what} with commas between them, not {text!r}")
        return found

    return values


def whole_number(text: str) -> int:
    """From 1; ValueError for others."""
    if not text.isdecimal() or int(text) < 1:
        raise ValueError
    return int(text)


def one_of(option: str, known: Iterable[str]) -> Callable[[str], str]:
    """A reader of names; a usage error with suggestions for a name that is not among the known ones."""
    names = tuple(known)

    def read(word: str) -> str:
        if word not in names:
            raise Problem(f"{option}: no {word!r}{did_you_mean(word, names)}")
        return word

    return read


# -- settings --------------------------------------------------------------------------------------------


PRESETS = ("fast", "balanced", "accurate")
BOOLEANS = {**dict.fromkeys(("true", "yes", "on", "1"), True), **dict.fromkeys(("false", "no", "off", "0"), False)}


def parse_assignments(assignments: Iterable[str]) -> dict[str, Any]:
    """``["dt=1/120", "substeps=8"]`` as field values of the right types; Problem for anything else."""
    fields = {field.name: field for field in dataclasses.fields(Settings)}
    texts = assigned("--set", "field=value", assignments)
    for name in texts:
        if name not in fields:
            raise Problem(f"Settings has no field {name!r}{did_you_mean(name, fields)}")
    return {name: _parse(name, text, str(fields[name].type)) for name, text in texts.items()}


def assigned(option: str, form: str, assignments: Iterable[str]) -> dict[str, str]:
    """``["n=100"]`` as texts by name; Problem, with the form that they must have, for others."""
    texts: dict[str, str] = {}
    for assignment in assignments:
        name, equals, text = (part.strip() for part in assignment.partition("="))
        if not equals or not name.isidentifier():
            raise Problem(f"{option} takes {form}, not {assignment!r}")
        if name in texts:
            raise Problem(f"{option} gives {name} twice")
        texts[name] = text
    return texts


def parse_view(text: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """``"0,0,4,3"`` as the lower and the upper corner; Problem for anything else."""
    try:
        numbers = tuple(float(number) for number in text.split(","))
    except ValueError:
        numbers = ()
    half = len(numbers) // 2
    view = numbers[:half], numbers[half:]
    if not is_view(view):
        raise Problem(f"--view takes the lower and the upper corner, as in 0,0,4,3, not {text!r}")
    return view


def is_view(view: tuple[tuple[float, ...], tuple[float, ...]]) -> bool:
    """True for a lower and an upper corner in 2D or 3D."""
    lower, upper = view
    return len(lower) == len(upper) in (2, 3) and all(-math.inf < a < b < math.inf for a, b in zip(*view, strict=True))


def apply(settings: Settings, values: dict[str, Any]) -> Settings:
    """``settings`` with ``values`` replaced; Problem with the message of Settings if it rejects one."""
    try:
        return dataclasses.replace(settings, **values)
    except (ValueError, TypeError) as error:
        raise Problem(f"--set: {one_line(error)}") from error


def _parse(name: str, text: str, kinds: str) -> Any:
    """``text`` as the first of the kinds, as in "float | None", that accepts it."""
    readers = [READERS[kind] for kind in READERS if kind in kinds.split(" | ")]
    for read, _ in readers:
        try:
            return read(text)
        except (ValueError, KeyError, ZeroDivisionError):
            continue
    raise Problem(f"--set {name} takes {' or '.join(what for _, what in readers)}, not {text!r}")


def real_number(text: str) -> float:
    """1/120 is an exact time step."""
    return float(Fraction(text.replace(" ", ""))) if "/" in text else float(text)


# How each type is read, and what it is called; the first that accepts a text has it.
READERS: dict[str, tuple[Callable[[str], Any], str]] = {
    "int": (int, "a whole number"),
    "float": (real_number, "a number"),
    "bool": (lambda text: BOOLEANS[text.lower()], "true or false"),
    "None": (lambda text: {"none": None}[text.lower()], "none"),
    "str": (str, "a word"),
}


# -- worlds -----------------------------------------------------------------------------------------------------

seed_option = click.option(
    "--seed", default=0, show_default=True, type=click.IntRange(min=0), metavar="NUMBER",
    help="Which variant of the scene: 0, 1, 2, ...",
)  # fmt: skip
traceback_option = click.option(  # seen by Commands.main
    "--traceback", is_flag=True, expose_value=False, help="Show in full where an error came from."
)
world_options = together(
    click.option(
        "--settings", type=click.Choice(PRESETS), callback=_read(lambda name: getattr(Settings, name)()),
        help="Default: what the scene recommends.",
    ),
    click.option(
        "--set", "changes", multiple=True, metavar="FIELD=VALUE", callback=_read(parse_assignments),
        help="Set one field of Settings; repeatable.",
    ),
    seed_option,
    click.option(
        "--plugin", "plugins", multiple=True, metavar="NAME", help="Add an installed plugin to the world; repeatable."
    ),
)  # fmt: skip

# -- results ----------------------------------------------------------------------------------------------------

shown_options = together(
    click.option("--json", "as_json", is_flag=True, help="Print the result as JSON, and nothing else, to stdout."),
    click.option("--markdown", "as_markdown", is_flag=True, help="Print the tables as Markdown."),
)


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


# -- what is measured -------------------------------------------------------------------------------------------


def _step(text: str) -> float:
    """"1/60" as seconds."""
    if not 0 < (step := real_number(text)) < math.inf:
        raise ValueError
    return step


def _build_options(assignments: tuple[str, ...]) -> dict[str, Any]:
    """["n=100", "height=2.5"] as keywords; a number where it is one, else a word."""
    texts = assigned("--option", "NAME=VALUE, a keyword of the scene's build", assignments)
    for name in texts.keys() & {"settings", "seed"}:
        raise Problem(f"--option cannot set {name}: the command does")
    return {name: _number_or_word(text) for name, text in texts.items()}


def _number_or_word(text: str) -> Any:
    for kind in (int, float):
        with contextlib.suppress(ValueError):
            return kind(text)
    return text


case_options = together(
    click.option(
        "--norm", "norms", multiple=True, metavar="NAME",
        help="What the error is the error of; repeatable, the first counts (default: what suits the scene).",
    ),
    click.option(
        "--seconds", type=float, metavar="S", callback=above_zero("--seconds"), help="Simulated time of each run."
    ),
    click.option(
        "--repeats", type=click.IntRange(min=1), metavar="N", help="Runs of each setting: start phases or seeds."
    ),
    click.option(
        "--dt", "steps", metavar="S,S", default=None,
        callback=listed("--dt", "steps above 0 s, as in 1/60,1/120,", _step),
        help="The steps, as in 1/60,1/120 (default: what suits the scene).",
    ),
    click.option(
        "--option", "options", multiple=True, metavar="NAME=VALUE", callback=_read(_build_options),
        help="A keyword of the scene's build, as in n=100; repeatable.",
    ),
    seed_option,
)  # fmt: skip


only_options = together(
    click.option(
        "--integrators", metavar="NAME,NAME", callback=listed("--integrators", "names", str),
        help="Only these (default: all that differ in the scene; so for the next two).",
    ),
    click.option(
        "--collisions", metavar="NAME,NAME",
        callback=listed("--collisions", "names", one_of("--collisions", COLLISION_MODES)),
        help=f"Only these of {', '.join(COLLISION_MODES)}.",
    ),
    click.option(
        "--substeps", metavar="N,N", callback=listed("--substeps", "whole numbers from 1", whole_number),
        help="Only these of the solver.",
    ),
)  # fmt: skip

# -- execution of runs ------------------------------------------------------------------------------------------

runs_options = together(
    click.option("--workers", type=click.IntRange(min=1), metavar="N", help="Processes (default: one a core)."),
    click.option("--cluster", metavar="ADDRESS", help="Run on the workers of this dask.distributed scheduler."),
    click.option(
        "--runs", "kept", type=click.Path(path_type=Path, file_okay=False), metavar="FOLDER",
        default=Path("out/runs"), show_default=True, help="Finished runs are kept here, and used again.",
    ),
)  # fmt: skip
