"""Functions of plugins, compiled so that ``raise ValueError("text", value)`` works in them, and can be arguments."""

from __future__ import annotations

import weakref
from typing import Any

from ....framework.compilation import allocating_part
from ....framework.jit.lazy import LazyIntrinsic, operation, types
from ....framework.plugins.plugin import checked_support

_compiled: weakref.WeakKeyDictionary[Any, Any] = weakref.WeakKeyDictionary()
_arguments: weakref.WeakKeyDictionary[Any, Any] = weakref.WeakKeyDictionary()


def user_function(function: Any) -> Any:
    """The same function with allocation allowed; one for all callers, so that they share its compiled code."""
    if not _is_compiled(function):  # with the JIT off
        return function
    if function not in _compiled:
        author = getattr(function, "author", None)
        if author is not None:
            _compiled[function] = checked_support(user_function(author))
        else:
            _compiled[function] = allocating_part(function)
    return _compiled[function]


def as_argument(function: Any) -> Any:
    """The function in a form that kernels can hand to others as an argument and still be kept on disk.

    numba hands on a dispatcher by its address in this process, and a kernel in which that address survives cannot be
    cached: as when a function that is not inlined gets it.
    """
    if not _is_compiled(function):
        return function
    if function not in _arguments:
        _arguments[function] = _without_address(function)
    return _arguments[function]


def _is_compiled(function: Any) -> bool:
    """Whether numba compiles it, ours or made by numba's own decorators."""
    return hasattr(function, "py_func")


def _without_address(function: Any) -> Any:
    def typing(context: Any, *arguments: Any) -> Any:
        kind = types.Dispatcher(function.made)
        found = kind.get_call_type(context, arguments, {})

        def emit(target: Any, builder: Any, sig: Any, values: Any) -> Any:
            return target.get_function(kind, found)(builder, values)

        return found.return_type(*found.args), emit

    plain = function.py_func
    return LazyIntrinsic(lambda: operation(plain.__name__, plain.__code__.co_argcount, typing), plain)


def is_long(function: Any) -> bool:
    """Whether the function, or one that it calls, asks to stay out of its callers (``part`` instead of ``inlined``)."""
    return _is_compiled(function) and _reaches_part(function, set())


def _reaches_part(function: Any, seen: set[Any]) -> bool:
    options, plain = function.targetoptions, function.py_func
    if not options.get("forceinline") and options.get("inline") != "always":
        return True
    seen.add(function)
    captured = [cell.cell_contents for cell in plain.__closure__ or ()]
    named = [plain.__globals__.get(name) for name in plain.__code__.co_names]
    called = [value for value in (*captured, *named) if _is_compiled(value) and value not in seen]
    return any(_reaches_part(value, seen) for value in called)
