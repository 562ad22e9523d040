"""Signatures of the functions that are linked to the shapes, and the calls that fit them in 2D and 3D."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from typing import Any

from ....framework.jit.lazy import JIT, LazyIntrinsic, operation, types
from ....framework.jit.linking import linked_call
from ....framework.jit.records.record_type import record_code, record_type
from ...records import STATE

# Values of ``state.unsound``: what was wrong with an answer of a plugin's function.
NOT_FINITE = 1
OUT_OF_TIME = 2  # a sweep's time is not from 0 to 1
ALONE = -1  # in place of a second row: the bounds of the first


def vector_type(dimensions: int) -> Any:
    """d floats."""
    return types.UniTuple(types.float64, dimensions)


def _two_rows() -> tuple[Any, ...]:
    return (types.int64,) * 4  # parameters of a, row a, parameters of b, row b


@cache
def evaluate_signature(dimensions: int) -> Any:
    """(state, parameters of a, row a, parameters of b, row b, d) -> (hit, depth, normal, point)."""
    state, vector = record_type(STATE, dimensions), vector_type(dimensions)
    contact = types.Tuple((types.boolean, types.float64, vector, vector))
    return contact(state, *_two_rows(), vector)


@cache
def batch_signature(dimensions: int) -> Any:
    """(state, start, stop) -> whether all answers were sound, see batches."""
    return types.int64(record_type(STATE, dimensions), types.int64, types.int64)


@cache
def sweep_signature(dimensions: int) -> Any:
    """(state, parameters of a, row a, parameters of b, row b, d, v) -> (hit, time)."""
    state, vector = record_type(STATE, dimensions), vector_type(dimensions)
    return types.Tuple((types.boolean, types.float64))(state, *_two_rows(), vector, vector)


@cache
def corner_signature(dimensions: int) -> Any:
    """(state, parameters of a, row a, parameters of b, row b, d, slop) -> bool."""
    state, vector = record_type(STATE, dimensions), vector_type(dimensions)
    return types.boolean(state, *_two_rows(), vector, types.float64)


@cache
def bounds_signature(dimensions: int) -> Any:
    """(state, parameters, row) -> half extents."""
    return vector_type(dimensions)(record_type(STATE, dimensions), types.int64, types.int64)


@cache
def moments_signature(dimensions: int) -> Any:
    """(state, own parameters, row) -> measure, centre, means of products of coordinates."""
    count = 1 + dimensions + dimensions * (dimensions + 1) // 2
    return types.UniTuple(types.float64, count)(record_type(STATE, dimensions), types.int64, types.int64)


@cache
def rotated_signature(dimensions: int) -> Any:
    """(state, own parameters, parameters as rotated, row, whether bodies are rotated) -> 0."""
    return types.int64(record_type(STATE, dimensions), types.int64, types.int64, types.int64, types.boolean)


@cache
def support_signature(dimensions: int) -> Any:
    """(parameters, row, direction) -> farthest point of the core."""
    return vector_type(dimensions)(types.int64, types.int64, vector_type(dimensions))


def rounding_signature() -> Any:
    """(parameters, row) -> rounding."""
    return types.float64(types.int64, types.int64)


def mixing_signature() -> Any:
    """(a's value, b's value) -> that of the pair."""
    return types.float64(types.float64, types.float64)


def call_in_dimension(signature_of: Callable[[int], Any]) -> Any:
    """call(address, *arguments) for a signature of each dimension; the types of the arguments tell which."""
    calls = {dimensions: linked_call(partial(signature_of, dimensions)) for dimensions in (2, 3)}
    if not JIT:
        return calls[2]  # an address is all it takes

    def typing(context: Any, address: Any, *given: Any) -> Any:
        for kind in given:
            if isinstance(kind, record_code.RecordType):
                return calls[kind.dimensions].made._defn(context, address, *given)
            if isinstance(kind, types.BaseTuple) and kind.count in calls:
                return calls[kind.count].made._defn(context, address, *given)
        return None

    def make() -> Any:
        depends_on = tuple(call.carom_depends_on for call in calls.values())
        return operation("call", 1 + len(signature_of(2).args), typing, depends_on)

    return LazyIntrinsic(make)


call_evaluate = call_in_dimension(evaluate_signature)
call_batch = call_in_dimension(batch_signature)
call_sweep = call_in_dimension(sweep_signature)
call_corner = call_in_dimension(corner_signature)
call_bounds = call_in_dimension(bounds_signature)
call_moments = call_in_dimension(moments_signature)
call_rotated = call_in_dimension(rotated_signature)
call_support = call_in_dimension(support_signature)
call_rounding = linked_call(rounding_signature)
call_mixing = linked_call(mixing_signature)


def named(function: Any) -> Any:
    """The function with a hash of all it depends on in its name.

    Machine code is found by symbol name, and numba's names tell apart only functions of one process: of two that one
    factory made in different processes, both loaded from the cache, one would run in place of the other.
    """
    if JIT:
        from ....framework.jit.hash import deep_hash  # loads numba

        function.__qualname__ = f"{function.__name__}_{deep_hash(function)[:16]}"
    return function
