"""Which bodies joints connect with each other: a group of bodies that can be moved, and the rows that hold them."""

from __future__ import annotations

from ...framework.compilation import inlined, part
from ..codes import OK
from ..islands import join_roots, root_of
from ..parts.rows import owner_of
from .records import HOLD, NOT_JOINED


@inlined
def may_move(state, i):
    """Whether row i is a body that may move in this step."""
    return 0 <= i < state.dynamic and state.bodies.inverse_mass[i] > 0.0


@part
def join_held(state):
    """``joined`` of all bodies: their first one, what cannot be moved joins none. Chains the rows of a group: that body
    has -2 less the place of the first of them, then follows stream[it], till -1. Parts have what their body has."""
    joints, joined = state.solver.joints, state.bodies.joined
    for i in range(state.count):
        joined[i] = NOT_JOINED
    for e in range(joints.active):
        for i in (joints.row_a[joints.order[e]], joints.row_b[joints.order[e]]):
            if may_move(state, i):
                joined[owner_of(state, i)] = owner_of(state, i)
    for e in range(joints.active):
        a, b = joints.row_a[joints.order[e]], joints.row_b[joints.order[e]]
        if may_move(state, a) and may_move(state, b):
            join_roots(joined, owner_of(state, a), owner_of(state, b))
    for i in range(state.dynamic):
        if joined[i] >= 0:
            joined[i] = root_of(joined, i)
    for e in range(joints.active - 1, -1, -1):
        a, b = joints.row_a[joints.order[e]], joints.row_b[joints.order[e]]
        i = owner_of(state, a if may_move(state, a) else b)
        i = joined[i] if joined[i] >= 0 else i
        joints.stream[e] = -2 - joined[i] if joined[i] < 0 else -1
        joined[i] = -2 - e
    for i in range(state.count if state.has_parts else 0):
        joined[i] = joined[owner_of(state, i)]


@inlined
def group_of(state, i):
    """The bodies that joints connect with row i, by the first place of their rows in ``order``; -1: none, or it cannot
    be moved."""
    joined, k = state.bodies.joined, i
    if i < 0 or joined[i] == NOT_JOINED:
        return -1
    return -2 - (joined[joined[k]] if joined[k] >= 0 else joined[k])


@inlined
def is_joined(state, a, b):
    """Whether joints hold one of two bodies that can be moved."""
    joined = state.bodies.joined
    return state.solver.joints.active > 0 and (joined[a] != NOT_JOINED or joined[b] != NOT_JOINED)


def mark_joined(state, dt):
    """What joints hold is ``warm_started``; ``swings`` what nothing else holds, nor drives."""
    joints, bodies = state.solver.joints, state.bodies
    for e in range(joints.active):
        for i in (joints.row_a[joints.order[e]], joints.row_b[joints.order[e]]):
            if i >= 0:
                bodies.swings[owner_of(state, i)] = not bodies.warm_started[owner_of(state, i)]
    for e in range(joints.active):
        j = joints.order[e]
        for i in (joints.row_a[j], joints.row_b[j]):
            if i >= 0 and state.bodies.inverse_mass[owner_of(state, i)] > 0.0:
                bodies.warm_started[owner_of(state, i)] = True
                bodies.swings[owner_of(state, i)] &= joints.rule[j] == HOLD
    return OK
