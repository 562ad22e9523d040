"""Signatures of the functions that are linked to the shapes, and the calls that fit them in 2D and 3D."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from typing import Any

from ....framework.jit.kinds import BOOL, FLOAT, INT, Kind, Signature, floats, record_kind, tuple_of
from ....framework.jit.lazy import JIT, LazyIntrinsic, operation, types
from ....framework.jit.linking import linked_call
from ....framework.jit.records.record_type import record_code
from ...records import STATE

# Values of ``state.unsound``: what was wrong with an answer of a plugin's function.
NOT_FINITE = 1
OUT_OF_TIME = 2  # a sweep's time is not from 0 to 1
ALONE = -1  # in place of a second row: the bounds of the first


TWO_ROWS: tuple[Kind, ...] = (INT,) * 4  # parameters of a, row a, parameters of b, row b


@cache
def evaluate_signature(dimensions: int) -> Signature:
    """(state, parameters of a, row a, parameters of b, row b, d) -> (hit, depth, normal, point)."""
    state, vector = record_kind(STATE, dimensions), floats(dimensions)
    contact = tuple_of(BOOL, FLOAT, vector, vector)
    return contact(state, *TWO_ROWS, vector)


@cache
def batch_signature(dimensions: int) -> Signature:
    """(state, start, stop) -> whether all answers were sound, see batches."""
    return INT(record_kind(STATE, dimensions), INT, INT)


@cache
def sweep_signature(dimensions: int) -> Signature:
    """(state, parameters of a, row a, parameters of b, row b, d, v) -> (hit, time)."""
    state, vector = record_kind(STATE, dimensions), floats(dimensions)
    return tuple_of(BOOL, FLOAT)(state, *TWO_ROWS, vector, vector)


@cache
def corner_signature(dimensions: int) -> Signature:
    """(state, parameters of a, row a, parameters of b, row b, d, slop) -> bool."""
    state, vector = record_kind(STATE, dimensions), floats(dimensions)
    return BOOL(state, *TWO_ROWS, vector, FLOAT)


@cache
def bounds_signature(dimensions: int) -> Signature:
    """(state, parameters, row) -> half extents."""
    return floats(dimensions)(record_kind(STATE, dimensions), INT, INT)


@cache
def moments_signature(dimensions: int) -> Signature:
    """(state, own parameters, row) -> measure, centre, means of products of coordinates."""
    count = 1 + dimensions + dimensions * (dimensions + 1) // 2
    return floats(count)(record_kind(STATE, dimensions), INT, INT)


@cache
def material_signature(dimensions: int) -> Signature:
    """(parameters, row, point, normal) -> (friction, restitution, surface velocity)."""
    vector = floats(dimensions)
    return tuple_of(FLOAT, FLOAT, vector)(INT, INT, vector, vector)


@cache
def rotated_signature(dimensions: int) -> Signature:
    """(state, own parameters, parameters as rotated, row, whether bodies are rotated) -> 0."""
    return INT(record_kind(STATE, dimensions), INT, INT, INT, BOOL)


@cache
def support_signature(dimensions: int) -> Signature:
    """(parameters, row, direction) -> farthest point of the core."""
    return floats(dimensions)(INT, INT, floats(dimensions))


@cache
def edge_signature(dimensions: int) -> Signature:
    """(parameters, row, normal, point, tilt) -> both ends of an edge, one after the other."""
    return floats(2 * dimensions)(INT, INT, floats(dimensions), floats(dimensions), FLOAT)


def rounding_signature() -> Signature:
    """(parameters, row) -> rounding."""
    return FLOAT(INT, INT)


def mixing_signature() -> Signature:
    """(a's value, b's value) -> that of the pair."""
    return FLOAT(FLOAT, FLOAT)


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

    return LazyIntrinsic(
        lambda: operation("call", 1 + len(signature_of(2).arguments), typing),
        label=lambda: f"calls {signature_of(2)}, {signature_of(3)}",
    )


call_evaluate = call_in_dimension(evaluate_signature)
call_batch = call_in_dimension(batch_signature)
call_sweep = call_in_dimension(sweep_signature)
call_corner = call_in_dimension(corner_signature)
call_bounds = call_in_dimension(bounds_signature)
call_moments = call_in_dimension(moments_signature)
call_material = call_in_dimension(material_signature)
call_rotated = call_in_dimension(rotated_signature)
call_support = call_in_dimension(support_signature)
call_edge = call_in_dimension(edge_signature)
call_rounding = linked_call(rounding_signature)
call_mixing = linked_call(mixing_signature)
