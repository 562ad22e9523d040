"""Layers by name: the members of the IntFlag class that a game gives to its world."""

from __future__ import annotations

import enum
import functools
import operator
from collections.abc import Iterable
from typing import Any

from ..names import did_you_mean

GROUPS = (tuple, set, frozenset)  # of names that stand for one mask
HOW = (
    "World(layers=Layers), or World.load(..., layers=Layers), with class Layers(enum.IntFlag) gives names to layers, "
    "and this world has none"
)


class Unresolved(tuple[Any, ...]):
    """Layers of which some are given by name, before a world is known that tells their bits."""

    @property
    def given(self) -> Any:
        """As the game wrote it."""
        return self[0] if len(self) == 1 else tuple(self)


def _is_name(value: Any) -> bool:
    return value.isidentifier() if isinstance(value, str) else isinstance(value, enum.Flag)


def is_named(value: Any) -> bool:
    """Whether a value names layers: a text or members of an IntFlag class, one or several."""
    if not isinstance(value, GROUPS):
        return _is_name(value)
    return any(map(_is_name, value)) and all(_is_name(each) or isinstance(each, int) for each in value)


def unresolved(value: Any) -> Any:
    """What names layers as bits, if there are members only, else in wait of a world; anything else as it is."""
    if not is_named(value):
        return value
    given = (value,) if isinstance(value, (str, enum.Flag)) else tuple(value)
    if isinstance(value, (set, frozenset)):
        given = tuple(sorted(given, key=str))
    if all(isinstance(each, int) for each in given):
        return functools.reduce(operator.or_, map(int, given), 0)
    return Unresolved(given)


class LayerNames:
    """The names of a world's layers; upper and lower case are the same.

    members
        the IntFlag class: TypeError for anything else; ValueError for a member without bits, or beyond the 63 that
        there are
    """

    def __init__(self, members: type[enum.IntFlag]) -> None:
        if not (isinstance(members, type) and issubclass(members, enum.IntFlag) and members.__members__):
            raise TypeError(f"layers must be an enum.IntFlag class that names each layer, got {members!r}")
        self._bits: dict[str, int] = {}
        for name, member in members.__members__.items():
            if not 0 < member.value < 1 << 63:
                raise ValueError(
                    f"layers: {members.__name__}.{name} must have one or more of the bits 1 << 0 to 1 << 62, got "
                    f"{member.value}"
                )
            if name.casefold() in self._bits:
                raise ValueError(f"layers: {members.__name__} has two members named {name}, in upper and lower case")
            self._bits[name.casefold()] = member.value
        self._single = {value: name for name, value in self._bits.items() if value & (value - 1) == 0}

    @property
    def single(self) -> dict[str, int]:
        """The names of one bit each, and their bits."""
        return {name: bit for bit, name in self._single.items()}

    def bits(self, name: str, what: str) -> int:
        """Those of one name; ValueError, which begins with ``what``, if there is none like it."""
        bits = self._bits.get(name.casefold())
        if bits is None:
            near = did_you_mean(name, self._bits)
            raise ValueError(f"{what}: no layer is named {name!r}{near}; there are {', '.join(self._bits)}")
        return bits

    def names(self, bits: int) -> Any:
        """The bits as names, one or a tuple of them; the bits themselves if they are all, none, or some have no name.
        """
        found = tuple(name for bit, name in self._single.items() if bits & bit)
        if bits < 0 or not found or functools.reduce(operator.or_, (self._bits[name] for name in found)) != bits:
            return bits
        return found if found[1:] else found[0]


def resolved(value: Any, names: LayerNames | None, what: str) -> Any:
    """Bits, of what names layers; anything else as it is. ValueError if some name is that of no layer."""
    value = unresolved(value)
    if type(value) is not Unresolved:
        return value
    bits = 0
    for each in value:
        if isinstance(each, str):
            if names is None:
                raise ValueError(f"{what}: {each!r} names a layer: {HOW}")
            bits |= names.bits(each, what)
        elif isinstance(each, int) and not isinstance(each, bool):
            bits |= int(each)
        else:
            raise ValueError(f"{what} must be names or bits of layers, got {each!r}")
    return bits


def resolved_rows(values: Any, names: LayerNames | None, what: str) -> Any:
    """The same of one value for all or, in a list or an array, of one per row."""
    if is_named(values):
        return resolved(values, names, what)
    of_texts = getattr(values, "dtype", None) is not None and values.dtype.kind in "OU" and values.ndim == 1
    rows: Iterable[Any] = values if isinstance(values, list) or of_texts else ()
    if not any(map(is_named, rows)):
        return values
    return [resolved(each, names, f"{what} (row {row})") for row, each in enumerate(rows)]
