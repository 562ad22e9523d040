"""Signatures of the functions that are linked to the shapes, and the calls that fit them in 2D and 3D."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from typing import Any

from ....framework.jit.kinds import BOOL, FLOAT, INT, Signature, floats, record_kind, tuple_of
from ....framework.jit.lazy import JIT, LazyIntrinsic, operation, types
from ....framework.jit.linking import linked_call
from ....framework.jit.records.record_type import record_code
from ...records import STATE

# Values of ``state.unsound``: what was wrong with an answer of a plugin's function.
NOT_FINITE = 1
OUT_OF_TIME = 2  # a sweep's time is not from 0 to 1
ALONE = -1  # in place of a second row: the bounds of the first


@cache
def signatures(dimensions: int) -> dict[str, Signature]:
    """By the names of the functions. Of a shape they take the address of its parameters and a row; of a pair those of
    a, then those of b."""
    state, vector = record_kind(STATE, dimensions), floats(dimensions)
    row, rows, moments = (INT,) * 2, (INT,) * 4, 1 + dimensions + dimensions * (dimensions + 1) // 2
    return {
        "evaluate": tuple_of(BOOL, FLOAT, vector, vector)(state, *rows, vector),  # (d): hit, depth, normal, point
        "batch": INT(state, INT, INT),  # (start, stop): whether all answers were sound, see batches
        "sweep": tuple_of(BOOL, FLOAT)(state, *rows, vector, vector),  # (d, v): hit, time
        "corner": BOOL(state, *rows, vector, FLOAT),  # (d, slop)
        "bounds": vector(state, *row),  # half extents
        "half_thickness": FLOAT(*row),  # the least half extent along the axes of its body
        "moments": floats(moments)(state, *row),  # of its own: measure, centre, means of products of coordinates
        # (point, normal): friction, restitution, surface velocity
        "material": tuple_of(FLOAT, FLOAT, vector)(*row, vector, vector),
        "rotated": INT(state, INT, INT, INT, BOOL),  # (own parameters, as rotated, row, whether bodies are rotated): 0
        "support": vector(*row, vector),  # (direction): farthest point of the core
        "edge": floats(2 * dimensions)(*row, vector, vector, FLOAT),  # (normal, point, tilt): both ends of an edge
        "rounding": FLOAT(*row),
        "mixed": FLOAT(FLOAT, FLOAT),  # (a's value, b's value): that of the pair
    }


def linked_signature(name: str, dimensions: int) -> Signature:
    """That of a function."""
    return signatures(dimensions)[name]


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


(
    call_evaluate, call_batch, call_sweep, call_corner, call_bounds, call_moments, call_material, call_rotated,
    call_support, call_edge,
) = (
    call_in_dimension(partial(linked_signature, name))
    for name in (
        "evaluate", "batch", "sweep", "corner", "bounds", "moments", "material", "rotated", "support", "edge",
    )
)  # fmt: skip
call_rounding, call_half_thickness, call_mixing = (
    linked_call(partial(linked_signature, name, 2)) for name in ("rounding", "half_thickness", "mixed")
)
