"""Errors raised in kernels of a library: what numba has written beside the machine code, made into exceptions again."""

from __future__ import annotations

import ctypes
import io
import pickle
import re
import sys
import types
from typing import Any

from .names import module_name

STOPPED = -3  # numba's code of StopIteration; all above 0 are exceptions with information


class _Information(ctypes.Structure):
    """Where numba notes an exception: class, constant arguments and place as a pickle, and arguments known only when it
    was raised, with a function that makes a tuple of them."""

    _fields_ = (
        ("pickle", ctypes.c_void_p), ("size", ctypes.c_int32), ("values", ctypes.c_void_p),
        ("make_tuple", ctypes.c_void_p), ("count", ctypes.c_int32),
    )  # fmt: skip


class _Written(ctypes.Structure):
    """The same as machine code writes it, if there are such arguments: numba has counted with addresses of 8 bytes."""

    _fields_ = (
        ("pickle", ctypes.c_uint64), ("size", ctypes.c_int32), ("values", ctypes.c_uint64),
        ("make_tuple", ctypes.c_uint64), ("count", ctypes.c_int32),
    )  # fmt: skip


def _read(address: int) -> Any:
    """What stands there. A constant is laid out by the platform: where addresses have 4 bytes, its count of 0 stands
    where the code writes the address of the arguments."""
    found = _Information.from_address(address)
    if ctypes.sizeof(ctypes.c_void_p) == 8 or found.count == 0:
        return found
    written = _Written.from_address(address)
    pickle, values, make_tuple = (value & 0xFFFFFFFF for value in (written.pickle, written.values, written.make_tuple))
    return _Information(pickle, written.size, values, make_tuple, written.count)


class _Unknown:
    """In place of an argument that is not a constant: numba pickles its compiler's object for one."""

    def __new__(cls, *_: Any) -> _Unknown:
        return super().__new__(cls)

    def __setstate__(self, state: Any) -> None:
        del state


# What commands call the module of a game's file while they build a library of it, see lab/cli/loading.
_LOADED_FILE = re.compile("carom_file_(.+)_[0-9a-f]{8}")


class _Reader(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        if module.partition(".")[0] == "llvmlite":
            return _Unknown
        file = _LOADED_FILE.fullmatch(module)
        if file is not None and module not in sys.modules:  # here it has another name: __main__, or that of the file
            for names in [vars(each) for each in [*sys.modules.values()] if isinstance(each, types.ModuleType)]:
                if name in names and module_name(names) == file[1]:
                    return names[name]
        try:
            return super().find_class(module, name)
        except (AttributeError, ImportError):  # the error counts, not that its class is out of reach
            return type(name, (RuntimeError,), {})


def raise_error(status: int, address: int) -> None:
    """Raise what a function has returned a status and information of; called by the library."""
    if status <= 0:
        raise StopIteration if status == STOPPED else SystemError(f"a kernel returned status {status}")
    found = _read(address)
    kind, arguments, place = _Reader(io.BytesIO(ctypes.string_at(found.pickle, found.size))).load()
    given = list(arguments or ())
    if found.count > 0:
        values = iter(ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p)(found.make_tuple)(found.values))
        given = [next(values) if isinstance(value, _Unknown) else value for value in given]
    error = kind(*given)
    if place is None:
        raise error
    function, file, line = place  # as a line of the traceback
    code = compile("\n" * (line - 1) + "raise error", file, "exec").replace(co_name=function)
    exec(code, {"error": error})
