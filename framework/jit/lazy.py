"""What compiled code needs of numba, made when the first kernel needs it.

Loading numba and llvmlite takes longer than all the rest of an import of carom, and a program that only asks for help,
or lists scenes, compiles nothing. So what stands in modules is light: a function to be compiled, or an operation that
is written in LLVM's language, is a :class:`LazyIntrinsic`. numba asks it for its type when a kernel that names it
compiles; only then it is made. Code that runs while kernels compile finds numba's modules here: ``types``,
``cgutils``, ``ir`` and so on.
"""

from __future__ import annotations

import functools
import importlib
import os
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

# Read as numba reads it.
JIT = os.environ.get("NUMBA_DISABLE_JIT", "").strip() in ("", "0")


class LazyModule:
    """A module that is imported when something of it is first asked for."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):  # what inspecting code asks any object for
            raise AttributeError(name)
        value = getattr(importlib.import_module(self._name), name)
        setattr(self, name, value)
        return value


if TYPE_CHECKING:
    from llvmlite import ir
    from numba.core import cgutils, types
    from numba.np import arrayobj
else:
    ir, arrayobj = LazyModule("llvmlite.ir"), LazyModule("numba.np.arrayobj")
    cgutils, types = (LazyModule(f"numba.core.{name}") for name in ("cgutils", "types"))
dispatchers: Any = LazyModule(f"{__package__}.dispatchers")


class LazyIntrinsic:
    """Something that numba knows, made when a kernel that names it compiles.

    make
        called without arguments, gives numba's object
    plain
        what Python runs instead; None: only kernels call it
    label
        called without arguments, tells it from others that are made by the same function
    """

    def __init__(
        self, make: Callable[[], Any], plain: Callable[..., Any] | None = None, label: Callable[[], str] | None = None
    ) -> None:
        if plain is not None:
            functools.update_wrapper(self, plain)
        self._maker, self.plain, self._label = make, plain, label

    @functools.cached_property
    def made(self) -> Any:
        """numba's object."""
        return self.__dict__.setdefault("made", self._make())  # one object, though two threads ask

    def _make(self) -> Any:
        return self._maker()

    @property
    def carom_depends_on(self) -> Any:
        """What its code is made of, see :mod:`hash`."""
        return self._maker if self._label is None else (self._label(), self._maker)

    @property
    def carom_structure(self) -> Any:
        """What it is, see :mod:`names`."""
        return self._label() if self._label is not None else self.plain or self._maker

    @property
    def _numba_type_(self) -> Any:
        try:
            return self._type()
        except AttributeError as error:  # numba would take it for an object that it does not know
            raise RuntimeError(f"{self!r} cannot be made: {error}") from error

    def _type(self) -> Any:
        from numba.core.registry import cpu_target

        made, context = self.made, cpu_target.typing_context
        context.refresh()  # made just now
        return context.resolve_value_type(made)

    def __call__(self, *args: Any) -> Any:
        if self.plain is None:
            raise NotImplementedError("only kernels can call this")
        return self.plain(*args)

    def __deepcopy__(self, memo: Any) -> LazyIntrinsic:  # numba copies the statements that name it
        return self


def is_of_compiler(error: BaseException) -> bool:
    """Whether numba raised it because it cannot compile something; does not load numba."""
    return type(error).__module__.partition(".")[0] == "numba"


def intrinsic(function: Callable[..., Any], plain: Callable[..., Any] | None = None) -> Any:
    """numba's decorator of that name: ``function(typing_context, *types)`` gives (signature, code generator)."""
    return LazyIntrinsic(lambda: _made_intrinsic(function), plain)


def operation(name: str, count: int, typing: Callable[..., Any]) -> Any:
    """numba's intrinsic for such a function of any ``count`` types."""
    names = "".join(f", a{k}" for k in range(count))
    scope = {"typing": typing}
    exec(f"def {name}(context{names}): return typing(context{names})", scope)
    return _made_intrinsic(scope[name])


def _made_intrinsic(function: Any) -> Any:
    from numba.core.extending import intrinsic as made_by_numba

    return made_by_numba(function)
