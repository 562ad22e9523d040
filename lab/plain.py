"""Records as plain data: what JSON writes, and back."""

from __future__ import annotations

import dataclasses
import functools
import math
import types
import typing
from collections.abc import Mapping, Sequence
from typing import Any, Self

import numpy as np


def jsonable(value: Any) -> Any:
    """Records as plain data, with None instead of numbers that JSON cannot represent: infinity and NaN."""
    if isinstance(value, Mapping):
        return {key: jsonable(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [jsonable(item) for item in value]
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return jsonable(_plain(value))
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _plain(record: Any) -> dict[str, Any]:
    found = dataclasses.asdict(record)
    return {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in found.items()}


class Plain:
    """A dataclass that converts to plain data and back."""

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return _plain(self)

    @classmethod
    def from_dict(cls, plain: Mapping[str, Any]) -> Self:
        """The inverse of :meth:`as_dict`, also after JSON."""
        return _read(plain, cls)


@functools.cache
def _hints(kind: type) -> dict[str, Any]:
    return typing.get_type_hints(kind)


def _read(plain: Any, kind: Any) -> Any:
    """Plain data as a value of that type: records in containers are read, and lists become tuples where these are."""
    if plain is None:
        return None
    origin, inner = typing.get_origin(kind), typing.get_args(kind)
    if dataclasses.is_dataclass(kind) and isinstance(plain, Mapping):
        names = [field.name for field in dataclasses.fields(kind) if field.name in plain]  # as_dict may give more
        return kind(**{name: _read(plain[name], _hints(kind)[name]) for name in names})  # type: ignore
    if origin in (typing.Union, types.UnionType):
        (first, *_) = (one for one in inner if one is not type(None))
        return _read(plain, first)
    if origin is tuple and isinstance(plain, Sequence):
        kinds = [inner[0]] * len(plain) if inner[-1] is Ellipsis else inner
        return tuple(_read(value, one) for value, one in zip(plain, kinds, strict=True))
    if origin is np.ndarray:
        return np.array(plain, float)
    if origin is list:
        return [_read(value, inner[0]) for value in plain]
    if origin in (dict, Mapping):
        return {key: _read(value, inner[1]) for key, value in plain.items()}
    return plain
