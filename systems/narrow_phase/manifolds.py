"""Manifolds: the contact of a pair, made once in a step and read for as long as the two hardly move to each other.

A manifold is a plane: normal, depth and point where the centres of the two shapes were ``at`` from each other. Pairs
that rested in the step before have theirs where the step starts, all others where free flight leads. Elsewhere the
depth follows from the plane, up to the curvature of the shapes.
"""

from __future__ import annotations

import math

from ...framework.compilation import inlined, part
from ...framework.vectors import add, add_scaled, dot, item, length, sub
from ..codes import OK
from ..shapes.dispatch import both_convex, evaluate
from ..shapes.tolerances import FLAT_SLOPS, PLANE_SIZES, SAME_PLACE, slop_for, turning_margin, way_of_turning


@inlined
def shape_centre(bodies, i):
    """Where the centre of the shape of body i is now."""
    return add(bodies.position[i], bodies.offset[i])


@inlined
def centre_offset(bodies, a, b):
    """From the centre of a's shape to that of b's, where they are now."""
    return sub(shape_centre(bodies, b), shape_centre(bodies, a))


@inlined
def centre_offset_at_start(bodies, a, b):
    """The same where the step starts."""
    position, offset = bodies.previous_position, bodies.offset
    return sub(add(position[b], offset[b]), add(position[a], offset[a]))


@part
def evaluate_pair(state, a, b, d):
    """The answer of the pair's function: (hit, depth, normal, point)."""
    shape = state.bodies.shape
    return evaluate(state, shape[a], a, shape[b], b, d)


@part
def make_manifold(state, c, d):
    """The manifold of pair c where the centres are d apart."""
    pairs = state.pairs
    hit, depth, normal, point = evaluate_pair(state, pairs.a[c], pairs.b[c], d)
    pairs.at[c], pairs.hit[c], pairs.depth[c], pairs.normal[c], pairs.point[c] = d, hit, depth, normal, point


@inlined
def forget_manifold(pairs, c):
    """The pair is not where its manifold was made, and has another normal."""
    pairs.at[c], pairs.depth[c] = add_scaled(pairs.at[c], pairs.at[c], math.nan), 0.0


@inlined
def has_manifold(pairs, c):
    """Whether a manifold of the pair has been made, and is not forgotten."""
    first = item(pairs.at[c], 0)
    return first == first


@inlined
def is_at_manifold(pairs, c, d, extent):
    """Whether d is where the manifold was made, so that all of it holds there."""
    move, nearest = sub(d, pairs.at[c]), SAME_PLACE * extent
    return dot(move, move) <= nearest * nearest


@inlined
def depth_by_plane(pairs, c, d):
    """The depth where the centres are d apart, as far as the surfaces are flat."""
    return pairs.depth[c] - dot(sub(d, pairs.at[c]), pairs.normal[c])


@part
def depth_bound(pairs, c, d):
    """The most that the depth may be where the centres are d apart: nothing gets deeper by more than it moves."""
    depth = pairs.depth[c]
    return depth + length(sub(d, pairs.at[c])) if depth > -math.inf else math.inf


@part
def depth_bound_on_path(state, c):
    """The most that the depth may be anywhere on the way of the step, however the two are turned there; infinity if
    one has had an impact, which leads it elsewhere."""
    bodies, pairs = state.bodies, state.pairs
    a, b = pairs.a[c], pairs.b[c]
    if bodies.impact_count[a] + bodies.impact_count[b] > 0:
        return math.inf
    depth = depth_bound(pairs, c, centre_offset_at_start(bodies, a, b))
    depth = max(depth, depth_bound(pairs, c, centre_offset(bodies, a, b)))
    return depth + way_of_turning(bodies, a, bodies.turn[a]) + way_of_turning(bodies, b, bodies.turn[b])


@part
def is_plane_reliable(state, c, d, extent):
    """Whether the plane gives the depth there, but for a small part of the slop.

    What goes by t along the plane of two round shapes gets nearer by t^2 / 2 extent, or less. Of a concave shape
    another face may be the nearest there.
    """
    pairs, bodies = state.pairs, state.bodies
    move = sub(d, pairs.at[c])
    along, square, most = dot(move, pairs.normal[c]), dot(move, move), PLANE_SIZES * extent
    flat = square - along * along <= 2.0 * extent * FLAT_SLOPS * slop_for(state, extent) and square <= most * most
    a, b = pairs.a[c], pairs.b[c]
    return flat and pairs.depth[c] > -math.inf and both_convex(state, bodies.shape[a], bodies.shape[b])


@part
def depth_at(state, c, d, extent, exact):
    """(depth, normal) where the centres are d apart: by the manifold if that tells, else by the pair's function.

    exact: as the function says; else but for a small part of the slop.
    """
    pairs = state.pairs
    if is_at_manifold(pairs, c, d, extent) or (not exact and is_plane_reliable(state, c, d, extent)):
        return depth_by_plane(pairs, c, d), pairs.normal[c]
    _, depth, normal, _ = evaluate_pair(state, pairs.a[c], pairs.b[c], d)
    return depth, normal


@inlined
def skip_before(rows, k, a, b):
    """The first row of the step before, from k on, of a pair of entities that is not before (a, b)."""
    now = rows.now
    while k < rows.counts[now] and (
        rows.entity_a[now, k] < a or (rows.entity_a[now, k] == a and rows.entity_b[now, k] < b)
    ):
        k += 1
    return k


@inlined
def is_of_pair(rows, k, a, b):
    """Whether there is a row k of the step before, and of that pair of entities."""
    now = rows.now
    return k < rows.counts[now] and rows.entity_a[now, k] == a and rows.entity_b[now, k] == b


@part
def mark_early(state):
    """Pairs that rested in the step before, and touched, are taken where this one starts. Both lists are in canonical
    order."""
    pairs, contacts, entity, now, k = state.pairs, state.contacts, state.bodies.entity, state.contacts.now, 0
    for c in range(pairs.count if state.moved and contacts.counts[now] > 0 else 0):
        a, b = entity[pairs.a[c]], entity[pairs.b[c]]
        k = skip_before(contacts, k, a, b)
        pairs.early[c] = is_of_pair(contacts, k, a, b) and contacts.rested[now, k] and pairs.is_solid[c]


@inlined
def is_near_manifold(state, span, c):
    """Whether a solid pair may touch within the step, by its depth where free flight leads."""
    pairs = state.pairs
    return pairs.is_solid[c] and pairs.depth[c] >= -turning_margin(state, span, pairs.a[c], pairs.b[c])


@part
def move_to_end(state, dt):
    """The contacts of the narrow phase become those where free flight leads."""
    pairs, bodies, found = state.pairs, state.bodies, 0
    if state.found_at_end:
        return
    state.found_at_end = True
    for h in range(pairs.found):
        c, near = pairs.hits[h], True
        if pairs.early[c]:
            make_manifold(state, c, centre_offset(bodies, pairs.a[c], pairs.b[c]))
            near = pairs.hit[c] or is_near_manifold(state, dt, c)
        if near:
            pairs.hits[found] = c
            found += 1
    pairs.found = found


@part
def move_to_start(state):
    """The response finds what it would have found if the contacts had not been read."""
    pairs, bodies = state.pairs, state.bodies
    for c in range(pairs.count if state.found_at_end else 0):
        if pairs.early[c]:
            make_manifold(state, c, centre_offset_at_start(bodies, pairs.a[c], pairs.b[c]))


def finish_found(state, dt):
    """The same as a stage, for code that reads these contacts."""
    move_to_end(state, dt)
    return OK
