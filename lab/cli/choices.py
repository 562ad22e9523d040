"""Settings from the command line: a preset by name, and ``--set field=value`` parsed by the field's type."""

from __future__ import annotations

import dataclasses
import math
import types
import typing
from collections.abc import Iterable
from fractions import Fraction
from typing import Any

from ...framework import Settings
from .usage_errors import Problem, did_you_mean, one_line

PRESETS = ("fast", "balanced", "accurate")
WORDS_FOR_BOOL = {
    "true": True,
    "yes": True,
    "on": True,
    "1": True,
    "false": False,
    "no": False,
    "off": False,
    "0": False,
}


def preset(name: str) -> Settings:
    """The Settings preset of that name; Problem for an unknown name."""
    if name not in PRESETS:
        raise Problem(f"no preset named {name!r}{did_you_mean(name, PRESETS)}")
    return getattr(Settings, name)()


def parse_assignments(assignments: Iterable[str]) -> dict[str, Any]:
    """``["dt=1/120", "substeps=8"]`` as field values of the right types; Problem for anything else."""
    fields = {field.name: field for field in dataclasses.fields(Settings)}
    hints = typing.get_type_hints(Settings)
    values: dict[str, Any] = {}
    for assignment in assignments:
        name, equals, text = (part.strip() for part in assignment.partition("="))
        if not equals or not name:
            raise Problem(f"--set takes field=value, not {assignment!r}")
        if name not in fields:
            raise Problem(f"Settings has no field {name!r}{did_you_mean(name, fields)}")
        if name in values:
            raise Problem(f"--set gives {name} twice")
        values[name] = _parse(name, text, hints[name])
    return values


def parse_view(text: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """``"0,0,4,3"`` as the lower and the upper corner; Problem for anything else."""
    try:
        numbers = tuple(float(number) for number in text.split(","))
    except ValueError:
        numbers = ()
    half = len(numbers) // 2
    lower, upper = numbers[:half], numbers[half:]
    good = len(numbers) in (4, 6) and all(map(math.isfinite, numbers))
    if not good or not all(a < b for a, b in zip(lower, upper, strict=True)):
        raise Problem(f"--view takes the lower and the upper corner, as in 0,0,4,3, not {text!r}")
    return lower, upper


def apply(settings: Settings, values: dict[str, Any]) -> Settings:
    """``settings`` with ``values`` replaced; Problem with the message of Settings if it rejects one."""
    try:
        return dataclasses.replace(settings, **values)
    except (ValueError, TypeError) as error:
        raise Problem(f"--set: {one_line(error)}") from error


def _parse(name: str, text: str, hint: Any) -> Any:
    """``text`` as the first of the hint's types that accepts it."""
    kinds = _kinds(hint)
    for kind in kinds:
        try:
            return _as_kind(text, kind)
        except ValueError:
            continue
    words = [
        word for kind in kinds if typing.get_origin(kind) is typing.Literal for word in typing.get_args(kind)
    ]
    if words:
        raise Problem(f"--set {name}: no choice {text!r}{did_you_mean(text, map(str, words))}")
    raise Problem(f"--set {name} takes {' or '.join(_in_words(kind) for kind in kinds)}, not {text!r}")


def _kinds(hint: Any) -> list[Any]:
    """The members of a union, flattened; a plain string last, because it accepts any text."""
    origin = typing.get_origin(hint)
    if origin in (typing.Union, types.UnionType):
        members = [kind for member in typing.get_args(hint) for kind in _kinds(member)]
        return sorted(members, key=lambda kind: kind is str)
    return [hint]


def _as_kind(text: str, kind: Any) -> Any:
    if typing.get_origin(kind) is typing.Literal:
        for word in typing.get_args(kind):
            if str(word) == text:
                return word
        raise ValueError
    if kind in (None, type(None)):
        if text.lower() == "none":
            return None
        raise ValueError
    if kind is bool:
        try:
            return WORDS_FOR_BOOL[text.lower()]
        except KeyError:
            raise ValueError from None
    if kind is int:
        return int(text)
    if kind is float:
        return float(_fraction(text)) if "/" in text else float(text)
    if kind is str:
        return text
    raise ValueError  # a type that cannot be written on a command line


def _fraction(text: str) -> Fraction:
    """1/120 as an exact time step."""
    try:
        return Fraction(text.replace(" ", ""))
    except ZeroDivisionError:
        raise ValueError from None


def _in_words(kind: Any) -> str:
    known = {
        int: "a whole number",
        float: "a number",
        bool: "true or false",
        str: "a word",
        type(None): "none",
    }
    return known.get(kind, getattr(kind, "__name__", str(kind)))
