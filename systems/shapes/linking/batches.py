"""The narrow phase of a run of candidates that are all of one pair of shapes.

A candidate names its bodies in the order of their ids. The pair's function wants them in the order in which the pair is
registered, so they are turned round before it and its answer after it: once where the bodies do not come in the order
of their shapes (``swapped``), once where the pair is registered against that order (``flipped``).
"""

from __future__ import annotations

from typing import Any

from ....framework.compilation import inlined
from ....framework.vectors import add, negative, sub
from .signatures import call_evaluate


@inlined
def centres_of(state, a, b):
    """(centre of a's shape, vector from there to that of b's)."""
    bodies = state.bodies
    centre = add(bodies.position[a], bodies.offset[a])
    return centre, sub(add(bodies.position[b], bodies.offset[b]), centre)


@inlined
def in_given_order(state, c, first, flipped):
    """(swapped, a, b, centre, d) of candidate c, both of one shape."""
    a, b = state.pairs.a[c], state.pairs.b[c]
    centre, d = centres_of(state, a, b)
    return False, a, b, centre, d


@inlined
def in_order_of_shapes(state, c, first, flipped):
    """(swapped, a, b, centre, d) of candidate c as the pair's function takes it; ``first``: the cheaper shape.

    The centre is that of the candidate's own first body, d leads from the centre of a to that of b.
    """
    a, b = state.pairs.a[c], state.pairs.b[c]
    centre, d = centres_of(state, a, b)
    swapped = state.bodies.shape[a] != first
    if swapped != flipped:
        return swapped, b, a, centre, negative(d)
    return swapped, a, b, centre, d


@inlined
def turned_back(swapped, flipped, d, contact):
    """The contact as a caller sees it that may have swapped the bodies of a pair that may be flipped; d as the function
    had it. Turning round twice rounds the point twice."""
    hit, depth, normal, point = contact
    if swapped != flipped:
        return hit, depth, negative(normal), sub(point, d)
    if swapped:
        return hit, depth, normal, sub(sub(point, d), negative(d))
    return contact


@inlined
def write_contact(state, c, centre, contact):
    """Store a contact as the candidate's first body sees it, its point in the world."""
    hit, depth, normal, point = contact
    pairs = state.pairs
    pairs.hit[c], pairs.depth[c] = hit, depth
    pairs.normal[c], pairs.point[c] = normal, add(centre, point)


@inlined
def shapes_of(state, start):
    """(cheaper shape, costlier shape, whether the pair is flipped) of the candidates of a batch."""
    c = state.candidates.bucket[start]
    one = state.bodies.shape[state.pairs.a[c]]
    two = state.bodies.shape[state.pairs.b[c]]
    first, second = min(one, two), max(one, two)
    return first, second, state.shapes.flipped[first * state.shapes.count + second]


@inlined
def parameters_of(state, first, second, flipped):
    """Addresses of the parameter records, in the order of the pair."""
    one, two = state.shapes.parameters[first], state.shapes.parameters[second]
    return (two, one) if flipped else (one, two)


def make_batch(contact: Any, checked: Any, order: Any, at_a: Any, at_b: Any) -> Any:
    """A batch around a pair's function, which is compiled into its loop."""

    def batch(state, start, stop):
        if start >= stop:
            return 0
        first, second, flipped = shapes_of(state, start)
        pa, pb = parameters_of(state, first, second, flipped)
        one, two = at_a(pa), at_b(pb)
        for k in range(start, stop):
            c = state.candidates.bucket[k]
            swapped, a, b, centre, d = order(state, c, first, flipped)
            state.row_a, state.row_b = a, b
            found = checked(state, a, b, d, contact(one, a, two, b, d))
            write_contact(state, c, centre, turned_back(swapped, flipped, d, found))
        return 0

    return batch


def batch_by_address(state, start, stop):
    """A batch for pairs whose functions are long: they are compiled once, and called for each candidate."""
    if start >= stop:
        return 0
    first, second, flipped = shapes_of(state, start)
    pa, pb = parameters_of(state, first, second, flipped)
    address = state.shapes.evaluate[first * state.shapes.count + second]
    for k in range(start, stop):
        c = state.candidates.bucket[k]
        swapped, a, b, centre, d = in_order_of_shapes(state, c, first, flipped)
        found = call_evaluate(address, state, pa, a, pb, b, d)
        write_contact(state, c, centre, turned_back(swapped, flipped, d, found))
    return 0
