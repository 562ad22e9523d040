"""Functions called through their address: what one kernel needs of another without being compiled into it.

A :class:`Linked` function has a fixed signature and a cache entry of its own; its address goes into a column of a
record and :func:`linked_call` calls what stands there. So a kernel over pairs of shapes is compiled once,
whatever the shapes are. Exceptions raised inside go up to whoever called, with their values.

Calls use numba's own convention. Addresses are good for this process only.
"""

from __future__ import annotations

from collections.abc import Callable
from operator import attrgetter
from typing import Any

from ..compilation import linked_dispatcher
from .lazy import JIT, LazyIntrinsic, cgutils, operation, types

# So many generated functions of each kind are kept at hand for worlds to come; worlds hold those that they use.
CACHE_SIZE = 1024

# With the JIT off an address is a place in this list.
_plain: list[Callable[..., Any]] = [lambda *_: None]


class Linked:
    """A function compiled for one signature, called through its address.

    function
        plain Python; helpers that it calls are compiled into it
    signature
        numba's: ``types.int64(state_type, types.float64)``
    """

    def __init__(self, function: Callable[..., Any], signature: Any) -> None:
        self.function = getattr(function, "py_func", function)
        self.name = self.function.__name__
        self.signature = signature
        self._dispatcher = linked_dispatcher(function) if JIT else function
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

    @property
    def is_cached(self) -> bool:
        """Whether linking it compiles nothing."""
        return self.ready or not JIT or self._dispatcher.is_kept(self.signature)

    @property
    def dependency_count(self) -> int:
        """Of how many functions it is made: the more, the longer it takes to compile."""
        return self._dispatcher.dependency_count

    def link(self) -> None:
        """Compile or load it now."""
        self.address  # noqa: B018 - asking for it links

    def _find(self) -> int:
        if not JIT:
            _plain.append(self.function)
            return len(_plain) - 1
        self._dispatcher.compile(self.signature)
        machine_code, description = attrgetter("library", "fndesc")(self._dispatcher.overloads[self.signature.args])
        return machine_code.get_pointer_to_function(description.llvm_func_name)


class Called:
    """A kernel that Python calls with numbers of these types, to be linked ahead of its first call."""

    def __init__(self, kernel: Any, *arguments: type[int] | type[float]) -> None:
        self._kernel, self._arguments, self._linked = kernel, arguments, not JIT

    @property
    def _types(self) -> tuple[Any, ...]:
        return tuple(types.int64 if kind is int else types.float64 for kind in self._arguments)

    @property
    def ready(self) -> bool:
        """Whether it has been linked."""
        return self._linked

    @property
    def is_cached(self) -> bool:
        """Whether linking it compiles nothing."""
        return self.ready or self._kernel.made.is_kept(self._types)

    @property
    def dependency_count(self) -> int:
        """Of how many functions it is made."""
        return self._kernel.made.dependency_count

    def link(self) -> None:
        """Compile or load it now."""
        if not self._linked:
            self._kernel.made.compile(self._types)
            self._linked = True


def linked_call(signature_of: Callable[[], Any]) -> Any:
    """The function call(address, *arguments) that calls what stands at an address, of that signature."""
    if not JIT:
        return lambda address, *values: _plain[address](*values)
    return LazyIntrinsic(lambda: _compiled_call(signature_of()))


def _compiled_call(signature: Any) -> Any:
    result, arguments = signature.return_type, signature.args

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

    return operation("call", 1 + len(arguments), typing, (str(result), *map(str, arguments), typing))
