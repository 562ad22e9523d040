"""Names of compiled functions by structure: the same in every process, with every Python, with and without numba.

A name is made of where a function is written, of what it closes over and of its signature; not of its code, see
:mod:`hash` for that. What stands in a file that is run or loaded as a game is named after the file.
"""

from __future__ import annotations

import enum
import functools
import hashlib
import sys
import types
from collections.abc import Mapping
from pathlib import PurePath
from typing import Any

import numpy as np

from .kinds import Signature


def symbol_of(function: Any, signature: Signature) -> str:
    """By which a library knows the function, compiled for that signature."""
    digest = hashlib.sha256(f"{structure_of(function)} {signature}".encode()).hexdigest()
    return f"carom_{digest[:20]}"


def structure_of(value: Any, inside: tuple[int, ...] = ()) -> str:
    """What it is, in words; inside: of which functions this is a part."""
    if hasattr(value, "carom_structure"):  # what is made for kernels: schemas, parts, calls through addresses
        return structure_of(value.carom_structure, inside)
    function = getattr(value, "py_func", value)
    if isinstance(function, types.FunctionType):
        return _function(function, inside)
    if isinstance(value, (tuple, list)):
        return f"({', '.join(structure_of(item, inside) for item in value)})"
    if isinstance(value, functools.partial):
        return f"{structure_of(value.func, inside)}{structure_of(value.args, inside)}"
    if isinstance(value, types.BuiltinFunctionType):
        return f"{value.__module__}.{value.__qualname__}"
    if isinstance(value, np.ufunc) or type(value) is type(np.dot):
        return f"numpy.{value.__name__}"
    if isinstance(value, type):
        where = vars(sys.modules[value.__module__]) if value.__module__ in sys.modules else {}
        return f"{module_name(where) or value.__module__}.{value.__qualname__}{getattr(value, '_fields', '')}"
    if isinstance(value, enum.Enum):
        return f"{type(value).__qualname__}.{value.name}"
    if isinstance(value, np.ndarray):
        return f"{value.dtype.str}{value.shape}{hashlib.sha256(value.tobytes()).hexdigest()}"
    if isinstance(value, (bool, int, float, complex, str, bytes, type(None), np.generic)):
        return repr(value)
    return f"{type(value).__module__}.{type(value).__qualname__}"


def _function(function: types.FunctionType, inside: tuple[int, ...]) -> str:
    named = f"{module_name(function.__globals__)}.{function.__code__.co_qualname}"
    if id(function) in inside or not function.__closure__:
        return named
    inside = (*inside, id(function))
    captured = zip(function.__code__.co_freevars, function.__closure__, strict=True)
    return f"{named}[{', '.join(f'{name}={structure_of(cell.cell_contents, inside)}' for name, cell in captured)}]"


def module_name(names: Mapping[str, Any]) -> str:
    """Of which module these are the global names; of a file outside of packages its stem: a game is run, imported, or
    loaded by a command."""
    file = names.get("__file__")
    name = names.get("__name__", "")
    in_package = names.get("__package__") and name != "__main__"  # which python -m runs
    return name if in_package or not file else PurePath(file).stem
