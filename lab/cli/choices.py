"""Settings from the command line: a preset by name, and ``--set field=value`` parsed by the field's type."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable
from fractions import Fraction
from typing import Any

from ...framework import Settings
from .usage_errors import Problem, did_you_mean, one_line

PRESETS = ("fast", "balanced", "accurate")
BOOLEANS = {**dict.fromkeys(("true", "yes", "on", "1"), True), **dict.fromkeys(("false", "no", "off", "0"), False)}


def preset(name: str) -> Settings:
    """The Settings preset of that name; Problem for an unknown name."""
    if name not in PRESETS:
        raise Problem(f"no preset named {name!r}{did_you_mean(name, PRESETS)}")
    return getattr(Settings, name)()


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
