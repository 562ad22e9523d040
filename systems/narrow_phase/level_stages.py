"""The narrow phase where some body has several levels of geometry: level by level, the cheap one first."""

from __future__ import annotations

from ...framework.compilation import part
from ...framework.jit.records.record_type import zero_of
from ...framework.vectors import add, sub
from ..codes import OK
from ..shapes.dispatch import evaluate
from ..shapes.tolerances import contact_margin
from .manifolds import centre_offset


@part
def evaluate_levels_of(state, a, b, margin):
    """(dropped, hit, depth, normal, point) of two bodies; the last level gives the contact, a pair hits if all do.

    dropped: a rotated level reaches out of one that misses, so that the two are kept apart in this step.
    """
    bodies = state.bodies
    position, levels, offsets = bodies.position, bodies.levels, bodies.level_offsets
    hit, depth, normal, point = False, 0.0, zero_of(state), zero_of(state)
    missed, first_hit = 0.0, False  # depth of the level that keeps them apart
    last = state.level_count - 1
    for level in range(last + 1):
        shape_a, shape_b = levels[level, a], levels[level, b]
        d = sub(add(position[b], offsets[level, b]), add(position[a], offsets[level, a]))
        hit, depth, normal, point = evaluate(state, shape_a, a, shape_b, b, d)
        if level == last or (shape_a == levels[last, a] and shape_b == levels[last, b]):
            break
        if level == 0:
            state.first_level_tests += 1
            first_hit = hit
            state.first_level_hits += 1 if hit else 0
        if not hit:
            missed = min(missed, depth)
            if depth < -margin and not (bodies.level_not_enclosing[a] or bodies.level_not_enclosing[b]):
                break
    dropped = missed < 0.0 and depth > missed and (bodies.level_not_enclosing[a] or bodies.level_not_enclosing[b])
    hit = hit and not missed < 0.0
    if first_hit and (dropped or not hit):
        state.false_positives += 1
    return dropped, hit, depth, normal, point


def evaluate_levels(state, dt):
    """Every pair level by level; pairs that a rotated level keeps apart are dropped."""
    pairs = state.pairs
    if not state.several_levels:
        return OK
    span, kept = dt if state.moved else 0.0, 0
    for c in range(pairs.count):
        a, b, solid = pairs.a[c], pairs.b[c], pairs.is_solid[c]
        margin = contact_margin(state, span, a, b) if span > 0.0 and solid else 0.0
        dropped, hit, depth, normal, point = evaluate_levels_of(state, a, b, margin)
        pairs.a[kept], pairs.b[kept], pairs.is_solid[kept] = a, b, solid
        pairs.hit[kept], pairs.depth[kept] = hit, depth
        pairs.at[kept], pairs.normal[kept], pairs.point[kept] = centre_offset(state.bodies, a, b), normal, point
        pairs.early[kept] = False
        kept += 0 if dropped else 1
    pairs.count = kept
    return OK
