"""The narrow phase of a run of candidates that are all of one pair of shapes.

Each gets a manifold: the contact, and where the two shapes were to each other then. Pairs that rested in the step
before are taken where the step starts (``early``), all others where free flight leads.

A candidate names its bodies in the order of their ids. The pair's function wants them in the order in which the pair is
registered, so they are turned round before it and its answer after it: once where the bodies do not come in the order
of their shapes (``swapped``), once where the pair is registered against that order (``flipped``).

The order of the bodies is as good as random, and so a branch on it would be mispredicted for every second candidate:
both results are computed and one is chosen. Nor is there a branch for the check of an answer: the batch only notes
whether all were sound.
"""

from __future__ import annotations

import math
from typing import Any

from ....framework.compilation import inlined, part
from ....framework.vectors import add, dot, negative, sub
from .signatures import NOT_FINITE, call_evaluate

SOUND, UNSOUND = 0, 1  # what a batch returns


@inlined
def centres_apart(state, c, a, b):
    """From the centre of a's shape to that of b's."""
    bodies = state.bodies
    position = bodies.previous_position if state.pairs.early[c] else bodies.position
    return sub(add(position[b], bodies.offset[b]), add(position[a], bodies.offset[a]))


@inlined
def in_given_order(state, c, first, flipped):
    """(swapped, a, b, d, d) of candidate c, both of one shape."""
    a, b = state.pairs.a[c], state.pairs.b[c]
    d = centres_apart(state, c, a, b)
    return False, a, b, d, d


@inlined
def in_order_of_shapes(state, c, first, flipped):
    """(swapped, a, b, at, d) of candidate c as the pair's function takes it; ``first``: the cheaper shape.

    at: from the centre of the candidate's own first body to that of its second; d: from that of a to that of b.
    """
    a, b = state.pairs.a[c], state.pairs.b[c]
    at = centres_apart(state, c, a, b)
    opposite, swapped = negative(at), state.bodies.shape[a] != first
    turned = swapped != flipped
    return swapped, b if turned else a, a if turned else b, at, opposite if turned else at


@inlined
def turned_back(swapped, flipped, d, contact):
    """The contact as a caller sees it that may have swapped the bodies of a pair that may be flipped; d as the function
    had it. Turning round twice rounds the point twice."""
    hit, depth, normal, point = contact
    opposite, once = negative(normal), sub(point, d)
    twice, turned = sub(once, negative(d)), swapped != flipped
    back = twice if swapped else point
    return hit, depth, opposite if turned else normal, once if turned else back


@inlined
def is_sound(hit, depth, normal, point):
    """Whether what a pair's function returned is a contact, or a miss."""
    touches, size = bool(hit), depth + (dot(normal, normal) + dot(point, point))
    return (touches & math.isfinite(size)) | ((not touches) & (depth < math.inf))


@inlined
def checked(state, a, b, d, contact):
    """The contact as it is; a miss, and a note in the state, if it is not finite though the bodies are."""
    hit, depth, normal, point = contact
    if is_sound(hit, depth, normal, point):
        return hit, depth, normal, point
    if math.isfinite(dot(d, d)):
        state.unsound, state.unsound_a, state.unsound_b = NOT_FINITE, a, b
    return False, -math.inf, d, d


@inlined
def write_manifold(state, c, at, contact):
    """Store a contact as the candidate's first body sees it."""
    hit, depth, normal, point = contact
    pairs = state.pairs
    pairs.at[c], pairs.hit[c], pairs.depth[c] = at, hit, depth
    pairs.normal[c], pairs.point[c] = normal, point


@inlined
def shapes_of(state, start):
    """(cheaper shape, costlier shape, whether the pair is flipped) of the candidates of a batch."""
    c, shape = state.candidates.bucket[start], state.bodies.shape
    one, two = shape[state.pairs.a[c]], shape[state.pairs.b[c]]
    first, second = min(one, two), max(one, two)
    return first, second, state.shapes.flipped[first * state.shapes.count + second]


@inlined
def parameters_of(state, first, second, flipped):
    """Addresses of the parameter records, in the order of the pair."""
    parameters = state.shapes.parameters
    one, two = parameters[first], parameters[second]
    return (two, one) if flipped else (one, two)


def make_batch(contact: Any, order: Any, at_a: Any, at_b: Any) -> Any:
    """A batch around a pair's function, which is compiled into its loop.

    It returns UNSOUND if some answer is no contact; the contacts it has written are then of no use, and
    :func:`batch_by_address` has to write them once more.
    """

    def batch(state, start, stop):
        if start >= stop:
            return SOUND
        first, second, flipped = shapes_of(state, start)
        pa, pb = parameters_of(state, first, second, flipped)
        one, two = at_a(pa), at_b(pb)
        sound = True
        for k in range(start, stop):
            c = state.candidates.bucket[k]
            swapped, a, b, at, d = order(state, c, first, flipped)
            state.row_a, state.row_b = a, b
            hit, depth, normal, point = contact(one, a, two, b, d)
            sound &= is_sound(hit, depth, normal, point)
            write_manifold(state, c, at, turned_back(swapped, flipped, d, (hit, depth, normal, point)))
        return SOUND if sound else UNSOUND

    return batch


def batch_by_address(state, start, stop):
    """A batch that calls the pair's function for each candidate, and checks each answer.

    For pairs whose functions are long, which are compiled only once, and for batches with an answer that is no contact.
    """
    if start >= stop:
        return SOUND
    first, second, flipped = shapes_of(state, start)
    pa, pb = parameters_of(state, first, second, flipped)
    address = state.shapes.evaluate[first * state.shapes.count + second]
    for k in range(start, stop):
        c = state.candidates.bucket[k]
        swapped, a, b, at, d = in_order_of_shapes(state, c, first, flipped)
        found = call_evaluate(address, state, pa, a, pb, b, d)
        write_manifold(state, c, at, turned_back(swapped, flipped, d, found))
    return SOUND


repeat_batch = part(batch_by_address)
