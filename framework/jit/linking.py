"""Functions called through their address: what one kernel needs of another without being compiled into it.

A :class:`Linked` function has a fixed signature and a cache entry of its own; its address goes into a column of a
record and :func:`linked_call` calls what stands there. So a kernel over pairs of shapes is compiled once,
whatever the shapes are. Exceptions raised inside go up to whoever called, with their values.

Calls use numba's own convention. Addresses are good for this process only.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

from ..compilation import linked_dispatcher
from .kinds import Signature
from .lazy import JIT, LazyIntrinsic, cgutils, dispatchers, operation, types
from .linkable import Linkable

# So many generated functions of each kind are kept at hand for worlds to come; worlds hold those that they use.
CACHE_SIZE = 1024

# With the JIT off an address is a place in this list.
_plain: list[Callable[..., Any]] = [lambda *_: None]


class Linked(Linkable):
    """A function compiled for one signature, called through its address.

    function
        plain Python; helpers that it calls are compiled into it
    what
        it is, for errors
    """

    def __init__(self, function: Callable[..., Any], signature: Signature, what: str = "") -> None:
        self.py_func = getattr(function, "py_func", function)
        self.name = self.py_func.__name__
        self.signature, self._what = signature, what or self.name
        self._address = 0

    @property
    def address(self) -> int:
        """Where its machine code stands; compiles or loads it when first asked for."""
        if not self._address:
            self._address = self._find()
        return self._address

    @property
    def ready(self) -> bool:
        """Whether it has been compiled or loaded."""
        return self._address != 0

    @cached_property
    def compiled(self) -> Any:
        return self.__dict__.setdefault("compiled", linked_dispatcher(self.py_func, self._what))  # one for all threads

    def link(self) -> None:
        self.address  # noqa: B018 - asking for it links

    def _find(self) -> int:
        if not JIT:
            _plain.append(self.py_func)
            return len(_plain) - 1
        holder = self.holder
        if holder is not None:
            return holder.addresses[self.symbol]
        return self.compiled.address_for(self.symbol, self.signature)


def linked_call(signature_of: Callable[[], Any]) -> Any:
    """The function call(address, *arguments) that calls what stands at an address, of that signature."""
    if not JIT:
        return lambda address, *values: _plain[address](*values)
    return LazyIntrinsic(lambda: _compiled_call(signature_of()), label=lambda: f"calls {signature_of()}")


def _compiled_call(signature: Signature) -> Any:
    result, arguments = dispatchers.numba_types(signature)

    def typing(typing_context: Any, *given: Any) -> Any:
        def emit(context: Any, builder: Any, sig: Any, values: Any) -> Any:
            convention = context.call_conv
            kind = convention.get_function_type(result, arguments)
            function = builder.inttoptr(values[0], kind.as_pointer())
            answer = cgutils.alloca_once(builder, kind.args[0].pointee)
            raised = cgutils.alloca_once(builder, kind.args[1].pointee)
            packed = context.get_arg_packer(arguments).as_arguments(builder, values[1:])
            code = builder.call(function, [answer, raised, *packed])
            status = convention._get_return_status(builder, code, builder.load(raised))
            with cgutils.if_unlikely(builder, status.is_error):
                convention.return_status_propagate(builder, status)
            return context.get_returned_value(builder, result, builder.load(answer))

        return result(types.int64, *arguments), emit

    return operation("call", 1 + len(arguments), typing)
